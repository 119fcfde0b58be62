"""The wire: setpoints out and telemetry in, against pymavlink in the same run.

    python benchmarks/mavlink.py

Out: construct and pack SET_POSITION_TARGET_LOCAL_NED, byte-equal. In: the recorded frames of a real PX4, decoded by both; and
the same frames through a whole session, which also stamps, routes and builds messages.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import development as mav

from companion.config import Link
from companion.io.tlog import read_frames
from companion.mavlink import codec, dialect
from companion.mavlink.session import Session
from companion.messages import VelocitySetpoint

LOG = Path(__file__).parents[1] / "tests" / "data" / "px4" / "takeoff_land.tlog"
ROUNDS = 5


def best_us(work: Callable[[], int]) -> float:
    """Microseconds an item, the best of some rounds; `work` returns how many items it did."""
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        count = work()
        times.append((time.perf_counter() - began) / count)
    return min(times) * 1e6


def pack_ours() -> int:
    for i in range(20_000):
        codec.encode(
            dialect.SetPositionTargetLocalNed(
                i, 0.0, 0.0, 0.0, 1.5, -0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.5, 1479, 1, 1, 1
            ),
            i & 0xFF,
            1,
            191,
        )
    return 20_000


def pack_pymavlink() -> int:
    encoder = mav.MAVLink(None, 1, 191)
    for i in range(20_000):
        message = mav.MAVLink_set_position_target_local_ned_message(
            i, 1, 1, 1, 1479, 0.0, 0.0, 0.0, 1.5, -0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.5
        )
        message.pack(encoder)
    return 20_000


def setpoint_through_session() -> int:
    session = Session(Link(), 0)
    for i in range(20_000):
        setpoint = VelocitySetpoint(i, i + 1_000, (1.5, -0.5, 0.25), 0.5, (0.1, 0.2, 0.0))
        session.send_setpoint(setpoint, i)
        session.datagrams_to_send()
    return 20_000


def main() -> None:
    recorded = list(read_frames(LOG))
    known = [frame for _, frame in recorded if codec.message_id(frame) in codec.DEFINITIONS]
    shared = [frame for frame in known if codec.message_id(frame) in mav.mavlink_map]

    def decode_ours() -> int:
        return sum(codec.decode(frame) is not None and bool(codec.frame_is_valid(frame)) for frame in shared)

    def decode_pymavlink() -> int:
        decoder = mav.MAVLink(None)
        return sum(decoder.decode(bytearray(frame)) is not None for frame in shared)

    def through_session() -> int:
        session = Session(Link(), recorded[0][0] * 1000)
        for t_us, frame in recorded:
            session.receive_datagram(frame, t_us * 1000)
        return len(recorded)

    rows = (
        ("pack a setpoint, pymavlink", best_us(pack_pymavlink)),
        ("pack a setpoint, ours", best_us(pack_ours)),
        ("setpoint through a session", best_us(setpoint_through_session)),
        ("decode a frame, pymavlink", best_us(decode_pymavlink)),
        ("decode a frame, ours, with CRC", best_us(decode_ours)),
        ("frame through a session", best_us(through_session)),
    )
    for label, microseconds in rows:
        print(f"{label:<34}{microseconds:>8.2f} us")
    print(f"pack {rows[0][1] / rows[1][1]:.1f} x, decode {rows[3][1] / rows[4][1]:.1f} x pymavlink")


if __name__ == "__main__":
    main()
