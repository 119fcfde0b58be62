"""Where the markers' corners are on the pad: facts to check by hand."""

from __future__ import annotations

import numpy as np
import pytest

from companion import config
from companion.vision import pad_layout


def corners(**keys: object) -> np.ndarray:
    return pad_layout.marker_corners(config.Marker(id=1, size_m=2.0, **keys))  # type: ignore[arg-type]


def test_the_top_left_corner_is_ahead_and_to_the_left() -> None:
    np.testing.assert_allclose(corners(), [(1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 0)])


def test_a_quarter_turn_to_the_right_points_the_top_edge_to_the_right() -> None:
    np.testing.assert_allclose(corners(yaw_deg=90.0), [(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)], atol=1e-12)


def test_a_marker_that_faces_back_stands_with_its_top_edge_up() -> None:
    expected = [(0.75, -1, -1.4), (0.75, 1, -1.4), (0.75, 1, 0.6), (0.75, -1, 0.6)]
    np.testing.assert_allclose(corners(facing="back", position_m=(0.75, 0.0), height_m=0.4), expected, atol=1e-12)


def test_the_extent_holds_every_marker() -> None:
    layout = pad_layout.from_config(config.Pad())
    np.testing.assert_allclose(layout.extent_P.min(axis=0), (-0.6, -0.6, 0.0))
    np.testing.assert_allclose(layout.extent_P.max(axis=0), (0.6, 0.6, 0.0))


@pytest.mark.parametrize(
    ("pad", "text"),
    [
        (config.Pad(family="DICT_9X9"), "unknown"),
        (config.Pad(markers=(config.Marker(id=50, size_m=1.0),)), "ids 0 to 49"),
        (config.Pad(markers=(config.Marker(id=3, size_m=1.0), config.Marker(id=3, size_m=0.2))), "twice"),
        (config.Pad(markers=()), "at least one"),
    ],
)
def test_a_pad_that_cannot_be_is_refused_with_the_reason(pad: config.Pad, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        pad_layout.from_config(pad)
