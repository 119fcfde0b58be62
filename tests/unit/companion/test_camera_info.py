"""camera_info YAML: as others write it, written and read again, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.camera_info import CameraInfo, parse, written
from companion.config import ConfigError, load

ROS = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo   # as camera_calibration writes it
camera_matrix:
  rows: 3
  cols: 3
  data: [ 438.783367,    0.000000,  305.593336,
            0.000000,  437.302876,  243.738352,
            0.000000,    0.000000,    1.000000]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]
"""
LISTED = """\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix:
  data:
  - 300.0
  - 0.0
  - 320.0
  - 0.0
  - 300.0
  - 240.0
  - 0
  - 0
  - 1
distortion_model: "equidistant"
distortion_coefficients:
  data:
  - 0.01
  - 0.0
  - 0.0
  - 0.0
"""
number = st.floats(-10.0, 10.0)


def test_a_file_of_ros_camera_calibration_is_read() -> None:
    info = parse(ROS)
    assert (info.model, info.width_px, info.height_px, info.camera_name) == ("pinhole", 640, 480, "narrow_stereo")
    assert (info.fx_px, info.cx_px, info.fy_px, info.cy_px) == (438.783367, 305.593336, 437.302876, 243.738352)
    assert info.distortion == (-0.361976, 0.110510, 0.001014, 0.000505, 0.0)


def test_lists_by_lines_and_equidistant_are_read() -> None:
    info = parse(LISTED)
    assert (info.model, info.distortion, info.cy_px) == ("kannala_brandt", (0.01, 0.0, 0.0, 0.0), 240.0)


@given(
    fx=st.floats(1.0, 5000.0),
    cx=st.floats(-100.0, 5000.0),
    distortion=st.one_of(*(st.tuples(*[number] * n) for n in (0, 4, 5, 8))),
)
def test_what_is_written_reads_as_the_same_value(fx: float, cx: float, distortion: tuple[float, ...]) -> None:
    info = CameraInfo("down", "pinhole", 752, 480, fx, fx, cx, cx, distortion)
    assert parse(written(info, "calibrated\nby hand")) == info


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("plumb_bob", "wavy"), "distortion_model 'wavy' is unknown"),
        (("image_width: 640", "image_width: wide"), "image_width must be"),
        (("438.783367", "-1"), "positive focal"),
        ((", 0.000000]", "]"), ""),
        (("data: [-0.36", "data: [minus-0.36"), "must be a list of numbers"),
        (("1.000000]", "1.000000"), "bracket"),
        (("camera_matrix:", "matrix:"), "camera_matrix is missing"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_with_the_reason(change: tuple[str, str], says: str) -> None:
    text = ROS.replace(*change)
    if not says:  # four coefficients are plumb_bob without k3
        assert len(parse(text).distortion) == 4
        return
    with pytest.raises(ValueError, match=says):
        parse(text)


@given(text=st.text(alphabet="abc:[]-, \n#019.", max_size=200))
def test_any_text_is_read_or_refused_as_a_value_error(text: str) -> None:
    with pytest.raises(ValueError):
        parse(text)


def test_the_configuration_takes_the_lens_from_the_file_beside_it(tmp_path: Path) -> None:
    (tmp_path / "down.yaml").write_text(ROS, encoding="utf-8")
    config = tmp_path / "my.toml"
    config.write_text('[cameras.down]\ncalibration_file = "down.yaml"\nfx_px = 1.0\n', encoding="utf-8")
    camera = load([config]).cameras["down"]
    assert (camera.fx_px, camera.width_px, camera.distortion[0]) == (438.783367, 640, -0.361976)


@pytest.mark.parametrize(("content", "says"), [(None, "cannot be read"), ("a: b", "distortion_model is missing")])
def test_a_bad_calibration_file_is_a_configuration_error_that_names_it(
    tmp_path: Path, content: str | None, says: str
) -> None:
    path = tmp_path / "down.yaml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(ConfigError, match=says) as raised:
        load([], {"cameras.down.calibration_file": str(path)})
    assert "[cameras.down] calibration_file" in str(raised.value)
