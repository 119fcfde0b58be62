"""Proofs by control points, volumes, views and limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.config import Planning
from companion.planning import (
    PLANNERS,
    Cylinder,
    FieldOfView,
    Limits,
    Plan,
    PlanRequest,
    Sphere,
    Trajectory,
    admitting_start,
    limits_from_config,
)
from companion.planning.limits import GRAVITY_M_S2, capped, excess, hold, widest
from companion.planning.obstacle import hull_is_clear, moved
from companion.planning.proof import prove
from companion.planning.view import pad_in_view

REQUEST = PlanRequest(t_ns=0, position_m=(0.0, 0.0, -5.0), velocity_m_s=(0.0, 0.0, 0.0), limits=Limits(floor_m=None))


def random_trajectory(rng: np.random.Generator, degree: int) -> Trajectory:
    pieces = []
    for _ in range(3):
        x, y, z = (tuple(float(c) for c in rng.normal(size=degree + 1) * 0.3) for _ in range(3))
        pieces.append((x, y, z))
    return Trajectory(0, (0.0, 0.8, 1.9, 2.5), tuple(pieces))


@pytest.mark.parametrize("degree", [1, 3, 5, 7])
def test_the_bounds_enclose_dense_samples_and_close_in_with_more_parts(degree: int) -> None:
    rng = np.random.default_rng(degree)
    request = replace(REQUEST, pad_velocity_m_s=(2.0, -1.0, 0.3), pad_acceleration_m_s2=(0.5, 0.5, -0.2))
    for _ in range(10):
        path = random_trajectory(rng, degree)
        times = np.linspace(0.0, 2.5, 800)
        states = np.array([[*path.sample(t), path.jerk(t)] for t in times])
        total = states[:, 1] + np.array(request.pad_velocity_m_s)
        force = states[:, 2] - np.array([0.0, 0.0, GRAVITY_M_S2])
        tight, loose = prove(path, request, parts=16).bounds, prove(path, request, parts=1).bounds
        for bound in (tight, loose):
            assert np.hypot(total[:, 0], total[:, 1]).max() <= bound.speed_m_s + 1e-9
            assert -total[:, 2].min() <= bound.climb_m_s + 1e-9
            assert total[:, 2].max() <= bound.descent_m_s + 1e-9
            assert np.linalg.norm(states[:, 2], axis=1).max() <= bound.acceleration_m_s2 + 1e-9
            assert np.linalg.norm(states[:, 3], axis=1).max() <= bound.jerk_m_s3 + 1e-9
            assert np.linalg.norm(force, axis=1).max() <= bound.thrust_max_m_s2 + 1e-9
            assert -force[:, 2].max() >= bound.thrust_min_m_s2 - 1e-9
        assert tight.jerk_m_s3 <= loose.jerk_m_s3 + 1e-9
        assert tight.speed_m_s <= loose.speed_m_s + 1e-9


def test_the_excess_names_what_binds_with_its_numbers() -> None:
    path = Trajectory(0, (0.0, 2.0), (((3.0, 0.0), (4.0, 0.0), (0.0, -5.0)),))
    proof = prove(path, replace(REQUEST, limits=Limits(max_speed_m_s=2.5)))
    assert not proof.holds
    assert proof.slowdown == pytest.approx(2.0)
    assert proof.reason == "speed 5 m/s, limit 2.5"
    assert hold(proof.bounds, Limits(max_speed_m_s=5.0))
    assert excess(proof.bounds, Limits(max_speed_m_s=5.0))[0] == pytest.approx(1.0)


def test_capped_and_widest_take_the_right_side_of_each_bound() -> None:
    slow = prove(Trajectory(0, (0.0, 1.0), (((1.0, 0.0), (0.0, 0.0), (0.0, -5.0)),)), REQUEST).bounds
    fast = prove(Trajectory(0, (0.0, 1.0), (((2.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, -5.0)),)), REQUEST).bounds
    both = widest(slow, fast)
    assert both == replace(fast, thrust_max_m_s2=slow.thrust_max_m_s2)
    assert capped(both, Limits(max_speed_m_s=1.5)).speed_m_s == 1.5
    assert capped(both, Limits(min_thrust_to_weight=0.9)).thrust_min_m_s2 == pytest.approx(0.9 * GRAVITY_M_S2)


@pytest.mark.parametrize("seed", range(20))
def test_a_hull_called_clear_has_no_point_inside_the_volume(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = {True: 0, False: 0}
    for _ in range(50):
        points = rng.normal(size=(4, 3)) + rng.normal(size=3) * 2.0
        volume = Cylinder((0.0, 0.0), 0.7) if rng.random() < 0.5 else Sphere((0.0, 0.0, 0.0), 0.7)
        offsets = [(float(x), float(y), float(z)) for x, y, z in points]
        clear = hull_is_clear(volume, offsets, [p[2] for p in offsets])
        inside = rng.dirichlet(np.ones(4), size=300) @ points
        used = inside[:, :2] if isinstance(volume, Cylinder) else inside
        if clear:
            assert np.linalg.norm(used, axis=1).min() >= 0.7 - 1e-9
        found[clear] += 1
    assert min(found.values()) > 0


def test_above_a_cylinders_top_is_clear() -> None:
    points = [(0.0, 0.0, -6.0), (0.5, 0.0, -7.0)]
    assert hull_is_clear(Cylinder((0.0, 0.0), 2.0, top_m=5.0), points, [-6.0, -7.0])
    assert not hull_is_clear(Cylinder((0.0, 0.0), 2.0, top_m=6.5), points, [-6.0, -7.0])


def test_volumes_drift_against_the_pads_motion() -> None:
    assert moved(Cylinder((3.0, 0.0), 1.0, 4.0), (1.0, -2.0, 0.0), 2.0) == Cylinder((1.0, 4.0), 1.0, 4.0)
    assert moved(Sphere((3.0, 0.0, -2.0), 1.0), (1.0, 0.0, -0.5), 2.0) == Sphere((1.0, 0.0, -1.0), 1.0)


def test_the_view_tilts_with_the_acceleration() -> None:
    """Hovering 5 m above and 2 m south, the pad is 22 degrees ahead. To accelerate north the nose drops, and a camera
    fixed to the body then looks back, to the south: the pad moves out of view."""
    view = FieldOfView(math.radians(30.0))
    behind = [(-2.0, 0.0, -5.0)]
    assert pad_in_view(view, behind, [(0.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    assert not pad_in_view(view, behind, [(4.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    assert pad_in_view(view, behind, [(-4.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    assert not pad_in_view(view, behind, [(0.0, 0.0, 0.0)], (4.0, 0.0, 0.0))
    assert pad_in_view(view, [(-2.0, 0.0, -0.9)], [(4.0, 0.0, 0.0)], (0.0, 0.0, 0.0))


def test_admitting_the_start_raises_only_what_the_start_needs() -> None:
    within = replace(REQUEST, limits=Limits())
    assert admitting_start(within) == within
    fast = replace(within, velocity_m_s=(13.0, 0.0, 1.5), acceleration_m_s2=(0.0, 5.0, 0.0))
    raised = admitting_start(fast).limits
    assert raised.max_speed_m_s > 13.0
    assert raised.max_descent_m_s > 1.5
    assert raised.max_acceleration_m_s2 == pytest.approx(5.5)
    assert raised.max_climb_m_s == Limits().max_climb_m_s
    assert raised.max_jerk_m_s3 == Limits().max_jerk_m_s3


def test_admitting_again_and_again_is_no_way_around_a_limit() -> None:
    limit = Limits().max_descent_m_s
    at_limit = replace(REQUEST, limits=Limits(), velocity_m_s=(0.0, 0.0, limit), pad_velocity_m_s=(0.0, 0.0, 0.0))
    assert admitting_start(at_limit).limits.max_descent_m_s <= limit + 0.02
    braking = replace(at_limit, acceleration_m_s2=(0.0, 0.0, -2.0))
    assert admitting_start(braking).limits.max_descent_m_s <= limit + 0.02
    speeding = replace(at_limit, acceleration_m_s2=(0.0, 0.0, 2.0))
    assert admitting_start(speeding).limits.max_descent_m_s > limit + 0.02


@pytest.mark.parametrize("way_m", [10.0, 60.0, 300.0])
def test_a_long_way_is_given_the_time_that_it_takes(way_m: float) -> None:
    far = replace(REQUEST, position_m=(way_m, 0.0, -5.0), limits=Limits(relative_speed_m_s=4.0))
    for name in sorted(set(PLANNERS) - {"corridor"}):
        found = PLANNERS[name](Planning()).plan(admitting_start(far))
        assert isinstance(found, Plan), (name, found)
        assert found.trajectory.duration_s >= way_m / 4.0


def test_limits_come_from_the_configuration() -> None:
    limits = limits_from_config(Planning(max_speed_m_s=9.0, max_body_rate_deg_s=90.0))
    assert limits.max_speed_m_s == 9.0
    assert limits.max_body_rate_rad_s == pytest.approx(math.pi / 2)
    assert limits.floor_m == 0.0
