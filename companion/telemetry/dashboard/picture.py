"""What the page shows at this moment, gathered message by message.

Written by the control thread (one assignment a message), read by the server's thread ten times a second. All that crosses is
frozen or replaced as a whole, so that no lock is needed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import count
from typing import Any

from companion.config import Config
from companion.geometry import yaw_of
from companion.messages import (
    AutopilotText,
    CommandResult,
    Health,
    Image,
    Message,
    MissionView,
    OperatorCommand,
    PadBeacon,
    PadBearing,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    PhaseChanged,
    Vec2,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.telemetry.live_view import PHASE_LADDER, Rate

EVENTS_KEPT = 300
FRAMES_WAITING = 4
"""Frames whose detection is still to come."""

Seen = PadObservation | PadBearing | PadNotSeen


@dataclass(frozen=True, slots=True)
class Event:
    """One line of the log; `number` grows by one each."""

    number: int
    t_s: float
    kind: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A frame and what was found in it."""

    t_ns: int
    content: Image | bytes
    corners_px: tuple[Vec2, ...]
    text: str


class Picture:
    """Times count from `start_ns`. `add` and `add_frame` from the flight; `numbers`, `events_after` and `shot` for the page."""

    def __init__(self, start_ns: int) -> None:
        self.shot: Shot | None = None
        self._latest: dict[type, Any] = {}
        self._health: dict[str, Health] = {}
        self._frames: deque[tuple[int, Image | bytes]] = deque(maxlen=FRAMES_WAITING)
        self._events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self._numbers = count(1)
        self._rates = {name: Rate() for name in ("state", "frames", "seen", "beacon", "setpoints")}
        self._start_ns = start_ns
        self._now_ns = start_ns

    # ------------------------------------------------------------------------------------------- in the control thread

    def add(self, message: Message) -> None:
        """Take one message into account."""
        self._now_ns = max(self._now_ns, message.t_ns)
        match message:
            case VehicleState():
                self._rates["state"].add(message.t_ns)
            case VelocitySetpoint():
                self._rates["setpoints"].add(message.t_ns)
            case PadBeacon():
                self._rates["beacon"].add(message.t_ns)
            case PadObservation() | PadBearing() | PadNotSeen():
                self._add_detection(message)
            case Health():
                self._health = {**self._health, message.subject: message}
        self._latest[type(message)] = message
        self._add_event(message)

    def add_frame(self, t_ns: int, content: Image | bytes) -> None:
        """A frame on its way to the detector; `t_ns` is what its detection will carry."""
        self._frames.append((t_ns, content))

    def _add_detection(self, seen: Seen) -> None:
        self._rates["frames"].add(seen.t_ns)
        if not isinstance(seen, PadNotSeen):
            self._rates["seen"].add(seen.t_ns)
        for t_ns, content in self._frames:
            if t_ns == seen.t_ns:
                self.shot = Shot(t_ns, content, _corners(seen), _caption(seen))

    def _add_event(self, message: Message) -> None:
        match message:
            case PhaseChanged():
                self._note(message, "phase", f"{message.before} → {message.after}: {message.reason}")
            case VehicleCommand():
                evidence = f" [{'; '.join(message.evidence)}]" if message.evidence else ""
                self._note(message, "ask", f"{message.kind}: {message.reason}{evidence}")
            case CommandResult():
                self._note(message, "answer", f"{message.kind}: {message.result}")
            case AutopilotText():
                self._note(message, "autopilot", message.text)
            case OperatorCommand():
                self._note(message, "operator", f"{message.action} ({message.source})")
            case Health():
                self._note(
                    message, ("fine", "warn", "fail")[min(2, message.level)], f"{message.subject}: {message.text}"
                )

    def _note(self, message: Message, kind: str, text: str) -> None:
        self._events.append(Event(next(self._numbers), self._seconds(message.t_ns), kind, text))

    def _seconds(self, t_ns: int) -> float:
        return round(max(0, t_ns - self._start_ns) / 1e9, 2)

    # -------------------------------------------------------------------------------------------- in the server's thread

    def events_after(self, number: int) -> list[Event]:
        """Those that a reader who has seen `number` has not."""
        return [event for event in list(self._events) if event.number > number]

    def numbers(self) -> dict[str, Any]:
        """Everything but events and camera, ready for JSON. Metres, m/s, radians, seconds; NED."""
        now_ns = self._now_ns
        return {
            "t_s": self._seconds(now_ns),
            "mission": _mission(self._latest.get(MissionView)),
            "vehicle": _vehicle(self._latest.get(VehicleState)),
            "pad": _pad(self._latest.get(PadEstimate)),
            "status": _status(self._latest.get(VehicleStatus)),
            "setpoint_m_s": _fresh_setpoint(self._latest.get(VelocitySetpoint), now_ns),
            "rates_hz": {name: round(rate.hz(now_ns), 1) for name, rate in self._rates.items()},
            "health": [{"subject": h.subject, "level": h.level, "text": h.text} for h in self._health.values()],
        }


