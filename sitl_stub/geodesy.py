"""Local north and east to latitude and longitude and back, as PX4 does: azimuthal equidistant on a sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from math import asin, atan2, cos, degrees, radians, sin, sqrt
from typing import NamedTuple

from sitl_stub.compiled import used_by_kernels

EARTH_RADIUS_M = 6371000.0


class OriginNumbers(NamedTuple):
    """Where W lies, as `to_global` and kernels take it; sine and cosine are of the latitude."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    sine: float
    cosine: float


@used_by_kernels
def to_global(origin: OriginNumbers, north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude in degrees."""
    latitude_deg, longitude_deg, _, sine, cosine = origin
    c = sqrt(north_m * north_m + east_m * east_m) / EARTH_RADIUS_M
    if c == 0.0:
        return latitude_deg, longitude_deg
    sin_c, cos_c = sin(c), cos(c)
    x, y = north_m / EARTH_RADIUS_M, east_m / EARTH_RADIUS_M
    lat = asin(cos_c * sine + x * sin_c * cosine / c)
    across = c * cosine * cos_c - x * sine * sin_c
    lon = radians(longitude_deg) + atan2(y * sin_c, across)
    return degrees(lat), degrees(lon)


@dataclass(frozen=True, slots=True)
class Origin:
    """Where W lies: latitude, longitude (degrees) and altitude above mean sea level (m) of its origin, on the ground."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    numbers: OriginNumbers = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        latitude_rad = math.radians(self.latitude_deg)
        numbers = OriginNumbers(
            self.latitude_deg, self.longitude_deg, self.altitude_m, math.sin(latitude_rad), math.cos(latitude_rad)
        )
        object.__setattr__(self, "numbers", numbers)

    def to_global(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude in degrees."""
        return to_global(self.numbers, north_m, east_m)

    def to_local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """North and east in m."""
        lat, lat0 = math.radians(latitude_deg), math.radians(self.latitude_deg)
        turn = math.radians(longitude_deg - self.longitude_deg)
        cos_c = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(turn)
        c = math.acos(min(max(cos_c, -1.0), 1.0))
        k = c / math.sin(c) if c > 1e-12 else 1.0
        north = k * (math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(turn))
        return north * EARTH_RADIUS_M, k * math.cos(lat) * math.sin(turn) * EARTH_RADIUS_M
