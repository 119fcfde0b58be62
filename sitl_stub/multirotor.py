"""The multirotor's true motion: rigid body, four rotors with first-order lag, drag against the air.

W local NED, B FRD, SI, plain floats. Integration as in PX4's SIH: velocity by forward Euler, position by trapezoid,
attitude by the exponential of the old rate, rates by forward Euler; good for steps of 1 to 4 ms. The rotor lag
tau u' = command - u is integrated the same way. `advance` is a pure function (numba compiles it); `Multirotor` keeps the
state for the world, which adds contact forces and wind.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

from sitl_stub.airframe import Airframe
from sitl_stub.compiled import COMPILED, used_by_kernels
from sitl_stub.rotation import Quaternion, Vec3, from_rotation_vector, multiply

GRAVITY_M_S2 = 9.80665
_MAX_RATE_RAD_S = 6.0 * 3.14159265  # as in SIH
_ZERO: Vec3 = (0.0, 0.0, 0.0)
_ALL_WELL = (1.0, 1.0, 1.0, 1.0)

Motors = tuple[float, float, float, float]


class BodyState(NamedTuple):
    """Everything that moves, flat."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    qw: float
    qx: float
    qy: float
    qz: float
    p: float
    q: float
    r: float
    u0: float
    u1: float
    u2: float
    u3: float


class Body(NamedTuple):
    """Constants of `advance`, from the airframe."""

    mass: float
    ixx: float
    iyy: float
    izz: float
    thrust: float
    torque: float
    arm_x: float
    arm_y: float
    lag: float
    curve: float
    drag_x: float
    drag_y: float
    drag_z: float
    drag2_x: float
    drag2_y: float
    drag2_z: float
    damping: float


class Loads(NamedTuple):
    """What acts from outside: velocity of the air in W, force in W, torque in B."""

    wind_x: float
    wind_y: float
    wind_z: float
    fx: float
    fy: float
    fz: float
    tx: float
    ty: float
    tz: float


