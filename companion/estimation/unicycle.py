"""The non-holonomic platform EKF of Falanga et al. (2017): x = (px, py, pz, theta, v), measured by a 3-D position,
and near the deck by the range sensor, as the paper does it.

    px' = v cos(theta)    py' = v sin(theta)    pz' = 0    theta' = u1    v' = u2    with u1 = u2 = 0

The platform cannot slip sideways; how it steers and brakes is unknown and stands in the process noise. Frame O (NED), theta
is the direction of travel, clockwise from north. Compiled with the extra `fast`. Chosen by `estimator = "unicycle"`, as
printed, or `"unicycle_turn"`, where u1 is learned: the corrections of theta, smoothed, are the turn rate that the model
lacked, and so prediction and the acceleration that is fed forward follow a curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from companion.compiled import compiled, room
from companion.estimation.gate import NS, AxisGate, Decision, judge
from companion.estimation.measurement import PadMeasurement
from companion.estimation.motion import in_steps
from companion.estimation.outlook import WholeOutlook
from companion.estimation.turn import MIN_SPEED_M_S
from companion.geometry import wrap_pi
from companion.messages import MeasurementVerdict, ObservationSource, PadEstimate, Vec3

BIASED = (ObservationSource.BEACON, ObservationSource.ODOMETRY)
START_WINDOW_NS, START_SIGHTS, START_WAY_M, START_SIGMAS = 6 * NS, 5, 0.3, 5.0
"""Direction and speed are the slope of a straight line through the sights of the last seconds, once there are so many of them, the
line is so long, and its slope is so many standard deviations: the first sights from far away are off by a metre."""
MAX_TURN_RAD_S = 1.0
TURN_TOLD_FROM_M_S = 2.0
"""Slower, theta's corrections are more of the sights' noise than of the platform's turn."""
TURN_KEPT_S, TURN_FADES_S = 1.0, 1.0
"""Unseen, the platform is believed to turn on for the first, and to come out of the turn within about the second: no path
turns for ever, and a prediction that does leads the vehicle round in a circle."""
UNSEEN_AFTER_S = 0.15
"""Longer than from one sight to the next."""
LONGEST_STEP_S = 0.1
"""What a step adds to the uncertainty of theta reaches the position with the next one."""
AXES = ("north", "east", "down")

Sight = tuple[int, float, float]
"""t_ns, north, east."""


@compiled
def predict_unicycle(
    x: Any, P: Any, dt: float, u1: float, q_position: float, q_height: float, q_theta: float, q_v: float
) -> None:
    """One step of mean and 5 x 5 covariance, in place. u1: turn rate, rad/s. q_*: variance gained per second.

    F differs from the identity in the rows of px and py only, which take from theta and v: F P F' changes two rows, then two columns.
    """
    theta, v = x[3] + 0.5 * dt * u1, x[4]
    c, s = math.cos(theta), math.sin(theta)
    x[0] += dt * v * c
    x[1] += dt * v * s
    x[3] += dt * u1
    x_theta, x_v, y_theta, y_v = -dt * v * s, dt * c, dt * v * c, dt * s
    for j in range(5):
        P[j] = P[j] + x_theta * P[15 + j] + x_v * P[20 + j]
        P[5 + j] = P[5 + j] + y_theta * P[15 + j] + y_v * P[20 + j]
    for i in range(5):
        r = 5 * i
        P[r] = P[r] + x_theta * P[r + 3] + x_v * P[r + 4]
        P[r + 1] = P[r + 1] + y_theta * P[r + 3] + y_v * P[r + 4]
    P[0] += q_position * dt
    P[6] += q_position * dt
    P[12] += q_height * dt
    P[18] += q_theta * dt
    P[24] += q_v * dt


@compiled
def update_position(x: Any, P: Any, z0: float, z1: float, z2: float, R0: float, R1: float, R2: float) -> None:
    """Fuse north, east, down, one after the other; a variance of 0 leaves that axis out."""
    for axis in range(3):
        R = R0 if axis == 0 else (R1 if axis == 1 else R2)
        if R <= 0.0:
            continue
        z = z0 if axis == 0 else (z1 if axis == 1 else z2)
        g = (P[axis], P[5 + axis], P[10 + axis], P[15 + axis], P[20 + axis])
        S = g[axis] + R
        y = z - x[axis]
        for i in range(5):
            k = g[i] / S
            x[i] += k * y
            for j in range(i + 1):
                value = P[5 * i + j] - k * g[j]
                P[5 * i + j] = value
                P[5 * j + i] = value


