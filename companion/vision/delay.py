"""A camera's delay from its turning: how the image rotates between frames against what the gyro says, shifted until they agree.

The turn from one frame to the next comes from features followed through the image (all as directions, so that any lens will
do). The gyro's turn is the integral of the body rates over the same interval, `delay` earlier. Slow parts are taken out of
both: flying past near ground looks like a slow turn. The delay is the shift at which the gyro explains most of the image.

Pure functions over arrays; times in seconds on one clock. Frames: C the camera, B the body (FRD).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from companion.messages import Image
from companion.vision.camera_model import Array, CameraModel

MIN_FEATURES = 12
MAX_FEATURES = 200
LONGEST_INTERVAL_S = 0.2
SLOW_S = 0.6
"""Variations slower than this are left out."""

EARLIEST_S, LATEST_S, STEP_S = -0.1, 0.6, 0.002
LEAST_RATE_RAD_S = 0.05
LEAST_CORRELATION = 0.8
LEAST_TURNS = 60
RIVAL_MARGIN = 0.05
"""A second peak so close to the first in correlation makes the answer ambiguous: the motion was too regular."""
RIVAL_DISTANCE_S = 0.06
LARGEST_SIGMA_S = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """Turns of the camera: (N,) frame times at begin and end, (N, 3) rotation vectors in B, rad."""

    begin_s: Array
    end_s: Array
    rotation_rad: Array


@dataclass(frozen=True, slots=True)
class DelayEstimate:
    """`delay_s` is how much later a frame is stamped than it was taken. `sigma_s` is its standard deviation,
    `correlation` 0 to 1 how much of the image's turning the gyro explains; `why_not` is empty where the answer may be used."""

    delay_s: float
    sigma_s: float
    correlation: float
    rate_rad_s: float
    turns: int
    why_not: str = ""


class ImageTurns:
    """Collects turns from frames as they come. State: the last frame."""

    def __init__(self, lens: CameraModel, R_BC: Array) -> None:
        self._lens = lens
        self._R_BC = R_BC
        self._last: tuple[float, Image] | None = None
        self._rows: list[tuple[float, float, Array]] = []

    def add(self, t_s: float, image: Image) -> bool:
        """Whether the turn since the last frame could be told. A frame of another size or out of order starts afresh."""
        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        last, self._last = self._last, (t_s, grey)
        if last is None or last[1].shape != grey.shape or not 0.0 < t_s - last[0] <= LONGEST_INTERVAL_S:
            return False
        rotation = turn_between(last[1], grey, self._lens)
        if rotation is None:
            return False
        self._rows.append((last[0], t_s, self._R_BC @ rotation))
        return True

    def turns(self) -> Turns:
        begin = np.array([row[0] for row in self._rows])
        end = np.array([row[1] for row in self._rows])
        return Turns(begin, end, np.array([row[2] for row in self._rows]).reshape(-1, 3))


def turn_between(before: Image, after: Image, lens: CameraModel) -> Array | None:
    """Rotation vector (3,) of the camera from one frame to the next, in C, rad; None where too little can be followed."""
    corners = cv2.goodFeaturesToTrack(before, MAX_FEATURES, 0.01, 12)
    if np.size(corners) < 2 * MIN_FEATURES:  # None where nothing stands out
        return None
    moved, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.empty(0), winSize=(21, 21), maxLevel=3)
    good = np.ravel(found) == 1
    if np.count_nonzero(good) < MIN_FEATURES:
        return None
    a = lens.ray(corners.reshape(-1, 2)[good].astype(np.float64))
    b = lens.ray(moved.reshape(-1, 2)[good].astype(np.float64))
    return _turn_of_rays(a, b)


def measure_delay(turns: Turns, gyro_t_s: Array, gyro_rad_s: Array) -> DelayEstimate:
    """The delay of the frames' stamps against the gyro's. (M,) times, rising, and (M, 3) body rates, rad/s."""
    inside = _covered(turns, gyro_t_s)
    count = int(np.count_nonzero(inside))
    if count < LEAST_TURNS:
        why = f"only {count} turns between frames lie within the gyro's record; {LEAST_TURNS} are needed"
        return DelayEstimate(0.0, float("inf"), 0.0, 0.0, count, why)
    begin, end = turns.begin_s[inside], turns.end_s[inside]
    interval = (end - begin)[:, None]
    slowness = max(3, round(SLOW_S / float(np.median(interval))) | 1)
    seen = _quick(turns.rotation_rad[inside] / interval, slowness)
    angle = _integral(gyro_t_s, gyro_rad_s)
    delays = np.arange(EARLIEST_S, LATEST_S + STEP_S / 2, STEP_S)
    felt = [_quick(_mean_rate(gyro_t_s, angle, begin - d, end - d), slowness) for d in delays]
    scores = np.array([_explained(seen, rates, _gains(seen, rates)) for rates in felt])
    signed = np.array([_explained(seen, rates, _signed_gains(seen, rates)) for rates in felt])
    best = int(np.argmax(scores))
    delay_s = float(delays[best]) + STEP_S * _parabola_top(scores, best)
    correlation = float(np.sqrt(scores[best]))
    rate = float(np.sqrt(np.mean(np.sum(felt[best] ** 2, axis=1))))
    sigma_s = _sigma(seen, felt, best)
    why = _why_not(scores, best, delays, rate, correlation, sigma_s)
    if not why and float(signed.max()) > float(scores[best]) + RIVAL_MARGIN:
        why = "the image turns against the gyro on some axis: is the camera mounted as mount_deg says?"
    return DelayEstimate(delay_s, sigma_s, correlation, rate, count, why)


