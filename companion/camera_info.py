"""ROS camera_info YAML, as `camera_calibration` and Kalibr's converters write it: text to a value and back. Pure.

The subset of YAML that such files consist of: `key: value`, nested by indentation, lists in brackets (over several lines too)
or as `- item` lines, comments. Pixel centres are at integer coordinates, as in OpenCV. The distortion models:
plumb_bob (k1 k2 p1 p2 k3) and rational_polynomial (8) are `pinhole`, equidistant (k1 to k4) is `kannala_brandt`; `scaramuzza`
is Companion's own name, with the coefficients of its model.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

MODELS = {
    "plumb_bob": "pinhole",
    "rational_polynomial": "pinhole",
    "equidistant": "kannala_brandt",
    "fisheye": "kannala_brandt",
    "scaramuzza": "scaramuzza",
}
COEFFICIENTS = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (8,),
    "equidistant": (0, 4),
    "fisheye": (0, 4),
    "scaramuzza": tuple(range(1, 33)),
}


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """One calibrated lens. `model` is Companion's name (`[cameras.<name>] model`)."""

    camera_name: str
    model: str
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...]


def parse(text: str) -> CameraInfo:
    """ValueError says what is missing or wrong."""
    tree = _tree(text)
    name = str(_get(tree, "distortion_model"))
    if name not in MODELS:
        raise ValueError(f"distortion_model {name!r} is unknown; known: {', '.join(MODELS)}")
    matrix = _numbers(tree, "camera_matrix")
    if len(matrix) != 9 or not (matrix[0] > 0.0 and matrix[4] > 0.0):
        raise ValueError(f"camera_matrix: data must be nine numbers with positive focal lengths, is {matrix}")
    distortion = _numbers(tree, "distortion_coefficients")
    if len(distortion) not in COEFFICIENTS[name]:
        raise ValueError(f"distortion_coefficients: {name} has {COEFFICIENTS[name]} numbers, not {len(distortion)}")
    return CameraInfo(
        camera_name=str(tree.get("camera_name", "")),
        model=MODELS[name],
        width_px=_size(tree, "image_width"),
        height_px=_size(tree, "image_height"),
        fx_px=matrix[0],
        fy_px=matrix[4],
        cx_px=matrix[2],
        cy_px=matrix[5],
        distortion=tuple(distortion),
    )


def written(info: CameraInfo, comment: str = "") -> str:
    """The YAML text; `parse` of it gives `info` again, to the last bit."""
    distortion = info.distortion
    name = {"pinhole": "plumb_bob", "kannala_brandt": "equidistant"}.get(info.model, info.model)
    if info.model == "pinhole" and len(distortion) == 8:
        name = "rational_polynomial"
    matrix = (info.fx_px, 0.0, info.cx_px, 0.0, info.fy_px, info.cy_px, 0.0, 0.0, 1.0)
    projection = (info.fx_px, 0.0, info.cx_px, 0.0, 0.0, info.fy_px, info.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0)
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [f"image_width: {info.width_px}", f"image_height: {info.height_px}", f"camera_name: {info.camera_name}"]
    lines += _matrix("camera_matrix", 3, 3, matrix)
    lines += [f"distortion_model: {name}"]
    lines += _matrix("distortion_coefficients", 1, len(distortion), distortion)
    lines += _matrix("rectification_matrix", 3, 3, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    lines += _matrix("projection_matrix", 3, 4, projection)
    return "\n".join(lines) + "\n"


def _matrix(name: str, rows: int, columns: int, values: tuple[float, ...]) -> list[str]:
    data = ", ".join(repr(float(value)) for value in values)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]


def _get(tree: dict[str, Any], key: str) -> Any:
    if key not in tree:
        raise ValueError(f"{key} is missing: not a camera_info file")
    return tree[key]


def _size(tree: dict[str, Any], key: str) -> int:
    value = _get(tree, key)
    if not isinstance(value, float) or not 16 <= value <= 100_000 or value != int(value):
        raise ValueError(f"{key} must be a number of pixels, is {value!r}")
    return int(value)


def _numbers(tree: dict[str, Any], key: str) -> list[float]:
    table = _get(tree, key)
    data = table.get("data") if isinstance(table, dict) else table
    if not isinstance(data, list) or not all(isinstance(value, float) and abs(value) < 1e12 for value in data):
        raise ValueError(f"{key}: data must be a list of numbers, is {data!r}")
    return data


def _tree(text: str) -> dict[str, Any]:
    """Nested dictionaries of floats, texts and lists."""
    root: dict[str, Any] = {}
    open_tables: list[tuple[int, dict[str, Any]]] = [(-1, root)]
    last: tuple[dict[str, Any], str] | None = None
    for number, indent, line in _logical_lines(text):
        if line.startswith("- ") and last is not None:
            table, key = last
            if not isinstance(table[key], list):
                table[key] = []
            table[key].append(_scalar(line[2:]))
            continue
        key, colon, value = line.partition(":")
        if not colon:
            raise ValueError(f"line {number}: {line[:60]!r} is not `key: value`")
        while open_tables[-1][0] >= indent:
            open_tables.pop()
        table = open_tables[-1][1]
        table[key.strip()] = _value(value.strip())
        last = (table, key.strip())
        if not value.strip():
            nested: dict[str, Any] = {}
            table[key.strip()] = nested
            open_tables.append((indent, nested))
    return root


def _logical_lines(text: str) -> Iterator[tuple[int, int, str]]:
    """(line number, indentation, content) without comments; a bracket that stays open takes the next lines in."""
    pending, start, indent = "", 0, 0
    for number, raw in enumerate(text.splitlines(), 1):
        line = re.sub(r"(^|\s)#.*$", "", raw).rstrip()
        if not pending:
            if not line.strip() or line.startswith(("%", "---", "...")):
                continue
            start, indent = number, len(line) - len(line.lstrip())
        pending += " " + line.strip()
        if pending.count("[") <= pending.count("]"):
            yield start, indent, pending.strip()
            pending = ""
    if pending:
        raise ValueError(f"line {start}: a bracket is not closed")


def _value(text: str) -> Any:
    if text.startswith("[") and text.endswith("]"):
        return [_scalar(part) for part in text[1:-1].split(",") if part.strip()]
    return _scalar(text)


def _scalar(text: str) -> float | str:
    text = text.strip().strip("\"'")
    try:
        return float(text)
    except ValueError:
        return text
