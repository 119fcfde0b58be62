"""What the ground looks like: tiles that repeat, in metres, one function a kind. `GROUNDS` is chosen by name.

Natural ground has detail at every scale, so each tile is a sum of noise fields from centimetres to metres, plus what makes a
detector work for its money: stones, tufts, cracks, patches. Nothing in it is drawn with straight black quadrangles. Tiles
wrap without a seam and are the same in every run: the ground is not what a seed is about.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from sitl_stub.camera.image import Floats32, Image
from sitl_stub.camera.pyramid import Pyramid, build_pyramid

TILE_PX = 2048
MARGIN_PX = 1500
"""More than the texels a 752 x 480 view spans at one texel a pixel, turned any way and somewhat tilted."""


@dataclass(frozen=True, slots=True)
class GroundKind:
    """A tile of grey detail of `tile_m` metres; `tint_bgr` colours it for colour cameras. `drift_m_s` moves it (waves)."""

    paint: Callable[[np.random.Generator], Floats32]
    tile_m: float
    tint_bgr: tuple[float, float, float]
    drift_m_s: tuple[float, float] = (0.0, 0.0)


def _octaves(rng: np.random.Generator, cells: tuple[int, ...], amplitudes: tuple[float, ...]) -> Floats32:
    """Sum of smooth noise fields that wrap; `cells` is how many lumps fit into the tile's side."""
    total = np.zeros((TILE_PX, TILE_PX), np.float32)
    for count, amplitude in zip(cells, amplitudes, strict=True):
        total += amplitude * _wrapping_noise(rng, count, count)
    return total


def _wrapping_noise(rng: np.random.Generator, rows: int, columns: int) -> Floats32:
    """(TILE_PX, TILE_PX) noise of unit variance at its nodes, enlarged smoothly and without a seam."""
    nodes = rng.standard_normal((rows, columns), np.float32)
    if (rows, columns) == (TILE_PX, TILE_PX):
        return nodes
    margin = 2
    wrapped = np.pad(nodes, margin, mode="wrap")
    size = (round(TILE_PX * (columns + 2 * margin) / columns), round(TILE_PX * (rows + 2 * margin) / rows))
    large = cv2.resize(wrapped, size, interpolation=cv2.INTER_CUBIC)
    r, c = (size[1] - TILE_PX) // 2, (size[0] - TILE_PX) // 2
    return np.asarray(large[r : r + TILE_PX, c : c + TILE_PX], np.float32)


def _scattered(rng: np.random.Generator, count: int, radius_px: tuple[float, float], depth: float) -> Floats32:
    """Blobs of random size and direction (stones, tufts), drawn so that they wrap."""
    field = np.zeros((TILE_PX, TILE_PX), np.float32)
    for _ in range(count):
        x, y = rng.uniform(0.0, TILE_PX, 2)
        a = float(np.exp(rng.uniform(np.log(radius_px[0]), np.log(radius_px[1]))))
        b, angle, value = a * rng.uniform(0.4, 1.0), rng.uniform(0.0, 180.0), depth * rng.uniform(-1.0, 1.0)
        for dx in (0.0, -TILE_PX if x > TILE_PX / 2 else TILE_PX):
            for dy in (0.0, -TILE_PX if y > TILE_PX / 2 else TILE_PX):
                box = (((x + dx), (y + dy)), (2 * a, 2 * b), angle)
                if -2 * a < x + dx < TILE_PX + 2 * a and -2 * a < y + dy < TILE_PX + 2 * a:
                    cv2.ellipse(field, box, value, -1, cv2.LINE_AA)
    return field


def _field(rng: np.random.Generator) -> Floats32:
    """Dry meadow: patches of soil and grass, tufts, stones."""
    cells, amplitudes = (4, 9, 23, 64, 170, 420, 1024), (10.0, 9.0, 10.0, 11.0, 12.0, 12.0, 9.0)
    tile: Floats32 = 104.0 + _octaves(rng, cells, amplitudes) + _scattered(rng, 1500, (3.0, 26.0), 34.0)
    return tile


def _asphalt(rng: np.random.Generator) -> Floats32:
    """Even grey with grain, patches of repair and a few cracks."""
    cells, amplitudes = (3, 8, 40, 300, 1024, 2048), (7.0, 6.0, 4.0, 4.0, 7.0, 9.0)
    tile = 92.0 + _octaves(rng, cells, amplitudes) + _scattered(rng, 60, (30.0, 130.0), 9.0)
    for _ in range(14):
        _crack(tile, rng)
    return tile


def _crack(tile: Floats32, rng: np.random.Generator) -> None:
    """A dark random walk, in place."""
    steps = rng.normal(0.0, 0.45, 120).cumsum() + rng.uniform(0.0, 2.0 * np.pi)
    points = np.cumsum(np.stack([np.cos(steps), np.sin(steps)], 1) * 11.0, axis=0) + rng.uniform(0.0, TILE_PX, 2)
    cv2.polylines(tile, [np.rint(points).astype(np.int32)], False, 48.0, 2, cv2.LINE_AA)


def _water(rng: np.random.Generator) -> Floats32:
    """Ripples across the wind with sparse glints."""
    waves = sum(
        _wrapping_noise(rng, rows, columns) * amplitude
        for rows, columns, amplitude in ((20, 9, 7.0), (60, 26, 7.0), (190, 80, 6.0), (700, 300, 5.0))
    )
    waves = np.asarray(waves, np.float32)
    tile: Floats32 = 70.0 + waves + 5.0 * np.maximum(waves - 22.0, 0.0)
    return tile


GROUNDS: dict[str, GroundKind] = {
    "field": GroundKind(_field, 20.48, (0.72, 1.02, 1.05)),
    "asphalt": GroundKind(_asphalt, 20.48, (1.02, 1.0, 0.98)),
    "water": GroundKind(_water, 20.48, (1.25, 1.02, 0.72), (0.5, 0.3)),
}


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A tile and its halvings. `repeated` are the same levels continued by `MARGIN_PX` beyond the tile to the right and
    down: a view that fits in is warped without wrapping, which is four times as fast."""

    pyramid: Pyramid
    repeated: tuple[Image, ...]
    drift_m_s: tuple[float, float]

    @property
    def mean(self) -> Image:
        """One pixel: what the ground looks like from very far."""
        return np.asarray(self.pyramid.levels[-1][0, 0], np.uint8)

    def level_for(self, texels_per_px: float) -> int:
        return self.pyramid.level_for(texels_per_px)


@lru_cache(maxsize=4)
def ground_of(name: str, coloured: bool) -> Ground:
    """The ground of that kind; the smallest level is one texel of its mean. KeyError for an unknown name."""
    kind = GROUNDS[name]
    grey = kind.paint(np.random.default_rng(sum(name.encode())))
    texture: Image = np.rint(np.clip(_tinted(grey, kind) if coloured else grey, 0.0, 255.0)).astype(np.uint8)
    pyramid = build_pyramid(texture, kind.tile_m / TILE_PX, smallest_px=1)
    return Ground(pyramid, tuple(_repeated(level) for level in pyramid.levels), kind.drift_m_s)


def _repeated(level: Image) -> Image:
    margins = ((0, MARGIN_PX), (0, MARGIN_PX)) + ((0, 0),) * (level.ndim - 2)
    return np.pad(level, margins, mode="wrap")


def _tinted(grey: Floats32, kind: GroundKind) -> Floats32:
    tinted: Floats32 = grey[..., None] * np.array(kind.tint_bgr, np.float32)
    return tinted
