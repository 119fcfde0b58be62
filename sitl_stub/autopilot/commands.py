"""MAVLink commands the vehicle knows, and the result codes of their acknowledgements, as PX4 uses them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class CommandId(IntEnum):
    """MAV_CMD."""

    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_PRECLAND = 23
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_FLIGHTTERMINATION = 185
    DO_REPOSITION = 192
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    COMPONENT_ARM_DISARM = 400
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520


FORCE_MAGIC = 21196


@dataclass(frozen=True, slots=True)
class Command:
    """A command addressed to this vehicle, from COMMAND_LONG, COMMAND_INT or SET_MODE; `parameters` are param1 to param7."""

    id: int
    parameters: tuple[float, float, float, float, float, float, float]
    link: str
    sender: tuple[int, int]
    """System and component to acknowledge to."""
