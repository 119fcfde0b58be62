"""Names how a flight ended, and measures the touchdown. Truth only; nothing here flies the vehicle.

Fed by the world: every millisecond while anything touches, every step otherwise. W local NED; errors in the pad frame.
A touchdown is the first contact with the deck's top of a spell of contacts; spells are apart when nothing touched for
`_SPELL_GAP_S`. An ending needs rest with stopped motors (or a vehicle that has turned over), so that sliding off, or
tipping after a good touchdown, is not called a landing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from sitl_stub.carriers.deck import DeckState
from sitl_stub.contact import ContactState, Quaternion, Vec3
from sitl_stub.scenario import Success

_SPELL_GAP_S = 1.0
_LASTING_S = 0.3
_GO_AROUND_S = 3.0
_AIRBORNE_S = 0.15
_AIRBORNE_GAP_M = 0.03
_FLOWN_GAP_M = 0.3
_CRASH_SPEED_M_S = 4.0
_TIPPED_TILT_RAD = math.radians(60.0)
_TIPPED_TIME_S = 1.0
_REST_SPEED_M_S = 0.15
# Armed with stopped motors for this long (kill switch, flight termination) is as good as disarmed.
_STOPPED_FOR_GOOD_S = 5.0


class Ending(StrEnum):
    """How a flight ended."""

    FLYING = "flying"
    """It has not."""
    ON_PAD = "on_pad"
    """Upright on the deck, motors stopped, carried."""
    OFF_PAD = "off_pad"
    """Upright on the ground (or in the water)."""
    TIPPED = "tipped"
    """Turned over on the deck or the ground."""
    SLID_OFF = "slid_off"
    """Stood on the deck, then left it without meaning to."""
    HIT_SIDE = "hit_side"
    """Struck a side of the deck and did not land after it."""
    FELL_AFTER_MOTORS_OFF = "fell_after_motors_off"
    """The motors were stopped in the air, and it did not come to rest on the deck."""
    CRASHED = "crashed"
    """Struck something too fast."""
    TIMEOUT = "timeout"
    """The scenario's time was up."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The ending and the numbers. Unset until there was a touchdown on the deck."""

    ending: Ending
    is_success: bool
    t_s: float
    touchdown_s: float | None = None
    touchdown_error_m: float | None = None
    """Horizontal distance (pad frame) of the vehicle's reference point from the pad's centre at touchdown."""
    touchdown_error_along_m: float | None = None
    """Its part along the pad's travel; positive: too far ahead."""
    touchdown_error_across_m: float | None = None
    """Its part to the right of the pad's travel."""
    final_error_m: float | None = None
    """The same at the end."""
    touchdown_relative_speed_horizontal_m_s: float | None = None
    touchdown_relative_speed_vertical_m_s: float | None = None
    """Positive: the vehicle came down on the deck."""
    touchdown_tilt_deg: float | None = None
    """Between the vehicle's and the deck's plane."""
    forced_disarm_in_air: bool = False
    """The motors stopped, not because of a landing, while nothing touched."""
    touchdowns: int = 0
    """Spells of contact with the deck's top."""

    @property
    def is_over(self) -> bool:
        return self.ending is not Ending.FLYING


@dataclass(frozen=True, slots=True)
class _Touchdown:
    t_s: float
    along_m: float
    across_m: float
    horizontal_m_s: float
    vertical_m_s: float
    tilt_deg: float