def settings_of(config: Config, title: str) -> dict[str, Any]:
    """What does not change during a run: for the page's frame, and the parameters that matter."""
    return {
        "title": title,
        "ladder": [str(phase) for phase in PHASE_LADDER],
        "pad": {"length_m": config.pad.length_m, "width_m": config.pad.width_m},
        "settings": {
            "link": config.link.url,
            "camera": config.cameras[config.vision.camera].source,
            "detector": config.vision.detector,
            "estimator": config.estimation.estimator,
            "planner": config.planning.planner,
            "controller": config.control.controller,
            "top speed": f"{config.control.max_speed_m_s:g} m/s",
            "follow height": f"{config.mission.follow_height_m:g} m",
            "commit height": f"{config.mission.commit_height_m:g} m",
            "ceiling, fence": f"{config.safety.ceiling_m:g} m, {config.safety.geofence_radius_m:g} m",
            "least battery": f"{100 * config.safety.min_battery:.0f} %",
            "disarm": config.mission.disarm,
        },
    }


def _corners(seen: Seen) -> tuple[Vec2, ...]:
    return () if isinstance(seen, PadNotSeen) else seen.corners_px


def _caption(seen: Seen) -> str:
    match seen:
        case PadObservation():
            ids = ", ".join(str(number) for number in seen.marker_ids)
            return f"{seen.detector}: {ids or 'pad'}, {seen.pad_position_camera_m[2]:.2f} m, {seen.reprojection_error_px:.2f} px"
        case PadBearing():
            return f"{seen.detector}: bearing"
        case PadNotSeen():
            return seen.reason or "pad not seen"


def _mission(view: MissionView | None) -> dict[str, Any] | None:
    if view is None:
        return None
    return {
        "phase": str(view.phase),
        "note": view.note,
        "position_m": _rounded(view.relative_position_ned_m),
        "velocity_m_s": _rounded(view.relative_velocity_ned_m_s),
        "height_m": view.height_above_pad_m,
        "is_seen": view.pad_seen,
        "go_arounds": view.go_arounds,
    }


def _vehicle(state: VehicleState | None) -> dict[str, Any] | None:
    if state is None:
        return None
    return {
        "position_m": _rounded(state.position_ned_m),
        "velocity_m_s": _rounded(state.velocity_ned_m_s),
        "yaw_rad": round(yaw_of(state.q_ned_frd), 3),
    }


def _pad(pad: PadEstimate | None) -> dict[str, Any] | None:
    if pad is None:
        return None
    return {
        "velocity_m_s": _rounded(pad.velocity_ned_m_s),
        "yaw_rad": round(pad.yaw_rad, 3),
        "sigma_m": round(pad.position_sigma_m, 3),
        "vision_age_s": pad.vision_age_s,
        "beacon_age_s": pad.beacon_age_s,
        "model": pad.model,
    }


def _status(status: VehicleStatus | None) -> dict[str, Any] | None:
    if status is None:
        return None
    return {
        "is_connected": status.connected,
        "is_armed": status.armed,
        "mode": str(status.mode),
        "landed": str(status.landed_state),
        "has_failsafe": status.failsafe,
        "is_ready": status.ready_to_arm,
        "battery": status.battery_fraction,
        "link_age_s": status.link_age_s,
    }


def _fresh_setpoint(setpoint: VelocitySetpoint | None, now_ns: int) -> list[float] | None:
    if setpoint is None or now_ns > setpoint.valid_until_ns:
        return None
    return _rounded(setpoint.velocity_ned_m_s)


def _rounded(vector: tuple[float, ...] | None) -> list[float] | None:
    return None if vector is None else [round(value, 3) for value in vector]
