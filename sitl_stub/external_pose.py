"""Where a foreign autopilot says its vehicle truly is: HIL_STATE_QUATERNION, SIM_STATE or ODOMETRY.

The first two are the simulator's truth (PX4 with SIH or Gazebo sends the first, ArduPilot's SITL the second). ODOMETRY is the autopilot's
own estimate, for a simulator that tells no truth: the pad is then as far off as the estimate, and GPS_GLOBAL_ORIGIN is asked for to
place it on the globe. Each is asked for in turn until one comes; while a better one comes a worse one is not looked at. W's axes (north,
east, down), B FRD, WGS84, SI. Used by external.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sitl_stub.geodesy import Origin
from sitl_stub.mavlink.definitions import (
    GPS_GLOBAL_ORIGIN,
    HIL_STATE_QUATERNION,
    ODOMETRY,
    SIM_STATE,
    MessageType,
)
from sitl_stub.mavlink.frame import Frame
from sitl_stub.rotation import Quaternion, Vec3, rotate

_TURNS_EACH = 2
_FRESH_US = 500_000
_LOCAL_NED = 1
_BODY_FRAMES = (8, 12)


@dataclass(frozen=True, slots=True)
class ReportedPose:
    """A pose on the globe, velocity along north, east, down."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    rates_frd_rad_s: Vec3


def read_hil_state(frame: Frame, origin: Origin | None) -> ReportedPose | None:
    """HIL_STATE_QUATERNION."""
    values = [float(value) for value in frame.values()]
    _, w, x, y, z, p, q, r, lat, lon, alt, vx, vy, vz = values[:14]
    velocity = (vx * 0.01, vy * 0.01, vz * 0.01)
    return ReportedPose(lat * 1e-7, lon * 1e-7, alt * 1e-3, velocity, (w, x, y, z), (p, q, r))


def read_sim_state(frame: Frame, origin: Origin | None) -> ReportedPose | None:
    """SIM_STATE; its float degrees are good to half a metre, so the integers of its extension are taken where they are filled."""
    values = [float(value) for value in frame.values()]
    w, x, y, z = values[:4]
    p, q, r, lat, lon, alt = values[10:16]
    vn, ve, vd, lat_int, lon_int = values[18:23]
    if lat_int or lon_int:
        lat, lon = lat_int * 1e-7, lon_int * 1e-7
    return ReportedPose(lat, lon, alt, (vn, ve, vd), (w, x, y, z), (p, q, r))


def read_odometry(frame: Frame, origin: Origin | None) -> ReportedPose | None:
    """ODOMETRY in the local frame whose origin is given; None without it, or for a frame that is not north, east, down."""
    values = [float(value) for value in frame.values()]
    _, x, y, z, qw, qx, qy, qz, vx, vy, vz, p, q, r = values[:14]
    frame_id, child_frame_id = int(values[56]), int(values[57])
    if origin is None or frame_id != _LOCAL_NED:
        return None
    attitude = (qw, qx, qy, qz)
    velocity = (vx, vy, vz)
    if child_frame_id in _BODY_FRAMES:
        velocity = rotate(attitude, velocity)
    latitude_deg, longitude_deg = origin.to_global(x, y)
    return ReportedPose(latitude_deg, longitude_deg, origin.altitude_m - z, velocity, attitude, (p, q, r))


SOURCES: tuple[tuple[MessageType, Callable[[Frame, Origin | None], ReportedPose | None]], ...] = (
    (HIL_STATE_QUATERNION, read_hil_state),
    (SIM_STATE, read_sim_state),
    (ODOMETRY, read_odometry),
)
"""Best first."""


class PoseSource:
    """Which message the pose is taken from, and what to ask for."""

    def __init__(self) -> None:
        self.message: MessageType | None = None
        """Where the last pose came from."""
        self._local_origin: Origin | None = None
        self._turn = 0
        self._rank = len(SOURCES)
        self._seen_us = 0

    @property
    def needs_origin(self) -> bool:
        """The source asked for last is in a local frame whose place is not known."""
        return self._asked_rank == len(SOURCES) - 1 and self._local_origin is None

    @property
    def _asked_rank(self) -> int:
        return max(self._turn - 1, 0) // _TURNS_EACH % len(SOURCES)

    def ask(self) -> MessageType:
        """The message to ask for now: each in turn, twice."""
        self._turn += 1
        return SOURCES[self._asked_rank][0]

    def read(self, frame: Frame, t_us: int) -> ReportedPose | None:
        """A pose, if this frame is of the best source that comes."""
        if frame.message_type is GPS_GLOBAL_ORIGIN:
            latitude, longitude, altitude, *_ = (float(value) for value in frame.values())
            self._local_origin = Origin(latitude * 1e-7, longitude * 1e-7, altitude * 1e-3)
            return None
        for rank, (message, reader) in enumerate(SOURCES):
            if frame.message_type is message and self._takes(rank, t_us):
                return self._take(rank, reader(frame, self._local_origin), t_us)
        return None

    def _takes(self, rank: int, t_us: int) -> bool:
        """Not while a better one comes, nor, since the autopilot may send it unasked, before it had its turn."""
        if self.message is not None and t_us - self._seen_us <= _FRESH_US:
            return rank <= self._rank
        return rank <= self._asked_rank

    def _take(self, rank: int, pose: ReportedPose | None, t_us: int) -> ReportedPose | None:
        if pose is not None:
            self._rank, self._seen_us, self.message = rank, t_us, SOURCES[rank][0]
        return pose
