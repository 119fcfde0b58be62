"""What the autopilot believes about itself: the fields of PX4's vehicle_local_position, vehicle_attitude and angular velocity.

Written in place each step by the estimator (estimate.py), read by control cascade, commander and MAVLink endpoint; copy what
you keep. W local NED with the origin where the estimator started, B FRD. Invalid is a flag, never a NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

from sitl_stub.rotation import Quaternion, Vec3

_ZERO: Vec3 = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class VehicleEstimate:
    """State with validity, accuracy, and counters and sizes of the last jumps."""

    t_us: int = 0
    position_ned_m: Vec3 = _ZERO
    velocity_ned_m_s: Vec3 = _ZERO
    acceleration_ned_m_s2: Vec3 = _ZERO
    height_rate_ned_m_s: float = 0.0
    """Derivative of position z: another estimate of the downward speed, with less bias (PX4's z_deriv)."""
    q_ned_frd: Quaternion = (1.0, 0.0, 0.0, 0.0)
    angular_velocity_frd_rad_s: Vec3 = _ZERO
    """Filtered as PX4 filters its gyro (IMU_GYRO_CUTOFF)."""
    angular_acceleration_frd_rad_s2: Vec3 = _ZERO
    yaw_rad: float = 0.0
    height_above_bottom_m: float | None = None
    """From the range sensor to what was below at the filter's fusion horizon (bottom_distance.py); None without a valid range."""
    has_attitude: bool = True
    has_velocity: bool = True
    has_position: bool = True
    has_altitude: bool = True
    is_dead_reckoning: bool = False
    horizontal_accuracy_m: float = 0.5
    vertical_accuracy_m: float = 0.7
    velocity_accuracy_m_s: float = 0.2
    position_xy_resets: int = 0
    position_z_resets: int = 0
    velocity_xy_resets: int = 0
    velocity_z_resets: int = 0
    yaw_resets: int = 0
    position_xy_jump_m: tuple[float, float] = (0.0, 0.0)
    position_z_jump_m: float = 0.0
    velocity_xy_jump_m_s: tuple[float, float] = (0.0, 0.0)
    velocity_z_jump_m_s: float = 0.0
    yaw_jump_rad: float = 0.0
