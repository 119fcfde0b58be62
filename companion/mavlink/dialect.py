"""The MAVLink messages Companion speaks, as named tuples in the order of the wire.

Fields, struct format and CRC seed follow the MAVLink XML (common, development; EVENT from PX4's events.xml); a test
compares every line with pymavlink's generated dialect. Values here are as on the wire: scaled integers, NaN, frames as
MAVLink numbers them. session and its parts turn them into the vocabulary of messages.py.
"""

from __future__ import annotations

from typing import NamedTuple

Floats = tuple[float, ...]


class Heartbeat(NamedTuple):
    custom_mode: int
    type: int
    autopilot: int
    base_mode: int
    system_status: int
    mavlink_version: int = 3


class SysStatus(NamedTuple):
    onboard_control_sensors_present: int
    onboard_control_sensors_enabled: int
    onboard_control_sensors_health: int
    load: int
    voltage_battery: int
    current_battery: int
    drop_rate_comm: int
    errors_comm: int
    errors_count1: int
    errors_count2: int
    errors_count3: int
    errors_count4: int
    battery_remaining: int
    onboard_control_sensors_present_extended: int
    onboard_control_sensors_enabled_extended: int
    onboard_control_sensors_health_extended: int


class Ping(NamedTuple):
    time_usec: int
    seq: int
    target_system: int
    target_component: int


class ParamRequestRead(NamedTuple):
    param_index: int
    target_system: int
    target_component: int
    param_id: bytes


class ParamRequestList(NamedTuple):
    target_system: int
    target_component: int


class ParamValue(NamedTuple):
    param_value: float
    param_count: int
    param_index: int
    param_id: bytes
    param_type: int


class ParamSet(NamedTuple):
    param_value: float
    target_system: int
    target_component: int
    param_id: bytes
    param_type: int


class GpsRawInt(NamedTuple):
    time_usec: int
    lat: int
    lon: int
    alt: int
    eph: int
    epv: int
    vel: int
    cog: int
    fix_type: int
    satellites_visible: int
    alt_ellipsoid: int
    h_acc: int
    v_acc: int
    vel_acc: int
    hdg_acc: int
    yaw: int


class AttitudeQuaternion(NamedTuple):
    time_boot_ms: int
    q1: float
    q2: float
    q3: float
    q4: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float
    repr_offset_q: Floats


class LocalPositionNed(NamedTuple):
    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


class GlobalPositionInt(NamedTuple):
    time_boot_ms: int
    lat: int
    lon: int
    alt: int
    relative_alt: int
    vx: int
    vy: int
    vz: int
    hdg: int


class GpsGlobalOrigin(NamedTuple):
    latitude: int
    longitude: int
    altitude: int
    time_usec: int


class HighresImu(NamedTuple):
    time_usec: int
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    xmag: float
    ymag: float
    zmag: float
    abs_pressure: float
    diff_pressure: float
    pressure_alt: float
    temperature: float
    fields_updated: int
    id: int


class CommandLong(NamedTuple):
    param1: float
    param2: float
    param3: float
    param4: float
    param5: float
    param6: float
    param7: float
    command: int
    target_system: int
    target_component: int
    confirmation: int


class CommandAck(NamedTuple):
    command: int
    result: int
    progress: int
    result_param2: int
    target_system: int
    target_component: int


class AttitudeTarget(NamedTuple):
    time_boot_ms: int
    q: Floats
    body_roll_rate: float
    body_pitch_rate: float
    body_yaw_rate: float
    thrust: float
    type_mask: int


class SetPositionTargetLocalNed(NamedTuple):
    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float
    type_mask: int
    target_system: int
    target_component: int
    coordinate_frame: int


class Timesync(NamedTuple):
    tc1: int
    ts1: int


class DistanceSensor(NamedTuple):
    time_boot_ms: int
    min_distance: int
    max_distance: int
    current_distance: int
    type: int
    id: int
    orientation: int
    covariance: int
    horizontal_fov: float
    vertical_fov: float
    quaternion: Floats
    signal_quality: int


