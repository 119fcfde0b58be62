"""Sample frames for a report: small JPEGs inside the page, the pad's corners drawn where the detector saw them."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import cv2
import numpy as np

from companion.io.cameras.frame import decoded
from companion.messages import Image
from companion.telemetry.flight_record import FlightRecord, FrameSample

WIDTH_PX = 172
QUALITY = 55
GREEN = (80, 200, 60)
"""BGR."""


def filmstrip_html(record: FlightRecord) -> str:
    """Thumbnails in order of time; green border where the pad was found in that frame."""
    shown = [thumbnail for sample in record.samples if (thumbnail := _figure(record, sample))]
    return f'<div class="strip">{"".join(shown)}</div>' if shown else ""


def _figure(record: FlightRecord, sample: FrameSample) -> str:
    image = decoded(sample.content) if isinstance(sample.content, bytes) else sample.content
    if image is None:
        return ""
    corners = record.corners_px.get(sample.t_ns)
    jpeg = base64.b64encode(_thumbnail(image, corners or ())).decode()
    css, says = ("", "not seen") if corners is None else (' class="seen"', "seen")
    return (
        f'<figure><img{css} width="{WIDTH_PX}" alt="frame at {sample.t_s:.1f} s" src="data:image/jpeg;base64,{jpeg}">'
        f"<figcaption>{sample.t_s:.1f} s, {says}</figcaption></figure>"
    )


def _thumbnail(image: Image, corners_px: Sequence[tuple[float, float]]) -> bytes:
    scale = WIDTH_PX / image.shape[1]
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    colour = cv2.cvtColor(small, cv2.COLOR_GRAY2BGR) if small.ndim == 2 else small
    for start in range(0, len(corners_px) - 3, 4):
        outline = np.array(corners_px[start : start + 4]) * scale
        cv2.polylines(colour, [outline.round().astype(np.int32)], True, GREEN, 1, cv2.LINE_AA)
    good, jpeg = cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return jpeg.tobytes() if good else b""
