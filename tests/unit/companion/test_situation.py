"""What counts as known: evidence of a touchdown from stale or stuck sources must never be complete."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.config import Config, Safety, Zone
from companion.estimation import DeckMotion, PadMotion, VehiclePose
from companion.messages import PadEstimate, RangeMeasurement, ThrustReport
from companion.mission.facts import Facts
from companion.situation import Situation

DT_S = 0.02
DT_NS = 20_000_000
PAD = PadEstimate(
    t_ns=0,
    position_ned_m=(0.0, 0.0, -0.5),
    velocity_ned_m_s=(4.0, 0.0, 0.0),
    acceleration_ned_m_s2=(0.0, 0.0, 0.0),
    yaw_rad=0.0,
    yaw_rate_rad_s=0.0,
    covariance=tuple(tuple(0.0 for _ in range(6)) for _ in range(6)),
    vision_age_s=0.05,
    beacon_age_s=None,
    model="test",
)


class Moving:
    """A pad that goes straight on, or is said to turn with an acceleration to the side."""

    def __init__(self, turn_m_s2: float = 0.0) -> None:
        self.turn_m_s2 = turn_m_s2

    def estimate(self, t_ns: int) -> PadEstimate | None:
        north = 4.0 * t_ns / 1e9
        return replace(PAD, t_ns=t_ns, position_ned_m=(north, 0.0, -0.5))

    def motion(self, t_ns: int) -> PadMotion:
        return PadMotion((4.0 * t_ns / 1e9, 0.0, -0.5), PAD.velocity_ned_m_s, (0.0, self.turn_m_s2, 0.0), 0.0, 0.0)

    def deck(self, t_ns: int) -> DeckMotion:
        return DeckMotion(0.1 * t_ns / 1e9, 0.0, 0.05)


class Scene:
    """A situation fed 20 ms at a time with a vehicle over the pad."""

    def __init__(self, config: Config | None = None) -> None:
        self.pad = Moving()
        self.situation = Situation(config or Config(), self.pad)
        self.t_ns = 0
        self.state_ns = 0
        self.frozen: set[str] = set()

    def run(self, seconds: float, *, height_m: float, sink_m_s: float, thrust: float, speed_m_s: float = 4.0) -> Facts:
        for _ in range(round(seconds / DT_S)):
            self.t_ns += DT_NS
            self.situation.commanded_down_m_s = 0.8
            if "range" not in self.frozen:
                self.situation.add_range(RangeMeasurement(self.t_ns, height_m, 0.1, 40.0))
            if "thrust" not in self.frozen:
                self.situation.add_thrust(ThrustReport(self.t_ns, thrust))
            if "state" not in self.frozen:
                self.state_ns = self.t_ns
            pad = Moving().estimate(self.t_ns)
            assert pad is not None
            north, east, down = pad.position_ned_m
            pose = pose_at((north, east, down - height_m), (speed_m_s, 0.0, sink_m_s))
            facts = self.situation.facts(self.t_ns, pose, self.state_ns, pad, dt_s=DT_S)
        return facts

    def flown_down(self) -> Scene:
        self.run(3.0, height_m=5.0, sink_m_s=0.0, thrust=0.5)
        return self


def pose_at(position: tuple[float, float, float], velocity: tuple[float, float, float]) -> VehiclePose:
    from companion.estimation.vehicle_history import VehicleHistory
    from companion.messages import VehicleState

    history = VehicleHistory(1.5)
    history.add(VehicleState(0, position, velocity, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    pose = history.at(0)
    assert pose is not None
    return pose


def test_standing_on_a_moving_deck_is_proven() -> None:
    facts = Scene().flown_down().run(1.0, height_m=0.2, sink_m_s=0.0, thrust=0.2)
    assert facts.touchdown.proven_for_s > 0.9


@pytest.mark.parametrize("source", ["state", "thrust"])
def test_standing_with_a_frozen_source_is_not_proven(source: str) -> None:
    scene = Scene().flown_down()
    scene.run(0.1, height_m=0.2, sink_m_s=0.0, thrust=0.2)
    scene.frozen.add(source)
    assert scene.run(1.0, height_m=0.2, sink_m_s=0.0, thrust=0.2).touchdown.proven_for_s == 0.0


@pytest.mark.parametrize(
    ("height_m", "sink_m_s", "thrust", "speed_m_s"),
    [
        (0.3, 0.0, 0.45, 4.0),  # hovers in ground effect just above the deck
        (0.3, 0.6, 0.3, 4.0),  # falls towards it
        (0.3, -0.5, 0.6, 4.0),  # goes around
        (0.3, 0.0, 0.3, 5.0),  # drags along it
        (1.0, 0.0, 0.2, 4.0),  # an updraft carries it
    ],
)
def test_in_the_air_near_the_deck_nothing_is_proven(
    height_m: float, sink_m_s: float, thrust: float, speed_m_s: float
) -> None:
    scene = Scene().flown_down()
    facts = scene.run(2.0, height_m=height_m, sink_m_s=sink_m_s, thrust=thrust, speed_m_s=speed_m_s)
    assert facts.touchdown.proven_for_s == 0.0


def test_a_range_sensor_stuck_low_proves_nothing_higher_up() -> None:
    scene = Scene().flown_down()
    scene.run(0.1, height_m=0.2, sink_m_s=0.0, thrust=0.5)
    scene.frozen.add("range")
    stuck = scene.situation
    for _ in range(50):
        stuck.add_range(RangeMeasurement(scene.t_ns, 0.2, 0.1, 40.0))
        facts = scene.run(DT_S, height_m=1.2, sink_m_s=0.0, thrust=0.2)
        assert facts.touchdown.proven_for_s == 0.0


def test_the_deck_is_predicted_for_the_time_of_contact() -> None:
    facts = Scene().run(0.1, height_m=1.22, sink_m_s=0.0, thrust=0.5)
    assert facts.contact is not None
    assert facts.contact.in_s == pytest.approx(2.0)
    assert facts.contact.deck_climb_m_s == pytest.approx(-0.21)
    assert facts.contact.deck_tilt_rad == pytest.approx(0.05)


def test_a_pad_on_its_way_into_a_no_land_zone_is_in_it_at_contact() -> None:
    zone = Zone(name="lock", center_m=(8.5, 0.0), radius_m=1.0)
    scene = Scene(Config(safety=Safety(zones=(zone,))))
    assert scene.run(0.1, height_m=5.0, sink_m_s=0.0, thrust=0.5).no_land_zone is None
    assert scene.run(0.02, height_m=1.22, sink_m_s=0.0, thrust=0.5).no_land_zone == "lock"


def test_a_no_fly_zone_counts_from_where_the_vehicle_could_stop() -> None:
    zone = Zone(name="mast", kind="no_fly", center_m=(8.0, 0.0), radius_m=2.0)
    scene = Scene(Config(safety=Safety(zones=(zone,))))
    facts = scene.run(0.7, height_m=5.0, sink_m_s=0.0, thrust=0.5, speed_m_s=4.0)
    assert facts.no_fly_zone is None
    facts = scene.run(0.4, height_m=5.0, sink_m_s=0.0, thrust=0.5, speed_m_s=4.0)
    assert facts.no_fly_zone == "mast"


def test_a_pad_that_turns_hard_is_bent_until_it_turns_clearly_less() -> None:
    scene, bent = Scene(), []
    for turn_m_s2 in (1.0, 1.6, -1.8, -1.2, 1.0, 1.6):
        scene.pad.turn_m_s2 = turn_m_s2
        bent.append(scene.run(DT_S, height_m=3.0, sink_m_s=0.5, thrust=0.5).pad_is_bent)
    assert bent == [False, False, True, True, False, False]


def test_a_camera_that_is_always_late_still_sees_the_pad_until_no_new_sight_comes_in() -> None:
    situation, ages = Situation(Config(), Moving()), []
    for tick in range(100):
        t_ns = tick * DT_NS
        captured_ns = min(t_ns, 1_000_000_000) - 500_000_000  # half a second late; none taken after 0.5 s
        pad = replace(PAD, t_ns=t_ns, vision_age_s=(t_ns - captured_ns) / 1e9)
        ages.append(situation.facts(t_ns, None, None, pad, dt_s=DT_S).sight_age_s)
    assert max(ages[:51]) == 0.0
    assert ages[-1] == pytest.approx(0.98)


def test_news_of_long_ago_is_no_sight() -> None:
    facts = Situation(Config(), Moving()).facts(0, None, None, replace(PAD, vision_age_s=4.0), dt_s=DT_S)
    assert facts.sight_age_s == pytest.approx(3.0)
