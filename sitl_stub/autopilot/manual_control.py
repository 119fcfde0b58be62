"""The pilot: sticks from MANUAL_CONTROL or from a radio that the scenario plays, and when the pilot takes over.

Sticks are -1 to 1: roll right, pitch forward (nose down), yaw clockwise, throttle -1 (down) to 1 (up), 0 is the middle. A signal older
than COM_RC_LOSS_T is no signal. Moving a stick by more than COM_RC_STICK_OV takes over from automatic modes (and from OFFBOARD if
COM_RC_OVERRIDE has bit 1), into position control.
"""

from __future__ import annotations

from dataclasses import dataclass

from sitl_stub.autopilot.parameters import Parameters

_OVERRIDE_AUTO = 1
_OVERRIDE_OFFBOARD = 2


@dataclass(frozen=True, slots=True)
class Sticks:
    """Deflections, -1 to 1."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    throttle: float = 0.0

    def largest_move(self, before: Sticks) -> float:
        """Greatest change of roll, pitch, yaw and throttle."""
        return max(
            abs(self.roll - before.roll),
            abs(self.pitch - before.pitch),
            abs(self.yaw - before.yaw),
            abs(self.throttle - before.throttle),
        )


class ManualControl:
    """The latest sticks and their age."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.sticks = Sticks()
        self._rest = Sticks()
        self._t_us: int | None = None
        self.was_seen = False
        self.kill = False

    def receive(self, sticks: Sticks, t_us: int) -> None:
        """New stick positions."""
        if not self.is_alive(t_us):
            self._rest = sticks
        self.sticks = sticks
        self._t_us = t_us
        self.was_seen = True

    def is_alive(self, t_us: int) -> bool:
        """A signal came within COM_RC_LOSS_T."""
        return self._t_us is not None and t_us - self._t_us <= self._parameters.get("COM_RC_LOSS_T") * 1e6

    def note_rest(self) -> None:
        """Take the present stick position as rest: only moves from here count as taking over."""
        self._rest = self.sticks

    def takes_over(self, t_us: int, *, in_offboard: bool) -> bool:
        """The pilot moved a stick far enough to get the vehicle."""
        allowed = self._parameters.get_int("COM_RC_OVERRIDE")
        if not allowed & (_OVERRIDE_OFFBOARD if in_offboard else _OVERRIDE_AUTO) or not self.is_alive(t_us):
            return False
        return self.sticks.largest_move(self._rest) > self._parameters.get("COM_RC_STICK_OV") / 100.0
