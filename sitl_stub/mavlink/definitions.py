"""Layout of every MAVLink message the simulator sends or understands: id, CRC_EXTRA, wire order, field names.

Layouts are those of the MAVLink XML of PX4 v1.17 with extensions; messages that pymavlink's dialects lack (8, 300, 380, 410 to 413)
are here too. Arrays appear once in `fields` with their length in `format`. Tests compare the bytes with pymavlink's.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from struct import Struct


@dataclass(frozen=True, slots=True, eq=False)
class MessageType:
    """One message: `pack` takes all values in wire order (arrays flattened)."""

    name: str
    id: int
    crc_extra: int
    format: str
    fields: tuple[str, ...]
    struct: Struct = field(init=False)
    extra_byte: bytes = field(init=False)
    id_low: int = field(init=False)
    id_high: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "struct", Struct("<" + self.format))
        object.__setattr__(self, "extra_byte", bytes((self.crc_extra,)))
        object.__setattr__(self, "id_low", self.id & 0xFFFF)
        object.__setattr__(self, "id_high", self.id >> 16)

    def unpack(self, payload: bytes) -> tuple[float | int | bytes, ...]:
        """Values in wire order; MAVLink 2 cuts trailing zeros, MAVLink 1 the extensions: both are filled up with zeros."""
        size = self.struct.size
        return self.struct.unpack(payload[:size].ljust(size, b"\0"))


MESSAGE_TYPES: dict[int, MessageType] = {}


def _define(name: str, id: int, crc_extra: int, format: str, fields: str) -> MessageType:
    message_type = MessageType(name, id, crc_extra, format, tuple(fields.split()))
    MESSAGE_TYPES[id] = message_type
    return message_type


HEARTBEAT = _define("HEARTBEAT", 0, 50, "IBBBBB", "custom_mode type autopilot base_mode system_status mavlink_version")
SYS_STATUS = _define(
    "SYS_STATUS",
    1,
    124,
    "IIIHHhHHHHHHbIII",
    "present enabled health load voltage_battery current_battery drop_rate_comm errors_comm errors_count1 errors_count2 "
    "errors_count3 errors_count4 battery_remaining present_extended enabled_extended health_extended",
)
SYSTEM_TIME = _define("SYSTEM_TIME", 2, 137, "QI", "time_unix_usec time_boot_ms")
PING = _define("PING", 4, 237, "QIBB", "time_usec seq target_system target_component")
LINK_NODE_STATUS = _define(
    "LINK_NODE_STATUS",
    8,
    117,
    "QIIIIIHHHBB",
    "timestamp tx_rate rx_rate messages_sent messages_received messages_lost rx_parse_err tx_overflows rx_overflows tx_buf rx_buf",
)
SET_MODE = _define("SET_MODE", 11, 89, "IBB", "custom_mode target_system base_mode")
PARAM_REQUEST_READ = _define(
    "PARAM_REQUEST_READ", 20, 214, "hBB16s", "param_index target_system target_component param_id"
)
PARAM_REQUEST_LIST = _define("PARAM_REQUEST_LIST", 21, 159, "BB", "target_system target_component")
PARAM_VALUE = _define("PARAM_VALUE", 22, 220, "4sHH16sB", "param_value param_count param_index param_id param_type")
PARAM_SET = _define("PARAM_SET", 23, 168, "4sBB16sB", "param_value target_system target_component param_id param_type")
GPS_RAW_INT = _define(
    "GPS_RAW_INT",
    24,
    24,
    "QiiiHHHHBBiIIIIH",
    "time_usec lat lon alt eph epv vel cog fix_type satellites_visible alt_ellipsoid h_acc v_acc vel_acc hdg_acc yaw",
)
SCALED_PRESSURE = _define(
    "SCALED_PRESSURE", 29, 115, "Iffhh", "time_boot_ms press_abs press_diff temperature temperature_press_diff"
)
ATTITUDE = _define("ATTITUDE", 30, 39, "Iffffff", "time_boot_ms roll pitch yaw rollspeed pitchspeed yawspeed")
ATTITUDE_QUATERNION = _define(
    "ATTITUDE_QUATERNION",
    31,
    246,
    "Ifffffff4f",
    "time_boot_ms q1 q2 q3 q4 rollspeed pitchspeed yawspeed repr_offset_q",
)
LOCAL_POSITION_NED = _define("LOCAL_POSITION_NED", 32, 185, "Iffffff", "time_boot_ms x y z vx vy vz")
GLOBAL_POSITION_INT = _define(
    "GLOBAL_POSITION_INT", 33, 104, "IiiiihhhH", "time_boot_ms lat lon alt relative_alt vx vy vz hdg"
)
SERVO_OUTPUT_RAW = _define(
    "SERVO_OUTPUT_RAW",
    36,
    222,
    "I8HB8H",
    "time_usec servo1_raw port servo9_raw",
)
MISSION_CURRENT = _define(
    "MISSION_CURRENT",
    42,
    28,
    "HHBBIII",
    "seq total mission_state mission_mode mission_id fence_id rally_points_id",
)
MISSION_REQUEST_LIST = _define("MISSION_REQUEST_LIST", 43, 132, "BBB", "target_system target_component mission_type")
MISSION_COUNT = _define(
    "MISSION_COUNT", 44, 221, "HBBBI", "count target_system target_component mission_type opaque_id"
)
MISSION_CLEAR_ALL = _define("MISSION_CLEAR_ALL", 45, 232, "BBB", "target_system target_component mission_type")
MISSION_ACK = _define("MISSION_ACK", 47, 153, "BBBBI", "target_system target_component type mission_type opaque_id")
GPS_GLOBAL_ORIGIN = _define("GPS_GLOBAL_ORIGIN", 49, 39, "iiiQ", "latitude longitude altitude time_usec")
RC_CHANNELS = _define("RC_CHANNELS", 65, 118, "I18HBB", "time_boot_ms chan1_raw chancount rssi")
MANUAL_CONTROL = _define(
    "MANUAL_CONTROL",
    69,
    243,
    "hhhhHBHBhhhhhhhh",
    "x y z r buttons target buttons2 enabled_extensions s t aux1 aux2 aux3 aux4 aux5 aux6",
)
RC_CHANNELS_OVERRIDE = _define(
    "RC_CHANNELS_OVERRIDE", 70, 124, "8HBB10H", "chan1_raw target_system target_component chan9_raw"
)
VFR_HUD = _define("VFR_HUD", 74, 20, "ffffhH", "airspeed groundspeed alt climb heading throttle")
COMMAND_INT = _define(
    "COMMAND_INT",
    75,
    158,
    "ffffiifHBBBBB",
    "param1 param2 param3 param4 x y z command target_system target_component frame current autocontinue",
)
COMMAND_LONG = _define(
    "COMMAND_LONG",
    76,
    152,
    "fffffffHBBB",
    "param1 param2 param3 param4 param5 param6 param7 command target_system target_component confirmation",
)
COMMAND_ACK = _define(
    "COMMAND_ACK", 77, 143, "HBBiBB", "command result progress result_param2 target_system target_component"
)
SET_ATTITUDE_TARGET = _define(
    "SET_ATTITUDE_TARGET",
    82,
    49,
    "I4fffffBBB3f",
    "time_boot_ms q body_roll_rate body_pitch_rate body_yaw_rate thrust target_system target_component type_mask thrust_body",
)
ATTITUDE_TARGET = _define(
    "ATTITUDE_TARGET",
    83,
    22,
    "I4fffffB",
    "time_boot_ms q body_roll_rate body_pitch_rate body_yaw_rate thrust type_mask",
)
SET_POSITION_TARGET_LOCAL_NED = _define(
    "SET_POSITION_TARGET_LOCAL_NED",
    84,
    143,
    "IfffffffffffHBBB",
    "time_boot_ms x y z vx vy vz afx afy afz yaw yaw_rate type_mask target_system target_component coordinate_frame",
)
POSITION_TARGET_LOCAL_NED = _define(
    "POSITION_TARGET_LOCAL_NED",
    85,
    140,
    "IfffffffffffHB",
    "time_boot_ms x y z vx vy vz afx afy afz yaw yaw_rate type_mask coordinate_frame",
)
POSITION_TARGET_GLOBAL_INT = _define(
    "POSITION_TARGET_GLOBAL_INT",
    87,
    150,
    "IiifffffffffHB",
    "time_boot_ms lat_int lon_int alt vx vy vz afx afy afz yaw yaw_rate type_mask coordinate_frame",
)
SIM_STATE = _define(
    "SIM_STATE",
    108,
    32,
    "21fii",
    "q1 q2 q3 q4 roll pitch yaw xacc yacc zacc xgyro ygyro zgyro lat lon alt std_dev_horz std_dev_vert vn ve vd lat_int lon_int",
)
HIL_STATE_QUATERNION = _define(
    "HIL_STATE_QUATERNION",
    115,
    4,
    "Q4ffffiiihhhHHhhh",
    "time_usec attitude_quaternion rollspeed pitchspeed yawspeed lat lon alt vx vy vz ind_airspeed true_airspeed xacc yacc zacc",
)
HIGHRES_IMU = _define(
    "HIGHRES_IMU",
    105,
    93,
    "QfffffffffffffHB",
    "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag abs_pressure diff_pressure pressure_alt temperature "
    "fields_updated id",
)
FILE_TRANSFER_PROTOCOL = _define(
    "FILE_TRANSFER_PROTOCOL", 110, 84, "BBB251s", "target_network target_system target_component payload"
)
TIMESYNC = _define("TIMESYNC", 111, 34, "qqBB", "tc1 ts1 target_system target_component")
DISTANCE_SENSOR = _define(
    "DISTANCE_SENSOR",
    132,
    85,
    "IHHHBBBBff4fB",
    "time_boot_ms min_distance max_distance current_distance type id orientation covariance horizontal_fov vertical_fov "
    "quaternion signal_quality",
)
ALTITUDE = _define(
    "ALTITUDE",
    141,
    47,
    "Qffffff",
    "time_usec altitude_monotonic altitude_amsl altitude_local altitude_relative altitude_terrain bottom_clearance",
)
BATTERY_STATUS = _define(
    "BATTERY_STATUS",
    147,
    154,
    "iih10HhBBBbiB4HBI",
    "current_consumed energy_consumed temperature voltages current_battery id battery_function type battery_remaining "
    "time_remaining charge_state voltages_ext mode fault_bitmask",
)
AUTOPILOT_VERSION = _define(
    "AUTOPILOT_VERSION",
    148,
    178,
    "QQIIIIHH8s8s8s18s",
    "capabilities uid flight_sw_version middleware_sw_version os_sw_version board_version vendor_id product_id "
    "flight_custom_version middleware_custom_version os_custom_version uid2",
)
LANDING_TARGET = _define(
    "LANDING_TARGET",
    149,
    200,
    "QfffffBBfff4fBB",
    "time_usec angle_x angle_y distance size_x size_y target_num frame x y z q type position_valid",
)
ESTIMATOR_STATUS = _define(
    "ESTIMATOR_STATUS",
    230,
    163,
    "QffffffffH",
    "time_usec vel_ratio pos_horiz_ratio pos_vert_ratio mag_ratio hagl_ratio tas_ratio pos_horiz_accuracy "
    "pos_vert_accuracy flags",
)
VIBRATION = _define(
    "VIBRATION",
    241,
    90,
    "QfffIII",
    "time_usec vibration_x vibration_y vibration_z clipping_0 clipping_1 clipping_2",
)
HOME_POSITION = _define(
    "HOME_POSITION",
    242,
    104,
    "iiifff4ffffQ",
    "latitude longitude altitude x y z q approach_x approach_y approach_z time_usec",
)
MESSAGE_INTERVAL = _define("MESSAGE_INTERVAL", 244, 95, "iH", "interval_us message_id")
EXTENDED_SYS_STATE = _define("EXTENDED_SYS_STATE", 245, 130, "BB", "vtol_state landed_state")
STATUSTEXT = _define("STATUSTEXT", 253, 83, "B50sHB", "severity text id chunk_seq")
SETUP_SIGNING = _define(
    "SETUP_SIGNING", 256, 71, "QBB32s", "initial_timestamp target_system target_component secret_key"
)
PROTOCOL_VERSION = _define(
    "PROTOCOL_VERSION",
    300,
    217,
    "HHH8s8s",
    "version min_version max_version spec_version_hash library_version_hash",
)
ODOMETRY = _define(
    "ODOMETRY",
    331,
    91,
    "Qfff4fffffff21f21fBBBBb",
    "time_usec x y z q vx vy vz rollspeed pitchspeed yawspeed pose_covariance velocity_covariance frame_id child_frame_id "
    "reset_counter estimator_type quality",
)
TIME_ESTIMATE_TO_TARGET = _define(
    "TIME_ESTIMATE_TO_TARGET",
    380,
    232,
    "iiiii",
    "safe_return land mission_next_item mission_end commanded_action",
)
EVENT = _define(
    "EVENT",
    410,
    160,
    "IIHBBB40s",
    "id event_time_boot_ms sequence destination_component destination_system log_levels arguments",
)
CURRENT_EVENT_SEQUENCE = _define("CURRENT_EVENT_SEQUENCE", 411, 106, "HB", "sequence flags")
REQUEST_EVENT = _define("REQUEST_EVENT", 412, 33, "HHBB", "first_sequence last_sequence target_system target_component")
RESPONSE_EVENT_ERROR = _define(
    "RESPONSE_EVENT_ERROR",
    413,
    77,
    "HHBBB",
    "sequence sequence_oldest_available target_system target_component reason",
)
CURRENT_MODE = _define("CURRENT_MODE", 436, 193, "IIB", "custom_mode intended_custom_mode standard_mode")
GNSS_INTEGRITY = _define(
    "GNSS_INTEGRITY",
    441,
    169,
    "IHHBBBBBBBBB",
    "system_errors raim_hfom raim_vfom id authentication_state jamming_state spoofing_state raim_state corrections_quality "
    "system_status_summary gnss_signal_quality post_processing_quality",
)
OPEN_DRONE_ID_LOCATION = _define(
    "OPEN_DRONE_ID_LOCATION",
    12901,
    254,
    "iiffffHHhBB20sBBBBBBB",
    "latitude longitude altitude_barometric altitude_geodetic height timestamp direction speed_horizontal speed_vertical "
    "target_system target_component id_or_mac status height_reference horizontal_accuracy vertical_accuracy "
    "barometer_accuracy speed_accuracy timestamp_accuracy",
)
OPEN_DRONE_ID_SYSTEM = _define(
    "OPEN_DRONE_ID_SYSTEM",
    12904,
    77,
    "iifffIHHBB20sBBBB",
    "operator_latitude operator_longitude area_ceiling area_floor operator_altitude_geo timestamp area_count area_radius "
    "target_system target_component id_or_mac operator_location_type classification_type category_eu class_eu",
)
