"""A scenario's [vehicle], [wind] and [estimate] as airframe, autopilot and wind."""

from __future__ import annotations

import numpy as np

from sitl_stub.airframe import Airframe, read_airframe
from sitl_stub.autopilot.autopilot import Autopilot, AutopilotOptions
from sitl_stub.autopilot.estimate import EstimateErrors
from sitl_stub.geodesy import Origin
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.scenario import Scenario, ScenarioError, find
from sitl_stub.wind import Wind, dryden_wind, steady_wind, still_air


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


def make_wind(scenario: Scenario, from_rad: float, rng: np.random.Generator) -> Wind:
    """The scenario's wind; steady without gusts."""
    wind = scenario.wind
    if wind.model == "none":
        return still_air()
    vertical = wind.vertical_gust_sigma_m_s
    vertical = 0.5 * wind.gust_sigma_m_s if vertical is None else vertical
    if wind.gust_sigma_m_s == 0.0 and vertical == 0.0:
        return steady_wind(wind.mean_m_s, from_rad)
    return dryden_wind(wind.mean_m_s, from_rad, wind.gust_sigma_m_s, vertical, rng)
