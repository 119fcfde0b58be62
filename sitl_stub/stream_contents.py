"""Payload of every message the vehicle streams, as a recorded PX4 v1.17 in SITL fills it.

One function a message: telemetry in, payload bytes out, or None when PX4 has nothing to send (no valid global position, no sensor).
`CONTENTS` maps message ids to them. Fields that PX4 leaves at constants in simulation are the recorded constants.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, isfinite, nan, sin
from struct import Struct

from sitl_stub import stream_values as values_of
from sitl_stub.autopilot.events import Notice, event_id
from sitl_stub.mavlink import definitions as mav
from sitl_stub.stream_values import IMU_NUMBERS, MOTOR_OFF_US, HomeAltitude, clip16
from sitl_stub.telemetry import Telemetry

Content = Callable[[Telemetry], bytes | None]

CONTENTS: dict[int, Content] = {}


def _streams(message_type: mav.MessageType) -> Callable[[Content], Content]:
    def register(content: Content) -> Content:
        CONTENTS[message_type.id] = content
        return content

    return register


def _altitude_m(t: Telemetry) -> float:
    return t.origin.altitude_m - t.estimate.position_ned_m[2]


def _home_altitude(t: Telemetry) -> HomeAltitude:
    return HomeAltitude(t.home.is_set, t.home.altitude_amsl_m)


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
    c, b = t.commander, t.battery
    *head, percent = values_of.sys_status(c.can_arm_now or c.armed, t.has_gps, b.charge, b.voltage_v)
    return mav.SYS_STATUS.struct.pack(*head, 0, 0, 0, 0, 0, 0, percent, 0, 0, 1)


@_streams(mav.SYSTEM_TIME)
def system_time(t: Telemetry) -> bytes:
    return mav.SYSTEM_TIME.struct.pack(t.unix_start_us + t.t_us, t.boot_ms)


@_streams(mav.GPS_RAW_INT)
def gps_raw_int(t: Telemetry) -> bytes:
    e = t.estimate
    head = values_of.gps_raw(t.t_us, e.position_ned_m, e.velocity_ned_m_s, t.origin.numbers, t.has_gps)
    return mav.GPS_RAW_INT.struct.pack(*head, head[3], 900, 1780, 400, 0, 0)


@_streams(mav.SCALED_PRESSURE)
def scaled_pressure(t: Telemetry) -> bytes:
    return mav.SCALED_PRESSURE.struct.pack(t.boot_ms, values_of.pressure_hpa(_altitude_m(t)), 0.0, 1182, 0)


@_streams(mav.ATTITUDE)
def attitude(t: Telemetry) -> bytes:
    e = t.estimate
    return _attitude(*values_of.attitude(e.t_us, e.q_ned_frd, e.angular_velocity_frd_rad_s))


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
    e, home = t.estimate, _home_altitude(t)
    if not e.has_position or not t.commander.health.is_ready:
        return None
    return _global_position(
        *values_of.global_position(e.t_us, e.position_ned_m, e.velocity_ned_m_s, e.yaw_rad, t.origin.numbers, home)
    )


@_streams(mav.SERVO_OUTPUT_RAW)
def servo_output_raw(t: Telemetry) -> bytes:
    motors = [values_of.motor_us(u, t.commander.armed) for u in t.motors]
    return mav.SERVO_OUTPUT_RAW.struct.pack(
        t.t_us & 0xFFFFFFFF, *motors, *([MOTOR_OFF_US] * 4), 0, *([MOTOR_OFF_US] * 8)
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
    e = t.estimate
    return mav.VFR_HUD.struct.pack(
        *values_of.vfr_hud(e.velocity_ned_m_s, _altitude_m(t), e.yaw_rad, t.thrust, t.commander.armed)
    )


@_streams(mav.ATTITUDE_TARGET)
def attitude_target(t: Telemetry) -> bytes:
    return mav.ATTITUDE_TARGET.struct.pack(t.boot_ms, *t.attitude_setpoint, *t.rates_setpoint, t.thrust, 0)


@_streams(mav.POSITION_TARGET_LOCAL_NED)
def position_target_local_ned(t: Telemetry) -> bytes:
    sp = t.position_setpoint
    asked = (sp.position_ned_m, sp.velocity_ned_m_s, sp.acceleration_ned_m_s2)
    yaw = values_of.target_yaw(sp.yaw_rad, t.attitude_setpoint)
    yaw_rate = values_of.zero_if_unset(sp.yaw_rate_rad_s)
    mask = values_of.ignored_mask(*asked)
    return mav.POSITION_TARGET_LOCAL_NED.struct.pack(t.boot_ms, *asked[0], *asked[1], *asked[2], yaw, yaw_rate, mask, 1)


@_streams(mav.POSITION_TARGET_GLOBAL_INT)
def position_target_global_int(t: Telemetry) -> bytes | None:
    """Only while an automatic mode has a target."""
    sp = t.position_setpoint
    if not t.has_target or not isfinite(sp.position_ned_m[0] + sp.position_ned_m[2]):
        return None
    return mav.POSITION_TARGET_GLOBAL_INT.struct.pack(
        t.boot_ms,
        *values_of.global_target(sp.position_ned_m, t.origin.numbers),
        *sp.velocity_ned_m_s,
        *sp.acceleration_ned_m_s2,
        values_of.zero_if_unset(sp.yaw_rad),
        sp.yaw_rate_rad_s,
        0,
        5,
    )


@_streams(mav.HIGHRES_IMU)
def highres_imu(t: Telemetry) -> bytes | None:
    if t.truth is None:
        return None
    (ax, ay, az), (p, q, r) = t.truth.specific_force_frd_m_s2, t.truth.angular_velocity_frd_rad_s
    if t.imu_noise_scale > 0.0 and t.commander.armed:
        t.imu_noise.reserve(IMU_NUMBERS)
        force, rates = values_of.imu_noise(t.imu_noise_scale, t.imu_noise.numbers, t.imu_noise.at)
        t.imu_noise.at += IMU_NUMBERS
        ax, ay, az, p, q, r = ax + force[0], ay + force[1], az + force[2], p + rates[0], q + rates[1], r + rates[2]
    amsl = _altitude_m(t)
    pressure = values_of.pressure_hpa(amsl)
    return _highres_imu(t.t_us, ax, ay, az, p, q, r, 0.224, -0.005, 0.418, pressure, 0.0, amsl, 15.0, 63, 0)


@_streams(mav.DISTANCE_SENSOR)
def distance_sensor(t: Telemetry) -> bytes | None:
    if not t.has_range_sensor:
        return None
    distance_cm = values_of.distance_cm(nan if t.range_m is None else t.range_m)
    return mav.DISTANCE_SENSOR.struct.pack(
        t.boot_ms, 0, 10000, distance_cm, 0, 0, 25, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    )


@_streams(mav.ALTITUDE)
def altitude(t: Telemetry) -> bytes:
    clearance = t.estimate.height_above_bottom_m
    return mav.ALTITUDE.struct.pack(
        *values_of.altitude(
            t.t_us,
            _altitude_m(t),
            t.estimate.position_ned_m[2],
            _home_altitude(t),
            nan if clearance is None else clearance,
        )
    )


_CELL_UNUSED = (65535,) * 9


@_streams(mav.BATTERY_STATUS)
def battery_status(t: Telemetry) -> bytes:
    millivolts, percent = values_of.millivolts(t.battery.voltage_v), values_of.percent(t.battery.charge)
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
    *place, direction, speed, climb = values_of.drone_location(
        e.position_ned_m, e.velocity_ned_m_s, t.origin.numbers, _home_altitude(t)
    )
    return mav.OPEN_DRONE_ID_LOCATION.struct.pack(
        *place,
        65535.0,
        direction,
        speed,
        climb,
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
        values_of.unix_seconds(t.unix_start_us + t.t_us),
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
    mg = [clip16(a / 9.80665 * 1000.0) for a in truth.specific_force_frd_m_s2]
    return mav.HIL_STATE_QUATERNION.struct.pack(
        0,
        *truth.q_ned_frd,
        *truth.angular_velocity_frd_rad_s,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round((t.origin.altitude_m - truth.position_ned_m[2]) * 1000.0),
        clip16(vx * 100.0),
        clip16(vy * 100.0),
        clip16(vz * 100.0),
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
