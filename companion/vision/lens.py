"""The lens models by name, and the lens of a configured camera."""

from __future__ import annotations

from collections.abc import Callable

from companion import config
from companion.vision.camera_model import CameraModel
from companion.vision.kannala_brandt import KannalaBrandt
from companion.vision.pinhole import Pinhole
from companion.vision.scaramuzza import Scaramuzza

CAMERA_MODELS: dict[str, Callable[..., CameraModel]] = {
    "pinhole": Pinhole,
    "kannala_brandt": KannalaBrandt,
    "scaramuzza": Scaramuzza,
}
"""Name in `[cameras.<name>] model` to the class; all take the same keyword arguments."""


def from_config(camera: config.Camera) -> CameraModel:
    """ValueError where the distortion has the wrong number of coefficients for the model."""
    return CAMERA_MODELS[camera.model](
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        distortion=tuple(camera.distortion),
    )
