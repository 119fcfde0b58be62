"""Drawings of a pad at true scale, to print and lay on a deck: SVG, PDF, PNG, and the layout file that describes it.

Called by `companion make-pad`. The page is the deck's top seen from above, +x of P (travel) up. A drawing is a list of
polygons in page metres (right, down) from the page's top-left corner, later ones over earlier ones; each format only writes
them down. PDF pages carry their size in points (1/72 inch), so print at 100 %, never "fit to page".
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from companion import config
from companion.messages import Image
from companion.vision import pad_layout

Point = tuple[float, float]
Colour = tuple[int, int, int]
BLACK: Colour = (0, 0, 0)
WHITE: Colour = (255, 255, 255)
RED: Colour = (220, 20, 20)

_POINTS_PER_M = 72.0 / 0.0254
_MAX_PDF_M = 14400.0 / _POINTS_PER_M
"""A PDF page has at most 14400 points."""
_FINER = 4
"""PNG pixels are averages over so many by so many."""
_STRIP_ROWS = 64
"""A PNG is drawn in strips, so that a large pad at print resolution needs no gigabytes."""
_CIRCLE_CORNERS = 360
"""A disc of 1.2 m drawn with so many corners is 0.02 mm off its circle."""


@dataclass(frozen=True, slots=True)
class Polygon:
    """Filled, in page metres (right, down)."""

    corners_m: tuple[Point, ...]
    colour: Colour


@dataclass(frozen=True, slots=True)
class Drawing:
    """A page of `width_m` x `height_m`, white, with polygons on it."""

    width_m: float
    height_m: float
    polygons: tuple[Polygon, ...]


def draw(pad: config.Pad) -> Drawing:
    """The deck's top. ValueError where the family is unknown or a marker is not on the deck."""
    markers = sorted((marker for marker in pad.markers if marker.facing == "up"), key=lambda marker: -marker.size_m)
    polygons = [
        Polygon(tuple(_on_page(pad, point) for point in corners), colour)
        for marker in markers
        for corners, colour in _marker_shapes(pad.family, marker)
    ]
    drawing = Drawing(width_m=pad.width_m, height_m=pad.length_m, polygons=tuple(polygons))
    for marker in markers:
        _check_on_deck(pad, marker)
    return drawing


def write_pad(pad: config.Pad, folder: Path, name: str, *, formats: tuple[str, ...], dots_per_inch: int) -> list[Path]:
    """Write the drawing in each of `formats` (keys of WRITERS) and the layout file; the paths written.

    ValueError for an unknown format or a pad that cannot be drawn. Existing files are replaced.
    """
    unknown = [kind for kind in formats if kind not in WRITERS]
    if unknown:
        raise ValueError(f"format {unknown[0]!r} is not one of {', '.join(WRITERS)}")
    drawing = draw(pad)
    folder.mkdir(parents=True, exist_ok=True)
    layout = folder / f"{name}.toml"
    layout.write_text(layout_toml(pad), encoding="utf-8")
    written = [layout]
    for kind in formats:
        path = folder / f"{name}.{kind}"
        path.write_bytes(WRITERS[kind](drawing, dots_per_inch))
        written.append(path)
    return written


# ------------------------------------------------------------------------------------------------------------- shapes


def _marker_shapes(family: str, marker: config.Marker) -> list[tuple[list[Point], Colour]]:
    """Polygons in P (x, y) and their colours, bottom first."""
    if family == "CIRCLE_CROSS":
        shapes = _circle_cross(marker.size_m)
    elif family == "RED_DISC":
        shapes = [(_disc(marker.size_m / 2.0), RED)]
    else:
        shapes = _cells(family, marker)
    c, s = math.cos(math.radians(marker.yaw_deg)), math.sin(math.radians(marker.yaw_deg))
    x0, y0 = marker.position_m
    return [([(x0 + c * x - s * y, y0 + s * x + c * y) for x, y in corners], colour) for corners, colour in shapes]


