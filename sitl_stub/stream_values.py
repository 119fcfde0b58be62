"""Numbers of the messages that are streamed often, in wire order: plain functions that kernels may call.

stream_contents.py packs them for one message, burst_kernel.py for all that are due while the vehicle flies steadily. Integers are
already rounded as PX4 rounds them. W local NED, B FRD, boot clock in microseconds.
"""

from __future__ import annotations

from math import atan2, degrees, isfinite, nan, sqrt
from typing import Any, NamedTuple

from sitl_stub.compiled import used_by_kernels
from sitl_stub.geodesy import OriginNumbers, to_global
from sitl_stub.rotation import Quaternion, Vec3, roll_pitch_yaw, yaw_of

MOTOR_OFF_US = 900
IMU_NUMBERS = 6
"""Random numbers of one noisy HIGHRES_IMU."""

_SENSORS_PRESENT = 0x300402F
_SENSORS_ENABLED = 0x301402F
_SENSORS_HEALTH = 0x320C83F
_HEALTH_PREARM = 0x10000000
_HEALTH_GPS = 0x20
_INVALID_RANGE_CM = 65535
_ACCELEROMETER_NOISE_M_S2 = (0.5, 1.7, 1.4)
_GYRO_NOISE_RAD_S = (0.14, 0.07, 0.03)


class HomeAltitude(NamedTuple):
    """Home's altitude above mean sea level, if it is known."""

    is_set: bool
    amsl_m: float


@used_by_kernels
def heading_cdeg(yaw_rad: float) -> int:
    return int(degrees(yaw_rad) % 360.0 * 100.0) % 36000


@used_by_kernels
def clip16(value: float) -> int:
    value = value if value < 32767.0 else 32767.0
    return int(value if value > -32768.0 else -32768.0)


@used_by_kernels
def altitude_m(origin: OriginNumbers, z_ned_m: float) -> float:
    return origin.altitude_m - z_ned_m


@used_by_kernels
def pressure_hpa(amsl_m: float) -> float:
    return 1013.25 * float((1.0 - 2.25577e-5 * amsl_m) ** 5.25588)


@used_by_kernels
def attitude(t_us: int, q: Quaternion, rates: Vec3) -> tuple[int, float, float, float, float, float, float]:
    roll, pitch, yaw = roll_pitch_yaw(q)
    return t_us // 1000, roll, pitch, yaw, rates[0], rates[1], rates[2]


@used_by_kernels
def global_position(
    t_us: int, position: Vec3, velocity: Vec3, yaw_rad: float, origin: OriginNumbers, home: HomeAltitude
) -> tuple[int, int, int, int, int, int, int, int, int]:
    latitude, longitude = to_global(origin, position[0], position[1])
    amsl = altitude_m(origin, position[2])
    return (
        t_us // 1000,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(amsl * 1000.0),
        round((amsl - home.amsl_m) * 1000.0) if home.is_set else 0,
        clip16(velocity[0] * 100.0),
        clip16(velocity[1] * 100.0),
        clip16(velocity[2] * 100.0),
        heading_cdeg(yaw_rad),
    )


@used_by_kernels
def gps_raw(
    t_us: int, position: Vec3, velocity: Vec3, origin: OriginNumbers, has_gps: bool
) -> tuple[int, int, int, int, int, int, int, int, int, int]:
    """The fields before those that stay the same; alt_ellipsoid is alt."""
    latitude, longitude = to_global(origin, position[0], position[1])
    vx, vy = velocity[0], velocity[1]
    return (
        t_us,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(altitude_m(origin, position[2]) * 1000.0),
        70,
        110,
        round(sqrt(vx * vx + vy * vy) * 100.0),
        heading_cdeg(atan2(vy, vx)),
        3 if has_gps else 0,
        10 if has_gps else 0,
    )


@used_by_kernels
def imu_noise(scale: float, tape: Any, at: int) -> tuple[Vec3, Vec3]:
    """What the accelerometer and the gyro are off by: six numbers of the tape from `at` on."""
    a, g = _ACCELEROMETER_NOISE_M_S2, _GYRO_NOISE_RAD_S
    return (
        (a[0] * scale * tape[at], a[1] * scale * tape[at + 1], a[2] * scale * tape[at + 2]),
        (g[0] * scale * tape[at + 3], g[1] * scale * tape[at + 4], g[2] * scale * tape[at + 5]),
    )