class BatteryStatus(NamedTuple):
    current_consumed: int
    energy_consumed: int
    temperature: int
    voltages: tuple[int, ...]
    current_battery: int
    id: int
    battery_function: int
    type: int
    battery_remaining: int
    time_remaining: int
    charge_state: int
    voltages_ext: tuple[int, ...]
    mode: int
    fault_bitmask: int


class LandingTarget(NamedTuple):
    time_usec: int
    angle_x: float
    angle_y: float
    distance: float
    size_x: float
    size_y: float
    target_num: int
    frame: int
    x: float
    y: float
    z: float
    q: Floats
    type: int
    position_valid: int


class HomePosition(NamedTuple):
    latitude: int
    longitude: int
    altitude: int
    x: float
    y: float
    z: float
    q: Floats
    approach_x: float
    approach_y: float
    approach_z: float
    time_usec: int


class ExtendedSysState(NamedTuple):
    vtol_state: int
    landed_state: int


class Statustext(NamedTuple):
    severity: int
    text: bytes
    id: int
    chunk_seq: int


class Odometry(NamedTuple):
    time_usec: int
    x: float
    y: float
    z: float
    q: Floats
    vx: float
    vy: float
    vz: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float
    pose_covariance: Floats
    velocity_covariance: Floats
    frame_id: int
    child_frame_id: int
    reset_counter: int
    estimator_type: int
    quality: int


class Event(NamedTuple):
    id: int
    event_time_boot_ms: int
    sequence: int
    destination_component: int
    destination_system: int
    log_levels: int
    arguments: bytes


class CurrentMode(NamedTuple):
    custom_mode: int
    intended_custom_mode: int
    standard_mode: int


WireMessage = (
    Heartbeat
    | SysStatus
    | Ping
    | ParamRequestRead
    | ParamRequestList
    | ParamValue
    | ParamSet
    | GpsRawInt
    | AttitudeQuaternion
    | LocalPositionNed
    | GlobalPositionInt
    | GpsGlobalOrigin
    | HighresImu
    | CommandLong
    | CommandAck
    | AttitudeTarget
    | SetPositionTargetLocalNed
    | Timesync
    | DistanceSensor
    | BatteryStatus
    | LandingTarget
    | HomePosition
    | ExtendedSysState
    | Statustext
    | Odometry
    | Event
    | CurrentMode
)

TABLE: tuple[tuple[type[WireMessage], int, str, int], ...] = (
    (Heartbeat, 0, "<IBBBBB", 50),
    (SysStatus, 1, "<IIIHHhHHHHHHbIII", 124),
    (Ping, 4, "<QIBB", 237),
    (ParamRequestRead, 20, "<hBB16s", 214),
    (ParamRequestList, 21, "<BB", 159),
    (ParamValue, 22, "<fHH16sB", 220),
    (ParamSet, 23, "<fBB16sB", 168),
    (GpsRawInt, 24, "<QiiiHHHHBBiIIIIH", 24),
    (AttitudeQuaternion, 31, "<Ifffffff4f", 246),
    (LocalPositionNed, 32, "<Iffffff", 185),
    (GlobalPositionInt, 33, "<IiiiihhhH", 104),
    (GpsGlobalOrigin, 49, "<iiiQ", 39),
    (CommandLong, 76, "<fffffffHBBB", 152),
    (CommandAck, 77, "<HBBiBB", 143),
    (AttitudeTarget, 83, "<I4fffffB", 22),
    (SetPositionTargetLocalNed, 84, "<IfffffffffffHBBB", 143),
    (HighresImu, 105, "<QfffffffffffffHB", 93),
    (Timesync, 111, "<qq", 34),
    (DistanceSensor, 132, "<IHHHBBBBff4fB", 85),
    (BatteryStatus, 147, "<iih10HhBBBbiB4HBI", 154),
    (LandingTarget, 149, "<QfffffBBfff4fBB", 200),
    (HomePosition, 242, "<iiifff4ffffQ", 104),
    (ExtendedSysState, 245, "<BB", 130),
    (Statustext, 253, "<B50sHB", 83),
    (Odometry, 331, "<Qfff4fffffff21f21fBBBBb", 91),
    (Event, 410, "<IIHBBB40s", 160),
    (CurrentMode, 436, "<IIB", 193),
)
"""(type, message id, struct format with MAVLink 2 extensions, CRC seed)."""
