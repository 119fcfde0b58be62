"""One camera as a scenario describes it: lens, size, mount, timing and imperfections. Frozen; camera.py builds on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from sitl_stub.camera.image import Vec3
from sitl_stub.camera.mount import mount_rotation
from sitl_stub.camera.projection import Intrinsics


@dataclass(frozen=True, slots=True)
class Effects:
    """What a lens and a sensor do to a picture. Zero or False switches each off.

    `noise_sigma` is the noise of a black pixel in grey levels, `shot_noise_sigma` what light adds at full scale (it grows
    with the root of the light). `vignetting` is the light lost in the corners, `softness_px` the lens's blur (Gaussian
    sigma), `readout_s` the time a rolling shutter takes from the first row to the last, `jpeg_quality` 1 to 100.
    """

    noise_sigma: float = 1.5
    shot_noise_sigma: float = 3.0
    vignetting: float = 0.0
    softness_px: float = 0.0
    readout_s: float = 0.0
    jpeg_quality: int = 0
    motion_blur: bool = True


@dataclass(frozen=True, slots=True)
class CameraSpec:
    """`position_frd_m` is p_BC; `mount_deg` as in mount.py. With a `stereo_baseline_m` each frame holds two pictures (stereo.py). `exposure_s` sets the motion blur, not the brightness (that is
    the light's). Delay of a frame from mid-exposure to hand-out: see delay.py."""

    name: str = "down"
    model: str = "pinhole"
    width_px: int = 752
    height_px: int = 480
    intrinsics: Intrinsics = field(default=Intrinsics())
    position_frd_m: Vec3 = (0.0, 0.0, 0.05)
    mount_deg: Vec3 = (0.0, 0.0, 0.0)
    colour: bool = False
    rate_hz: float = 30.0
    delay_s: float = 0.05
    delay_spread_s: float = 0.0
    delay_kind: str = "constant"
    drop_probability: float = 0.0
    exposure_s: float = 0.003
    stereo_baseline_m: float = 0.0
    effects: Effects = field(default=Effects())


def stereo_pair(left: CameraSpec, baseline_m: float) -> tuple[CameraSpec, CameraSpec]:
    """The camera and a second one `baseline_m` along its own image right (C x), named <name>_left and <name>_right."""
    along = mount_rotation(left.mount_deg)[:, 0] * baseline_m
    x, y, z = left.position_frd_m
    moved = (x + float(along[0]), y + float(along[1]), z + float(along[2]))
    return (
        replace(left, name=f"{left.name}_left"),
        replace(left, name=f"{left.name}_right", position_frd_m=moved),
    )
