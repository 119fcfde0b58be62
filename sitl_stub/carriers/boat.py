"""A boat: surge and yaw with lags (Nomoto's first-order yaw), drift with the current, and waves that lift and tilt it.

The hull follows the mean plane of the water under it (waves.py); its centre of rotation is on the waterline below the
middle of the hull, the pad's centre `pad_ahead_m` in front of it, so that pitch and roll also move the deck. Inertia of heave,
roll and pitch (resonance) is not modelled. Ground for contact is the mean water.
"""

from __future__ import annotations

import math

import numpy as np

from sitl_stub.carriers.guidance import follow, slew
from sitl_stub.carriers.motion import KNOT_S, Carrier, CarrierMotion
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.carriers.waves import Sea
from sitl_stub.carriers.wobble import Wobble
from sitl_stub.randomness import NormalDraws
from sitl_stub.section import NonNegative, Positive, Section


class BoatSettings(Section, frozen=True, tag_field="kind", tag="boat"):
    """[carrier] kind = "boat"."""

    length_m: Positive = 4.0
    beam_m: Positive = 1.8
    pad_ahead_m: float = 0.0
    speed_lag_s: Positive = 2.0
    yaw_lag_s: Positive = 1.5
    max_acceleration_m_s2: Positive = 0.8
    max_turn_rad_s: Positive = 0.5
    current_m_s: NonNegative = 0.0
    """Drift of the water, in a seeded direction."""
    significant_wave_height_m: NonNegative = 0.5
    peak_wave_period_s: Positive = 4.0
    wave_from_deg: float | None = None
    """Where the waves come from; absent: seeded."""
    yaw_swing_deg: NonNegative = 0.0
    """Heading swings by this much around the path's."""
    yaw_swing_period_s: Positive = 6.0
    turn_wobble_rad_s: NonNegative = 0.02

    def build(self, path: PlacedPath, deck_height_m: float, rng: np.random.Generator) -> Carrier:
        return Boat(self, path, deck_height_m, rng)


class Boat:
    """Follows its path through the water; the path drifts with the current."""

    def __init__(
        self, settings: BoatSettings, path: PlacedPath, deck_height_m: float, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._path = path
        self._deck_height_m = deck_height_m
        waves_from = rng.uniform(0.0, math.tau)
        if settings.wave_from_deg is not None:
            waves_from = math.radians(settings.wave_from_deg)
        self._sea = Sea(settings.significant_wave_height_m, settings.peak_wave_period_s, waves_from + math.pi, rng)
        current_toward = rng.uniform(0.0, math.tau)
        self._current = (
            settings.current_m_s * math.cos(current_toward),
            settings.current_m_s * math.sin(current_toward),
        )
        self._swing_phase_rad = rng.uniform(0.0, math.tau)
        draws = NormalDraws(rng)
        self._turn_wobble = Wobble(settings.turn_wobble_rad_s, 3.0, KNOT_S, draws)
        start = path.at(0.0)
        self._heading_rad, self._speed_m_s = start.heading_rad, start.speed_m_s
        self._turn_rad_s = start.speed_m_s * start.curvature_1_m
        self._north_m = start.north_m - settings.pad_ahead_m * math.cos(self._heading_rad)
        self._east_m = start.east_m - settings.pad_ahead_m * math.sin(self._heading_rad)
        self._offset = (self._north_m - start.north_m, self._east_m - start.east_m)
        self._knot = 0
        self._motion = self._deck_motion()

    def motion(self) -> CarrierMotion:
        return self._motion

    def advance(self) -> None:
        self._knot += 1
        v0, w0, h0 = self._speed_m_s, self._turn_rad_s, self._heading_rad
        self._steer(self._knot * KNOT_S)
        turn = 0.5 * (w0 + self._turn_rad_s) * KNOT_S
        way = 0.5 * (v0 + self._speed_m_s) * KNOT_S
        self._north_m += way * math.cos(h0 + 0.5 * turn) + self._current[0] * KNOT_S
        self._east_m += way * math.sin(h0 + 0.5 * turn) + self._current[1] * KNOT_S
        self._heading_rad = h0 + turn
        self._motion = self._deck_motion()

    def _steer(self, t_s: float) -> None:
        s = self._settings
        reference = self._path.at(t_s)
        swing_rate = math.tau / s.yaw_swing_period_s
        swing = math.radians(s.yaw_swing_deg)
        swung_rad = swing * math.sin(swing_rate * t_s + self._swing_phase_rad)
        north = self._north_m - self._offset[0] - self._current[0] * t_s
        east = self._east_m - self._offset[1] - self._current[1] * t_s
        settle_m = max(s.length_m, 4.0 * s.yaw_lag_s * self._speed_m_s)
        heading = self._heading_rad - swung_rad
        v, w = follow(reference, north, east, heading, lead_s=s.speed_lag_s, settle_m=settle_m)
        if reference.speed_m_s <= 0.0:
            # Without way the law has no authority over heading; an anchored boat still swings.
            w = 0.5 * math.remainder(reference.heading_rad + swung_rad - self._heading_rad, math.tau)
        w += swing * swing_rate * math.cos(swing_rate * t_s + self._swing_phase_rad) + self._turn_wobble.advance()
        w = min(max(w, -s.max_turn_rad_s), s.max_turn_rad_s)
        lagged = self._speed_m_s + (v - self._speed_m_s) * KNOT_S / (s.speed_lag_s + KNOT_S)
        self._speed_m_s = slew(self._speed_m_s, lagged, s.max_acceleration_m_s2 * KNOT_S)
        self._turn_rad_s += (w - self._turn_rad_s) * KNOT_S / (s.yaw_lag_s + KNOT_S)

    def _deck_motion(self) -> CarrierMotion:
        """The hull's pose from the water under it, then the lever arm to the pad (second order in the tilt left out
        of the position only where it is below a millimetre)."""
        s, h, v = self._settings, self._heading_rad, self._speed_m_s
        c, sn = math.cos(h), math.sin(h)
        velocity = (v * c + self._current[0], v * sn + self._current[1])
        t_s = self._knot * KNOT_S
        up, pitch, roll, up_rate, pitch_rate, roll_rate = self._sea.hull(
            t_s, self._north_m, self._east_m, velocity, h, s.length_m, s.beam_m
        )
        ahead, above = s.pad_ahead_m, self._deck_height_m
        # Nose up lifts what is ahead and moves what is above backwards; right side down moves what is above to the right.
        forward = ahead - above * pitch
        right = above * roll
        down = -(up + above + ahead * pitch)
        forward_rate, right_rate = -above * pitch_rate, above * roll_rate
        w = self._turn_rad_s
        north = self._north_m + c * forward - sn * right
        east = self._east_m + sn * forward + c * right
        north_rate = velocity[0] + c * (forward_rate - w * right) - sn * (right_rate + w * forward)
        east_rate = velocity[1] + sn * (forward_rate - w * right) + c * (right_rate + w * forward)
        return CarrierMotion(
            (north, east, down, roll, pitch, h),
            (north_rate, east_rate, -(up_rate + ahead * pitch_rate), roll_rate, pitch_rate, w),
        )

    def highest_deck_m(self) -> float:
        steepest = self._sea.largest_elevation_m()
        return self._deck_height_m + steepest + abs(self._settings.pad_ahead_m) * 0.5
