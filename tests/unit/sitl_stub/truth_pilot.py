"""Flies the simulated vehicle onto the deck with perfect knowledge: setpoints and commands as MAVLink bytes, truth as eyes.

Stands in for the application, so that the world's own tests need none of it.
"""

from __future__ import annotations

import math

from sitl_stub.datagram_faults import Datagram
from sitl_stub.mavlink.definitions import COMMAND_LONG, HEARTBEAT, SET_POSITION_TARGET_LOCAL_NED, MessageType
from sitl_stub.mavlink.frame import encode
from sitl_stub.verdict import Verdict
from sitl_stub.world import StepOutput, World

_VELOCITY_AND_YAW_RATE = 0b010111000111
_OFFBOARD = 6 << 16
PERIOD_S = 0.02


class TruthPilot:
    """One call of `turn` every 20 ms."""

    def __init__(self, world: World, aim_m: tuple[float, float] = (0.0, 0.0), disarm: bool = True) -> None:
        self.world = world
        self.aim_m = aim_m
        self.disarm = disarm
        self._sequence = 0
        self._turns = 0
        self._touching_s = 0.0
        self._integral = [0.0, 0.0]
        self._pad_velocity = (0.0, 0.0, 0.0)

    def fly(self, limit_s: float) -> Verdict:
        """Until the flight has ended, or for that long."""
        end_us = self.world.t_us + round(limit_s * 1e6)
        while self.world.t_us < end_us and not self.world.verdict().is_over:
            self.turn()
        return self.world.verdict()

    def turn(self) -> StepOutput:
        datagrams = [self.setpoint()]
        if self._turns % 50 == 0:
            datagrams.append(self._datagram(HEARTBEAT, 0, 18, 8, 0, 4, 3))
        if self._turns == 5:
            datagrams.append(self.command(176, 1.0, 6.0))
        if self._should_disarm():
            datagrams.append(self.command(400, 0.0, 21196.0))
        self._turns += 1
        return self.world.step(PERIOD_S, datagrams)

    def setpoint(self) -> Datagram:
        """Pad's velocity, plus a pull to the point above the aim, plus what the wind and drag ask for."""
        truth = self.world.truth()
        x, y, z = truth.vehicle_in_pad_m
        w, _, _, qz = truth.pad_q_ned_pad
        yaw = 2.0 * math.atan2(qz, w)
        ahead, right = self.aim_m[0] - x, self.aim_m[1] - y
        north = math.cos(yaw) * ahead - math.sin(yaw) * right
        east = math.sin(yaw) * ahead + math.cos(yaw) * right
        off = math.hypot(north, east)
        pad, velocity = truth.pad_velocity_ned_m_s, truth.vehicle.velocity_ned_m_s
        if off < 3.0:
            self._integral[0] += 0.6 * PERIOD_S * north
            self._integral[1] += 0.6 * PERIOD_S * east
        acceleration = [(p - q) / PERIOD_S for p, q in zip(pad, self._pad_velocity, strict=True)]
        self._pad_velocity = pad
        scale = min(1.5 * off, 5.0) / max(off, 1e-6)
        height = -z - self.world.vehicle.airframe.feet.below_m
        down = 0.0 if off > 0.15 + 0.2 * max(height, 0.0) else min(0.4 + 0.3 * max(height, 0.0), 1.2)
        if truth.contact.is_touching:
            # Press on: a slow descent leaves PX4 hovering on one foot until its integrals tip it over.
            down, scale = 1.5, 0.0
        vn = pad[0] + scale * north + self._integral[0] + 0.6 * (pad[0] - velocity[0])
        ve = pad[1] + scale * east + self._integral[1] + 0.6 * (pad[1] - velocity[1])
        values = (0, 0.0, 0.0, 0.0, vn, ve, down + pad[2], *acceleration, 0.0, 0.0)
        return self._datagram(SET_POSITION_TARGET_LOCAL_NED, *values, 0b010000000111, 1, 1, 1)

    def _should_disarm(self) -> bool:
        truth = self.world.truth()
        self._touching_s = self._touching_s + PERIOD_S if truth.contact.feet_on_deck >= 1 else 0.0
        return self.disarm and self._touching_s > 0.2 and truth.is_armed

    def command(self, number: int, *parameters: float) -> Datagram:
        values = (*parameters, *([0.0] * (7 - len(parameters))))
        return self._datagram(COMMAND_LONG, *values, number, 1, 1, 0)

    def _datagram(self, message: MessageType, *values: float | int) -> Datagram:
        self._sequence = (self._sequence + 1) & 0xFF
        data = encode(message, message.struct.pack(*values), self._sequence, 1, 191)
        return Datagram("onboard", data)
