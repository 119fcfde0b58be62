"""`sitl-stub`: arguments in, server.py run, status lines and the verdict out. Nothing here simulates anything."""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import math
import signal
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from sitl_stub import scenario as scenarios
from sitl_stub.airframe import AirframeError
from sitl_stub.external import EXTERNAL_LINKS, ExternalWorld
from sitl_stub.pad_layout import PadLayoutError
from sitl_stub.scenario import Scenario, ScenarioError
from sitl_stub.server import Server, ServerOptions, Status
from sitl_stub.server_link import PX4_LINKS, LinkOptions
from sitl_stub.verdict import Verdict
from sitl_stub.world import World

_DESCRIPTION = """\
A multirotor with PX4's behaviour, a pad that moves, and cameras; served as PX4 SITL serves itself.

MAVLink over UDP: the vehicle binds 14580 and sends to 127.0.0.1:14540 (the application), and binds
18570 and sends to 14550 (a ground station); it answers to wherever it is spoken to from.
Cameras over HTTP: http://127.0.0.1:8554/down, JPEG after JPEG, each with its capture time on the
vehicle's clock (X-Capture-Time-Boot-Us). http://127.0.0.1:8554/ lists the cameras."""

_EPILOG = """\
examples:
  sitl-stub                                   the scenario "line", in real time
  sitl-stub figure8 --seed 7 --speed 4        four times faster
  sitl-stub my.toml --until-landed --json     stop at the end of the flight, print the verdict
  sitl-stub line --set wind.mean_m_s=8 --set path.speed_m_s=3
  sitl-stub circle --vehicle external         pad, cameras, range sensor and beacon around a PX4
                                              SITL that runs already (its pose comes over MAVLink)

Exit status: 0 for a landing on the pad (or when stopped before an end), 1 for another end of the
flight with --until-landed, 2 for a wrong argument or scenario, 3 where a port is taken."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the console script; ends the process."""
    sys.exit(run(arguments))


