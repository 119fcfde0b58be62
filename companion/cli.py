"""Command line: parsing and printing only. Each command calls one function of the module that does the work."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

from companion.calibration.cli import calibrate
from companion.config import Config, ConfigError, load, parse_value

app = typer.Typer(
    help="Lands a PX4 multirotor on a pad that moves.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

ConfigFiles = Annotated[
    list[Path] | None, typer.Option("-c", "--config", help="Configuration file (TOML); may be given several times.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="Override a key: --set control.position_gain_hz=1.5", metavar="KEY=VALUE"),
]

Preset = Annotated[
    str | None,
    typer.Option(help="Fly as a paper did: shivam, falanga, guo, kim, dalang (configs/papers).", metavar="KEY"),
]

Dashboard = Annotated[
    bool, typer.Option("--dashboard", help="A page in the browser: camera, plan, health, hold and abort.")
]


@app.command()
def demo(
    scenario: Annotated[
        str | None, typer.Argument(help="line, circle, figure8, ... or a file (configs/scenarios).")
    ] = None,
    scenario_option: Annotated[str | None, typer.Option("--scenario", help="The same as the argument.")] = None,
    preset: Preset = None,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 1,
    config: ConfigFiles = None,
    settings: Settings = None,
    world: Annotated[
        list[str] | None,
        typer.Option("--world", help="Override a key of the scenario: --world wind.mean_m_s=8", metavar="KEY=VALUE"),
    ] = None,
    udp: Annotated[
        bool, typer.Option("--udp", help="Two processes, real sockets, real time, camera over HTTP.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="No view; end with one line of JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No live view.")] = False,
    dashboard: Dashboard = False,
    runs: Annotated[Path, typer.Option(help="Where run folders are made.")] = Path("runs"),
    keep: Annotated[bool, typer.Option("--keep/--no-keep", help="Write the run folder.")] = True,
) -> None:
    """Watch a simulated landing: the simulator and Companion, in lockstep or over sockets."""
    from companion.demo import DemoOptions, exit_status, fly_demo
    from sitl_stub.scenario import ScenarioError, with_overrides
    from sitl_stub.scenario import load as load_scenario

    name = scenario_option or scenario or _preset_scenario(preset) or "line"
    if dashboard and not udp:
        _fail("--dashboard shows a flight in real time: give --udp too")
    loaded = _with_page(_config(_with_preset(preset, config), settings), dashboard)
    try:
        flown = with_overrides(load_scenario(name), _pairs(world, parse=True))
    except ScenarioError as error:
        _fail(str(error))
    console = Console(stderr=as_json)
    options = DemoOptions(Path(name).stem, seed, runs, show=not (as_json or quiet) and console.is_terminal, keep=keep)
    if udp:
        from companion.demo_udp import fly_demo_udp

        try:
            figures = fly_demo_udp(name, _pairs(world), flown, loaded, options, console)
        except ConfigError as error:
            _fail(str(error))
    else:
        figures = fly_demo(flown, loaded, options, console)
    _print_result(figures, as_json, console)
    raise typer.Exit(exit_status(figures))


def _print_result(figures: dict[str, Any], as_json: bool, console: Console) -> None:
    from companion.campaign.summary import summary_line

    if as_json:
        print(json.dumps(figures))
        return
    console.print(summary_line(figures), style="bold green" if figures["outcome"] == "landed" else "bold red")
    if "run" in figures:
        console.print(f"kept in {figures['run']}: flight.tlog, flight.mcap, run.json, report.html")


@app.command()
def run(
    preset: Preset = None,
    config: ConfigFiles = None,
    settings: Settings = None,
    start: Annotated[bool, typer.Option("--start", help="Say START as soon as the vehicle is heard.")] = False,
    runs: Annotated[Path, typer.Option(help="Where run folders are made.")] = Path("runs"),
    quiet: Annotated[bool, typer.Option("--quiet", help="No live view.")] = False,
    dashboard: Dashboard = False,
) -> None:
    """Fly: the app on a companion computer, or against a simulator."""
    from companion.app import run_live

    loaded = _with_page(_config(_with_preset(preset, config), settings), dashboard)
    try:
        status = run_live(loaded, start=start, runs=runs, show=not quiet and sys.stdout.isatty())
    except ConfigError as error:
        _fail(str(error))
    raise typer.Exit(status)


@app.command()
def campaign(
    file: Annotated[str, typer.Argument(help="Campaign file (configs/campaigns), or `rerun` before it.")],
    again: Annotated[Path | None, typer.Argument(help="With `rerun`: the campaign file.", metavar="FILE")] = None,
    sample: Annotated[int | None, typer.Option(help="With `rerun`: which sample to repeat exactly.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; default: one per core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler instead of local processes.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; default: runs/campaign-<name>.")] = None,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Only the first so many seeds of each combination, for a quick look.")
    ] = None,
    runs: Annotated[
        Path | None, typer.Option(help="Where `rerun` makes its run folder; default: beside the campaign's results.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="End with one line of JSON.")] = False,
) -> None:
    """Hundreds of seeded landings: scenario x parameters x seeds. Goes on where it was interrupted."""
    from companion.campaign.command import rerun, run_campaign

    console = Console(stderr=as_json, width=None if sys.stdout.isatty() else 160)
    try:
        if file == "rerun":
            if again is None or sample is None:
                _fail("campaign rerun needs a campaign file and --sample N")
            figures = rerun(again, sample, console, out=out, runs=runs)
            _print_result(figures, as_json, console)
            return
        figures = run_campaign(Path(file), out=out, workers=workers, scheduler=scheduler, console=console, seeds=seeds)
    except ValueError as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted; the same command goes on with what is missing")
    if as_json:
        print(json.dumps(figures))


@app.command()
def reproduce(
    key: Annotated[str | None, typer.Argument(help="shivam, falanga, guo, kim or dalang; default: all.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pages.")] = Path("runs/reproduce"),
    quick: Annotated[bool, typer.Option("--quick", help="Seconds instead of minutes: fewer seeds.")] = False,
    versus: Annotated[bool, typer.Option("--versus", help="Each paper's preset against the default pipeline.")] = False,
    seeds: Annotated[int | None, typer.Option(min=1, help="With --versus: seeds of each scenario.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="End with one line of JSON.")] = False,
) -> None:
    """Five papers: what they printed beside what this program measures. Writes KEY.html and KEY.md."""
    from companion.reproduce.command import run_reproduce, run_versus

    console = Console(stderr=as_json, width=None if sys.stdout.isatty() else 160)
    try:
        if versus:
            figures = run_versus(key, out, seeds=seeds, quick=quick, console=console)
        else:
            figures = run_reproduce(key, out, quick=quick, console=console)
    except ValueError as error:
        _fail(str(error))
    if as_json:
        print(json.dumps(figures))


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help=".mcap of ours (exact), or any .tlog or .ulg (state in).")],
    config: ConfigFiles = None,
    settings: Settings = None,
    frames: Annotated[
        Path | None, typer.Option(help="Folder of pictures, video, or .mcap whose frames the detector looks at.")
    ] = None,
    frame_rate: Annotated[float | None, typer.Option(help="Of frames without times, Hz.")] = None,
    pad: Annotated[
        str | None, typer.Option(help="A pad that stands still, for logs without one.", metavar="N,E,D")
    ] = None,
    check: Annotated[
        Path | None, typer.Option(help="Golden file to compare with; exit status 1 on difference.")
    ] = None,
    update: Annotated[bool, typer.Option("--update", help="Write the golden file and say what changed.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Run the same pipeline over a log: the first difference, a what-if, or a golden check."""
    from companion.io.frame_folder import recorded_frames
    from companion.replay import ReplayOptions
    from companion.replay_command import answer

    values = {key: parse_value(text) for key, text in _pairs(settings).items()}
    try:
        seen = [] if frames is None else recorded_frames(frames, frame_rate)
        options = ReplayOptions(values, config or [], seen, None if pad is None else _vector(pad))
        found = answer(file, options, check=check, update=update)
    except ValueError as error:
        _fail(str(error))
    print(json.dumps(found.content) if as_json else "\n".join(found.lines))
    raise typer.Exit(found.status)


