"""Local north and east to latitude and longitude and back, as PX4 does: azimuthal equidistant on a sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

EARTH_RADIUS_M = 6371000.0


@dataclass(frozen=True, slots=True)
class Origin:
    """Where W lies: latitude, longitude (degrees) and altitude above mean sea level (m) of its origin, on the ground."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    _latitude_rad: float = field(init=False, repr=False, compare=False)
    _sine: float = field(init=False, repr=False, compare=False)
    _cosine: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        latitude_rad = math.radians(self.latitude_deg)
        object.__setattr__(self, "_latitude_rad", latitude_rad)
        object.__setattr__(self, "_sine", math.sin(latitude_rad))
        object.__setattr__(self, "_cosine", math.cos(latitude_rad))

    def to_global(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude in degrees."""
        c = math.hypot(north_m, east_m) / EARTH_RADIUS_M
        if c == 0.0:
            return self.latitude_deg, self.longitude_deg
        sine, cosine, sin_c, cos_c = self._sine, self._cosine, math.sin(c), math.cos(c)
        x, y = north_m / EARTH_RADIUS_M, east_m / EARTH_RADIUS_M
        lat = math.asin(cos_c * sine + x * sin_c * cosine / c)
        across = c * cosine * cos_c - x * sine * sin_c
        lon = math.radians(self.longitude_deg) + math.atan2(y * sin_c, across)
        return math.degrees(lat), math.degrees(lon)

    def to_local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """North and east in m."""
        lat, lat0 = math.radians(latitude_deg), self._latitude_rad
        turn = math.radians(longitude_deg - self.longitude_deg)
        cos_c = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(turn)
        c = math.acos(min(max(cos_c, -1.0), 1.0))
        k = c / math.sin(c) if c > 1e-12 else 1.0
        north = k * (math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(turn))
        return north * EARTH_RADIUS_M, k * math.cos(lat) * math.sin(turn) * EARTH_RADIUS_M
