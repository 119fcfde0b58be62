"""Which messages the companion needs, how often, and the nagging until they come.

PX4 acknowledges MAV_CMD_SET_MESSAGE_INTERVAL without naming the message, and an acknowledged stream can still be silent
(no sensor, lost request, reboot). So nothing is believed but arrivals: a stream that brings less than half of what was
asked within its window is asked for again, with growing pauses. One-time data (the global origin) is requested until it
has come.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from companion.mavlink.dialect import CommandLong

SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512
WINDOW_NS = 2_000_000_000
LONGEST_PAUSE_NS = 16_000_000_000
ENOUGH = 0.5
"""Share of the asked rate that is good enough: a simulator below real time sends less."""

SYS_STATUS, ATTITUDE_QUATERNION, LOCAL_POSITION_NED, HIGHRES_IMU = 1, 31, 32, 105
ATTITUDE_TARGET, DISTANCE_SENSOR, BATTERY_STATUS, HOME_POSITION = 83, 132, 147, 242
EXTENDED_SYS_STATE, ODOMETRY, CURRENT_MODE, GPS_GLOBAL_ORIGIN = 245, 331, 436, 49


def wanted_rates_hz(state_rate_hz: float, status_rate_hz: float) -> dict[int, float]:
    """Message id to rate. Position comes as ODOMETRY (one message, one instant)."""
    return {
        ODOMETRY: state_rate_hz,
        CURRENT_MODE: status_rate_hz,
        EXTENDED_SYS_STATE: status_rate_hz,
        DISTANCE_SENSOR: 20.0,
        ATTITUDE_TARGET: 20.0,
        HIGHRES_IMU: 50.0,
        SYS_STATUS: 2.0,
        BATTERY_STATUS: 1.0,
        HOME_POSITION: 1.0,
    }


@dataclass(slots=True)
class _Stream:
    rate_hz: float
    count: int = 0
    asked_ns: int | None = None
    pause_ns: int = WINDOW_NS


class StreamRequests:
    """Counts arrivals and says which requests to send. One check a window; quiet when everything flows."""

    def __init__(self, rates_hz: Mapping[int, float]) -> None:
        self._streams = {number: _Stream(rate_hz) for number, rate_hz in rates_hz.items()}
        self._missing_once = {GPS_GLOBAL_ORIGIN}
        self._check_ns: int | None = None

    def saw(self, message_id: int) -> None:
        """One message of this id has arrived."""
        stream = self._streams.get(message_id)
        if stream is not None:
            stream.count += 1
        self._missing_once.discard(message_id)

    def start_over(self, now_ns: int) -> None:
        """The autopilot is there, or there again: ask for everything at once."""
        for stream in self._streams.values():
            stream.count, stream.asked_ns, stream.pause_ns = 0, None, WINDOW_NS
        self._missing_once = {GPS_GLOBAL_ORIGIN}
        self._check_ns = now_ns

    def next_timer_ns(self) -> int | None:
        return self._check_ns

    def due(self, now_ns: int) -> list[tuple[int, tuple[float, float]]]:
        """(command, first two parameters) of every request to send now."""
        if self._check_ns is None or now_ns < self._check_ns:
            return []
        self._check_ns = now_ns + WINDOW_NS
        requests = [
            (SET_MESSAGE_INTERVAL, (float(number), 1e6 / stream.rate_hz))
            for number, stream in self._streams.items()
            if self._must_ask(stream, now_ns)
        ]
        return requests + [(REQUEST_MESSAGE, (float(number), 0.0)) for number in sorted(self._missing_once)]

    def _must_ask(self, stream: _Stream, now_ns: int) -> bool:
        """Judge the window that ends now. A stream that flows already is not asked for."""
        enough = stream.count >= ENOUGH * stream.rate_hz * WINDOW_NS * 1e-9
        stream.count = 0
        if enough:
            stream.pause_ns = WINDOW_NS
            return False
        if stream.asked_ns is not None and now_ns - stream.asked_ns < stream.pause_ns:
            return False
        if stream.asked_ns is not None:
            stream.pause_ns = min(2 * stream.pause_ns, LONGEST_PAUSE_NS)
        stream.asked_ns = now_ns
        return True


def request(command: int, parameters: tuple[float, float], system: int, component: int) -> CommandLong:
    """The COMMAND_LONG of one such request."""
    return CommandLong(parameters[0], parameters[1], 0.0, 0.0, 0.0, 0.0, 0.0, command, system, component, 0)
