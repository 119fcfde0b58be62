"""Many steps of steady flight and all their stream messages in one call: steady_kernel.py's loop, then what `MavlinkEndpoint.step` does.

The plain message is the template: tables say which of its fields move and how they are packed (from the message's own format), and
stream_values.py gives the numbers, the same functions as for a single message. The kernel stops before a step in which a message is
due that it does not know. `b`, `e`, `k` are rows of steady_kernel.py, `s` the slow numbers laid out below. Bytes are those of the plain way.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from struct import calcsize
from typing import Any

import numpy as np
import numpy.typing as npt

from sitl_stub import stream_values as values_of
from sitl_stub.autopilot.battery import Drain, charge_after, voltage_of
from sitl_stub.compiled import compiled, used_by_kernels
from sitl_stub.geodesy import OriginNumbers
from sitl_stub.mavlink import definitions as mav
from sitl_stub.mavlink.definitions import MessageType
from sitl_stub.multirotor import specific_force
from sitl_stub.steady_kernel import fly_steadily

Integers = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

# Places in s.
ORIGIN, HOME, HAS_GLOBAL, HAS_GPS, IS_ARMED, CAN_FLY, LANDED_STATE, HAS_TARGET = 0, 5, 7, 8, 9, 10, 11, 12
IMU_SCALE, RESETS, DRAIN, FULL_SINCE_US, HAS_RANGE, ASKED_POSITION, UNIX_START_US, SLOW_SIZE = (
    13,
    14,
    15,
    18,
    19,
    20,
    23,
    24,
)

# Columns of the timetable, of a link, and of a frame made.
DUE, ORDER, KIND, LAST_SENT, TIMETABLE_SIZE = 0, 1, 3, 4, 5
"""The interval is between order and kind."""
FIRST, END, COUNTERS, RECEIVED, LINK_SIZE = 0, 1, 2, 5, 7
"""Of the streams; then sequence number, messages and bytes sent; messages and bytes received."""
FRAME_SIZE = 3
"""Begin, end, link."""
NO_STEP = 1 << 40
"""As the first step to send: none."""

_STEP_US = 4000
LONGEST_FRAME = 280
_MOST_FIELDS = 16
_NEVER_US = 1 << 62

(
    _UNKNOWN,
    _ATTITUDE,
    _QUATERNION,
    _LOCAL,
    _GLOBAL,
    _ODOMETRY,
    _IMU,
    _ATTITUDE_TARGET,
    _LOCAL_TARGET,
    _GLOBAL_TARGET,
    _ALTITUDE,
    _RANGE,
    _SERVOS,
    _HUD,
    _TIMESYNC,
    _GPS,
    _STATUS,
    _LANDED,
    _NODE,
    _PING,
    _CLOCK,
    _PRESSURE,
    _ESTIMATOR,
    _VIBRATION,
    _BATTERY,
    _DRONE,
    _DRONE_SYSTEM,
    _HEARTBEAT,
    _MISSION,
    _INTEGRITY,
    _MODE,
    _HOME,
    _ARRIVAL,
    _EVENTS,
) = range(34)
FIRST_FRESH = _NODE
"""From this kind on: sent about once a second, and much of the message is not the flight's; templates are made anew before."""

