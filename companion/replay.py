"""`companion replay`: a log through the same Pipeline that flew, as fast as it goes.

Three ways, by what the log is:
  our .mcap, same configuration   exact: the recorded inputs in the recorded order, every output compared to the last bit
                                  (a log that holds inputs only gives figures, for golden files)
  our .mcap with --set or frames  what-if: the same inputs, figures of both sides beside each other
  any .tlog or .ulg               the vehicle's state goes in; our setpoints are compared with those that were sent
What it finds is a flat dictionary of figures: printed, compared with a golden file (golden.py), or given as JSON.
"""

from __future__ import annotations

import gc
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from heapq import merge
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec

from companion.config import Config, ConfigError, load_with
from companion.estimation.kalman import warm_up
from companion.io.frame_folder import RecordedFrame
from companion.io.log_inputs import LogInputs, LogInputsError, RecordedSetpoint, tlog_inputs, ulog_inputs
from companion.io.mcap_log import LoggedEntry, McapLog, McapLogError, encode_entry, topic_of
from companion.messages import (
    AutopilotMode,
    CameraImage,
    Input,
    LandedState,
    MeasurementVerdict,
    Message,
    OperatorAction,
    OperatorCommand,
    Output,
    PadBeacon,
    PadBearing,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    PlanMade,
    Tick,
    Vec3,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)
from companion.pipeline import Pipeline
from companion.vision import DETECTORS, Detector
from companion.vision.lens import from_config

PAIR_WITHIN_NS = 50_000_000
PAD_PERIOD_NS = 200_000_000
PAD_SIGMA_M = 0.3
BLIND_PERIOD_NS = 100_000_000
LONGEST_TICKED_NS = 10_000_000_000
DETECTIONS = (PadObservation, PadBearing, PadNotSeen)
_COUNTED: dict[type, str] = {kind: topic_of(kind)[1:] for kind in (*DETECTIONS, Tick)}


