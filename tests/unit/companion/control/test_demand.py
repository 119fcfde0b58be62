"""What steady flight costs is found from tilt and velocity, whatever is sent, and it takes the steady lag away."""

from __future__ import annotations

import pytest
from plant import DT_S, Plant

from companion.config import Control
from companion.control import ControlInput, Reference
from companion.control.demand import SteadyDemand, thrust_acceleration
from companion.control.velocity import VelocityLaw
from companion.geometry import ZERO, quaternion_from_euler

LEVEL = Reference(ZERO, ZERO, ZERO)


def chase(plant: Plant, *, pad_speed_m_s: float, seconds: float, **settings: float) -> tuple[float, VelocityLaw]:
    """Fly the default law after a pad that began together with the vehicle; vehicle minus pad at the end, m."""
    law = VelocityLaw(Control(integral_gain_hz2=0.0, **settings))  # type: ignore[arg-type]
    pad_m = plant.position_m
    for _ in range(round(seconds / DT_S)):
        out = law.update(
            ControlInput(
                dt_s=DT_S,
                relative_position_m=(plant.position_m - pad_m, 0.0, 0.0),
                relative_velocity_m_s=(plant.velocity_m_s - pad_speed_m_s, 0.0, 0.0),
                reference=LEVEL,
                reference_ahead=LEVEL,
                pad_velocity_ahead_m_s=(pad_speed_m_s, 0.0, 0.0),
                pad_acceleration_ahead_m_s2=ZERO,
                velocity_ned_m_s=(plant.velocity_m_s, 0.0, 0.0),
                q_ned_frd=plant.q_ned_frd,
            )
        )
        plant.step(out.velocity_ned_m_s[0], out.acceleration_ned_m_s2[0])
        pad_m += pad_speed_m_s * DT_S
    return plant.position_m - pad_m, law


@pytest.mark.parametrize(("pitch_deg", "north"), [(0.0, 0.0), (-45.0, 9.80665), (10.0, -1.7292)])
def test_tilt_says_what_the_thrust_does_sideways(pitch_deg: float, north: float) -> None:
    q = quaternion_from_euler(0.0, pitch_deg * 0.017453292519943295, 0.7)
    a_north, a_east = thrust_acceleration(quaternion_from_euler(0.0, pitch_deg * 0.017453292519943295, 0.0))
    assert (a_north, a_east) == pytest.approx((north, 0.0), abs=1e-4)
    turned = thrust_acceleration(q)
    assert (turned[0] ** 2 + turned[1] ** 2) ** 0.5 == pytest.approx(abs(north), abs=1e-4)


def test_demand_is_the_drag_and_not_what_speeds_the_vehicle_up() -> None:
    demand, plant = SteadyDemand(0.5, 5.0), Plant(drag_hz=0.0)
    for _ in range(200):
        plant.step(plant.velocity_m_s + 1.0, 0.0)
        demand.update((plant.velocity_m_s, 0.0, 0.0), plant.q_ned_frd, DT_S)
    assert plant.velocity_m_s > 5.0
    assert demand.acceleration_ned_m_s2 == pytest.approx((0.0, 0.0, 0.0), abs=0.05)


def test_without_it_drag_holds_the_vehicle_back_and_with_it_nothing_does() -> None:
    behind_m, _ = chase(Plant(drag_hz=0.3, velocity_m_s=8.0), pad_speed_m_s=8.0, seconds=10.0, demand_time_s=0.0)
    level_m, law = chase(Plant(drag_hz=0.3, velocity_m_s=8.0), pad_speed_m_s=8.0, seconds=10.0, demand_time_s=0.6)
    assert behind_m == pytest.approx(-0.3 * 8.0 / (1.8 * 1.8), rel=0.02)
    assert level_m == pytest.approx(0.0, abs=0.01)
    assert law._demand is not None
    assert law._demand.acceleration_ned_m_s2[0] == pytest.approx(2.4, rel=0.01)


def test_wind_over_a_pad_that_stands_is_a_demand_too() -> None:
    drifted_m, _ = chase(Plant(drag_hz=0.3, wind_m_s=-10.0), pad_speed_m_s=0.0, seconds=10.0, demand_time_s=0.0)
    held_m, _ = chase(Plant(drag_hz=0.3, wind_m_s=-10.0), pad_speed_m_s=0.0, seconds=10.0, demand_time_s=0.6)
    assert drifted_m < -0.8
    assert abs(held_m) < 0.02


def test_demand_is_bounded() -> None:
    demand = SteadyDemand(0.1, 2.0)
    for _ in range(200):
        demand.update(ZERO, quaternion_from_euler(0.0, -1.2, 0.0), DT_S)
    assert demand.acceleration_ned_m_s2[0] == pytest.approx(2.0, abs=1e-3)


def test_pressed_on_the_deck_nothing_is_learned() -> None:
    law = VelocityLaw(Control(demand_time_s=0.5))
    pressing = ControlInput(
        dt_s=DT_S,
        relative_position_m=ZERO,
        relative_velocity_m_s=ZERO,
        reference=LEVEL,
        reference_ahead=LEVEL,
        pad_velocity_ahead_m_s=ZERO,
        pad_acceleration_ahead_m_s2=ZERO,
        feedback=False,
        q_ned_frd=quaternion_from_euler(0.0, -0.5, 0.0),
    )
    for _ in range(100):
        out = law.update(pressing)
    assert out.acceleration_ned_m_s2 == ZERO
