"""One table: what goes out to people's programs and what may come in, under which topic, how often, in what form.

Read by io/mqtt.py, by the page and by docs/make_mqtt_page.py, which prints it as docs/mqtt.md. A payload is one JSON
object: the message of messages.py field by field, units and frames in the field names, and `t_unix_ns`, the same instant as
`t_ns` on the wall clock, for readers on other computers. What comes in has its own narrow types, checked on arrival.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from companion.messages import (
    AutopilotText,
    CommandResult,
    Health,
    MeasurementVerdict,
    Message,
    MissionView,
    OperatorAction,
    OperatorCommand,
    PadBeacon,
    PadEstimate,
    PadReport,
    PhaseChanged,
    PlanMade,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)

LARGEST_PAYLOAD = 4096
"""Bytes of an incoming message; ours are a few hundred."""
OLDEST_NS = 2_000_000_000
"""A command or beacon older than this is of another moment."""
SLACK_NS = 500_000_000
"""How far ahead of ours the sender's wall clock may be."""

Coordinate = Annotated[float, Meta(ge=-100_000.0, le=100_000.0)]
UnixNs = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Speed = Annotated[float, Meta(ge=-100.0, le=100.0)]


class Refused(ValueError):
    """An incoming message that is not acted on; the text says why."""


class CommandIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A person asks for something. With `t_unix_ns`, a command that comes late (2 s) is refused."""

    action: OperatorAction
    source: Annotated[str, Meta(max_length=60)] = "mqtt"
    t_unix_ns: UnixNs | None = None


class PadIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The pad says where it is, in the autopilot's local NED. `t_unix_ns` is when that was true; without it, the arrival."""

    position_ned_m: tuple[Coordinate, Coordinate, Coordinate]
    velocity_ned_m_s: tuple[Speed, Speed, Speed] | None = None
    yaw_rad: Annotated[float, Meta(ge=-6.3, le=6.3)] | None = None
    position_sigma_m: Annotated[float, Meta(gt=0.0, le=1000.0)] = 1.5
    velocity_sigma_m_s: Annotated[float, Meta(gt=0.0, le=100.0)] = 0.3
    yaw_rate_rad_s: Annotated[float, Meta(ge=-10.0, le=10.0)] | None = None
    source: Annotated[str, Meta(max_length=60)] = "mqtt"
    t_unix_ns: UnixNs | None = None


class Online(msgspec.Struct, frozen=True):
    """`false` is the last will: the broker says it when Companion is gone."""

    online: bool


class Refusal(msgspec.Struct, frozen=True):
    """A message to us that was not acted on, and why."""

    t_unix_ns: int
    topic: str
    reason: str


@dataclass(frozen=True, slots=True)
class Topic:
    """One row. `rate_hz` is the most there is a second, None means every one. `{subject}` in a name is filled from the
    message."""

    name: str
    direction: Literal["out", "in"]
    content: type
    rate_hz: float | None
    is_retained: bool
    qos: int
    about: str


TOPICS = (
    Topic("state", "out", VehicleState, 10.0, False, 0, "the vehicle as the autopilot believes it"),
    Topic("estimate", "out", PadEstimate, 10.0, False, 0, "the pad as Companion believes it"),
    Topic(
        "verdict", "out", MeasurementVerdict, None, False, 0, "what became of each measurement and why, innovation, NIS"
    ),
    Topic(
        "mission", "out", MissionView, 5.0, False, 0, "phase, position and speed against the pad, what is waited for"
    ),
    Topic("status", "out", VehicleStatus, 2.0, True, 0, "mode, armed, landed, battery, age of the link"),
    Topic("setpoint", "out", VelocitySetpoint, 5.0, False, 0, "a sample of what is asked of the autopilot"),
    Topic(
        "report", "out", PadReport, 5.0, False, 0, "guidance only: a sample of what the autopilot is told of the pad"
    ),
    Topic("plan", "out", PlanMade, 1.0, False, 0, "a sample of the plans"),
    Topic("phase", "out", PhaseChanged, None, True, 1, "every change of phase, with its reason"),
    Topic("health/{subject}", "out", Health, None, True, 1, "a condition: 0 fine, 1 warn, 2 fail"),
    Topic("event/command", "out", VehicleCommand, None, False, 1, "Companion asks the autopilot"),
    Topic("event/answer", "out", CommandResult, None, False, 1, "the autopilot answers"),
    Topic("event/text", "out", AutopilotText, None, False, 1, "the autopilot says something to people"),
    Topic("event/operator", "out", OperatorCommand, None, False, 1, "a person's command that was taken, from anywhere"),
    Topic("event/refused", "out", Refusal, None, False, 1, "a message to us that was not acted on"),
    Topic("online", "out", Online, None, True, 1, "true while connected; false is the last will"),
    Topic("command", "in", CommandIn, None, False, 1, "start, hold, abort, go_around, return"),
    Topic("pad", "in", PadIn, 50.0, False, 0, "beacon of the pad"),
)