class ReplayError(ValueError):
    """This log, or this request, cannot be replayed; the text says why."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """What the command line asked for. `pad_ned_m` places a pad that stands still, for logs without one. `watch` is shown every
    message in and out."""

    settings: Mapping[str, Any] = field(default_factory=dict)
    config_files: Sequence[Path] = ()
    frames: Sequence[RecordedFrame] = ()
    pad_ned_m: Vec3 | None = None
    watch: Callable[[Message], None] | None = None

    def watched_by(self, watch: Callable[[Message], None]) -> ReplayOptions:
        return replace(self, watch=watch)

    @property
    def is_what_if(self) -> bool:
        return bool(self.settings or self.config_files or self.frames)


@dataclass(frozen=True, slots=True)
class Difference:
    """The first place where a replay left the log."""

    sequence: int
    message: str
    field: str
    expected: Any
    got: Any

    def __str__(self) -> str:
        return f"sequence {self.sequence}: {self.message}.{self.field}: expected {self.expected!r}, got {self.got!r}"


@dataclass(slots=True)
class ReplayResult:
    """`recorded` holds the figures of the outputs in the log where there are any; `figures` those of the replay."""

    mode: str
    figures: dict[str, float]
    recorded: dict[str, float] = field(default_factory=dict)
    phases: list[tuple[float, str, str]] = field(default_factory=list)
    difference: Difference | None = None
    differing: int = 0
    compared: int = 0
    damage: str = "none"
    log_s: float = 0.0
    wall_s: float = 0.0

    def as_json(self) -> dict[str, Any]:
        first = None if self.difference is None else {s: getattr(self.difference, s) for s in Difference.__slots__}
        return {
            "mode": self.mode,
            "log_s": round(self.log_s, 3),
            "wall_s": round(self.wall_s, 3),
            "real_time_factor": round(self.log_s / self.wall_s, 1) if self.wall_s > 0.0 else None,
            "damage": self.damage,
            "compared": self.compared,
            "differing": self.differing,
            "first_difference": first,
            "figures": self.figures,
            "recorded": self.recorded,
        }


def replay(path: Path, options: ReplayOptions) -> ReplayResult:
    """Replay one log; ReplayError or ConfigError where that cannot be done."""
    kind = path.suffix.lower()
    if kind not in _KINDS:
        raise ReplayError(f"{path}: not a .mcap, .tlog or .ulg")
    warm_up()  # machine code is loaded once for a program: that is no part of what a log costs
    started = time.perf_counter()
    gc.disable()  # nothing here makes cycles, and looking for them costs a tenth
    try:
        result = _KINDS[kind](path, options)
    except (OSError, McapLogError, LogInputsError) as error:
        raise ReplayError(f"{path}: {error}") from error
    finally:
        gc.enable()
    result.wall_s = time.perf_counter() - started
    return result


# ---------------------------------------------------------------------------------------------------------- our .mcap


def _replay_mcap(path: Path, options: ReplayOptions) -> ReplayResult:
    log = McapLog.read(path)
    if not log.is_ours:
        raise ReplayError("this MCAP file was not written by Companion: it holds none of its inputs")
    config = _logged_config(log, options)
    entries = list(log.entries())
    result = _what_if(entries, config, options) if options.is_what_if else _exact(entries, config, options.watch)
    result.damage = str(log.damage)
    if len(entries) > 1:
        result.log_s = (entries[-1].arrived_ns - entries[0].arrived_ns) / 1e9
    return result


def _logged_config(log: McapLog, options: ReplayOptions) -> Config:
    """The configuration that flew, with the changes asked for laid over it."""
    try:
        flown: dict[str, Any] = msgspec.json.decode(log.about.get("config", "{}"))
    except msgspec.DecodeError as error:
        raise ReplayError(f"the configuration in the log is damaged: {error}") from error
    if options.config_files:
        return load_with(options.config_files, options.settings)
    try:
        return load_with([], {**flown, **_nested(flown, options.settings)})
    except ConfigError as error:
        made_by = log.about.get("versions", "an unknown version")
        raise ConfigError(f"{error}\n(the log was made by {made_by}; -c FILE replaces its configuration)") from error


def _nested(flown: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Sections of `flown` that `settings` (dotted keys) touch, with the new values."""
    touched: dict[str, Any] = {}
    for key, value in settings.items():
        section, *path = key.split(".")
        table = touched.setdefault(section, msgspec.json.decode(msgspec.json.encode(flown.get(section, {}))))
        for name in path[:-1]:
            table = table.setdefault(name, {})
        if path:
            table[path[-1]] = value
        else:
            touched[section] = value
    return touched


def _exact(entries: Sequence[LoggedEntry], config: Config, watch: Callable[[Message], None] | None) -> ReplayResult:
    pipeline = Pipeline(config)
    figures = Figures(_start_of(entries), watch)
    has_outputs = any(entry.cause is not None for entry in entries)
    result = ReplayResult("exact" if has_outputs else "inputs only", {})
    for entry, recorded in _answered(entries):
        outputs = pipeline.handle(entry.message)  # type: ignore[arg-type]
        figures.add(entry.message)
        figures.add_all(outputs)
        if has_outputs:
            _compare(entry.sequence, outputs, recorded, result)
    result.figures, result.phases = figures.summary(), figures.phases
    return result


def _answered(entries: Sequence[LoggedEntry]) -> Iterator[tuple[LoggedEntry, list[LoggedEntry]]]:
    """Each input with the outputs that were recorded as its answer. What a shell reported (no cause) is left out."""
    current: LoggedEntry | None = None
    answers: list[LoggedEntry] = []
    for entry in entries:
        if entry.is_input:
            if current is not None:
                yield current, answers
            current, answers = entry, []
        elif current is not None and entry.cause == current.sequence:
            answers.append(entry)
    if current is not None:
        yield current, answers


def _compare(sequence: int, outputs: Sequence[Output], recorded: Sequence[LoggedEntry], result: ReplayResult) -> None:
    for index in range(max(len(outputs), len(recorded))):
        output = outputs[index] if index < len(outputs) else None
        entry = recorded[index] if index < len(recorded) else None
        result.compared += 1
        if entry is not None and output is not None and encode_entry(entry.sequence, entry.cause, output) == entry.data:
            continue
        difference = _first_difference(entry.sequence if entry is not None else sequence, entry, output)
        if difference is not None:
            result.differing += 1
            result.difference = result.difference or difference


