"""Commands to the autopilot: sent, repeated, and answered with the right acknowledgement. Sans-IO.

PX4 answers MAV_CMD_DO_SET_MODE twice: the receiver says ACCEPTED at once, always; the commander's verdict follows within
some 13 ms. So the first acceptance of a mode command means nothing. Accepted is a mode that CURRENT_MODE or HEARTBEAT
shows after the request; refused is any acknowledgement that refuses. Where no CURRENT_MODE comes (older autopilots) the
second acceptance counts. All other commands have one acknowledgement and it is true.

At most one command of a MAV_CMD is outstanding. The same request again changes nothing; another request with the same
MAV_CMD (hold after offboard, forced disarm after disarm) replaces it at once. Acknowledgements do not say whom they
answer, and answers to the request before may still be under way, late or doubled. So for the length of one timeout after
it a refusal is not believed: if it was meant, the next attempt is refused too. Nor is the acceptance of a one-answer
command, unless the one before was refused: it is asked again.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.mavlink.codec import wire
from companion.mavlink.dialect import CommandAck, CommandLong
from companion.mavlink.modes import MAIN_AUTO, MAIN_OFFBOARD, SUB_LAND, SUB_LOITER, SUB_RTL
from companion.messages import AutopilotMode, CommandKind, CommandResult, VehicleCommand

ARM_DISARM = 400
DO_SET_MODE = 176
NAV_TAKEOFF = 22
FORCE_DISARM_MAGIC = 21196.0
MODE_FLAG_CUSTOM = 1.0

ACCEPTED, IN_PROGRESS = 0, 5
RESULT_NAMES = {
    0: "accepted",
    1: "temporarily_rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
    5: "in_progress",
    6: "cancelled",
    7: "command_long_only",
    8: "command_int_only",
    9: "unsupported_mav_frame",
}

SUPERSEDED = "superseded"

Parameters = tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Request:
    """What goes on the wire for one kind of command. `mode` is set where the mode itself is the answer."""

    command: int
    parameters: Parameters
    mode: AutopilotMode | None = None


def _mode_request(main: int, sub: int, mode: AutopilotMode) -> Request:
    return Request(DO_SET_MODE, (MODE_FLAG_CUSTOM, float(main), float(sub), 0.0, 0.0, 0.0, 0.0), mode)


_FIXED = {
    CommandKind.ARM: Request(ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    CommandKind.DISARM: Request(ARM_DISARM, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    CommandKind.FORCE_DISARM: Request(ARM_DISARM, (0.0, FORCE_DISARM_MAGIC, 0.0, 0.0, 0.0, 0.0, 0.0)),
    CommandKind.OFFBOARD: _mode_request(MAIN_OFFBOARD, 0, AutopilotMode.OFFBOARD),
    CommandKind.HOLD: _mode_request(MAIN_AUTO, SUB_LOITER, AutopilotMode.HOLD),
    CommandKind.LAND: _mode_request(MAIN_AUTO, SUB_LAND, AutopilotMode.LAND),
    CommandKind.RETURN: _mode_request(MAIN_AUTO, SUB_RTL, AutopilotMode.RETURN),
}


def request_for(command: VehicleCommand, altitude_amsl_m: float | None) -> Request:
    """The wire form. Take-off climbs to `altitude_amsl_m`; None leaves the height to the autopilot's parameter."""
    if command.kind is CommandKind.TAKEOFF:
        return Request(NAV_TAKEOFF, (None, 0.0, 0.0, None, None, None, altitude_amsl_m))
    return _FIXED[command.kind]


@dataclass(slots=True)
class _Outstanding:
    kind: CommandKind
    request: Request
    deadline_ns: int
    sent_ns: int
    refusals_count_from_ns: int
    acceptance_counts: bool
    attempts: int = 1
    acceptances: int = 0


@dataclass(frozen=True, slots=True)
class _Ended:
    """The command before: answers to it may still come."""

    kind: CommandKind
    sent_ns: int
    was_refused: bool


