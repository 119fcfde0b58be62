"""How many simulated seconds the simulator makes in a second of one core, and where the time goes.

    python benchmarks/simulator_speed.py [--seconds 20] [--repeat 3] [--json] [--fast|--plain] [--references] [--profile]
        [--parts]

Rows without cameras: OFFBOARD with setpoints at 25 Hz and hovering in AUTO.LOITER, each with the autopilot's ground link off
and on (on, PX4 sends twice as many messages), and standing on a moving deck (contact at 1 kHz). Then flying with the 752 x 480 camera
at 30 Hz rendered, and one frame. Each row is measured in a process of its own, plain (NUMBA_DISABLE_JIT=1) and with numba where it is
installed. Time is the process's CPU time; "loop" is a fixed loop of plain Python in the same run, to tell a busy machine from a slow
simulator: it takes about 0.07 s on the machine of docs/simulator.md when that is quiet. The best of the repeats counts.

`--parts` puts timers around the parts of OFFBOARD flight with the ground link off and prints calls a simulated second, the median of a
call and their product; parts lie within one another. A timer adds about 0.3 us to a call.

`--references` adds, where they are installed, MuJoCo (a quadrotor at 250 Hz with a small attitude and height controller in NumPy) and
gym-pybullet-drones (its CtrlAviary at 240 Hz with its own DSLPIDControl). Both have neither estimator, autopilot nor messages nor
wind: they say what a physics loop with a controller costs in Python, not what a substitute for PX4 does.
"""

from __future__ import annotations

import argparse
import cProfile
import importlib.util
import json
import os
import pstats
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import msgspec

from sitl_stub import scenario as scenarios
from sitl_stub.carriers.deck import Deck
from sitl_stub.compiled import COMPILED
from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED
from sitl_stub.mavlink.frame import encode
from sitl_stub.scenario import Scenario
from sitl_stub.steady_flight import SteadyFlight
from sitl_stub.world import World

CHUNK_S = 0.02
SETPOINT_EVERY = 2  # 25 Hz
SETTLING_S = 0.4
_LOOP_TURNS = 2_000_000


def flying(*, cameras: bool, overrides: dict[str, Any] | None = None) -> Scenario:
    loaded = scenarios.with_overrides(scenarios.load("line"), {"place.pad_distance_m": 3.0, **(overrides or {})})
    return loaded if cameras else msgspec.structs.replace(loaded, cameras={})


def setpoint(turn: int) -> Datagram:
    """A slow flight north-east at the same height."""
    values = (0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0b100111000111, 1, 1, 1)
    packed = SET_POSITION_TARGET_LOCAL_NED.struct.pack(*values)
    return Datagram("onboard", encode(SET_POSITION_TARGET_LOCAL_NED, packed, turn & 0xFF, 1, 191))


def go_offboard() -> Datagram:
    packed = COMMAND_LONG.struct.pack(1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 176, 1, 1, 0)
    return Datagram("onboard", encode(COMMAND_LONG, packed, 0, 1, 191))


def fly(world: World, seconds: float, *, offboard: bool) -> None:
    for turn in range(round(seconds / CHUNK_S)):
        datagrams = [setpoint(turn)] if offboard and turn % SETPOINT_EVERY == 0 else []
        if offboard and turn == SETPOINT_EVERY:
            datagrams.append(go_offboard())
        world.step(CHUNK_S, datagrams)


def run_world(
    scenario: Scenario, seconds: float, *, offboard: bool = False, ground_link: bool = True
) -> Callable[[], float]:
    """A function that simulates so long and returns simulated seconds per second of CPU time."""

    def once() -> float:
        world = World(scenario, 1)
        if not ground_link:
            world.autopilot.endpoint.silence("ground")
        fly(world, SETTLING_S, offboard=offboard)
        if offboard and world.autopilot.mode_name != "OFFBOARD":
            raise RuntimeError("the vehicle is not in OFFBOARD")
        begun = time.process_time()
        fly(world, seconds, offboard=offboard)
        return seconds / (time.process_time() - begun)

    return once


def frame_time(seconds: float) -> Callable[[], float]:
    """Milliseconds of one rendered frame."""

    def once() -> float:
        world = World(flying(cameras=True), 1, render=False)
        captures = [capture for _ in range(round(seconds / CHUNK_S)) for capture in world.step(CHUNK_S).captures]
        begun = time.process_time()
        for capture in captures:
            capture.render()
        return (time.process_time() - begun) / len(captures) * 1e3

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
        begun = time.process_time()
        for _ in range(steps):
            q, w, p, v = data.qpos[3:7], data.qvel[3:6], data.qpos[0:3], data.qvel[0:3]
            lift = 2.0 * (9.81 + 2.0 * (10.0 - p[2]) - 2.0 * v[2])
            torque = -4.0 * q[1:4] * np.sign(q[0]) - 0.8 * w
            roll, pitch = torque[0] / 0.68, torque[1] / 0.68
            data.ctrl[:] = lift / 4.0 + np.array([roll - pitch, pitch - roll, -roll - pitch, roll + pitch])
            mujoco.mj_step(model, data)
        return seconds / (time.process_time() - begun)

    return once


