"""Where the vehicle was when an image was taken, in two frames.

W is the autopilot's local NED. Its velocity carries a slowly varying error of 0.2 to 0.4 m/s, its position is corrected for that
all the time by GNSS, and now and then stepped or reset by metres. O is the odometric frame: equal to W at the first sample, afterwards
moved by the integral of the autopilot's velocity and of what GNSS slowly corrects, but never by a step. On the recorded flights the
corrections are the velocity error with its sign turned (correlation 0.9), so O drifts by 0.15 m in 2 s where the velocity alone drifts
by 0.46 m (benchmarks/frame_drift.py): a pad's velocity in O is nearly the one over ground.

`offset` is p_WO: a point in W is the point in O plus the offset of that moment. The vehicle flies the autopilot's velocity, error
included, so what is told of the pad in W has that error too and it cancels in the command: `VehiclePose.correction_m_s` is the
difference. Called by the pad tracker.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

from companion.geometry import (
    ZERO,
    add,
    norm,
    quaternion_multiply,
    quaternion_normalized,
    scale,
    slerp,
    subtract,
)
from companion.messages import Quaternion, Vec3, VehicleState

NS = 1_000_000_000
MAX_GAP_S = 0.5
"""Over a longer gap in the stream the velocity is not known well enough to integrate: the position step is used."""
CORRECTION_TIME_S = 0.2
"""Over this time the rate of the autopilot's corrections is smoothed."""
FASTEST_CORRECTION_M_S = 1.5
"""Faster than a velocity error can be: a step of the position estimate, which O does not follow (recorded velocity errors reach
0.9 m/s)."""


@dataclass(frozen=True, slots=True)
class VehiclePose:
    """The vehicle at one instant. `position_o_m` is p_OB, `offset_m` is p_WO, both NED axes. In O the vehicle moves with
    `velocity_ned_m_s`, which is the autopilot's, plus `correction_m_s`."""

    t_ns: int
    position_o_m: Vec3
    offset_m: Vec3
    velocity_ned_m_s: Vec3
    q_ned_frd: Quaternion
    angular_velocity_frd_rad_s: Vec3
    correction_m_s: Vec3 = ZERO

    @property
    def position_ned_m(self) -> Vec3:
        """p_WB as the autopilot sees it."""
        return add(self.position_o_m, self.offset_m)


@dataclass(frozen=True, slots=True)
class VehicleReset:
    """The autopilot's estimator jumped. In O neither place nor velocity of the pad does."""

    t_ns: int
    velocity_step_m_s: Vec3
    position_step_m: Vec3


class VehicleHistory:
    """Ring of vehicle poses over the last `history_s` seconds."""

    def __init__(self, history_s: float, *, max_extrapolation_s: float = 0.3) -> None:
        self._history_ns = int(history_s * NS)
        self._ahead_ns = int(max_extrapolation_s * NS)
        self._poses: deque[VehiclePose] = deque()
        self._reset_counter: int | None = None

    @property
    def latest(self) -> VehiclePose | None:
        return self._poses[-1] if self._poses else None

    def add(self, state: VehicleState) -> VehicleReset | None:
        """Take one sample; the reset it reveals, if any. Samples that are not newer than the last are ignored."""
        last = self.latest
        if last is None:
            self._append(_pose(state, state.position_ned_m, ZERO))
            self._reset_counter = state.reset_counter
            return None
        if state.t_ns <= last.t_ns:
            return None
        reset = self._reset(last, state) if state.reset_counter != self._reset_counter else None
        self._reset_counter = state.reset_counter
        self._append(_advanced(last, state, reset, begins=len(self._poses) == 1))
        return reset

    def at(self, t_ns: int) -> VehiclePose | None:
        """The pose at `t_ns`: between two samples interpolated, up to `max_extrapolation_s` after the last continued,
        None outside."""
        poses = self._poses
        if not poses or t_ns < poses[0].t_ns or t_ns > poses[-1].t_ns + self._ahead_ns:
            return None
        if t_ns >= poses[-1].t_ns:
            return _continued(poses[-1], t_ns)
        index = bisect_right(poses, t_ns, key=lambda pose: pose.t_ns)
        return _between(poses[index - 1], poses[index], t_ns)

    def _append(self, pose: VehiclePose) -> None:
        self._poses.append(pose)
        while self._poses[0].t_ns < pose.t_ns - self._history_ns:
            self._poses.popleft()

    def _reset(self, last: VehiclePose, state: VehicleState) -> VehicleReset:
        expected = _continued(last, state.t_ns)
        return VehicleReset(
            t_ns=state.t_ns,
            velocity_step_m_s=subtract(state.velocity_ned_m_s, self._expected_velocity(last, state.t_ns)),
            position_step_m=subtract(state.position_ned_m, expected.position_ned_m),
        )

    def _expected_velocity(self, last: VehiclePose, t_ns: int) -> Vec3:
        """Velocity continued with the last acceleration, so that a manoeuvre is not taken for a reset."""
        if len(self._poses) < 2:
            return last.velocity_ned_m_s
        before = self._poses[-2]
        fraction = (t_ns - last.t_ns) / (last.t_ns - before.t_ns)
        step = subtract(last.velocity_ned_m_s, before.velocity_ned_m_s)
        return add(last.velocity_ned_m_s, scale(step, min(fraction, 3.0)))


