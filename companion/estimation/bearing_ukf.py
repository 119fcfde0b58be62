"""Pad from bearings alone, with the camera's attitude as uncertain as it is: the unscented filter of Kim et al.

    x = (px, py, vx, vy)  pad in O, constant velocity;  three angles of the camera's attitude enter as states without memory

The paper's state is relative to the camera and takes the camera's velocity change as an input; frame O, which moves with the
vehicle's own velocity, is the same thing written once for all filters. A bearing is compared on the plane across the measured
direction, so that a fisheye that looks sideways or backwards has no singular place. The height of the pad comes from the range
sensor, else from `ground_down_m`. Compiled with the extra `fast`. Chosen by `estimator = "bearing_ukf"`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from companion.compiled import compiled, room
from companion.estimation.gate import NS, AxisGate, Decision, judge
from companion.estimation.measurement import CameraPose, PadMeasurement
from companion.estimation.outlook import WholeOutlook
from companion.estimation.vertical import LevelGround, State
from companion.geometry import cross, norm, scale
from companion.messages import MeasurementVerdict, PadEstimate, Vec3

SHALLOW = 0.05
GROUND = LevelGround()


@compiled
def predict_constant_velocity(x: Any, P: Any, dt: float, q: float) -> None:
    """Mean and 4 x 4 covariance by dt, in place; q: variance that a velocity component gains per second."""
    for i in range(2):
        x[i] += dt * x[2 + i]
    for j in range(4):
        P[j] += dt * P[8 + j]
        P[4 + j] += dt * P[12 + j]
    for i in range(4):
        P[4 * i] += dt * P[4 * i + 2]
        P[4 * i + 1] += dt * P[4 * i + 3]
    for i in range(2):
        P[5 * i] += q * dt * dt * dt / 3.0
        P[5 * i + 2] += q * dt * dt / 2.0
        P[5 * i + 8] += q * dt * dt / 2.0
        P[5 * i + 10] += q * dt


@compiled
def update_bearing(
    x: Any,
    P: Any,
    L: Any,
    Z: Any,
    S: Any,
    c: Any,
    E: Any,
    down: float,
    tilt: float,
    yaw: float,
    R: float,
    limit2: float,
) -> float:
    """Unscented update: two points for each of seven uncertain numbers, all of equal weight. Returns the NIS; where that is above `limit2`, or P has lost its root, x and P are left alone.

    `c` is p_OC, `E` the two directions across the bearing, written in O (6 floats), `down` the pad's height in O, `tilt` and
    `yaw` standard deviations of the attitude about level axes and about the vertical, R the variance of the bearing. Room: L 16,
    Z 28, S 24 (means, innovation covariance, cross covariance, gain). S[0], S[1] hold the innovation at return.
    """
    for i in range(16):
        L[i] = 0.0
    for i in range(4):
        for j in range(i + 1):
            total = P[4 * i + j]
            for k in range(j):
                total -= L[4 * i + k] * L[4 * j + k]
            if i == j:
                if total <= 0.0:
                    return -1.0
                L[5 * i] = math.sqrt(total)
            else:
                L[4 * i + j] = total / L[5 * j]
    root = math.sqrt(7.0)
    for point in range(14):
        k, sign = point % 7, (root if point < 7 else -root)
        px, py = x[0] - c[0], x[1] - c[1]
        pz = down - c[2]
        ax = ay = az = 0.0
        if k < 4:
            px += sign * L[k]
            py += sign * L[4 + k]
        elif k == 4:
            ax = sign * tilt
        elif k == 5:
            ay = sign * tilt
        else:
            az = sign * yaw
        dx, dy, dz = px + ay * pz - az * py, py + az * px - ax * pz, pz + ax * py - ay * px
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        Z[2 * point] = (E[0] * dx + E[1] * dy + E[2] * dz) / length
        Z[2 * point + 1] = (E[3] * dx + E[4] * dy + E[5] * dz) / length
    for i in range(24):
        S[i] = 0.0
    for point in range(14):
        S[0] += Z[2 * point] / 14.0
        S[1] += Z[2 * point + 1] / 14.0
    for point in range(14):
        a, b = Z[2 * point] - S[0], Z[2 * point + 1] - S[1]
        S[2] += a * a / 14.0
        S[3] += a * b / 14.0
        S[4] += b * b / 14.0
        k, sign = point % 7, (root if point < 7 else -root)
        if k < 4:
            for i in range(4):
                S[5 + 2 * i] += sign * L[4 * i + k] * a / 14.0
                S[6 + 2 * i] += sign * L[4 * i + k] * b / 14.0
    S[2] += R
    S[4] += R
    det = S[2] * S[4] - S[3] * S[3]
    y0, y1 = -S[0], -S[1]
    nis = (y0 * y0 * S[4] - 2.0 * y0 * y1 * S[3] + y1 * y1 * S[2]) / det
    S[0], S[1] = y0, y1
    if nis > limit2:
        return float(nis)
    for i in range(4):
        C0, C1 = S[5 + 2 * i], S[6 + 2 * i]
        S[13 + 2 * i] = (C0 * S[4] - C1 * S[3]) / det
        S[14 + 2 * i] = (C1 * S[2] - C0 * S[3]) / det
        x[i] += S[13 + 2 * i] * y0 + S[14 + 2 * i] * y1
    for i in range(4):
        for j in range(i + 1):
            value = P[4 * i + j] - S[13 + 2 * i] * S[5 + 2 * j] - S[14 + 2 * i] * S[6 + 2 * j]
            P[4 * i + j] = value
            P[4 * j + i] = value
    return float(nis)


@dataclass(frozen=True, slots=True)
class BearingSettings:
    """`acceleration_psd` (m^2/s^3): wander of the velocity. Attitude sigmas are the vehicle's attitude error."""

    acceleration_psd: float = 0.02
    tilt_sigma_rad: float = math.radians(1.2)
    yaw_sigma_rad: float = math.radians(3.0)
    ground_down_m: float = 0.0
    ground_sigma_m: float = 0.5
    initial_speed_m_s: float = 3.0
    gate_nis: float = 13.8
    lost_after: int = 15
    """Bearings refused in a row after which the filter starts anew from the bearing at hand."""


