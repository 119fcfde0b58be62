"""Does the vehicle stand on the pad? Evidence for and against, gathered every tick.

PX4's own land detector looks at absolute velocity and so never reports a landing on a deck that moves faster than
LNDMC_XY_VEL_MAX; its landed state after a forced disarm is always ON_GROUND and proves nothing. So five independent signs
are asked for, and all must hold together for `touchdown_time_s` while a descent is being commanded:

  height     the feet are at the deck (range sensor where it sees the deck, else the estimate)
  sinking    the vehicle does not sink against the pad although it is told to
  thrust     the autopilot has let the collective thrust fall well below what hovering takes
  carried    no horizontal motion against the pad, as far as the pad's motion is known: out of view of the last half metre a
             pad that turns is soon not where the estimate says, and the estimate says by how much it may be wrong
  level      the vehicle stands as the deck does: on one foot and leaning it still needs its motors, to come down on the others
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.config import Mission

HOVER_THRUST_TIME_S = 2.0
"""Time constant of the hover thrust average: slower than gusts, faster than the battery."""

CONTACT_MARGIN_M = 0.12
"""Above the legs' height the range sensor may still read on a deck: noise, tilt, legs that flex."""

DISBELIEF_M = 0.5
"""The estimate of the height may be this wrong at contact, not more."""

STILL_VERTICAL_M_S = 0.2
CARRIED_M_S = 0.5
CARRIED_SIGMAS, CARRIED_PART = 2.0, 0.5
"""Faster than CARRIED_M_S counts as carried where the pad's velocity is that uncertain, but never at more than this part of
the pad's own speed: a vehicle that stands on the ground while the pad drives on is not carried."""

LEVEL_RAD = math.radians(15.0)
"""Against the deck, as far as its tilt is known: more than legs that flex and a tilt badly seen explain."""

HELD_UP, SUSPECTED_AFTER_S = 0.4, 0.06
"""Sinks less than this part of what is commanded: something carries. Enough to press on, not to stop motors."""

LIGHT_THRUST = 0.75
"""Of the hover thrust: in the air this fraction would sink the vehicle at 2.5 m/s^2."""


@dataclass(frozen=True, slots=True)
class TouchdownEvidence:
    """`suspected`: the vehicle has probably touched. `proven_for_s`: how long all signs have held. `signs`: for the log."""

    suspected: bool
    airborne: bool
    proven_for_s: float
    signs: tuple[str, ...]


NO_EVIDENCE = TouchdownEvidence(suspected=False, airborne=True, proven_for_s=0.0, signs=())


@dataclass(frozen=True, slots=True)
class TouchdownSigns:
    """One tick's raw signs. `height_m` is above the pad, `range_m` the range sensor's fresh reading or None. Pad: horizontal
    speed over ground, and the standard deviation of its estimated velocity."""

    height_m: float | None
    range_m: float | None
    sink_rate_m_s: float | None
    relative_speed_m_s: float | None
    commanded_sink_m_s: float
    thrust_normalized: float | None
    lean_rad: float | None
    """Of the vehicle against the deck."""
    pad_speed_m_s: float = 0.0
    pad_velocity_sigma_m_s: float = 0.0

    @property
    def carried_within_m_s(self) -> float:
        """The relative speed below which the pad may be what carries the vehicle."""
        unsure = min(CARRIED_SIGMAS * self.pad_velocity_sigma_m_s, CARRIED_PART * self.pad_speed_m_s)
        return max(CARRIED_M_S, unsure)


class TouchdownDetector:
    """State: the hover thrust, and since when all signs hold."""

    def __init__(self, config: Mission) -> None:
        self._config = config
        self._hover_thrust: float | None = None
        self._proven_for_s = 0.0
        self._held_up_for_s = 0.0

    def learn_hover_thrust(self, thrust_normalized: float, *, dt_s: float) -> None:
        """Called while the vehicle flies level and free; a first-order average."""
        if self._hover_thrust is None:
            self._hover_thrust = thrust_normalized
        self._hover_thrust += (thrust_normalized - self._hover_thrust) * min(1.0, dt_s / HOVER_THRUST_TIME_S)

    def update(self, signs: TouchdownSigns, *, dt_s: float) -> TouchdownEvidence:
        """Weigh one tick."""
        at_deck = self._at_deck(signs)
        sinking = signs.sink_rate_m_s
        still = sinking is not None and abs(sinking) < STILL_VERTICAL_M_S
        carried = signs.relative_speed_m_s is not None and signs.relative_speed_m_s < signs.carried_within_m_s
        light = self._is_light(signs.thrust_normalized)
        level = signs.lean_rad is not None and signs.lean_rad < LEVEL_RAD
        pressing = signs.commanded_sink_m_s > 0.0
        held_up = sinking is not None and sinking < HELD_UP * signs.commanded_sink_m_s
        self._held_up_for_s = self._held_up_for_s + dt_s if at_deck and held_up and pressing else 0.0
        proven = at_deck and still and carried and light and level and pressing
        self._proven_for_s = self._proven_for_s + dt_s if proven else 0.0
        return TouchdownEvidence(
            suspected=self._held_up_for_s >= SUSPECTED_AFTER_S,
            airborne=self._is_airborne(signs),
            proven_for_s=self._proven_for_s,
            signs=self._words(signs) if proven else (),
        )

    def _at_deck(self, signs: TouchdownSigns) -> bool:
        limit = self._config.vehicle_leg_height_m + CONTACT_MARGIN_M
        if signs.height_m is None or signs.height_m > limit + DISBELIEF_M:
            return False  # a range sensor that is stuck must not end a flight by itself
        return (signs.height_m if signs.range_m is None else signs.range_m) < limit

    def _is_airborne(self, signs: TouchdownSigns) -> bool:
        limit = self._config.vehicle_leg_height_m + 3.0 * CONTACT_MARGIN_M
        heights = [height for height in (signs.height_m, signs.range_m) if height is not None]
        return bool(heights) and min(heights) > limit

    def _is_light(self, thrust: float | None) -> bool:
        return thrust is not None and self._hover_thrust is not None and thrust < LIGHT_THRUST * self._hover_thrust

    def _words(self, s: TouchdownSigns) -> tuple[str, ...]:
        height = f"range {s.range_m:.2f} m" if s.range_m is not None else f"height {s.height_m or 0.0:.2f} m"
        return (
            f"{height} <= {self._config.vehicle_leg_height_m + CONTACT_MARGIN_M:.2f} m",
            f"sink rate {s.sink_rate_m_s or 0.0:.2f} m/s while {s.commanded_sink_m_s:.2f} m/s is commanded",
            f"thrust {s.thrust_normalized or 0.0:.2f} < {LIGHT_THRUST:.2f} x hover {self._hover_thrust or 0.0:.2f}",
            f"relative speed {s.relative_speed_m_s or 0.0:.2f} m/s < {s.carried_within_m_s:.2f} m/s",
            f"leans {math.degrees(s.lean_rad or 0.0):.0f} < {math.degrees(LEVEL_RAD):.0f} degrees against the deck",
        )
