"""The curve's hull and the heading loop, by themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from companion.planning.bezier import BezierCurve
from companion.reproduce import shivam


def test_a_curve_that_leaves_the_triangle_is_noticed() -> None:
    curve = shivam.curve_of(shivam.CASES[0])
    assert shivam.outside_hull_m(curve) < 1e-12
    p0, p1, p2, p3, p4 = curve.points_m
    bulged = BezierCurve((p0, (p1[0], p1[1] + 4.0, 0.0), p2, p3, p4))
    assert shivam.outside_hull_m(bulged) > 0.5


def test_the_distance_left_is_the_speed_over_the_gain_times_the_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    curve = shivam.curve_of(shivam.CASES[0])
    for gain_hz in (5.0, 10.0, 20.0):
        monkeypatch.setattr(shivam, "GAIN_HZ", gain_hz)
        left = shivam.track(curve).distance_m[-1]
        assert left == pytest.approx(math.sqrt(2.0) / gain_hz, rel=0.1)


def test_the_heading_begins_and_ends_as_asked() -> None:
    for case in (shivam.CASES[0], shivam.CASES[-1]):
        found = shivam.track(shivam.curve_of(case))
        assert math.degrees(found.heading_rad[0]) % 360.0 == pytest.approx(case.heading_deg % 360.0)
        assert math.degrees(found.heading_rad[-1]) % 360.0 == pytest.approx(270.0, abs=1.0)


def test_the_loop_flies_at_one_metre_a_second() -> None:
    found = shivam.track(shivam.curve_of(shivam.CASES[5]))
    steps = zip(found.x_m, found.y_m, found.x_m[1:], found.y_m[1:], strict=False)
    flown = sum(math.hypot(x1 - x0, y1 - y0) for x0, y0, x1, y1 in steps)
    assert flown == pytest.approx(found.t_s[-1], rel=1e-3)


def test_a_ratio_off_the_middle_bends_more() -> None:
    middle = shivam.peak_curvature_1_m(shivam.curve_of(shivam.CASES[0]), 501)
    for ratio in (0.1, 0.3, 0.7, 0.9):
        case = replace(shivam.CASES[0], ratio=ratio)
        assert shivam.peak_curvature_1_m(shivam.curve_of(case), 501) > middle
