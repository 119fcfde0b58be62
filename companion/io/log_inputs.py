"""Recorded telemetry of any vehicle as timed messages of the vocabulary, and the setpoints somebody else sent to it.

A .tlog goes frame by frame through a Session, whose now is the time of the log; a .ulg (PX4's own log, with the extra `ulog`)
is translated topic by topic. A .tlog's stamps carry no checksum: a jump that the next frame does not confirm is a damaged
stamp, and the frame is left out and counted. Times are ns of the log's clock.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from companion import config
from companion.io.tlog import read_frames
from companion.mavlink import codec, dialect
from companion.mavlink.session import Session
from companion.messages import (
    AutopilotMode,
    LandedState,
    RangeMeasurement,
    SensorInput,
    ThrustReport,
    Vec3,
    VehicleState,
    VehicleStatus,
)

LONGEST_GAP_US = 10_000_000
"""A longer silence is passed over in one step: nobody ticks through a night."""

LATEST_US = 4_102_444_800_000_000
"""Year 2100: a later stamp is damaged, and its nanoseconds may not fit into the answers that a session makes."""

VELOCITY_IGNORED = 0x38
STATUS_PERIOD_NS = 200_000_000


@dataclass(frozen=True, slots=True)
class RecordedSetpoint:
    """A velocity that somebody asked for, W."""

    t_ns: int
    velocity_ned_m_s: Vec3


@dataclass(slots=True)
class LogInputs:
    """`messages` may be iterated once; `setpoints` and `skipped` are complete only after that."""

    messages: Iterator[tuple[int, SensorInput]]
    setpoints: list[RecordedSetpoint] = field(default_factory=list)
    skipped: int = 0
    first_ns: int | None = None


class LogInputsError(ValueError):
    """The log cannot be read at all; the text says why."""


# ---------------------------------------------------------------------------------------------------------------- tlog


def tlog_inputs(path: Path, link: config.Link) -> LogInputs:
    """What a session makes of the frames of a .tlog."""
    found = LogInputs(iter(()))
    found.messages = _through_session(path, link, found)
    return found


def _through_session(path: Path, link: config.Link, found: LogInputs) -> Iterator[tuple[int, SensorInput]]:
    session: Session | None = None
    now_ns = 0
    for t_us, frame in _steady(read_frames(path), found):
        gap = session is not None and t_us * 1000 - now_ns > LONGEST_GAP_US * 1000
        now_ns = t_us * 1000
        if session is None:
            session = Session(link, now_ns)
            found.first_ns = now_ns
        if gap:
            yield from ((now_ns, message) for message in session.handle_timer(now_ns))
        due_ns = session.next_timer_ns()
        while not gap and due_ns is not None and due_ns <= now_ns:
            yield from ((due_ns, message) for message in session.handle_timer(due_ns))
            due_ns = session.next_timer_ns()
        yield from ((now_ns, message) for message in session.receive_datagram(frame, now_ns))
        session.datagrams_to_send()
        _keep_setpoint(frame, now_ns, link, found)
    if session is not None:
        found.skipped += session.counters.bytes_skipped


def _steady(frames: Iterator[tuple[int, bytes]], found: LogInputs) -> Iterator[tuple[int, bytes]]:
    """Frames in order of time, without those whose stamp the next frame does not confirm."""
    last_us: int | None = None
    held: tuple[int, bytes] | None = None
    for t_us, frame in frames:
        if t_us > LATEST_US:
            found.skipped += 1
            continue
        near_last = last_us is not None and abs(t_us - last_us) <= LONGEST_GAP_US
        if near_last:
            found.skipped += held is not None
            held = None
            last_us = max(last_us or 0, t_us)
            yield last_us, frame
        elif held is not None and abs(t_us - held[0]) <= LONGEST_GAP_US and (last_us is None or held[0] > last_us):
            yield held
            last_us, held = max(held[0], t_us), None
            yield last_us, frame
        else:
            found.skipped += held is not None
            held = (t_us, frame)
    if held is not None and last_us is None:
        yield held


def _keep_setpoint(frame: bytes, now_ns: int, link: config.Link, found: LogInputs) -> None:
    if codec.message_id(frame) not in _SETPOINT_IDS:
        return
    received = codec.decode(frame)
    if received is None or not isinstance(received.message, dialect.SetPositionTargetLocalNed):
        return
    asked = received.message
    is_velocity = not asked.type_mask & VELOCITY_IGNORED and asked.target_system in (0, link.target_system)
    if is_velocity and codec.finite(asked.vx, asked.vy, asked.vz):
        found.setpoints.append(RecordedSetpoint(now_ns, (asked.vx, asked.vy, asked.vz)))


_SETPOINT_IDS = frozenset({codec.BY_TYPE[dialect.SetPositionTargetLocalNed].message_id})


# ---------------------------------------------------------------------------------------------------------------- ulog

_NAV_STATES = {
    0: AutopilotMode.MANUAL,
    1: AutopilotMode.ALTITUDE,
    2: AutopilotMode.POSITION,
    3: AutopilotMode.MISSION,
    4: AutopilotMode.HOLD,
    5: AutopilotMode.RETURN,
    10: AutopilotMode.ACRO,
    13: AutopilotMode.TERMINATION,
    14: AutopilotMode.OFFBOARD,
    15: AutopilotMode.STABILIZED,
    17: AutopilotMode.TAKEOFF,
    18: AutopilotMode.LAND,
    19: AutopilotMode.FOLLOW,
    20: AutopilotMode.PRECISION_LAND,
}
"""PX4's vehicle_status.nav_state."""