def _first_difference(sequence: int, entry: LoggedEntry | None, output: Output | None) -> Difference | None:
    if entry is None or output is None or type(entry.message) is not type(output):
        expected = None if entry is None else type(entry.message).__name__
        got = None if output is None else type(output).__name__
        return Difference(sequence, expected or got or "", "(message)", expected, got)
    expected = msgspec.json.decode(entry.data)
    got = msgspec.json.decode(encode_entry(entry.sequence, entry.cause, output))
    for path, one, other in _leaves(expected, got, ""):
        return Difference(sequence, type(output).__name__, path, one, other)
    return None


def _leaves(expected: Any, got: Any, path: str) -> Iterator[tuple[str, Any, Any]]:
    """(path, expected, got) of every leaf that differs."""
    if isinstance(expected, dict) and isinstance(got, dict):
        for key in [*expected, *(key for key in got if key not in expected)]:
            yield from _leaves(expected.get(key), got.get(key), f"{path}.{key}" if path else str(key))
    elif isinstance(expected, list) and isinstance(got, list) and len(expected) == len(got):
        for index, (one, other) in enumerate(zip(expected, got, strict=True)):
            yield from _leaves(one, other, f"{path}[{index}]")
    elif expected != got:
        yield path, expected, got


def _what_if(entries: Sequence[LoggedEntry], config: Config, options: ReplayOptions) -> ReplayResult:
    start_ns = _start_of(entries)
    recorded, figures = Figures(start_ns), Figures(start_ns, options.watch)
    for entry in entries:
        recorded.add(entry.message)
    inputs = [(entry.arrived_ns, entry.message) for entry in entries if entry.is_input]
    if options.frames:
        inputs = [(at, message) for at, message in inputs if not isinstance(message, DETECTIONS)]
    run_through(inputs, config, figures, _shifted(options.frames, start_ns))  # type: ignore[arg-type]
    sent = [
        RecordedSetpoint(entry.message.t_ns, entry.message.velocity_ned_m_s)
        for entry in entries
        if isinstance(entry.message, VelocitySetpoint)
    ]
    summary = {**figures.summary(), **setpoint_differences(sent, figures.setpoints)}
    return ReplayResult("what-if", summary, recorded.summary(), figures.phases)


def _start_of(entries: Sequence[LoggedEntry]) -> int:
    return entries[0].arrived_ns if entries else 0


def _shifted(frames: Sequence[RecordedFrame], start_ns: int) -> list[tuple[int, RecordedFrame]]:
    return [(start_ns + round(frame.t_s * 1e9), frame) for frame in frames]


# ----------------------------------------------------------------------------------------------------- anybody's logs


def _replay_tlog(path: Path, options: ReplayOptions) -> ReplayResult:
    config = load_with(options.config_files, options.settings)
    return _state_in(tlog_inputs(path, config.link), config, options)


def _replay_ulog(path: Path, options: ReplayOptions) -> ReplayResult:
    return _state_in(ulog_inputs(path), load_with(options.config_files, options.settings), options)


def _state_in(log: LogInputs, config: Config, options: ReplayOptions) -> ReplayResult:
    inputs: list[tuple[int, Input]] = list(log.messages)
    start_ns = inputs[0][0] if inputs else 0
    figures = Figures(start_ns, options.watch)
    if inputs:
        period_ns = round(1e9 / config.control.rate_hz)
        blind = () if options.frames else _blind_camera(inputs, config)
        timed = merge(inputs, _ticks(inputs, period_ns), _still_pad(inputs, options.pad_ned_m), blind, key=_at)
        run_through(_with_starts(timed), config, figures, _shifted(options.frames, start_ns))
    summary = {**figures.summary(), **setpoint_differences(log.setpoints, figures.setpoints)}
    summary["setpoints_in_log"] = len(log.setpoints)
    damage = f"{log.skipped} bytes or frames skipped" if log.skipped else "none"
    result = ReplayResult("state in", summary, phases=figures.phases, damage=damage)
    result.log_s = (inputs[-1][0] - start_ns) / 1e9 if inputs else 0.0
    return result


