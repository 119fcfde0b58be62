"""The minimum-jerk fan: what it accepts holds, what it picks is cheapest, nothing leaks from one candidate to the next."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from companion.config import Planning
from companion.planning import Cylinder, DescentCone, FieldOfView, Limits, NoPlan, Plan, PlanRequest, Trajectory, fan
from companion.planning.min_jerk import (
    MinJerkPlanner,
    approach_velocities,
    end_times,
    floats,
    floats_of,
    integers,
    limit_array,
    pad_array,
)
from companion.planning.proof import jerk_cost
from companion.planning.trajectory import quintic

GRAVITY = 9.80665
REQUEST = PlanRequest(
    t_ns=0,
    position_m=(-3.0, 2.0, -6.0),
    velocity_m_s=(1.0, 0.3, 0.2),
    acceleration_m_s2=(0.5, 0.0, 0.0),
    goal_position_m=(0.0, 0.0, -1.0),
    goal_velocity_m_s=(0.0, 0.0, 0.3),
    pad_velocity_m_s=(4.2, 0.0, 0.0),
    pad_acceleration_m_s2=(0.0, 1.0, 0.0),
    limits=Limits(),
)


def fresh(**settings: Any) -> MinJerkPlanner:
    return MinJerkPlanner(**settings)


def random_request(rng: np.random.Generator, **extra: Any) -> PlanRequest:
    def vector(*bound: float) -> tuple[float, float, float]:
        x, y, z = (float(rng.uniform(-b, b)) for b in bound)
        return (x, y, z)

    x, y, dz = vector(6.0, 6.0, 3.0)
    ax, ay, _ = vector(1.5, 1.5, 0.0)
    return PlanRequest(
        t_ns=0,
        position_m=(x, y, -5.5 + dz),
        velocity_m_s=vector(2.0, 2.0, 0.8),
        acceleration_m_s2=vector(2.0, 2.0, 1.0),
        goal_velocity_m_s=(0.0, 0.0, 0.3),
        pad_velocity_m_s=vector(5.0, 5.0, 0.5),
        pad_acceleration_m_s2=(ax, ay, 0.0),
        limits=Limits(max_descent_m_s=3.0, max_jerk_m_s3=12.0, max_body_rate_rad_s=1.5, thrust_to_weight=1.3),
        **extra,
    )


def evaluated(request: PlanRequest, durations: list[float], prune: bool = False) -> tuple[int, list[float], list[int]]:
    count = len(durations)
    costs, verdicts = floats(count), integers(count)
    end = [*request.goal_position_m, *request.goal_velocity_m_s, 0.0, 0.0, 0.0]
    best = fan.evaluate(
        floats_of(durations),
        floats_of([*request.position_m, *request.velocity_m_s, *request.acceleration_m_s2]),
        floats_of(end * count),
        pad_array(request),
        limit_array(request),
        0.0,
        prune,
        floats(fan.WORKSPACE),
        costs,
        verdicts,
    )
    return best, [float(c) for c in costs], [int(v) for v in verdicts]


def candidate(request: PlanRequest, duration_s: float) -> Trajectory:
    start, end = (request.position_m, request.velocity_m_s, request.acceleration_m_s2), request.goal_position_m
    x, y, z = (
        quintic(duration_s, (start[0][i], start[1][i], start[2][i]), (end[i], request.goal_velocity_m_s[i], 0.0))
        for i in range(3)
    )
    return Trajectory(0, (0.0, duration_s), ((x, y, z),))


def excess_when_sampled(request: PlanRequest, duration_s: float, count: int = 300) -> float:
    """Largest relative excess over any limit at dense samples; negative where all hold."""
    limits = request.limits
    path = candidate(request, duration_s)
    states = np.array([[*path.sample(t), path.jerk(t)] for t in np.linspace(0.0, duration_s, count + 1)])
    position, velocity, acceleration, jerk = (states[:, k] for k in range(4))
    worst = [float(position[:, 2].max()), float(np.linalg.norm(jerk, axis=1).max() / limits.max_jerk_m_s3 - 1.0)]
    for share in (0.0, 1.0):
        push = share * np.array(request.pad_acceleration_m_s2)
        total = velocity + np.array(request.pad_velocity_m_s) + request.pad_preview_s * push
        pushed = acceleration + push
        force = pushed - np.array([0.0, 0.0, GRAVITY])
        size = np.linalg.norm(force, axis=1)
        along = force / size[:, None]
        turning = jerk - (jerk * along).sum(axis=1)[:, None] * along
        worst += [
            float(np.hypot(total[:, 0], total[:, 1]).max() / limits.max_speed_m_s - 1.0),
            float(-total[:, 2].min() / limits.max_climb_m_s - 1.0),
            float(total[:, 2].max() / limits.max_descent_m_s - 1.0),
            float(np.linalg.norm(pushed, axis=1).max() / limits.max_acceleration_m_s2 - 1.0),
            float(size.max() / (limits.thrust_to_weight * GRAVITY) - 1.0),
            float(1.0 + force[:, 2].max() / (limits.min_thrust_to_weight * GRAVITY)),
            float((np.linalg.norm(turning, axis=1) / size).max() / limits.max_body_rate_rad_s - 1.0),
        ]
    return max(worst)


def test_no_accepted_candidate_breaks_a_limit_when_sampled_densely_and_few_good_ones_are_refused() -> None:
    rng = np.random.default_rng(11)
    accepted = refused_though_good = good = 0
    for _ in range(60):
        request = random_request(rng)
        durations = end_times(0.6, 9.0, 8)
        _, _, verdicts = evaluated(request, durations)
        for duration, verdict in zip(durations, verdicts, strict=True):
            excess = excess_when_sampled(request, duration)
            accepted += verdict == 0
            assert verdict != 0 or excess <= 1e-5
            good += excess <= -1e-3
            refused_though_good += excess <= -1e-3 and verdict != 0
    assert accepted > 80
    assert refused_though_good <= 0.05 * good


def test_a_candidates_verdict_depends_on_nothing_but_itself() -> None:
    """Kept extrema of an earlier candidate are a known way to accept what breaks a limit."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        request = random_request(rng)
        durations = end_times(0.5, 8.0, 20)
        _, costs, verdicts = evaluated(request, durations)
        order = [int(k) for k in rng.permutation(20)]
        _, shuffled_costs, shuffled = evaluated(request, [durations[k] for k in order])
        assert shuffled == [verdicts[k] for k in order]
        assert shuffled_costs == [costs[k] for k in order]
        assert [evaluated(request, [t])[2][0] for t in durations] == verdicts


