"""How closely the simulator's vehicle answers setpoints as the recorded PX4 did.

    python benchmarks/px4_fidelity.py DIR [--json] [--plots DIR] [--airframe NAME] [--own-horizontal | --recorded-error]

Each file of DIR (format of px4_recording.py or px4_landing.py) is replayed without noise and compared with PX4's *estimated* response along
the direction that was commanded: velocity, or position, or heading (rate). `nrmse` is the RMS difference as a fraction of the
step. PX4 steers by its estimate, whose error against truth is in the recording: `floor` is that error's RMS, as the same
fraction, and `allowed` = sqrt(0.06^2 + floor^2). For steps of 3 m/s and more also t63, t90 (within 15 % or 0.05 s), peak tilt
(3 degrees) and first reaction (20 ms). A rise time on which the recorded estimate and the recorded truth disagree by more
than that tolerance is not fixed by the recording (a slow creep through the threshold); it is shown in brackets. A folder with "lowdrag" in its name flies the airframe sih_quadx_lowdrag.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import hypot, isfinite, sqrt
from pathlib import Path

import numpy as np
from px4_landing import (
    Flight,
    FlightReplay,
    Given,
    first_time,
    is_flight_recording,
    order_of,
    read_flight,
    start_and_ground_z_m,
    touchdown_s,
)
from px4_recording import Array, Command, Recording, is_step_recording, read_recording
from px4_replay import Replay, Response
from response_plot import write_plot

from sitl_stub.airframe import Airframe, read_airframe

TOLERANCE = 0.06
RISE_RELATIVE, RISE_S = 0.15, 0.05
TILT_DEG, REACTION_S = 3.0, 0.02
RISE_FROM_M_S = 3.0
_AIRFRAMES = Path(__file__).parent.parent / "configs" / "airframes"
_REACTION_LEAN = 0.03


@dataclass(frozen=True, slots=True)
class Pair:
    """A number of the recording and the same of the simulator; None where it never happens."""

    recorded: float | None
    stub: float | None
    is_fixed: bool = True
    """False when recorded truth and estimate disagree about it by more than the tolerance."""
    end_s: float = 0.0
    """A time that is None did not come before this one, when the command ended."""

    @property
    def difference(self) -> float | None:
        return None if self.recorded is None or self.stub is None else self.stub - self.recorded


@dataclass(frozen=True, slots=True)
class Row:
    """One file's result. `nrmse_all_axes` and `floor_all_axes` count the other axes' errors too."""

    name: str
    quantity: str
    step: float
    nrmse: float
    floor: float
    allowed: float
    nrmse_all_axes: float
    floor_all_axes: float
    rise: dict[str, Pair]
    passed: bool
    failures: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Recorded and simulated response at the same times, shape (n, axes), with the true one where there is one."""

    quantity: str
    t_s: Array
    recorded: Array
    stub: Array
    error: Array
    """Recorded estimate minus truth; zeros where truth was not recorded."""
    direction: Array
    step: float

    def along(self, values: Array) -> Array:
        return values @ self.direction


def _asked(command: Command) -> tuple[str, tuple[float, ...]]:
    if isfinite(command.position_m[0]):
        return "position", command.position_m
    return "velocity", command.velocity_m_s


def compare(recording: Recording, response: Response) -> Comparison:
    """Choose the quantity that was commanded and line both responses up."""
    before, after = recording.commands[0], recording.commands[1]
    rows = slice(recording.start + 1, None)
    t_s = recording.t_s[rows]
    stub = response.at(t_s)
    quantity, _ = _asked(after)
    if _turns(before, after):
        return _compare_heading(recording, stub, rows, before, after)
    names = ("x", "y", "z") if quantity == "position" else ("vx", "vy", "vz")
    path = np.array([_asked(command)[1] for command in recording.commands[1:]])
    step, direction = _step_of(path, np.array(_asked(before)[1]), recording, quantity)
    recorded = recording.vector(*names)[rows]
    return Comparison(
        quantity,
        t_s,
        recorded,
        np.stack([stub[name] for name in names], axis=1),
        _estimate_error(recording, rows, quantity),
        direction,
        step,
    )


def _turns(before: Command, after: Command) -> bool:
    """Only the heading changes."""
    return _asked(after)[1] == _asked(before)[1]


