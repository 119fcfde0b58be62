"""Messages and rates on both links against the recording, within 2 %, and what changes them."""

from __future__ import annotations

import csv
import struct
from collections import Counter
from functools import cache
from math import nan
from pathlib import Path

import pytest
from px4_rig import Rig
from pymavlink.dialects.v20 import development as mavlink

RECORDED = Path(__file__).resolve().parents[1] / "data" / "px4" / "rates.csv"
LINKS = {"14540": "onboard", "14550": "ground"}
REAL_TIME_FACTOR = 0.992
"""The recording counted per second of the wall clock, of which simulated time made 0.992."""
ONCE = {"EVENT", "PARAM_VALUE", "STATUSTEXT", "GPS_GLOBAL_ORIGIN"}
"""Sent on an occasion, not at a rate."""
MEASURED_S = 60.0


def recorded_rates() -> list[tuple[str, int, str, float]]:
    with RECORDED.open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return [
        (LINKS[row["link"]], int(row["id"]), row["message"], float(row["rate_hz_after_20s"]))
        for row in rows
        if row["message"] not in ONCE
    ]


def ids(rig: Rig, since_us: int) -> Counter[tuple[str, int]]:
    """Messages of the vehicle itself by link and id."""
    return Counter(
        (link, data[7] | data[8] << 8 | data[9] << 16)
        for t_us, link, data in rig.raw
        if t_us >= since_us and data[5] == data[6] == 1
    )


@cache
def counted() -> Counter[tuple[str, int]]:
    """Messages of a minute after the first 20 s of a cold boot, with heartbeats of a companion and a ground station."""
    rig = Rig(cold_boot=True)
    rig.beat("ground")
    rig.run(20.0)
    rig.raw.clear()
    rig.run(MEASURED_S)
    return ids(rig, 0)


@pytest.mark.parametrize(("link", "message_id", "name", "rate_hz"), recorded_rates())
def test_a_message_comes_at_the_recorded_rate(link: str, message_id: int, name: str, rate_hz: float) -> None:
    count = counted()[link, message_id]
    wanted = rate_hz / REAL_TIME_FACTOR * MEASURED_S
    # One message more or less is the phase of the window.
    assert abs(count - wanted) <= max(0.02 * wanted, 1.5), f"{name}: {count} in a minute, wanted {wanted:.1f}"


def test_nothing_is_streamed_that_the_real_px4_does_not_stream() -> None:
    known = {(link, message_id) for link, message_id, _, _ in recorded_rates()}
    occasional = {22, 49, 253, 410}
    assert {key for key in counted() if key[1] not in occasional} <= known


def test_the_ground_link_can_be_switched_off() -> None:
    rig = Rig(options={"ground_link": False})
    rig.run(1.0)
    assert {link for _, link, _ in rig.raw} == {"onboard"}


@pytest.mark.parametrize(
    ("message_id", "asked_hz", "got_hz"),
    [
        (32, 50.0, 50.0),
        (32, 100.0, 100.0),
        (32, 1000.0, 125.0),
        (30, 250.0, 250.0),
        (30, 1000.0, 250.0),
        (115, 50.0, 50.0),
    ],
)
def test_an_interval_can_be_set_down_to_that_of_the_data(message_id: int, asked_hz: float, got_hz: float) -> None:
    rig = Rig()
    rig.run(1.0)
    rig.command(511, message_id, 1e6 / asked_hz)
    rig.run(0.2)
    start_us = rig.t_us
    rig.run(2.0)
    assert abs(ids(rig, start_us)["onboard", message_id] - 2.0 * got_hz) <= 0.02 * 2.0 * got_hz + 1
    assert (511, 0) in rig.acks()


def test_an_interval_of_minus_one_stops_a_stream_and_zero_restores_it() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.command(511, 32, -1)
    start_us = rig.t_us
    rig.run(1.0)
    assert ids(rig, start_us)["onboard", 32] == 0
    rig.command(511, 32, 0)
    start_us = rig.t_us
    rig.run(1.0)
    assert ids(rig, start_us)["onboard", 32] == 30


def test_status_texts_go_only_to_links_on_which_a_ground_station_beats() -> None:
    rig = Rig()
    rig.beat("onboard", kind=18)
    rig.run(1.0)
    rig.arm()
    rig.run(0.5)
    assert rig.texts("onboard") == []
    assert rig.texts("ground") == []
    assert 0x190CAF3 in rig.events()
    rig.beat("onboard", kind=6)
    rig.run(0.5)
    rig.command(400, 0)
    rig.run(0.5)
    assert rig.texts("onboard") == ["Disarmed by external command\t"]