def test_the_cost_is_the_integral_of_squared_jerk() -> None:
    _, costs, _ = evaluated(REQUEST, [1.5, 4.0])
    assert costs == pytest.approx([jerk_cost(candidate(REQUEST, t)) for t in (1.5, 4.0)], rel=1e-9)


def test_pruning_picks_the_same_winner() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        request = random_request(rng)
        durations = end_times(0.5, 8.0, 30)
        assert evaluated(request, durations, prune=True)[0] == evaluated(request, durations)[0]


def test_the_winner_is_the_cheapest_accepted() -> None:
    best, costs, verdicts = evaluated(REQUEST, end_times(0.5, 8.0, 40))
    assert best == min((k for k in range(40) if verdicts[k] == 0), key=costs.__getitem__)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"limits": Limits(max_speed_m_s=4.0)}, "speed"),
        ({"limits": Limits(max_descent_m_s=0.25)}, "descent"),
        ({"limits": Limits(max_acceleration_m_s2=0.4)}, "acceleration"),
        ({"limits": Limits(max_jerk_m_s3=0.05)}, "jerk"),
        ({"limits": Limits(relative_speed_m_s=0.9)}, "relative speed"),
        ({"limits": Limits(max_body_rate_rad_s=0.001)}, "body rate"),
        ({"limits": Limits(floor_m=3.0)}, "floor"),
        ({"limits": Limits(thrust_to_weight=1.001)}, "thrust"),
        ({"limits": Limits(min_thrust_to_weight=0.999)}, "least thrust"),
        ({"field_of_view": FieldOfView(0.3)}, "view"),
        ({"cone": DescentCone(0.3, 0.1, 8.0)}, "descent cone"),
        ({"velocity_m_s": (1.0, 0.0, -2.6)}, "climb"),
    ],
)
def test_each_check_refuses_and_is_named(change: dict[str, Any], reason: str) -> None:
    result = fresh().plan(replace(REQUEST, **change))
    assert isinstance(result, NoPlan)
    assert f"{reason} " in result.reason.partition("refused: ")[2]


def test_the_view_check_refuses_what_leaves_the_view_and_accepts_what_stays() -> None:
    rng = np.random.default_rng(8)
    counts = {True: 0, False: 0}
    half_angle = 0.7
    for _ in range(80):
        request = random_request(rng, field_of_view=FieldOfView(half_angle))
        durations = end_times(1.0, 9.0, 5)
        _, _, verdicts = evaluated(request, durations)
        for duration, verdict in zip(durations, verdicts, strict=True):
            if verdict not in (0, fan.REASONS.index("view")):
                continue
            path = candidate(request, duration)
            states = np.array([path.sample(t) for t in np.linspace(0.0, duration, 300)])
            down = np.array([0.0, 0.0, GRAVITY]) - states[:, 2] - np.array(request.pad_acceleration_m_s2)
            cosine = -(down * states[:, 0]).sum(axis=1) / np.linalg.norm(down, axis=1)
            cosine /= np.maximum(np.linalg.norm(states[:, 0], axis=1), 1e-12)
            high = -states[:, 0, 2] >= 1.0
            if verdict == 0:
                assert cosine[high].min() >= math.cos(half_angle) - 1e-6
            counts[verdict == 0] += 1
    assert min(counts.values()) > 20


