"""The boat paper: energies, ranges and the box against what can be computed by hand; its quick part's judgements."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.messages import Phase
from companion.reproduce import guo_paths, guo_stereo
from companion.reproduce.guo_flights import is_in_box, yaw_turn
from companion.reproduce.watched_flight import Instant


def instant(t_s: float, in_pad_m: tuple[float, float, float], yaw_rad: float, phase: Phase = Phase.DESCEND) -> Instant:
    zero = (0.0, 0.0, 0.0)
    return Instant(t_s, phase, zero, zero, yaw_rad, zero, zero, 0.0, in_pad_m, "OFFBOARD")


def test_the_power_at_rest_is_the_printed_one() -> None:
    assert float(guo_paths.power_w(np.array([0.0]))[0]) == pytest.approx(guo_paths.PRINTED_POWER_W)


def test_a_straight_line_is_flown_in_the_time_of_a_trapezoid() -> None:
    line = np.linspace([0.0, 0.0, 0.0], [100.0, 0.0, 0.0], 501)
    duration_s, energy_j = guo_paths.flown(line)
    ramp_s = guo_paths.CRUISE_M_S / guo_paths.TURN_M_S2
    assert duration_s == pytest.approx(100.0 / guo_paths.CRUISE_M_S + ramp_s, rel=0.01)
    assert energy_j == pytest.approx(duration_s * guo_paths.PRINTED_POWER_W, rel=0.001)


def test_the_orders_that_the_paper_prints_come_out() -> None:
    rows, charts, figures = guo_paths.path_rows(True)
    orders = {(row.table, row.name): row.verdict for row in rows if row.name.startswith("order")}
    assert orders["Table 1, 2-D as printed", "order by mean"] == "same"
    assert orders["Table 1, 3-D stated here", "order by mean"] == "same"
    for quantity in ("distance", "duration", "energy"):
        assert orders["Table 2, 3-D stated here", f"order by {quantity}"] == "same"
    assert figures["improved minimum snap"].largest_m < guo_paths.THRESHOLD_M
    assert len(charts) == len(guo_paths.METHODS) + 1


def test_the_printed_ranges_give_the_erratum_and_the_crossover() -> None:
    printed = guo_stereo.printed_ranges()
    assert 100.0 * guo_stereo.errors(printed.truth_m, printed.stereo_m).mae_m == pytest.approx(35.35, abs=0.01)
    assert guo_stereo.crossover_m(printed) == 5.0


def test_a_method_that_is_never_worse_has_no_crossover() -> None:
    truth = np.array([1.0, 2.0])
    assert guo_stereo.crossover_m(guo_stereo.Ranges(truth, truth, truth + 0.1)) is None


def test_the_box_is_the_yaw_laws_box() -> None:
    assert is_in_box(instant(0.0, (0.0, 0.0, -0.3), 0.0))
    assert not is_in_box(instant(0.0, (0.2, 0.0, -0.3), 0.0))
    assert not is_in_box(instant(0.0, (0.0, 0.3, -0.3), 0.0))
    assert not is_in_box(instant(0.0, (0.0, 0.0, -0.7), 0.0))


def test_a_yaw_error_is_gone_when_it_was_large_for_the_last_time() -> None:
    errors_deg = (15.0, 15.0, 10.0, 2.0, 4.0, 1.0)
    places = [(-1.0, 0.0, -0.3), *[(0.0, 0.0, -0.3)] * 5]
    flown = [instant(float(k), p, math.radians(e)) for k, (p, e) in enumerate(zip(places, errors_deg, strict=True))]
    turn = yaw_turn(flown)
    assert turn is not None
    assert turn.first_rad == pytest.approx(math.radians(15.0))
    assert turn.gone_after_s == 3.0
    assert yaw_turn(flown[:1]) is None