def run(arguments: Sequence[str] | None = None) -> int:
    """The exit status."""
    options = _parser().parse_args(arguments)
    try:
        if options.list:
            return _list_scenarios()
        scenario = scenarios.with_overrides(scenarios.load(options.scenario), _overrides(options.set))
        return asyncio.run(_serve(scenario, options))
    except (ScenarioError, AirframeError, PadLayoutError) as error:
        print(f"sitl-stub: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"sitl-stub: cannot listen: {error}. Does another one run? See --help for the ports.", file=sys.stderr)
        return 3


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sitl-stub",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("scenario", nargs="?", default="line", help="a name of --list, or a file (configs/scenarios; default line)")
    add("--list", action="store_true", help="the scenarios that come with it, and what each is")
    add("--seed", type=int, default=1, help="which of the scenario's flights (default 1)")
    add("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the scenario; repeatable")
    add("--speed", type=_positive, default=1.0, metavar="X", help="simulated seconds per second (default 1)")
    add(
        "--vehicle", choices=("simulated", "external"), default="simulated", help="whose multirotor (default simulated)"
    )
    add("--until-landed", action="store_true", help="stop when the flight has ended")
    add("--duration", type=_positive, metavar="S", help="stop after this much simulated time")
    add("--json", action="store_true", help="print the verdict as one line of JSON at the end")
    add("--quiet", action="store_true", help="no status lines")
    network = parser.add_argument_group("network")
    add = network.add_argument
    add("--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1; 0.0.0.0 opens it to the network)")
    add("--remote-host", default="127.0.0.1", help="where datagrams go first (default 127.0.0.1)")
    add("--onboard", type=_ports, metavar="BIND:TO", help="ports of the application's link (default 14580:14540)")
    add("--ground", type=_ports, metavar="BIND:TO", help="ports of the ground station's link (default 18570:14550)")
    add("--camera-port", type=int, default=8554, help="port of the cameras (default 8554)")
    add("--jpeg-quality", type=int, default=92, help="1 to 100 (default 92)")
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be more than 0")
    return value


def _ports(text: str) -> tuple[int, int]:
    bind, colon, to = text.partition(":")
    if not colon or not (bind + to).isdigit():
        raise argparse.ArgumentTypeError(f"{text}: must be two ports, as in 14580:14540")
    return int(bind), int(to)


def _overrides(pairs: Sequence[str]) -> dict[str, Any]:
    overrides = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals:
            raise ScenarioError(f"--set {pair}: must be KEY=VALUE, as in wind.mean_m_s=8")
        try:
            overrides[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            overrides[key.strip()] = text
    return overrides


def _list_scenarios() -> int:
    for name in scenarios.names():
        print(f"{name:16s} {scenarios.load(name).description}")
    return 0


async def _serve(scenario: Scenario, options: argparse.Namespace) -> int:
    is_external = options.vehicle == "external"
    simulation = ExternalWorld(scenario, options.seed) if is_external else World(scenario, options.seed, render=False)
    server_options = ServerOptions(
        host=options.host,
        remote_host=options.remote_host,
        links=_links(options, EXTERNAL_LINKS if is_external else PX4_LINKS),
        camera_port=options.camera_port,
        speed=options.speed,
        jpeg_quality=options.jpeg_quality,
        until_landed=options.until_landed,
        stop_after_s=options.duration,
    )
    on_status = _ignore if options.quiet else _print_status
    server = Server(simulation, list(scenario.cameras), server_options, on_status)
    await server.open()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, server.stop)
    if not options.quiet:
        _print_opening(scenario, options, server)
    # What exists now lives as long as the process: the collector need not look at it in flight.
    gc.freeze()
    verdict = await server.run()
    return _finish(verdict, scenario, options)


def _links(options: argparse.Namespace, defaults: tuple[LinkOptions, ...]) -> tuple[LinkOptions, ...]:
    asked = {"onboard": options.onboard, "ground": options.ground}
    return tuple(
        LinkOptions(link.name, *asked[link.name]) if asked[link.name] is not None else link for link in defaults
    )


def _ignore(status: Status) -> None:
    pass


def _print_opening(scenario: Scenario, options: argparse.Namespace, server: Server) -> None:
    print(f"{scenario.name}: {scenario.description} (seed {options.seed}, {options.vehicle} vehicle)")
    for name, link in server.links.items():
        print(f"  {name:8s} udp {options.host}:{link.port} -> {link.remote[0]}:{link.remote[1]}")
    for camera in scenario.cameras:
        print(f"  camera   http://{options.host}:{server.camera_port}/{camera}")
    print("  Ctrl-C stops it.", flush=True)


def _print_status(status: Status) -> None:
    truth, verdict = status.truth, status.verdict
    x, y, z = truth.vehicle_in_pad_m
    late = f"  cannot keep up: {status.given_up_s:.1f} s given up" if status.given_up_s > 0.0 else ""
    frames = f"  {status.frames_dropped} frames dropped" if status.frames_dropped else ""
    print(
        f"{truth.t_us * 1e-6:7.1f} s  x{status.real_time_factor:4.2f}  {truth.mode:12s} "
        f"{'armed' if truth.is_armed else 'disarmed':8s}  pad {math.hypot(x, y):6.2f} m off, {-z:6.2f} m below  "
        f"{verdict.ending}{late}{frames}",
        flush=True,
    )


def _finish(verdict: Verdict, scenario: Scenario, options: argparse.Namespace) -> int:
    if options.json:
        row = {"scenario": scenario.name, "seed": options.seed, **asdict(verdict), "ending": str(verdict.ending)}
        print(json.dumps(row), flush=True)
    elif not options.quiet:
        print(verdict_line(verdict), flush=True)
    return 1 if options.until_landed and verdict.is_over and not verdict.is_success else 0


def verdict_line(verdict: Verdict) -> str:
    """One sentence for a person."""
    if verdict.touchdown_s is None:
        return f"{verdict.ending} after {verdict.t_s:.1f} s, no touchdown on the pad"
    return (
        f"{verdict.ending} after {verdict.t_s:.1f} s: touchdown at {verdict.touchdown_s:.2f} s, "
        f"{verdict.touchdown_error_m:.3f} m from the centre, "
        f"{verdict.touchdown_relative_speed_horizontal_m_s:.2f} m/s across, "
        f"{verdict.touchdown_relative_speed_vertical_m_s:.2f} m/s down"
        + (", motors stopped in the air" if verdict.forced_disarm_in_air else "")
    )
