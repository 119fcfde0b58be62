"""`companion reproduce --versus`: each paper's scenes by its preset and by the default pipeline, with the same seeds.

A row is a median over the seeds that landed; the first row says how many did. The default wins where it is better, ties where
it is equal within the stated tolerance, and a row where it does neither says so.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from companion.campaign.campaign_file import Sample
from companion.campaign.engine import Row as FlightRow
from companion.reproduce.flights import flight, flown
from companion.reproduce.row import Reproduction, Row, Verdict
from companion.reproduce.scenes import SCENES, Scene


@dataclass(frozen=True, slots=True)
class Measure:
    """One line of a scene's table. `good`: +1 more is better, -1 less is; a tie is within `tie` (`relative`: of the preset's)."""

    name: str
    key: str
    unit: str
    good: int
    tie: float
    relative: bool = False


MEASURES = (
    Measure("touchdown error, median", "touchdown_error_m", "m", -1, 0.02),
    Measure("start to touchdown, median", "time_to_touchdown_s", "s", -1, 0.05, relative=True),
    Measure("jerk of the vehicle, rms, median", "jerk_rms_m_s3", "m/s3", -1, 0.05, relative=True),
    Measure("energy, median", "energy_j", "J", -1, 0.05, relative=True),
)

NOTES = (
    "Simulated flights. Per scene and seed one by each side; the same world but for what the default pipeline looks"
    " at: its own nested marker (configs/pads), through the paper's camera where that looks down (`falanga`, `kim`), else"
    " through its own. Its configuration is the default one, with nothing set for any paper but that lens.",
    "Success: stands on the deck at the end, motors off, whether the pad still moves or not. The other figures are "
    "medians over the landings. Jerk: root mean square from start to touchdown of the true motion, by second "
    "differences of the velocity at 20 Hz. It rewards slowness: a preset that takes three times as long has less of"
    " it.",
    "Energy from start to touchdown by the power model of `guo`, P = 1/2 C_D A rho v^3 + sqrt((m g)^3 / (2 pi r^2 "
    "rho)), with the airframe's mass and drag, speed over ground, and propellers of 10 inches.",
)


def fly_versus(keys: Sequence[str], *, seeds: int, done: Callable[[int, int], None]) -> Reproduction:
    """The papers of `keys` that have scenes and a preset."""
    scenes = [(key, scene) for key in keys for scene in SCENES.get(key, ())]
    samples = [sample for i, (key, scene) in enumerate(scenes) for sample in _samples(i, key, scene, seeds)]
    rows = flown(samples, done)
    found: list[Row] = []
    for i, (key, scene) in enumerate(scenes):
        sides = [[row for row in rows if row["sample"] // 10_000 == 2 * i + side] for side in (0, 1)]
        found += scene_rows(f"{key}: {scene.name}", sides[0], sides[1])
    name = f"versus-{keys[0]}" if len(keys) == 1 else "versus"
    flown_with = "Seed 1" if seeds == 1 else f"Seeds 1 to {seeds}"
    notes = (*NOTES, f"{flown_with}: {len(samples)} flights.", balance(found))
    title = f"{keys[0]}: the paper's preset" if len(keys) == 1 else "The papers' presets"
    return Reproduction(name, f"{title} against the default pipeline", tuple(found), (), (), notes)


def balance(rows: Sequence[Row]) -> str:
    """One sentence: what the default wins, ties and loses, and which rows it loses."""
    verdicts = Counter(row.verdict for row in rows)
    lost = Counter(row.name for row in rows if row.verdict == "differs")
    said = f"In {len(rows)} rows the default wins {verdicts['better']}, ties {verdicts['same']} and loses {verdicts['differs']}"
    return said + (": " + "; ".join(f"{name} ({count})" for name, count in lost.items()) if lost else "") + "."


def _samples(index: int, key: str, scene: Scene, seeds: int) -> list[Sample]:
    first, second = 2 * index * 10_000, (2 * index + 1) * 10_000
    world = {**scene.world, **scene.default_world}
    return [
        sample
        for seed in range(1, seeds + 1)
        for sample in (
            flight(first + seed, scene.scenario, preset=key, seed=seed, world=scene.world, app=scene.preset_app),
            flight(
                second + seed,
                scene.scenario,
                preset=None,
                seed=seed,
                world=world,
                files=scene.default_files,
                app=scene.default_app,
            ),
        )
    ]


def scene_rows(table: str, preset: Sequence[FlightRow], default: Sequence[FlightRow]) -> list[Row]:
    """The table of one scene."""
    landed = [sum(row["outcome"] == "landed" for row in side) for side in (preset, default)]
    said = [f"{count} of {len(side)}" for count, side in zip(landed, (preset, default), strict=True)]
    rows = [Row(table, "landed", said[0], said[1], "", "0", judged(1, 0.0, float(landed[0]), float(landed[1])))]
    for measure in MEASURES:
        rows.append(_row(table, measure, _median(preset, measure.key), _median(default, measure.key)))
    return rows


def _median(rows: Sequence[FlightRow], key: str) -> float | None:
    values = [row[key] for row in rows if row["outcome"] == "landed" and row[key] is not None]
    return statistics.median(values) if values else None


def _row(table: str, measure: Measure, preset: float | None, default: float | None) -> Row:
    tie = measure.tie * abs(preset or 0.0) if measure.relative else measure.tie
    told = f"{measure.tie:.0%}" if measure.relative else f"{measure.tie:g} {measure.unit}".rstrip()
    ours: float | str = "no landing" if default is None else default
    theirs: float | str = "no landing" if preset is None else preset
    return Row(table, measure.name, theirs, ours, measure.unit, told, judged(measure.good, tie, preset, default))


def judged(good: int, tie: float, preset: float | None, default: float | None) -> Verdict:
    """`better`: the default wins. Who never landed has no figure and loses to who has."""
    if preset is None or default is None:
        return "same" if preset is default else "better" if preset is None else "differs"
    if abs(default - preset) <= tie:
        return "same"
    return "better" if (default - preset) * good > 0 else "differs"
