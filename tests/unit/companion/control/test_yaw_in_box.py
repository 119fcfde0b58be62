"""The yaw law of the boat paper: announced heading first, then nothing, then the seen heading inside the box."""

from __future__ import annotations

import math

import pytest

from companion.control.law import YawInput
from companion.control.yaw import yaw_in_box
from companion.messages import Vec3


def asked(pad_yaw_rad: float | None, relative_m: Vec3 | None, announced_rad: float | None = 0.3) -> float:
    velocity = (0.0, 0.0, 0.0)
    return yaw_in_box(
        YawInput(0.1, 0.0, pad_yaw_rad, velocity, relative_position_m=relative_m, announced_yaw_rad=announced_rad)
    )


def test_before_the_pad_is_seen_the_nose_turns_to_the_announced_heading() -> None:
    assert asked(None, (-20.0, 0.0, -8.0)) == pytest.approx(0.2)
    assert asked(None, (-20.0, 0.0, -8.0), None) == 0.0


def test_seen_from_outside_the_box_nothing_is_corrected() -> None:
    assert asked(0.4, (-3.0, 0.0, -0.5)) == 0.0


def test_inside_the_box_the_nose_turns_to_the_heading_that_is_seen() -> None:
    assert asked(0.4, (0.0, 0.0, -0.3)) == pytest.approx(0.3)
    turned = 0.12 * math.cos(0.4), 0.12 * math.sin(0.4), -0.3  # 12 cm ahead along the pad's heading
    assert asked(0.4, turned) == pytest.approx(0.3)
