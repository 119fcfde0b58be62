"""The vocabulary: every message that flows between the parts of Companion.

All messages are frozen and carry `t_ns`, the instant at which their content was **true**, on the companion's
monotonic clock in nanoseconds. When a message arrived is the recorder's business, not the message's.

Frames (see docs/conventions.md): W local NED of the autopilot, B body FRD, C camera optical (right, down, forward),
P pad (x along travel, y right, z down). Units are SI and stand in the field's name. Quaternions are Hamilton, w x y z,
unit, w >= 0; `q_ned_frd` takes vectors given in B to W. Unset is None; NaN exists only on the wire.

Small vectors are plain tuples: they compare exactly, hash, print and serialise as themselves, and for three numbers they
are faster than arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Mat3 = tuple[Vec3, Vec3, Vec3]
"""Rows of a 3 x 3 matrix."""

Image = npt.NDArray[np.uint8]
"""(height, width) grey or (height, width, 3) BGR."""


# --------------------------------------------------------------------------------------------------------------- enums


class AutopilotMode(StrEnum):
    """PX4's navigation state as its users name it. `HOLD` is AUTO.LOITER."""

    MANUAL = "manual"
    ALTITUDE = "altitude"
    POSITION = "position"
    ACRO = "acro"
    STABILIZED = "stabilized"
    OFFBOARD = "offboard"
    MISSION = "mission"
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"
    TAKEOFF = "takeoff"
    PRECISION_LAND = "precision_land"
    FOLLOW = "follow"
    TERMINATION = "termination"
    OTHER = "other"


class LandedState(StrEnum):
    """MAVLink's MAV_LANDED_STATE as the autopilot reports it. It speaks of the ground it believes in, not of the pad."""

    UNDEFINED = "undefined"
    ON_GROUND = "on_ground"
    IN_AIR = "in_air"
    TAKEOFF = "takeoff"
    LANDING = "landing"


class Phase(StrEnum):
    """What the mission is doing. The table of transitions stands in mission/phases.py."""

    IDLE = "idle"
    TAKEOFF = "takeoff"
    ENGAGE = "engage"
    SEARCH = "search"
    APPROACH = "approach"
    FOLLOW = "follow"
    DESCEND = "descend"
    COMMIT = "commit"
    TOUCHDOWN = "touchdown"
    DONE = "done"
    GO_AROUND = "go_around"
    HOLD = "hold"
    RETURN = "return"
    ABORT = "abort"


class OperatorAction(StrEnum):
    """What a person may ask for over MQTT, the page or the command line."""

    START = "start"
    HOLD = "hold"
    ABORT = "abort"
    GO_AROUND = "go_around"
    RETURN = "return"


class CommandKind(StrEnum):
    """What the mission may ask of the autopilot."""

    ARM = "arm"
    DISARM = "disarm"
    FORCE_DISARM = "force_disarm"
    TAKEOFF = "takeoff"
    OFFBOARD = "offboard"
    HOLD = "hold"
    LAND = "land"
    RETURN = "return"


class ObservationSource(StrEnum):
    """Where a measurement of the pad came from."""

    VISION_POSE = "vision_pose"
    VISION_BEARING = "vision_bearing"
    RANGE = "range"
    BEACON = "beacon"
    ODOMETRY = "odometry"


# ------------------------------------------------------------------------------------------------------ inputs: sensors


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """One frame. `t_ns` is the middle of the exposure."""

    t_ns: int
    camera: str
    image: Image
    sequence: int
    capture_uncertainty_ns: int = 0


