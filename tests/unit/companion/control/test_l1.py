"""L1 augmentation: wind is answered, still air changes nothing."""

from __future__ import annotations

import math

import pytest
from plant import DT_S, Plant

from companion.config import Control
from companion.control import CONTROLLERS, ControlInput, Reference
from companion.geometry import ZERO

STILL = Reference(ZERO, ZERO, ZERO)


def hover(name: str, plant: Plant, seconds: float = 15.0, **settings: float) -> list[float]:
    """Hold position 0 with the law of that name, nothing else against wind; the positions flown, m."""
    law = CONTROLLERS[name](Control(integral_gain_hz2=0.0, demand_time_s=0.0, **settings))  # type: ignore[arg-type]
    flown = []
    for _ in range(round(seconds / DT_S)):
        out = law.update(
            ControlInput(
                dt_s=DT_S,
                relative_position_m=(plant.position_m, 0.0, 0.0),
                relative_velocity_m_s=(plant.velocity_m_s, 0.0, 0.0),
                reference=STILL,
                reference_ahead=STILL,
                pad_velocity_ahead_m_s=ZERO,
                pad_acceleration_ahead_m_s2=ZERO,
                velocity_ned_m_s=(plant.velocity_m_s, 0.0, 0.0),
                q_ned_frd=plant.q_ned_frd,
            )
        )
        plant.step(out.velocity_ned_m_s[0], out.acceleration_ned_m_s2[0])
        flown.append(plant.position_m)
    return flown


def test_wind_no_longer_pushes_the_vehicle_off_its_place() -> None:
    alone = hover("velocity", Plant(drag_hz=0.25, wind_m_s=10.0))
    adaptive = hover("l1", Plant(drag_hz=0.25, wind_m_s=10.0))
    assert alone[-1] == pytest.approx(2.5 / 1.8 / 1.8, rel=0.05)
    one_step = 1.0 - math.exp(-1.8 * DT_S)  # the part of a constant disturbance that a piecewise constant law leaves
    assert adaptive[-1] == pytest.approx(one_step * alone[-1], rel=0.05)
    assert max(abs(x) for x in adaptive) < max(abs(x) for x in alone)


def test_in_still_air_it_flies_as_the_law_it_stands_around() -> None:
    alone = hover("velocity", Plant(position_m=2.0), seconds=6.0)
    adaptive = hover("l1", Plant(position_m=2.0), seconds=6.0)
    assert max(abs(a - b) for a, b in zip(alone, adaptive, strict=True)) < 0.15
    assert abs(adaptive[-1]) < 0.03


def test_what_it_adds_is_bounded() -> None:
    drifted = hover("l1", Plant(drag_hz=0.25, wind_m_s=10.0), max_adaptive_m_s=0.5)
    assert drifted[-1] == pytest.approx((2.5 / 1.8 - 0.5) / 1.8, rel=0.05)