def _cells(family: str, marker: config.Marker) -> list[tuple[list[Point], Colour]]:
    """A white quiet zone of one cell, the black square, and its white cells joined along rows."""
    dictionary = pad_layout.dictionary(family)
    n = int(dictionary.markerSize) + 2
    if marker.id >= len(dictionary.bytesList):
        raise ValueError(
            f"[pad] marker id {marker.id} is not in {family}, which has ids 0 to {len(dictionary.bytesList) - 1}"
        )
    white = cv2.aruco.generateImageMarker(dictionary, marker.id, n) > 127
    half, cell = marker.size_m / 2.0, marker.size_m / n
    shapes = [(_square(half + cell), WHITE), (_square(half), BLACK)]
    for row in range(n):
        column = 0
        while column < n:
            end = column
            while end < n and white[row, end]:
                end += 1
            if end > column:
                top, left, right = half - row * cell, column * cell - half, end * cell - half
                shapes.append(([(top, left), (top, right), (top - cell, right), (top - cell, left)], WHITE))
            column = end + 1
    return shapes


def _circle_cross(size_m: float) -> list[tuple[list[Point], Colour]]:
    """A ring a tenth of its diameter wide, in it an upright cross that spans 0.6 with bars 0.15 wide."""
    span, bar = 0.3 * size_m, 0.075 * size_m
    return [
        (_disc(0.5 * size_m), BLACK),
        (_disc(0.4 * size_m), WHITE),
        ([(span, -bar), (span, bar), (-span, bar), (-span, -bar)], BLACK),
        ([(bar, -span), (bar, span), (-bar, span), (-bar, -span)], BLACK),
    ]


def _disc(radius_m: float) -> list[Point]:
    step = 2.0 * math.pi / _CIRCLE_CORNERS
    return [(radius_m * math.cos(k * step), radius_m * math.sin(k * step)) for k in range(_CIRCLE_CORNERS)]


def _square(half_m: float) -> list[Point]:
    return [(half_m, -half_m), (half_m, half_m), (-half_m, half_m), (-half_m, -half_m)]


def _on_page(pad: config.Pad, point_P: Point) -> Point:
    """P (x up the page, y right) to page metres; exact to a nanometre so that files do not change with rounding."""
    x, y = point_P[0] - pad.deck_center_m[0], point_P[1] - pad.deck_center_m[1]
    return round(pad.width_m / 2.0 + y, 9), round(pad.length_m / 2.0 - x, 9)


def _check_on_deck(pad: config.Pad, marker: config.Marker) -> None:
    for x, y, _ in pad_layout.marker_corners(marker):
        right, down = _on_page(pad, (float(x), float(y)))
        if not (0.0 <= right <= pad.width_m and 0.0 <= down <= pad.length_m):
            raise ValueError(
                f"[pad] marker {marker.id} of {marker.size_m} m does not lie on the deck of {pad.length_m} x {pad.width_m} m"
            )


# ------------------------------------------------------------------------------------------------------------ formats


def svg(drawing: Drawing, dots_per_inch: int) -> bytes:
    """Lengths in millimetres; `dots_per_inch` does not matter."""
    width, height = 1000.0 * drawing.width_m, 1000.0 * drawing.height_m
    paths = [
        f'<path fill="#{r:02x}{g:02x}{b:02x}" d="M{" L".join(f"{1000.0 * x:.4f} {1000.0 * y:.4f}" for x, y in polygon.corners_m)}Z"/>'
        for polygon in drawing.polygons
        for r, g, b in (polygon.colour,)
    ]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.4f}mm" height="{height:.4f}mm" '
        f'viewBox="0 0 {width:.4f} {height:.4f}">'
    )
    return "\n".join([head, '<rect width="100%" height="100%" fill="#ffffff"/>', *paths, "</svg>", ""]).encode()


def pdf(drawing: Drawing, dots_per_inch: int) -> bytes:
    """One page; `dots_per_inch` does not matter. ValueError where the deck is larger than a PDF page may be."""
    if max(drawing.width_m, drawing.height_m) > _MAX_PDF_M:
        raise ValueError(f"a PDF page is at most {_MAX_PDF_M:.2f} m long; use SVG")
    width, height = drawing.width_m * _POINTS_PER_M, drawing.height_m * _POINTS_PER_M
    content = zlib.compress("\n".join(_pdf_fill(polygon, height) for polygon in drawing.polygons).encode())
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Resources << >> /Contents 4 0 R >>".encode(),
        b"<< /Length %d /Filter /FlateDecode >>\nstream\n%b\nendstream" % (len(content), content),
    ]
    return _pdf_file(objects)


