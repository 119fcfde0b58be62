"""The planar model of the event trigger: what a picture says, and that a landing by the printed law comes to an end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.reproduce import guo_trigger


def test_a_picture_says_where_the_marker_stands() -> None:
    rng = np.random.default_rng(1)
    turned = math.radians(15.0)
    forward, right, turn = np.mean([guo_trigger.seen(-0.5, 0.2, turned, rng) for _ in range(50)], axis=0)
    ahead_m, right_m = 1.25, -0.2
    assert forward == pytest.approx(math.cos(turned) * ahead_m + math.sin(turned) * right_m - 0.75, abs=0.01)
    assert right == pytest.approx(math.cos(turned) * right_m - math.sin(turned) * ahead_m, abs=0.01)
    assert turn == pytest.approx(-turned, abs=math.radians(1.0))


def test_far_away_and_nearly_from_the_front_one_picture_knows_little_of_the_heading() -> None:
    rng = np.random.default_rng(1)
    far = [guo_trigger.seen(-4.25, 0.0, 0.0, rng)[2] for _ in range(100)]
    near = [guo_trigger.seen(0.0, 0.0, 0.0, rng)[2] for _ in range(100)]
    assert math.degrees(float(np.std(far))) > 5.0 > 3.5 > math.degrees(float(np.std(near)))


def test_few_draws_give_the_printed_ratio() -> None:
    rows = {row.name: row for row in guo_trigger.trigger_rows(True)}
    assert float(rows["with over without, median"].ours) == pytest.approx(1.0, abs=0.25)
    assert float(rows["landing with it, median"].ours) < guo_trigger.TOO_LONG_S