@dataclass(frozen=True, slots=True)
class PadObservation:
    """The pad as one frame showed it, in the camera that took the frame.

    `pad_position_camera_m` is p_CP, the landing point in C; `q_camera_pad` takes P to C (None where only a bearing or a
    position is known). Covariances come from the reprojection Jacobian. A planar target seen from afar has two poses
    that explain it; when the second is nearly as good it is kept in `q_camera_pad_alternative`.
    """

    t_ns: int
    camera: str
    detector: str
    pad_position_camera_m: Vec3
    position_covariance_m2: Mat3
    q_camera_pad: Quaternion | None = None
    rotation_covariance_rad2: Mat3 | None = None
    q_camera_pad_alternative: Quaternion | None = None
    marker_ids: tuple[int, ...] = ()
    corners_px: tuple[Vec2, ...] = ()
    reprojection_error_px: float = 0.0


@dataclass(frozen=True, slots=True)
class PadBearing:
    """Direction to the pad only: a unit vector in C and the standard deviation of its angle."""

    t_ns: int
    camera: str
    detector: str
    bearing_camera: Vec3
    sigma_rad: float
    corners_px: tuple[Vec2, ...] = ()


@dataclass(frozen=True, slots=True)
class PadNotSeen:
    """A frame was searched and the pad was not in it. Absence is news: it drives ages, search and the display."""

    t_ns: int
    camera: str
    detector: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class PadBeacon:
    """The pad's own report of where it is (GNSS or odometry of its carrier), already in the autopilot's local NED."""

    t_ns: int
    source: str
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3 | None
    yaw_rad: float | None
    position_sigma_m: float
    velocity_sigma_m_s: float = 0.3
    yaw_rate_rad_s: float | None = None


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The autopilot's own estimate of itself. It is an estimate: drift, resets and metre-level error are normal."""

    t_ns: int
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    angular_velocity_frd_rad_s: Vec3
    reset_counter: int = 0


@dataclass(frozen=True, slots=True)
class RangeMeasurement:
    """Distance along the sensor's axis to whatever is below. `distance_m` is None when the sensor says it has none."""

    t_ns: int
    distance_m: float | None
    min_distance_m: float
    max_distance_m: float


@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """What the autopilot is doing. Sent on every change and with every mode report.

    `t_ns` is the instant of the latest mode report, so that its age says how old this knowledge is.
    """

    t_ns: int
    connected: bool
    armed: bool
    mode: AutopilotMode
    intended_mode: AutopilotMode | None
    landed_state: LandedState
    failsafe: bool
    ready_to_arm: bool | None
    battery_fraction: float | None
    home_position_ned_m: Vec3 | None
    link_age_s: float
    home_position_deg: Vec2 | None = None


@dataclass(frozen=True, slots=True)
class ThrustReport:
    """Collective thrust the autopilot asks of its motors, 0 to 1: one of the signs of a touchdown."""

    t_ns: int
    thrust_normalized: float


@dataclass(frozen=True, slots=True)
class AccelerationReport:
    """Specific force measured by the IMU, body FRD: a touchdown shows in it."""

    t_ns: int
    specific_force_frd_m_s2: Vec3


@dataclass(frozen=True, slots=True)
class AutopilotText:
    """A status text or event of the autopilot, for people."""

    t_ns: int
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class CommandResult:
    """The autopilot's real answer to a VehicleCommand (the last acknowledgement, not the first; see mavlink/commands)."""

    t_ns: int
    kind: CommandKind
    accepted: bool
    result: str
    attempts: int


# ------------------------------------------------------------------------------------------------- inputs: people, time


@dataclass(frozen=True, slots=True)
class OperatorCommand:
    """A person asks for something."""

    t_ns: int
    action: OperatorAction
    source: str


@dataclass(frozen=True, slots=True)
class Tick:
    """The control clock, 50 Hz by default. Everything periodic hangs on it, so that a log is the whole input."""

    t_ns: int


# -------------------------------------------------------------------------------------------------- between the stages


