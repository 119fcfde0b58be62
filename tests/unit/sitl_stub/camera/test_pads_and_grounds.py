"""Pad files, their markers as a detector reads them, and grounds without markers of their own."""

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_measurement import edge_offsets, quaternion

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.ground import GROUNDS, TILE_PX, ground_of
from sitl_stub.camera.pyramid import build_pyramid, level_from_base
from sitl_stub.camera.scene import CameraView, Scene
from sitl_stub.camera.spec import CameraSpec
from sitl_stub.markers import MARKER_PAINTERS
from sitl_stub.pad_layout import PadLayout, PadLayoutError, pad_layout_from_toml

PADS = sorted((Path(__file__).parents[4] / "configs/pads").glob("*.toml"))


def layout(name):
    return pad_layout_from_toml(next(path for path in PADS if path.stem == name).read_text())


def detected(image, family):
    found = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family))).detectMarkers(image)
    return set() if found[1] is None else {int(marker_id) for marker_id in found[1].ravel()}


def seen_by(pad, seen, **spec):
    return Camera(CameraSpec(**spec), Scene(pad)).render(seen, np.random.default_rng(1))


def overhead(height_m):
    return CameraView(0, (0.05, 0.03, -0.5 - height_m), quaternion(0.03, -0.02, 0.4), (0.0, 0.0, -0.5))


@pytest.mark.parametrize("path", PADS, ids=lambda path: path.stem)
def test_every_pad_file_can_be_read_and_painted(path):
    pad = pad_layout_from_toml(path.read_text())
    assert pad.family in MARKER_PAINTERS
    assert seen_by(pad, overhead(3.0)).std() > 10


def test_the_default_layout_is_the_nested_pad_file():
    assert layout("nested") == PadLayout()


def test_the_large_marker_is_read_from_afar_and_the_nested_one_from_near():
    assert detected(seen_by(layout("nested"), overhead(8.0)), "DICT_4X4_50") == {45}
    assert detected(seen_by(layout("nested"), overhead(0.7)), "DICT_4X4_50") == {7}


def test_apriltags_are_read_with_their_ids():
    assert detected(seen_by(layout("apriltag"), overhead(2.4)), "DICT_APRILTAG_36h11") == {5, 6, 7}


def test_the_upright_marker_is_read_from_behind_and_not_from_ahead():
    pad = layout("guo")
    behind = CameraView(0, (-2.5, 0.1, -0.8), quaternion(0.02, -0.03, 0.05), (0.0, 0.0, -0.4))
    ahead = replace(behind, vehicle_position_ned_m=(4.0, 0.0, -0.8), vehicle_q_ned_frd=quaternion(0.0, 0.0, math.pi))

    assert detected(seen_by(pad, behind, mount_deg=(0.0, 90.0, 0.0)), "DICT_4X4_50") == {23}
    assert detected(seen_by(pad, ahead, mount_deg=(0.0, 90.0, 0.0)), "DICT_4X4_50") == set()


def test_the_upright_marker_stands_where_the_pad_file_says():
    # Level and 1.75 m behind the marker's foot, camera at the height of its centre: 0.4 m are 96 px, in the middle.
    seen = CameraView(0, (-1.0, 0.0, -0.75), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -0.4))
    image = seen_by(layout("guo"), seen, mount_deg=(0.0, 90.0, 0.0), position_frd_m=(0.0, 0.0, 0.0))
    half = 420.0 * 0.2 / 1.75
    expected = [(375.5 + right * half, 239.5 + down * half) for right, down in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    assert np.abs(edge_offsets(image, np.array(expected))).max() < 0.05


def test_the_circle_and_cross_have_the_documented_dimensions():
    tag = MARKER_PAINTERS["CIRCLE_CROSS"]("CIRCLE_CROSS", 0, 1000)
    middle_row, off_axis_row = tag[500] < 128, tag[300] < 128

    assert np.flatnonzero(np.diff(middle_row.astype(int))).tolist() == pytest.approx([99, 199, 799, 899], abs=1)
    assert off_axis_row[426:574].all()
    assert not off_axis_row[[420, 580]].any()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[pad]\ncolour = 3", "colour is not a key"),
        ("[[pad.markers]]\nid = 3", "needs id and size_m"),
        ("[[pad.markers]]\nid = 3\nsize_m = 0.0", "must be greater than 0"),
        ('[[pad.markers]]\nid = 3\nsize_m = 0.2\nfacing = "left"', "allowed are up, back"),
        ('[[pad.markers]]\nid = 3\nsize_m = 0.2\nfacing = "back"', "needs [pad] board_size_m"),
        ("pad = ", "is not valid TOML"),
        ("[deck]", "has no [pad]"),
    ],
)
def test_a_pad_file_that_cannot_be_used_is_refused_with_its_reason(text, complaint):
    with pytest.raises(PadLayoutError, match=r"my\.toml") as refusal:
        pad_layout_from_toml(text, "my.toml")
    assert complaint in str(refusal.value)


