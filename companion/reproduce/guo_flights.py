"""The flights of `guo`: event trigger on and off, yaw error, Hold while the marker is hidden, cart, boat, approach in wind.

All by the preset in the simulator. Landing time is from the beginning of the landing (behind the pad, marker in view) to the
first contact. Times in s, angles in degrees where a row says so. Called by guo.py.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.control.yaw import BOX_AHEAD_M, BOX_BEHIND_M, BOX_HALF_ACROSS_M, BOX_HEIGHT_M
from companion.messages import Phase
from companion.reproduce.flight_rows import error_row, landed_row, phase_bands
from companion.reproduce.row import Row, number_row, said_row
from companion.reproduce.watched_flight import Instant, WatchedFlight, preset, watched
from companion.telemetry.svg_plot import Chart, Line

STILL: dict[str, Any] = {"carrier": {"kind": "still"}, "path": {"kind": "still"}}
NEAR = {"mission.follow_behind_m": 2.25}
"""Cart, boat and the comparisons begin 3 m from the marker, as in the paper."""
FLYING = (Phase.DESCEND, Phase.COMMIT)
ALIGNED_DEG = 3.0
TURNED_DEG = 15.0
HIDDEN_FROM_S, HIDDEN_S = 7.0, 3.0
COVERED = {"kind": "camera_blackout", "start_s": HIDDEN_FROM_S, "duration_s": HIDDEN_S}
"""The paper holds a hand before the lens; the simulator's sheet covers markers on the deck only."""


@dataclass(frozen=True, slots=True)
class YawTurn:
    """The yaw error at the first instant in the box (rad) and how long it took to be gone for good, s."""

    first_rad: float
    gone_after_s: float | None


def near_deck(seed: int, *, yaw: str = "guo", turned_deg: float = 0.0, faults: Sequence[Any] = ()) -> WatchedFlight:
    """The still deck from 3 m, the vehicle turned away from its heading."""
    world = {**STILL, "vehicle.start_yaw_deg": 60.0 + turned_deg, "faults": list(faults)}
    return watched(preset("guo", {**NEAR, "control.yaw": yaw}), "guo_cart", seed=seed, world=world)


def landing_s(flight: WatchedFlight, first: Phase = Phase.FOLLOW) -> float | None:
    """From where the landing begins to the first contact; None where there was none. FOLLOW: from where the marker is seen,
    the way to the place behind the pad included; DESCEND: from that place."""
    begin, touched = flight.watch.entered_s(first), flight.result.touchdown_s
    return None if begin is None or touched is None or not flight.landed else touched - begin


def yaw_error_rad(instant: Instant) -> float:
    return math.remainder(instant.yaw_rad - instant.pad_yaw_rad, math.tau)


def is_in_box(instant: Instant) -> bool:
    """Truth, in the pad's frame: the box of control/yaw.py."""
    ahead, right, down = instant.in_pad_m
    return -BOX_BEHIND_M <= ahead <= BOX_AHEAD_M and abs(right) <= BOX_HALF_ACROSS_M and 0.0 <= -down <= BOX_HEIGHT_M


def yaw_turn(instants: Sequence[Instant]) -> YawTurn | None:
    """None where the vehicle never came into the box."""
    first = next((k for k, instant in enumerate(instants) if is_in_box(instant)), None)
    if first is None:
        return None
    late = [i.t_s for i in instants[first:] if abs(yaw_error_rad(i)) > math.radians(ALIGNED_DEG) and i.phase in FLYING]
    inside = instants[first]
    return YawTurn(yaw_error_rad(inside), max(late) - inside.t_s if late else 0.0)


def flight_rows(quick: bool) -> tuple[list[Row], list[Chart]]:
    """Quick: one turned landing. Full: everything."""
    turned = [near_deck(seed, turned_deg=TURNED_DEG) for seed in ((1,) if quick else (1, 2))]
    rows = _turn_rows(turned)
    charts = [_yaw_chart("Yaw error, turned by 15 degrees at the start", turned[0]), _offset_chart(turned[0])]
    if quick:
        return rows, charts
    rows += _trigger_rows(turned, [near_deck(seed, yaw="pad", turned_deg=TURNED_DEG) for seed in (1, 2)])
    hidden = near_deck(1, faults=[COVERED])
    rows += _hold_rows(hidden)
    charts.append(_offset_chart(hidden, "Marker hidden for 3 s"))
    for builder in (_cart, _boat, _wind):
        more, chart = builder()
        rows += more
        charts.append(chart)
    return rows, charts


