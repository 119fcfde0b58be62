"""Lens calibrations as ROS camera_info YAML: read by the configuration, written by `companion calibrate`.

The format is fixed and small, so it is read here without a YAML library: scalars, one level of nesting, and number lists in
brackets, which may run over lines. Lens names: plumb_bob and rational_polynomial are `pinhole`, equidistant or fisheye is
`kannala_brandt`; `scaramuzza` is ours.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

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


class CalibrationError(ValueError):
    """The file cannot be used. The text names it, the key and what is wrong."""


class Lens(Protocol):
    """What a configured camera says of its lens."""

    @property
    def model(self) -> LensModel: ...
    @property
    def width_px(self) -> int: ...
    @property
    def height_px(self) -> int: ...
    @property
    def fx_px(self) -> float: ...
    @property
    def fy_px(self) -> float: ...
    @property
    def cx_px(self) -> float: ...
    @property
    def cy_px(self) -> float: ...
    @property
    def distortion(self) -> tuple[float, ...]: ...


def of(name: str, lens: Lens) -> CameraInfo:
    """The lens of a configured camera, to be written."""
    return CameraInfo(
        name=name,
        model=lens.model,
        width_px=lens.width_px,
        height_px=lens.height_px,
        fx_px=lens.fx_px,
        fy_px=lens.fy_px,
        cx_px=lens.cx_px,
        cy_px=lens.cy_px,
        distortion=lens.distortion,
    )


def read(path: Path) -> CameraInfo:
    """CalibrationError names the file and what is missing or wrong in it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read: {error}") from error
    return parse(text, str(path))


def write(path: Path, info: CameraInfo) -> None:
    path.write_text(text_of(info), encoding="utf-8")


def parse(text: str, origin: str) -> CameraInfo:
    """The calibration in a camera_info YAML text; CalibrationError names `origin` and the key."""
    values = _flattened(text)
    K = _numbers(values, "camera_matrix.data", origin)
    if len(K) != 9:
        raise CalibrationError(f"{origin}: camera_matrix.data has {len(K)} numbers, not 9")
    if not (0.0 < K[0] < math.inf and 0.0 < K[4] < math.inf):
        raise CalibrationError(f"{origin}: camera_matrix.data: focal lengths {K[0]:g} and {K[4]:g} must be positive")
    ros_model = _text(values, "distortion_model", origin)
    if ros_model not in _MODELS:
        known = ", ".join(sorted(_MODELS))
        raise CalibrationError(f"{origin}: distortion_model = {ros_model!r} is not known; known: {known}")
    model = _MODELS[ros_model]
    distortion = _numbers(values, "distortion_coefficients.data", origin)
    if len(distortion) not in _COUNTS[model]:
        allowed = " or ".join(str(count) for count in _COUNTS[model])
        raise CalibrationError(
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
        raise CalibrationError(f"{origin}: {key} is missing; is this a ROS camera_info file?")
    return values[key].strip("\"'")


def _whole(values: dict[str, str], key: str, origin: str) -> int:
    text = _text(values, key, origin)
    if not text.isdigit() or int(text) < 16:
        raise CalibrationError(f"{origin}: {key} = {text!r}: expected a whole number of pixels, at least 16")
    return int(text)


def _numbers(values: dict[str, str], key: str, origin: str) -> tuple[float, ...]:
    text = _text(values, key, origin)
    if not (text.startswith("[") and text.endswith("]")):
        raise CalibrationError(f"{origin}: {key} = {text[:60]!r}: expected a list of numbers in brackets")
    text = text[1:-1]
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise CalibrationError(f"{origin}: {key}: {error}") from error