def test_the_running_plan_is_kept_while_its_end_stays_and_dropped_when_the_pad_turns() -> None:
    planner = fresh(switch_distance_m=0.15)
    first = planner.plan(REQUEST)
    assert isinstance(first, Plan)
    position, velocity, acceleration = first.trajectory.sample(0.5)
    later = replace(
        REQUEST, t_ns=500_000_000, position_m=position, velocity_m_s=velocity, acceleration_m_s2=acceleration
    )
    assert planner.plan(later) is first
    turned = replace(later, pad_velocity_m_s=(4.0, 0.6, 0.0))
    second = planner.plan(turned)
    assert second is not first
    assert isinstance(second, Plan)
    assert second.trajectory.start_ns == 500_000_000


def test_a_vehicle_off_the_running_plan_gets_a_new_one() -> None:
    planner = fresh(switch_distance_m=0.15)
    first = planner.plan(REQUEST)
    assert isinstance(first, Plan)
    position, velocity, acceleration = first.trajectory.sample(0.5)
    blown = (position[0] + 0.3, position[1], position[2])
    second = planner.plan(
        replace(REQUEST, t_ns=500_000_000, position_m=blown, velocity_m_s=velocity, acceleration_m_s2=acceleration)
    )
    assert isinstance(second, Plan)
    assert second.trajectory.sample(0.0)[0] == pytest.approx(blown)


def test_a_volume_in_the_way_takes_another_candidate_or_none() -> None:
    request = replace(REQUEST, obstacles=(Cylinder((0.0, 0.0), 0.5),), pad_velocity_m_s=(0.0, 0.0, 0.0))
    result = fresh().plan(request)
    assert isinstance(result, NoPlan)
    assert "no-fly volume" in result.reason
    beside = replace(request, obstacles=(Cylinder((3.0, 3.0), 0.5),))
    assert isinstance(fresh().plan(beside), Plan)


def test_the_papers_fan_is_a_setting() -> None:
    planner = MinJerkPlanner.from_config(
        Planning(end_times=20, approach_directions=1, horizon_s=9.0, duration_weight=0.0)
    )
    plan = planner.plan(REQUEST)
    assert isinstance(plan, Plan)
    step = (9.0 - REQUEST.min_duration_s) / 19
    assert (plan.trajectory.duration_s - REQUEST.min_duration_s) / step == pytest.approx(
        round((plan.trajectory.duration_s - REQUEST.min_duration_s) / step), abs=1e-9
    )
    assert plan.trajectory.sample(plan.trajectory.duration_s)[1] == pytest.approx(REQUEST.goal_velocity_m_s, abs=1e-9)


def test_approach_directions_are_spread_evenly_around_the_straight_one() -> None:
    velocities = approach_velocities(5, 0.2)
    assert velocities[0] == (0.0, 0.0, 0.0)
    assert np.array(velocities).sum(axis=0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert [math.hypot(x, y) for x, y, _ in velocities[1:]] == pytest.approx([0.2] * 4)


DECISIONS = """
import json, sys
import numpy as np
sys.path.insert(0, {folder!r})
from test_min_jerk import end_times, evaluated, random_request
from companion.compiled import COMPILED
rng = np.random.default_rng(17)
out = []
for _ in range(15):
    best, costs, verdicts = evaluated(random_request(rng), end_times(0.5, 8.0, 12))
    out.append([best, costs, verdicts])
print(json.dumps([COMPILED, out]))
"""


def test_compiled_and_plain_kernels_decide_the_same() -> None:
    pytest.importorskip("numba")
    script = DECISIONS.format(folder=__file__.rpartition("/")[0])
    plain = _run(script, {"NUMBA_DISABLE_JIT": "1"})
    compiled = _run(script, {})
    assert (plain[0], compiled[0]) == (False, True)
    for (best, costs, verdicts), (best_, costs_, verdicts_) in zip(plain[1], compiled[1], strict=True):
        assert (best, verdicts) == (best_, verdicts_)
        assert costs == pytest.approx(costs_, rel=1e-12)


def _run(script: str, extra: dict[str, str]) -> Any:
    import os

    environment = {**os.environ, **extra, "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    return json.loads(done.stdout)
