"""Which message PX4 streams on which link, how often and from when: the recorded rates of a stock PX4 v1.17 in SITL.

Rates are per simulated second. `FIRST_US` is when each appears after a cold boot. `LEAST_INTERVAL_US` is the period of the data behind a
stream: asking for more gives no more.
"""

from __future__ import annotations

from sitl_stub.mavlink import definitions as mav
from sitl_stub.mavlink.definitions import MessageType

ONBOARD_HZ: dict[MessageType, float] = {
    mav.HEARTBEAT: 1.0,
    mav.SYS_STATUS: 5.0,
    mav.EXTENDED_SYS_STATE: 5.0,
    mav.TIMESYNC: 10.0,
    mav.HIGHRES_IMU: 50.0,
    mav.LOCAL_POSITION_NED: 30.0,
    mav.ODOMETRY: 30.0,
    mav.ATTITUDE: 100.0,
    mav.ATTITUDE_QUATERNION: 50.0,
    mav.ATTITUDE_TARGET: 10.0,
    mav.POSITION_TARGET_LOCAL_NED: 10.0,
    mav.POSITION_TARGET_GLOBAL_INT: 10.0,
    mav.GLOBAL_POSITION_INT: 50.0,
    mav.GPS_RAW_INT: 8.0,
    mav.ALTITUDE: 10.0,
    mav.DISTANCE_SENSOR: 10.0,
    mav.SERVO_OUTPUT_RAW: 10.0,
    mav.VFR_HUD: 10.0,
    mav.PING: 1.0,
    mav.SYSTEM_TIME: 1.0,
    mav.SCALED_PRESSURE: 1.0,
    mav.ESTIMATOR_STATUS: 1.0,
    mav.GNSS_INTEGRITY: 1.0,
    mav.MISSION_CURRENT: 1.0,
    mav.OPEN_DRONE_ID_LOCATION: 1.0,
    mav.OPEN_DRONE_ID_SYSTEM: 1.0,
    mav.LINK_NODE_STATUS: 1.0,
    mav.BATTERY_STATUS: 0.5,
    mav.CURRENT_MODE: 0.5,
    mav.HOME_POSITION: 0.5,
    mav.VIBRATION: 0.5,
    mav.TIME_ESTIMATE_TO_TARGET: 0.5,
    mav.CURRENT_EVENT_SEQUENCE: 1.0 / 3.0,
}

GROUND_HZ: dict[MessageType, float] = {
    mav.HEARTBEAT: 1.0,
    mav.SYS_STATUS: 1.0,
    mav.EXTENDED_SYS_STATE: 1.0,
    mav.LOCAL_POSITION_NED: 50.0,
    mav.ATTITUDE: 50.0,
    mav.ATTITUDE_QUATERNION: 50.0,
    mav.ATTITUDE_TARGET: 50.0,
    mav.POSITION_TARGET_LOCAL_NED: 50.0,
    mav.POSITION_TARGET_GLOBAL_INT: 10.0,
    mav.GLOBAL_POSITION_INT: 50.0,
    mav.SERVO_OUTPUT_RAW: 50.0,
    mav.GPS_RAW_INT: 5.0,
    mav.VFR_HUD: 4.0,
    mav.ALTITUDE: 1.0,
    mav.SCALED_PRESSURE: 1.0,
    mav.GNSS_INTEGRITY: 1.0,
    mav.MISSION_CURRENT: 1.0,
    mav.OPEN_DRONE_ID_LOCATION: 1.0,
    mav.OPEN_DRONE_ID_SYSTEM: 1.0,
    mav.LINK_NODE_STATUS: 1.0,
    mav.DISTANCE_SENSOR: 0.5,
    mav.ESTIMATOR_STATUS: 0.5,
    mav.BATTERY_STATUS: 0.5,
    mav.CURRENT_MODE: 0.5,
    mav.HOME_POSITION: 0.5,
    mav.TIME_ESTIMATE_TO_TARGET: 0.5,
    mav.CURRENT_EVENT_SEQUENCE: 1.0 / 3.0,
    mav.PING: 0.1,
    mav.VIBRATION: 0.1,
}

TIMETABLES = {"onboard": ONBOARD_HZ, "ground": GROUND_HZ}

FIRST_US: dict[MessageType, int] = {
    mav.ATTITUDE: 1_500_000,
    mav.ATTITUDE_QUATERNION: 1_500_000,
    mav.HEARTBEAT: 1_100_000,
    mav.GLOBAL_POSITION_INT: 2_600_000,
    mav.PING: 1_100_000,
    mav.SYSTEM_TIME: 1_100_000,
    mav.ESTIMATOR_STATUS: 1_100_000,
    mav.BATTERY_STATUS: 2_100_000,
    mav.CURRENT_MODE: 2_100_000,
    mav.HOME_POSITION: 2_100_000,
    mav.VIBRATION: 2_100_000,
}
FIRST_OTHERS_US = 200_000

LEAST_INTERVAL_US: dict[MessageType, int] = {
    mav.LOCAL_POSITION_NED: 8_000,
    mav.ODOMETRY: 8_000,
    mav.GLOBAL_POSITION_INT: 8_000,
    mav.POSITION_TARGET_LOCAL_NED: 8_000,
    mav.HIGHRES_IMU: 8_000,
    mav.GPS_RAW_INT: 125_000,
    mav.DISTANCE_SENSOR: 20_000,
}
PHYSICS_STEP_US = 4_000


def least_interval_us(message_type: MessageType) -> int:
    """Shortest interval the data behind the stream allows."""
    return LEAST_INTERVAL_US.get(message_type, PHYSICS_STEP_US)