def _step_of(path: Array, before: Array, recording: Recording, quantity: str) -> tuple[float, Array]:
    """Size of the step and its direction; a path that turns has the sum of both horizontal axes as "direction"."""
    moves = path - before
    if quantity == "velocity" and recording.commands[1].is_body_frame:
        moves = _turned(moves, float(recording.columns["yaw"][recording.start]))
    if quantity == "velocity":
        moves = _limited(moves)
    largest = moves[int(np.argmax(np.linalg.norm(moves, axis=1)))]
    step = float(np.linalg.norm(largest))
    if np.linalg.matrix_rank(moves, tol=0.05 * step) > 1:
        return float(np.linalg.norm(path - path.mean(axis=0), axis=1).max()), np.eye(3)[:, :2]
    return step, (largest / step)[:, None]


def _limited(moves: Array) -> Array:
    """PX4 clips the velocity it is asked for; the step is what is left."""
    horizontal = np.linalg.norm(moves[:, :2], axis=1, keepdims=True)
    clipped = moves.copy()
    clipped[:, :2] *= np.minimum(1.0, 12.0 / np.maximum(horizontal, 1e-9))
    clipped[:, 2] = np.clip(clipped[:, 2], -3.0, 1.5)
    return clipped


def _turned(moves: Array, yaw_rad: float) -> Array:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return moves @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _estimate_error(recording: Recording, rows: slice, quantity: str) -> Array:
    """Estimate minus truth. True position is not recorded: the true velocity is integrated from where the estimate was."""
    error = recording.vector("vx", "vy", "vz") - recording.vector("true_vx", "true_vy", "true_vz")
    error = np.nan_to_num(error)
    if quantity == "velocity":
        return error[rows]
    true = np.nan_to_num(recording.vector("true_vx", "true_vy", "true_vz"))[rows]
    t_s, position = recording.t_s[rows], recording.vector("x", "y", "z")[rows]
    travelled = np.zeros_like(true)
    travelled[1:] = np.cumsum(0.5 * (true[1:] + true[:-1]) * np.diff(t_s)[:, None], axis=0)
    return position - position[0] - travelled


def _compare_heading(
    recording: Recording, stub: dict[str, Array], rows: slice, before: Command, after: Command
) -> Comparison:
    is_rate = after.yaw_rate_rad_s != before.yaw_rate_rad_s and isfinite(after.yaw_rate_rad_s)
    name = "r" if is_rate else "yaw"
    recorded = np.unwrap(recording.columns["yaw"]) if not is_rate else recording.columns["r"]
    step = abs(after.yaw_rate_rad_s - before.yaw_rate_rad_s) if is_rate else abs(after.yaw_rad - before.yaw_rad)
    column = recorded[rows][:, None]
    return Comparison(
        "yaw rate" if is_rate else "yaw",
        recording.t_s[rows],
        column,
        stub[name][:, None],
        np.zeros_like(column),
        np.ones((1, 1)),
        min(step, np.deg2rad(200.0)) if is_rate else step,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(values * values, axis=1))))


def _first(t_s: Array, condition: Array) -> float | None:
    found = np.flatnonzero(condition)
    return float(t_s[found[0]]) if len(found) else None


def _agree(reference: float | None, other: float | None, end_s: float) -> bool:
    """Two rise times within 15 % or 0.05 s; one that did not come before the command ended counts as its end."""
    reference, other = (end_s if t is None else t for t in (reference, other))
    return abs(other - reference) <= max(RISE_RELATIVE * reference, RISE_S)


def _rise(recording: Recording, response: Response, c: Comparison) -> dict[str, Pair]:
    """Times to 63 and 90 % of the commanded step, peak tilt, first tilt; until the command changes again."""
    end = recording.commands[2].t_s if len(recording.commands) > 2 else float(c.t_s[-1])
    keep = c.t_s < end
    t_s = c.t_s[keep]
    recorded, stub, true = (c.along(v)[keep, 0] for v in (c.recorded, c.stub, c.recorded - c.error))
    pairs = {}
    for percent in (63, 90):
        level = percent / 100 * c.step
        times = [_first(t_s, values >= level) for values in (recorded, stub, true)]
        pairs[f"t{percent}_s"] = Pair(times[0], times[1], _agree(times[0], times[2], end), end)
    lean = _lean(recording.columns, slice(recording.start + 1, None))
    stub_lean = _lean(response.at(c.t_s), slice(None))
    peaks = [float(np.rad2deg(np.arcsin(np.linalg.norm(values, axis=1).max()))) for values in (lean, stub_lean)]
    pairs["peak_tilt_deg"] = Pair(*peaks)
    if hypot(c.direction[0, 0], c.direction[1, 0]) > 0.5:
        pairs["reaction_s"] = Pair(*(_reaction(t_s, values[keep] @ c.direction[:2, 0]) for values in (lean, stub_lean)))
    return pairs