class Judge:
    """Watches one flight."""

    def __init__(self, success: Success, duration_limit_s: float, *, starts_in_air: bool) -> None:
        self._success = success
        self._limit_s = duration_limit_s
        self.limit_us = round(duration_limit_s * 1e6)
        """When the time is up, on the boot clock."""
        self._has_flown = starts_in_air
        self._touchdown: _Touchdown | None = None
        self._touchdowns = 0
        self._last_touch_s = -math.inf
        self._last_deck_touch_s = -math.inf
        self._ground_touch_s = math.inf
        self._deck_time_s = 0.0
        self._was_on_deck_lastingly = False
        self._hit_side = self._struck = self._fell = False
        self._motors_ran = False
        self._rest_s = self._overturned_s = self._stopped_s = 0.0
        self._ending = Ending.FLYING
        self._end_t_s = 0.0
        self._final_error_m: float | None = None

    @property
    def is_over(self) -> bool:
        return self._ending is not Ending.FLYING

    def update(
        self,
        t_s: float,
        dt_s: float,
        *,
        position_ned_m: Vec3,
        velocity_ned_m_s: Vec3,
        q_ned_frd: Quaternion,
        deck: DeckState,
        contact: ContactState,
        motors_run: bool,
        is_armed: bool,
    ) -> None:
        """Advance by `dt_s` to `t_s`."""
        if self.is_over:
            return
        if t_s >= self._limit_s:
            self._end(Ending.TIMEOUT, t_s, position_ned_m, deck)
            return
        touching = contact.is_touching
        relative = relative_velocity(position_ned_m, velocity_ned_m_s, deck)
        self._watch_motors(t_s, motors_run, touching, contact.gap_m)
        self._has_flown = self._has_flown or (motors_run and not touching and contact.gap_m > _FLOWN_GAP_M)
        if not touching or not self._has_flown:
            self._rest_s = self._overturned_s = 0.0
            return
        self._watch_impact(t_s, relative, velocity_ned_m_s, contact)
        if contact.feet_on_deck + contact.frame_on_deck:
            self._watch_deck(t_s, dt_s, position_ned_m, relative, q_ned_frd, deck)
        self._last_touch_s = t_s
        self._stopped_s = 0.0 if motors_run else self._stopped_s + dt_s
        is_off = not is_armed or self._stopped_s > _STOPPED_FOR_GOOD_S
        speed = math.hypot(*(relative if contact.feet_on_deck + contact.frame_on_deck else velocity_ned_m_s))
        at_rest = is_off and not motors_run and speed < _REST_SPEED_M_S
        self._rest_s = self._rest_s + dt_s if at_rest else 0.0
        overturned = upright_angle(q_ned_frd) > _TIPPED_TILT_RAD
        self._overturned_s = self._overturned_s + dt_s if overturned else 0.0
        self._decide(t_s, position_ned_m, deck, contact)

    def free(self, t_s: float, motors_run: bool) -> None:
        """The short way while nothing is near: only the time and the motors matter."""
        flies_on = motors_run and self._motors_ran and self._has_flown
        if (flies_on and t_s < self._limit_s) or self.is_over:
            return
        self._has_flown = self._has_flown or motors_run
        self._watch_motors(t_s, motors_run, touching=False, gap_m=math.inf)
        if t_s >= self._limit_s:
            self._ending, self._end_t_s = Ending.TIMEOUT, t_s

    def verdict(self, t_s: float) -> Verdict:
        touchdown = self._touchdown
        return Verdict(
            ending=self._ending,
            is_success=self._ending is Ending.ON_PAD and self._is_good_enough(),
            t_s=self._end_t_s if self.is_over else t_s,
            touchdown_s=touchdown.t_s if touchdown else None,
            touchdown_error_m=math.hypot(touchdown.along_m, touchdown.across_m) if touchdown else None,
            touchdown_error_along_m=touchdown.along_m if touchdown else None,
            touchdown_error_across_m=touchdown.across_m if touchdown else None,
            final_error_m=self._final_error_m,
            touchdown_relative_speed_horizontal_m_s=touchdown.horizontal_m_s if touchdown else None,
            touchdown_relative_speed_vertical_m_s=touchdown.vertical_m_s if touchdown else None,
            touchdown_tilt_deg=touchdown.tilt_deg if touchdown else None,
            forced_disarm_in_air=self._fell,
            touchdowns=self._touchdowns,
        )

    def _is_good_enough(self) -> bool:
        touchdown, s = self._touchdown, self._success
        if touchdown is None:
            return False
        error_m = math.hypot(touchdown.along_m, touchdown.across_m)
        error_ok = s.max_touchdown_error_m is None or error_m <= s.max_touchdown_error_m
        return error_ok and touchdown.vertical_m_s <= s.max_vertical_speed_m_s

    def _watch_motors(self, t_s: float, motors_run: bool, touching: bool, gap_m: float) -> None:
        stopped = self._motors_ran and not motors_run
        self._motors_ran = motors_run
        airborne = not touching and t_s - self._last_touch_s > _AIRBORNE_S and gap_m > _AIRBORNE_GAP_M
        if stopped and airborne and self._has_flown:
            self._fell = True

    def _watch_impact(self, t_s: float, relative: Vec3, velocity: Vec3, contact: ContactState) -> None:
        on_ground = contact.feet_on_ground + contact.frame_on_ground > 0
        felt = velocity if on_ground and not contact.feet_on_deck else relative
        if on_ground:
            self._ground_touch_s = min(self._ground_touch_s, t_s)
        is_first = t_s - self._last_touch_s > _AIRBORNE_S
        if is_first and math.hypot(*felt) > _CRASH_SPEED_M_S and felt[2] > 0.5 * _CRASH_SPEED_M_S:
            self._struck = True
        if contact.frame_on_deck + contact.frame_on_ground and is_first:
            self._struck = True
        if contact.side_hits:
            self._hit_side = True

    def _watch_deck(
        self, t_s: float, dt_s: float, position: Vec3, relative: Vec3, q_ned_frd: Quaternion, deck: DeckState
    ) -> None:
        if t_s - self._last_deck_touch_s > _SPELL_GAP_S:
            self._touchdowns += 1
            self._deck_time_s = 0.0
            self._hit_side = False
            horizontal = math.hypot(relative[0], relative[1])
            tilt = math.degrees(tilt_between(q_ned_frd, deck))
            self._touchdown = _Touchdown(t_s, *pad_offset(position, deck), horizontal, relative[2], tilt)
        self._last_deck_touch_s, self._ground_touch_s = t_s, math.inf
        self._deck_time_s += dt_s
        self._was_on_deck_lastingly = self._deck_time_s >= _LASTING_S

    def _decide(self, t_s: float, position: Vec3, deck: DeckState, contact: ContactState) -> None:
        if self._overturned_s >= _TIPPED_TIME_S:
            self._end(self._cause(Ending.TIPPED), t_s, position, deck)
        elif self._rest_s >= self._success.settle_s:
            on_deck = contact.feet_on_deck + contact.frame_on_deck > 0
            self._end(Ending.ON_PAD if on_deck else self._cause(Ending.OFF_PAD), t_s, position, deck)

    def _cause(self, otherwise: Ending) -> Ending:
        """What went wrong first, for a vehicle that is not upright on the deck."""
        if self._fell:
            return Ending.FELL_AFTER_MOTORS_OFF
        if self._struck:
            return Ending.CRASHED
        if self._hit_side:
            return Ending.HIT_SIDE
        if self._was_on_deck_lastingly and otherwise is Ending.OFF_PAD and not self._flew_on():
            return Ending.SLID_OFF
        return otherwise

    def _flew_on(self) -> bool:
        """It left the deck and flew for long before it touched the ground: a go-around, not a slide."""
        return self._ground_touch_s - self._last_deck_touch_s > _GO_AROUND_S

    def _end(self, ending: Ending, t_s: float, position: Vec3, deck: DeckState) -> None:
        self._ending, self._end_t_s = ending, t_s
        self._final_error_m = pad_distance(position, deck)


