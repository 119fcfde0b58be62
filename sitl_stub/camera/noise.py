"""Sensor noise from a bank: one large field of normal deviates, of which each frame takes another window.

Adding a window costs a tenth of a millisecond; fresh deviates for each pixel would cost five. Light adds noise (photon
statistics): sigma^2 = read^2 + shot^2 * grey / 255.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.image import Image

_BANK_MARGIN_PX = 509
"""Offsets in each direction: a quarter of a million different windows."""

_UNITS = 64.0
"""The bank holds deviates in 1 / 64, so that one byte reaches 4 sigma."""


@lru_cache(maxsize=4)
def _bank(height: int, width: int, channels: int) -> tuple[Image, Image]:
    """Sizes of the deviates, and 255 where they are positive: byte arithmetic that saturates has no signs."""
    shape = (height + _BANK_MARGIN_PX, width + _BANK_MARGIN_PX) + ((channels,) if channels > 1 else ())
    field = np.random.default_rng(752480).standard_normal(shape, np.float32)
    size: Image = np.rint(np.minimum(np.abs(field) * np.float32(_UNITS), 255.0)).astype(np.uint8)
    return size, np.where(field > 0.0, np.uint8(255), np.uint8(0))


def add_noise(image: Image, read_sigma: float, shot_sigma: float, rng: np.random.Generator) -> Image:
    """The image with noise, in place. `rng` only picks the window: two draws a frame, whatever the sigmas are."""
    row, column = (int(offset) for offset in rng.integers(0, _BANK_MARGIN_PX, 2))
    if read_sigma <= 0.0 and shot_sigma <= 0.0:
        return image
    height, width = image.shape[:2]
    size, is_positive = _bank(height, width, image.shape[2] if image.ndim == 3 else 1)
    window = (slice(row, row + height), slice(column, column + width))
    sigma = cv2.LUT(image, _sigma_table(read_sigma, shot_sigma))
    noise = cv2.multiply(size[window], sigma, scale=1.0 / (_UNITS * _SIGMA_UNITS))
    lighter = cv2.bitwise_and(noise, is_positive[window])
    cv2.add(image, lighter, dst=image)
    cv2.subtract(image, cv2.subtract(noise, lighter, dst=noise), dst=image)
    return image


_SIGMA_UNITS = 8.0


@lru_cache(maxsize=64)
def _sigma_table(read_sigma: float, shot_sigma: float) -> Image:
    """(256,) standard deviation over grey, in 1 / 8 grey levels."""
    grey = np.arange(256) / 255.0
    sigma = np.sqrt(read_sigma**2 + shot_sigma**2 * grey)
    table: Image = np.rint(np.clip(sigma * _SIGMA_UNITS, 0.0, 255.0)).astype(np.uint8)
    return table