def _vector(text: str) -> tuple[float, float, float]:
    try:
        north, east, down = (float(part) for part in text.split(","))
    except ValueError:
        _fail(f"{text!r}: expected three numbers, north,east,down in metres")
    return north, east, down


@app.command()
def report(
    path: Annotated[Path, typer.Argument(help="A run folder, a .mcap of ours, or any .tlog or .ulg (replayed).")],
    out: Annotated[
        Path | None, typer.Option(help="The page; default: report.html in the run folder, else here.")
    ] = None,
    config: ConfigFiles = None,
    settings: Settings = None,
    pad: Annotated[str | None, typer.Option(help="As for replay.", metavar="N,E,D")] = None,
) -> None:
    """One self-contained HTML page of a flight or a log: what to look at first, paths, errors, detection, delays."""
    from companion.replay import ReplayOptions
    from companion.report_command import write_report

    values = {key: parse_value(text) for key, text in _pairs(settings).items()}
    try:
        print(write_report(path, out, ReplayOptions(values, config or [], (), None if pad is None else _vector(pad))))
    except ValueError as error:
        _fail(str(error))


log_app = typer.Typer(help="Look into a log: .tlog, .mcap or .ulg.", no_args_is_help=True)
app.add_typer(log_app, name="log")
app.add_typer(calibrate, name="calibrate")