@dataclass(frozen=True, slots=True)
class UnicycleSettings:
    """Process noise as variance gained per second, and the gate of one component in standard deviations. `turn_gain_hz` is
    the share of theta's corrections that the turn rate takes up per second; 0 is the filter as printed. `unseen_turn_rad_s`:
    standard deviation of the turn rate that is added to what was learned while the platform is not seen."""

    position_psd: float = 1e-4
    height_psd: float = 0.01
    theta_psd: float = 0.05
    speed_psd: float = 0.2
    gate_sigmas: float = 3.29
    turn_gain_hz: float = 0.0
    unseen_turn_rad_s: float = 0.0


@dataclass(slots=True)
class UnicycleTrack:
    """State at `t_ns`. `start` has the sights (t_ns, north, east) as long as direction and speed are open, None afterwards."""

    settings: UnicycleSettings
    t_ns: int
    x: Any
    P: Any
    start: list[Sight] | None
    gates: dict[tuple[ObservationSource, str], AxisGate] = field(default_factory=dict)
    vision_ns: int | None = None
    beacon_ns: int | None = None
    turn_rad_s: float = 0.0

    def copied(self) -> UnicycleTrack:
        gates = {key: gate.copied() for key, gate in self.gates.items()}
        return UnicycleTrack(
            self.settings, self.t_ns, self.x.copy(), self.P.copy(), None if self.start is None else self.start.copy(),
            gates, self.vision_ns, self.beacon_ns, self.turn_rad_s,
        )  # fmt: skip

    def look_ahead(self, t_ns: int) -> None:
        self.advance(t_ns)

    def outlook(self, *, deck_only: bool) -> WholeOutlook:
        return WholeOutlook(self.copied())

    def advance(self, t_ns: int) -> None:
        if t_ns <= self.t_ns:
            return
        s = self.settings
        for dt_s in in_steps((t_ns - self.t_ns) / NS, LONGEST_STEP_S):
            u1, unseen_s = self.turn_now_rad_s, self._unseen_s() - UNSEEN_AFTER_S
            theta_psd = s.theta_psd + s.unseen_turn_rad_s**2 * max(0.0, 2.0 * unseen_s + dt_s)
            predict_unicycle(self.x, self.P, dt_s, u1, s.position_psd, s.height_psd, theta_psd, s.speed_psd)
            self.t_ns += round(dt_s * NS)
        self.t_ns = t_ns

    @property
    def turn_now_rad_s(self) -> float:
        """The learned turn rate, faded where it has not been seen for long."""
        faded_s = self._unseen_s() - TURN_KEPT_S
        return self.turn_rad_s if faded_s <= 0.0 else self.turn_rad_s * math.exp(-faded_s / TURN_FADES_S)

    def _unseen_s(self) -> float:
        seen_ns = max((ns for ns in (self.vision_ns, self.beacon_ns) if ns is not None), default=self.t_ns)
        return (self.t_ns - seen_ns) / NS

    def fuse(self, m: PadMeasurement) -> MeasurementVerdict:
        if m.position_o_m is None or m.covariance_m2 is None:
            if m.height_o_m is not None:
                return self._fuse_height(m, m.height_o_m, m.height_sigma_m**2)
            return MeasurementVerdict(
                m.t_ns, m.source, accepted=False, reason="this filter takes positions and ranges only"
            )
        variance = [m.covariance_m2[i][i] + 1e-4 + (m.bias_sigma_m**2 if m.source in BIASED else 0.0) for i in range(3)]
        if self.start is not None and m.source not in BIASED:
            return self._fuse_at_start(m, m.position_o_m, variance)
        y = [m.position_o_m[i] - float(self.x[i]) for i in range(3)]
        nis = sum(y[i] * y[i] / (float(self.P[6 * i]) + variance[i]) for i in range(3))
        limit2 = self.settings.gate_sigmas**2
        elsewhere = all(y[i] ** 2 > limit2 * (float(self.P[6 * i]) + variance[i]) for i in range(2))
        decisions = [self._judge(m, axis, y[axis], variance[axis], both_axes=elsewhere) for axis in range(3)]
        kept = [R if d is not Decision.REJECT else 0.0 for R, d in zip(variance, decisions, strict=True)]
        z, theta = m.position_o_m, float(self.x[3])
        update_position(self.x, self.P, z[0], z[1], z[2], kept[0], kept[1], kept[2])
        self._learn_turn(float(self.x[3]) - theta)
        self._note(m, any(kept))
        lost = [name for name, d in zip(AXES, decisions, strict=True) if d is Decision.REJECT]
        reason = "outside gate: " + ", ".join(lost) if lost else "fused"
        return MeasurementVerdict(m.t_ns, m.source, any(kept), reason, nis=nis, innovation=tuple(y))

    def _fuse_height(self, m: PadMeasurement, down_m: float, R: float) -> MeasurementVerdict:
        """The range sensor's distance to the deck, which the paper lands by."""
        y = down_m - float(self.x[2])
        S = float(self.P[12]) + R
        accepted = self._judge(m, 2, y, R) is not Decision.REJECT
        if accepted:
            update_position(self.x, self.P, 0.0, 0.0, down_m, 0.0, 0.0, R)
        reason = "fused" if accepted else "outside gate: down"
        return MeasurementVerdict(m.t_ns, m.source, accepted, reason, nis=y * y / S, innovation=(y,))

    def _judge(self, m: PadMeasurement, axis: int, y: float, R: float, *, both_axes: bool = False) -> Decision:
        gate = self.gates.setdefault((m.source, AXES[axis]), AxisGate())
        S = float(self.P[6 * axis]) + R
        limit = self.settings.gate_sigmas
        decision = judge(gate, t_ns=m.t_ns, y=y, S=S, R=R, limit=limit, both_axes=both_axes and axis < 2)
        if decision is Decision.REACQUIRE:
            self.P[6 * axis] += y * y
            self.P[18], self.P[24] = max(float(self.P[18]), 0.3), max(float(self.P[24]), 1.0)
            if both_axes and axis < 2:
                self.start, self.turn_rad_s, self.x[4], self.P[18] = [], 0.0, 0.0, 1.0
        return decision

    def _fuse_at_start(self, m: PadMeasurement, z: Vec3, variance: list[float]) -> MeasurementVerdict:
        """An EKF cannot start at an unknown direction: the place is that of the line through the sights, and as soon as the line
        says where the platform goes, direction and speed are its own."""
        self._fuse_height(m, z[2], variance[2])
        self.start = [old for old in self.start or [] if m.t_ns - old[0] <= START_WINDOW_NS] + [(m.t_ns, z[0], z[1])]
        line = fitted_line(self.start, max(variance[:2]) + m.systematic_sigma_m**2)
        for i in range(5):
            for j in range(5):
                if i != j and (i, j) != (3, 4) and (i, j) != (4, 3):
                    self.P[5 * i + j] = 0.0
        self.x[0], self.x[1] = (z[0], z[1]) if line is None else line.end_m
        self.P[0], self.P[6] = (variance[0], variance[1]) if line is None else (line.end_variance_m2,) * 2
        self._note(m, True)
        if line is not None and line.tells_direction:
            self.x[3], self.x[4] = math.atan2(line.velocity_m_s[1], line.velocity_m_s[0]), line.speed_m_s
            self.P[18] = max(0.1, 2.0 * line.velocity_variance / line.speed_m_s**2)
            self.P[24] = max(0.25, 2.0 * line.velocity_variance)
            self.P[19] = self.P[23] = 0.0
            self.start = None
        return MeasurementVerdict(m.t_ns, m.source, True, "fused: direction still open")

    def _learn_turn(self, corrected_rad: float) -> None:
        """u1 from how the measurements keep turning theta. A platform that hardly moves has no direction to turn."""
        if self.start is not None or float(self.x[4]) < MIN_SPEED_M_S:
            self.turn_rad_s = 0.0
            return
        speed2 = float(self.x[4]) ** 2
        gain_hz = self.settings.turn_gain_hz * speed2 / (speed2 + TURN_TOLD_FROM_M_S**2)
        learned = self.turn_rad_s + gain_hz * corrected_rad
        self.turn_rad_s = max(-MAX_TURN_RAD_S, min(MAX_TURN_RAD_S, learned))

    def _note(self, m: PadMeasurement, accepted: bool) -> None:
        if accepted and m.source in BIASED:
            self.beacon_ns = m.t_ns
        elif accepted:
            self.vision_ns = m.t_ns

    def estimate(self, name: str) -> PadEstimate:
        px, py, pz, theta, v = (float(value) for value in self.x)
        c, s = math.cos(theta), math.sin(theta)
        across = v * self.turn_now_rad_s
        return PadEstimate(
            t_ns=self.t_ns,
            position_ned_m=(px, py, pz),
            velocity_ned_m_s=(v * c, v * s, 0.0),
            acceleration_ned_m_s2=(-across * s, across * c, 0.0),
            yaw_rad=wrap_pi(theta),
            yaw_rate_rad_s=self.turn_now_rad_s,
            covariance=self._covariance(c, s, v),
            vision_age_s=None if self.vision_ns is None else (self.t_ns - self.vision_ns) / NS,
            beacon_age_s=None if self.beacon_ns is None else (self.t_ns - self.beacon_ns) / NS,
            model=name,
        )

    def _covariance(self, c: float, s: float, v: float) -> tuple[tuple[float, ...], ...]:
        """J P J' with the velocity as a function of theta and v."""
        J = [[float(i == j) for j in range(5)] for i in range(3)]
        J += [[0.0, 0.0, 0.0, -v * s, c], [0.0, 0.0, 0.0, v * c, s], [0.0] * 5]
        P = [[float(self.P[5 * i + j]) for j in range(5)] for i in range(5)]
        JP = [[sum(row[k] * P[k][j] for k in range(5)) for j in range(5)] for row in J]
        return tuple(tuple(sum(a[k] * b[k] for k in range(5)) for b in J) for a in JP)