MOVING_FIELDS: dict[MessageType, tuple[int, tuple[int, ...]]] = {
    mav.ATTITUDE: (_ATTITUDE, tuple(range(7))),
    mav.ATTITUDE_QUATERNION: (_QUATERNION, tuple(range(8))),
    mav.LOCAL_POSITION_NED: (_LOCAL, tuple(range(7))),
    mav.GLOBAL_POSITION_INT: (_GLOBAL, tuple(range(9))),
    mav.ODOMETRY: (_ODOMETRY, (*range(14), 58)),
    mav.HIGHRES_IMU: (_IMU, (*range(7), 10, 12)),
    mav.ATTITUDE_TARGET: (_ATTITUDE_TARGET, tuple(range(9))),
    mav.POSITION_TARGET_LOCAL_NED: (_LOCAL_TARGET, tuple(range(13))),
    mav.POSITION_TARGET_GLOBAL_INT: (_GLOBAL_TARGET, tuple(range(12))),
    mav.ALTITUDE: (_ALTITUDE, tuple(range(7))),
    mav.DISTANCE_SENSOR: (_RANGE, (0, 3)),
    mav.SERVO_OUTPUT_RAW: (_SERVOS, tuple(range(5))),
    mav.VFR_HUD: (_HUD, tuple(range(6))),
    mav.TIMESYNC: (_TIMESYNC, (1,)),
    mav.GPS_RAW_INT: (_GPS, tuple(range(11))),
    mav.SYS_STATUS: (_STATUS, (2, 4, 12)),
    mav.EXTENDED_SYS_STATE: (_LANDED, (1,)),
    mav.LINK_NODE_STATUS: (_NODE, tuple(range(5))),
    mav.PING: (_PING, (0, 1)),
    mav.SYSTEM_TIME: (_CLOCK, (0, 1)),
    mav.SCALED_PRESSURE: (_PRESSURE, (0, 1)),
    mav.ESTIMATOR_STATUS: (_ESTIMATOR, (0,)),
    mav.VIBRATION: (_VIBRATION, (0,)),
    mav.BATTERY_STATUS: (_BATTERY, (3, 17)),
    mav.OPEN_DRONE_ID_LOCATION: (_DRONE, (0, 1, 2, 3, 4, 6, 7, 8)),
    mav.OPEN_DRONE_ID_SYSTEM: (_DRONE_SYSTEM, (5,)),
    mav.HEARTBEAT: (_HEARTBEAT, ()),
    mav.MISSION_CURRENT: (_MISSION, ()),
    mav.GNSS_INTEGRITY: (_INTEGRITY, ()),
    mav.CURRENT_MODE: (_MODE, ()),
    mav.HOME_POSITION: (_HOME, ()),
    mav.TIME_ESTIMATE_TO_TARGET: (_ARRIVAL, ()),
    mav.CURRENT_EVENT_SEQUENCE: (_EVENTS, ()),
}
"""The kernel's number of a message, and which of its fields (counted in wire order, arrays one by one) it writes."""

KIND_OF = {message_type.id: kind for message_type, (kind, _) in MOVING_FIELDS.items()}


@dataclass(frozen=True, slots=True, eq=False)
class Layouts:
    """For each kind: first and last field, size (0: nothing to say), id, CRC_EXTRA, place of its template. For each field: place, code, size."""

    kinds: Integers
    fields: Integers
    templates: Bytes


def layouts(templates: dict[MessageType, bytes]) -> Layouts:
    """Tables from the messages' own formats."""
    kinds = np.zeros((len(MOVING_FIELDS) + 1, 6), np.int64)
    fields: list[tuple[int, int, int]] = []
    joined = b""
    for message_type, (kind, moving) in MOVING_FIELDS.items():
        every = _fields(message_type.format)
        template = templates[message_type]
        first = len(fields)
        fields += [every[place] for place in moving]
        kinds[kind] = (first, len(fields), len(template), message_type.id, message_type.crc_extra, len(joined))
        joined += template
    return Layouts(kinds, np.array(fields, np.int64), np.frombuffer(joined, np.uint8).copy())


def _fields(format: str) -> list[tuple[int, int, int]]:
    """(place, is it a float, size) of each field of a wire format."""
    found: list[tuple[int, int, int]] = []
    place, count = 0, ""
    for code in format:
        if code.isdigit():
            count += code
            continue
        is_text = code == "s"
        size = calcsize("<" + (count if is_text else "") + code)
        for _ in range(1 if is_text else int(count or 1)):
            found.append((place, int(code == "f"), size))
            place += size
        count = ""
    return found