def _advanced(last: VehiclePose, state: VehicleState, reset: VehicleReset | None, *, begins: bool) -> VehiclePose:
    """One sample on. The interval before a reset was flown with the velocity, and the correction, of before the reset. What the first
    interval shows of the correction is taken whole."""
    dt_s = (state.t_ns - last.t_ns) / NS
    if dt_s > MAX_GAP_S and reset is None:
        step = subtract(state.position_ned_m, last.position_ned_m)
        return _pose(state, add(last.position_o_m, step), last.correction_m_s)
    step = ZERO if reset is None else reset.velocity_step_m_s
    mean = scale(add(last.velocity_ned_m_s, subtract(state.velocity_ned_m_s, step)), 0.5)
    moved = scale(subtract(state.position_ned_m, last.position_ned_m), 1.0 / dt_s)
    share = 1.0 if begins else 1.0 - math.exp(-dt_s / CORRECTION_TIME_S)
    correction = last.correction_m_s if reset else _smoothed(last.correction_m_s, subtract(moved, mean), share)
    position_o_m = add(last.position_o_m, scale(add(mean, correction), dt_s))
    return _pose(state, position_o_m, subtract(correction, step))


def _smoothed(correction_m_s: Vec3, seen_m_s: Vec3, share: float) -> Vec3:
    """The correction that goes on, towards what this sample shows of it; an axis that stepped shows nothing."""
    north, east, down = (
        old + share * (seen - old) if abs(seen) < FASTEST_CORRECTION_M_S else old
        for old, seen in zip(correction_m_s, seen_m_s, strict=True)
    )
    return north, east, down


def _pose(state: VehicleState, position_o_m: Vec3, correction_m_s: Vec3) -> VehiclePose:
    return VehiclePose(
        t_ns=state.t_ns,
        position_o_m=position_o_m,
        offset_m=subtract(state.position_ned_m, position_o_m),
        velocity_ned_m_s=state.velocity_ned_m_s,
        q_ned_frd=state.q_ned_frd,
        angular_velocity_frd_rad_s=state.angular_velocity_frd_rad_s,
        correction_m_s=correction_m_s,
    )


def _continued(pose: VehiclePose, t_ns: int) -> VehiclePose:
    """Constant velocity and constant body rates from `pose`; in W the vehicle moves as the autopilot's velocity says."""
    dt_s = (t_ns - pose.t_ns) / NS
    corrected = scale(pose.correction_m_s, dt_s)
    return VehiclePose(
        t_ns=t_ns,
        position_o_m=add(pose.position_o_m, add(scale(pose.velocity_ned_m_s, dt_s), corrected)),
        offset_m=subtract(pose.offset_m, corrected),
        velocity_ned_m_s=pose.velocity_ned_m_s,
        q_ned_frd=_turned(pose.q_ned_frd, pose.angular_velocity_frd_rad_s, dt_s),
        angular_velocity_frd_rad_s=pose.angular_velocity_frd_rad_s,
        correction_m_s=pose.correction_m_s,
    )


def _turned(q: Quaternion, rates_frd_rad_s: Vec3, dt_s: float) -> Quaternion:
    """q after dt_s with constant body rates; the half angle is small enough for the first order."""
    half = scale(rates_frd_rad_s, 0.5 * dt_s)
    if norm(half) == 0.0:
        return q
    return quaternion_normalized(quaternion_multiply(q, (1.0, half[0], half[1], half[2])))


def _between(a: VehiclePose, b: VehiclePose, t_ns: int) -> VehiclePose:
    fraction = (t_ns - a.t_ns) / (b.t_ns - a.t_ns)
    return VehiclePose(
        t_ns=t_ns,
        position_o_m=_mix(a.position_o_m, b.position_o_m, fraction),
        offset_m=_mix(a.offset_m, b.offset_m, fraction),
        velocity_ned_m_s=_mix(a.velocity_ned_m_s, b.velocity_ned_m_s, fraction),
        q_ned_frd=slerp(a.q_ned_frd, b.q_ned_frd, fraction),
        angular_velocity_frd_rad_s=_mix(a.angular_velocity_frd_rad_s, b.angular_velocity_frd_rad_s, fraction),
        correction_m_s=_mix(a.correction_m_s, b.correction_m_s, fraction),
    )


def _mix(a: Vec3, b: Vec3, fraction: float) -> Vec3:
    return add(a, scale(subtract(b, a), fraction))
