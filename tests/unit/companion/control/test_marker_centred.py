"""The law of `guo`: the marker is kept in the middle of the picture, so a wrong heading is a wrong place."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from plant import DT_S, Plant

from companion.config import Control
from companion.control import CONTROLLERS, ControlInput, Reference
from companion.geometry import ZERO, quaternion_from_euler

AHEAD_M = 0.75
SETTINGS = Control(
    controller="guo",
    marker_ahead_m=AHEAD_M,
    position_gain_hz=0.4,
    damping=0.0,
    integral_gain_hz2=0.0,
    demand_time_s=0.0,
)
STILL = Reference(ZERO, ZERO, ZERO)
HERE = ControlInput(
    dt_s=DT_S,
    relative_position_m=(-3.0, 0.0, -0.4),
    relative_velocity_m_s=ZERO,
    reference=STILL,
    reference_ahead=STILL,
    pad_velocity_ahead_m_s=ZERO,
    pad_acceleration_ahead_m_s2=ZERO,
    goal_position_m=(0.0, 0.0, -0.38),
    pad_yaw_rad=0.0,
)


def at(north_m: float, east_m: float, yaw_rad: float) -> ControlInput:
    q = quaternion_from_euler(0.0, 0.0, yaw_rad)
    return replace(HERE, relative_position_m=(north_m, east_m, -0.4), q_ned_frd=q)


def asked(control: ControlInput, settings: Control = SETTINGS) -> tuple[float, float]:
    velocity = CONTROLLERS["guo"](settings).update(control).velocity_ned_m_s
    return velocity[0], velocity[1]


def test_with_a_wrong_heading_it_rests_where_the_marker_is_in_the_middle() -> None:
    turned = math.radians(15.0)
    rest = (AHEAD_M * (1.0 - math.cos(turned)), -AHEAD_M * math.sin(turned))
    assert asked(at(*rest, turned)) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert asked(at(0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert asked(at(0.0, 0.0, turned))[1] < -0.05


def test_forward_and_sideways_are_limited_each_in_the_body_frame() -> None:
    """3 m behind and turned by 15 degrees: straight ahead at the limit, sideways in proportion to 3.75 m x sin 15."""
    turned = math.radians(15.0)
    north, east = asked(at(-3.0, 0.0, turned))
    forward = math.cos(turned) * north + math.sin(turned) * east
    right = math.cos(turned) * east - math.sin(turned) * north
    assert forward == pytest.approx(SETTINGS.max_axis_speed_m_s)
    assert right == pytest.approx(-0.4 * 3.75 * math.sin(turned))


def test_turning_counts_as_sideways_motion_of_the_marker() -> None:
    law = CONTROLLERS["guo"](replace_settings(damping=0.2))
    still = law.update(at(-1.0, 0.0, 0.0)).velocity_ned_m_s
    turning = law.update(at(-1.0, 0.0, 0.002)).velocity_ned_m_s
    assert turning[1] - still[1] == pytest.approx(-(0.2 / DT_S + 0.4) * 1.75 * 0.002, rel=0.05)


def replace_settings(**changes: float) -> Control:
    return Control(**{**{name: getattr(SETTINGS, name) for name in SETTINGS.__struct_fields__}, **changes})


@pytest.mark.parametrize(("integral_hz2", "lag_m"), [(0.0, 0.5 / 0.4), (0.04, 0.0)])
def test_it_trails_a_moving_pad_until_the_integral_has_learned_its_speed(integral_hz2: float, lag_m: float) -> None:
    law = CONTROLLERS["guo"](replace_settings(integral_gain_hz2=integral_hz2, max_integral_m_s=0.8))
    plant, pad_m = Plant(velocity_m_s=0.5), 0.0
    for _ in range(round(60.0 / DT_S)):
        out = law.update(
            replace(at(plant.position_m - pad_m, 0.0, 0.0), velocity_ned_m_s=(plant.velocity_m_s, 0.0, 0.0))
        )
        plant.step(out.velocity_ned_m_s[0], out.acceleration_ned_m_s2[0])
        pad_m += 0.5 * DT_S
    assert pad_m - plant.position_m == pytest.approx(lag_m, abs=0.05)


@pytest.mark.parametrize("change", [{"goal_position_m": (-2.0, 0.0, -0.4)}, {"pad_yaw_rad": None}, {"feedback": False}])
def test_on_the_way_elsewhere_or_before_the_pad_was_seen_it_flies_as_velocity_does(change: dict[str, object]) -> None:
    given = replace(at(-3.0, 0.5, 0.3), **change)  # type: ignore[arg-type]
    assert CONTROLLERS["guo"](SETTINGS).update(given) == CONTROLLERS["velocity"](SETTINGS).update(given)