_TOPICS = (
    "vehicle_local_position",
    "vehicle_attitude",
    "vehicle_angular_velocity",
    "vehicle_status",
    "vehicle_land_detected",
    "vehicle_thrust_setpoint",
    "distance_sensor",
    "trajectory_setpoint",
)


def read_ulog(path: Path, topics: tuple[str, ...] | None = None) -> Any:
    """pyulog's ULog; LogInputsError where the extra is missing or the file is none."""
    try:
        from pyulog.core import ULog
    except ImportError as error:
        raise LogInputsError("reading .ulg needs pyulog: pip install 'companion[ulog]'") from error
    try:
        return ULog(io.BytesIO(path.read_bytes()), None if topics is None else list(topics))  # type: ignore[no-untyped-call]
    except OSError as error:
        raise LogInputsError(f"{path}: cannot be read: {error.strerror}") from error
    except Exception as error:  # pyulog raises anything from struct.error to KeyError on damaged files
        raise LogInputsError(f"{path}: pyulog cannot read it: {type(error).__name__}: {error}") from error


def ulog_inputs(path: Path) -> LogInputs:
    """State, status, range, thrust and setpoints of a PX4 flight log; times are PX4's boot clock."""
    topics = {data.name: data.data for data in reversed(read_ulog(path, _TOPICS).data_list)}
    rows = [row for name in _TOPICS if name in topics for row in _rows(name, topics[name])]
    kept = _longest_stretch(sorted(rows, key=lambda row: row[0]))
    found = LogInputs(iter(()), skipped=len(rows) - len(kept), first_ns=kept[0][0] if kept else None)
    found.messages = _translated(kept, found)
    return found


Row = tuple[int, str, dict[str, Any]]


def _longest_stretch(rows: list[Row]) -> list[Row]:
    """The rows between two long silences that are most: damaged times stand far out."""
    cuts = [i for i in range(1, len(rows)) if rows[i][0] - rows[i - 1][0] > LONGEST_GAP_US * 1000]
    stretches = [rows[a:b] for a, b in pairwise([0, *cuts, len(rows)])]
    return max(stretches, key=len)


def _rows(name: str, columns: dict[str, Any]) -> list[Row]:
    keys = list(columns)
    lists = [columns[key].tolist() for key in keys]
    return [(values[0] * 1000, name, dict(zip(keys, values, strict=True))) for values in zip(*lists, strict=True)]


@dataclass(slots=True)
class _UlogState:
    """What the rows so far have said, as far as later rows need it."""

    q: tuple[float, float, float, float] | None = None
    rates: Vec3 = (0.0, 0.0, 0.0)
    landed: LandedState = LandedState.UNDEFINED
    status: dict[str, Any] | None = None
    told_ns: int = 0


