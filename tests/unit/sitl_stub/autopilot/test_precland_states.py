"""The state machine of PX4's precision landing, seen from what it tells the flight task to do."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from sitl_stub.autopilot.navigation import NavigationTarget, Situation, TargetKind
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.precland import LandingTarget, Precland, PreclandState

STEP_US = 50_000


@dataclass
class Landing:
    """A precision landing whose vehicle is put where a test wants it."""

    parameters: Parameters = field(default_factory=Parameters)

    def __post_init__(self) -> None:
        self.target = LandingTarget()
        self.route = Precland(self.target)
        self.at = (0.0, 0.0, -8.0)
        self.t_us = 10_000_000
        self.route.enter(self._situation(), None)

    def _situation(self) -> Situation:
        return Situation(
            self.t_us,
            0.05,
            self.at,
            (0.0, 0.0, 0.0),
            0.0,
            None,
            (0.0, 0.0, 0.0),
            489.4,
            False,
            self.parameters,
            lambda notice: None,
        )

    def run(self, seconds: float, seen: tuple[float, float] | None = None) -> NavigationTarget:
        """So long with the target seen there (or not seen); what the flight task was told at last."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.t_us += STEP_US
            if seen is not None:
                self.target.receive(*seen, 0.0, self.t_us)
            told = self.route.update(self._situation())
        return told

    @property
    def state(self) -> PreclandState:
        return self.route.state


def test_it_waits_two_seconds_for_a_target_before_it_climbs_to_search() -> None:
    landing = Landing()
    assert landing.run(1.9) == NavigationTarget(TargetKind.POSITION, 0.0, 0.0, -8.0)
    assert landing.run(0.3).z_m == -10.0
    assert landing.state is PreclandState.SEARCH


def test_a_target_far_away_is_flown_to_however_long_it_is_out_of_sight() -> None:
    landing = Landing()
    landing.run(0.2, seen=(6.0, 0.0))
    assert landing.state is PreclandState.HORIZONTAL_APPROACH
    told = landing.run(30.0)
    assert landing.state is PreclandState.HORIZONTAL_APPROACH
    assert (told.x_m, told.y_m, told.z_m) == pytest.approx((6.0, 0.0, -8.0), abs=0.05)


def test_where_a_lost_target_was_it_starts_again_waits_and_searches() -> None:
    landing = Landing()
    landing.run(0.2, seen=(6.0, 0.0))
    landing.run(6.0)
    landing.at = (5.9, 0.1, -8.0)
    told = landing.run(0.1)
    assert landing.state is PreclandState.START
    assert (told.x_m, told.y_m, told.z_m) == landing.at
    landing.run(1.9)
    assert landing.state is PreclandState.START
    landing.run(0.3)
    assert landing.state is PreclandState.SEARCH


def test_two_samples_inside_the_radius_two_seconds_apart_begin_the_descent() -> None:
    """The time is not taken again when the target has left the radius in between."""
    landing = Landing()
    landing.run(0.1, seen=(0.1, 0.0))
    landing.run(2.0, seen=(0.5, 0.0))
    assert landing.state is PreclandState.HORIZONTAL_APPROACH
    told = landing.run(0.2, seen=(0.1, 0.0))
    assert landing.state is PreclandState.DESCEND_ABOVE_TARGET
    assert told.kind is TargetKind.LAND


def test_a_target_lost_in_the_descent_is_believed_for_its_timeout_then_it_stops_where_it_is() -> None:
    landing = Landing()
    landing.run(2.3, seen=(0.1, 0.0))
    landing.at = (0.0, 0.0, -2.0)
    assert landing.run(4.9).kind is TargetKind.LAND
    told = landing.run(0.3)
    assert told == NavigationTarget(TargetKind.POSITION, 0.0, 0.0, -2.0)
    assert landing.state is PreclandState.START


def test_a_target_lost_near_the_ground_is_landed_on_where_it_was() -> None:
    landing = Landing()
    landing.run(2.3, seen=(0.1, 0.0))
    landing.at = (0.0, 0.0, -0.05)
    landing.run(0.7)
    assert landing.state is PreclandState.FINAL_APPROACH
    assert landing.run(20.0) == NavigationTarget(TargetKind.LAND, 0.1, 0.0, -8.0)


def test_a_target_found_in_the_search_stops_the_climb_and_is_approached_a_second_later() -> None:
    landing = Landing()
    landing.run(2.3)
    landing.at = (0.0, 0.0, -8.5)
    assert landing.run(0.5, seen=(1.0, 0.0)).z_m == -9.5
    landing.run(0.7, seen=(1.0, 0.0))
    assert landing.state is PreclandState.HORIZONTAL_APPROACH


def test_a_search_in_vain_ends_in_a_landing_on_the_spot() -> None:
    landing = Landing()
    landing.run(2.3)
    landing.at = (0.3, -0.2, -9.9)
    landing.run(9.8)
    assert landing.state is PreclandState.SEARCH
    told = landing.run(0.3)
    assert told == NavigationTarget(TargetKind.LAND, 0.3, -0.2, -9.9)
    assert landing.state is PreclandState.FALLBACK


def test_it_starts_again_only_so_many_times() -> None:
    landing = Landing(Parameters({"PLD_MAX_SRCH": 1}))
    landing.run(2.3, seen=(0.0, 0.0))
    landing.run(5.2)
    assert landing.state is PreclandState.START
    landing.run(2.3, seen=(0.0, 0.0))
    landing.run(5.2)
    assert landing.state is PreclandState.FALLBACK