@used_by_kernels
def _fill(
    kind: int,
    v: Any,
    t_us: int,
    b: Any,
    e: Any,
    k: Any,
    s: Any,
    range_m: float,
    bottom_m: float,
    tape: Any,
    tape_at: int,
    link: Any,
    pings: int,
) -> bool:
    """The numbers of one message into v; False when there is nothing to say."""
    position, velocity = (e[50], e[51], e[52]), (e[53], e[54], e[55])
    q, rates, yaw = (e[60], e[61], e[62], e[63]), (e[64], e[65], e[66]), e[70]
    origin = OriginNumbers(s[0], s[1], s[2], s[3], s[4])
    home = values_of.HomeAltitude(s[5] > 0.5, s[6])
    amsl = values_of.altitude_m(origin, e[52])
    v[0] = t_us // 1000
    if kind == _ATTITUDE:
        v[0], v[1], v[2], v[3], v[4], v[5], v[6] = values_of.attitude(t_us, q, rates)
    elif kind == _QUATERNION:
        v[1], v[2], v[3], v[4] = q
        v[5], v[6], v[7] = rates
    elif kind == _LOCAL:
        v[1], v[2], v[3] = position
        v[4], v[5], v[6] = velocity
    elif kind == _GLOBAL:
        if s[7] < 0.5:
            return False
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8] = values_of.global_position(
            t_us, position, velocity, yaw, origin, home
        )
    elif kind == _ODOMETRY:
        v[0] = t_us
        v[1], v[2], v[3] = position
        v[4], v[5], v[6], v[7] = q
        v[8], v[9], v[10] = velocity
        v[11], v[12], v[13] = rates
        v[14] = int(s[14]) & 0xFF
    elif kind == _IMU:
        v[0] = t_us
        v[1], v[2], v[3] = specific_force((b[6], b[7], b[8], b[9]), (b[17], b[18], b[19]))
        v[4], v[5], v[6] = b[10], b[11], b[12]
        if s[13] > 0.0:
            force, turning = values_of.imu_noise(s[13], tape, tape_at)
            for i in range(3):
                v[1 + i] += force[i]
                v[4 + i] += turning[i]
        v[7], v[8] = values_of.pressure_hpa(amsl), amsl
    elif kind == _ATTITUDE_TARGET:
        v[1], v[2], v[3], v[4] = k[11], k[12], k[13], k[14]
        v[5], v[6], v[7], v[8] = k[0], k[1], k[2], k[10]
    elif kind == _LOCAL_TARGET:
        asked, speed, push = (s[20], s[21], s[22]), (k[42], k[43], k[44]), (k[45], k[46], k[47])
        v[1], v[2], v[3] = asked
        v[4], v[5], v[6] = speed
        v[7], v[8], v[9] = push
        v[10] = values_of.target_yaw(k[51], (k[11], k[12], k[13], k[14]))
        v[11] = values_of.zero_if_unset(k[15])
        v[12] = values_of.ignored_mask(asked, speed, push)
    elif kind == _GLOBAL_TARGET:
        if s[12] < 0.5 or not isfinite(s[20] + s[22]):
            return False
        v[1], v[2], v[3] = values_of.global_target((s[20], s[21], s[22]), origin)
        v[4], v[5], v[6], v[7], v[8], v[9] = k[42], k[43], k[44], k[45], k[46], k[47]
        v[10], v[11] = values_of.zero_if_unset(k[51]), k[15]
    elif kind == _ALTITUDE:
        v[0], v[1], v[2], v[3], v[4], v[5], v[6] = values_of.altitude(t_us, amsl, e[52], home, bottom_m)
    elif kind == _RANGE:
        if s[19] < 0.5:
            return False
        v[1] = values_of.distance_cm(range_m)
    elif kind == _SERVOS:
        v[0] = t_us & 0xFFFFFFFF
        for i in range(4):
            v[1 + i] = values_of.motor_us(k[28 + i], s[9] > 0.5)
    elif kind == _HUD:
        v[0], v[1], v[2], v[3], v[4], v[5] = values_of.vfr_hud(velocity, amsl, yaw, k[10], s[9] > 0.5)
    elif kind == _TIMESYNC:
        v[0] = t_us * 1000
    elif kind == _GPS:
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9] = values_of.gps_raw(
            t_us, position, velocity, origin, s[8] > 0.5
        )
        v[10] = v[3]
    elif kind == _STATUS:
        charge = _charge(t_us, k, s)
        _, _, v[0], _, v[1], _, v[2] = values_of.sys_status(s[10] > 0.5, s[8] > 0.5, charge, voltage_of(charge))
    elif kind == _LANDED:
        v[0] = s[11]
    elif kind == _NODE:
        v[0] = t_us
        v[1], v[2] = values_of.per_second(link[4], t_us), values_of.per_second(link[6], t_us)
        v[3], v[4] = link[3], link[5]
    elif kind == _PING:
        v[0], v[1] = t_us, pings
    elif kind == _CLOCK:
        v[0], v[1] = int(s[23]) + t_us, t_us // 1000
    elif kind == _PRESSURE:
        v[1] = values_of.pressure_hpa(amsl)
    elif kind in (_ESTIMATOR, _VIBRATION):
        v[0] = t_us
    elif kind == _BATTERY:
        charge = _charge(t_us, k, s)
        v[0], v[1] = values_of.millivolts(voltage_of(charge)), values_of.percent(charge)
    elif kind == _DRONE:
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7] = values_of.drone_location(position, velocity, origin, home)
    elif kind == _DRONE_SYSTEM:
        v[0] = values_of.unix_seconds(int(s[23]) + t_us)
    return True


