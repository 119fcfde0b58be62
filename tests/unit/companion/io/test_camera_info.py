"""Calibration files: what ROS writes is read, what we write is read back, what is wrong is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion import config
from companion.io import camera_info

ROS_FILE = """\
image_width: 848
image_height: 480
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [422.27, 0.0, 425.83,
         0.0, 422.88, 239.86,
         0.0, 0.0, 1.0]   # px
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.0028, -0.0041, 0.00034, -0.00036, 7.66e-04]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


def test_a_file_of_ros_is_read() -> None:
    info = camera_info.parse(ROS_FILE, "front.yaml")
    assert (info.name, info.model, info.width_px, info.height_px) == ("front", "pinhole", 848, 480)
    assert (info.fx_px, info.fy_px, info.cx_px, info.cy_px) == (422.27, 422.88, 425.83, 239.86)
    assert info.distortion == (0.0028, -0.0041, 0.00034, -0.00036, 0.000766)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [
        ("pinhole", (0.1, -0.02, 0.001, 0.0, 0.003)),
        ("pinhole", (0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6)),
        ("kannala_brandt", (-0.02, 0.004, 0.0, 1e-5)),
        ("scaramuzza", (210.0, 0.0, -1.2e-3, 8e-7, -1e-9)),
    ],
)
def test_what_is_written_is_read_back(tmp_path: Path, model: str, distortion: tuple[float, ...]) -> None:
    camera = config.Camera(model=model, distortion=distortion, fx_px=300.25, fy_px=301.5)  # type: ignore[arg-type]
    path = tmp_path / "down.yaml"
    camera_info.write(path, camera_info.of("down", camera))
    assert config.with_lens(config.Camera(delay_s=0.1), camera_info.read(path)) == config.Camera(
        model=model,  # type: ignore[arg-type]
        distortion=distortion,
        fx_px=300.25,
        fy_px=301.5,
        delay_s=0.1,
    )


def test_the_calibration_file_of_a_camera_replaces_its_lens_only(tmp_path: Path) -> None:
    path = tmp_path / "front.yaml"
    path.write_text(ROS_FILE, encoding="utf-8")
    camera = config.calibrated(config.Camera(calibration_file=str(path), mount_deg=(0.0, 90.0, 0.0)))
    assert (camera.width_px, camera.fx_px, camera.mount_deg) == (848, 422.27, (0.0, 90.0, 0.0))


def test_a_camera_without_a_calibration_file_stays_as_it_is() -> None:
    assert config.calibrated(config.Camera()) == config.Camera()


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("plumb_bob", "thin_prism", "thin_prism"),
        ("image_width: 848", "image_width: wide", "image_width"),
        ("camera_matrix", "matrix", "camera_matrix.data is missing"),
        ("0.0, 0.0, 1.0]", "0.0, 0.0]", "not 9"),
        ("0.00034, -0.00036, 7.66e-04]", "0.00034]", "plumb_bob has"),
        ("422.27", "four", "camera_matrix.data"),
    ],
)
def test_what_is_wrong_is_named_with_the_file(old: str, new: str, text: str) -> None:
    with pytest.raises(camera_info.CalibrationError, match=text) as refused:
        camera_info.parse(ROS_FILE.replace(old, new), "front.yaml")
    assert "front.yaml" in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(camera_info.CalibrationError, match=r"missing\.yaml"):
        camera_info.read(tmp_path / "missing.yaml")


def test_a_focal_length_that_no_lens_has_is_refused() -> None:
    with pytest.raises(camera_info.CalibrationError, match="must be positive"):
        camera_info.parse(ROS_FILE.replace("422.27", "-1"), "front.yaml")


def test_loading_a_configuration_takes_the_lens_from_the_file_beside_it(tmp_path: Path) -> None:
    (tmp_path / "down.yaml").write_text(ROS_FILE, encoding="utf-8")
    file = tmp_path / "my.toml"
    file.write_text('[cameras.down]\ncalibration_file = "down.yaml"\nfx_px = 1.0\n', encoding="utf-8")
    camera = config.load([file]).cameras["down"]
    assert (camera.fx_px, camera.width_px, camera.distortion[0]) == (422.27, 848, 0.0028)


@pytest.mark.parametrize(("content", "says"), [(None, "cannot be read"), ("a: b", "is missing")])
def test_a_bad_calibration_file_is_a_configuration_error_that_names_the_camera_and_the_file(
    tmp_path: Path, content: str | None, says: str
) -> None:
    path = tmp_path / "down.yaml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(config.ConfigError, match=says) as raised:
        config.load([], {"cameras.down.calibration_file": str(path)})
    assert "[cameras.down] calibration_file" in str(raised.value)
    assert str(path) in str(raised.value)
