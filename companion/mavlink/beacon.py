"""The pad's own report of where it is, brought into the autopilot's local NED.

The pad's carrier is a second MAVLink system. Its GLOBAL_POSITION_INT (degrees) goes through the autopilot's global
origin. Its ODOMETRY is local to an origin of its own, so it counts only once that origin is known too; while it flows it
is preferred, because it is the same estimate with attitude and turn rate.
"""

from __future__ import annotations

from companion.geometry import add, quaternion_normalized, rotate, yaw_of
from companion.mavlink.codec import finite
from companion.mavlink.dialect import GlobalPositionInt, GpsGlobalOrigin, Odometry
from companion.mavlink.geodesy import GeoOrigin
from companion.messages import PadBeacon, Vec3

FRAME_LOCAL_NED = 1
VELOCITY_FRAME_NED = 1
VELOCITY_FRAMES_BODY = (8, 12)
HEADING_UNKNOWN = 65535
ODOMETRY_PREFERRED_NS = 1_000_000_000


def geo_origin(message: GpsGlobalOrigin) -> GeoOrigin:
    return GeoOrigin.from_degrees(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)


class BeaconReader:
    """Messages of the beacon system to PadBeacon."""

    def __init__(self, *, position_sigma_m: float) -> None:
        self._sigma_m = position_sigma_m
        self._own_origin: GeoOrigin | None = None
        self._odometry_ns: int | None = None

    def set_origin(self, message: GpsGlobalOrigin) -> None:
        self._own_origin = geo_origin(message)

    def global_position(self, m: GlobalPositionInt, origin: GeoOrigin, t_ns: int) -> PadBeacon | None:
        """None while odometry of the same system flows, and for the position 0, 0 that means no fix."""
        has_odometry = self._odometry_ns is not None and t_ns - self._odometry_ns < ODOMETRY_PREFERRED_NS
        if has_odometry or (m.lat == 0 and m.lon == 0):
            return None
        heading_known = m.hdg != HEADING_UNKNOWN
        return PadBeacon(
            t_ns=t_ns,
            source="global_position",
            position_ned_m=origin.ned_from_degrees(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3),
            velocity_ned_m_s=(m.vx * 0.01, m.vy * 0.01, m.vz * 0.01),
            yaw_rad=_yaw_from_centidegrees(m.hdg) if heading_known else None,
            position_sigma_m=self._sigma_m,
        )

    def odometry(self, m: Odometry, origin: GeoOrigin, t_ns: int) -> PadBeacon | None:
        """None where its origin is unknown or its frames are none that can be used."""
        velocity = odometry_velocity_ned_m_s(m)
        if self._own_origin is None or velocity is None:
            return None
        self._odometry_ns = t_ns
        offset = origin.ned_from_degrees(*self._own_origin.degrees_from_ned((0.0, 0.0, 0.0)))
        return PadBeacon(
            t_ns=t_ns,
            source="odometry",
            position_ned_m=add(offset, (m.x, m.y, m.z)),
            velocity_ned_m_s=velocity,
            yaw_rad=yaw_of(quaternion_normalized((m.q[0], m.q[1], m.q[2], m.q[3]))),
            position_sigma_m=self._sigma_m,
            yaw_rate_rad_s=m.yawspeed if finite(m.yawspeed) else None,
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


def _yaw_from_centidegrees(heading_cdeg: int) -> float:
    """0..36000 to (-pi, pi]."""
    degrees = heading_cdeg * 0.01
    return (degrees - 360.0 if degrees > 180.0 else degrees) * 0.017453292519943295