BY_CONTENT = {topic.content: topic for topic in TOPICS}
INCOMING = {topic.name: topic for topic in TOPICS if topic.direction == "in"}


class RateLimits:
    """Which messages are due, by their own time. State: the last one let through for each topic."""

    def __init__(self) -> None:
        self._last_ns: dict[type, int] = {}

    def passes(self, message: Message) -> bool:
        """A change of phase, an event: always. A stream: where its period has passed."""
        topic = BY_CONTENT.get(type(message))
        if topic is None:
            return False
        if topic.rate_hz is None:
            return True
        last_ns = self._last_ns.get(topic.content)
        if last_ns is not None and 0 <= message.t_ns - last_ns < 1e9 / topic.rate_hz:
            return False
        self._last_ns[topic.content] = message.t_ns
        return True


def name_of(topic: Topic, message: Any) -> str:
    """Without the prefix. A subject becomes one level: `camera down` -> `health/camera_down`."""
    if "{subject}" not in topic.name:
        return topic.name
    subject = "".join(c if c.isalnum() or c in "-_." else "_" for c in message.subject) or "_"
    return topic.name.replace("{subject}", subject)


def payload_of(message: Any, *, unix_minus_monotonic_ns: int) -> bytes:
    """JSON of a message. Time on both clocks where the message has one."""
    content = msgspec.to_builtins(message)
    if "t_ns" in content:
        content = {"t_unix_ns": content["t_ns"] + unix_minus_monotonic_ns, **content}
    return msgspec.json.encode(content)


def schema_of(topic: Topic) -> dict[str, Any]:
    """JSON Schema (2020-12) of the payload."""
    schema = msgspec.json.schema(topic.content)
    for definition in schema["$defs"].values():
        if "description" in definition:  # some versions of msgspec leave a docstring's indentation in it
            definition["description"] = inspect.cleandoc(definition["description"])
    content = schema["$defs"][topic.content.__name__]
    if "t_ns" in content["properties"]:
        content["properties"] = {"t_unix_ns": {"type": "integer"}, **content["properties"]}
        content["required"] = ["t_unix_ns", *content.get("required", ())]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def taken(name: str, payload: bytes, *, now_ns: int, unix_minus_monotonic_ns: int) -> OperatorCommand | PadBeacon:
    """An incoming message as one of ours, stamped on the companion's monotonic clock; Refused says why not."""
    if name not in INCOMING:
        raise Refused("no topic that is listened to")
    if len(payload) > LARGEST_PAYLOAD:
        raise Refused(f"{len(payload)} bytes, at most {LARGEST_PAYLOAD}")
    try:
        content: CommandIn | PadIn = msgspec.json.decode(payload, type=INCOMING[name].content)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise Refused(str(error)) from error
    t_ns = _stamp(content.t_unix_ns, now_ns, unix_minus_monotonic_ns)
    if isinstance(content, CommandIn):
        return OperatorCommand(now_ns, content.action, content.source)
    return PadBeacon(
        t_ns,
        content.source,
        content.position_ned_m,
        content.velocity_ned_m_s,
        content.yaw_rad,
        content.position_sigma_m,
        content.velocity_sigma_m_s,
        content.yaw_rate_rad_s,
    )


def _stamp(t_unix_ns: int | None, now_ns: int, unix_minus_monotonic_ns: int) -> int:
    if t_unix_ns is None:
        return now_ns
    age_ns = now_ns - (t_unix_ns - unix_minus_monotonic_ns)
    if age_ns > OLDEST_NS:
        raise Refused(f"{age_ns / 1e9:.1f} s old")
    if age_ns < -SLACK_NS:
        raise Refused(f"{-age_ns / 1e9:.1f} s in the future: the clocks disagree")
    return now_ns - max(0, age_ns)
