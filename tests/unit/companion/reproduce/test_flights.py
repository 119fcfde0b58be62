"""Smoothness and energy against motions whose figures are known."""

from __future__ import annotations

import math

import pytest

from companion.reproduce.flights import energy_j, flight, jerk_rms_m_s3, power_w
from sitl_stub.airframe import read_airframe
from sitl_stub.scenario import find

X500 = read_airframe(find("airframes", "x500"))


def test_the_jerk_of_a_steady_acceleration_is_none_and_of_a_ramp_its_slope() -> None:
    times = [0.05 * i for i in range(101)]
    assert jerk_rms_m_s3([(t, (2.0 * t, -t, 0.0)) for t in times]) == pytest.approx(0.0, abs=1e-9)
    assert jerk_rms_m_s3([(t, (0.0, 1.5 * t * t, 0.0)) for t in times]) == pytest.approx(3.0)
    assert jerk_rms_m_s3([(0.0, (0.0, 0.0, 0.0))]) is None


def test_hovering_takes_the_induced_power_and_speed_costs_its_cube() -> None:
    weight_n = X500.mass_kg * 9.80665
    induced = math.sqrt(weight_n**3 / (2.0 * math.pi * 0.127**2 * 1.225))
    assert power_w(0.0, X500) == pytest.approx(induced)
    assert power_w(5.0, X500) - induced == pytest.approx(0.02 * 125.0)


def test_energy_is_power_over_time() -> None:
    steady = [(0.1 * i, (3.0, 4.0, 0.0)) for i in range(101)]
    assert energy_j(steady, X500) == pytest.approx(10.0 * power_w(5.0, X500))


def test_a_flight_of_the_default_pipeline_has_no_file_but_those_named() -> None:
    assert flight(1, "shivam", preset=None).presets == ()
    assert flight(1, "shivam", preset=None, files=("pads/nested",)).presets[0].endswith("configs/pads/nested.toml")
    assert flight(1, "shivam", preset="shivam").presets[0].endswith("configs/papers/shivam.toml")
