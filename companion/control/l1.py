"""L1 adaptive augmentation around the default law, against wind: what the paper `kim` adds to its linear controller.

    predictor   vh' = m (u + sigma - vh) + a          the autopilot's velocity loop as it should answer
    adaptation  sigma = -(e^-mT / (1 - e^-mT)) (vh - v)   piecewise constant: explains the error of one step T away
    control     a = a_base - m w / (s + w) sigma      only what the vehicle can follow is compensated

The compensation is sent as acceleration: PX4 adds it to its own demand. As a velocity it would be an error that PX4's integrator
works against. m is the gain of PX4's velocity loop, u the velocity and a the acceleration that are sent, v the measured output (the vehicle's
velocity), sigma the disturbance as if it were added to u. The base law is velocity.py without its integral and demand, which
would answer the same wind twice. Horizontal, W (NED).
"""

from __future__ import annotations

import math

import msgspec

from companion.config import Control
from companion.control.law import ControlInput, ControlOutput
from companion.control.limits import clipped
from companion.control.velocity import VelocityLaw
from companion.messages import Vec3

MODEL_GAIN_HZ = 1.8
"""MPC_XY_VEL_P_ACC of PX4."""


class AdaptiveLaw:
    """`controller = "l1"`: one estimator for each horizontal axis around the default law."""

    def __init__(self, config: Control) -> None:
        self._base = VelocityLaw(msgspec.structs.replace(config, integral_gain_hz2=0.0, demand_time_s=0.0))
        self._north = MatchedDisturbance(config.adaptive_bandwidth_hz, config.max_adaptive_m_s)
        self._east = MatchedDisturbance(config.adaptive_bandwidth_hz, config.max_adaptive_m_s)

    def reset(self) -> None:
        self._base.reset()
        self._north.reset()
        self._east.reset()

    def update(self, control: ControlInput) -> ControlOutput:
        base = self._base.update(control)
        u, a, v = base.velocity_ned_m_s, base.acceleration_ned_m_s2, control.velocity_ned_m_s
        if control.feedback:
            self._north.observe(v[0], control.dt_s)
            self._east.observe(v[1], control.dt_s)
        north, east = (MODEL_GAIN_HZ * axis.compensated_m_s for axis in (self._north, self._east))
        sent: Vec3 = (a[0] - north, a[1] - east, a[2])
        self._north.predict(u[0], sent[0], v[0], control.dt_s)
        self._east.predict(u[1], sent[1], v[1], control.dt_s)
        return ControlOutput(u, sent)


class MatchedDisturbance:
    """One axis: predictor, adaptation, low-pass at `bandwidth_hz` (rad/s over 2 pi), cut to `limit_m_s`."""

    def __init__(self, bandwidth_hz: float, limit_m_s: float) -> None:
        self._bandwidth_rad_s = math.tau * bandwidth_hz
        self._limit_m_s = limit_m_s
        self._sigma_m_s = 0.0
        self._predicted_m_s: float | None = None
        self.compensated_m_s = 0.0

    def reset(self) -> None:
        self._sigma_m_s, self._predicted_m_s, self.compensated_m_s = 0.0, None, 0.0

    def observe(self, velocity_m_s: float, dt_s: float) -> None:
        """Compare the prediction with what came; adapt."""
        if self._predicted_m_s is None:
            return
        kept = math.exp(-MODEL_GAIN_HZ * dt_s)
        error = self._predicted_m_s - velocity_m_s
        self._sigma_m_s = -kept / (1.0 - kept) * error
        share = 1.0 - math.exp(-self._bandwidth_rad_s * dt_s)
        filtered = self.compensated_m_s + share * (self._sigma_m_s - self.compensated_m_s)
        self.compensated_m_s = clipped(filtered, self._limit_m_s)

    def predict(self, sent_m_s: float, acceleration_m_s2: float, velocity_m_s: float, dt_s: float) -> None:
        """One step of the model. It starts where the vehicle is."""
        start = velocity_m_s if self._predicted_m_s is None else self._predicted_m_s
        steady = sent_m_s + self._sigma_m_s + acceleration_m_s2 / MODEL_GAIN_HZ
        self._predicted_m_s = steady + (start - steady) * math.exp(-MODEL_GAIN_HZ * dt_s)