def _median(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else math.nan


def _landed(flights: Sequence[WatchedFlight]) -> str:
    return f"{sum(flight.landed for flight in flights)} of {len(flights)}"


def _turn_rows(flights: Sequence[WatchedFlight]) -> list[Row]:
    table = f"Yaw error of 15 degrees (n = {len(flights)}, medians)"
    turns = [turn for flight in flights if (turn := yaw_turn(flight.watch.instants)) is not None]
    first = _median([math.degrees(abs(turn.first_rad)) for turn in turns])
    gone = _median([turn.gone_after_s for turn in turns])
    return [
        said_row(table, "landed", "yes", _landed(flights), holds=all(flight.landed for flight in flights)),
        number_row(table, "error when the box is entered", 15.0, round(first, 1), "deg", 5.0),
        number_row(table, "gone (below 3 deg) after", 3.0, round(gone, 2), "s", 0.5, good=-1),
    ]


def _trigger_rows(on: Sequence[WatchedFlight], off: Sequence[WatchedFlight]) -> list[Row]:
    table = f"Event trigger (n = {len(on)} each, medians)"
    with_s, without_s = _median([landing_s(flight) for flight in on]), _median([landing_s(flight) for flight in off])
    return [
        number_row(table, "landing with it", 18.0, round(with_s, 1), "s", 2.0, good=-1),
        number_row(table, "landing without it", 30.0, round(without_s, 1), "s", 2.0, good=-1),
        number_row(table, "with over without", 0.6, round(with_s / without_s, 2), "", 0.05, good=-1),
        said_row(
            table, "landed with, without", "all", f"{_landed(on)}, {_landed(off)}", holds=all(f.landed for f in on)
        ),
    ]


def _hold_rows(flight: WatchedFlight) -> list[Row]:
    table = "Marker hidden for 3 s (n = 1)"
    watch = flight.watch
    held = next((t for t, c in watch.changes if c.after is Phase.HOLD), None)
    back = next((t for t, c in watch.changes if c.before is Phase.HOLD and c.after is Phase.ENGAGE), None)
    after = math.nan if held is None else held - HIDDEN_FROM_S
    resumed = math.nan if back is None else back - HIDDEN_FROM_S - HIDDEN_S
    return [
        number_row(table, "Hold after the marker is hidden", 0.3, round(after, 2), "s", 0.2),
        number_row(table, "Offboard asked for after it is back", None, round(resumed, 2), "s", 0.0),
        landed_row(table, flight, "lands after it"),
    ]


def _cart() -> tuple[list[Row], Chart]:
    flight = watched(preset("guo", NEAR), "guo_cart", seed=1)
    table = "Cart at 0.2 m/s (n = 1)"
    took = landing_s(flight) or math.nan
    return [
        landed_row(table, flight),
        number_row(table, "landing from 3 m", 15.0, round(took, 1), "s", 1.0, good=-1),
        error_row(table, flight),
    ], _offset_chart(flight, "Cart at 0.2 m/s")


def _boat() -> tuple[list[Row], Chart]:
    flight = watched(preset("guo", NEAR), "guo", seed=1)
    table = "Boat at 0.4 m/s, heading 55 to 65 degrees (n = 1)"
    headings = [math.degrees(instant.pad_yaw_rad) for instant in flight.watch.instants]
    turn = yaw_turn(flight.watch.instants)
    gone = math.nan if turn is None or turn.gone_after_s is None else turn.gone_after_s
    swing = f"{min(headings):.0f} to {max(headings):.0f}"
    return [
        landed_row(table, flight),
        Row(table, "heading of the boat", "55 to 65", swing, "deg", "", "same"),
        number_row(table, "yaw corrected in the box within", 1.5, round(gone, 2), "s", 0.5, good=-1),
        error_row(table, flight),
    ], _yaw_chart("Boat: yaw error", flight)


def _wind() -> tuple[list[Row], Chart]:
    flight = watched(preset("guo"), "guo_deck", seed=1)
    table = "Still deck, wind 12 km/h, from 30 m away and 10 m high (n = 1)"
    approach = flight.seconds(Phase.APPROACH, Phase.DESCEND) or math.nan
    took = landing_s(flight, Phase.DESCEND) or math.nan
    return [
        landed_row(table, flight),
        number_row(
            table, "approach to 5 m behind it (62 s in the paper, along waypoints)", None, round(approach, 1), "s", 0.0
        ),
        number_row(table, "landing from there", 13.0, round(took, 1), "s", 1.0, good=-1),
        error_row(table, flight),
    ], _map(flight)


def _yaw_chart(title: str, flight: WatchedFlight) -> Chart:
    instants = flight.watch.instants
    t_s = [instant.t_s for instant in instants]
    line = Line("yaw error", "#36c", t_s, [math.degrees(yaw_error_rad(instant)) for instant in instants])
    return Chart(title, "time s", "deg", (line,), phase_bands(flight), width=760.0)


def _offset_chart(flight: WatchedFlight, title: str = "From the landing point") -> Chart:
    instants = flight.watch.instants
    t_s = [instant.t_s for instant in instants]
    lines = tuple(
        Line(name, colour, t_s, [sign * instant.in_pad_m[axis] for instant in instants])
        for axis, (name, colour, sign) in enumerate(
            (("ahead", "#c33", 1.0), ("right", "#36c", 1.0), ("up", "#0a7", -1.0))
        )
    )
    return Chart(title, "time s", "m in the pad's frame", lines, phase_bands(flight), width=760.0)


def _map(flight: WatchedFlight) -> Chart:
    instants = flight.watch.instants
    path = Line("vehicle", "#36c", [i.vehicle_m[1] for i in instants], [i.vehicle_m[0] for i in instants])
    pad = Line("pad", "#c33", [i.pad_m[1] for i in instants[::50]], [i.pad_m[0] for i in instants[::50]], dots=True)
    return Chart("Approach in wind, from above", "east m", "north m", (path, pad), equal=True, height=360.0)