def pybullet_drones_loop(seconds: float) -> Callable[[], float]:
    """One quadrotor of gym-pybullet-drones at 240 Hz, held by its own controller."""
    import numpy as np

    control = importlib.import_module("gym_pybullet_drones.control.DSLPIDControl")
    environments = importlib.import_module("gym_pybullet_drones.envs.CtrlAviary")
    model = importlib.import_module("gym_pybullet_drones.utils.enums").DroneModel.CF2X

    def once() -> float:
        environment = environments.CtrlAviary(drone_model=model, pyb_freq=240, ctrl_freq=240, gui=False)
        controller = control.DSLPIDControl(drone_model=model)
        action, target = np.zeros((1, 4)), np.array([0.0, 0.0, 1.0])
        environment.reset()
        begun = time.process_time()
        for _ in range(round(240.0 * seconds)):
            observation, *_ = environment.step(action)
            action[0], _, _ = controller.computeControlFromState(1.0 / 240.0, observation[0], target_pos=target)
        speed = seconds / (time.process_time() - begun)
        environment.close()
        return speed

    return once


def plain_loop() -> Callable[[], float]:
    """Seconds of a fixed loop of plain Python."""

    def once() -> float:
        begun, x = time.process_time(), 0.0
        for i in range(_LOOP_TURNS):
            x = x * 0.5 + i
        return time.process_time() - begun

    return once


def rows(seconds: float) -> list[tuple[str, str, Callable[[], float]]]:
    silent = flying(cameras=False)
    return [
        ("offboard, ground link off", "x", run_world(silent, seconds, offboard=True, ground_link=False)),
        ("offboard, ground link on", "x", run_world(silent, seconds, offboard=True)),
        ("loiter, ground link off", "x", run_world(silent, seconds, ground_link=False)),
        ("loiter, ground link on", "x", run_world(silent, seconds)),
        (
            "standing on a moving deck",
            "x",
            run_world(flying(cameras=False, overrides={"vehicle.start": "deck"}), 0.5 * seconds),
        ),
        ("loiter, camera rendered", "x", run_world(flying(cameras=True), 0.3 * seconds)),
        ("one frame 752 x 480", "ms", frame_time(0.3 * seconds)),
        ("loop", "s", plain_loop()),
    ]


def references(seconds: float) -> list[tuple[str, str, Callable[[], float]]]:
    """Those that are installed."""
    found: list[tuple[str, str, Callable[[], float]]] = []
    if importlib.util.find_spec("mujoco") is not None:
        found.append(("MuJoCo, 250 Hz, no autopilot", "x", mujoco_loop(seconds)))
    if importlib.util.find_spec("gym_pybullet_drones") is not None:
        found.append(("gym-pybullet-drones, 240 Hz", "x", pybullet_drones_loop(0.2 * seconds)))
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


PARTS: tuple[tuple[type, str], ...] = (
    (World, "step"),
    (World, "_take_in"),
    (World, "_fly_steadily"),
    (SteadyFlight, "fly"),
    (SteadyFlight, "send_many"),
    (SteadyFlight, "send"),
    (SteadyFlight, "decide"),
    (World, "_do_what_is_due"),
    (Deck, "at"),
)


def timed(function: Callable[..., Any], times_ns: list[int]) -> Callable[..., Any]:
    def call(*arguments: Any, **named: Any) -> Any:
        begun = time.perf_counter_ns()
        result = function(*arguments, **named)
        times_ns.append(time.perf_counter_ns() - begun)
        return result

    return call


def parts(seconds: float) -> None:
    """Where the time of OFFBOARD flight goes, on the wall: medians, so that what else runs on the machine counts little."""
    world = World(flying(cameras=False), 1)
    world.autopilot.endpoint.silence("ground")
    fly(world, SETTLING_S, offboard=True)
    taken: dict[str, list[int]] = {f"{owner.__name__}.{name}": [] for owner, name in PARTS}
    for owner, name in PARTS:
        setattr(owner, name, timed(getattr(owner, name), taken[f"{owner.__name__}.{name}"]))
    fly(world, seconds, offboard=True)
    for name, times_ns in taken.items():
        if times_ns:
            rate, median_us = len(times_ns) / seconds, statistics.median(times_ns) * 1e-3
            print(f"{name:24s} {rate:7.1f} /s {median_us:8.1f} us {rate * median_us * 1e-3:7.3f} ms/s")


def measured(options: argparse.Namespace) -> None:
    """Measure in this process and print."""
    kind = "fast" if COMPILED else "plain"
    chosen = rows(options.seconds) + (references(options.seconds) if options.references else [])
    for name, unit, measure in chosen:
        values = [measure() for _ in range(options.repeat)]
        best = max(values) if unit == "x" else min(values)
        if options.json:
            print(json.dumps({"name": name, "kind": kind, "unit": unit, "best": best, "all": values}), flush=True)
        else:
            every = ", ".join(f"{value:.3g}" for value in values)
            print(f"{kind:6s} {name:30s} {best:8.3g} {unit:3s} (all: {every})", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated time of a row")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--plain", action="store_true", help="only without numba")
    parser.add_argument("--fast", action="store_true", help="only with numba")
    parser.add_argument("--references", action="store_true", help="add other simulators where they are installed")
    parser.add_argument("--profile", action="store_true", help="also say where the time goes, without camera")
    parser.add_argument("--parts", action="store_true", help="only say where the time of OFFBOARD flight goes")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        cv2.setNumThreads(1)  # one core: OpenCV's own threads would count as processor time too
        if options.parts:
            parts(options.seconds)
            return
        measured(options)
        if options.profile:
            profile(options.seconds)
        return
    both = not options.plain and not options.fast
    for is_wanted, disabled in ((both or options.plain, "1"), (both or options.fast, "0")):
        if is_wanted:
            command = [sys.executable, *sys.argv, "--here"]
            subprocess.run(
                command, check=True, env={**os.environ, "NUMBA_DISABLE_JIT": disabled, "OMP_NUM_THREADS": "1"}
            )


if __name__ == "__main__":
    main()
