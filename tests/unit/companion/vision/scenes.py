"""Small pictures of pads for the tests: a texture of the pad seen by a pinhole camera, over a ground of noise.

Independent of the simulator and of the code under test: plain OpenCV, four-fold supersampling, blur and noise after it.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
PX_PER_M = 400.0


def nested_pad_texture(size_m: float = 1.5) -> Image:
    """The default pad from above with +x of P up: white deck, id 45 of 1.2 m, id 7 of 0.24 m in the middle."""
    return pad_texture(size_m, cv2.aruco.DICT_4X4_50, ((45, 1.2, (0.0, 0.0)), (7, 0.24, (0.0, 0.0))))


def pad_texture(size_m: float, family: int, markers: tuple[tuple[int, float, tuple[float, float]], ...]) -> Image:
    """White square deck with upright markers (id, size, (x, y) of the centre in P)."""
    side = round(size_m * PX_PER_M)
    texture = np.full((side, side), 230, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(family)
    for marker_id, marker_m, (x, y) in markers:
        pixels = round(marker_m * PX_PER_M)
        marker = cv2.aruco.generateImageMarker(dictionary, marker_id, pixels)
        if marker_id == 7 and len(markers) > 1:  # the quiet zone of the nested marker
            quiet = round(0.4 * PX_PER_M)
            texture[_at(side, x, y, quiet)] = 230
        texture[_at(side, x, y, pixels)] = np.where(marker > 0, 230, 25)
    return texture


def _at(side: int, x: float, y: float, pixels: int) -> tuple[slice, slice]:
    row = round(side / 2 - x * PX_PER_M - pixels / 2)
    column = round(side / 2 + y * PX_PER_M - pixels / 2)
    return slice(row, row + pixels), slice(column, column + pixels)


def homography(
    texture: Image, R_CP: npt.NDArray[np.float64], p_CP: npt.NDArray[np.float64], K: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Texture pixels (centres at integers) to image pixels."""
    half = texture.shape[0] / 2.0
    # texture column = half - 0.5 + y * s, row = half - 0.5 - x * s
    to_pad = np.array(
        [
            [0.0, -1.0 / PX_PER_M, (half - 0.5) / PX_PER_M],
            [1.0 / PX_PER_M, 0.0, -(half - 0.5) / PX_PER_M],
            [0.0, 0.0, 1.0],
        ]
    )
    return np.asarray(K @ np.column_stack((R_CP[:, 0], R_CP[:, 1], p_CP)) @ to_pad)


def picture(
    texture: Image,
    R_CP: npt.NDArray[np.float64],
    p_CP: npt.NDArray[np.float64],
    K: npt.NDArray[np.float64],
    *,
    width: int = 752,
    height: int = 480,
    rng: np.random.Generator,
    blur_px: float = 0.6,
    noise: float = 3.0,
    ground: int = 110,
) -> Image:
    """Grey image of the pad on textured ground."""
    over = 4
    shift = np.array([[over, 0.0, (over - 1) / 2.0], [0.0, over, (over - 1) / 2.0], [0.0, 0.0, 1.0]])
    H = shift @ homography(texture, R_CP, p_CP, K)
    corners = np.array(
        [
            [-0.5, -0.5],
            [texture.shape[1] - 0.5, -0.5],
            [texture.shape[1] - 0.5, texture.shape[0] - 0.5],
            [-0.5, texture.shape[0] - 0.5],
        ]
    )
    outline = cv2.perspectiveTransform(corners[None], H)[0]
    # Shrink the texture first where it is far away: bilinear sampling of a fine texture would alias.
    span = float(np.ptp(outline, axis=0).max()) / texture.shape[0]
    small, G = texture, H
    if span < 0.5:
        factor = max(2, int(1.0 / span))
        while texture.shape[0] % factor:
            factor -= 1
        small = cv2.resize(texture, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
        G = H @ np.array([[factor, 0.0, (factor - 1) / 2.0], [0.0, factor, (factor - 1) / 2.0], [0.0, 0.0, 1.0]])
    big = cv2.warpPerspective(
        small, G, (width * over, height * over), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    mask = np.zeros((height * over, width * over), np.uint8)
    cv2.fillConvexPoly(mask, np.round(outline * 16).astype(np.int32), 255, shift=4)
    pad = cv2.resize(big, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    cover = cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    rough = ground + ground_texture(width, height, rng)
    image = cover * pad + (1.0 - cover) * rough
    image = cv2.GaussianBlur(image, (0, 0), blur_px) + rng.normal(0.0, noise, image.shape).astype(np.float32)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def ground_texture(width: int, height: int, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Gravel and patches: four octaves of smooth noise, standard deviation about 40 grey levels."""
    total = np.zeros((height, width), np.float32)
    for cell_px in (2, 5, 12, 40):
        coarse = rng.normal(0.0, 30.0, (height // cell_px + 2, width // cell_px + 2)).astype(np.float32)
        total += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return total


def looking_down(yaw_rad: float = 0.0, tilt_x_rad: float = 0.0, tilt_y_rad: float = 0.0) -> npt.NDArray[np.float64]:
    """R_CP of a camera above a level pad: at yaw 0 the pad's +x points to the top of the image."""
    level = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    yaw = cv2.Rodrigues(np.array([0.0, 0.0, yaw_rad]))[0]
    tilt = cv2.Rodrigues(np.array([tilt_x_rad, tilt_y_rad, 0.0]))[0]
    return np.asarray(tilt @ level @ yaw)


def camera_matrix(f: float = 420.0, cx: float = 375.5, cy: float = 239.5) -> npt.NDArray[np.float64]:
    return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


def cross_texture(size_m: float = 1.2, deck_m: float = 1.5) -> Image:
    """Circle and cross on a white deck: ring 0.1 wide, cross spanning 0.6 with bars 0.15 wide, in outer diameters."""
    side, px = round(deck_m * PX_PER_M), size_m * PX_PER_M
    down, right = np.mgrid[0:side, 0:side] - (side - 1) / 2.0
    radius = np.hypot(down, right)
    ring = (radius <= 0.5 * px) & (radius >= 0.4 * px)
    bars = (np.abs(down) <= 0.075 * px) & (np.abs(right) <= 0.3 * px)
    bars |= (np.abs(right) <= 0.075 * px) & (np.abs(down) <= 0.3 * px)
    return np.where(ring | bars, 25, 230).astype(np.uint8)
