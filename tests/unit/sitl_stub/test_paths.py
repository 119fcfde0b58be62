"""Every path: speed, heading and curvature must be the derivatives of its position."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.paths import PATHS, Path
from sitl_stub.paths.circle import CircleSettings
from sitl_stub.paths.figure8 import Figure8Settings
from sitl_stub.paths.line import LineSettings
from sitl_stub.paths.random_turns import RandomTurnsSettings
from sitl_stub.paths.recorded import RecordedSettings
from sitl_stub.paths.still import StillSettings
from sitl_stub.paths.stop_and_go import StopAndGoSettings
from sitl_stub.paths.waypoints import WaypointsSettings

CORNERS = ((0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 25.0))


@pytest.fixture
def track(tmp_path: FilePath) -> str:
    """A recorded circle of 10 m radius at 2 m/s, ten rows a second."""
    rows = [(0.1 * i, 10.0 * math.sin(0.02 * i), 10.0 - 10.0 * math.cos(0.02 * i)) for i in range(300)]
    file = tmp_path / "track.csv"
    file.write_text("# a circle\nt_s,north_m,east_m\n" + "\n".join(f"{t},{n},{e}" for t, n, e in rows))
    return str(file)


def every_path(track: str) -> dict[str, Path]:
    settings = [
        StillSettings(),
        LineSettings(speed_m_s=2.0, start_delay_s=1.0, acceleration_m_s2=0.5),
        CircleSettings(speed_m_s=2.0, radius_m=7.0, turn="counterclockwise"),
        Figure8Settings(speed_m_s=4.2),
        WaypointsSettings(speed_m_s=2.0, points_m=CORNERS),
        StopAndGoSettings(speed_m_s=3.0),
        RandomTurnsSettings(speed_m_s=3.0),
        RecordedSettings(file=track),
    ]
    return {type(s).__struct_config__.tag: s.build(np.random.default_rng(5)) for s in settings}


def test_every_path_of_the_registry_is_tested_here(track: str) -> None:
    assert set(every_path(track)) == set(PATHS)


@pytest.mark.parametrize("kind", sorted(PATHS))
def test_speed_heading_and_curvature_are_the_derivatives_of_position(kind: str, track: str) -> None:
    path = every_path(track)[kind]
    h = 0.01
    for i in range(5, 250):
        before, here, after = (path.at(0.1 * i + 0.037 + k * h) for k in (-1, 0, 1))
        vn, ve = (after.north_m - before.north_m) / (2 * h), (after.east_m - before.east_m) / (2 * h)
        assert math.hypot(vn, ve) == pytest.approx(here.speed_m_s, abs=0.05)
        if here.speed_m_s > 0.3 and before.speed_m_s > 0.0:
            assert abs(math.remainder(math.atan2(ve, vn) - here.heading_rad, math.tau)) < 0.05
            turn = math.remainder(after.heading_rad - before.heading_rad, math.tau) / (2 * h)
            # Where straight meets arc the curvature steps; the difference quotient sees half of it.
            step = abs(after.curvature_1_m - before.curvature_1_m) * here.speed_m_s
            assert turn == pytest.approx(here.curvature_1_m * here.speed_m_s, abs=0.06 + step)


def test_a_circle_comes_back_after_its_circumference() -> None:
    circle = CircleSettings(speed_m_s=2.0, radius_m=5.0, turn="clockwise").build(np.random.default_rng(1))
    around = circle.at(2.0 * math.pi * 5.0 / 2.0)
    assert math.hypot(around.north_m, around.east_m) < 1e-9
    assert circle.at(1.0).east_m > 0.0


def test_a_figure_8_is_as_long_and_wide_as_asked_and_turns_both_ways() -> None:
    loop = Figure8Settings(speed_m_s=4.2, length_m=50.0, width_m=16.0).build(np.random.default_rng(1))
    points = [loop.at(0.02 * i) for i in range(1600)]
    assert max(p.north_m for p in points) == pytest.approx(25.0, abs=0.01)
    assert max(p.east_m for p in points) == pytest.approx(8.0, abs=0.01)
    curvature = [p.curvature_1_m for p in points]
    assert min(curvature) == pytest.approx(-max(curvature), rel=0.01)
    assert 1.0 / max(curvature) == pytest.approx(6.3, abs=0.1)


def test_a_harmonic_figure_8_has_its_speed_at_the_crossing_and_less_elsewhere() -> None:
    settings = Figure8Settings(speed_m_s=4.2, length_m=20.0, width_m=10.0, timing="harmonic", start_fraction=0.0)
    loop = settings.build(np.random.default_rng(1))
    speeds = [loop.at(0.02 * i).speed_m_s for i in range(1000)]
    assert speeds[0] == pytest.approx(4.2)
    assert max(speeds) == pytest.approx(4.2, abs=0.01)
    assert min(speeds) < 3.0
    h = 1e-4
    here, after = loop.at(3.0), loop.at(3.0 + h)
    assert math.hypot(after.north_m - here.north_m, after.east_m - here.east_m) / h == pytest.approx(
        here.speed_m_s, rel=1e-3
    )
    assert (after.heading_rad - here.heading_rad) / h == pytest.approx(here.speed_m_s * here.curvature_1_m, rel=1e-2)


def test_waypoints_are_passed_within_the_corner_cut_and_the_last_one_is_where_it_ends() -> None:
    path = WaypointsSettings(speed_m_s=2.0, points_m=CORNERS, corner_radius_m=3.0).build(np.random.default_rng(1))
    points = [path.at(0.05 * i) for i in range(1200)]
    for north, east in CORNERS:
        assert min(math.hypot(p.north_m - north, p.east_m - east) for p in points) < 1.4
    end = path.at(60.0)
    assert end.speed_m_s == 0.0
    assert math.hypot(end.north_m - CORNERS[-1][0], end.east_m - CORNERS[-1][1]) < 0.3


def test_stop_and_go_stands_for_as_long_as_asked() -> None:
    settings = StopAndGoSettings(speed_m_s=3.0, acceleration_m_s2=1.0, go_s=8.0, stop_s=4.0, start_fraction=0.0)
    path = settings.build(np.random.default_rng(1))
    standing_s = sum(0.01 for i in range(1800) if path.at(0.01 * i).speed_m_s == 0.0)
    assert standing_s == pytest.approx(4.0, abs=0.05)
    assert path.at(18.0).north_m == pytest.approx(3.0 * (3.0 + 8.0))


def test_random_turns_are_the_same_for_a_seed_and_within_the_smallest_radius() -> None:
    settings = RandomTurnsSettings(speed_m_s=3.0, smallest_radius_m=8.0)
    one, same, other = (settings.build(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one.at(33.0) == same.at(33.0)
    assert one.at(33.0) != other.at(33.0)
    assert max(abs(one.at(0.1 * i).curvature_1_m) for i in range(600)) <= 1.0 / 8.0


def test_a_recorded_track_without_its_columns_is_refused_with_their_names(tmp_path: FilePath) -> None:
    file = tmp_path / "bad.csv"
    file.write_text("time,x\n0,1\n1,2\n")
    with pytest.raises(ValueError, match="t_s, north_m, east_m"):
        RecordedSettings(file=str(file)).build(np.random.default_rng(1))


def test_a_placed_path_begins_where_and_whither_it_is_told() -> None:
    placed = PlacedPath(Figure8Settings(speed_m_s=2.0).build(np.random.default_rng(3)), 12.0, -7.0, 1.1)
    start, soon = placed.at(0.0), placed.at(0.05)
    assert (start.north_m, start.east_m) == pytest.approx((12.0, -7.0))
    assert start.heading_rad == pytest.approx(1.1)
    assert math.atan2(soon.east_m + 7.0, soon.north_m - 12.0) == pytest.approx(1.1, abs=0.02)