@dataclass(frozen=True, slots=True)
class PadEstimate:
    """Where the pad is at `t_ns`, in W, and how well that is known.

    `covariance` is 6 x 6 over (position, velocity) as rows. `vision_age_s` and `beacon_age_s` count from the capture of
    the last accepted measurement; None means never.
    """

    t_ns: int
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    acceleration_ned_m_s2: Vec3
    yaw_rad: float
    yaw_rate_rad_s: float
    covariance: tuple[tuple[float, ...], ...]
    vision_age_s: float | None
    beacon_age_s: float | None
    model: str
    model_probabilities: tuple[tuple[str, float], ...] = ()
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    @property
    def position_sigma_m(self) -> float:
        """Horizontal position standard deviation, m (root mean square of the two axes)."""
        return float(((self.covariance[0][0] + self.covariance[1][1]) / 2.0) ** 0.5)

    @property
    def velocity_sigma_m_s(self) -> float:
        """Horizontal velocity standard deviation, m/s (root sum of squares of the two axes)."""
        return float((self.covariance[3][3] + self.covariance[4][4]) ** 0.5)


@dataclass(frozen=True, slots=True)
class MeasurementVerdict:
    """What the estimator did with one measurement and why. `nis` is the normalised innovation squared."""

    t_ns: int
    source: ObservationSource
    accepted: bool
    reason: str
    nis: float | None = None
    innovation: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanMade:
    """A plan relative to the predicted pad. Control points are pad-relative, non-rotating NED axes, metres.

    `found` is False when the planner has nothing to offer; then `reason` says why and the mission acts on it.
    """

    t_ns: int
    method: str
    found: bool
    reason: str
    start_ns: int
    end_ns: int
    control_points_m: tuple[Vec3, ...] = ()
    cost: float = 0.0
    max_speed_m_s: float = 0.0
    max_acceleration_m_s2: float = 0.0


@dataclass(frozen=True, slots=True)
class PhaseChanged:
    """The mission moved on (or back)."""

    t_ns: int
    before: Phase
    after: Phase
    reason: str


# ------------------------------------------------------------------------------------------------------------- outputs


@dataclass(frozen=True, slots=True)
class VelocitySetpoint:
    """What the vehicle is asked to fly now. It dies at `valid_until_ns`: nothing may re-send it with a new stamp."""

    t_ns: int
    valid_until_ns: int
    velocity_ned_m_s: Vec3
    yaw_rate_rad_s: float
    acceleration_ned_m_s2: Vec3 | None = None


@dataclass(frozen=True, slots=True)
class PadReport:
    """Where the pad is, for an autopilot that flies its own precision landing; W, local NED."""

    t_ns: int
    position_ned_m: Vec3


@dataclass(frozen=True, slots=True)
class VehicleCommand:
    """A discrete request to the autopilot. A forced disarm carries the evidence that the vehicle stands on the pad."""

    t_ns: int
    kind: CommandKind
    reason: str
    evidence: tuple[str, ...] = ()
    height_m: float | None = None


@dataclass(frozen=True, slots=True)
class MissionView:
    """The mission once a tick, for people: what phase, how far from the pad, how fast against it, what is missing."""

    t_ns: int
    phase: Phase
    relative_position_ned_m: Vec3 | None
    relative_velocity_ned_m_s: Vec3 | None
    height_above_pad_m: float | None
    pad_seen: bool
    note: str
    go_arounds: int


@dataclass(frozen=True, slots=True)
class Health:
    """A condition somebody should know of: link, clock, camera, queue, timing. `level` is 0 fine, 1 warn, 2 fail."""

    t_ns: int
    subject: str
    level: int
    text: str
    value: float | None = None


SensorInput = (
    PadObservation
    | PadBearing
    | PadNotSeen
    | PadBeacon
    | VehicleState
    | RangeMeasurement
    | VehicleStatus
    | ThrustReport
    | AccelerationReport
    | AutopilotText
    | CommandResult
)
Input = SensorInput | OperatorCommand | Tick
Output = (
    VelocitySetpoint
    | PadReport
    | VehicleCommand
    | PadEstimate
    | MeasurementVerdict
    | PlanMade
    | PhaseChanged
    | MissionView
    | Health
)
Message = Input | Output
