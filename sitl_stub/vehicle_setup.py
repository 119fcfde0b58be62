"""A scenario's [vehicle], [wind] and [estimate] as airframe, autopilot and wind."""

from __future__ import annotations

import math

import numpy as np

from sitl_stub.airframe import Airframe, read_airframe
from sitl_stub.autopilot.autopilot import Autopilot, AutopilotOptions
from sitl_stub.autopilot.estimate import EstimateErrors
from sitl_stub.geodesy import Origin
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.rotation import Vec3
from sitl_stub.scenario import Scenario, ScenarioError, find


class SteadyWind:
    def __init__(self, velocity_ned_m_s: Vec3) -> None:
        self.velocity_ned_m_s = velocity_ned_m_s

    def step(self, dt_s: float, height_m: float) -> Vec3:
        return self.velocity_ned_m_s


def read_vehicle(scenario: Scenario) -> Airframe:
    """The airframe; AirframeError or ScenarioError says what is wrong with it."""
    return read_airframe(find("airframes", scenario.vehicle.airframe))


def make_autopilot(
    scenario: Scenario, airframe: Airframe, truth: VehicleTruth, origin: Origin, rng: np.random.Generator
) -> Autopilot:
    """Booted and ready; armed and flying where the scenario starts in the air."""
    scale = scenario.estimate.error_scale
    options = AutopilotOptions(
        origin=origin,
        errors=EstimateErrors.scaled(scale),
        home_error_scale=scale,
        cold_boot=scenario.vehicle.cold_boot,
        has_range_sensor=scenario.range_sensor.fitted,
    )
    try:
        autopilot = Autopilot(airframe, scenario.vehicle.parameters, rng, options)
    except KeyError as error:
        raise ScenarioError(f"[vehicle.parameters] {error.args[0]} is not a parameter of this autopilot") from error
    if scenario.vehicle.start == "air":
        autopilot.begin_in_air(truth)
    return autopilot


def make_wind(scenario: Scenario, from_rad: float, rng: np.random.Generator) -> SteadyWind:
    speed = scenario.wind.mean_m_s
    return SteadyWind((-speed * math.cos(from_rad), -speed * math.sin(from_rad), 0.0))
