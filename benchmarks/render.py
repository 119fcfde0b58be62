"""Time of one simulated camera frame, on one core, beside a plain renderer of the same picture in the same run.

    python benchmarks/render.py [--json] [--repeat N]

The plain renderer does what first comes to mind: one full-frame warp of a large ground texture, one of the pad over it, fresh
normal noise. Views are those of a landing: down from 10 m, deck at 1.5 m/s, with the motion blur that goes with it. Times are
processor time, median and best of N frames, milliseconds; the ratio is of medians.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable

import cv2
import numpy as np

from sitl_stub.camera.camera import Camera
from sitl_stub.camera.ground import ground_of
from sitl_stub.camera.projection import Intrinsics
from sitl_stub.camera.scene import CameraView, Scene, surfaces_of
from sitl_stub.camera.spec import CameraSpec, Effects

HEIGHTS_M = (10.0, 5.0, 2.5, 1.2, 0.6, 0.3)
FISHEYE = Intrinsics(240.0, 240.0, 375.5, 239.5, (-0.01, 0.002, 0.0, 0.0))
RADTAN = Intrinsics(420.0, 420.0, 375.5, 239.5, (-0.28, 0.08, 0.0005, -0.0003, 0.0))
CAMERAS = {
    "pinhole": CameraSpec(),
    "pinhole distorted": CameraSpec(intrinsics=RADTAN),
    "rolling shutter": CameraSpec(effects=Effects(readout_s=0.02)),
    "kannala_brandt": CameraSpec(model="kannala_brandt", intrinsics=FISHEYE),
    "pinhole colour": CameraSpec(colour=True),
}


def landing_view(height_m: float) -> CameraView:
    """Over a deck that drives north at 1.5 m/s; the vehicle still closes in and tilts a little."""
    return CameraView(
        t_us=0,
        vehicle_position_ned_m=(-0.05 * height_m, 0.03 * height_m, -0.5 - height_m),
        vehicle_q_ned_frd=(0.99796, 0.03, -0.04, 0.04),
        deck_position_ned_m=(0.0, 0.0, -0.5),
        vehicle_velocity_ned_m_s=(1.5 + 0.1 * height_m, 0.0, 0.5),
        vehicle_angular_velocity_frd_rad_s=(0.05, -0.08, 0.02),
        deck_velocity_ned_m_s=(1.5, 0.0, 0.0),
    )


class PlainRenderer:
    """The same scene for a pinhole camera, without mip levels, bounding boxes or a bank of noise."""

    def __init__(self, spec: CameraSpec, scene: Scene) -> None:
        self._camera = Camera(spec, scene)
        tile = ground_of(scene.ground, False).pyramid.levels[0]
        self._ground = np.tile(tile, (4, 4))
        self._ground_m = 4 * 20.48
        self._deck = surfaces_of(scene.pad, False)[0].pyramid.levels[0]
        self._deck_m = scene.pad.length_m

    def render(self, view: CameraView, rng: np.random.Generator) -> np.ndarray:
        geometry = self._camera._geometry(view)
        size = (752, 480)
        ground = geometry.X_CW
        canvas = self._warp(self._ground, self._ground_m, ground.R, ground.p, size, None)
        canvas = self._warp(self._deck, self._deck_m, geometry.X_CP.R, geometry.X_CP.p, size, canvas)
        noise = rng.standard_normal(canvas.shape, np.float32) * 2.5
        return np.clip(canvas + noise, 0, 255).astype(np.uint8)

    def _warp(self, texture, side_m, R, p, size, onto):
        per_m = texture.shape[0] / side_m
        K = np.array([[420.0, 0.0, 375.5], [0.0, 420.0, 239.5], [0.0, 0.0, 1.0]])
        middle = texture.shape[0] / 2.0 - 0.5
        texels = np.array([[0.0, per_m, middle], [-per_m, 0.0, middle], [0.0, 0.0, 1.0]])
        H = texels @ np.linalg.inv(K @ np.stack([R[:, 0], R[:, 1], p], axis=1))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        if onto is None:
            return cv2.warpPerspective(texture, H, size, flags=flags, borderMode=cv2.BORDER_WRAP)
        return cv2.warpPerspective(texture, H, size, dst=onto, flags=flags, borderMode=cv2.BORDER_TRANSPARENT)


def frame_times_ms(
    render: Callable[[CameraView, np.random.Generator], object], view: CameraView, repeat: int
) -> list[float]:
    rng = np.random.default_rng(1)
    render(view, rng)
    times = []
    for _ in range(repeat):
        start = time.process_time()
        render(view, rng)
        times.append((time.process_time() - start) * 1e3)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON row a line")
    parser.add_argument("--repeat", type=int, default=60, help="frames a row")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    plain = PlainRenderer(CameraSpec(), Scene())
    for name, spec in CAMERAS.items():
        camera = Camera(spec, Scene())
        for height_m in HEIGHTS_M:
            view = landing_view(height_m)
            times = frame_times_ms(camera.render, view, options.repeat)
            row = {"camera": name, "height_m": height_m, "median_ms": statistics.median(times), "best_ms": min(times)}
            if name == "pinhole":
                plainly = statistics.median(frame_times_ms(plain.render, view, max(5, options.repeat // 6)))
                row |= {"plain_ms": plainly, "ratio": plainly / row["median_ms"]}
            rows.append(row)
    for row in rows:
        print(json.dumps(row) if options.json else _line(row))


def _line(row: dict) -> str:
    text = (
        f"{row['camera']:18s} {row['height_m']:5.1f} m  median {row['median_ms']:5.2f}  best {row['best_ms']:5.2f} ms"
    )
    return text + (f"  plain {row['plain_ms']:6.2f} ms  {row['ratio']:4.1f} x" if "ratio" in row else "")


if __name__ == "__main__":
    main()