@used_by_kernels
def _charge(t_us: int, k: Any, s: Any) -> float:
    """The battery's at the last decision."""
    return charge_after(t_us - round(k[52]) - s[18], Drain(s[15], s[16], s[17]))


@used_by_kernels
def _checksum(out: Any, begin: int, end: int, extra: int) -> int:
    """CRC-16/MCRF4XX of out[begin:end] and the extra byte."""
    crc = 0xFFFF
    for i in range(begin, end + 1):
        x = (int(out[i]) if i < end else extra) ^ (crc & 0xFF)
        x ^= (x << 4) & 0xFF
        crc = (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    return crc


@used_by_kernels
def _frame(
    out: Any, at: int, kinds: Any, fields: Any, templates: Any, kind: int, v: Any, single: Any, sequence: int
) -> int:
    """One MAVLink 2 frame from `at` on; gives its end. `single` is a float of four bytes, and the same bytes."""
    first, last, size, message_id, extra, place = kinds[kind]
    payload = at + 10
    for i in range(size):
        out[payload + i] = templates[place + i]
    value, parts = single
    for j in range(first, last):
        to, is_float, width = payload + fields[j, 0], fields[j, 1], fields[j, 2]
        number = v[j - first]
        if is_float:
            value[0] = number
            for i in range(4):
                out[to + i] = parts[i]
        else:
            whole = int(number)
            for i in range(width):
                out[to + i] = (whole >> (8 * i)) & 0xFF
    while size > 1 and out[payload + size - 1] == 0:
        size -= 1
    out[at], out[at + 1], out[at + 2], out[at + 3] = 0xFD, size, 0, 0
    out[at + 4], out[at + 5], out[at + 6] = sequence, 1, 1
    out[at + 7], out[at + 8], out[at + 9] = message_id & 0xFF, (message_id >> 8) & 0xFF, message_id >> 16
    end = payload + size
    crc = _checksum(out, at + 1, end, extra)
    out[end], out[end + 1] = crc & 0xFF, crc >> 8
    return int(end + 2)


@used_by_kernels
def _next(timetable: Any, first: int, end: int, t_us: int) -> int:
    """The stream that is due first by t_us, -1 when none is."""
    best = -1
    for j in range(first, end):
        due = timetable[0, j]
        if due <= t_us and (
            best < 0 or due < timetable[0, best] or (due == timetable[0, best] and timetable[1, j] < timetable[1, best])
        ):
            best = j
    return best


@used_by_kernels
def _is_known(timetable: Any, streams: int, t_us: int) -> bool:
    unknown = 0
    for j in range(streams):
        unknown += timetable[0, j] <= t_us and timetable[3, j] == _UNKNOWN
    return unknown == 0


@used_by_kernels
def _earliest(timetable: Any, first_kind: int) -> int:
    """When a stream of this kind or a later one is due next."""
    earliest = _NEVER_US
    for j in range(timetable.shape[1]):
        if timetable[3, j] >= first_kind:
            earliest = min(earliest, timetable[0, j])
    return earliest


@used_by_kernels
def _send(
    timetable: Any,
    links: Any,
    tables: Any,
    rows: Any,
    s: Any,
    range_m: float,
    bottom_m: float,
    tape: Any,
    tape_at: int,
    pings: int,
    out: Any,
    frames: Any,
    from_us: int,
    first: int,
    last: int,
) -> tuple[int, int, int, int, int, int]:
    """Messages of the steps `first` to `last`; step 0 is at from_us. `timetable` and `links` go on.

    Gives where it stopped, frames, the place on the tape, the last step with a message, frames before the last of all steps, and the
    number of the last PING.
    """
    kinds, fields, templates = tables
    rows_b, rows_e, rows_k = rows
    v, value = np.empty(_MOST_FIELDS), np.empty(1, np.float32)
    parts = value.view(np.uint8)
    i, streams, count, before, end, last_step = first, timetable.shape[1], 0, 0, 0, -1
    while i <= last:
        i = max(i, -((from_us - _earliest(timetable, 0)) // _STEP_US))
        t_us = from_us + i * _STEP_US
        if i > last or not _is_known(timetable, streams, t_us):
            break
        last_step = i
        imu_at = -1
        for link in range(links.shape[0]):
            while True:
                j = _next(timetable, links[link, 0], links[link, 1], t_us)
                if j < 0:
                    break
                timetable[0, j] = max(timetable[0, j] + timetable[2, j], t_us + 1)
                kind = timetable[3, j]
                if kinds[kind, 2] == 0:
                    continue
                if kind == _IMU and imu_at < 0:
                    imu_at = tape_at
                    tape_at += values_of.IMU_NUMBERS if s[13] > 0.0 else 0
                pings += kind == _PING
                if not _fill(
                    kind,
                    v,
                    t_us,
                    rows_b[i],
                    rows_e[i],
                    rows_k[i],
                    s,
                    range_m,
                    bottom_m,
                    tape,
                    imu_at,
                    links[link],
                    pings,
                ):
                    continue
                timetable[4, j] = t_us
                begin = end
                end = _frame(out, begin, kinds, fields, templates, kind, v, (value, parts), links[link, 2])
                links[link, 2] = (links[link, 2] + 1) & 0xFF
                links[link, 3] += 1
                links[link, 4] += end - begin
                frames[count, 0], frames[count, 1], frames[count, 2] = begin, end, link
                count += 1
                before += i < last
        i += 1
    return i, count, tape_at, last_step, before, pings


@compiled
def fly_and_send(
    b: Any,
    e: Any,
    k: Any,
    rows_b: Any,
    rows_e: Any,
    rows_k: Any,
    tape: Any,
    at: int,
    constants: Any,
    wanted: Any,
    wanted_next: Any,
    air: Any,
    gusts: Any,
    gust_at: int,
    steps: int,
    quiet_steps: int,
    is_estimated: bool,
    kept_from: int,
    timetable: Any,
    links: Any,
    kinds: Any,
    fields: Any,
    templates: Any,
    slow: Any,
    range_m: float,
    bottom_m: float,
    imu_tape: Any,
    imu_at: int,
    pings: int,
    out: Any,
    frames: Any,
    from_us: int,
    first: int,
    last: int,
) -> tuple[int, bool, int, int, int, int, int, int, int, int, int, int]:
    """`fly_steadily`, and the messages of the steps from `first` on; with no steps to fly those of steps flown before, up to `last`.

    Every array by itself: numba takes a tuple of arrays more slowly. Gives what `fly_steadily` and `_send` give, and when a message
    and when a fresh template is due next.
    """
    rows = (rows_b, rows_e, rows_k)
    done, waits, at, gust_at = fly_steadily(
        b,
        e,
        k,
        rows,
        tape,
        at,
        constants,
        wanted,
        wanted_next,
        air,
        gusts,
        gust_at,
        steps,
        quiet_steps,
        is_estimated,
        kept_from,
    )
    stopped_at, count, imu_at, last_step, before, pings = _send(
        timetable,
        links,
        (kinds, fields, templates),
        rows,
        slow,
        range_m,
        bottom_m,
        imu_tape,
        imu_at,
        pings,
        out,
        frames,
        from_us,
        first,
        done - 1 if steps > 0 else last,
    )
    next_us, next_fresh_us = _earliest(timetable, 0), _earliest(timetable, FIRST_FRESH)
    return done, waits, at, gust_at, stopped_at, count, imu_at, last_step, before, pings, next_us, next_fresh_us
