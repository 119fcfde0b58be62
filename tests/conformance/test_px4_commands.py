"""Every command that was sent to a real PX4, sent to the simulated one: same acknowledgements, same mode and arming, same texts.

The 159 rows of the recording are one session (with reboots where the real one was rebooted); each row starts from the state the one
before has left. Rows the simulator answers otherwise are in DEVIATIONS with the reason, and in docs/simulator-conformance.md.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import nan
from pathlib import Path

import pytest
from px4_rig import LOITER, OFFBOARD, VELOCITY_MASK, Rig
from pymavlink.dialects.v20 import development as mavlink

RECORDED = Path(__file__).resolve().parents[1] / "data" / "px4" / "commands.csv"
RESULTS = {"ACCEPTED": 0, "TEMPORARILY_REJECTED": 1, "DENIED": 2, "UNSUPPORTED": 3, "FAILED": 4}

DEVIATIONS: dict[str, str] = {}

MODES = {
    "MANUAL": (1, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "AUTO.MISSION": (4, 4),
    "AUTO.LOITER": (4, 3),
    "AUTO.TAKEOFF": (4, 2),
    "AUTO.RTL": (4, 5),
    "AUTO.LAND": (4, 6),
    "AUTO.FOLLOW": (4, 8),
    "AUTO.PRECLAND": (4, 9),
    "ACRO": (5, 0),
    "OFFBOARD(no stream)": (6, 0),
    "STABILIZED": (7, 0),
    "AUTO sub=0": (4, 0),
    "AUTO sub=1 READY": (4, 1),
    "main=99": (99, 0),
    "TERMINATION": (10, 0),
}

Action = Callable[[Rig], None]


@dataclass(frozen=True)
class Outcome:
    """What a row led to."""

    acks: list[tuple[int, int]]
    before: str
    after: str
    landed_after: int
    texts: list[str]


def set_mode(main: float, sub: float, flags: float = 1.0, wait_s: float = 0.3) -> Action:
    def act(rig: Rig) -> None:
        rig.command(176, flags, main, sub)
        rig.run(wait_s)

    return act


def command(number: int, *parameters: float, wait_s: float = 0.3, to: tuple[int, int] = (1, 1)) -> Action:
    def act(rig: Rig) -> None:
        rig.command(number, *parameters, to=to)
        rig.run(wait_s)

    return act


def command_int(number: int, *parameters: float) -> Action:
    def act(rig: Rig) -> None:
        p = [*parameters, *([0.0] * (4 - len(parameters)))]
        rig.send(mavlink.MAVLink_command_int_message(1, 1, 0, number, 0, 0, *p, 0, 0, 0.0))
        rig.run(0.3)

    return act


def request_just_sent(rig: Rig) -> None:
    """A request for a message whose newest data has gone out already is denied; the recording caught such a moment."""
    link = rig.autopilot.endpoint.links["onboard"]
    rig.run_until(lambda: link.streams[32].last_sent_us == rig.t_us - 4_000, 1.0)
    command(512, 32)(rig)


def old_set_mode(custom_mode: int) -> Action:
    def act(rig: Rig) -> None:
        rig.send(mavlink.MAVLink_set_mode_message(1, 1, custom_mode))
        rig.run(0.3)

    return act


def wait(duration_s: float) -> Action:
    return lambda rig: rig.run(duration_s)


def take_off(rig: Rig) -> None:
    rig.command(22, *[nan] * 7)
    rig.run(0.3)
    rig.arm()
    rig.run(11.0)


def stream_then_offboard(rig: Rig) -> None:
    rig.stream_velocity(0.0, 0.0, 0.0)
    rig.run(1.5)
    set_mode(6, 0)(rig)


def arm_after_stream_stopped(rig: Rig) -> None:
    rig.stop_streams()
    rig.run(2.0)
    rig.arm()
    rig.run(0.3)


def loiter_without_stream(rig: Rig) -> None:
    set_mode(4, 3, wait_s=1.0)(rig)
    rig.stop_streams()
    rig.run(1.5)


def offboard_late(rig: Rig) -> None:
    rig.stream_velocity(0.0, 0.0, 0.0)
    rig.run(1.0)
    rig.stop_streams()
    rig.run(0.7)
    rig.command(176, 1.0, 6.0, 0.0)
    rig.run(3.0)


def one_setpoint(delay_s: float) -> Action:
    def act(rig: Rig) -> None:
        rig.velocity(0.0, 0.0, 0.0)
        rig.run(delay_s)
        rig.command(176, 1.0, 6.0, 0.0)
        rig.run(2.5)

    return act


def setpoint(frame: int = 1, mask: int = VELOCITY_MASK, system: int = 1) -> Action:
    def act(rig: Rig) -> None:
        rig.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, system, 1, frame, mask, 0, 0, 0, 0.1, 0, 0, 0, 0, 0, 0, 0
            )
        )
        rig.run(0.3)

    return act


def precland_on_target(rig: Rig) -> None:
    def send() -> None:
        rig.send(mavlink.MAVLink_landing_target_message(0, 0, 1, 0, 0, 0, 0, 0, 1.5, 1.0, 0.0, (1, 0, 0, 0), 2, 1))

    rig.every.append((rig.t_us, 50_000, send))
    rig.command(176, 1.0, 4.0, 9.0)
    rig.run_until(lambda: not rig.is_armed, 70.0)


ACTIONS: dict[str, Action] = {
    "GND REQUEST_MESSAGE AUTOPILOT_VERSION(148)": command(512, 148),
    "GND REQUEST_MESSAGE HOME_POSITION(242)": command(512, 242),
    "GND REQUEST_MESSAGE LOCAL_POSITION_NED(32)": request_just_sent,
    "GND REQUEST_MESSAGE unknown msg 9999": command(512, 9999),
    "GND REQUEST_MESSAGE LANDING_TARGET(149) (no data)": command(512, 149),
    "GND REQUEST_MESSAGE PROTOCOL_VERSION(300)": command(512, 300),
    "GND REQUEST_AUTOPILOT_CAPABILITIES(520)": command(520, 1),
    "GND SET_MESSAGE_INTERVAL LOCAL_POSITION_NED 50Hz": command(511, 32, 20_000),
    "GND SET_MESSAGE_INTERVAL LPN -1 (disable)": command(511, 32, -1),
    "GND SET_MESSAGE_INTERVAL LPN 0 (default)": command(511, 32, 0),
    "GND SET_MESSAGE_INTERVAL HEARTBEAT": command(511, 0, 100_000),
    "GND SET_MESSAGE_INTERVAL unknown 9999": command(511, 9999, 100_000),
    "GND SET_MESSAGE_INTERVAL 149 LANDING_TARGET": command(511, 149, 100_000),
    "GND GET_MESSAGE_INTERVAL 32": command(510, 32),
    "GND unknown command 44444": command(44444),
    "GND MAV_CMD_USER_1 31010": command(31010),
    "GND command to wrong system 7": command(400, 1, to=(7, 1)),
    "GND command to system 0 comp 0 (broadcast) DO_SET_MODE LOITER": command(176, 1, 4, 3, to=(0, 0)),
    "GND command to comp 190": command(400, 1, to=(1, 190)),
    "GND DO_FLIGHTTERMINATION 1 disarmed": command(185, 1),
    "GND DO_FLIGHTTERMINATION 0 disarmed": command(185, 0),
    "GND DISARM while disarmed": command(400, 0),
    # In spite of the row's name nothing was armed: the fraction is cut off.
    "GND ARM param1=0.7 (rounds to 1)": command(400, 0.7),
    "GND ARM param1=5": command(400, 5),
    "GND then ARM": command(400, 1),
    "GND then DISARM": command(400, 0),
    "GND then LOITER": set_mode(4, 3),
    "GND DO_SET_MODE base_mode=0 main 4 sub 3": set_mode(4, 3, 0.0),
    "GND DO_SET_MODE base_mode=217 custom LOITER": set_mode(4, 3, 217.0),
    "GND SET_MODE (msg 11) LOITER": old_set_mode(LOITER),
    "GND SET_MODE (msg 11) OFFBOARD": old_set_mode(OFFBOARD),
    "GND back LOITER": set_mode(4, 3),
    "GND ARM in LOITER": command(400, 1, wait_s=1.0),
    "GND ARM again while armed": command(400, 1, wait_s=1.0),
    "GND wait preflight auto-disarm (COM_DISARM_PRFLT)": wait(12.0),
    "GND ARM in LOITER (2)": command(400, 1),
    "GND DISARM on ground": command(400, 0),
    "GND force ARM 21196": command(400, 1, 21196),
    "GND force DISARM 21196": command(400, 0, 21196),
    "GND NAV_TAKEOFF disarmed (all NaN)": command(22, *[nan] * 7),
    "GND NAV_LAND disarmed": command(21),
    "GND ARM in LAND": command(400, 1),
    "GND COMMAND_INT arm": command_int(400, 1.0),
    "GND COMMAND_INT disarm": command_int(400, 0.0),
    "GND DISARMED DO_SET_MODE OFFBOARD with 20Hz stream 1.5s": stream_then_offboard,
    "GND ARM in OFFBOARD (vel 0,0,0 stream)": command(400, 1, wait_s=4.0),
    "GND ARMED on ground OFFBOARD vel 0: wait": wait(8.0),
    "GND DISARM": command(400, 0),
    "GND stop stream, disarmed in OFFBOARD; ARM after 2 s": arm_after_stream_stopped,
    "AIR NAV_TAKEOFF (NaN) then ARM: whole takeoff 12 s": take_off,
    "AIR ARM while flying": command(400, 1),
    "AIR DISARM no force in air": command(400, 0),
    "AIR ARMED in air DO_SET_MODE AUTO.TAKEOFF": set_mode(4, 2, wait_s=1.5),
    "AIR back to LOITER": set_mode(4, 3, wait_s=1.0),
    "AIR LOITER": set_mode(4, 3, wait_s=1.0),
    "AIR SET_MODE msg OFFBOARD no stream": old_set_mode(OFFBOARD),
    "AIR NAV_TAKEOFF while flying": command(22, *[nan] * 7, wait_s=6.0),
    "AIR unknown command 44444": command(44444),
    "AIR AUTO.PRECLAND no target": set_mode(4, 9, wait_s=6.0),
    "AIR AUTO.RTL": set_mode(4, 5, wait_s=5.0),
    "AIR OFFBOARD with 20Hz stream": lambda rig: stream_then_offboard(rig),
    "AIR OFFBOARD again while OFFBOARD": set_mode(6, 0),
    "AIR LOITER while stream goes on": loiter_without_stream,
    "AIR OFFBOARD 0.7 s after the stream stopped": offboard_late,
    "AIR one single setpoint then at once OFFBOARD": one_setpoint(0.004),
    "AIR one single setpoint, 0.2 s later OFFBOARD": one_setpoint(0.2),
    "AIR setpoint frame 7 LOCAL_OFFSET_NED": setpoint(frame=7),
    "AIR setpoint frame 9 BODY_OFFSET_NED": setpoint(frame=9),
    "AIR setpoint frame 12 BODY_FRD": setpoint(frame=12),
    "AIR setpoint mask ignoring everything": setpoint(mask=0xFFF),
    "AIR setpoint to wrong system 9": setpoint(system=9),
    "AIR NAV_LAND: whole landing": command(21, wait_s=16.0),
    "AIR AFTER landing: ARM at once": command(400, 1),
    "AIR DISARM": command(400, 0),
    "KILL takeoff": take_off,
    "KILL force DISARM 21196 in air": command(400, 0, 21196, wait_s=3.0),
    "KILL ARM after crash": command(400, 1),
    "KILL DISARM": command(400, 0),
    "KILL DO_FLIGHTTERMINATION 1 in air": command(185, 1, wait_s=4.0),
    "KILL LOITER after termination": set_mode(4, 3),
    "KILL ARM after termination": command(400, 1),
    "KILL DISARM after termination": command(400, 0),
    "KILL force DISARM after termination": command(400, 0, 21196, wait_s=1.0),
    "KILL ARM after that": command(400, 1, wait_s=2.5),
    "KILL NAV_PRECLAND command 94? (MAV_CMD_NAV_PRECLAND unknown id test 23 LAND_LOCAL)": command(23, wait_s=1.5),
    "KILL AUTO.PRECLAND with LANDING_TARGET position_valid at (1.5,1.0,0) LOCAL_NED 20 Hz": precland_on_target,
}


def action_of(case: str) -> Action:
    if case in ACTIONS:
        return ACTIONS[case]
    if case.startswith("GND then ARM in "):
        return ACTIONS["GND then ARM"]
    name = case.split("DO_SET_MODE ")[-1]
    return set_mode(*MODES[name])


def recorded_rows() -> list[dict[str, str]]:
    with RECORDED.open(encoding="ascii") as file:
        return list(csv.DictReader(file))


ROWS = recorded_rows()


def state_of(rig: Rig) -> str:
    c = rig.autopilot.commander
    return f"{c.base_mode}/{c.custom_mode}/st{c.system_status}"


def recorded_state(text: str) -> str:
    base, custom, _, status = text.split("/")
    return f"{base}/{custom}/{status}"


def booted() -> Rig:
    rig = Rig()
    rig.beat("ground")
    rig.run(6.0)
    return rig


def joined_texts(rig: Rig, since_s: float) -> list[str]:
    texts: list[str] = []
    for message in rig.messages("STATUSTEXT", "ground", since_s):
        if message.chunk_seq:
            texts[-1] += message.text
        else:
            texts.append(message.text)
    return [re.sub(r"-?\d+", "#", text.strip()) for text in texts]


@cache
def session() -> list[Outcome]:
    """Flies all rows once."""
    rig = booted()
    outcomes: list[Outcome] = []
    for row in ROWS:
        if row["case"] == "KILL takeoff" and rig.autopilot.commander.terminated:
            rig = booted()
        since_s = rig.t_s
        before = state_of(rig)
        action_of(row["case"])(rig)
        outcomes.append(
            Outcome(
                rig.acks(since_s),
                before,
                state_of(rig),
                rig.autopilot.telemetry.landed_state,
                joined_texts(rig, since_s),
            )
        )
    return outcomes


def is_same(row: dict[str, str], outcome: Outcome) -> bool:
    acks = [(int(pair.split("/")[1]), RESULTS[pair.split("/")[0]]) for pair in row["acks"].split()]
    return outcome.acks == acks and outcome.after == recorded_state(row["after"])


@pytest.mark.parametrize("index", range(len(ROWS)), ids=[f"{i} {row['case']}" for i, row in enumerate(ROWS)])
def test_a_recorded_command_is_answered_as_by_the_real_px4(index: int) -> None:
    row, outcome = ROWS[index], session()[index]
    if row["case"] in DEVIATIONS:
        assert not is_same(row, outcome), "the deviation is gone: take it off the list"
        return
    acks = [(int(pair.split("/")[1]), RESULTS[pair.split("/")[0]]) for pair in row["acks"].split()]
    assert outcome.before == recorded_state(row["before"])
    assert outcome.acks == acks
    assert outcome.after == recorded_state(row["after"])


def test_at_least_95_percent_of_the_recorded_commands_are_answered_the_same() -> None:
    same = sum(is_same(row, outcome) for row, outcome in zip(ROWS, session(), strict=True))
    assert same >= 0.95 * len(ROWS)


@pytest.mark.parametrize("index", range(len(ROWS)), ids=[f"{i} {row['case']}" for i, row in enumerate(ROWS)])
def test_a_recorded_command_brings_the_same_status_texts(index: int) -> None:
    row, outcome = ROWS[index], session()[index]
    wanted = [re.sub(r"-?\d+", "#", text) for text in row["texts"].split(" | ")] if row["texts"] else []
    assert outcome.texts == wanted
