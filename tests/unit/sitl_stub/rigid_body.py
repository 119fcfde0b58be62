"""A free rigid body for contact tests: semi-implicit Euler, no thrust, no drag, diagonal inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sitl_stub.carriers.deck import Deck, DeckState
from sitl_stub.contact import Contact

G = 9.80665


@dataclass
class RigidBody:
    position: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    q: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass: float = 2.0
    inertia: tuple[float, float, float] = (0.03, 0.03, 0.05)

    def step(self, dt: float, force: tuple[float, float, float], torque: tuple[float, float, float]) -> None:
        fx, fy, fz = force
        vx, vy, vz = self.velocity
        self.velocity = (
            vx + fx / self.mass * dt,
            vy + fy / self.mass * dt,
            vz + (fz / self.mass + G) * dt,
        )
        self.position = tuple(p + v * dt for p, v in zip(self.position, self.velocity, strict=True))
        p, q, r = self.rates
        ix, iy, iz = self.inertia
        tx, ty, tz = torque
        p, q, r = (
            p + (tx - (iz - iy) * q * r) / ix * dt,
            q + (ty - (ix - iz) * r * p) / iy * dt,
            r + (tz - (iy - ix) * p * q) / iz * dt,
        )
        self.rates = (p, q, r)
        w, x, y, z = self.q
        h = 0.5 * dt
        turned = (
            w - h * (p * x + q * y + r * z),
            x + h * (p * w + r * y - q * z),
            y + h * (q * w - r * x + p * z),
            z + h * (r * w + q * x - p * y),
        )
        size = math.sqrt(sum(c * c for c in turned))
        self.q = tuple(c / size for c in turned)


def run(
    body: RigidBody, contact: Contact, deck: Deck, start_s: float, duration_s: float, dt: float = 0.001
) -> DeckState:
    """Let the body lie, fall or slide for that long; returns the deck at the end."""
    steps = round(duration_s / dt)
    state = deck.at(start_s)
    for i in range(steps):
        state = deck.at(start_s + i * dt)
        touch = contact.step(body.position, body.velocity, body.q, body.rates, state)
        body.step(dt, touch.force_ned_n, touch.torque_frd_nm)
    return deck.at(start_s + duration_s)
