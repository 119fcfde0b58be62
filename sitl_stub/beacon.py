"""The pad's own GNSS on the air: a second MAVLink system that says where the pad is, with an error of its own.

HEARTBEAT (surface rover) at 1 Hz, GLOBAL_POSITION_INT at its rate, ODOMETRY beside it where the scenario asks. The error of
position is slow (Gauss-Markov) plus a little noise; what is sent was true `delay_s` earlier, and time_boot_ms says when. The
clock is the vehicle's, as if both were synchronised by GNSS. World asks for `frames` once a period.
"""

from __future__ import annotations

import math

import numpy as np

from sitl_stub import scenario
from sitl_stub.carriers.deck import DeckState
from sitl_stub.carriers.wobble import Wobble
from sitl_stub.geodesy import Origin
from sitl_stub.mavlink.definitions import GLOBAL_POSITION_INT, HEARTBEAT, ODOMETRY, MessageType
from sitl_stub.mavlink.frame import encode

_GROUND_ROVER, _INVALID_AUTOPILOT, _ACTIVE, _AUTOPILOT_COMPONENT = 10, 8, 4, 1
_LOCAL_NED, _BODY_FRD = 1, 12


class Beacon:
    """Speaks for one deck."""

    def __init__(self, settings: scenario.Beacon, origin: Origin, rng: np.random.Generator) -> None:
        self.period_us = round(1e6 / settings.rate_hz)
        self.is_lost = False
        self.jump_ned_m = (0.0, 0.0)
        self._settings = settings
        self._origin = origin
        self._rng = rng
        per_axis = settings.position_sigma_m / math.sqrt(2.0)
        period_s = 1.0 / settings.rate_hz
        self._north_error = Wobble(per_axis, settings.position_time_s, period_s, rng)
        self._east_error = Wobble(per_axis, settings.position_time_s, period_s, rng)
        self._up_error = Wobble(1.5 * per_axis, settings.position_time_s, period_s, rng)
        self._heading_error = Wobble(math.radians(settings.heading_sigma_deg), 20.0, period_s, rng)
        self._sequence = 0
        self._count = 0

    @property
    def delay_us(self) -> int:
        return round(self._settings.delay_s * 1e6)

    def frames(self, deck: DeckState, t_us: int) -> list[bytes]:
        """What the beacon sends for the deck as it was at `t_us`: once a period."""
        errors = self._errors()
        self._count += 1
        if self.is_lost:
            return []
        frames = [self._frame(GLOBAL_POSITION_INT, *self._global_position(deck, t_us, errors))]
        if (self._count - 1) % max(round(self._settings.rate_hz), 1) == 0:
            heartbeat = (0, _GROUND_ROVER, _INVALID_AUTOPILOT, 0, _ACTIVE, 3)
            frames.insert(0, self._frame(HEARTBEAT, *heartbeat))
        if self._settings.odometry_rate_hz > 0.0:
            frames.append(self._frame(ODOMETRY, *self._odometry(deck, t_us, errors)))
        return frames

    def _errors(self) -> tuple[float, float, float, float, float, float]:
        """North, east, up (m), heading (rad), north and east speed (m/s)."""
        s, noise = self._settings, self._rng.standard_normal(5).tolist()
        return (
            self._north_error.advance() + s.noise_sigma_m * noise[0] + self.jump_ned_m[0],
            self._east_error.advance() + s.noise_sigma_m * noise[1] + self.jump_ned_m[1],
            self._up_error.advance() + s.noise_sigma_m * noise[2],
            self._heading_error.advance(),
            s.velocity_sigma_m_s * noise[3],
            s.velocity_sigma_m_s * noise[4],
        )

    def _global_position(self, deck: DeckState, t_us: int, errors: tuple[float, ...]) -> tuple[int, ...]:
        n, e, d = deck.position_ned_m
        vn, ve, vd = deck.velocity_ned_m_s
        lat, lon = self._origin.to_global(n + errors[0], e + errors[1])
        up = -d + errors[2]
        heading = math.degrees(deck.rpy_rad[2] + errors[3]) % 360.0
        return (
            t_us // 1000,
            round(lat * 1e7),
            round(lon * 1e7),
            round((self._origin.altitude_m + up) * 1000.0),
            round(up * 1000.0),
            round((vn + errors[4]) * 100.0),
            round((ve + errors[5]) * 100.0),
            round(vd * 100.0),
            round(heading * 100.0) % 36000,
        )

    def _odometry(self, deck: DeckState, t_us: int, errors: tuple[float, ...]) -> tuple[float | int, ...]:
        """Position and attitude in local NED; velocity in the carrier's body frame, as the message wants it."""
        n, e, d = deck.position_ned_m
        vn, ve = deck.velocity_ned_m_s[0] + errors[4], deck.velocity_ned_m_s[1] + errors[5]
        yaw = deck.rpy_rad[2] + errors[3]
        c, s = math.cos(yaw), math.sin(yaw)
        q = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
        sigma = self._settings.position_sigma_m / math.sqrt(2.0)
        pose_covariance = covariance(sigma**2, math.radians(self._settings.heading_sigma_deg) ** 2)
        velocity_covariance = covariance(self._settings.velocity_sigma_m_s**2, 0.0)
        velocity = (c * vn + s * ve, c * ve - s * vn, deck.velocity_ned_m_s[2])
        rates = (0.0, 0.0, deck.angular_velocity_ned_rad_s[2])
        return (
            t_us,
            n + errors[0],
            e + errors[1],
            d - errors[2],
            *q,
            *velocity,
            *rates,
            *pose_covariance,
            *velocity_covariance,
            _LOCAL_NED,
            _BODY_FRD,
            0,
            0,
            0,
        )

    def _frame(self, message: MessageType, *values: float | int) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        payload = message.struct.pack(*values)
        return encode(message, payload, self._sequence, self._settings.system_id, _AUTOPILOT_COMPONENT)


def covariance(position: float, heading: float) -> tuple[float, ...]:
    """The 21 entries of the upper triangle, row by row: variances of x, y, z and of yaw, the rest 0."""
    diagonal = {0: position, 6: position, 11: position, 20: heading}
    return tuple(diagonal.get(i, 0.0) for i in range(21))
