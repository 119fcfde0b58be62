"""Flights of a paper's preset, or of the default pipeline, over a pool of processes.

A flight is a campaign's sample and goes through the campaign's engine. All figures are the simulator's truth. Smoothness
is the root mean square of the jerk between start and touchdown, by second differences of the true velocity at 20 Hz.
Energy is what the power model of the `guo` paper gives, P = 1/2 C_D A rho v^3 + sqrt((m g)^3 / (2 pi r^2 rho)), with the
airframe's mass and quadratic drag, v over ground and a propeller of 0.127 m radius (10 inches). W local NED, SI.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from companion.campaign.campaign_file import Sample
from companion.campaign.engine import Row, default_workers, fly_all
from companion.campaign.summary import summary
from companion.config import load_with
from companion.messages import Vec3
from companion.reproduce.papers import preset_file
from companion.reproduce.power import hover_power_w
from companion.reproduce.watched_flight import FlightWatch, Instant
from sitl_stub.airframe import Airframe, read_airframe
from sitl_stub.scenario import find, with_overrides
from sitl_stub.scenario import load as load_scenario

ROTOR_RADIUS_M = 0.127


def flight(
    index: int,
    scenario: str,
    *,
    preset: str | None,
    seed: int = 1,
    world: Mapping[str, Any] | None = None,
    app: Mapping[str, Any] | None = None,
    files: Sequence[str] = (),
) -> Sample:
    """One flight in configs/scenarios/papers/<scenario>.toml. `preset` None: the default pipeline, with what `app` says.

    `files` are further configuration files, as "pads/nested".
    """
    presets: tuple[str, ...] = () if preset is None else (str(preset_file(preset)),)
    presets += tuple(str(find(*name.split("/"))) for name in files)
    file = str(find("scenarios/papers", scenario))
    return Sample(index, file, seed, preset or "default", presets, dict(app or {}), dict(world or {}))


def flown(samples: Sequence[Sample], done: Callable[[int, int], None] = lambda count, of: None) -> list[Row]:
    """All of them, in their order; the rows of `fly_and_measure`. RuntimeError where the program itself failed.

    `done` is told after each flight how many of how many have been flown.
    """
    rows: dict[int, Row] = {}
    for row in fly_all(samples, workers=min(len(samples), default_workers()), flight=fly_and_measure):
        rows[row["sample"]] = row
        done(len(rows), len(samples))
    broken = [row["reason"] for row in rows.values() if row["outcome"] in ("error", "lost")]
    if broken:
        raise RuntimeError(f"{len(broken)} of {len(samples)} flights could not be flown: {broken[0]}")
    return [rows[sample.index] for sample in samples]


def fly_and_measure(sample: Sample) -> Row:
    """A campaign's row with `jerk_rms_m_s3`, `energy_j`, `pad_speed_m_s` at touchdown, `phases`, and `track`.

    `track` has (time, vehicle, pad, yaw) at 20 Hz, `phases` (time, the phase that began).
    """
    import cv2

    from companion.campaign.runner import fly

    cv2.setNumThreads(1)
    scenario = with_overrides(load_scenario(sample.scenario), sample.world)
    config = load_with([Path(name) for name in sample.presets], sample.app)
    watch = FlightWatch()
    began = time.perf_counter()
    result = fly(scenario, config, seed=sample.seed, sinks=[watch])
    figures = summary(result, scenario=scenario.name, seed=sample.seed, wall_s=time.perf_counter() - began)
    airborne = _airborne(watch.instants, result.start_s or 0.0, result.touchdown_s)
    airframe = read_airframe(find("airframes", scenario.vehicle.airframe))
    return {
        "sample": sample.index,
        "cell": sample.cell,
        **figures,
        "touchdown_s": result.touchdown_s,
        "pad_speed_m_s": _pad_speed_m_s(watch.instants, result.touchdown_s),
        "jerk_rms_m_s3": jerk_rms_m_s3([(i.t_s, i.velocity_m_s) for i in airborne]),
        "energy_j": energy_j([(i.t_s, i.velocity_m_s) for i in airborne], airframe),
        "track": [(i.t_s, i.vehicle_m, i.pad_m, i.yaw_rad) for i in watch.instants],
        "phases": [(t_s, str(change.after)) for t_s, change in watch.changes],
    }


def _airborne(instants: Sequence[Instant], start_s: float, touchdown_s: float | None) -> list[Instant]:
    end_s = math.inf if touchdown_s is None else touchdown_s
    return [i for i in instants if start_s <= i.t_s <= end_s]


def _pad_speed_m_s(instants: Sequence[Instant], touchdown_s: float | None) -> float | None:
    if touchdown_s is None:
        return None
    at = min(instants, key=lambda i: abs(i.t_s - touchdown_s))
    return math.hypot(at.pad_velocity_m_s[0], at.pad_velocity_m_s[1])


def jerk_rms_m_s3(velocities: Sequence[tuple[float, Vec3]]) -> float | None:
    """From (time, velocity) at an even rate; None with fewer than three."""
    if len(velocities) < 3:
        return None
    total, count = 0.0, 0
    for (t0, a), (_, b), (t2, c) in zip(velocities, velocities[1:], velocities[2:], strict=False):
        step_s = 0.5 * (t2 - t0)
        total += sum(((x - 2.0 * y + z) / step_s**2) ** 2 for x, y, z in zip(a, b, c, strict=True))
        count += 1
    return math.sqrt(total / count)


def power_w(speed_m_s: float, airframe: Airframe) -> float:
    """The paper's model: parasitic drag and the induced power of one disc that carries the weight."""
    return airframe.drag.quadratic_n_s2_m2[0] * speed_m_s**3 + hover_power_w(airframe.mass_kg, ROTOR_RADIUS_M)


def energy_j(velocities: Sequence[tuple[float, Vec3]], airframe: Airframe) -> float:
    """The model's power over the flight."""
    return sum(
        power_w(math.hypot(*(0.5 * (x + y) for x, y in zip(a, b, strict=True))), airframe) * (t1 - t0)
        for (t0, a), (t1, b) in pairwise(velocities)
    )
