"""What the filters are given: one measurement of the pad, already in the odometric frame O (NED axes, see
vehicle_history.py), and the pure functions that make it from an observation and the vehicle's pose at capture time.

`covariance_m2` is the part of the error that is new with every measurement; `systematic_sigma_m` the part that
neighbouring measurements share (attitude error of the vehicle times range, capture time), which averaging does not remove.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.estimation.vehicle_history import VehiclePose
from companion.geometry import (
    Transform,
    add,
    euler_from_quaternion,
    matrix_from_quaternion,
    norm,
    quaternion_multiply,
    rotate,
    rotated_covariance,
    scale,
    subtract,
)
from companion.messages import Mat3, ObservationSource, PadBeacon, PadBearing, PadObservation, Quaternion, Vec3

ANGLE_SIGMA_FLOOR_RAD = math.radians(0.5)
UNTOLD_ANGLE_SIGMAS_RAD = (math.radians(3.0), math.radians(3.0), math.radians(2.0))
"""Of roll, pitch and yaw where a detector says nothing of its own."""
STEEPEST = 0.1
"""Cosine of pitch below which roll and yaw cannot be told apart: a deck never stands like that."""


@dataclass(frozen=True, slots=True)
class CameraPose:
    """The camera when the frame was taken: p_OC, q_OC and the vehicle's velocity in O."""

    position_o_m: Vec3
    q_ned_camera: Quaternion
    velocity_m_s: Vec3


@dataclass(frozen=True, slots=True)
class PadMeasurement:
    """One measurement. What it does not carry is None. Angles are about NED axes, rad."""

    t_ns: int
    source: ObservationSource
    position_o_m: Vec3 | None = None
    covariance_m2: Mat3 | None = None
    systematic_sigma_m: float = 0.0
    bias_sigma_m: float = 0.0
    velocity_m_s: Vec3 | None = None
    velocity_sigma_m_s: float = 0.3
    yaw_rad: float | None = None
    yaw_sigma_rad: float = math.radians(2.0)
    yaw_rate_rad_s: float | None = None
    yaw_rate_sigma_rad_s: float = 0.1
    roll_rad: float | None = None
    pitch_rad: float | None = None
    tilt_sigma_rad: float = math.radians(1.0)
    rival_angles_rad: Vec3 | None = None
    """Roll, pitch, yaw of the other pose that explains an ambiguous picture nearly as well."""
    bearing_o: Vec3 | None = None
    bearing_sigma_rad: float = 0.01
    camera: CameraPose | None = None
    height_o_m: float | None = None
    height_sigma_m: float = 0.1


@dataclass(frozen=True, slots=True)
class VehicleErrors:
    """How far the autopilot's own estimate may be off, as standard deviations (measured on a real PX4 by default)."""

    tilt_rad: float = math.radians(1.2)
    yaw_rad: float = math.radians(3.0)
    velocity_m_s: float = 0.3


def measurement_from_observation(
    observation: PadObservation, vehicle: VehiclePose, X_BC: Transform, errors: VehicleErrors
) -> PadMeasurement:
    """X_OP = X_OB X_BC X_CP at capture time, with the covariance turned into O."""
    X_OC = Transform(q=vehicle.q_ned_frd, p=vehicle.position_o_m) @ X_BC
    p_OP = X_OC.point(observation.pad_position_camera_m)
    angles = _angles_o_rad(X_OC.q, observation.q_camera_pad)
    roll_sigma, pitch_sigma, yaw_sigma = _angle_sigmas(X_OC.q, observation)
    return PadMeasurement(
        t_ns=observation.t_ns,
        source=ObservationSource.VISION_POSE,
        position_o_m=p_OP,
        covariance_m2=rotated_covariance(matrix_from_quaternion(X_OC.q), observation.position_covariance_m2),
        systematic_sigma_m=systematic_sigma_m(subtract(p_OP, vehicle.position_o_m), errors),
        yaw_rad=None if angles is None else angles[2],
        yaw_sigma_rad=yaw_sigma,
        roll_rad=None if angles is None else angles[0],
        pitch_rad=None if angles is None else angles[1],
        tilt_sigma_rad=max(roll_sigma, pitch_sigma),
        rival_angles_rad=_angles_o_rad(X_OC.q, observation.q_camera_pad_alternative),
    )


def _angles_o_rad(q_OC: Quaternion, q_CP: Quaternion | None) -> Vec3 | None:
    """Roll, pitch, yaw of the pad in O."""
    return None if q_CP is None else euler_from_quaternion(quaternion_multiply(q_OC, q_CP))


