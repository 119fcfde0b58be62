"""Where everything is when a scenario begins: drawn from the seed where the file leaves it open.

W has its origin where the vehicle starts (on the ground below it), so that the autopilot's own origin is W's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.airframe import Airframe
from sitl_stub.carriers.deck import DeckState
from sitl_stub.rotation import Quaternion, Vec3, from_euler
from sitl_stub.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Start:
    """Directions in rad, 0 north, clockwise; the pad's place in W."""

    pad_north_m: float
    pad_east_m: float
    path_heading_rad: float
    vehicle_yaw_rad: float
    wind_from_rad: float


def draw_start(scenario: Scenario, rng: np.random.Generator) -> Start:
    """Always draws four numbers, used or not, so that giving one in the file leaves the others as they were."""
    bearing, heading, yaw, wind_from = rng.uniform(-math.pi, math.pi, 4).tolist()
    place = scenario.place
    bearing = _given(place.pad_bearing_deg, bearing)
    distance = 0.0 if scenario.vehicle.start == "deck" else place.pad_distance_m
    return Start(
        pad_north_m=distance * math.cos(bearing),
        pad_east_m=distance * math.sin(bearing),
        path_heading_rad=_given(place.path_heading_deg, heading),
        vehicle_yaw_rad=_given(scenario.vehicle.start_yaw_deg, yaw),
        wind_from_rad=_given(scenario.wind.from_deg, wind_from),
    )


def _given(degrees: float | None, drawn_rad: float) -> float:
    return drawn_rad if degrees is None else math.radians(degrees)


@dataclass(frozen=True, slots=True)
class VehiclePose:
    """Where the vehicle begins, and how fast."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    rates_frd_rad_s: Vec3


def vehicle_pose(scenario: Scenario, start: Start, airframe: Airframe, deck: DeckState) -> VehiclePose:
    """In the air above the origin, standing on the ground at it, or standing on the deck and moving with it."""
    level = from_euler(0.0, 0.0, start.vehicle_yaw_rad)
    rest = (0.0, 0.0, 0.0)
    legs = airframe.feet.below_m
    if scenario.vehicle.start == "air":
        return VehiclePose((0.0, 0.0, -scenario.vehicle.start_height_m), rest, level, rest)
    if scenario.vehicle.start == "ground":
        return VehiclePose((0.0, 0.0, -legs), rest, level, rest)
    r, o = deck.rotation_ned_deck, deck.position_ned_m
    position = (o[0] - legs * r[2], o[1] - legs * r[5], o[2] - legs * r[8])
    turn = (0.0, 0.0, deck.angular_velocity_ned_rad_s[2])
    return VehiclePose(position, deck.velocity_ned_m_s, from_euler(*deck.rpy_rad), turn)
