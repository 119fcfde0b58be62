"""Printed pads: true size in every format, and a drawing that the detector finds where the layout says."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from companion import config, make_pad
from companion.messages import CameraImage, PadObservation
from companion.vision import DETECTORS
from companion.vision.pinhole import Pinhole

PAD = config.Pad()


def test_a_pdf_page_is_the_deck_in_points() -> None:
    """1.5 m are 4251.97 points of 1/72 inch."""
    data = make_pad.pdf(make_pad.draw(PAD), 72)
    box = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)
    assert box is not None
    assert float(box[1]) == pytest.approx(1.5 / 0.0254 * 72.0, abs=1e-3)
    assert data.startswith(b"%PDF-1.4")
    assert data.endswith(b"%%EOF\n")


def test_the_offsets_of_a_pdf_point_at_its_objects() -> None:
    data = make_pad.pdf(make_pad.draw(PAD), 72)
    for number, start in enumerate(re.findall(rb"(\d{10}) 00000 n", data), start=1):
        assert data[int(start) :].startswith(b"%d 0 obj" % number)
    table = int(re.search(rb"startxref\n(\d+)", data)[1])  # type: ignore[index]
    assert data[table:].startswith(b"xref")


def test_the_black_square_of_the_pdf_is_1200_mm_wide() -> None:
    data = make_pad.pdf(make_pad.draw(PAD), 72)
    content = zlib.decompress(re.search(rb"stream\n(.*)\nendstream", data, re.DOTALL)[1]).decode()  # type: ignore[index]
    black = next(line for line in content.splitlines() if line.startswith("0.0000 0.0000 0.0000 rg"))
    x = [float(number) for number in re.findall(r"([\d.]+) [\d.]+ [ml]", black)]
    assert (max(x) - min(x)) * 25.4 / 72.0 == pytest.approx(1200.0, abs=0.01)


def test_an_svg_is_in_millimetres() -> None:
    text = make_pad.svg(make_pad.draw(PAD), 72).decode()
    assert 'width="1500.0000mm" height="1500.0000mm" viewBox="0 0 1500.0000 1500.0000"' in text
    assert "M150.0000 150.0000 L1350.0000 150.0000" in text


def test_a_png_carries_its_resolution_and_opens() -> None:
    data = make_pad.png(make_pad.draw(PAD), 50)
    kind = data.index(b"pHYs")
    assert struct.unpack(">IIB", data[kind + 4 : kind + 13]) == (round(50 / 0.0254), round(50 / 0.0254), 1)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (2953, 2953, 3)


@pytest.mark.parametrize(
    "pad", [PAD, config.Pad(family="DICT_APRILTAG_36h11", markers=(config.Marker(id=9, size_m=0.8),))]
)
def test_a_camera_above_the_print_finds_the_landing_point(pad: config.Pad) -> None:
    """The picture itself is the view of a camera 2 m above: f = 2 m times its pixels per metre."""
    drawing = make_pad.draw(pad)
    image = cv2.imdecode(np.frombuffer(make_pad.png(drawing, 10), np.uint8), cv2.IMREAD_GRAYSCALE)
    image = cv2.copyMakeBorder(image, 45, 45, 45, 45, cv2.BORDER_CONSTANT, value=120)
    side, f = image.shape[0], 2.0 * 10.0 / 0.0254
    lens = Pinhole(width_px=side, height_px=side, fx_px=f, fy_px=f, cx_px=(side - 1) / 2.0, cy_px=(side - 1) / 2.0)
    detection = DETECTORS["aruco"](config.Vision(), pad, lens).detect(CameraImage(0, "print", image, 0), None)
    assert isinstance(detection, PadObservation)
    np.testing.assert_allclose(detection.pad_position_camera_m, (0.0, 0.0, 2.0), atol=0.006)


def test_the_layout_file_is_the_pad_again(tmp_path: Path) -> None:
    pad = config.Pad(
        length_m=1.2,
        width_m=0.7,
        deck_center_m=(0.2, 0.0),
        board_size_m=(0.7, 0.7),
        markers=(config.Marker(id=3, size_m=0.4, position_m=(0.75, 0.0), yaw_deg=30.0, facing="back", height_m=0.4),),
    )
    paths = make_pad.write_pad(pad, tmp_path, "boat", formats=("svg",), dots_per_inch=72)
    assert [path.name for path in paths] == ["boat.toml", "boat.svg"]
    assert config.load([paths[0]]).pad == pad


@pytest.mark.parametrize("family", ["CIRCLE_CROSS", "RED_DISC"])
def test_tags_without_codes_are_drawn_too(family: str) -> None:
    pad = config.Pad(family=family, markers=(config.Marker(id=0, size_m=1.2),))
    image = cv2.imdecode(np.frombuffer(make_pad.png(make_pad.draw(pad), 10), np.uint8), cv2.IMREAD_COLOR)
    middle = image[image.shape[0] // 2, image.shape[1] // 2]
    assert middle.tolist() == ([0, 0, 0] if family == "CIRCLE_CROSS" else [20, 20, 220])
    assert image[5, 5].tolist() == [255, 255, 255]


@pytest.mark.parametrize(
    ("pad", "text"),
    [
        (config.Pad(markers=(config.Marker(id=45, size_m=1.6),)), "does not lie on the deck"),
        (config.Pad(markers=(config.Marker(id=77, size_m=0.5),)), "not in DICT_4X4_50"),
        (config.Pad(family="DICT_3X3"), "unknown"),
    ],
)
def test_a_pad_that_cannot_be_printed_is_refused_with_the_reason(pad: config.Pad, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        make_pad.draw(pad)


def test_an_unknown_format_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'dxf' is not one of pdf, svg, png"):
        make_pad.write_pad(PAD, tmp_path / "new", "pad", formats=("svg", "dxf"), dots_per_inch=72)
    assert not (tmp_path / "new").exists()