def test_an_id_outside_the_dictionary_is_refused():
    with pytest.raises(ValueError, match="ids 0 to 49"):
        MARKER_PAINTERS["DICT_4X4_50"]("DICT_4X4_50", 50, 100)


@pytest.mark.parametrize("name", sorted(GROUNDS))
def test_a_ground_holds_no_marker_but_enough_to_look_at(name):
    tile = ground_of(name, False).pyramid
    for level in tile.levels[:3]:
        assert detected(level, "DICT_4X4_50") == set()
        assert detected(level, "DICT_APRILTAG_36h11") == set()
    assert tile.levels[0].std() > 8.0


@pytest.mark.parametrize("name", sorted(GROUNDS))
def test_a_ground_tile_repeats_without_a_seam(name):
    tile = ground_of(name, False).pyramid.levels[2].astype(float)
    inside = np.abs(np.diff(tile, axis=0)).mean()
    across = np.abs(tile[0] - tile[-1]).mean()
    assert across < 1.25 * inside


def test_the_ground_stays_put_while_the_vehicle_flies_over_it():
    # 20.48 m is the tile: crossing its border must not move what is seen; one whole tile further it looks the same.
    here = CameraView(0, (20.4, 0.0, -5.0), (1.0, 0.0, 0.0, 0.0), (100.0, 0.0, -0.5))
    north = replace(here, vehicle_position_ned_m=(20.4 + 40 * 4.95 / 420.0, 0.0, -5.0))
    far = replace(here, vehicle_position_ned_m=(20.4 + 10 * 20.48, 0.0, -5.0), deck_position_ned_m=(-900.0, 0.0, -0.5))
    pictures = [seen_by(PadLayout(), view).astype(int) for view in (here, north, far)]

    assert np.abs(pictures[0][:440] - pictures[1][40:]).mean() < 3.0
    assert np.abs(pictures[0] - pictures[2]).mean() < 2.0


def test_water_moves_and_a_meadow_does_not():
    early = CameraView(0, (0.0, 0.0, -5.0), (1.0, 0.0, 0.0, 0.0), (100.0, 0.0, -0.5))
    late = replace(early, t_us=400_000)
    change = {}
    for name in ("field", "water"):
        camera = Camera(CameraSpec(), Scene(ground=name))
        before, after = (camera.render(view, np.random.default_rng(1)).astype(int) for view in (early, late))
        change[name] = np.abs(before - after).mean()
    assert change["field"] == 0.0
    assert change["water"] > 1.0


def test_halving_a_texture_keeps_an_edge_where_it_is():
    texture = np.zeros((64, 64), np.uint8)
    texture[:, 22:] = 200
    for level, image in enumerate(build_pyramid(texture, 0.01).levels[:5]):
        bright = image[0].astype(float).sum() / 200.0
        edge = level_from_base(level) @ (21.5, 0.0, 1.0)
        assert image.shape[1] - 0.5 - bright == pytest.approx(edge[0], abs=0.01)
    assert TILE_PX % 32 == 0


@pytest.mark.parametrize("colour", [False, True])
def test_pictures_have_the_size_and_channels_of_the_camera(colour):
    image = seen_by(PadLayout(), overhead(3.0), colour=colour, width_px=320, height_px=200)
    assert image.shape == ((200, 320, 3) if colour else (200, 320))
    assert image.dtype == np.uint8