def relative_velocity(position: Vec3, velocity: Vec3, deck: DeckState) -> Vec3:
    """Velocity of the vehicle against the point of the (rotating) deck under it, in W."""
    o, u, w = deck.position_ned_m, deck.velocity_ned_m_s, deck.angular_velocity_ned_rad_s
    dx, dy, dz = position[0] - o[0], position[1] - o[1], position[2] - o[2]
    return (
        velocity[0] - u[0] - w[1] * dz + w[2] * dy,
        velocity[1] - u[1] - w[2] * dx + w[0] * dz,
        velocity[2] - u[2] - w[0] * dy + w[1] * dx,
    )


def pad_distance(position: Vec3, deck: DeckState) -> float:
    """Distance from the pad's centre in the plane of the pad."""
    return math.hypot(*pad_offset(position, deck))


def pad_offset(position: Vec3, deck: DeckState) -> tuple[float, float]:
    """From the pad's centre in the plane of the pad: along its travel, and to the right of it."""
    r, o = deck.rotation_ned_deck, deck.position_ned_m
    dx, dy, dz = position[0] - o[0], position[1] - o[1], position[2] - o[2]
    return r[0] * dx + r[3] * dy + r[6] * dz, r[1] * dx + r[4] * dy + r[7] * dz


def upright_angle(q_ned_frd: Quaternion) -> float:
    """Angle between the vehicle's up and the world's, rad."""
    _, x, y, _ = q_ned_frd
    return math.acos(min(max(1.0 - 2.0 * (x * x + y * y), -1.0), 1.0))


def tilt_between(q_ned_frd: Quaternion, deck: DeckState) -> float:
    """Angle between the vehicle's up and the deck's, rad."""
    w, x, y, z = q_ned_frd
    r = deck.rotation_ned_deck
    cosine = r[2] * 2.0 * (x * z + w * y) + r[5] * 2.0 * (y * z - w * x) + r[8] * (1.0 - 2.0 * (x * x + y * y))
    return math.acos(min(max(cosine, -1.0), 1.0))