@dataclass(slots=True)
class BearingTrack:
    """State at `t_ns`."""

    settings: BearingSettings
    t_ns: int
    x: Any
    P: Any
    height: State
    refused: int = 0
    vision_ns: int | None = None
    height_gate: AxisGate = field(default_factory=AxisGate)

    def copied(self) -> BearingTrack:
        return BearingTrack(
            self.settings, self.t_ns, self.x.copy(), self.P.copy(), GROUND.copied(self.height), self.refused,
            self.vision_ns, self.height_gate.copied(),
        )  # fmt: skip

    def look_ahead(self, t_ns: int) -> None:
        self.advance(t_ns)

    def outlook(self, *, deck_only: bool) -> WholeOutlook:
        return WholeOutlook(self.copied())

    def advance(self, t_ns: int) -> None:
        dt_s = (t_ns - self.t_ns) / NS
        if dt_s > 0.0:
            predict_constant_velocity(self.x, self.P, dt_s, self.settings.acceleration_psd)
            GROUND.predict(self.height, dt_s)
            self.t_ns = t_ns

    def fuse(self, m: PadMeasurement) -> MeasurementVerdict:
        if m.bearing_o is not None and m.camera is not None:
            return self._fuse_bearing(m, m.bearing_o, m.camera)
        if m.height_o_m is not None:
            return self._fuse_height(m, m.height_o_m)
        return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="this filter takes bearings and ranges only")

    def _fuse_bearing(self, m: PadMeasurement, bearing_o: Vec3, camera: CameraPose) -> MeasurementVerdict:
        s, S = self.settings, room([0.0] * 24)
        across = _across(bearing_o)
        nis = float(
            update_bearing(
                self.x, self.P, room([0.0] * 16), room([0.0] * 28), S, room(list(camera.position_o_m)), room(list(across)),
                self.height[0][0], s.tilt_sigma_rad, s.yaw_sigma_rad, m.bearing_sigma_rad**2, s.gate_nis,
            )
        )  # fmt: skip
        accepted = 0.0 <= nis <= s.gate_nis
        self.refused = 0 if accepted else self.refused + 1
        if accepted:
            self.vision_ns = m.t_ns
        elif self.refused >= s.lost_after:
            return self._start_anew(m)
        reason = "fused" if accepted else ("covariance lost" if nis < 0.0 else "outside gate: bearing")
        innovation = (float(S[0]), float(S[1]))
        return MeasurementVerdict(m.t_ns, m.source, accepted, reason, nis=nis, innovation=innovation)

    def _start_anew(self, m: PadMeasurement) -> MeasurementVerdict:
        fresh = start_bearing(self.settings, m, down_m=self.height[0][0])
        if fresh is None:
            return MeasurementVerdict(m.t_ns, m.source, accepted=False, reason="bearing does not meet the ground")
        self.x, self.P, self.refused, self.vision_ns = fresh.x, fresh.P, 0, m.t_ns
        return MeasurementVerdict(m.t_ns, m.source, accepted=True, reason="started anew")

    def _fuse_height(self, m: PadMeasurement, down_m: float) -> MeasurementVerdict:
        R = m.height_sigma_m**2
        y, S = GROUND.innovation(self.height, down_m, R, biased=False)
        decision = judge(self.height_gate, t_ns=m.t_ns, y=y, S=S, R=R, limit=math.sqrt(self.settings.gate_nis))
        if decision is Decision.REACQUIRE:
            GROUND.distrust(self.height, y * y, biased=False)
        if decision is not Decision.REJECT:
            GROUND.update(self.height, down_m, R, biased=False)
        accepted = decision is not Decision.REJECT
        reason = "fused" if accepted else "outside gate: down"
        return MeasurementVerdict(m.t_ns, m.source, accepted, reason, nis=y * y / S, innovation=(y,))

    def estimate(self, name: str) -> PadEstimate:
        px, py, vx, vy = (float(value) for value in self.x)
        deck = GROUND.view(self.height)
        rows = [[0.0] * 6 for _ in range(6)]
        for i, a in enumerate((0, 1, 3, 4)):
            for j, b in enumerate((0, 1, 3, 4)):
                rows[a][b] = float(self.P[4 * i + j])
        rows[2][2], rows[5][5], rows[2][5], rows[5][2] = (
            deck.variance_m2, deck.rate_variance, deck.covariance, deck.covariance,
        )  # fmt: skip
        return PadEstimate(
            t_ns=self.t_ns,
            position_ned_m=(px, py, deck.z_m),
            velocity_ned_m_s=(vx, vy, deck.rate_m_s),
            acceleration_ned_m_s2=(0.0, 0.0, 0.0),
            yaw_rad=math.atan2(vy, vx),
            yaw_rate_rad_s=0.0,
            covariance=tuple(tuple(row) for row in rows),
            vision_age_s=None if self.vision_ns is None else (self.t_ns - self.vision_ns) / NS,
            beacon_age_s=None,
            model=name,
        )


