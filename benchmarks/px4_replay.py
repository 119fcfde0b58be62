"""Replay of a recorded PX4 flight into the simulator's vehicle and cascade, with no noise and no estimate error.

PX4 steers by its estimate, so the vehicle starts from the *estimated* state in the last row before the command changes. The
integrators start where they hold that state: PX4's own also carried the estimator's errors (tilt bias, velocity drift), which do
not exist here. From then on only the recorded commands go in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, nan, sin

import numpy as np
from px4_recording import Array, Command, Recording

from sitl_stub.airframe import Airframe
from sitl_stub.autopilot.cascade import Cascade, FlightConstraints
from sitl_stub.autopilot.estimate import NO_ERRORS, Estimator
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.position_control import attitude_from_thrust
from sitl_stub.autopilot.setpoint import UNSET, TrajectorySetpoint
from sitl_stub.multirotor import GRAVITY_M_S2, Multirotor
from sitl_stub.rotation import roll_pitch_yaw

STEP_US = 4_000
_STREAM_US = 20_000
_BEFORE_S = 1.0
_IN_FLIGHT = FlightConstraints(armed=True, landed=False, maybe_landed=False)

RESPONSE = ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "p", "q", "r", "sp_roll", "sp_pitch", "sp_thrust")


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """What the simulator did: `columns` as in the recording, at `t_s`."""

    t_s: Array
    columns: dict[str, Array]

    def at(self, t_s: Array) -> dict[str, Array]:
        """Interpolated to other times (angles are unwrapped)."""
        return {name: np.interp(t_s, self.t_s, column) for name, column in self.columns.items()}


@dataclass(frozen=True, slots=True)
class Trim:
    """State in which the recorded vehicle was when the command changed."""

    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]
    acceleration_m_s2: tuple[float, float, float]
    """Estimated acceleration, mean of the second before."""
    velocity_error_m_s: tuple[float, float, float]
    """Velocity setpoint minus estimate, mean of the second before."""
    velocity_mean_m_s: tuple[float, float, float]
    yaw_rad: float
    hover_thrust: float


def trim_of(recording: Recording) -> Trim:
    """Read the state before the first new command."""
    last = recording.start
    t_s = recording.t_s
    before = slice(int(np.searchsorted(t_s, t_s[last] - _BEFORE_S)), last + 1)
    velocity = recording.vector("vx", "vy", "vz")[before]
    demand = recording.vector("px4sp_vx", "px4sp_vy", "px4sp_vz")[before]
    slope = np.polyfit(t_s[before] - t_s[last], velocity, 1)[0]
    c = recording.columns
    tilt = np.cos(c["sp_roll"][before]) * np.cos(c["sp_pitch"][before])
    hover = np.nanmedian(c["sp_thrust"][before] * tilt / (1.0 - c["px4sp_az"][before] / GRAVITY_M_S2))
    return Trim(
        _three(recording.vector("x", "y", "z")[last]),
        _three(velocity[-1]),
        _three(slope),
        _three(np.nanmean(demand - velocity, axis=0)),
        _three(velocity.mean(axis=0)),
        float(c["yaw"][last]),
        float(hover),
    )


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


class Replay:
    """One recording flown by the simulator."""

    def __init__(
        self, recording: Recording, airframe: Airframe, overrides: Mapping[str, float | int] | None = None
    ) -> None:
        self._recording = recording
        parameters = Parameters({**airframe.parameters, **(overrides or {})}).as_mapping()
        self._parameters = parameters
        self._cascade = Cascade(parameters)
        self._estimator = Estimator(parameters, np.random.default_rng(0), NO_ERRORS)
        self._body = self._trimmed(airframe, trim_of(recording))

    def _trimmed(self, airframe: Airframe, trim: Trim) -> Multirotor:
        """Body and cascade in the recorded state: thrust against weight, drag and the present acceleration."""
        drag = airframe.drag.linear_n_s_m[0] / airframe.mass_kg
        wanted = [a + drag * v for a, v in zip(trim.acceleration_m_s2, trim.velocity_mean_m_s, strict=True)]
        hover, cascade, p = airframe.hover_signal, self._cascade, self._parameters
        lift = 1.0 - wanted[2] / GRAVITY_M_S2
        thrust = [hover * wanted[0] / GRAVITY_M_S2, hover * wanted[1] / GRAVITY_M_S2, -hover * lift]
        attitude, signal = attitude_from_thrust(*thrust, trim.yaw_rad)
        gains = [(p[f"MPC_{axis}_VEL_P_ACC"], p[f"MPC_{axis}_VEL_D_ACC"]) for axis in ("XY", "XY", "Z")]
        # The same thrust with PX4's own idea of the hover thrust.
        wanted[2] = GRAVITY_M_S2 * (1.0 - hover * lift / trim.hover_thrust)
        integral = [
            w - gain_p * e + gain_d * a
            for w, (gain_p, gain_d), e, a in zip(
                wanted, gains, trim.velocity_error_m_s, trim.acceleration_m_s2, strict=True
            )
        ]
        cascade.velocity_integral_m_s2 = _three(np.array(integral))
        cascade.start_in_flight(trim.hover_thrust, attitude, signal, trim.velocity_m_s, trim.acceleration_m_s2)
        body = Multirotor(
            airframe, trim.position_m, trim.velocity_m_s, attitude, motors=(signal, signal, signal, signal)
        )
        self._estimator.settle(body.truth())
        return body

    def run(self) -> Response:
        """Fly to the end of the recording."""
        recording = self._recording
        start_s, end_s = float(recording.t_s[recording.start]), float(recording.t_s[-1])
        rows: list[tuple[float, ...]] = []
        pending = list(recording.commands)
        setpoint, command = TrajectorySetpoint(), pending[0]
        sent_us = -_STREAM_US
        for tick in range(int((end_s - start_s) * 1e6 / STEP_US) + 1):
            t_us = tick * STEP_US
            estimate = self._estimator.step(t_us, self._body.truth(), STEP_US * 1e-6)
            is_new = False
            while pending and pending[0].t_s <= start_s + t_us * 1e-6 + 1e-4:
                command, is_new = pending.pop(0), True
            if is_new or t_us - sent_us >= _STREAM_US:
                setpoint, sent_us = _setpoint(command, estimate.yaw_rad), t_us
            motors = self._cascade.step(STEP_US * 1e-6, estimate, setpoint, _IN_FLIGHT)
            rows.append((start_s + t_us * 1e-6, *self._row()))
            self._body.step(STEP_US * 1e-6, motors)
        return _response(np.array(rows))

    def _row(self) -> tuple[float, ...]:
        body, cascade = self._body, self._cascade
        roll, pitch, yaw = roll_pitch_yaw(body.q_ned_frd)
        sp_roll, sp_pitch, _ = roll_pitch_yaw(cascade.attitude_setpoint)
        return (
            *body.position_ned_m,
            *body.velocity_ned_m_s,
            roll,
            pitch,
            yaw,
            *body.rates_frd_rad_s,
            sp_roll,
            sp_pitch,
            cascade.thrust_setpoint,
        )


def _setpoint(command: Command, yaw_rad: float) -> TrajectorySetpoint:
    """As PX4's receiver makes it: a body-frame velocity is turned by the present heading, its position ignored."""
    velocity, position = command.velocity_m_s, command.position_m
    if command.is_body_frame:
        c, s = cos(yaw_rad), sin(yaw_rad)
        velocity = (c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1], velocity[2])
        position = UNSET
    return TrajectorySetpoint(position, velocity, (nan, nan, nan), command.yaw_rad, command.yaw_rate_rad_s)


def _response(table: Array) -> Response:
    columns = {name: table[:, i + 1] for i, name in enumerate(RESPONSE)}
    columns["yaw"] = np.unwrap(columns["yaw"])
    return Response(table[:, 0], columns)
