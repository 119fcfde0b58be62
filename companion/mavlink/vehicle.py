"""The autopilot's report of itself: state, range, thrust, acceleration. Wire messages to vocabulary.

State comes from ODOMETRY (one message, one instant, attitude included). Where none comes, LOCAL_POSITION_NED is joined
with the attitude of the same moment. A message that is not finite or in frames that cannot be used gives None.
"""

from __future__ import annotations

from companion.geometry import quaternion_normalized
from companion.mavlink.beacon import odometry_velocity_ned_m_s
from companion.mavlink.codec import finite
from companion.mavlink.dialect import (
    AttitudeQuaternion,
    AttitudeTarget,
    DistanceSensor,
    HighresImu,
    LocalPositionNed,
    Odometry,
)
from companion.messages import AccelerationReport, RangeMeasurement, ThrustReport, VehicleState

ODOMETRY_PREFERRED_NS = 500_000_000
ATTITUDE_MATCH_MS = 60
ORIENTATION_DOWN = 25
SIGNAL_INVALID = 1


class VehicleReader:
    """Keeps what has to be joined: the last attitude, and whether odometry flows."""

    def __init__(self) -> None:
        self.state: VehicleState | None = None
        self._odometry_ns: int | None = None
        self._attitude: AttitudeQuaternion | None = None

    def odometry(self, m: Odometry, t_ns: int) -> VehicleState | None:
        velocity = odometry_velocity_ned_m_s(m)
        if velocity is None or not finite(m.rollspeed, m.pitchspeed, m.yawspeed):
            return None
        self._odometry_ns = t_ns
        self.state = VehicleState(
            t_ns=t_ns,
            position_ned_m=(m.x, m.y, m.z),
            velocity_ned_m_s=velocity,
            q_ned_frd=quaternion_normalized((m.q[0], m.q[1], m.q[2], m.q[3])),
            angular_velocity_frd_rad_s=(m.rollspeed, m.pitchspeed, m.yawspeed),
            reset_counter=m.reset_counter,
        )
        return self.state

    def attitude(self, m: AttitudeQuaternion) -> None:
        self._attitude = m

    def local_position(self, m: LocalPositionNed, t_ns: int) -> VehicleState | None:
        """Only where odometry does not flow and an attitude of about the same time is there."""
        attitude = self._attitude
        if self._odometry_ns is not None and t_ns - self._odometry_ns < ODOMETRY_PREFERRED_NS:
            return None
        if attitude is None or abs(attitude.time_boot_ms - m.time_boot_ms) > ATTITUDE_MATCH_MS:
            return None
        q = (attitude.q1, attitude.q2, attitude.q3, attitude.q4)
        rates = (attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)
        if not finite(m.x, m.y, m.z, m.vx, m.vy, m.vz, *q, *rates) or not any(q):
            return None
        self.state = VehicleState(t_ns, (m.x, m.y, m.z), (m.vx, m.vy, m.vz), quaternion_normalized(q), rates)
        return self.state


def range_measurement(m: DistanceSensor, t_ns: int) -> RangeMeasurement | None:
    """The sensor that looks down; distance None outside its range (PX4's simulator says 655 m on the ground)."""
    if m.orientation != ORIENTATION_DOWN:
        return None
    inside = m.min_distance <= m.current_distance <= m.max_distance and m.signal_quality != SIGNAL_INVALID
    return RangeMeasurement(
        t_ns=t_ns,
        distance_m=m.current_distance * 0.01 if inside else None,
        min_distance_m=m.min_distance * 0.01,
        max_distance_m=m.max_distance * 0.01,
    )


def thrust_report(m: AttitudeTarget, t_ns: int) -> ThrustReport | None:
    return ThrustReport(t_ns, m.thrust) if finite(m.thrust) else None


def acceleration_report(m: HighresImu, t_ns: int) -> AccelerationReport | None:
    if not finite(m.xacc, m.yacc, m.zacc):
        return None
    return AccelerationReport(t_ns, (m.xacc, m.yacc, m.zacc))