def test_a_text_longer_than_50_characters_comes_in_chunks() -> None:
    rig = Rig()
    rig.beat("ground")
    rig.run(0.5)
    rig.set_mode(0x00010000)
    rig.arm()
    rig.run(0.1)
    chunks = [(m.chunk_seq, m.text) for m in rig.messages("STATUSTEXT", "ground")]
    assert chunks == [(0, "Arming denied: Resolve system health failures firs"), (1, "t\t")]
    assert len({m.id for m in rig.messages("STATUSTEXT", "ground")}) == 1


def test_heartbeats_are_passed_on_between_the_links() -> None:
    rig = Rig()
    rig.beat("ground")
    rig.beat("onboard", kind=18)
    rig.run(1.0)
    on_board = {(data[5], data[6]) for _, link, data in rig.raw if link == "onboard" and data[7:10] == b"\0\0\0"}
    on_ground = {(data[5], data[6]) for _, link, data in rig.raw if link == "ground" and data[7:10] == b"\0\0\0"}
    assert on_board == {(1, 1), (255, 190)}
    assert on_ground == {(1, 1), (1, 191)}


def test_timesync_is_asked_and_answered() -> None:
    rig = Rig()
    rig.run(0.5)
    rig.send(mavlink.MAVLink_timesync_message(0, 123_456))
    rig.step()
    asked = [m for m in rig.messages("TIMESYNC") if m.tc1 == 0]
    answered = [m for m in rig.messages("TIMESYNC") if m.tc1 != 0]
    assert [m.ts1 for m in asked] == [t * 100_000_000 for t in range(6)]
    assert [(m.tc1, m.ts1) for m in answered] == [(500_000_000, 123_456)]


def test_a_ping_to_all_is_answered_to_its_sender() -> None:
    rig = Rig()
    rig.send(mavlink.MAVLink_ping_message(42, 7, 0, 0))
    rig.step()
    answers = [m for m in rig.messages("PING", "onboard") if m.target_system]
    assert [(m.time_usec, m.seq, m.target_system, m.target_component) for m in answers] == [(42, 7, 1, 191)]


def test_all_parameters_are_listed_with_the_bytes_of_integers() -> None:
    rig = Rig()
    rig.send(mavlink.MAVLink_param_request_list_message(1, 1))
    rig.run(1.0)
    values = {m.param_id: m for m in rig.messages("PARAM_VALUE", "onboard")}
    assert len(values) == 888  # 887 and _HASH_CHECK
    autostart = values["SYS_AUTOSTART"]
    assert autostart.param_type == 6
    assert mavlink_bytes(autostart.param_value) == (10040).to_bytes(4, "little")
    assert values["MPC_XY_P"].param_value == pytest.approx(0.95)


def mavlink_bytes(value: float) -> bytes:

    return struct.pack("<f", value)


def test_a_parameter_is_read_by_name_and_set_on_both_links() -> None:

    rig = Rig()
    rig.run(0.1)
    rig.send(mavlink.MAVLink_param_request_read_message(1, 1, b"COM_OBL_RC_ACT", -1))
    rig.step()
    value = struct.unpack("<f", (5).to_bytes(4, "little"))[0]
    rig.send(mavlink.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", value, 6))
    rig.step()
    seen = [
        (s.link, mavlink_bytes(s.message.param_value)[0]) for s in rig.seen if s.message.get_type() == "PARAM_VALUE"
    ]
    assert seen == [("onboard", 0), ("onboard", 5), ("ground", 5)]
    assert rig.autopilot.parameters["COM_OBL_RC_ACT"] == 5


@pytest.mark.parametrize(("name", "kind"), [(b"NO_SUCH_NAME", 6), (b"COM_OBL_RC_ACT", 9)])
def test_an_unknown_name_or_a_wrong_type_changes_nothing_and_is_not_answered(name: bytes, kind: int) -> None:
    rig = Rig()
    rig.run(0.1)
    rig.send(mavlink.MAVLink_param_set_message(1, 1, name, 1.0, kind))
    rig.step()
    assert rig.messages("PARAM_VALUE") == []
    assert rig.autopilot.parameters["COM_OBL_RC_ACT"] == 0


def test_a_cold_boot_answers_late_and_arms_at_about_four_seconds() -> None:
    rig = Rig(cold_boot=True)
    answers: list[tuple[float, int]] = []
    while rig.t_s < 5.0:
        before = len(rig.acks())
        rig.arm()
        rig.run(0.1)
        answers += [(rig.t_s, result) for _, result in rig.acks()[before:]]
        if rig.is_armed:
            break
    # Recorded: no answer before 1.2 s of the boot clock, refused until 4.0, then armed (0.3 s after the process starts).
    assert 1.1 <= answers[0][0] <= 1.4
    assert {result for _, result in answers[:-1]} == {1}
    assert 3.9 <= rig.t_s <= 4.4


def test_messages_reach_nobody_else_when_a_command_is_for_another_system() -> None:
    rig = Rig()
    rig.command(22, *[nan] * 7, to=(2, 1))
    rig.run(0.2)
    assert rig.acks() == []