def _at(timed: tuple[int, Any]) -> int:
    return timed[0]


def _ticks(inputs: Sequence[tuple[int, Input]], period_ns: int) -> Iterator[tuple[int, Input]]:
    """The control clock over the log, but not through long silences."""
    due_ns = inputs[0][0] + period_ns
    for (before_ns, _), (after_ns, _) in pairwise(inputs):
        if after_ns - before_ns > LONGEST_TICKED_NS:
            due_ns = after_ns
        while due_ns <= after_ns:
            yield due_ns, Tick(due_ns)
            due_ns += period_ns


def _still_pad(inputs: Sequence[tuple[int, Input]], position: Vec3 | None) -> Iterator[tuple[int, Input]]:
    if position is None:
        return
    for t_ns in range(inputs[0][0], inputs[-1][0], PAD_PERIOD_NS):
        yield t_ns, PadBeacon(t_ns, "replay", position, (0.0, 0.0, 0.0), None, PAD_SIGMA_M)


def _blind_camera(inputs: Sequence[tuple[int, Input]], config: Config) -> Iterator[tuple[int, Input]]:
    """A log without frames is replayed as one with a camera that sees nothing: without any frame no START is obeyed."""
    for t_ns in range(inputs[0][0], inputs[-1][0], BLIND_PERIOD_NS):
        yield t_ns, PadNotSeen(t_ns, config.vision.camera, "replay", "no frames in this log")


def _with_starts(timed: Iterable[tuple[int, Input]]) -> Iterator[tuple[int, Input]]:
    """Nobody says START in a foreign log: it is said whenever somebody begins to fly the vehicle in OFFBOARD."""
    was_flying = False
    for at_ns, message in timed:
        yield at_ns, message
        if isinstance(message, VehicleStatus):
            in_air = message.armed and message.landed_state is not LandedState.ON_GROUND
            is_flying = in_air and message.mode is AutopilotMode.OFFBOARD
            if is_flying and not was_flying:
                yield at_ns, OperatorCommand(at_ns, OperatorAction.START, "replay")
            was_flying = is_flying


_KINDS = {".mcap": _replay_mcap, ".tlog": _replay_tlog, ".ulg": _replay_ulog}


# ------------------------------------------------------------------------------------------------------------ the run


def run_through(
    inputs: Iterable[tuple[int, Input]],
    config: Config,
    figures: Figures,
    frames: Sequence[tuple[int, RecordedFrame]] = (),
) -> None:
    """Inputs, and frames at their time of capture plus the camera's delay, through a new pipeline."""
    pipeline = Pipeline(config)
    camera = config.cameras[config.vision.camera]
    detector = DETECTORS[config.vision.detector](config.vision, config.pad, from_config(camera)) if frames else None
    delay_ns = round(camera.delay_s * 1e9)
    waiting = sorted(frames, key=_at, reverse=True)
    for at_ns, message in inputs:
        while detector is not None and waiting and waiting[-1][0] + delay_ns <= at_ns:
            t_ns, frame = waiting.pop()
            figures.handle(pipeline, _seen(detector, pipeline, config.vision.camera, t_ns, frame))
        figures.handle(pipeline, message)


def _seen(detector: Detector, pipeline: Pipeline, camera: str, t_ns: int, frame: RecordedFrame) -> Input:
    image = frame.read()
    if image is None:
        return PadNotSeen(t_ns, camera, "replay", "the frame is not readable")
    return detector.detect(CameraImage(t_ns, camera, image, frame.sequence), pipeline.hint(camera, t_ns))


# ------------------------------------------------------------------------------------------------------------ figures


