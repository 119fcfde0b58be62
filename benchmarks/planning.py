"""Planning: what a candidate, a plan and a sample cost, whether accepted plans hold their limits, and the `guo` comparison.

    python benchmarks/planning.py [--candidates 10000] [--json FILE]

Everything is measured in one run on one core, so the ratios mean something; absolute times are this machine's. References in
the same run: the same kernel without compilation, a NumPy batch that samples each candidate at 100 instants (which proves
nothing), a dense linear solve for minimum snap.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from companion.campaign.runner import Flight
from companion.compiled import COMPILED
from companion.config import Planning, load_with
from companion.messages import Input, Phase, Tick
from companion.planning import PLANNERS, Cylinder, FieldOfView, Limits, Plan, PlanRequest, admitting_start, fan
from companion.planning.catmull_rom import catmull_rom_path
from companion.planning.corridor import corridor_minimum_snap
from companion.planning.min_jerk import MinJerkPlanner, end_times, floats, floats_of, integers, limit_array, pad_array
from companion.planning.min_snap import (
    distance_to_segment,
    durations_by_distance,
    improved_minimum_snap,
    minimum_snap,
)
from companion.planning.obstacle import centre_at
from companion.planning.snap import GRAM, solve
from companion.planning.trajectory import Trajectory
from sitl_stub.scenario import load

GRAVITY = 9.80665
PER_SITUATION = 20
WAYPOINTS = np.array([(10, 30, 0), (20, 70, 0), (60, 70, 0), (40, 30, 0), (90, 30, 0)], dtype=float)


def situation(rng: np.random.Generator, view: bool = True) -> PlanRequest:
    """A landing somewhere above a moving pad, within 5 m horizontally and 3 to 10 m up."""

    def vector(*bound: float) -> tuple[float, float, float]:
        x, y, z = (float(rng.uniform(-b, b)) for b in bound)
        return (x, y, z)

    x, y, dz = vector(5.0, 5.0, 3.5)
    ax, ay, _ = vector(1.5, 1.5, 0.0)
    return PlanRequest(
        t_ns=0,
        position_m=(x, y, -6.5 + dz),
        velocity_m_s=vector(1.5, 1.5, 0.5),
        acceleration_m_s2=vector(1.0, 1.0, 0.5),
        goal_velocity_m_s=(0.0, 0.0, 0.4),
        pad_velocity_m_s=vector(4.2, 4.2, 0.2),
        pad_acceleration_m_s2=(ax, ay, 0.0),
        limits=Limits(max_descent_m_s=3.0),
        field_of_view=FieldOfView(0.9) if view else None,
    )


def kernel_input(request: PlanRequest, durations: list[float]) -> tuple[Any, ...]:
    count = len(durations)
    end = [*request.goal_position_m, *request.goal_velocity_m_s, 0.0, 0.0, 0.0]
    start = [*request.position_m, *request.velocity_m_s, *request.acceleration_m_s2]
    work = floats(fan.WORKSPACE), floats(count), integers(count)
    fixed = floats_of(durations), floats_of(start), floats_of(end * count), pad_array(request), limit_array(request)
    return *fixed, 0.0, False, *work


def best_of(repeats: int, call: Callable[[], Any]) -> float:
    """Least seconds of several calls."""
    least = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - begin)
    return least


def fan_times(candidates: int, view: bool) -> dict[str, float]:
    """Nanoseconds a candidate, all checks, and the share accepted."""
    rng = np.random.default_rng(1)
    durations = end_times(0.5, 8.0, PER_SITUATION)
    total, accepted, count = 0.0, 0, candidates // PER_SITUATION
    for k in range(count):
        arguments = kernel_input(situation(rng, view), durations)
        if k == 0:
            fan.evaluate(*arguments)
        total += best_of(3, lambda arguments=arguments: fan.evaluate(*arguments))
        accepted += sum(1 for verdict in arguments[-1] if verdict == 0)
    return {"ns": total / (count * PER_SITUATION) * 1e9, "accepted": accepted / (count * PER_SITUATION)}


def sampled_batch(request: PlanRequest, durations: np.ndarray, count: int = 100) -> np.ndarray:
    """The usual way in NumPy: largest relative excess of each candidate over any limit, at `count` instants."""
    p0, v0, a0 = (np.array(v) for v in (request.position_m, request.velocity_m_s, request.acceleration_m_s2))
    p1, v1 = np.array(request.goal_position_m), np.array(request.goal_velocity_m_s)
    T = durations[:, None]
    dp, dv, da = p1 - p0 - v0 * T - 0.5 * a0 * T**2, (v1 - v0 - a0 * T) * T, -a0 * T**2
    c5 = (6 * dp - 3 * dv + 0.5 * da) / T**5
    c4 = (-15 * dp + 7 * dv - da) / T**4
    c3 = (10 * dp - 4 * dv + 0.5 * da) / T**3
    t = (T * np.linspace(0.0, 1.0, count))[:, :, None]
    c5, c4, c3 = c5[:, None], c4[:, None], c3[:, None]
    position = p0 + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5))))
    velocity = v0 + t * (a0 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5)))
    acceleration = a0 + t * (6 * c3 + t * (12 * c4 + t * 20 * c5))
    jerk = 6 * c3 + t * (24 * c4 + t * 60 * c5)
    return _excess(request, position, velocity, acceleration, jerk)


def _excess(
    request: PlanRequest, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, jerk: np.ndarray
) -> np.ndarray:
    limits = request.limits
    worst = [position[..., 2].max(axis=1), np.linalg.norm(jerk, axis=-1).max(axis=1) / limits.max_jerk_m_s3 - 1.0]
    for share in (0.0, 1.0):
        push = share * np.array(request.pad_acceleration_m_s2)
        total = velocity + np.array(request.pad_velocity_m_s) + request.pad_preview_s * push
        pushed = acceleration + push
        force = pushed - np.array([0.0, 0.0, GRAVITY])
        size = np.linalg.norm(force, axis=-1)
        along = force / size[..., None]
        turning = jerk - (jerk * along).sum(axis=-1)[..., None] * along
        worst += [
            np.hypot(total[..., 0], total[..., 1]).max(axis=1) / limits.max_speed_m_s - 1.0,
            -total[..., 2].min(axis=1) / limits.max_climb_m_s - 1.0,
            total[..., 2].max(axis=1) / limits.max_descent_m_s - 1.0,
            np.linalg.norm(pushed, axis=-1).max(axis=1) / limits.max_acceleration_m_s2 - 1.0,
            size.max(axis=1) / (limits.thrust_to_weight * GRAVITY) - 1.0,
            1.0 + force[..., 2].max(axis=1) / (limits.min_thrust_to_weight * GRAVITY),
            (np.linalg.norm(turning, axis=-1) / size).max(axis=1) / limits.max_body_rate_rad_s - 1.0,
        ]
        if request.field_of_view is not None:
            cosine = (along * position).sum(axis=-1) / np.maximum(np.linalg.norm(position, axis=-1), 1e-12)
            high = -position[..., 2] >= request.field_of_view.min_height_m
            worst.append(np.where(high, np.cos(request.field_of_view.half_angle_rad) - cosine, -1.0).max(axis=1))
    return np.max(worst, axis=0)


def numpy_times(situations: int) -> float:
    """Nanoseconds a candidate of the sampling batch."""
    rng = np.random.default_rng(1)
    durations = np.array(end_times(0.5, 8.0, PER_SITUATION))
    requests = [situation(rng) for _ in range(situations)]
    return sum(best_of(3, lambda r=r: sampled_batch(r, durations)) for r in requests) / situations / PER_SITUATION * 1e9


def false_verdicts(candidates: int) -> dict[str, int]:
    """Accepted candidates that break a limit at 2001 instants, and refused ones that hold all of them."""
    rng = np.random.default_rng(2)
    durations = end_times(0.5, 8.0, PER_SITUATION)
    found = {"candidates": 0, "accepted": 0, "accepted_but_violating": 0, "good": 0, "refused_though_good": 0}
    for _ in range(candidates // PER_SITUATION):
        request = situation(rng)
        arguments = kernel_input(request, durations)
        fan.evaluate(*arguments)
        excess = sampled_batch(request, np.array(durations), 2001)
        accepted = np.array([verdict == 0 for verdict in arguments[-1]])
        found["candidates"] += len(durations)
        found["accepted"] += int(accepted.sum())
        found["accepted_but_violating"] += int((accepted & (excess > 1e-5)).sum())
        found["good"] += int((excess < 1e-9).sum())
        found["refused_though_good"] += int((~accepted & (excess < 1e-9)).sum())
    return found


def planner_times(count: int) -> dict[str, dict[str, float]]:
    """CPU milliseconds a plan from request to answer, share of plans found, violations when sampled at 1001 instants."""
    table = {}
    for name, factory in PLANNERS.items():
        rng = np.random.default_rng(3)
        planner, times, found, violating, durations = factory(Planning(max_descent_m_s=3.0)), [], 0, 0, []
        for k in range(count + 1):
            request = admitting_start(replace(situation(rng, view=False), limits=Limits(max_descent_m_s=3.0)))
            begin = time.thread_time()
            result = planner.plan(request)
            if k:
                times.append(time.thread_time() - begin)
            if isinstance(result, Plan):
                found += 1
                durations.append(result.trajectory.duration_s)
                violating += _violates(request, result.trajectory)
        table[name] = {
            **_percentiles_ms(times),
            "found": found / (count + 1),
            "violating": violating,
            "duration_s": float(np.mean(durations)),
        }
    return table


def ways_round(count: int) -> dict[str, dict[str, float]]:
    """Random ways of 12 to 40 m past a no-fly cylinder near their middle, over a pad at up to 3 m/s."""
    rng = np.random.default_rng(5)
    requests = [request for request in (_past_a_cylinder(rng) for _ in range(count)) if request is not None]
    results = {}
    for name in sorted(PLANNERS):
        made = PLANNERS[name](Planning(corridor_half_width_m=6.0))
        times, plans = [], []
        for request in requests:
            began = time.process_time()
            plans.append(made.plan(request))
            times.append(time.process_time() - began)
        found = [(r, p) for r, p in zip(requests, plans, strict=True) if isinstance(p, Plan)]
        results[name] = {
            **_percentiles_ms(times),
            "asked": len(requests),
            "found": len(found),
            "through": sum(_meets(request, plan.trajectory) for request, plan in found),
        }
    return results


def _past_a_cylinder(rng: np.random.Generator) -> PlanRequest | None:
    """None where the cylinder holds the start or the goal."""
    bearing, way_m, speed_m_s, course = (rng.uniform(*r) for r in ((0.0, 6.28), (12.0, 40.0), (0.0, 3.0), (0.0, 6.28)))
    start = (float(way_m * np.cos(bearing)), float(way_m * np.sin(bearing)))
    share, radius_m = rng.uniform(0.3, 0.7), float(rng.uniform(1.0, 4.0))
    north, east = (float(share * start[k] + rng.uniform(-1.0, 1.0)) for k in (0, 1))
    if min(np.hypot(north, east), np.hypot(north - start[0], east - start[1])) < 1.1 * radius_m:
        return None
    return admitting_start(
        PlanRequest(
            t_ns=0,
            position_m=(*start, -float(rng.uniform(5.0, 10.0))),
            velocity_m_s=(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(-1.0, 1.0)), 0.0),
            limits=Limits(relative_speed_m_s=4.0),
            goal_position_m=(0.0, 0.0, -5.0),
            pad_velocity_m_s=(float(speed_m_s * np.cos(course)), float(speed_m_s * np.sin(course)), 0.0),
            obstacles=(Cylinder((north, east), radius_m),),
        )
    )


def _meets(request: PlanRequest, path: Trajectory) -> bool:
    """Sampled, not proven: a second opinion."""
    (cylinder,) = request.obstacles
    for t_s in np.linspace(0.0, path.duration_s, 1001).tolist():
        here, centre = path.sample(t_s)[0], centre_at(cylinder, request.pad_velocity_m_s, t_s)
        if np.hypot(here[0] - centre[0], here[1] - centre[1]) < cylinder.radius_m - 1e-6:
            return True
    return False


def _percentiles_ms(times_s: list[float]) -> dict[str, float]:
    p50, p99, p100 = np.percentile(times_s, [50, 99, 100]).tolist()
    return {"p50_ms": 1e3 * p50, "p99_ms": 1e3 * p99, "p100_ms": 1e3 * p100}


def _violates(request: PlanRequest, path: Trajectory) -> bool:
    states = np.array([[*path.sample(t), path.jerk(t)] for t in np.linspace(0.0, path.duration_s, 1001)])
    return bool(_excess(request, *(states[None, :, k] for k in range(4)))[0] > 1e-5)


def tick_time(cycles: int = 1000) -> dict[str, float]:
    """One whole `plan` of the fan with 200 candidates, view checked, nothing kept from the cycle before. CPU time."""
    rng = np.random.default_rng(4)
    planner = MinJerkPlanner(end_times=40, approaches=5, switch_distance_m=0.0)
    times = []
    for k in range(cycles + 1):
        request = situation(rng)
        begin = time.thread_time()
        planner.plan(request)
        if k:
            times.append(time.thread_time() - begin)
    return _percentiles_ms(times)


def whole_tick_time(seed: int = 1) -> dict[str, float]:
    """Ticks of a whole simulated landing (`line`) that plans anew at 50 Hz from 200 candidates: estimate, mission, plan and
    control. CPU time of `Pipeline.handle`, from OFFBOARD on."""
    wanted = {"planning.planner": "min_jerk", "planning.end_times": 40, "planning.approach_directions": 5}
    flight = Flight(load("line"), load_with([], {**wanted, "planning.replan_hz": 50.0}), seed)
    pipeline, times = flight._onboard.pipeline, []
    handle = pipeline.handle

    def timed(message: Input) -> list[Any]:
        begin = time.thread_time()
        outputs = handle(message)
        if isinstance(message, Tick) and pipeline.phase not in (Phase.IDLE, Phase.ENGAGE):
            times.append(time.thread_time() - begin)
        return outputs

    setattr(pipeline, "handle", timed)  # noqa: B010  an instance is watched, not the class changed
    outcome = flight.run(lambda: False).outcome
    figures = _percentiles_ms(times)
    return {"landed": float(outcome == "landed"), "ticks": float(len(times)), **figures}


def sample_time() -> float:
    """Microseconds a sample of a B-spline plan (position, velocity, acceleration)."""
    result = PLANNERS["bspline"](Planning()).plan(admitting_start(situation(np.random.default_rng(5), view=False)))
    assert isinstance(result, Plan)
    times = np.linspace(0.0, result.trajectory.duration_s, 1000).tolist()
    return best_of(10, lambda: [result.trajectory.sample(t) for t in times]) / 1000 * 1e6


def snap_times() -> dict[str, dict[str, float]]:
    """Microseconds of the closed form, and of a dense solve of the same reduced system, for n segments in 3-D."""
    rng = np.random.default_rng(6)
    rest, table = np.zeros((3, 3)), {}
    for n in (4, 10, 100, 1000):
        waypoints, durations = np.cumsum(rng.normal(size=(n + 1, 3)), axis=0), rng.uniform(0.5, 2.0, n)
        solve(waypoints, durations, rest, rest, GRAM)
        ours = best_of(200, lambda w=waypoints, d=durations: solve(w, d, rest, rest, GRAM)) * 1e6
        dense = best_of(3, lambda w=waypoints, d=durations: _dense(w, d)) * 1e6 if n <= 100 else float("nan")
        table[str(n)] = {"us": ours, "dense_us": dense}
    return table


def _dense(waypoints: np.ndarray, durations: np.ndarray) -> np.ndarray:
    n = len(durations)
    form = np.zeros((4 * n + 4, 4 * n + 4))
    for i, t in enumerate(durations):
        powers = np.tile(t ** np.arange(4.0), 2)
        form[4 * i : 4 * i + 8, 4 * i : 4 * i + 8] += GRAM * np.outer(powers, powers) / t**7
    unknown = np.array([4 * i + k for i in range(1, n) for k in (1, 2, 3)])
    known = 4 * np.arange(n + 1)
    return np.linalg.solve(form[np.ix_(unknown, unknown)], -form[np.ix_(unknown, known)] @ waypoints)


def guo_table() -> list[dict[str, Any]]:
    """The four methods on the printed 2-D waypoints, T = 180 s, threshold 2 m, corridor 3 m wide."""
    durations = durations_by_distance(WAYPOINTS, 180.0)
    methods: dict[str, Callable[[], Trajectory]] = {
        "improved, split all": lambda: improved_minimum_snap(WAYPOINTS, 180.0, 2.0).trajectory(),
        "improved, split worst": lambda: improved_minimum_snap(WAYPOINTS, 180.0, 2.0, rule="worst").trajectory(),
        "corridor, through": lambda: corridor_minimum_snap(WAYPOINTS, durations, 1.5).trajectory(),
        "corridor, free": lambda: corridor_minimum_snap(WAYPOINTS, durations, 1.5, [False] * 5).trajectory(),
        "minimum snap": lambda: minimum_snap(WAYPOINTS, durations).trajectory(),
        "Catmull-Rom": lambda: catmull_rom_path(WAYPOINTS, durations),
    }
    return [_row(name, make) for name, make in methods.items()]


def _row(name: str, make: Callable[[], Trajectory]) -> dict[str, Any]:
    path = make()
    points = np.array([path.sample(t)[0] for t in np.linspace(0.0, path.duration_s, 4001)])
    away = np.min([distance_to_segment(points, a, b) for a, b in itertools.pairwise(WAYPOINTS)], axis=0)
    return {
        "method": name,
        "mean_m": float(away.mean()),
        "std_m": float(away.std()),
        "max_m": float(away.max()),
        "segments": len(path.pieces),
        "distance_m": float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()),
        "generation_ms": best_of(20, make) * 1e3,
    }


def plain_fan(candidates: int) -> dict[str, float]:
    """The same kernel in another process with compilation switched off."""
    command = [sys.executable, __file__, "--plain-fan", str(candidates)]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return dict(json.loads(done.stdout))


def measure(candidates: int) -> dict[str, Any]:
    return {
        "compiled": COMPILED,
        "candidate, all checks without view": fan_times(candidates, view=False),
        "candidate, all checks": fan_times(candidates, view=True),
        "candidate, all checks, plain Python": plain_fan(max(candidates // 20, 200)),
        "candidate, NumPy batch of 20 sampled at 100 instants, ns": numpy_times(100),
        "verdicts against 2001 samples": false_verdicts(candidates),
        "fan of 200 candidates, whole plan": tick_time(),
        "whole 50 Hz tick of a flight, 200 candidates": whole_tick_time(),
        "sample of a plan, us": sample_time(),
        "planners": planner_times(300),
        "past a no-fly cylinder": ways_round(400),
        "minimum snap by segments": snap_times(),
        "guo": guo_table(),
    }


def show(value: Any, indent: str = "") -> None:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, content in items:
        if isinstance(content, dict) and not any(isinstance(v, dict) for v in content.values()):
            texts = [f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in content.items()]
            print(f"{indent}{key}: {', '.join(texts)}")
        elif isinstance(content, dict | list):
            print(f"{indent}{key}:")
            show(content, indent + "  ")
        else:
            print(f"{indent}{key}: {content:.4g}" if isinstance(content, float) else f"{indent}{key}: {content}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--candidates", type=int, default=10_000)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plain-fan", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.plain_fan:
        print(json.dumps(fan_times(arguments.plain_fan, view=True)))
        return
    results = measure(arguments.candidates)
    show(results)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
