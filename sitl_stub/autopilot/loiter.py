"""AUTO.LOITER: stop and stay. After a take-off it stays at the take-off target. AUTO.FOLLOW without a target does the same."""

from __future__ import annotations

from dataclasses import replace

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind


class Loiter:
    """Holds the point where the vehicle came to rest."""

    done = False

    def __init__(self) -> None:
        self._target: NavigationTarget | None = None

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        if previous is not None and previous.kind is TargetKind.TAKEOFF:
            self._target = replace(previous, kind=TargetKind.POSITION)
        else:
            self._target = situation.stop_point()

    def update(self, situation: Situation) -> NavigationTarget:
        if situation.landed:
            self._target = replace(situation.stop_point(), kind=TargetKind.IDLE)
        elif self._target is None or self._target.kind is TargetKind.IDLE:
            self._target = situation.stop_point()
        return self._target