class Commander:
    """Keeps what was asked until it is answered or given up."""

    def __init__(self, *, target_system: int, target_component: int, timeout_ns: int, attempts: int) -> None:
        self._target = (target_system, target_component)
        self._timeout_ns = timeout_ns
        self._attempts = attempts
        self._outstanding: dict[int, _Outstanding] = {}
        self._last: dict[int, _Ended] = {}
        self._to_send: list[CommandLong] = []
        self._results: list[CommandResult] = []
        self.current_mode_seen = False

    # ---------------------------------------------------------------------------------------------------------- asked

    def ask(self, command: VehicleCommand, request: Request, now_ns: int) -> None:
        """Send it, unless the very same is outstanding already."""
        before = self._outstanding.get(request.command)
        if before is not None and before.kind is command.kind:
            return
        if before is not None:
            self._finish(before, now_ns, accepted=False, result=SUPERSEDED)
        last = self._last.get(request.command)
        if last is not None and (last.kind is command.kind or now_ns >= last.sent_ns + self._timeout_ns):
            last = None  # nothing under way that could be mistaken
        pending = _Outstanding(
            kind=command.kind,
            request=request,
            deadline_ns=now_ns + self._timeout_ns,
            sent_ns=now_ns,
            refusals_count_from_ns=now_ns if last is None else last.sent_ns + self._timeout_ns,
            acceptance_counts=last is None or last.was_refused,
        )
        self._outstanding[request.command] = pending
        self._send(pending)

    def refuse(self, command: VehicleCommand, reason: str, now_ns: int) -> None:
        """Answer a command that never leaves."""
        self._results.append(CommandResult(now_ns, command.kind, accepted=False, result=reason, attempts=0))

    # ------------------------------------------------------------------------------------------------------- answered

    def acknowledged(self, ack: CommandAck, now_ns: int) -> CommandKind | None:
        """Take one COMMAND_ACK; the kind of a command that it made succeed, None otherwise."""
        pending = self._outstanding.get(ack.command)
        if pending is None:
            return None
        if ack.result == IN_PROGRESS:
            pending.deadline_ns = now_ns + self._timeout_ns
        elif ack.result != ACCEPTED:
            self._refused(pending, ack.result, now_ns)
        elif pending.request.mode is not None:
            return self._mode_accepted(pending, now_ns)
        elif not pending.acceptance_counts:
            self._ask_again(pending, now_ns)
        else:
            self._finish(pending, now_ns, accepted=True, result="accepted")
            return pending.kind
        return None

    def mode_seen(self, mode: AutopilotMode, intended: AutopilotMode | None, now_ns: int) -> None:
        """The autopilot says which mode it is in: the real answer to a mode command."""
        pending = self._outstanding.get(DO_SET_MODE)
        if pending is None or pending.request.mode is not mode or intended not in (None, mode):
            return
        self._finish(pending, now_ns, accepted=True, result="accepted")

    def armed_seen(self, armed: bool, now_ns: int) -> None:
        """A heartbeat says armed or not: as good as an acknowledgement that got lost."""
        pending = self._outstanding.get(ARM_DISARM)
        if pending is not None and (pending.kind is CommandKind.ARM) is armed:
            self._finish(pending, now_ns, accepted=True, result="accepted")

    def _mode_accepted(self, pending: _Outstanding, now_ns: int) -> CommandKind | None:
        pending.acceptances += 1
        if self.current_mode_seen or pending.acceptances < 2 or not pending.acceptance_counts:
            return None
        self._finish(pending, now_ns, accepted=True, result="accepted")
        return pending.kind

    def _refused(self, pending: _Outstanding, result: int, now_ns: int) -> None:
        if now_ns >= pending.refusals_count_from_ns:
            self._finish(pending, now_ns, accepted=False, result=RESULT_NAMES.get(result, f"result_{result}"))

    # ----------------------------------------------------------------------------------------------------------- time

    def next_timer_ns(self) -> int | None:
        return min((pending.deadline_ns for pending in self._outstanding.values()), default=None)

    def handle_timer(self, now_ns: int) -> None:
        """Ask again what was not answered in time; give up after the last attempt."""
        for pending in [p for p in self._outstanding.values() if p.deadline_ns <= now_ns]:
            if pending.attempts < self._attempts:
                self._ask_again(pending, now_ns)
            else:
                seen = "accepted, but the mode was not seen" if pending.acceptances else "timeout"
                self._finish(pending, now_ns, accepted=False, result=seen)

    def _ask_again(self, pending: _Outstanding, now_ns: int) -> None:
        pending.acceptance_counts = True
        pending.acceptances = 0
        pending.sent_ns = now_ns
        pending.attempts += 1
        pending.deadline_ns = now_ns + self._timeout_ns
        self._send(pending)

    def _send(self, pending: _Outstanding) -> None:
        a, b, c, d, e, f, g = (wire(value) for value in pending.request.parameters)
        confirmation = min(pending.attempts - 1, 255)
        self._to_send.append(CommandLong(a, b, c, d, e, f, g, pending.request.command, *self._target, confirmation))

    def _finish(self, pending: _Outstanding, now_ns: int, *, accepted: bool, result: str) -> None:
        del self._outstanding[pending.request.command]
        refused = not accepted and result in RESULT_NAMES.values()
        self._last[pending.request.command] = _Ended(pending.kind, pending.sent_ns, was_refused=refused)
        self._results.append(CommandResult(now_ns, pending.kind, accepted, result, pending.attempts))

    def drain(self) -> tuple[list[CommandLong], list[CommandResult]]:
        """What to send and what was decided since the last call."""
        drained = self._to_send, self._results
        self._to_send, self._results = [], []
        return drained