def _lean(columns: dict[str, Array], rows: slice) -> Array:
    """Horizontal part of the unit vector along the thrust, north and east."""
    roll, pitch, yaw = (columns[name][rows] for name in ("roll", "pitch", "yaw"))
    north = -np.cos(roll) * np.sin(pitch) * np.cos(yaw) - np.sin(roll) * np.sin(yaw)
    east = -np.cos(roll) * np.sin(pitch) * np.sin(yaw) + np.sin(roll) * np.cos(yaw)
    return np.stack([north, east], axis=1)


def _reaction(t_s: Array, lean: Array) -> float | None:
    """When the vehicle has begun to lean the way it was asked."""
    return _first(t_s, lean - lean[0] > _REACTION_LEAN)


def _judge(nrmse: float, allowed: float, rise: dict[str, Pair]) -> tuple[str, ...]:
    failures = [] if nrmse <= allowed else ["nrmse"]
    for name, pair in rise.items():
        if name.startswith("t"):
            good = not pair.is_fixed or _agree(pair.recorded, pair.stub, pair.end_s)
        else:
            limit = TILT_DEG if name == "peak_tilt_deg" else REACTION_S
            good = pair.difference is not None and abs(pair.difference) <= limit
        if not good:
            failures.append(name)
    return tuple(failures)


def score(recording: Recording, airframe: Airframe) -> tuple[Row, Comparison]:
    """Replay one recording and judge it."""
    response = Replay(recording, airframe).run()
    c = compare(recording, response)
    difference = c.stub - c.recorded
    nrmse, floor = _rms(c.along(difference)) / c.step, _rms(c.along(c.error)) / c.step
    allowed = sqrt(TOLERANCE**2 + floor**2)
    is_step = c.quantity == "velocity" and len(recording.commands) <= 3 and c.step >= RISE_FROM_M_S
    rise = _rise(recording, response, c) if is_step else {}
    failures = _judge(nrmse, allowed, rise)
    return Row(
        recording.name,
        c.quantity,
        c.step,
        nrmse,
        floor,
        allowed,
        _rms(difference) / c.step,
        _rms(c.error) / c.step,
        rise,
        not failures,
        failures,
    ), c


def score_flight(
    name: str, recorded: Flight, airframe: Airframe, given: Given = Given.HORIZONTAL
) -> tuple[Row, Comparison]:
    """Fly one take-off or landing again and judge its vertical speed (or height) until touchdown."""
    order = order_of(name)
    replay = FlightReplay(order, airframe, *start_and_ground_z_m(order, recorded, given), recorded, given)
    stub = replay.run(float(recorded.t_s[-1]))
    down_s, stub_down_s = touchdown_s(recorded), touchdown_s(stub)
    ends = [float(recorded.t_s[-1])]
    if not order.starts_on_ground:
        ends += [t for t in (down_s, stub_down_s) if t is not None]
    end_s = min(ends)
    keep = (recorded.t_s > 0.0) & (recorded.t_s <= end_s) & ~np.isnan(recorded.vz_m_s)
    t_s = recorded.t_s[keep]
    is_height = order.what == "offboard_pos"
    columns = [(f.z_m if is_height else f.vz_m_s) for f in (recorded, stub)]
    if is_height:
        # PX4's height is not zero on the ground; only the way is compared.
        columns = [values - np.interp(0.0, f.t_s, values) for values, f in zip(columns, (recorded, stub), strict=True)]
    measured, simulated = columns[0][keep][:, None], np.interp(t_s, stub.t_s, columns[1])[:, None]
    step = abs(order.value) if abs(order.value) > 0.0 else max(float(np.abs(stub.vz_m_s).max()), 1.0)
    error = _flight_error(recorded, keep, is_height)
    c = Comparison("height" if is_height else "vertical speed", t_s, measured, simulated, error, np.ones((1, 1)), step)
    nrmse, floor = _rms(c.stub - c.recorded) / step, _rms(error) / step
    allowed = sqrt(TOLERANCE**2 + floor**2)
    times = _landing_times(recorded, stub, down_s, stub_down_s)
    failures = () if nrmse <= allowed else ("nrmse",)
    return Row(name, c.quantity, step, nrmse, floor, allowed, nrmse, floor, times, not failures, failures), c


