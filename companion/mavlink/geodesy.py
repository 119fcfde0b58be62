"""Latitude and longitude to local north and east and back: PX4's map projection.

Azimuthal equidistant about the origin on a sphere of 6371 km, as in PX4's lib/geo, so that a position given in degrees
lands where the autopilot's own local frame has it. Distances along a ray from the origin are exact on the sphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.messages import Vec3

EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, slots=True)
class GeoOrigin:
    """Where the autopilot's local NED has its zero; altitude above mean sea level."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float

    @classmethod
    def from_degrees(cls, latitude_deg: float, longitude_deg: float, altitude_m: float) -> GeoOrigin:
        return cls(math.radians(latitude_deg), math.radians(longitude_deg), altitude_m)

    def ned_from_degrees(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Vec3:
        """Local position in m of a point given in degrees and metres above sea level."""
        latitude, d_longitude = math.radians(latitude_deg), math.radians(longitude_deg) - self.longitude_rad
        sin_origin, cos_origin = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        sin_point, cos_point = math.sin(latitude), math.cos(latitude)
        cosine = sin_origin * sin_point + cos_origin * cos_point * math.cos(d_longitude)
        arc = math.acos(max(-1.0, min(1.0, cosine)))
        stretch = EARTH_RADIUS_M * (arc / math.sin(arc) if abs(arc) > 0.0 else 1.0)
        north = stretch * (cos_origin * sin_point - sin_origin * cos_point * math.cos(d_longitude))
        east = stretch * cos_point * math.sin(d_longitude)
        return (north, east, self.altitude_m - altitude_m)

    def degrees_from_ned(self, position_ned_m: Vec3) -> tuple[float, float, float]:
        """(latitude deg, longitude deg, altitude m) of a local position."""
        north, east, down = position_ned_m
        distance = math.hypot(north, east)
        if distance == 0.0:
            return (math.degrees(self.latitude_rad), math.degrees(self.longitude_rad), self.altitude_m - down)
        arc = distance / EARTH_RADIUS_M
        sin_arc, cos_arc = math.sin(arc), math.cos(arc)
        sin_origin, cos_origin = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        latitude = math.asin(cos_arc * sin_origin + north / distance * sin_arc * cos_origin)
        longitude = self.longitude_rad + math.atan2(
            east / distance * sin_arc, cos_origin * cos_arc - sin_origin * sin_arc * north / distance
        )
        return (math.degrees(latitude), math.degrees(longitude), self.altitude_m - down)
