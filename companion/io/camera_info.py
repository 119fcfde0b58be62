"""Lens calibrations as ROS camera_info YAML: read into the configuration, written by `companion calibrate`.

The format is fixed and small, so it is read here without a YAML library: scalars, one level of nesting, and number lists in
brackets, which may run over lines. Lens names: plumb_bob and rational_polynomial are `pinhole`, equidistant or fisheye is
`kannala_brandt`; `scaramuzza` is ours.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from companion import config

LensModel = Literal["pinhole", "kannala_brandt", "scaramuzza"]
_MODELS: dict[str, LensModel] = {
    "plumb_bob": "pinhole",
    "rational_polynomial": "pinhole",
    "equidistant": "kannala_brandt",
    "fisheye": "kannala_brandt",
    "scaramuzza": "scaramuzza",
}
_COUNTS: dict[LensModel, tuple[int, ...]] = {"pinhole": (0, 4, 5, 8), "kannala_brandt": (0, 4), "scaramuzza": (5,)}


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """One calibrated lens. `distortion` is in the order of the lens model of that name."""

    name: str
    model: LensModel
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...]


def calibrated(camera: config.Camera) -> config.Camera:
    """The camera with the lens of its `calibration_file`, itself where it names none. ConfigError as `read`."""
    return onto(camera, read(Path(camera.calibration_file))) if camera.calibration_file else camera


def onto(camera: config.Camera, info: CameraInfo) -> config.Camera:
    """The configured camera with the calibrated lens in place of its own."""
    return msgspec.structs.replace(
        camera,
        model=info.model,
        width_px=info.width_px,
        height_px=info.height_px,
        fx_px=info.fx_px,
        fy_px=info.fy_px,
        cx_px=info.cx_px,
        cy_px=info.cy_px,
        distortion=info.distortion,
    )


def of(name: str, camera: config.Camera) -> CameraInfo:
    """The lens of a configured camera, to be written."""
    return CameraInfo(
        name=name,
        model=camera.model,
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        distortion=camera.distortion,
    )


def read(path: Path) -> CameraInfo:
    """ConfigError names the file and what is missing or wrong in it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise config.ConfigError(f"{path}: cannot be read: {error}") from error
    return parse(text, str(path))


def write(path: Path, info: CameraInfo) -> None:
    path.write_text(text_of(info), encoding="utf-8")


def parse(text: str, origin: str) -> CameraInfo:
    """The calibration in a camera_info YAML text; ConfigError names `origin` and the key."""
    values = _flattened(text)
    K = _numbers(values, "camera_matrix.data", origin)
    if len(K) != 9:
        raise config.ConfigError(f"{origin}: camera_matrix.data has {len(K)} numbers, not 9")
    if not (0.0 < K[0] < math.inf and 0.0 < K[4] < math.inf):
        raise config.ConfigError(f"{origin}: camera_matrix.data: focal lengths {K[0]:g} and {K[4]:g} must be positive")
    ros_model = _text(values, "distortion_model", origin)
    if ros_model not in _MODELS:
        known = ", ".join(sorted(_MODELS))
        raise config.ConfigError(f"{origin}: distortion_model = {ros_model!r} is not known; known: {known}")
    model = _MODELS[ros_model]
    distortion = _numbers(values, "distortion_coefficients.data", origin)
    if len(distortion) not in _COUNTS[model]:
        allowed = " or ".join(str(count) for count in _COUNTS[model])
        raise config.ConfigError(
            f"{origin}: distortion_coefficients.data has {len(distortion)} numbers, {ros_model} has {allowed}"
        )
    return CameraInfo(
        name=values.get("camera_name", "camera").strip("\"'"),
        model=model,
        width_px=_whole(values, "image_width", origin),
        height_px=_whole(values, "image_height", origin),
        fx_px=K[0],
        fy_px=K[4],
        cx_px=K[2],
        cy_px=K[5],
        distortion=distortion,
    )


def text_of(info: CameraInfo) -> str:
    """The YAML that ROS's camera_info_manager and `read` understand."""
    K = (info.fx_px, 0.0, info.cx_px, 0.0, info.fy_px, info.cy_px, 0.0, 0.0, 1.0)
    projection = (info.fx_px, 0.0, info.cx_px, 0.0, 0.0, info.fy_px, info.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0)
    distortion = info.distortion or ((0.0,) * 5 if info.model == "pinhole" else (0.0,) * 4)
    return "\n".join(
        [
            f"image_width: {info.width_px}",
            f"image_height: {info.height_px}",
            f"camera_name: {info.name}",
            *_matrix("camera_matrix", 3, 3, K),
            f"distortion_model: {_ros_model(info)}",
            *_matrix("distortion_coefficients", 1, len(distortion), distortion),
            *_matrix("rectification_matrix", 3, 3, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
            *_matrix("projection_matrix", 3, 4, projection),
            "",
        ]
    )


def _ros_model(info: CameraInfo) -> str:
    if info.model == "pinhole":
        return "rational_polynomial" if len(info.distortion) == 8 else "plumb_bob"
    return "equidistant" if info.model == "kannala_brandt" else "scaramuzza"


def _matrix(name: str, rows: int, columns: int, data: tuple[float, ...]) -> list[str]:
    numbers = ", ".join(repr(float(value)) for value in data)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{numbers}]"]


def _flattened(text: str) -> dict[str, str]:
    """`outer.inner` to the text of its value; comments, directives and type tags dropped, bracketed lists on one line."""
    values: dict[str, str] = {}
    outer = ""
    lines = [re.sub(r"(^|\s)#.*$", "", line) for line in text.splitlines() if not line.startswith(("%", "---", "..."))]
    joined = re.sub(r"\[[^\]]*\]", lambda match: " ".join(match.group().split()), "\n".join(lines))
    for line in joined.splitlines():
        key, colon, value = line.partition(":")
        value = re.sub(r"!!\S+", "", value).strip()
        if not colon:
            continue
        if not key.startswith((" ", "\t")):
            outer = key.strip()
        name = outer if not key.startswith((" ", "\t")) else f"{outer}.{key.strip()}"
        if value:
            values[name] = value
    return values


def _text(values: dict[str, str], key: str, origin: str) -> str:
    if key not in values:
        raise config.ConfigError(f"{origin}: {key} is missing; is this a ROS camera_info file?")
    return values[key].strip("\"'")


def _whole(values: dict[str, str], key: str, origin: str) -> int:
    text = _text(values, key, origin)
    if not text.isdigit() or int(text) < 16:
        raise config.ConfigError(f"{origin}: {key} = {text!r}: expected a whole number of pixels, at least 16")
    return int(text)


def _numbers(values: dict[str, str], key: str, origin: str) -> tuple[float, ...]:
    text = _text(values, key, origin)
    if not (text.startswith("[") and text.endswith("]")):
        raise config.ConfigError(f"{origin}: {key} = {text[:60]!r}: expected a list of numbers in brackets")
    text = text[1:-1]
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise config.ConfigError(f"{origin}: {key}: {error}") from error