class Figures:
    """Sums over messages, inputs and outputs alike: what a what-if and a golden file look at."""

    def __init__(self, start_ns: int, watch: Callable[[Message], None] | None = None) -> None:
        self._start_ns = start_ns
        self._watch = watch
        self._counts: Counter[str] = Counter()
        self._nis: dict[str, list[float]] = {}
        self._sigma_m: list[float] = []
        self._pad_m: list[Vec3] = []
        self.setpoints: list[tuple[int, Vec3]] = []
        self.phases: list[tuple[float, str, str]] = []

    def handle(self, pipeline: Pipeline, message: Input) -> None:
        self.add(message)
        self.add_all(pipeline.handle(message))

    def add_all(self, messages: Iterable[Message]) -> None:
        for message in messages:
            self.add(message)

    def add(self, message: Message) -> None:
        if self._watch is not None:
            self._watch(message)
        match message:
            case VehicleState():
                self._counts["vehicle_states"] += 1
            case VelocitySetpoint():
                self.setpoints.append((message.t_ns, message.velocity_ned_m_s))
            case PadEstimate():
                self._sigma_m.append(message.position_sigma_m)
                self._pad_m.append(message.position_ned_m)
            case MeasurementVerdict():
                self._counts[f"{message.source}_{'accepted' if message.accepted else 'rejected'}"] += 1
                if message.accepted and message.nis is not None:
                    self._nis.setdefault(str(message.source), []).append(message.nis)
            case PlanMade():
                self._counts["plans_found" if message.found else "plans_not_found"] += 1
            case PhaseChanged():
                at_s = (message.t_ns - self._start_ns) / 1e9
                self.phases.append((at_s, str(message.after), message.reason))
            case VehicleCommand():
                self._counts[f"asked_{message.kind}"] += 1
            case PadObservation() | PadBearing() | PadNotSeen() | Tick():
                self._counts[_COUNTED[type(message)]] += 1
            case _:
                pass

    def summary(self) -> dict[str, float]:
        """Counts as integers, the rest rounded to 1e-6."""
        found: dict[str, float] = dict(sorted(self._counts.items()))
        found |= {f"{source}_nis_mean": _mean(values) for source, values in sorted(self._nis.items())}
        found["pad_estimates"] = len(self._pad_m)
        if self._pad_m:
            found["pad_sigma_mean_m"] = _mean(self._sigma_m)
            found |= _means("pad", "m", self._pad_m)
        found["setpoints"] = len(self.setpoints)
        if self.setpoints:
            velocities = [velocity for _, velocity in self.setpoints]
            found |= _means("setpoint", "m_s", velocities)
            found["setpoint_speed_mean_m_s"] = _mean([math.hypot(*velocity) for velocity in velocities])
        found |= {f"phase_{i}_{phase}_s": round(t_s, 6) for i, (t_s, phase, _) in enumerate(self.phases, 1)}
        found["ended_idle"] = int(not self.phases or self.phases[-1][1] in (Phase.IDLE, Phase.HOLD, Phase.RETURN))
        return found


def _mean(values: Sequence[float]) -> float:
    return round(math.fsum(values) / len(values), 6)


def _means(name: str, unit: str, vectors: Sequence[Vec3]) -> dict[str, float]:
    return {f"{name}_{axis}_mean_{unit}": _mean([v[i] for v in vectors]) for i, axis in enumerate(("n", "e", "d"))}


def setpoint_differences(sent: Sequence[RecordedSetpoint], ours: Sequence[tuple[int, Vec3]]) -> dict[str, float]:
    """How far our setpoints are from those in the log that were sent within 50 ms of them."""
    distances: list[float] = []
    index = 0
    for setpoint in sent:
        while index + 1 < len(ours) and abs(ours[index + 1][0] - setpoint.t_ns) <= abs(ours[index][0] - setpoint.t_ns):
            index += 1
        if ours and abs(ours[index][0] - setpoint.t_ns) <= PAIR_WITHIN_NS:
            distances.append(math.dist(ours[index][1], setpoint.velocity_ned_m_s))
    if not distances:
        return {"setpoints_paired": 0}
    return {
        "setpoints_paired": len(distances),
        "setpoint_difference_rms_m_s": round(math.sqrt(math.fsum(d * d for d in distances) / len(distances)), 6),
        "setpoint_difference_max_m_s": round(max(distances), 6),
    }
