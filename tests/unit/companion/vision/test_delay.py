"""The delay that was put in comes out, and what cannot be measured is said to be so."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
import pytest

from companion.vision.delay import DelayEstimate, ImageTurns, Turns, measure_delay, turn_between
from companion.vision.pinhole import Pinhole

F, WIDTH, HEIGHT = 200.0, 320, 240
LENS = Pinhole(WIDTH, HEIGHT, F, F, 159.5, 119.5)
DOWN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_BC of the default mount."""


def scene(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    texture = np.zeros((900, 900), np.float32)
    for cell in (4, 9, 25):
        coarse = rng.normal(0.0, 35.0, (900 // cell + 2, 900 // cell + 2)).astype(np.float32)
        texture += cv2.resize(coarse, (900, 900), interpolation=cv2.INTER_CUBIC)
    return np.clip(texture + 120.0, 0, 255).astype(np.uint8)


TEXTURE = scene(3)


def seen(R_CW: Any, rng: np.random.Generator) -> Any:
    """The far scene (at infinity, straight ahead of R = I) as the turned camera sees it."""
    K = np.array([[F, 0.0, 159.5], [0.0, F, 119.5], [0.0, 0.0, 1.0]])
    sheet = np.array([[F, 0.0, 449.5], [0.0, F, 449.5], [0.0, 0.0, 1.0]])
    image = cv2.warpPerspective(TEXTURE, K @ R_CW @ np.linalg.inv(sheet), (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
    return np.clip(image + rng.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)


@functools.cache
def recorded(duration_s: float, size_rad: float, regular: bool) -> tuple[Turns, Any, Any]:
    """Frames at 30 Hz from t = 1 s on, gyro at 50 Hz from t = 0 with noise and bias."""
    rng = np.random.default_rng(1)
    hz = np.array([1.0] * 3) if regular else np.array([0.7, 1.3, 2.1])
    phase = rng.uniform(0.0, 6.28, (3, 3))
    size = size_rad * np.array([1.0, 0.7, 0.5])

    def angles(t: float) -> Any:
        return np.array([float(np.sum(size * np.sin(2 * np.pi * hz * t + phase[k]))) for k in range(3)])

    collected = ImageTurns(LENS, DOWN)
    for t in np.arange(1.0, 1.0 + duration_s, 1.0 / 30.0):
        R_WB = cv2.Rodrigues(angles(float(t)))[0]
        collected.add(float(t), seen((DOWN.T @ R_WB @ DOWN).T, rng))
    gyro_t = np.arange(0.0, duration_s + 2.5, 0.02)
    step = 1e-4
    rates = []
    for t in gyro_t:
        turned = cv2.Rodrigues(angles(t - step))[0].T @ cv2.Rodrigues(angles(t + step))[0]
        rates.append(cv2.Rodrigues(turned)[0].ravel() / (2 * step))
    noise = rng.normal(0.0, 0.01, (len(gyro_t), 3)) + np.array([0.02, -0.01, 0.015])
    return collected.turns(), gyro_t, np.array(rates) + noise


def shaken(
    delay_s: float, *, duration_s: float = 6.0, size_rad: float = 0.08, regular: bool = False
) -> tuple[Turns, Any, Any]:
    """The record with every frame stamped `delay_s` late."""
    turns, gyro_t, rates = recorded(duration_s, size_rad, regular)
    return Turns(turns.begin_s + delay_s, turns.end_s + delay_s, turns.rotation_rad), gyro_t, rates


def measured(delay_s: float, **options: Any) -> DelayEstimate:
    return measure_delay(*shaken(delay_s, **options))


@pytest.mark.parametrize("delay_s", [0.0, 0.0437, 0.25])
def test_a_known_delay_is_found_within_3_ms_and_within_what_the_estimate_claims(delay_s: float) -> None:
    found = measured(delay_s)
    assert found.why_not == ""
    assert abs(found.delay_s - delay_s) < 0.003
    assert abs(found.delay_s - delay_s) < max(5.0 * found.sigma_s, 0.001)
    assert found.correlation > 0.97


def test_a_camera_that_is_stamped_early_has_a_negative_delay() -> None:
    assert measured(-0.04).delay_s == pytest.approx(-0.04, abs=0.003)


def test_a_turn_about_each_axis_has_its_sign_and_size() -> None:
    rng = np.random.default_rng(4)
    still = seen(np.eye(3), rng)
    for axis in np.eye(3):
        turned = seen(cv2.Rodrigues(0.03 * axis)[0].T, rng)
        rotation = turn_between(still, turned, LENS)
        assert rotation == pytest.approx(0.03 * axis, abs=0.001)


def test_a_vehicle_that_stands_still_gives_no_delay_and_says_what_to_do() -> None:
    assert "hardly turned" in measured(0.1, size_rad=0.0005).why_not


def test_a_motion_of_one_frequency_only_is_called_ambiguous() -> None:
    turns, gyro_t, rates = shaken(0.05, regular=True)
    # A second delay a period apart is outside the range; at twice the frequency it is inside.
    fast = Turns(turns.begin_s / 2.5, turns.end_s / 2.5, turns.rotation_rad)
    assert "too regular" in measure_delay(fast, gyro_t / 2.5, rates * 2.5).why_not


def test_a_camera_mounted_otherwise_than_configured_is_noticed() -> None:
    turns, gyro_t, rates = shaken(0.05)
    turned = Turns(turns.begin_s, turns.end_s, turns.rotation_rad @ np.diag([-1.0, -1.0, -1.0]))
    assert measure_delay(turned, gyro_t, rates).why_not != ""


def test_a_gyro_record_that_does_not_cover_the_frames_is_refused() -> None:
    turns, gyro_t, rates = shaken(0.05)
    assert "only 0 turns" in measure_delay(turns, gyro_t + 100.0, rates).why_not
    assert "only 0 turns" in measure_delay(turns, gyro_t[:1], rates[:1]).why_not


def test_frames_of_other_sizes_without_texture_or_out_of_order_give_no_turn() -> None:
    collected = ImageTurns(LENS, DOWN)
    blank = np.full((HEIGHT, WIDTH), 90, np.uint8)
    image = seen(np.eye(3), np.random.default_rng(1))
    given = [(0.0, blank), (0.03, blank), (0.06, image[:100]), (0.09, image), (0.05, image), (9.0, image)]
    assert [collected.add(t, picture) for t, picture in given] == [False] * 6
    assert len(collected.turns().begin_s) == 0
