"""Feet and frame against the ground and a moving deck: spring and damper across, Coulomb friction along.

Frames: W local NED, B body FRD of the vehicle, D the deck (x along travel, y right, z down, origin on the pad's centre).
Each point that touches keeps an anchor in the surface's own frame; the spring between point and anchor is what sticks, and
it slides when it would exceed friction, so that a vehicle at rest on a moving deck does not creep. Points: the feet, and
points of the frame (hubs, belly), which touch only when it has tipped or hit something. The deck is a box: a point that
comes in through the top presses on the top, one that comes in through a side on that side. The edge of the box against
the span between two points is not modelled. Called by the world at 1 ms while anything is near; forces act on the centre of
gravity, for Multirotor.step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sitl_stub.carriers.deck import DeckState

Vec3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Stiffness so that the natural frequency on four feet is 100 rad/s: a millimetre of sag, far from the limit at 1 ms steps.
_STIFFNESS_1_S2 = 2500.0
_TANGENTIAL_RATIO = 0.8
_CRUSH_LIMIT_M = 0.5
_LARGEST_DAMPING_RATIO = 1.5

_ABOVE = (0.0, 0.0, -1.0)
_TOP, _FRONT, _BACK, _RIGHT, _LEFT = range(5)
# Outward normals of the box's faces in D.
_NORMALS: tuple[Vec3, ...] = (
    (0.0, 0.0, -1.0),
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
)


@dataclass(frozen=True, slots=True)
class DeckShape:
    """The box under the deck's top: extent in D and how far it goes down."""

    length_m: float
    width_m: float
    center_x_m: float = 0.0
    center_y_m: float = 0.0
    depth_m: float = 0.5


@dataclass(frozen=True, slots=True)
class Surface:
    """How the surfaces feel."""

    deck_friction: float = 0.7
    ground_friction: float = 0.8
    restitution: float = 0.15


@dataclass(slots=True)
class ContactState:
    """What touches what after the last step: for the verdict, the land detector and display."""

    feet_on_deck: int = 0
    feet_on_ground: int = 0
    frame_on_deck: int = 0
    frame_on_ground: int = 0
    side_hits: int = 0
    """Points that press against a side of the deck."""
    gap_m: float = math.inf
    """How far the lowest foot is above what is under it; not positive while one touches. Infinite: not looked at."""
    force_ned_n: Vec3 = (0.0, 0.0, 0.0)
    torque_frd_nm: Vec3 = (0.0, 0.0, 0.0)

    @property
    def is_touching(self) -> bool:
        return bool(
            self.feet_on_deck + self.feet_on_ground + self.frame_on_deck + self.frame_on_ground + self.side_hits
        )


@dataclass(slots=True)
class _Point:
    """One point of the vehicle, and what it holds on to."""

    at_frd_m: Vec3
    is_foot: bool
    face: int = -1
    anchor_d_m: Vec3 = (0.0, 0.0, 0.0)
    on_ground: bool = False
    anchor_north_m: float = 0.0
    anchor_east_m: float = 0.0
    last_d_m: Vec3 = _ABOVE


