"""Light on the scene: how bright, a shadow's edge over the deck, glare; and patches that cover the marker.

Everything here is data plus the tone curve; shade.py and deck_box.py paint. A brightness of 1 is a well exposed picture in
which the deck's paper has the grey of the pad file.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sitl_stub.camera.image import Image


@dataclass(frozen=True, slots=True)
class Shadow:
    """Something large (bridge, tree, building) shades the side of a straight edge over deck and ground.

    The edge passes `offset_m` from the landing point, measured along `direction_rad` in P (0 along x, clockwise seen from
    above); what lies farther along that direction is in the shade and keeps `remaining` of its light.
    """

    direction_rad: float
    offset_m: float
    remaining: float = 0.45


@dataclass(frozen=True, slots=True)
class Glare:
    """Sun mirrored by the deck at (x, y) of P: a spot of `radius_m` that adds `strength` of full scale at its middle."""

    position_m: tuple[float, float]
    radius_m: float = 0.3
    strength: float = 1.0


@dataclass(frozen=True, slots=True)
class Light:
    """`brightness` scales all light times exposure (over 1 burns out, 0.05 is night); `noise_gain` is the sensor's
    amplification that goes with it (2 = noise twice as large). `sun_direction_ned` points to the sun; it shades the deck's
    sides and throws the deck's shadow."""

    brightness: float = 1.0
    noise_gain: float = 1.0
    black_level: float = 6.0
    sun_direction_ned: tuple[float, float, float] = (0.45, -0.35, -0.82)
    shadow: Shadow | None = None
    glare: Glare | None = None


NIGHT = Light(brightness=0.09, noise_gain=2.5, sun_direction_ned=(0.0, 0.0, -1.0))


@dataclass(frozen=True, slots=True)
class Patch:
    """Something flat lies on the deck (a leaf, a tarpaulin, a foot): a rectangle in P with its grey."""

    centre_m: tuple[float, float]
    size_m: tuple[float, float]
    yaw_rad: float = 0.0
    brightness: float = 70.0


@lru_cache(maxsize=64)
def tone_curve(light: Light) -> Image | None:
    """(256,) table from the scene's grey to the sensor's: scaled, lifted by the black level, clipped. None where it would
    leave the picture as it is (brightness 1)."""
    if light.brightness == 1.0:
        return None
    scene = np.arange(256, dtype=np.float64)
    scaled = scene * light.brightness + light.black_level * (1.0 - min(1.0, light.brightness))
    table: Image = np.rint(np.clip(scaled, 0.0, 255.0)).astype(np.uint8)
    return table
