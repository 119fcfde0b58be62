"""The table of topics: every row has a schema, what is written can be read, what comes in is checked."""

from __future__ import annotations

from typing import get_args

import msgspec
import pytest

from companion.messages import (
    Health,
    MeasurementVerdict,
    ObservationSource,
    OperatorAction,
    OperatorCommand,
    Output,
    PadBeacon,
    PadEstimate,
    Phase,
    PhaseChanged,
    VehicleState,
)
from companion.telemetry.topics import (
    BY_CONTENT,
    LARGEST_PAYLOAD,
    TOPICS,
    RateLimits,
    Refused,
    name_of,
    payload_of,
    schema_of,
    taken,
)

SHIFT_NS = 1_700_000_000_000_000_000
NOW_NS = 5_000_000_000
STATE = VehicleState(NOW_NS, (1.0, 2.0, -3.0), (0.0, 0.5, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1))


def take(name: str, payload: bytes) -> OperatorCommand | PadBeacon:
    return taken(name, payload, now_ns=NOW_NS, unix_minus_monotonic_ns=SHIFT_NS)


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_every_topic_has_a_schema_that_names_its_fields(topic) -> None:
    content = schema_of(topic)["$defs"][topic.content.__name__]
    fields = {field.name for field in msgspec.inspect.type_info(topic.content).fields}
    assert fields <= set(content["properties"])
    assert content["type"] == "object"


def test_no_two_topics_share_a_name_or_a_content() -> None:
    assert len({topic.name for topic in TOPICS}) == len(TOPICS) == len(BY_CONTENT)


def test_whatever_the_pipeline_gives_out_is_published() -> None:
    assert {output.__name__ for output in get_args(Output) if output not in BY_CONTENT} == set()


def test_every_verdict_is_published_with_its_reason_innovation_and_nis() -> None:
    limits = RateLimits()
    verdicts = [
        MeasurementVerdict(NOW_NS, ObservationSource.VISION_POSE, True, "fused", 2.5, (0.1, -0.2, 0.3)),
        MeasurementVerdict(NOW_NS, ObservationSource.BEACON, False, "older than the history"),
    ]
    assert [limits.passes(verdict) for verdict in verdicts] == [True, True]
    sent = [msgspec.json.decode(payload_of(verdict, unix_minus_monotonic_ns=SHIFT_NS)) for verdict in verdicts]
    assert [content["reason"] for content in sent] == ["fused", "older than the history"]
    assert sent[0]["innovation"] == [0.1, -0.2, 0.3]
    assert sent[0]["nis"] == 2.5
    assert "model_probabilities" in schema_of(BY_CONTENT[PadEstimate])["$defs"]["PadEstimate"]["properties"]


def test_a_payload_reads_back_as_the_message_and_says_the_time_on_the_wall_clock() -> None:
    payload = payload_of(STATE, unix_minus_monotonic_ns=SHIFT_NS)
    assert msgspec.json.decode(payload, type=VehicleState) == STATE
    assert msgspec.json.decode(payload)["t_unix_ns"] == NOW_NS + SHIFT_NS


def test_a_stream_is_thinned_to_its_rate_and_events_are_not() -> None:
    limits = RateLimits()
    states = [VehicleState(t, *_rest()) for t in range(0, 2_000_000_000, 20_000_000)]
    assert sum(limits.passes(state) for state in states) == 20
    change = PhaseChanged(0, Phase.IDLE, Phase.ENGAGE, "operator: start")
    assert [limits.passes(change) for _ in range(3)] == [True, True, True]


def _rest() -> tuple:
    return STATE.position_ned_m, STATE.velocity_ned_m_s, STATE.q_ned_frd, STATE.angular_velocity_frd_rad_s


def test_a_clock_that_went_back_does_not_silence_a_stream() -> None:
    limits = RateLimits()
    assert limits.passes(VehicleState(10_000_000_000, *_rest()))
    assert limits.passes(VehicleState(1_000_000_000, *_rest()))


def test_a_subject_becomes_one_level_of_the_topic() -> None:
    health = Health(0, "camera down/+#", 2, "dead")
    assert name_of(BY_CONTENT[Health], health) == "health/camera_down___"


def test_a_command_is_taken_and_stamped_on_the_monotonic_clock() -> None:
    assert take("command", b'{"action": "go_around", "source": "tower"}') == OperatorCommand(
        NOW_NS, OperatorAction.GO_AROUND, "tower"
    )


def test_a_beacon_is_stamped_with_when_it_was_true() -> None:
    sent = SHIFT_NS + NOW_NS - 120_000_000
    beacon = take("pad", b'{"position_ned_m": [1, 2, 0.5], "yaw_rad": 0.3, "t_unix_ns": %d}' % sent)
    assert isinstance(beacon, PadBeacon)
    assert (beacon.t_ns, beacon.position_ned_m, beacon.yaw_rad) == (NOW_NS - 120_000_000, (1.0, 2.0, 0.5), 0.3)


def test_a_sender_whose_clock_is_a_little_ahead_is_taken_at_its_arrival() -> None:
    ahead = SHIFT_NS + NOW_NS + 100_000_000
    assert take("pad", b'{"position_ned_m": [0, 0, 0], "t_unix_ns": %d}' % ahead).t_ns == NOW_NS


HOSTILE = {
    "nothing": b"",
    "no json": b"start",
    "not UTF-8": b'{"action": "\xff"}',
    "another action": b'{"action": "takeover"}',
    "an unknown key": b'{"action": "start", "force": true}',
    "no action": b"{}",
    "an array": b"[]",
    "deep nesting": b"[" * 4000,
    "a long one": b'{"action": "start", "source": "' + b"x" * LARGEST_PAYLOAD + b'"}',
    "a long source": b'{"action": "start", "source": "' + b"x" * 61 + b'"}',
    "an old one": b'{"action": "start", "t_unix_ns": %d}' % (SHIFT_NS + NOW_NS - 3_000_000_000),
    "one of tomorrow": b'{"action": "start", "t_unix_ns": %d}' % (SHIFT_NS + NOW_NS + 86_400_000_000_000),
    "a huge stamp": b'{"action": "start", "t_unix_ns": 1' + b"0" * 400 + b"}",
}
HOSTILE_PADS = {
    "infinite": b'{"position_ned_m": [1e999, 0, 0]}',
    "NaN": b'{"position_ned_m": [NaN, 0, 0]}',
    "far": b'{"position_ned_m": [1e9, 0, 0]}',
    "two numbers": b'{"position_ned_m": [1, 2]}',
    "certain beyond doubt": b'{"position_ned_m": [1, 2, 3], "position_sigma_m": 0}',
    "text": b'{"position_ned_m": ["a", 0, 0]}',
}


@pytest.mark.parametrize("payload", HOSTILE.values(), ids=HOSTILE.keys())
def test_a_hostile_command_is_refused_with_a_reason(payload: bytes) -> None:
    with pytest.raises(Refused, match=r"\w"):
        take("command", payload)


@pytest.mark.parametrize("payload", HOSTILE_PADS.values(), ids=HOSTILE_PADS.keys())
def test_a_hostile_beacon_is_refused_with_a_reason(payload: bytes) -> None:
    with pytest.raises(Refused, match=r"\w"):
        take("pad", payload)


def test_another_topic_is_refused() -> None:
    with pytest.raises(Refused, match="no topic"):
        take("command/x", b'{"action": "start"}')