@dataclass(slots=True)
class VehicleTruth:
    """What is true of the vehicle now. `specific_force_frd_m_s2` is what an ideal accelerometer reads."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    angular_velocity_frd_rad_s: Vec3
    specific_force_frd_m_s2: Vec3
    acceleration_ned_m_s2: Vec3
    on_surface: bool


def body_of(airframe: Airframe) -> Body:
    """Constants of the motion."""
    rotors, drag = airframe.rotors, airframe.drag
    return Body(
        airframe.mass_kg,
        *airframe.inertia_kg_m2,
        rotors.max_thrust_n,
        rotors.max_torque_nm,
        rotors.arm_forward_m,
        rotors.arm_right_m,
        rotors.time_constant_s,
        rotors.thrust_curve,
        *drag.linear_n_s_m,
        *drag.quadratic_n_s2_m2,
        drag.angular_nm_s,
    )


@used_by_kernels
def advance(
    s: tuple[float, ...], body: tuple[float, ...], command: Motors, health: Motors, loads: tuple[float, ...], dt: float
) -> tuple[tuple[float, ...], Vec3]:
    """One step from a BodyState, Body and Loads or their plain numbers (faster in a kernel); returns the new state's numbers and the acceleration in W that acted during it (gravity included).

    `command` are the motor commands 0..1, `health` the part of its thrust that each rotor still gives.
    """
    px, py, pz, vx, vy, vz, w, x, y, z, p, q, r, u0, u1, u2, u3 = s
    mass, ixx, iyy, izz, thrust, torque, arm_x, arm_y, lag, c, d_x, d_y, d_z, d2_x, d2_y, d2_z, damping = body
    wind_x, wind_y, wind_z, load_x, load_y, load_z, load_p, load_q, load_r = loads
    c0, c1, c2, c3 = command
    h0, h1, h2, h3 = health
    lag = dt / lag
    u0 = u0 + lag * (c0 - u0)
    u1 = u1 + lag * (c1 - u1)
    u2 = u2 + lag * (c2 - u2)
    u3 = u3 + lag * (c3 - u3)
    straight = 1.0 - c
    t0 = h0 * (straight * u0 + c * u0 * u0)
    t1 = h1 * (straight * u1 + c * u1 * u1)
    t2 = h2 * (straight * u2 + c * u2 * u2)
    t3 = h3 * (straight * u3 + c * u3 * u3)

    # R_WB and the air's velocity over the body, in B.
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    r00, r01, r02 = 1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)
    r10, r11, r12 = 2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)
    r20, r21, r22 = 2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)
    ax, ay, az = vx - wind_x, vy - wind_y, vz - wind_z
    bx, by, bz = r00 * ax + r10 * ay + r20 * az, r01 * ax + r11 * ay + r21 * az, r02 * ax + r12 * ay + r22 * az
    speed = sqrt(bx * bx + by * by + bz * bz)

    # Forces in B (thrust up, drag against the air), then acceleration in W.
    fx = -bx * (d_x + d2_x * speed)
    fy = -by * (d_y + d2_y * speed)
    fz = -bz * (d_z + d2_z * speed) - thrust * (t0 + t1 + t2 + t3)
    accel_x = (r00 * fx + r01 * fy + r02 * fz + load_x) / mass
    accel_y = (r10 * fx + r11 * fy + r12 * fz + load_y) / mass
    accel_z = (r20 * fx + r21 * fy + r22 * fz + load_z) / mass + GRAVITY_M_S2

    # Torques in B about the centre of gravity, with Euler's equations.
    tx = arm_y * thrust * (t1 + t2 - t0 - t3) - damping * p + load_p
    ty = arm_x * thrust * (t0 + t2 - t1 - t3) - damping * q + load_q
    tz = torque * (t0 + t1 - t2 - t3) - damping * r + load_r
    p_dot = (tx - (izz - iyy) * q * r) / ixx
    q_dot = (ty - (ixx - izz) * r * p) / iyy
    r_dot = (tz - (iyy - ixx) * p * q) / izz

    nw, nx, ny, nz = multiply((w, x, y, z), from_rotation_vector(p * dt, q * dt, r * dt))
    scale = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    p, q, r = p + p_dot * dt, q + q_dot * dt, r + r_dot * dt
    nvx, nvy, nvz = vx + accel_x * dt, vy + accel_y * dt, vz + accel_z * dt
    half = 0.5 * dt
    state = (
        px + half * (vx + nvx),
        py + half * (vy + nvy),
        pz + half * (vz + nvz),
        nvx,
        nvy,
        nvz,
        nw * scale,
        nx * scale,
        ny * scale,
        nz * scale,
        -_MAX_RATE_RAD_S if p < -_MAX_RATE_RAD_S else _MAX_RATE_RAD_S if p > _MAX_RATE_RAD_S else p,
        -_MAX_RATE_RAD_S if q < -_MAX_RATE_RAD_S else _MAX_RATE_RAD_S if q > _MAX_RATE_RAD_S else q,
        -_MAX_RATE_RAD_S if r < -_MAX_RATE_RAD_S else _MAX_RATE_RAD_S if r > _MAX_RATE_RAD_S else r,
        u0,
        u1,
        u2,
        u3,
    )
    return state, (accel_x, accel_y, accel_z)


class Multirotor:
    """State of one vehicle's body. `motor_health` (0..1 each) is for faults; `on_surface` is set by the contact model's caller."""

    def __init__(
        self,
        airframe: Airframe,
        position_ned_m: Vec3 = _ZERO,
        velocity_ned_m_s: Vec3 = _ZERO,
        q_ned_frd: Quaternion = (1.0, 0.0, 0.0, 0.0),
        rates_frd_rad_s: Vec3 = _ZERO,
        motors: Motors = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        self.airframe = airframe
        self.body = body_of(airframe)
        self._state = BodyState(*position_ned_m, *velocity_ned_m_s, *q_ned_frd, *rates_frd_rad_s, *motors)
        self._flat: Any = None
        self.motor_health: Motors = _ALL_WELL
        self.on_surface = False
        self._acceleration_ned_m_s2: Vec3 = (0.0, 0.0, 0.0)

    @property
    def position_ned_m(self) -> Vec3:
        return self.state[:3]

    @property
    def velocity_ned_m_s(self) -> Vec3:
        return self.state[3:6]

    @property
    def q_ned_frd(self) -> Quaternion:
        return self.state[6:10]

    @property
    def rates_frd_rad_s(self) -> Vec3:
        return self.state[10:13]

    def keep(self, flat: Any) -> None:
        """The state, then the acceleration, are in these numbers: looked at when somebody asks, or before the next `step`."""
        self._flat = flat

    def _look(self) -> None:
        flat, self._flat = self._flat, None
        numbers = flat.tolist() if COMPILED else flat
        self._state = BodyState._make(numbers[:17])
        self._acceleration_ned_m_s2 = (numbers[17], numbers[18], numbers[19])

    @property
    def state(self) -> BodyState:
        if self._flat is not None:
            self._look()
        return self._state

    @state.setter
    def state(self, state: BodyState) -> None:
        if self._flat is not None:
            self._look()
        self._state = state

    @property
    def acceleration_ned_m_s2(self) -> Vec3:
        if self._flat is not None:
            self._look()
        return self._acceleration_ned_m_s2

    @acceleration_ned_m_s2.setter
    def acceleration_ned_m_s2(self, acceleration_ned_m_s2: Vec3) -> None:
        if self._flat is not None:
            self._look()
        self._acceleration_ned_m_s2 = acceleration_ned_m_s2

    @property
    def motors(self) -> Motors:
        """Signals of the rotors after their lag."""
        return self.state[13:]

    def step(
        self,
        dt_s: float,
        motor_commands: Motors,
        wind_ned_m_s: Vec3 = _ZERO,
        external_force_ned_n: Vec3 = _ZERO,
        external_torque_frd_nm: Vec3 = _ZERO,
    ) -> None:
        """Advance by dt_s (1 to 4 ms)."""
        loads = Loads(*wind_ned_m_s, *external_force_ned_n, *external_torque_frd_nm)
        state, self._acceleration_ned_m_s2 = advance(
            self.state, self.body, motor_commands, self.motor_health, loads, dt_s
        )
        self._state = BodyState(*state)

    def truth(self) -> VehicleTruth:
        """What is true now, for sensors, scoring and display."""
        return truth_of(self.state, self.acceleration_ned_m_s2, self.on_surface)


@used_by_kernels
def specific_force(q_ned_frd: Quaternion, acceleration_ned_m_s2: Vec3) -> Vec3:
    """Acceleration without gravity, turned into B (conjugate of q_WB)."""
    w, x, y, z = q_ned_frd
    ax, ay, az = acceleration_ned_m_s2
    gz = az - GRAVITY_M_S2
    tx, ty, tz = 2.0 * (z * ay - y * gz), 2.0 * (x * gz - z * ax), 2.0 * (y * ax - x * ay)
    return (
        ax + w * tx - y * tz + z * ty,
        ay + w * ty - z * tx + x * tz,
        gz + w * tz - x * ty + y * tx,
    )


def truth_of(state: tuple[float, ...], acceleration_ned_m_s2: Vec3, on_surface: bool) -> VehicleTruth:
    """A BodyState or its plain numbers, and what an accelerometer reads when the vehicle accelerates so."""
    px, py, pz, vx, vy, vz, w, x, y, z, p, q, r, _, _, _, _ = state
    force = specific_force((w, x, y, z), acceleration_ned_m_s2)
    return VehicleTruth((px, py, pz), (vx, vy, vz), (w, x, y, z), (p, q, r), force, acceleration_ned_m_s2, on_surface)
