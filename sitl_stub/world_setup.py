"""A scenario's parts as the world needs them: deck, body, contact, range sensor. Shared by World and ExternalWorld."""

from __future__ import annotations

from sitl_stub.airframe import Airframe
from sitl_stub.carriers.deck import Deck
from sitl_stub.carriers.placement import PlacedPath
from sitl_stub.contact import Contact, DeckShape, Surface
from sitl_stub.multirotor import Multirotor
from sitl_stub.pad_layout import PadLayout
from sitl_stub.randomness import generator
from sitl_stub.scenario import Scenario
from sitl_stub.sensors import RangeSensor
from sitl_stub.start import Start, VehiclePose

_BELLY = 0.4
"""How far down between the centre of gravity and the feet the lowest point of the frame is."""
_BURIED_M = 1.0


def make_deck(scenario: Scenario, seed: int, start: Start, pad: PadLayout) -> Deck:
    """The carrier on its path, as a deck that can be asked for any time."""
    path = scenario.path.build(generator(seed, "path"))
    placed = PlacedPath(path, start.pad_north_m, start.pad_east_m, start.path_heading_rad)
    return Deck(scenario.carrier.build(placed, pad.deck_height_m, generator(seed, "carrier")))


def deck_shape(pad: PadLayout) -> DeckShape:
    """The deck as the contact model wants it: solid down into the ground or the water."""
    return DeckShape(
        length_m=pad.length_m,
        width_m=pad.width_m,
        center_x_m=pad.deck_center_m[0],
        center_y_m=pad.deck_center_m[1],
        depth_m=pad.deck_height_m + _BURIED_M,
    )


def make_body(airframe: Airframe, pose: VehiclePose, *, in_air: bool) -> Multirotor:
    """Hovering rotors in the air, stopped ones on the ground."""
    signal = airframe.hover_signal if in_air else 0.0
    body = Multirotor(
        airframe,
        pose.position_ned_m,
        pose.velocity_ned_m_s,
        pose.q_ned_frd,
        pose.rates_frd_rad_s,
        (signal, signal, signal, signal),
    )
    body.on_surface = not in_air
    return body


def make_contact(scenario: Scenario, airframe: Airframe, shape: DeckShape) -> Contact:
    """Feet, rotor hubs and belly against ground and deck."""
    pad = scenario.pad
    return Contact(
        mass_kg=airframe.mass_kg,
        feet_frd_m=airframe.feet_frd_m,
        frame_frd_m=(*airframe.hubs_frd_m, (0.0, 0.0, _BELLY * airframe.feet.below_m)),
        deck=shape,
        surface=Surface(pad.friction, pad.ground_friction, pad.restitution),
    )


def make_range_sensor(scenario: Scenario, seed: int) -> RangeSensor:
    sensor = scenario.range_sensor
    return RangeSensor(
        rate_hz=sensor.rate_hz,
        min_m=sensor.min_m,
        max_m=sensor.max_m,
        noise_sigma_m=sensor.noise_sigma_m,
        rng=generator(seed, "range sensor"),
    )
