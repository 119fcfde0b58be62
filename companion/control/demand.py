"""The acceleration that steady flight costs here and now: drag at speed, wind, a tilt that the autopilot believes wrongly.

    demand = low-pass( thrust acceleration - acceleration )        horizontal, W (NED), m/s2

The thrust acceleration follows from the autopilot's attitude (a vehicle that keeps its height pulls g tan(tilt) sideways),
the acceleration from its velocity; both are the autopilot's own, so the demand is what *its* loop has to hold. Sent as
feed-forward it leaves PX4's velocity integrator (0.4 1/s2 behind a gain of 1.8 1/s: 4.5 s) nothing to wind up. What is sent
does not enter what is measured: thrust and acceleration both contain it and it cancels, so that the estimate cannot oscillate.
Used by velocity.py.
"""

from __future__ import annotations

from companion.control.limits import clipped
from companion.geometry import ZERO, rotate
from companion.messages import Quaternion, Vec3

GRAVITY_M_S2 = 9.80665

LEAST_UPRIGHT = 0.3
"""Cosine of the tilt beyond which the balance of the vertical says nothing about the horizontal."""


class SteadyDemand:
    """Low-pass with time constant `time_s`, cut to `limit_m_s2`. State: filtered thrust acceleration and velocity."""

    def __init__(self, time_s: float, limit_m_s2: float) -> None:
        self._time_s = time_s
        self._limit_m_s2 = limit_m_s2
        self._filtered: tuple[float, float, float, float] | None = None
        self._demand_m_s2: Vec3 = ZERO
        self._trust = 0.0

    @property
    def acceleration_ned_m_s2(self) -> Vec3:
        """What to add to the acceleration that is asked for; zero at first, in full after a few time constants."""
        x, y, _ = self._demand_m_s2
        return (self._trust * x, self._trust * y, 0.0)

    def reset(self) -> None:
        self._filtered, self._demand_m_s2, self._trust = None, ZERO, 0.0

    def update(self, velocity_ned_m_s: Vec3, q_ned_frd: Quaternion, dt_s: float) -> None:
        """One more sample of the vehicle's own state."""
        ax, ay = thrust_acceleration(q_ned_frd)
        vx, vy, _ = velocity_ned_m_s
        if self._filtered is None:
            self._filtered = (ax, ay, vx, vy)
            return
        share = dt_s / (self._time_s + dt_s)
        fax, fay, fvx, fvy = self._filtered
        self._filtered = fax, fay, fvx, fvy = (
            fax + share * (ax - fax),
            fay + share * (ay - fay),
            fvx + share * (vx - fvx),
            fvy + share * (vy - fvy),
        )
        limit = self._limit_m_s2
        x = fax - (vx - fvx) / self._time_s
        y = fay - (vy - fvy) / self._time_s
        self._demand_m_s2 = (clipped(x, limit), clipped(y, limit), 0.0)
        self._trust += share * (1.0 - self._trust)


def thrust_acceleration(q_ned_frd: Quaternion) -> tuple[float, float]:
    """Horizontal acceleration (north, east) from the thrust of a vehicle that holds its height with this attitude."""
    down = rotate(q_ned_frd, (0.0, 0.0, 1.0))
    upright = max(LEAST_UPRIGHT, down[2])
    return -GRAVITY_M_S2 * down[0] / upright, -GRAVITY_M_S2 * down[1] / upright
