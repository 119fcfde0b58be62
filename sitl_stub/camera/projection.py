"""The two questions a camera model answers, for batches of points. Pixel centres are at integer coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from sitl_stub.camera.image import Floats


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Numbers of a lens. What `distortion` means is the model's business; see the model's file."""

    fx_px: float = 420.0
    fy_px: float = 420.0
    cx_px: float = 375.5
    cy_px: float = 239.5
    distortion: tuple[float, ...] = ()


class Projection(Protocol):
    """`project` takes points p_C (n, 3) in metres to pixels (n, 2); NaN for points the model cannot see. `rays` takes
    pixels (n, 2) to unit directions in C (n, 3). `is_linear`: straight lines stay straight (a 3 x 3 matrix says it all)."""

    @property
    def is_linear(self) -> bool: ...
    def project(self, points_C: Floats) -> Floats: ...
    def rays(self, pixels: Floats) -> Floats: ...


class ProjectionFactory(Protocol):
    def __call__(self, intrinsics: Intrinsics) -> Projection: ...
