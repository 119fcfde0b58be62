"""The pad's own report of where it is, brought into the autopilot's local NED.

The pad's carrier is a second MAVLink system. Its GLOBAL_POSITION_INT (degrees) goes through the autopilot's global
origin. Its ODOMETRY is local to an origin of its own, which shows when both messages speak of about the same moment: the
difference of the two positions. While odometry flows it is preferred, because it is the same estimate with turn rate.
"""

from __future__ import annotations

import math

from companion.geometry import add, norm, quaternion_normalized, rotate, scale, subtract, wrap_pi, yaw_of
from companion.mavlink.codec import finite, number
from companion.mavlink.dialect import GlobalPositionInt, GpsGlobalOrigin, Odometry
from companion.mavlink.geodesy import GeoOrigin
from companion.messages import PadBeacon, Vec3

FRAME_LOCAL_NED = 1
VELOCITY_FRAME_NED = 1
VELOCITY_FRAMES_BODY = (8, 12)
HEADING_UNKNOWN = 65535
SAME_MOMENT_NS = 300_000_000
OFFSET_JUMP_M = 1.0
OFFSET_SMOOTHING = 0.2
"""GLOBAL_POSITION_INT is rounded to centimetres; a larger step is a reset of the carrier's estimator."""


def geo_origin(message: GpsGlobalOrigin) -> GeoOrigin:
    return GeoOrigin.from_degrees(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)


class BeaconReader:
    """Messages of the beacon system to PadBeacon. Times are those at which the contents were true."""

    def __init__(self, *, position_sigma_m: float) -> None:
        self._sigma_m = position_sigma_m
        self._odometry: tuple[int, Vec3, Vec3] | None = None
        self._offset_ned_m: Vec3 | None = None

    def global_position(self, m: GlobalPositionInt, origin: GeoOrigin, t_ns: int) -> PadBeacon | None:
        """None while odometry of the same system flows, and for the position 0, 0 that means no fix."""
        if m.lat == 0 and m.lon == 0:
            return None
        position = origin.ned_from_degrees(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3)
        if self._place_odometry(position, t_ns):
            return None
        return PadBeacon(
            t_ns=t_ns,
            source="global_position",
            position_ned_m=position,
            velocity_ned_m_s=(m.vx * 0.01, m.vy * 0.01, m.vz * 0.01),
            yaw_rad=None if m.hdg == HEADING_UNKNOWN else wrap_pi(math.radians(m.hdg * 0.01)),
            position_sigma_m=self._sigma_m,
        )

    def _place_odometry(self, position_ned_m: Vec3, t_ns: int) -> bool:
        """Learn where odometry has its origin; False where no odometry of this moment is there."""
        if self._odometry is None or abs(t_ns - self._odometry[0]) > SAME_MOMENT_NS:
            self._offset_ned_m = None
            return False
        odometry_ns, local, velocity = self._odometry
        moved = scale(velocity, (t_ns - odometry_ns) * 1e-9)
        seen = subtract(position_ned_m, add(local, moved))
        before = self._offset_ned_m
        step = (0.0, 0.0, 0.0) if before is None else subtract(seen, before)
        smooth = before is not None and norm(step) < OFFSET_JUMP_M
        self._offset_ned_m = add(before, scale(step, OFFSET_SMOOTHING)) if before is not None and smooth else seen
        return True

    def odometry(self, m: Odometry, t_ns: int) -> PadBeacon | None:
        """None where its origin is unknown yet or its frames are none that can be used."""
        velocity = odometry_velocity_ned_m_s(m)
        if velocity is None:
            return None
        self._odometry = (t_ns, (m.x, m.y, m.z), velocity)
        if self._offset_ned_m is None:
            return None
        return PadBeacon(
            t_ns=t_ns,
            source="odometry",
            position_ned_m=add(self._offset_ned_m, (m.x, m.y, m.z)),
            velocity_ned_m_s=velocity,
            yaw_rad=yaw_of(quaternion_normalized((m.q[0], m.q[1], m.q[2], m.q[3]))),
            position_sigma_m=self._sigma_m,
            yaw_rate_rad_s=number(m.yawspeed),
        )


def odometry_velocity_ned_m_s(m: Odometry) -> Vec3 | None:
    """Velocity in NED from either velocity frame; None where frames, attitude or numbers cannot be used."""
    usable = m.frame_id == FRAME_LOCAL_NED and finite(m.x, m.y, m.z, m.vx, m.vy, m.vz, *m.q)
    if not usable or not any(m.q):
        return None
    if m.child_frame_id == VELOCITY_FRAME_NED:
        return (m.vx, m.vy, m.vz)
    if m.child_frame_id in VELOCITY_FRAMES_BODY:
        return rotate(quaternion_normalized((m.q[0], m.q[1], m.q[2], m.q[3])), (m.vx, m.vy, m.vz))
    return None