class Contact:
    """Contact of one vehicle with the ground plane (z = 0) and one deck."""

    def __init__(
        self,
        *,
        mass_kg: float,
        feet_frd_m: tuple[Vec3, ...],
        frame_frd_m: tuple[Vec3, ...],
        deck: DeckShape,
        surface: Surface,
    ) -> None:
        self._points = [_Point(p, True) for p in feet_frd_m] + [_Point(p, False) for p in frame_frd_m]
        self._stiffness = mass_kg * _STIFFNESS_1_S2
        self._damping = foot_damping(mass_kg, len(feet_frd_m), self._stiffness, surface.restitution)
        self._shape = deck
        self._surface = surface
        self._reach_m = max(math.dist((0.0, 0.0, 0.0), p) for p in (*feet_frd_m, *frame_frd_m))
        corner = math.hypot(deck.center_x_m, deck.center_y_m) + 0.5 * math.hypot(deck.length_m, deck.width_m)
        self._deck_radius_m = corner
        self.state = ContactState()

    def clearance_m(self, position_ned_m: Vec3, deck: DeckState) -> float:
        """No point of the vehicle is nearer than this to the ground or the deck, however it is turned; <= 0: it may touch."""
        z = position_ned_m[2]
        above = deck.position_ned_m[2] - self._deck_radius_m * _steepness(deck) - z
        return min(-z, max(self._aside_m(position_ned_m, deck), above)) - self._reach_m

    def _aside_m(self, position_ned_m: Vec3, deck: DeckState) -> float:
        """Horizontal distance to the circle around the deck's corners."""
        o = deck.position_ned_m
        return math.hypot(position_ned_m[0] - o[0], position_ned_m[1] - o[1]) - self._deck_radius_m

    def release(self) -> None:
        """Nothing is near: forget all anchors."""
        self.state = ContactState()
        for point in self._points:
            self._let_go(point)

    def _let_go(self, point: _Point) -> None:
        if point.face >= 0 or point.on_ground:
            point.face, point.on_ground = -1, False
        point.last_d_m = _ABOVE

    def step(
        self,
        position_ned_m: Vec3,
        velocity_ned_m_s: Vec3,
        q_ned_frd: Quaternion,
        rates_frd_rad_s: Vec3,
        deck: DeckState,
    ) -> ContactState:
        """Force (N, W) and torque (N m, B, about the centre of gravity) of all points that touch now."""
        r = rotation_matrix(q_ned_frd)
        wx, wy, wz = _rotated(r, rates_frd_rad_s)
        px, py, pz = position_ned_m
        vx, vy, vz = velocity_ned_m_s
        deck_is_near = self._aside_m(position_ned_m, deck) < self._reach_m
        # Above this nothing can touch: the common case while the vehicle stands, for all but the feet.
        ceiling = min(deck.position_ned_m[2] - self._deck_radius_m * _steepness(deck), 0.0) if deck_is_near else 0.0
        state = ContactState()
        fx = fy = fz = tx = ty = tz = 0.0
        for point in self._points:
            ax, ay, az = _rotated(r, point.at_frd_m)
            p = (px + ax, py + ay, pz + az)
            if p[2] <= ceiling and not point.is_foot:
                self._let_go(point)
                continue
            v = (vx + wy * az - wz * ay, vy + wz * ax - wx * az, vz + wx * ay - wy * ax)
            over_deck, on_deck = self._on_deck(point, p, v, deck, state) if deck_is_near else (False, None)
            # The water under a boat goes up and down with it: no ground where the deck is.
            on_ground = None if over_deck else self._on_ground(point, p, v, state)
            for force in (on_deck, on_ground):
                if force is not None:
                    gx, gy, gz = force
                    fx, fy, fz = fx + gx, fy + gy, fz + gz
                    tx, ty, tz = tx + ay * gz - az * gy, ty + az * gx - ax * gz, tz + ax * gy - ay * gx
        state.force_ned_n = (fx, fy, fz)
        state.torque_frd_nm = (
            r[0] * tx + r[3] * ty + r[6] * tz,
            r[1] * tx + r[4] * ty + r[7] * tz,
            r[2] * tx + r[5] * ty + r[8] * tz,
        )
        self.state = state
        return state

    def _on_ground(self, point: _Point, p: Vec3, v: Vec3, state: ContactState) -> Vec3 | None:
        if point.is_foot and -p[2] < state.gap_m:
            state.gap_m = -p[2]
        if p[2] <= 0.0:
            point.on_ground = False
            return None
        if not point.on_ground:
            point.on_ground, point.anchor_north_m, point.anchor_east_m = True, p[0], p[1]
        normal = self._press(p[2], v[2])
        sx, sy = p[0] - point.anchor_north_m, p[1] - point.anchor_east_m
        friction_x, friction_y, kept = self._friction(sx, sy, v[0], v[1], self._surface.ground_friction * normal)
        point.anchor_north_m, point.anchor_east_m = p[0] - kept * sx, p[1] - kept * sy
        if point.is_foot:
            state.feet_on_ground += 1
        else:
            state.frame_on_ground += 1
        return (friction_x, friction_y, -normal)

    def _on_deck(
        self, point: _Point, p: Vec3, v: Vec3, deck: DeckState, state: ContactState
    ) -> tuple[bool, Vec3 | None]:
        """Whether the point is within the deck's outline, and the force on it if it touches."""
        r = deck.rotation_ned_deck
        o, u, w = deck.position_ned_m, deck.velocity_ned_m_s, deck.angular_velocity_ned_rad_s
        dx, dy, dz = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        d = (r[0] * dx + r[3] * dy + r[6] * dz, r[1] * dx + r[4] * dy + r[7] * dz, r[2] * dx + r[5] * dy + r[8] * dz)
        face = self._face(point, d)
        point.last_d_m, point.face = d, face
        is_over = self._is_over(d)
        if point.is_foot and is_over and -d[2] < state.gap_m:
            state.gap_m = -d[2]
        if face < 0:
            return is_over, None
        ex = v[0] - u[0] - w[1] * dz + w[2] * dy
        ey = v[1] - u[1] - w[2] * dx + w[0] * dz
        ez = v[2] - u[2] - w[0] * dy + w[1] * dx
        e = (r[0] * ex + r[3] * ey + r[6] * ez, r[1] * ex + r[4] * ey + r[7] * ez, r[2] * ex + r[5] * ey + r[8] * ez)
        self._count_deck(point, face, state)
        return is_over, _rotated(r, self._face_force(point, face, d, e))

    def _face(self, point: _Point, d: Vec3) -> int:
        """Which face of the box the point presses on: the one it came in by; -1 outside."""
        s = self._shape
        if not (0.0 < d[2] < s.depth_m and self._is_over(d)):
            return -1
        if point.face >= 0:
            return point.face
        point.anchor_d_m = d
        last_x, last_y, last_z = point.last_d_m[0] - s.center_x_m, point.last_d_m[1] - s.center_y_m, point.last_d_m[2]
        if last_z <= 0.0:
            return _TOP
        half_x, half_y = 0.5 * s.length_m, 0.5 * s.width_m
        overhang = {_FRONT: last_x - half_x, _BACK: -last_x - half_x, _RIGHT: last_y - half_y, _LEFT: -last_y - half_y}
        return max(overhang, key=lambda name: overhang[name])

    def _is_over(self, d: Vec3) -> bool:
        s = self._shape
        return abs(d[0] - s.center_x_m) < 0.5 * s.length_m and abs(d[1] - s.center_y_m) < 0.5 * s.width_m

    def _depth(self, face: int, d: Vec3) -> float:
        s = self._shape
        if face == _TOP:
            return d[2]
        nx, ny, _ = _NORMALS[face]
        along = nx * (d[0] - s.center_x_m) + ny * (d[1] - s.center_y_m)
        return (0.5 * s.length_m if nx != 0.0 else 0.5 * s.width_m) - along

    def _face_force(self, point: _Point, face: int, d: Vec3, e: Vec3) -> Vec3:
        """Force in D: along the normal, and friction in the two other axes against the anchor."""
        nx, ny, nz = _NORMALS[face]
        normal = self._press(self._depth(face, d), -(nx * e[0] + ny * e[1] + nz * e[2]))
        a = point.anchor_d_m
        sx, sy, sz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
        limit = self._surface.deck_friction * normal
        if face == _TOP:
            friction_x, friction_y, kept = self._friction(sx, sy, e[0], e[1], limit)
            point.anchor_d_m = (d[0] - kept * sx, d[1] - kept * sy, d[2])
            return (friction_x, friction_y, -normal)
        if nx != 0.0:
            friction_y, friction_z, kept = self._friction(sy, sz, e[1], e[2], limit)
            point.anchor_d_m = (d[0], d[1] - kept * sy, d[2] - kept * sz)
            return (nx * normal, friction_y, friction_z)
        friction_x, friction_z, kept = self._friction(sx, sz, e[0], e[2], limit)
        point.anchor_d_m = (d[0] - kept * sx, d[1], d[2] - kept * sz)
        return (friction_x, ny * normal, friction_z)

    def _press(self, depth_m: float, closing_m_s: float) -> float:
        """Normal force: never a pull."""
        return max(self._stiffness * min(depth_m, _CRUSH_LIMIT_M) + self._damping * closing_m_s, 0.0)

    def _friction(self, sx: float, sy: float, vx: float, vy: float, limit_n: float) -> tuple[float, float, float]:
        """Force along two axes and the part of the stretch (0 to 1) that the anchor keeps: less than 1 is sliding."""
        k = _TANGENTIAL_RATIO * self._stiffness
        fx, fy = -k * sx - self._damping * vx, -k * sy - self._damping * vy
        size = math.hypot(fx, fy)
        if size <= limit_n:
            return fx, fy, 1.0
        stretch = k * math.hypot(sx, sy)
        kept = min(limit_n / stretch, 1.0) if stretch > 0.0 else 1.0
        return fx * limit_n / size, fy * limit_n / size, kept

    def _count_deck(self, point: _Point, face: int, state: ContactState) -> None:
        if face != _TOP:
            state.side_hits += 1
        elif point.is_foot:
            state.feet_on_deck += 1
        else:
            state.frame_on_deck += 1