@used_by_kernels
def altitude(
    t_us: int, amsl_m: float, z_ned_m: float, home: HomeAltitude, clearance_m: float
) -> tuple[int, float, float, float, float, float, float]:
    """`clearance_m` NaN: not known."""
    local = -z_ned_m
    relative = amsl_m - home.amsl_m if home.is_set else nan
    bottom = clearance_m if isfinite(clearance_m) else nan
    terrain = local - bottom if isfinite(bottom) else nan
    return t_us, amsl_m + 0.75, amsl_m, local, relative, terrain, bottom


@used_by_kernels
def distance_cm(range_m: float) -> int:
    """DISTANCE_SENSOR.current_distance; NaN is no valid range."""
    return _INVALID_RANGE_CM if range_m != range_m else min(round(range_m * 100.0), _INVALID_RANGE_CM)


@used_by_kernels
def motor_us(command: float, is_armed: bool) -> int:
    return round(1000.0 + 1000.0 * max(0.0, min(1.0, command))) if is_armed else MOTOR_OFF_US


@used_by_kernels
def vfr_hud(
    velocity: Vec3, amsl_m: float, yaw_rad: float, thrust: float, is_armed: bool
) -> tuple[float, float, float, float, int, int]:
    vx, vy, vz = velocity
    throttle = int(100.0 * thrust) if is_armed else 0
    heading = int(degrees(yaw_rad) % 360.0)
    return nan, sqrt(vx * vx + vy * vy), amsl_m, -vz, heading, max(0, min(100, throttle))


@used_by_kernels
def ignored_mask(position: Vec3, velocity: Vec3, acceleration: Vec3) -> int:
    """POSITION_TARGET_LOCAL_NED.type_mask: a bit for each number that is not finite."""
    mask = 0
    for i in range(3):
        mask |= 0 if isfinite(position[i]) else 1 << i
        mask |= 0 if isfinite(velocity[i]) else 8 << i
        mask |= 0 if isfinite(acceleration[i]) else 64 << i
    return mask


@used_by_kernels
def target_yaw(yaw_rad: float, attitude_setpoint: Quaternion) -> float:
    return yaw_rad if isfinite(yaw_rad) else yaw_of(attitude_setpoint)


@used_by_kernels
def zero_if_unset(value: float) -> float:
    return value if isfinite(value) else 0.0


@used_by_kernels
def global_target(position: Vec3, origin: OriginNumbers) -> tuple[int, int, float]:
    """Latitude and longitude in 1e-7 degrees, altitude."""
    latitude, longitude = to_global(origin, position[0], position[1])
    return round(latitude * 1e7), round(longitude * 1e7), altitude_m(origin, position[2])


@used_by_kernels
def drone_location(
    position: Vec3, velocity: Vec3, origin: OriginNumbers, home: HomeAltitude
) -> tuple[int, int, float, float, float, int, int, int]:
    """OPEN_DRONE_ID_LOCATION up to its height, then direction and both speeds."""
    latitude, longitude = to_global(origin, position[0], position[1])
    vx, vy, vz = velocity
    amsl = altitude_m(origin, position[2])
    return (
        round(latitude * 1e7),
        round(longitude * 1e7),
        amsl,
        float(round(amsl)),
        amsl - home.amsl_m if home.is_set else -1000.0,
        heading_cdeg(atan2(vy, vx)),
        min(round(sqrt(vx * vx + vy * vy) * 100.0), 25425),
        clip16(-vz * 100.0),
    )


@used_by_kernels
def per_second(count: int, t_us: int) -> int:
    """A mean rate since boot."""
    return round(count / max(t_us * 1e-6, 1.0))


@used_by_kernels
def unix_seconds(unix_us: int) -> int:
    """As 32 bits take it."""
    return unix_us // 1_000_000 & 0xFFFFFFFF


@used_by_kernels
def millivolts(voltage_v: float) -> int:
    return round(voltage_v * 1000.0)


@used_by_kernels
def percent(charge: float) -> int:
    return round(charge * 100.0)


@used_by_kernels
def sys_status(
    can_fly: bool, has_gps: bool, charge: float, voltage_v: float
) -> tuple[int, int, int, int, int, int, int]:
    """present, enabled, health, load, voltage, current; and battery_remaining."""
    health = _SENSORS_HEALTH | (_HEALTH_PREARM if can_fly else 0)
    if not has_gps:
        health &= ~_HEALTH_GPS
    return (
        _SENSORS_PRESENT,
        _SENSORS_ENABLED,
        health,
        140,
        millivolts(voltage_v),
        -100,
        percent(charge),
    )
