"""Where edges lie in a picture, by area: what the renderer drew is compared with geometry written out by hand.

Nothing of the renderer is used here but the pictures.
"""

from __future__ import annotations

import math

import numpy as np

REACH_PX = 6
LEVEL_PX = 3
"""Grey of either side is read three pixels and more from the edge."""


def rotation(roll, pitch, yaw):
    """R_WB of a body that was yawed, then pitched, then rolled, entry by entry."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def quaternion(roll, pitch, yaw):
    """The same rotation as w x y z."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def body_from_world(point, position, angles):
    """p_B of a point in W for a vehicle at `position` with (roll, pitch, yaw)."""
    return rotation(*angles).T @ (np.array(point, float) - np.array(position, float))


def down_camera(p_B, offset=(0.0, 0.0, 0.05)):
    """Coordinates in the camera that looks down with its image top to the nose: right = B y, down = -B x, forward = B z."""
    x, y, z = np.array(p_B, float) - np.array(offset)
    return np.array([y, -x, z])


def pinhole_pixel(p_C, f=420.0, centre=(375.5, 239.5)):
    x, y, z = p_C
    return np.array([centre[0] + f * x / z, centre[1] + f * y / z])


def marker_corners_P(size, centre=(0.0, 0.0), yaw=0.0):
    """Top left, top right, bottom right, bottom left as the marker's image has them, in P."""
    c, s = math.cos(yaw), math.sin(yaw)
    square = ((0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5))
    return [(centre[0] + size * (c * x - s * y), centre[1] + size * (s * x + c * y), 0.0) for x, y in square]


def edge_offsets(image, corners_px, inset=0.08, reach_px=REACH_PX, level_px=LEVEL_PX):
    """Mean distance (4,) in pixels between the drawn edges and the straight lines through the corners, positive outward."""
    middle = np.mean(corners_px, axis=0)
    edges = zip(corners_px, np.roll(corners_px, -1, axis=0), strict=True)
    spans = [(a + inset * (b - a), b - inset * (b - a)) for a, b in edges]
    return np.array([edge_offset(image, a, b, middle, reach_px, level_px) for a, b in spans])


def edge_offset(image, a, b, inside, reach_px=REACH_PX, level_px=LEVEL_PX):
    """Mean distance in pixels between a drawn edge and the line from a to b, positive away from the dark point `inside`."""
    normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
    normal *= np.sign(normal @ ((a + b) / 2 - inside))
    return np.mean(list(_offsets_along(image, a, b, normal, reach_px, level_px)))


def _offsets_along(image, a, b, normal, reach_px, level_px):
    """One measurement for each row or column that crosses the edge: the dark length inside, by area, over the expected one."""
    axis = int(abs(normal[1]) > abs(normal[0]))
    sign = 1 if normal[axis] > 0 else -1
    low, high = sorted((a[1 - axis], b[1 - axis]))
    for line in range(math.ceil(low), math.floor(high) + 1):
        share = (line - a[1 - axis]) / (b[1 - axis] - a[1 - axis])
        expected = a[axis] + share * (b[axis] - a[axis])
        start = round(expected)
        along = start + sign * np.arange(-reach_px, reach_px + 1)
        if line < 0 or line >= image.shape[axis] or along.min() < 0 or along.max() >= image.shape[1 - axis]:
            continue
        profile = (image[line, along] if axis == 0 else image[along, line]).astype(float)
        dark, bright = profile[: reach_px + 1 - level_px].mean(), profile[reach_px + level_px :].mean()
        inside = np.clip((bright - profile) / (bright - dark), -0.2, 1.2).sum()
        measured = start + sign * (inside - reach_px - 0.5)
        yield (measured - expected) * sign * abs(normal[axis])