def _steepness(deck: DeckState) -> float:
    """How much higher than its centre a deck may be at a distance of 1 m."""
    roll, pitch, _ = deck.rpy_rad
    return 0.0 if roll == 0.0 and pitch == 0.0 else abs(roll) + abs(pitch)


def foot_damping(mass_kg: float, feet: int, stiffness_n_m: float, restitution: float) -> float:
    """Damping of one foot (N s/m) so that a flat landing on all feet rebounds with that part of its speed."""
    low, high = 0.0, _LARGEST_DAMPING_RATIO
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rebound(middle) > restitution else (low, middle)
    return 2.0 * low * math.sqrt(feet * stiffness_n_m * mass_kg) / feet


def rebound(ratio: float) -> float:
    """Restitution of a spring and a damper of that damping ratio, which together never pull."""
    below = 1.0 - ratio * ratio
    root = math.sqrt(abs(below)) or 1e-9
    cosine, sine = 2.0 * ratio * ratio - 1.0, 2.0 * ratio * root
    # Contact ends where the force is zero, not where the spring is relaxed.
    angle = math.atan2(sine, cosine) if below > 0.0 else math.log(cosine + sine)
    return math.exp(-ratio / root * angle)


def rotation_matrix(q: Quaternion) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Rows of the matrix of a unit quaternion w x y z."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def _rotated(r: tuple[float, float, float, float, float, float, float, float, float], v: Vec3) -> Vec3:
    x, y, z = v
    return (r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z, r[6] * x + r[7] * y + r[8] * z)
