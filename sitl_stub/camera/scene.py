"""What stands in front of the camera: ground, deck (a box) with its markers, board; and the state of one frame.

Frames: W local NED, B vehicle body, P pad (origin: landing point on the deck's top), S a face (x up and y right as seen
from in front, z into the face). A `Scene` is built once; a `CameraView` says where everything is at mid-exposure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from sitl_stub.camera.image import Quaternion, Vec3
from sitl_stub.camera.light import Light, Patch
from sitl_stub.camera.mount import Pose
from sitl_stub.camera.pyramid import Pyramid, build_pyramid
from sitl_stub.markers.surface_texture import SurfaceTexture, board_texture, deck_texture
from sitl_stub.pad_layout import PadLayout

_IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
_ZERO: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A textured rectangle, `length_m` along S x by `width_m` along S y, centred on S; X_PS is fixed to the pad."""

    X_PS: Pose
    length_m: float
    width_m: float
    pyramid: Pyramid


@dataclass(frozen=True, slots=True)
class Scene:
    """`ground` is a name of GROUNDS; its plane lies at `ground_down_m` in W."""

    pad: PadLayout = field(default=PadLayout())
    ground: str = "field"
    ground_down_m: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraView:
    """Poses and motions at mid-exposure, light, and what is wrong with the camera. `t_us` moves the waves.

    `vehicle_*` is the body's origin; `deck_position_ned_m` and `deck_q_ned_pad` the pad frame P. Angular velocities are in
    the moving body's own frame (B, P). `covers` are patches that lie on the deck.
    """

    t_us: int
    vehicle_position_ned_m: Vec3
    vehicle_q_ned_frd: Quaternion
    deck_position_ned_m: Vec3
    deck_q_ned_pad: Quaternion = _IDENTITY
    vehicle_velocity_ned_m_s: Vec3 = _ZERO
    vehicle_angular_velocity_frd_rad_s: Vec3 = _ZERO
    deck_velocity_ned_m_s: Vec3 = _ZERO
    deck_angular_velocity_pad_rad_s: Vec3 = _ZERO
    light: Light = field(default=Light())
    covers: tuple[Patch, ...] = ()
    is_black: bool = False


@lru_cache(maxsize=16)
def surfaces_of(pad: PadLayout, coloured: bool) -> tuple[Surface, ...]:
    """The faces with something to see, the deck's top first."""
    cx, cy = pad.deck_center_m
    top = _surface(deck_texture(pad, coloured), Pose(np.eye(3), np.array([cx, cy, 0.0])))
    if pad.board_size_m is None:
        return (top,)
    height = pad.board_size_m[1]
    # The board looks back: its up is P -z, its right P y, and into it is P x.
    facing_back = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    foot_x = next((marker.position_m[0] for marker in pad.markers if marker.facing == "back"), pad.length_m / 2.0 + cx)
    return (top, _surface(board_texture(pad, coloured), Pose(facing_back, np.array([foot_x, cy, -height / 2.0]))))


def _surface(texture: SurfaceTexture, X_PS: Pose) -> Surface:
    pyramid = build_pyramid(texture.image, texture.metres_per_texel)
    return Surface(X_PS, texture.length_m, texture.width_m, pyramid)