@dataclass(frozen=True, slots=True)
class SightLine:
    """The straight line through the sights: its slope, its place at the last of them, variances of one component, and the way
    that it covers."""

    velocity_m_s: tuple[float, float]
    velocity_variance: float
    end_m: tuple[float, float]
    end_variance_m2: float
    seconds: float

    @property
    def speed_m_s(self) -> float:
        return math.hypot(*self.velocity_m_s)

    @property
    def tells_direction(self) -> bool:
        far_enough = self.speed_m_s * self.seconds >= START_WAY_M
        return far_enough and self.speed_m_s**2 >= START_SIGMAS**2 * self.velocity_variance


def fitted_line(sights: list[Sight], variance_m2: float) -> SightLine | None:
    """Least squares; None with fewer than START_SIGHTS. A sight's variance is the one given, or what they scatter about the
    line where that is more."""
    n = len(sights)
    if n < START_SIGHTS:
        return None
    t_s = [(t_ns - sights[0][0]) / NS for t_ns, _, _ in sights]
    mean_s, mean_n, mean_e = sum(t_s) / n, sum(s[1] for s in sights) / n, sum(s[2] for s in sights) / n
    rows = [(t - mean_s, s[1] - mean_n, s[2] - mean_e) for t, s in zip(t_s, sights, strict=True)]
    spread = sum(t * t for t, _, _ in rows)
    if spread <= 0.0:
        return None
    north, east = sum(t * x for t, x, _ in rows) / spread, sum(t * y for t, _, y in rows) / spread
    scatter = sum((x - t * north) ** 2 + (y - t * east) ** 2 for t, x, y in rows) / (2 * n - 4)
    variance, end_s = max(variance_m2, scatter), t_s[-1] - mean_s
    return SightLine(
        velocity_m_s=(north, east),
        velocity_variance=variance / spread,
        end_m=(mean_n + end_s * north, mean_e + end_s * east),
        end_variance_m2=variance / n + end_s**2 * variance / spread,
        seconds=t_s[-1],
    )


def start_unicycle(settings: UnicycleSettings, m: PadMeasurement) -> UnicycleTrack | None:
    """A track from a first position; a velocity, where the beacon gives one, sets the direction at once."""
    if m.position_o_m is None or m.covariance_m2 is None:
        return None
    P = [0.0] * 25
    for i in range(3):
        P[6 * i] = m.covariance_m2[i][i] + 1e-4 + (m.bias_sigma_m**2 if m.source in BIASED else 0.0)
    P[18], P[24] = 1.0, 1.0
    v = m.velocity_m_s
    known = v is not None and math.hypot(v[0], v[1]) > 0.5
    theta, speed = (math.atan2(v[1], v[0]), math.hypot(v[0], v[1])) if v is not None and known else (0.0, 0.0)
    track = UnicycleTrack(
        settings,
        m.t_ns,
        room([*m.position_o_m, theta, speed]),
        room(P),
        None if known else [(m.t_ns, m.position_o_m[0], m.position_o_m[1])],
    )
    track._note(m, True)
    return track
