"""Black rectangles on paper at true scale: PDF and SVG as vectors, PNG at 300 dots an inch with the scale in the file.

Metres in, millimetres on paper. A ruler of 100 mm stands under the drawing: printers that "fit to page" show themselves there.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

PAPERS_MM = ((297.0, 210.0), (420.0, 297.0), (594.0, 420.0), (841.0, 594.0), (1189.0, 841.0))
MARGIN_MM = 10.0
FOOT_MM = 10.0
RULER_MM = 100.0
DOTS_PER_MM = 300.0 / 25.4


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Left, top, width, height."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Sheet:
    """A page, millimetres; y down."""

    width_mm: float
    height_mm: float
    black: tuple[Rectangle, ...]
    text: str


def laid_out(black_m: Sequence[Rectangle], size_m: tuple[float, float], text: str) -> Sheet:
    """The drawing in the middle of the smallest A sheet (across) that holds it, or of a sheet of its own size."""
    width, height = size_m[0] * 1000.0, size_m[1] * 1000.0
    needed = (width + 2 * MARGIN_MM, height + 2 * MARGIN_MM + FOOT_MM)
    page = next((p for p in PAPERS_MM if p[0] >= needed[0] and p[1] >= needed[1]), needed)
    left, top = (page[0] - width) / 2.0, (page[1] - FOOT_MM - height) / 2.0
    black = [Rectangle(left + 1000 * r.x, top + 1000 * r.y, 1000 * r.width, 1000 * r.height) for r in black_m]
    ruler = Rectangle(MARGIN_MM, page[1] - MARGIN_MM, RULER_MM, 0.4)
    ends = [Rectangle(x, page[1] - MARGIN_MM - 1.5, 0.2, 3.0) for x in (MARGIN_MM, MARGIN_MM + RULER_MM - 0.2)]
    return Sheet(page[0], page[1], (*black, ruler, *ends), f"the line is 100 mm; {text}")


def pdf(sheet: Sheet) -> bytes:
    """One page; PDF counts points (1/72 inch) from the bottom left."""
    k = 72.0 / 25.4
    draw = "".join(
        f"{r.x * k:.4f} {(sheet.height_mm - r.y - r.height) * k:.4f} {r.width * k:.4f} {r.height * k:.4f} re\n"
        for r in sheet.black
    )
    words = sheet.text.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    note = f"BT /F1 7 Tf {MARGIN_MM * k:.2f} {(MARGIN_MM - 5.0) * k:.2f} Td ({words}) Tj ET\n"
    stream = (draw + "f\n" + note).encode("latin-1", "replace")
    box = f"[0 0 {sheet.width_mm * k:.4f} {sheet.height_mm * k:.4f}]"
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"
    return _pdf_file(
        [
            b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R"
            f" /Resources << /Font << /F1 {font} >> >> >>".encode(),
            b"<< /Length %d >>\nstream\n%s\nendstream" % (len(stream), stream),
        ]
    )


def svg(sheet: Sheet) -> bytes:
    boxes = "".join(
        f'<rect x="{r.x:.4f}" y="{r.y:.4f}" width="{r.width:.4f}" height="{r.height:.4f}"/>\n' for r in sheet.black
    )
    text = sheet.text.replace("&", "&amp;").replace("<", "&lt;")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sheet.width_mm}mm" height="{sheet.height_mm}mm"'
        f' viewBox="0 0 {sheet.width_mm} {sheet.height_mm}" shape-rendering="crispEdges">\n'
        f'<rect width="100%" height="100%" fill="white"/>\n{boxes}'
        f'<text x="{MARGIN_MM}" y="{sheet.height_mm - MARGIN_MM + 5}" font-size="2.5">{text}</text>\n</svg>\n'
    ).encode()


def png(sheet: Sheet) -> bytes:
    """Grey, with the resolution in a pHYs chunk."""
    size = round(sheet.height_mm * DOTS_PER_MM), round(sheet.width_mm * DOTS_PER_MM)
    dots = np.full(size, 255, np.uint8)
    for r in sheet.black:
        rows = slice(round(r.y * DOTS_PER_MM), round((r.y + r.height) * DOTS_PER_MM))
        dots[rows, round(r.x * DOTS_PER_MM) : round((r.x + r.width) * DOTS_PER_MM)] = 0
    lines = np.concatenate((np.zeros((size[0], 1), np.uint8), dots), axis=1)
    per_m = round(DOTS_PER_MM * 1000.0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", struct.pack(">IIBBBBB", size[1], size[0], 8, 0, 0, 0, 0))
        + _chunk(b"pHYs", struct.pack(">IIB", per_m, per_m, 1))
        + _chunk(b"IDAT", zlib.compress(lines.tobytes(), 6))
        + _chunk(b"IEND", b"")
    )


FORMATS: dict[str, Callable[[Sheet], bytes]] = {".pdf": pdf, ".svg": svg, ".png": png}
"""By the suffix of the file's name."""


def write(sheet: Sheet, path: Path) -> None:
    """ValueError where the suffix is none of FORMATS."""
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{path}: a sheet is written as one of {', '.join(FORMATS)}")
    path.write_bytes(FORMATS[path.suffix.lower()](sheet))


def _pdf_file(objects: list[bytes]) -> bytes:
    body, offsets = b"%PDF-1.4\n", []
    for number, content in enumerate(objects, 1):
        offsets.append(len(body))
        body += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    table = b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    size = len(objects) + 1
    return (
        body
        + b"xref\n0 %d\n0000000000 65535 f \n%strailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n"
        % (
            size,
            table,
            size,
            len(body),
        )
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