def _pdf_fill(polygon: Polygon, page_height: float) -> str:
    colour = " ".join(f"{channel / 255.0:.4f}" for channel in polygon.colour)
    points = [(x * _POINTS_PER_M, page_height - y * _POINTS_PER_M) for x, y in polygon.corners_m]
    steps = " ".join(f"{x:.4f} {y:.4f} {'l' if k else 'm'}" for k, (x, y) in enumerate(points))
    return f"{colour} rg {steps} h f"


def _pdf_file(objects: list[bytes]) -> bytes:
    """Header, numbered objects, and the table of where each begins."""
    out = bytearray(b"%PDF-1.4\n")
    starts = []
    for number, body in enumerate(objects, start=1):
        starts.append(len(out))
        out += b"%d 0 obj\n%b\nendobj\n" % (number, body)
    table = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % start for start in starts)
    out += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, table)
    return bytes(out)


def png(drawing: Drawing, dots_per_inch: int) -> bytes:
    """RGB picture that carries its resolution, so that programs print it at true size."""
    per_m = dots_per_inch / 0.0254
    columns, rows = round(drawing.width_m * per_m), round(drawing.height_m * per_m)
    strips = [_strip(drawing, per_m, top, min(_STRIP_ROWS, rows - top), columns) for top in range(0, rows, _STRIP_ROWS)]
    pixels_per_m = round(per_m)
    raw = b"".join(b"\x00" + row.tobytes() for strip in strips for row in strip)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (
            _png_chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)),
            _png_chunk(b"pHYs", struct.pack(">IIB", pixels_per_m, pixels_per_m, 1)),
            _png_chunk(b"IDAT", zlib.compress(raw, 6)),
            _png_chunk(b"IEND", b""),
        )
    )


def _strip(drawing: Drawing, per_m: float, top: int, rows: int, columns: int) -> Image:
    """(rows, columns, 3) RGB of the page from pixel row `top` on, drawn finer and averaged: edges fall between pixels."""
    fine = np.full((rows * _FINER, columns * _FINER, 3), 255, np.uint8)
    for polygon in drawing.polygons:
        # Pixel k covers k to k + 1 of the page, so its centre lies half a pixel in; 8 bits of fraction for OpenCV.
        corners = (np.array(polygon.corners_m) * per_m - (0.0, top)) * _FINER - 0.5
        cv2.fillConvexPoly(fine, np.round(corners * 256.0).astype(np.int32), polygon.colour, cv2.LINE_8, 8)
    return np.asarray(cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _png_chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def layout_toml(pad: config.Pad) -> str:
    """The [pad] section that describes the drawing, for `companion run -c` and the simulator."""
    lines = [
        "[pad]",
        f'family = "{pad.family}"',
        f"length_m = {pad.length_m!r}",
        f"width_m = {pad.width_m!r}",
        f"deck_height_m = {pad.deck_height_m!r}",
        f"deck_center_m = {list(pad.deck_center_m)!r}",
    ]
    if pad.board_size_m is not None:
        lines.append(f"board_size_m = {list(pad.board_size_m)!r}")
    for marker in pad.markers:
        lines += [
            "",
            "[[pad.markers]]",
            f"id = {marker.id}",
            f"size_m = {marker.size_m!r}",
            f"position_m = {list(marker.position_m)!r}",
            f"yaw_deg = {marker.yaw_deg!r}",
            f'facing = "{marker.facing}"',
            f"height_m = {marker.height_m!r}",
        ]
    return "\n".join(lines) + "\n"


WRITERS: dict[str, Callable[[Drawing, int], bytes]] = {"pdf": pdf, "svg": svg, "png": png}
"""Format by file ending: (drawing, dots per inch) to the file's bytes."""