def _across(bearing: Vec3) -> tuple[float, ...]:
    """Two unit vectors across a unit vector, as six floats."""
    helper = (1.0, 0.0, 0.0) if abs(bearing[0]) < 0.7 else (0.0, 1.0, 0.0)
    first = cross(bearing, helper)
    first = scale(first, 1.0 / norm(first))
    return (*first, *cross(bearing, first))


def start_bearing(settings: BearingSettings, m: PadMeasurement, *, down_m: float | None = None) -> BearingTrack | None:
    """A track where the first bearing meets the ground; None where it does not, or where `m` is no bearing."""
    if m.bearing_o is None or m.camera is None:
        return None
    down = settings.ground_down_m if down_m is None else down_m
    c, (dx, dy, dz) = m.camera.position_o_m, m.bearing_o
    drop = down - c[2]
    if dz < SHALLOW or drop <= 0.0:
        return None
    distance = drop / dz
    sigma = distance * math.hypot(m.bearing_sigma_rad, settings.tilt_sigma_rad) / dz + settings.ground_sigma_m / dz
    P = [0.0] * 16
    P[0] = P[5] = sigma * sigma
    P[10] = P[15] = settings.initial_speed_m_s**2
    x = [c[0] + distance * dx, c[1] + distance * dy, 0.0, 0.0]
    height = GROUND.start(down, settings.ground_sigma_m**2, 0.0)
    return BearingTrack(settings, m.t_ns, room(x), room(P), height, vision_ns=m.t_ns)
