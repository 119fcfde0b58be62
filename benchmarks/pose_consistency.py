"""How far the camera's own covariance of a pose is true: NEES of rotation and position in rendered pictures, by range.

    python benchmarks/pose_consistency.py [--frames N]

The 0.4 m marker at 752 x 480, tilted by up to 20 degrees against the line of sight, pose and gravity foreseen as in a tracked flight. 3 is
what a true covariance gives. `corner noise` is the noise of a corner that would make the NEES 3, beside `[vision] pixel_sigma_px`.
"""

from __future__ import annotations

import argparse
import math

import cv2
import numpy as np
from detection import SMALL, shot

from companion.config import Vision
from companion.geometry import matrix_from_quaternion
from companion.messages import PadObservation
from companion.vision import DETECTORS
from companion.vision.lens import from_config
from sitl_stub.camera.camera import Camera
from sitl_stub.camera.scene import Scene

RANGES_M = (1.5, 3.0, 5.0, 8.0, 11.0)


def nees(range_m: float, frames: int) -> tuple[list[float], list[float]]:
    """Of rotation and of position, for each frame with a pose."""
    eye = DETECTORS["aruco"](Vision(), SMALL.pad, from_config(SMALL.camera))
    camera = Camera(SMALL.spec, Scene(pad=SMALL.sim_pad, ground=SMALL.ground, ground_down_m=0.0))
    rotation, position = [], []
    for k in range(frames):
        rng = np.random.default_rng((77, k, round(10 * range_m)))
        one = shot(SMALL, camera, rng, range_m, tilt_deg=float(rng.uniform(0.0, 20.0)))
        found = eye.detect(one.frame, one.prior)
        if not isinstance(found, PadObservation) or found.q_camera_pad is None:
            continue
        R, true = (np.array(matrix_from_quaternion(q)) for q in (found.q_camera_pad, one.X_CP.q))
        turn = cv2.Rodrigues(R @ true.T)[0][:, 0]
        off = np.array(found.pad_position_camera_m) - np.array(one.X_CP.p)
        rotation.append(float(turn @ np.linalg.solve(np.array(found.rotation_covariance_rad2), turn)))
        position.append(float(off @ np.linalg.solve(np.array(found.position_covariance_m2), off)))
    return rotation, position


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=40)
    frames, assumed_px = parser.parse_args().frames, Vision().pixel_sigma_px
    print(f"{frames} pictures a row; pixel_sigma_px = {assumed_px}\n")
    print("| range m | poses | NEES rotation | corner noise px | NEES position | corner noise px |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for range_m in RANGES_M:
        both = nees(range_m, frames)
        cells = [f"{np.mean(values):.2f} | {assumed_px * math.sqrt(np.mean(values) / 3.0):.2f}" for values in both]
        print(f"| {range_m:g} | {len(both[0])} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