def _translated(rows: list[Row], found: LogInputs) -> Iterator[tuple[int, SensorInput]]:
    known = _UlogState()
    for t_ns, name, row in rows:
        try:
            message = _READERS[name](row, t_ns, known, found)
        except KeyError:  # a topic of another version of PX4
            found.skipped += 1
            continue
        if message is not None:
            yield t_ns, message
        if known.status is not None and t_ns - known.told_ns >= STATUS_PERIOD_NS:
            known.told_ns = t_ns
            yield t_ns, _status(known, known.status, t_ns)


def _state(row: dict[str, Any], t_ns: int, known: _UlogState, _: LogInputs) -> SensorInput | None:
    numbers = tuple(float(row[key]) for key in ("x", "y", "z", "vx", "vy", "vz"))
    if known.q is None or not codec.finite(*numbers) or not row.get("xy_valid", 1):
        return None
    counter = int(row.get("xy_reset_counter", 0)) + int(row.get("z_reset_counter", 0))
    x, y, z, vx, vy, vz = numbers
    return VehicleState(t_ns, (x, y, z), (vx, vy, vz), known.q, known.rates, counter & 0xFF)


def _attitude(row: dict[str, Any], _t_ns: int, known: _UlogState, _: LogInputs) -> None:
    w, x, y, z = (float(row[f"q[{i}]"]) for i in range(4))
    if codec.finite(w, x, y, z) and 0.9 < math.hypot(w, x, y, z) < 1.1:
        known.q = (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)


def _rates(row: dict[str, Any], _t_ns: int, known: _UlogState, _: LogInputs) -> None:
    known.rates = (float(row["xyz[0]"]), float(row["xyz[1]"]), float(row["xyz[2]"]))


def _on_status(row: dict[str, Any], t_ns: int, known: _UlogState, _: LogInputs) -> SensorInput:
    status = _status(known, row, t_ns)
    known.status, known.told_ns = row, t_ns
    return status


def _status(known: _UlogState, row: dict[str, Any], t_ns: int) -> VehicleStatus:
    intended = row.get("nav_state_user_intention")
    return VehicleStatus(
        t_ns=t_ns,
        connected=True,
        armed=int(row["arming_state"]) == 2,
        mode=_NAV_STATES.get(int(row["nav_state"]), AutopilotMode.OTHER),
        intended_mode=None if intended is None else _NAV_STATES.get(int(intended), AutopilotMode.OTHER),
        landed_state=known.landed,
        failsafe=bool(row.get("failsafe", 0)),
        ready_to_arm=None,
        battery_fraction=None,
        home_position_ned_m=None,
        link_age_s=0.0,
    )


def _landed(row: dict[str, Any], _t_ns: int, known: _UlogState, _: LogInputs) -> None:
    known.landed = LandedState.ON_GROUND if row["landed"] else LandedState.IN_AIR


def _thrust(row: dict[str, Any], t_ns: int, _known: _UlogState, _: LogInputs) -> SensorInput | None:
    thrust = -float(row["xyz[2]"])
    return ThrustReport(t_ns, thrust) if math.isfinite(thrust) else None


def _range(row: dict[str, Any], t_ns: int, _known: _UlogState, _: LogInputs) -> SensorInput:
    distance, low, high = (float(row[key]) for key in ("current_distance", "min_distance", "max_distance"))
    good = math.isfinite(distance) and low <= distance <= high and int(row.get("signal_quality", -1)) != 0
    return RangeMeasurement(t_ns, distance if good else None, low, high)


def _setpoint(row: dict[str, Any], t_ns: int, _known: _UlogState, found: LogInputs) -> None:
    x, y, z = (float(row[f"velocity[{i}]"]) for i in range(3))
    if codec.finite(x, y, z):
        found.setpoints.append(RecordedSetpoint(t_ns, (x, y, z)))


_READERS = {
    "vehicle_local_position": _state,
    "vehicle_attitude": _attitude,
    "vehicle_angular_velocity": _rates,
    "vehicle_status": _on_status,
    "vehicle_land_detected": _landed,
    "vehicle_thrust_setpoint": _thrust,
    "distance_sensor": _range,
    "trajectory_setpoint": _setpoint,
}
