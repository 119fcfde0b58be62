"""A multirotor's body: mass, rotors, drag, feet, and the PX4 parameters that differ for it; read from configs/airframes/*.toml.

Body frame FRD, SI units. Rotor order and turning sense are PX4's quad X (1 front right, 2 rear left, 3 front left, 4 rear
right; the first two turn counter-clockwise seen from above and so push the body clockwise). Read by scenario, dynamics and contact.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from sitl_stub.section import NonNegative, Positive, Section

Vec3 = tuple[float, float, float]
ROTOR_COUNT = 4


class AirframeError(ValueError):
    """An airframe file that cannot be used; the text names the file and the key."""


class Rotors(Section, frozen=True, kw_only=True):
    """[rotors]: four equal rotors."""

    max_thrust_n: Positive
    """Of one rotor."""
    max_torque_nm: Positive
    """Reaction torque about z of one rotor at full thrust."""
    arm_forward_m: Positive
    """From the centre of gravity to a rotor along B x."""
    arm_right_m: Positive
    time_constant_s: Positive
    thrust_curve: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0
    """Thrust = max * ((1 - c) u + c u^2) of the rotor's signal u; PX4's THR_MDL_FAC undoes the same c."""


class Drag(Section, frozen=True, kw_only=True):
    """[drag]: force against the air's relative velocity in B, and damping of rotation."""

    linear_n_s_m: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 0.0)
    quadratic_n_s2_m2: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 0.0)
    """Force -c v |v| with v the body-frame component and |v| the whole speed."""
    angular_nm_s: NonNegative = 0.0


class Feet(Section, frozen=True, kw_only=True):
    """[feet]: four feet at (+-forward, +-right) below the centre of gravity, and points of the frame that may hit something."""

    forward_m: Positive = 0.12
    right_m: Positive = 0.12
    below_m: Positive = 0.15
    hub_above_m: float = 0.02
    """Rotor hubs' height over the centre of gravity."""


class Airframe(Section, frozen=True, kw_only=True):
    """One vehicle. `parameters` are PX4 names and override PX4's defaults."""

    name: str = ""
    description: str = ""
    mass_kg: Positive
    inertia_kg_m2: tuple[Positive, Positive, Positive]
    rotors: Rotors
    drag: Drag = Drag()
    feet: Feet = Feet()
    parameters: dict[str, float | int] = msgspec.field(default_factory=dict)

    @property
    def hover_signal(self) -> float:
        """Rotor signal 0..1 that carries the weight in still air (normal gravity)."""
        share = self.mass_kg * 9.80665 / (ROTOR_COUNT * self.rotors.max_thrust_n)
        c = self.rotors.thrust_curve
        return share if c == 0.0 else ((c - 1.0) + ((1.0 - c) ** 2 + 4.0 * c * share) ** 0.5) / (2.0 * c)

    @property
    def feet_frd_m(self) -> tuple[Vec3, Vec3, Vec3, Vec3]:
        """Where the feet are: front right, rear left, front left, rear right."""
        x, y, z = self.feet.forward_m, self.feet.right_m, self.feet.below_m
        return ((x, y, z), (-x, -y, z), (x, -y, z), (-x, y, z))

    @property
    def hubs_frd_m(self) -> tuple[Vec3, Vec3, Vec3, Vec3]:
        """Where the rotor hubs are, in the order of the rotors."""
        x, y, z = self.rotors.arm_forward_m, self.rotors.arm_right_m, -self.feet.hub_above_m
        return ((x, y, z), (-x, -y, z), (x, -y, z), (-x, y, z))


def read_airframe(path: Path) -> Airframe:
    """Airframe of a TOML file; AirframeError for anything that does not fit."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        table.setdefault("name", path.stem)
        return msgspec.convert(table, Airframe)
    except (OSError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise AirframeError(f"{path}: {error}") from error
