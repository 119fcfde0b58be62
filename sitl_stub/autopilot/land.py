"""AUTO.LAND: brake, then sink over the stop point. The sink rate itself is the flight task's (it depends on the height)."""

from __future__ import annotations

from dataclasses import replace

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind


class Land:
    """Lands where the vehicle comes to rest."""

    done = False

    def __init__(self) -> None:
        self._target: NavigationTarget | None = None

    def enter(self, situation: Situation, previous: NavigationTarget | None) -> None:
        self._target = replace(situation.stop_point(), kind=TargetKind.LAND)

    def update(self, situation: Situation) -> NavigationTarget:
        if self._target is None:
            self.enter(situation, None)
        assert self._target is not None
        return self._target
