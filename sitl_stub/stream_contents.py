"""Payload of every message the vehicle streams, as a recorded PX4 v1.17 in SITL fills it.

One function a message: telemetry in, payload bytes out, or None when PX4 has nothing to send (no valid global position, no sensor).
`CONTENTS` maps message ids to them. Fields that PX4 leaves at constants in simulation are the recorded constants.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, degrees, hypot, isfinite, nan, sin
from struct import Struct

from sitl_stub.autopilot.events import Notice, event_id
from sitl_stub.mavlink import definitions as mav
from sitl_stub.rotation import roll_pitch_yaw, yaw_of
from sitl_stub.telemetry import Telemetry

Content = Callable[[Telemetry], bytes | None]

CONTENTS: dict[int, Content] = {}

_SENSORS_PRESENT = 0x300402F
_SENSORS_ENABLED = 0x301402F
_SENSORS_HEALTH = 0x320C83F
_HEALTH_PREARM = 0x10000000
_HEALTH_GPS = 0x20
_MOTOR_OFF_US = 900
_INVALID_RANGE_CM = 65535


def _streams(message_type: mav.MessageType) -> Callable[[Content], Content]:
    def register(content: Content) -> Content:
        CONTENTS[message_type.id] = content
        return content

    return register


def _heading_cdeg(yaw_rad: float) -> int:
    return int(degrees(yaw_rad) % 360.0 * 100.0) % 36000


def _altitude_m(t: Telemetry) -> float:
    return t.origin.altitude_m - t.estimate.position_ned_m[2]


def _clip16(value: float) -> int:
    return int(max(-32768.0, min(32767.0, value)))


_heartbeat = mav.HEARTBEAT.struct.pack
_local_position = mav.LOCAL_POSITION_NED.struct.pack
_attitude = mav.ATTITUDE.struct.pack
_attitude_quaternion = mav.ATTITUDE_QUATERNION.struct.pack
_highres_imu = mav.HIGHRES_IMU.struct.pack
_global_position = mav.GLOBAL_POSITION_INT.struct.pack


@_streams(mav.HEARTBEAT)
def heartbeat(t: Telemetry) -> bytes:
    c = t.commander
    return _heartbeat(c.custom_mode, 2, 12, c.base_mode, c.system_status, 3)


@_streams(mav.SYS_STATUS)
def sys_status(t: Telemetry) -> bytes:
    health = _SENSORS_HEALTH | (_HEALTH_PREARM if t.commander.can_arm_now or t.commander.armed else 0)
    if not t.has_gps:
        health &= ~_HEALTH_GPS
    millivolts = round(t.battery.voltage_v * 1000.0)
    percent = round(t.battery.charge * 100.0)
    return mav.SYS_STATUS.struct.pack(
        _SENSORS_PRESENT, _SENSORS_ENABLED, health, 140, millivolts, -100, 0, 0, 0, 0, 0, 0, percent, 0, 0, 1
    )


@_streams(mav.SYSTEM_TIME)
def system_time(t: Telemetry) -> bytes:
    return mav.SYSTEM_TIME.struct.pack(t.unix_start_us + t.t_us, t.boot_ms)


@_streams(mav.GPS_RAW_INT)
def gps_raw_int(t: Telemetry) -> bytes:
    latitude, longitude = t.origin.to_global(t.estimate.position_ned_m[0], t.estimate.position_ned_m[1])
    altitude_mm = round(_altitude_m(t) * 1000.0)
    vx, vy, _ = t.estimate.velocity_ned_m_s
    fix, satellites = (3, 10) if t.has_gps else (0, 0)
    return mav.GPS_RAW_INT.struct.pack(
        t.t_us,
        round(latitude * 1e7),
        round(longitude * 1e7),
        altitude_mm,
        70,
        110,
        round(hypot(vx, vy) * 100.0),
        _heading_cdeg(atan2(vy, vx)),
        fix,
        satellites,
        altitude_mm,
        900,
        1780,
        400,
        0,
        0,
    )


@_streams(mav.SCALED_PRESSURE)
def scaled_pressure(t: Telemetry) -> bytes:
    return mav.SCALED_PRESSURE.struct.pack(t.boot_ms, _pressure_hpa(t), 0.0, 1182, 0)


def _pressure_hpa(t: Telemetry) -> float:
    return 1013.25 * float((1.0 - 2.25577e-5 * _altitude_m(t)) ** 5.25588)


@_streams(mav.ATTITUDE)
def attitude(t: Telemetry) -> bytes:
    e = t.estimate
    return _attitude(e.t_us // 1000, *roll_pitch_yaw(e.q_ned_frd), *e.angular_velocity_frd_rad_s)


@_streams(mav.ATTITUDE_QUATERNION)
def attitude_quaternion(t: Telemetry) -> bytes:
    e = t.estimate
    return _attitude_quaternion(e.t_us // 1000, *e.q_ned_frd, *e.angular_velocity_frd_rad_s, 0.0, 0.0, 0.0, 0.0)


@_streams(mav.LOCAL_POSITION_NED)
def local_position_ned(t: Telemetry) -> bytes:
    e = t.estimate
    return _local_position(e.t_us // 1000, *e.position_ned_m, *e.velocity_ned_m_s)


@_streams(mav.GLOBAL_POSITION_INT)
def global_position_int(t: Telemetry) -> bytes | None:
    if not t.estimate.has_position or not t.commander.health.is_ready:
        return None
    e = t.estimate
    latitude, longitude = t.origin.to_global(e.position_ned_m[0], e.position_ned_m[1])
    altitude = _altitude_m(t)
    vx, vy, vz = e.velocity_ned_m_s
    return _global_position(
        e.t_us // 1000,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(altitude * 1000.0),
        round((altitude - t.home.altitude_amsl_m) * 1000.0) if t.home.is_set else 0,
        _clip16(vx * 100.0),
        _clip16(vy * 100.0),
        _clip16(vz * 100.0),
        _heading_cdeg(e.yaw_rad),
    )


@_streams(mav.SERVO_OUTPUT_RAW)
def servo_output_raw(t: Telemetry) -> bytes:
    if t.commander.armed:
        motors = [round(1000.0 + 1000.0 * max(0.0, min(1.0, u))) for u in t.motors]
    else:
        motors = [_MOTOR_OFF_US] * 4
    return mav.SERVO_OUTPUT_RAW.struct.pack(
        t.t_us & 0xFFFFFFFF, *motors, *([_MOTOR_OFF_US] * 4), 0, *([_MOTOR_OFF_US] * 8)
    )


@_streams(mav.MISSION_CURRENT)
def mission_current(t: Telemetry) -> bytes:
    return mav.MISSION_CURRENT.struct.pack(0, 0xFFFF, 1, 2, 0, 0, 0)


@_streams(mav.GPS_GLOBAL_ORIGIN)
def gps_global_origin(t: Telemetry) -> bytes:
    o = t.origin
    return mav.GPS_GLOBAL_ORIGIN.struct.pack(
        round(o.latitude_deg * 1e7), round(o.longitude_deg * 1e7), round(o.altitude_m * 1000.0), t.t_us
    )


@_streams(mav.VFR_HUD)
def vfr_hud(t: Telemetry) -> bytes:
    vx, vy, vz = t.estimate.velocity_ned_m_s
    heading = int(degrees(t.estimate.yaw_rad) % 360.0)
    throttle = int(100.0 * t.thrust) if t.commander.armed else 0
    return mav.VFR_HUD.struct.pack(nan, hypot(vx, vy), _altitude_m(t), -vz, heading, max(0, min(100, throttle)))


@_streams(mav.ATTITUDE_TARGET)
def attitude_target(t: Telemetry) -> bytes:
    return mav.ATTITUDE_TARGET.struct.pack(t.boot_ms, *t.attitude_setpoint, *t.rates_setpoint, t.thrust, 0)


@_streams(mav.POSITION_TARGET_LOCAL_NED)
def position_target_local_ned(t: Telemetry) -> bytes:
    sp = t.position_setpoint
    values = (*sp.position_ned_m, *sp.velocity_ned_m_s, *sp.acceleration_ned_m_s2)
    mask = sum(1 << bit for bit, value in enumerate(values) if not isfinite(value))
    yaw_rate = sp.yaw_rate_rad_s if isfinite(sp.yaw_rate_rad_s) else 0.0
    yaw = sp.yaw_rad if isfinite(sp.yaw_rad) else yaw_of(t.attitude_setpoint)
    return mav.POSITION_TARGET_LOCAL_NED.struct.pack(t.boot_ms, *values, yaw, yaw_rate, mask, 1)


@_streams(mav.POSITION_TARGET_GLOBAL_INT)
def position_target_global_int(t: Telemetry) -> bytes | None:
    """Only while an automatic mode has a target."""
    sp = t.position_setpoint
    if not t.has_target or not isfinite(sp.position_ned_m[0] + sp.position_ned_m[2]):
        return None
    latitude, longitude = t.origin.to_global(sp.position_ned_m[0], sp.position_ned_m[1])
    altitude = t.origin.altitude_m - sp.position_ned_m[2]
    yaw = sp.yaw_rad if isfinite(sp.yaw_rad) else 0.0
    return mav.POSITION_TARGET_GLOBAL_INT.struct.pack(
        t.boot_ms,
        round(latitude * 1e7),
        round(longitude * 1e7),
        altitude,
        *sp.velocity_ned_m_s,
        *sp.acceleration_ned_m_s2,
        yaw,
        sp.yaw_rate_rad_s,
        0,
        5,
    )


@_streams(mav.HIGHRES_IMU)
def highres_imu(t: Telemetry) -> bytes | None:
    if t.truth is None:
        return None
    ax, ay, az = t.truth.specific_force_frd_m_s2
    p, q, r = t.truth.angular_velocity_frd_rad_s
    if t.imu_noise_scale > 0.0 and t.commander.armed:
        k, normal = t.imu_noise_scale, t.imu_noise.next
        ax, ay, az = ax + 0.5 * k * normal(), ay + 1.7 * k * normal(), az + 1.4 * k * normal()
        p, q, r = p + 0.14 * k * normal(), q + 0.07 * k * normal(), r + 0.03 * k * normal()
    pressure = _pressure_hpa(t)
    return _highres_imu(t.t_us, ax, ay, az, p, q, r, 0.224, -0.005, 0.418, pressure, 0.0, _altitude_m(t), 15.0, 63, 0)


@_streams(mav.DISTANCE_SENSOR)
def distance_sensor(t: Telemetry) -> bytes | None:
    if not t.has_range_sensor:
        return None
    distance_cm = _INVALID_RANGE_CM if t.range_m is None else min(round(t.range_m * 100.0), _INVALID_RANGE_CM)
    return mav.DISTANCE_SENSOR.struct.pack(
        t.boot_ms, 0, 10000, distance_cm, 0, 0, 25, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    )


@_streams(mav.ALTITUDE)
def altitude(t: Telemetry) -> bytes:
    amsl = _altitude_m(t)
    local = -t.estimate.position_ned_m[2]
    relative = amsl - t.home.altitude_amsl_m if t.home.is_set else nan
    clearance = t.estimate.height_above_bottom_m
    bottom = nan if clearance is None else clearance
    terrain = local - bottom if isfinite(bottom) else nan
    return mav.ALTITUDE.struct.pack(t.t_us, amsl + 0.75, amsl, local, relative, terrain, bottom)


_CELL_UNUSED = (65535,) * 9


@_streams(mav.BATTERY_STATUS)
def battery_status(t: Telemetry) -> bytes:
    millivolts = round(t.battery.voltage_v * 1000.0)
    percent = round(t.battery.charge * 100.0)
    warning = t.battery.warning()
    charge_state = 1 if warning is None else {"low": 2, "critical": 3, "emergency": 4}[warning]
    return mav.BATTERY_STATUS.struct.pack(
        -1, -1, 32767, millivolts, *_CELL_UNUSED, -100, 0, 1, 1, percent, 0, charge_state, 0, 0, 0, 0, 0, 0
    )


@_streams(mav.AUTOPILOT_VERSION)
def autopilot_version(t: Telemetry) -> bytes:
    # MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, SET_ATTITUDE_TARGET, SET_POSITION_TARGET_LOCAL_NED,
    # FLIGHT_TERMINATION, MAVLINK2.
    capabilities = 4 | 8 | 16 | 64 | 128 | 2048 | 8192
    return mav.AUTOPILOT_VERSION.struct.pack(
        capabilities, 1, 0x011100FF, 0x011100FF, 0x060B00FF, 1, 0, 0, b"sitlstub", b"sitlstub", bytes(8), bytes(18)
    )


@_streams(mav.ESTIMATOR_STATUS)
def estimator_status(t: Telemetry) -> bytes:
    e = t.estimate
    flags = 1023 if t.landed_state == 1 else 895
    if not e.has_position:
        flags &= ~0x18
    return mav.ESTIMATOR_STATUS.struct.pack(
        t.t_us, 0.1, 0.02, 0.012, 0.1, 0.002, nan, e.horizontal_accuracy_m, e.vertical_accuracy_m, flags
    )


@_streams(mav.VIBRATION)
def vibration(t: Telemetry) -> bytes:
    level = (7e-9, 0.098, 1.45) if t.commander.armed else (9e-11, 0.01, 0.11)
    return mav.VIBRATION.struct.pack(t.t_us, *level, 0, 0, 0)


@_streams(mav.HOME_POSITION)
def home_position(t: Telemetry) -> bytes | None:
    if not t.home.is_set:
        return None
    h = t.home
    latitude, longitude = t.origin.to_global(h.position_ned_m[0], h.position_ned_m[1])
    z = t.origin.altitude_m - h.altitude_amsl_m
    return mav.HOME_POSITION.struct.pack(
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(h.altitude_amsl_m * 1000.0),
        h.position_ned_m[0],
        h.position_ned_m[1],
        z,
        *_yaw_quaternion(h.yaw_rad),
        0.0,
        0.0,
        0.0,
        h.set_t_us,
    )


def _yaw_quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    return cos(0.5 * yaw_rad), 0.0, 0.0, sin(0.5 * yaw_rad)


@_streams(mav.EXTENDED_SYS_STATE)
def extended_sys_state(t: Telemetry) -> bytes:
    return mav.EXTENDED_SYS_STATE.struct.pack(0, t.landed_state)


@_streams(mav.PROTOCOL_VERSION)
def protocol_version(t: Telemetry) -> bytes:
    return mav.PROTOCOL_VERSION.struct.pack(200, 100, 200, b"sitlstub", b"sitlstub")


_ODOMETRY_HEAD = Struct("<Qfff4fffffff")
_POSE_DIAGONAL = (0, 6, 11, 15, 18, 20)


def _upper_triangle(diagonal: tuple[float, ...]) -> bytes:
    values = [nan] * 21
    for index, value in zip(_POSE_DIAGONAL, diagonal, strict=True):
        values[index] = value
    return Struct("<21f").pack(*values)


_POSE_COVARIANCE = _upper_triangle((0.041, 0.0417, 0.0955, 0.000146, 0.000114, 0.00132))
_VELOCITY_COVARIANCE = _upper_triangle((0.009, 0.0117, 0.00856, nan, nan, nan))


@_streams(mav.ODOMETRY)
def odometry(t: Telemetry) -> bytes:
    e = t.estimate
    head = _ODOMETRY_HEAD.pack(
        e.t_us, *e.position_ned_m, *e.q_ned_frd, *e.velocity_ned_m_s, *e.angular_velocity_frd_rad_s
    )
    return head + _POSE_COVARIANCE + _VELOCITY_COVARIANCE + bytes((1, 1, t.estimate_resets & 0xFF, 8, 0))


@_streams(mav.TIME_ESTIMATE_TO_TARGET)
def time_estimate_to_target(t: Telemetry) -> bytes:
    seconds = 0 if t.landed_state == 1 else 111
    return mav.TIME_ESTIMATE_TO_TARGET.struct.pack(seconds, -1, -1, -1, -1)


@_streams(mav.CURRENT_EVENT_SEQUENCE)
def current_event_sequence(t: Telemetry) -> bytes:
    return mav.CURRENT_EVENT_SEQUENCE.struct.pack(t.event_sequence & 0xFFFF, 0)


@_streams(mav.CURRENT_MODE)
def current_mode(t: Telemetry) -> bytes:
    return mav.CURRENT_MODE.struct.pack(t.commander.custom_mode, t.commander.intended_custom_mode, 0)


@_streams(mav.GNSS_INTEGRITY)
def gnss_integrity(t: Telemetry) -> bytes:
    return mav.GNSS_INTEGRITY.struct.pack(0, 65535, 65535, 4, 0, 0, 0, 0, 255, 255, 255, 255)


@_streams(mav.OPEN_DRONE_ID_LOCATION)
def open_drone_id_location(t: Telemetry) -> bytes:
    e = t.estimate
    latitude, longitude = t.origin.to_global(e.position_ned_m[0], e.position_ned_m[1])
    vx, vy, vz = e.velocity_ned_m_s
    altitude_m = _altitude_m(t)
    height = altitude_m - t.home.altitude_amsl_m if t.home.is_set else -1000.0
    return mav.OPEN_DRONE_ID_LOCATION.struct.pack(
        round(latitude * 1e7),
        round(longitude * 1e7),
        altitude_m,
        float(round(altitude_m)),
        height,
        65535.0,
        _heading_cdeg(atan2(vy, vx)),
        min(round(hypot(vx, vy) * 100.0), 25425),
        _clip16(-vz * 100.0),
        0,
        0,
        bytes(20),
        1 if t.landed_state == 1 else 2,
        0,
        12,
        5,
        0,
        3,
        0,
    )


@_streams(mav.OPEN_DRONE_ID_SYSTEM)
def open_drone_id_system(t: Telemetry) -> bytes:
    latitude, longitude = t.origin.to_global(t.home.position_ned_m[0], t.home.position_ned_m[1])
    return mav.OPEN_DRONE_ID_SYSTEM.struct.pack(
        round(latitude * 1e7),
        round(longitude * 1e7),
        -1000.0,
        -1000.0,
        t.home.altitude_amsl_m,
        (t.unix_start_us + t.t_us) // 1_000_000 & 0xFFFFFFFF,
        1,
        0,
        0,
        0,
        bytes(20),
        0,
        0,
        0,
        0,
    )


@_streams(mav.HIL_STATE_QUATERNION)
def hil_state_quaternion(t: Telemetry) -> bytes | None:
    """Ground truth, as SIH gives it (its time_usec is 0)."""
    truth = t.truth
    if truth is None:
        return None
    latitude, longitude = t.origin.to_global(truth.position_ned_m[0], truth.position_ned_m[1])
    vx, vy, vz = truth.velocity_ned_m_s
    mg = [_clip16(a / 9.80665 * 1000.0) for a in truth.specific_force_frd_m_s2]
    return mav.HIL_STATE_QUATERNION.struct.pack(
        0,
        *truth.q_ned_frd,
        *truth.angular_velocity_frd_rad_s,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round((t.origin.altitude_m - truth.position_ned_m[2]) * 1000.0),
        _clip16(vx * 100.0),
        _clip16(vy * 100.0),
        _clip16(vz * 100.0),
        0,
        0,
        *mg,
    )


def event(notice: Notice, sequence: int, boot_ms: int) -> bytes:
    """Payload of EVENT."""
    return mav.EVENT.struct.pack(
        event_id(notice.event_name), boot_ms, sequence & 0xFFFF, 0, 0, notice.log_levels, notice.arguments
    )


NEEDS_ESTIMATE_ONLY = frozenset(
    message.id
    for message in (
        mav.HEARTBEAT,
        mav.ATTITUDE,
        mav.ATTITUDE_QUATERNION,
        mav.LOCAL_POSITION_NED,
        mav.GLOBAL_POSITION_INT,
        mav.ODOMETRY,
    )
)
"""Made of the estimate, the commander and home alone."""

# Known to PX4's stream list, with nothing to say here: SET_MESSAGE_INTERVAL is accepted, REQUEST_MESSAGE denied.
SILENT_STREAMS = frozenset({mav.LANDING_TARGET.id, mav.RC_CHANNELS.id, 140, 192, 259, 285})
