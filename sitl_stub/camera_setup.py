"""A scenario's [cameras] and [light] as camera channels: one small translation, so that neither side knows the other."""

from __future__ import annotations

import math

from sitl_stub import scenario
from sitl_stub.camera.camera import Camera
from sitl_stub.camera.light import Glare, Light, Shadow
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import Scene
from sitl_stub.camera.spec import CameraSpec, Effects
from sitl_stub.camera.stereo import StereoCamera
from sitl_stub.capture import CameraChannel
from sitl_stub.pad_layout import PadLayout
from sitl_stub.randomness import generator


def camera_channels(flown: scenario.Scenario, pad: PadLayout, seed: int) -> list[CameraChannel]:
    """One channel a camera, in the file's order."""
    scene = Scene(pad=pad, ground=flown.light.ground)
    return [
        CameraChannel(
            eye_of(camera_spec(name, settings), scene),
            generator(seed, f"camera {name} timing"),
            generator(seed, f"camera {name} pixels"),
        )
        for name, settings in flown.cameras.items()
    ]


def eye_of(spec: CameraSpec, scene: Scene) -> Camera | StereoCamera:
    return StereoCamera(spec, scene) if spec.stereo_baseline_m > 0.0 else Camera(spec, scene)


def camera_spec(name: str, settings: scenario.Camera) -> CameraSpec:
    return CameraSpec(
        name=name,
        model=settings.model,
        width_px=settings.width_px,
        height_px=settings.height_px,
        intrinsics=Intrinsics(
            settings.fx_px, settings.fy_px, settings.cx_px, settings.cy_px, tuple(settings.distortion)
        ),
        position_frd_m=settings.position_frd_m,
        mount_deg=settings.mount_deg,
        colour=settings.colour,
        rate_hz=settings.rate_hz,
        delay_s=settings.delay_s,
        delay_spread_s=settings.delay_spread_s,
        delay_kind=settings.delay_kind,
        drop_probability=settings.drop_probability,
        exposure_s=settings.exposure_s,
        stereo_baseline_m=settings.stereo_baseline_m,
        effects=Effects(
            noise_sigma=settings.noise_sigma,
            shot_noise_sigma=settings.shot_noise_sigma,
            vignetting=settings.vignetting,
            softness_px=settings.softness_px,
            readout_s=settings.readout_s,
            jpeg_quality=settings.jpeg_quality,
            motion_blur=settings.motion_blur,
        ),
    )


def light_of(settings: scenario.Light) -> Light:
    shadow = glare = None
    if settings.shadow_remaining is not None:
        direction = math.radians(settings.shadow_direction_deg)
        shadow = Shadow(direction, settings.shadow_offset_m, settings.shadow_remaining)
    if settings.glare_strength > 0.0:
        glare = Glare(settings.glare_position_m, settings.glare_radius_m, settings.glare_strength)
    return Light(brightness=settings.brightness, noise_gain=settings.noise_gain, shadow=shadow, glare=glare)