@log_app.command("info")
def log_info(
    file: Annotated[Path, typer.Argument(help="The log.")],
    as_json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """What is in a log: messages, rates, duration, damage."""
    from companion.io.log_commands import info, info_lines

    try:
        found = info(file)
    except ValueError as error:
        _fail(str(error))
    print(json.dumps(found) if as_json else "\n".join(info_lines(found)))


@log_app.command("export")
def log_export(
    file: Annotated[Path, typer.Argument(help="The log.")],
    out: Annotated[Path, typer.Option(help="Folder for the files.")],
    topic: Annotated[list[str] | None, typer.Option(help="Only this message; may be given several times.")] = None,
    form: Annotated[str, typer.Option("--format", help="csv, or parquet (needs companion[parquet]).")] = "csv",
    frames: Annotated[bool, typer.Option("--frames", help="The camera frames of a .mcap instead.")] = False,
) -> None:
    """One file for each message type, or the camera frames."""
    from companion.io.log_commands import export, export_frames

    try:
        if frames:
            print(f"{export_frames(file, out)} frames in {out}")
            return
        written = export(file, out, topics=topic or [], form=form)
    except ValueError as error:
        _fail(str(error))
    print(f"{len(written)} files in {out}")


@log_app.command("plot")
def log_plot(
    file: Annotated[Path, typer.Argument(help="The log.")],
    fields: Annotated[list[str], typer.Argument(help="MESSAGE.FIELD ..., as pad_estimate.position_ned_m")],
    out: Annotated[Path, typer.Option(help="The page to write.")] = Path("plot.html"),
) -> None:
    """Charts of chosen fields on one HTML page."""
    from companion.io.log_commands import plot

    try:
        print(plot(file, fields, out))
    except ValueError as error:
        _fail(str(error))


@app.command("make-pad")
def make_pad(
    config: ConfigFiles = None,
    settings: Settings = None,
    out: Annotated[Path, typer.Option(help="Folder for the drawing and the layout file.")] = Path("."),
    name: Annotated[str, typer.Option(help="Name of the files, without a suffix.")] = "pad",
    formats: Annotated[list[str] | None, typer.Option("--format", help="pdf, svg or png; may be given again.")] = None,
    dots_per_inch: Annotated[int, typer.Option("--dpi", min=10, max=1200, help="Of a PNG.")] = 150,
) -> None:
    """Draw the configured pad at true scale, to print: -c configs/pads/nested.toml."""
    from companion.make_pad import write_pad

    pad = _config(config, settings).pad
    try:
        paths = write_pad(pad, out, name, formats=tuple(formats or ["pdf"]), dots_per_inch=dots_per_inch)
    except (ValueError, OSError) as error:
        _fail(str(error))
    for path in paths:
        print(path)


@app.command()
def doctor(
    config: ConfigFiles = None,
    settings: Settings = None,
    pad_speed: Annotated[float, typer.Option(min=0.0, help="How fast the pad will move, m/s.")] = 3.0,
    seconds: Annotated[float, typer.Option(min=1.0, max=120.0, help="How long to listen.")] = 5.0,
    runs: Annotated[Path, typer.Option(help="Where run folders will be made.")] = Path("runs"),
    as_json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Before the flight: link, clocks, camera, pad, parameters, battery, home, disk, CPU. Flies nothing."""
    from companion.doctor import command

    loaded = _config(config, settings)
    try:
        findings = command.run_doctor(loaded, pad_speed_m_s=pad_speed, duration_s=seconds, runs=runs)
    except ConfigError as error:
        _fail(str(error))
    if as_json:
        print(command.as_json(findings))
    else:
        command.print_findings(findings, Console())
    raise typer.Exit(command.exit_status(findings))


@app.command()
def init(
    file: Annotated[Path, typer.Argument(help="The file to write.")] = Path("companion.toml"),
    answers: Annotated[
        list[str] | None,
        typer.Option(
            "--answer", help="An answer ahead: --answer link=serial:///dev/ttyAMA0:921600", metavar="NAME=TEXT"
        ),
    ] = None,
    defaults: Annotated[bool, typer.Option("--defaults", help="Ask nothing; defaults for what is not given.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
) -> None:
    """Write a commented configuration: a few questions, each with a default."""
    from companion import first_config

    try:
        given = _pairs(answers)
        first_config.write(file, given, ask=not defaults and sys.stdin.isatty(), overwrite=force)
    except ValueError as error:
        _fail(str(error))
    print(f"{file}: written; next: companion check-config -c {file}, companion doctor -c {file}")


@app.command("check-config")
def check_config(config: ConfigFiles = None, settings: Settings = None) -> None:
    """Check configuration files and print the whole configuration as JSON."""
    import msgspec

    loaded = _config(config, settings)
    print(msgspec.json.format(msgspec.json.encode(loaded), indent=2).decode())


def _preset_scenario(preset: str | None) -> str | None:
    from companion.reproduce.papers import preset_scenario

    try:
        return None if preset is None else str(preset_scenario(preset))
    except ValueError as error:
        _fail(str(error))


def _with_preset(preset: str | None, files: list[Path] | None) -> list[Path]:
    """The preset's file, then the user's own, which may differ from it."""
    if preset is None:
        return files or []
    from companion.reproduce.papers import preset_file

    try:
        return [preset_file(preset), *(files or [])]
    except ValueError as error:
        _fail(str(error))


def _config(files: list[Path] | None, settings: list[str] | None) -> Config:
    try:
        return load(files or [], _pairs(settings))
    except ConfigError as error:
        _fail(str(error))


def _with_page(config: Config, wanted: bool) -> Config:
    import msgspec

    page = msgspec.structs.replace(config.dashboard, enabled=config.dashboard.enabled or wanted)
    return msgspec.structs.replace(config, dashboard=page)


def _pairs(settings: list[str] | None, *, parse: bool = False) -> dict[str, Any]:
    pairs: dict[str, Any] = {}
    for text in settings or []:
        key, equals, value = text.partition("=")
        if not equals or not key:
            _fail(f"{text!r}: expected KEY=VALUE, as in --set control.position_gain_hz=1.5")
        pairs[key.strip()] = parse_value(value.strip()) if parse else value.strip()
    return pairs


def _fail(text: str) -> NoReturn:
    print(f"companion: {text}", file=sys.stderr)
    raise typer.Exit(2)


def main() -> None:
    """Entry point of the console script."""
    app()