def measurement_from_bearing(
    bearing: PadBearing, vehicle: VehiclePose, X_BC: Transform, errors: VehicleErrors
) -> PadMeasurement:
    """Direction of the pad in O and where it was seen from."""
    X_OC = Transform(q=vehicle.q_ned_frd, p=vehicle.position_o_m) @ X_BC
    return PadMeasurement(
        t_ns=bearing.t_ns,
        source=ObservationSource.VISION_BEARING,
        bearing_o=rotate(X_OC.q, bearing.bearing_camera),
        bearing_sigma_rad=math.hypot(bearing.sigma_rad, 0.3 * errors.tilt_rad),
        camera=CameraPose(X_OC.p, X_OC.q, vehicle.velocity_ned_m_s),
    )


def measurement_from_beacon(
    beacon: PadBeacon, vehicle: VehiclePose, *, noise_sigma_m: float, errors: VehicleErrors
) -> PadMeasurement:
    """W to O with the offset of that moment. The beacon's accuracy is a slowly varying bias; `noise_sigma_m` is the rest.

    Its velocity is the true one, while velocities in O carry the vehicle's velocity error: that is added.
    """
    variance = noise_sigma_m * noise_sigma_m
    return PadMeasurement(
        t_ns=beacon.t_ns,
        source=ObservationSource.ODOMETRY if "odom" in beacon.source.lower() else ObservationSource.BEACON,
        position_o_m=subtract(beacon.position_ned_m, vehicle.offset_m),
        covariance_m2=((variance, 0.0, 0.0), (0.0, variance, 0.0), (0.0, 0.0, 4.0 * variance)),
        bias_sigma_m=beacon.position_sigma_m,
        velocity_m_s=beacon.velocity_ned_m_s,
        velocity_sigma_m_s=math.hypot(beacon.velocity_sigma_m_s, errors.velocity_m_s),
        yaw_rad=beacon.yaw_rad,
        yaw_sigma_rad=math.radians(5.0),
        yaw_rate_rad_s=beacon.yaw_rate_rad_s,
    )


def measurement_from_range(
    t_ns: int, distance_m: float, vehicle: VehiclePose, *, sensor_sigma_m: float = 0.05
) -> PadMeasurement:
    """Height of what is below the vehicle, from a sensor that looks along body z."""
    return PadMeasurement(
        t_ns=t_ns,
        source=ObservationSource.RANGE,
        height_o_m=foot_of_range(distance_m, vehicle)[2],
        height_sigma_m=sensor_sigma_m + 0.02 * distance_m,
    )


def foot_of_range(distance_m: float, vehicle: VehiclePose) -> Vec3:
    """Where in O the beam of a range sensor that looks along body z ends."""
    return add(vehicle.position_o_m, scale(rotate(vehicle.q_ned_frd, (0.0, 0.0, 1.0)), distance_m))


def systematic_sigma_m(p_BP_W: Vec3, errors: VehicleErrors) -> float:
    """Horizontal error that a wrong attitude makes: tilt acts on the whole range, yaw on the horizontal part."""
    return math.hypot(errors.tilt_rad * norm(p_BP_W), errors.yaw_rad * math.hypot(p_BP_W[0], p_BP_W[1]))


def _angle_sigmas(q_OC: Quaternion, observation: PadObservation) -> Vec3:
    """Standard deviations of the pad's roll, pitch and yaw in O, rad. A small turn of the pad about the axes of O changes roll and
    pitch by its parts along and across the pad's heading, yaw by its part about down and, on a deck that pitches, by tan(pitch) of
    what it rolls."""
    covariance_C, q_CP = observation.rotation_covariance_rad2, observation.q_camera_pad
    if covariance_C is None or q_CP is None:
        return UNTOLD_ANGLE_SIGMAS_RAD
    covariance_O = rotated_covariance(matrix_from_quaternion(q_OC), covariance_C)
    _, pitch, yaw = euler_from_quaternion(quaternion_multiply(q_OC, q_CP))
    c, s = math.cos(yaw), math.sin(yaw)
    steep = max(STEEPEST, math.cos(pitch))
    by_turn = (
        (c / steep, s / steep, 0.0),
        (-s, c, 0.0),
        (c * math.sin(pitch) / steep, s * math.sin(pitch) / steep, 1.0),
    )
    variances = rotated_covariance(by_turn, covariance_O)
    roll, pitch, yaw = (max(ANGLE_SIGMA_FLOOR_RAD, math.sqrt(max(0.0, variances[i][i]))) for i in range(3))
    return roll, pitch, yaw
