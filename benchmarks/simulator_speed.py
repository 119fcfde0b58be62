"""How many simulated seconds the simulator makes in a second of one core, and where the time goes.

    python benchmarks/simulator_speed.py [--seconds 20] [--repeat 3] [--json] [--mujoco] [--profile]

Rows: flying without cameras (the autopilot's ground link off and on), flying with the 752 x 480 camera at 30 Hz rendered,
standing on a moving deck (contact at 1 kHz), and one rendered frame. `--mujoco` adds a quadrotor in MuJoCo at 250 Hz with a
small attitude and height controller in NumPy, if the package is installed, in the same run; it has no estimator, no
autopilot, no messages, no wind, so it says what a bare physics loop costs and not what a substitute for PX4 does. The
best of the repeats counts: everything else is other load. Run it on a quiet machine.
"""

from __future__ import annotations

import argparse
import cProfile
import importlib.util
import json
import pstats
import time
from collections.abc import Callable
from typing import Any

import msgspec

from sitl_stub import scenario as scenarios
from sitl_stub.scenario import Scenario
from sitl_stub.world import World

CHUNK_S = 0.02


def flying(*, cameras: bool, overrides: dict[str, Any] | None = None) -> Scenario:
    loaded = scenarios.with_overrides(scenarios.load("line"), {"place.pad_distance_m": 3.0, **(overrides or {})})
    return loaded if cameras else msgspec.structs.replace(loaded, cameras={})


def run_world(scenario: Scenario, seconds: float) -> Callable[[], float]:
    """A function that simulates so long and returns simulated seconds per second."""

    def once() -> float:
        world = World(scenario, 1)
        world.step(0.4)
        begun = time.perf_counter()
        for _ in range(round(seconds / CHUNK_S)):
            world.step(CHUNK_S)
        return seconds / (time.perf_counter() - begun)

    return once


def frame_time(seconds: float) -> Callable[[], float]:
    """Milliseconds of one rendered frame."""

    def once() -> float:
        world = World(flying(cameras=True), 1, render=False)
        captures = [capture for _ in range(round(seconds / CHUNK_S)) for capture in world.step(CHUNK_S).captures]
        begun = time.perf_counter()
        for capture in captures:
            capture.render()
        return (time.perf_counter() - begun) / len(captures) * 1e3

    return once


_MUJOCO_MODEL = """
<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="50 50 1"/>
<body name="quad" pos="0 0 10"><freejoint/><geom type="box" size="0.2 0.2 0.05" mass="2"/>
<site name="m0" pos="0.17 0.17 0"/><site name="m1" pos="-0.17 -0.17 0"/>
<site name="m2" pos="0.17 -0.17 0"/><site name="m3" pos="-0.17 0.17 0"/></body></worldbody>
<actuator><motor site="m0" gear="0 0 1 0 0 0.016"/><motor site="m1" gear="0 0 1 0 0 0.016"/>
<motor site="m2" gear="0 0 1 0 0 -0.016"/><motor site="m3" gear="0 0 1 0 0 -0.016"/></actuator></mujoco>
"""


def mujoco_loop(seconds: float) -> Callable[[], float]:
    """A quadrotor in MuJoCo, 250 Hz, with a small attitude and height controller in NumPy around it."""
    import mujoco
    import numpy as np

    def once() -> float:
        model = mujoco.MjModel.from_xml_string(_MUJOCO_MODEL)
        data = mujoco.MjData(model)
        steps = round(seconds * 250.0)
        begun = time.perf_counter()
        for _ in range(steps):
            q, w, p, v = data.qpos[3:7], data.qvel[3:6], data.qpos[0:3], data.qvel[0:3]
            lift = 2.0 * (9.81 + 2.0 * (10.0 - p[2]) - 2.0 * v[2])
            torque = -4.0 * q[1:4] * np.sign(q[0]) - 0.8 * w
            roll, pitch = torque[0] / 0.68, torque[1] / 0.68
            data.ctrl[:] = lift / 4.0 + np.array([roll - pitch, pitch - roll, -roll - pitch, roll + pitch])
            mujoco.mj_step(model, data)
        return seconds / (time.perf_counter() - begun)

    return once


def rows(seconds: float, with_mujoco: bool) -> list[tuple[str, str, Callable[[], float]]]:
    found = [
        ("flying, no camera", "x real time", run_world(flying(cameras=False), seconds)),
        ("flying, camera rendered", "x real time", run_world(flying(cameras=True), 0.3 * seconds)),
        (
            "standing on a moving deck",
            "x real time",
            run_world(flying(cameras=False, overrides={"vehicle.start": "deck"}), 0.5 * seconds),
        ),
        ("one frame 752 x 480", "ms", frame_time(0.3 * seconds)),
    ]
    if with_mujoco and importlib.util.find_spec("mujoco") is not None:
        found.append(("MuJoCo loop, same rate", "x real time", mujoco_loop(seconds)))
    return found


def profile(seconds: float) -> None:
    world = World(flying(cameras=False), 1)
    world.step(0.4)
    profiler = cProfile.Profile()
    profiler.enable()
    for _ in range(round(seconds / CHUNK_S)):
        world.step(CHUNK_S)
    profiler.disable()
    pstats.Stats(profiler).sort_stats("tottime").print_stats(25)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated time of a row")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--mujoco", action="store_true", help="add MuJoCo where it is installed")
    parser.add_argument("--profile", action="store_true", help="also say where the time goes, without camera")
    options = parser.parse_args()
    for name, unit, measure in rows(options.seconds, options.mujoco):
        values = [measure() for _ in range(options.repeat)]
        best = min(values) if unit == "ms" else max(values)
        if options.json:
            print(json.dumps({"name": name, "unit": unit, "best": best, "all": values}))
        else:
            print(f"{name:28s} {best:8.2f} {unit}   (all: {', '.join(f'{v:.2f}' for v in values)})")
    if options.profile:
        profile(options.seconds)


if __name__ == "__main__":
    main()