def _turn_of_rays(a: Array, b: Array) -> Array | None:
    """The rotation of the camera that takes directions `a` to `b`, outliers dropped three times."""
    kept = np.ones(len(a), bool)
    R = np.eye(3)
    for _ in range(4):
        if np.count_nonzero(kept) < MIN_FEATURES:
            return None
        U, _, Vt = np.linalg.svd(b[kept].T @ a[kept])
        R = U @ np.diag([1.0, 1.0, float(np.linalg.det(U @ Vt))]) @ Vt
        error = np.linalg.norm(b - a @ R.T, axis=1)
        kept = error <= max(3.0 * float(np.median(error[kept])), 1e-4)
    # The scene's directions turn against the camera.
    return -np.asarray(cv2.Rodrigues(R)[0], np.float64).ravel()


def _covered(turns: Turns, gyro_t_s: Array) -> npt.NDArray[np.bool_]:
    """Turns for which every delay can be tried."""
    if len(gyro_t_s) < 2:
        return np.zeros(len(turns.begin_s), bool)
    return np.asarray((turns.begin_s - LATEST_S >= gyro_t_s[0]) & (turns.end_s - EARLIEST_S <= gyro_t_s[-1]), np.bool_)


def _integral(t_s: Array, rates: Array) -> Array:
    """(M, 3) trapezoids: the angle turned since the first sample. Small angles between frames make the axes independent."""
    steps = np.diff(t_s)[:, None] * (rates[1:] + rates[:-1]) / 2.0
    return np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


def _mean_rate(t_s: Array, angle: Array, begin: Array, end: Array) -> Array:
    """(N, 3) mean rate over each interval."""
    turned = [np.interp(end, t_s, angle[:, k]) - np.interp(begin, t_s, angle[:, k]) for k in range(3)]
    return np.stack(turned, axis=1) / (end - begin)[:, None]


def _quick(rates: Array, window: int) -> Array:
    """Less a running mean of `window` samples."""
    kernel = np.ones(window)
    weight = np.convolve(np.ones(len(rates)), kernel, "same")
    slow = np.stack([np.convolve(rates[:, k], kernel, "same") / weight for k in range(3)], axis=1)
    return np.asarray(rates - slow)


def _gains(seen: Array, felt: Array) -> Array:
    """(3,) how much of the gyro each axis shows: near ground weakens it, but never turns it round."""
    return np.maximum(0.0, _signed_gains(seen, felt))


def _signed_gains(seen: Array, felt: Array) -> Array:
    power = np.maximum(np.sum(felt * felt, axis=0), 1e-12)
    return np.asarray(np.sum(seen * felt, axis=0) / power)


def _explained(seen: Array, felt: Array, gains: Array) -> float:
    """Share of the seen turning's variance that the gyro explains with these gains."""
    total = max(float(np.sum(seen * seen)), 1e-12)
    return float(np.sum(gains**2 * np.sum(felt * felt, axis=0))) / total


def _parabola_top(scores: Array, best: int) -> float:
    """Where between its neighbours the top lies, in steps."""
    if not 0 < best < len(scores) - 1:
        return 0.0
    left, middle, right = (float(scores[best + k]) for k in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    return 0.0 if bend >= 0.0 else float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5))


def _sigma(seen: Array, felt: list[Array], best: int) -> float:
    """Linearised: what is left unexplained over how fast the prediction changes with the delay."""
    if not 0 < best < len(felt) - 1:
        return float("inf")
    gains = _gains(seen, felt[best])
    slope = gains * (felt[best + 1] - felt[best - 1]) / (2.0 * STEP_S)
    rest = seen - gains * felt[best]
    information = float(np.sum(slope * slope)) / max(float(np.mean(rest * rest)), 1e-12)
    return float(information**-0.5) if information > 0.0 else float("inf")


def _why_not(scores: Array, best: int, delays: Array, rate: float, correlation: float, sigma_s: float) -> str:
    if rate < LEAST_RATE_RAD_S:
        return f"the vehicle hardly turned ({rate:.3f} rad/s): turn it to and fro, irregularly, for ten seconds"
    if best in (0, len(delays) - 1):
        return f"no peak within {EARLIEST_S:g} to {LATEST_S:g} s: are both on the same clock?"
    if correlation < LEAST_CORRELATION:
        return f"the gyro explains too little of what the image shows (correlation {correlation:.2f}): lens, mount, or scene"
    far = np.abs(delays - delays[best]) > RIVAL_DISTANCE_S
    if float(np.sqrt(scores[far].max(initial=0.0))) > correlation - RIVAL_MARGIN:
        return "another delay fits nearly as well: the motion was too regular"
    if sigma_s > LARGEST_SIGMA_S:
        return f"uncertain by {1000 * sigma_s:.0f} ms: record longer, turn faster"
    return ""