def _flight_error(recorded: Flight, keep: Array, is_height: bool) -> Array:
    """Recorded estimate minus truth; the truth comes at 10 Hz and is interpolated."""
    true = recorded.height_m if is_height else recorded.true_vz_m_s
    known = ~np.isnan(true)
    t_s = recorded.t_s[keep]
    if not known.any():
        return np.zeros((len(t_s), 1))
    reference = np.interp(t_s, recorded.t_s[known], true[known])
    if is_height:
        estimate = recorded.z_m[keep] - recorded.z_m[keep][0]
        return (estimate + reference - reference[0])[:, None]
    return (recorded.vz_m_s[keep] - reference)[:, None]


def _landing_times(recorded: Flight, stub: Flight, down_s: float | None, stub_down_s: float | None) -> dict[str, Pair]:
    """Touchdown, ON_GROUND after touchdown, disarming after that; only shown, the conformance tests judge them."""
    if down_s is None or stub_down_s is None:
        return {}
    landed = [first_time(f.t_s, f.landed, 1.0) for f in (recorded, stub)]
    disarmed = [first_time(f.t_s, f.armed, 0.0) for f in (recorded, stub)]
    if None in landed or None in disarmed:
        return {"touchdown_s": Pair(down_s, stub_down_s)}
    return {
        "touchdown_s": Pair(down_s, stub_down_s),
        "on_ground_after_s": Pair(landed[0] - down_s, landed[1] - stub_down_s),
        "disarmed_after_s": Pair(disarmed[0] - landed[0], disarmed[1] - landed[1]),
    }


def airframe_for(folder: Path, name: str | None = None) -> Airframe:
    """The recorded vehicle; low drag by the folder's name."""
    name = name or ("sih_quadx_lowdrag" if "lowdrag" in folder.name else "sih_quadx")
    return read_airframe(_AIRFRAMES / f"{name}.toml")


def score_folder(
    folder: Path,
    airframe: str | None = None,
    on_compared: Callable[[Row, Comparison], None] | None = None,
    given: Given = Given.HORIZONTAL,
) -> list[Row]:
    """Rows for all files of a folder that have this format, by name."""
    rows = []
    for path in sorted(folder.glob("*.csv")):
        vehicle = airframe_for(folder, airframe)
        if is_step_recording(path):
            row, comparison = score(read_recording(path), vehicle)
        elif is_flight_recording(path):
            row, comparison = score_flight(path.stem, read_flight(path), vehicle, given)
        else:
            continue
        rows.append(row)
        if on_compared:
            on_compared(row, comparison)
    return rows


def _number(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _shown(pair: Pair) -> str:
    text = f"{_number(pair.recorded)} | {_number(pair.stub)} | {_number(pair.difference)}"
    return text if pair.is_fixed else f"({text})"


def _table(rows: list[Row]) -> str:
    lines = [
        f"{'file':24} {'quantity':9} {'step':>6} {'nrmse':>6} {'floor':>6} {'allowed':>7}  recorded | stub | difference"
    ]
    for row in rows:
        rise = "  ".join(f"{name} {_shown(p)}" for name, p in row.rise.items())
        verdict = "ok" if row.passed else "FAILED " + ", ".join(row.failures)
        lines.append(
            f"{row.name:24} {row.quantity:9} {row.step:6.2f} {row.nrmse:6.3f} {row.floor:6.3f} {row.allowed:7.3f}  {rise}  {verdict}"
        )
    lines.append(f"{sum(row.passed for row in rows)} of {len(rows)} files within their limits")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Exit code 1 when a file is out of its limits."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true", help="rows as JSON")
    parser.add_argument("--plots", type=Path, help="write an overlay of each file as SVG into this folder")
    inputs = parser.add_mutually_exclusive_group()
    inputs.add_argument(
        "--own-horizontal",
        action="store_const",
        dest="given",
        const=Given.NOTHING,
        default=Given.HORIZONTAL,
        help="automatic modes without the recorded horizontal estimate",
    )
    inputs.add_argument(
        "--recorded-error",
        action="store_const",
        dest="given",
        const=Given.ERROR,
        help="take-offs and landings with the recorded vertical error of the estimate as input",
    )
    parser.add_argument("--airframe", help="a file of configs/airframes; default by the folder's name")
    options = parser.parse_args(arguments)

    def plot(row: Row, c: Comparison) -> None:
        if options.plots:
            options.plots.mkdir(parents=True, exist_ok=True)
            title = f"{row.name}: {row.quantity}, difference {row.nrmse:.3f} of the step, allowed {row.allowed:.3f}"
            write_plot(options.plots / f"{row.name}.svg", title, c.t_s, c.along(c.recorded), c.along(c.stub))

    rows = score_folder(options.folder, options.airframe, plot, options.given)
    print(json.dumps([asdict(row) for row in rows], indent=1) if options.json else _table(rows))
    return 0 if rows and all(row.passed for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
