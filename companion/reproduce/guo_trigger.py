"""The event trigger of `guo` by its law as printed: many landings in the plane with the gains, which it does not print, drawn.

A vehicle that answers as PX4 does (MPC_XY_P, MPC_XY_VEL_P_ACC, MC_YAW_P) before an upright marker. A picture every 40 ms gives the
pose of the marker by PnP from four corners with noise, as in the paper the first of the two that explain them; both PIDs work on
that and nothing else. The ranges of the draws are what its text lets through: it trails a boat of 0.4 m/s by 2.2 m, flies 5 m
in 13 s at 0.6 m/s on average, turns by 15 degrees in 3 s. Pad frame (x ahead, y right), SI, angles in rad. Called by guo.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from companion.control.limits import clipped
from companion.control.yaw import BOX_AHEAD_M, BOX_BEHIND_M, BOX_HALF_ACROSS_M
from companion.reproduce.row import Row, number_row

STEP_S = 0.02
STEPS_A_FRAME = 2
TOO_LONG_S = 60.0
STANDOFF_M, HALF_SIDE_M = 0.75, 0.2
FOCAL_PX = 422.27
CORNER_SIGMA_PX = 0.3
"""Of a corner as OpenCV's detectors find it."""
POSITION_HZ, VELOCITY_HZ, YAW_HZ, YAW_LAG_S = 0.95, 1.8, 2.8, 0.15
SETTLED_S = 0.5
SQUARE = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)], dtype=np.float64) * HALF_SIDE_M
LENS = np.array([(FOCAL_PX, 0.0, 0.0), (0.0, FOCAL_PX, 0.0), (0.0, 0.0, 1.0)])


@dataclass(frozen=True, slots=True)
class Draw:
    """What the paper does not print, and one start."""

    gain: float
    damping: float
    yaw_gain: float
    forward_limit_m: float
    sideways_limit_m: float
    delay_s: float
    start_y_m: float
    start_yaw_rad: float
    close_m: float
    close_rad: float


def drawn(rng: np.random.Generator) -> Draw:
    degrees = math.radians
    return Draw(
        gain=rng.uniform(0.2, 0.5),
        damping=rng.uniform(0.0, 0.5),
        yaw_gain=rng.uniform(0.25, 0.6),
        forward_limit_m=rng.uniform(0.55, 0.8),
        sideways_limit_m=rng.uniform(0.3, 0.8),
        delay_s=rng.uniform(0.05, 0.3),
        start_y_m=rng.uniform(-1.0, 1.0),
        start_yaw_rad=rng.uniform(degrees(-15.0), degrees(15.0)),
        close_m=rng.uniform(0.05, 0.15),
        close_rad=rng.uniform(degrees(3.0), degrees(8.0)),
    )


def seen(x_m: float, y_m: float, yaw_rad: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Forward and sideways error (m) and the yaw error (rad), from one picture at that place."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    ahead, right = STANDOFF_M - x_m, SQUARE[:, 0] - y_m
    depth = c * ahead + s * right
    pixels = FOCAL_PX * np.column_stack(((c * right - s * ahead) / depth, -SQUARE[:, 1] / depth))
    pixels += rng.normal(0.0, CORNER_SIGMA_PX, pixels.shape)
    _, turn, place = cv2.solvePnP(SQUARE, pixels, LENS, np.zeros(4), flags=cv2.SOLVEPNP_IPPE_SQUARE)
    towards: Any = cv2.Rodrigues(turn)[0][:, 2]
    return float(place[2, 0]) - STANDOFF_M, float(place[0, 0]), math.atan2(-towards[0], -towards[2])


def landing_s(draw: Draw, *, triggered: bool, seed: int) -> float:
    """From 5 m behind until the pose has been close for SETTLED_S; TOO_LONG_S where it never is."""
    rng = np.random.default_rng(seed)
    place, speed = np.array([STANDOFF_M - 5.0, draw.start_y_m]), np.zeros(2)
    yaw = wanted_yaw = draw.start_yaw_rad
    yaw_rate, close_s = 0.0, 0.0
    output, before = np.zeros(2), None
    past = [(place[0], place[1], yaw)] * max(1, round(draw.delay_s / STEP_S))
    for step in range(round(TOO_LONG_S / STEP_S)):
        past = [*past[1:], (place[0], place[1], yaw)]
        if step % STEPS_A_FRAME == 0:
            forward, right, turn = seen(*past[0], rng)
            error = np.array([forward, right])
            rate = np.zeros(2) if before is None else (error - before) / (STEPS_A_FRAME * STEP_S)
            before = error
            wanted = draw.gain * error + draw.damping * rate
            output = np.array([clipped(wanted[0], draw.forward_limit_m), clipped(wanted[1], draw.sideways_limit_m)])
            if not triggered or (-BOX_BEHIND_M <= -forward <= BOX_AHEAD_M and abs(right) <= BOX_HALF_ACROSS_M):
                wanted_yaw = yaw + draw.yaw_gain * turn
            is_close = math.hypot(forward, right) < draw.close_m and abs(turn) < draw.close_rad
            close_s = close_s + STEPS_A_FRAME * STEP_S if is_close else 0.0
            if close_s >= SETTLED_S:
                return step * STEP_S
        yaw_rate += STEP_S / YAW_LAG_S * (YAW_HZ * (wanted_yaw - yaw) - yaw_rate)
        yaw += yaw_rate * STEP_S
        c, s = math.cos(wanted_yaw), math.sin(wanted_yaw)
        asked = POSITION_HZ * np.array([c * output[0] - s * output[1], s * output[0] + c * output[1]])
        speed = speed + VELOCITY_HZ * (asked - speed) * STEP_S
        place = place + speed * STEP_S
    return TOO_LONG_S


def trigger_rows(quick: bool) -> list[Row]:
    """Quick: 6 draws. Full: 100."""
    count = 6 if quick else 100
    rng = np.random.default_rng(1)
    draws = [drawn(rng) for _ in range(count)]
    on, off = (
        np.array([landing_s(draw, triggered=triggered, seed=k) for k, draw in enumerate(draws)])
        for triggered in (True, False)
    )
    ratios = on / off
    low, middle, high = (float(value) for value in np.quantile(ratios, (0.05, 0.5, 0.95)))
    table = f"Event trigger by the printed law, in the plane ({count} draws of gains, delay, start)"
    few = int((ratios <= 0.6).sum())
    return [
        number_row(table, "landing with it, median", 18.0, round(float(np.median(on)), 1), "s", 5.0, good=-1),
        number_row(table, "landing without it, median", 30.0, round(float(np.median(off)), 1), "s", 5.0, good=-1),
        number_row(table, "with over without, median", 0.6, round(middle, 2), "", 0.05, good=-1),
        Row(
            table, "with over without, 5 to 95 % of the draws", None, f"{low:.2f} to {high:.2f}", "", "", "not printed"
        ),
        Row(table, "draws at 0.6 or less", None, f"{few} of {count}", "", "", "not printed"),
    ]
