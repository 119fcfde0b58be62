"""What each fault does to the parts of the world when it begins, and how it is taken back when it ends.

`EFFECTS` maps a fault's struct to (begin, end). Faults of the links are handled by their channels, which are told the whole
list of active faults at each change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from sitl_stub import faults
from sitl_stub.autopilot.autopilot import Autopilot
from sitl_stub.autopilot.manual_control import Sticks
from sitl_stub.beacon import Beacon
from sitl_stub.camera.light import Patch
from sitl_stub.capture import CameraChannel
from sitl_stub.datagram_faults import DatagramChannel
from sitl_stub.faults import Fault, FaultWindow
from sitl_stub.multirotor import Multirotor
from sitl_stub.pad_layout import PadLayout
from sitl_stub.sensors import RangeSensor

_COVER_MARGIN = 1.25
"""A sheet over a marker hides its white border too."""


@dataclass(slots=True)
class FaultEffects:
    """The parts that faults act on."""

    vehicle: Multirotor
    autopilot: Autopilot
    cameras: Sequence[CameraChannel]
    range_sensor: RangeSensor
    beacon: Beacon
    links: tuple[DatagramChannel, DatagramChannel]
    pad: PadLayout
    covers: tuple[Patch, ...] = ()

    def change(self, window: FaultWindow, active: Sequence[Fault]) -> None:
        """`window` has just opened or closed; `active` are all faults that act from now on."""
        for link in self.links:
            link.set_faults(active)
        effect = EFFECTS.get(type(window.fault))
        if effect is not None:
            begin, end = effect
            (begin if window.active else end)(self, window.fault)

    def of_camera(self, fault: Any) -> list[CameraChannel]:
        return [camera for camera in self.cameras if fault.camera in (None, camera.name)]


Effect = Callable[[FaultEffects, Any], None]


def _freeze(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_frozen = True


def _thaw(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_frozen = False


def _stop_camera(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_stopped = True


def _start_camera(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_stopped = False


def _blacken(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_black = True


def _brighten(world: FaultEffects, fault: Any) -> None:
    for camera in world.of_camera(fault):
        camera.is_black = False


def _cover(world: FaultEffects, fault: Any) -> None:
    world.covers = tuple(
        Patch(marker.position_m, (_COVER_MARGIN * marker.size_m, _COVER_MARGIN * marker.size_m), marker.yaw_rad)
        for marker in world.pad.markers
        if not fault.ids or marker.id in fault.ids
    )


def _uncover(world: FaultEffects, fault: Any) -> None:
    world.covers = ()


def _silence_beacon(world: FaultEffects, fault: Any) -> None:
    world.beacon.is_lost = True


def _wake_beacon(world: FaultEffects, fault: Any) -> None:
    world.beacon.is_lost = False


def _move_beacon(world: FaultEffects, fault: Any) -> None:
    world.beacon.jump_ned_m = (fault.north_m, fault.east_m)


def _restore_beacon(world: FaultEffects, fault: Any) -> None:
    world.beacon.jump_ned_m = (0.0, 0.0)


def _stick_range(world: FaultEffects, fault: Any) -> None:
    world.range_sensor.is_stuck = True


def _free_range(world: FaultEffects, fault: Any) -> None:
    world.range_sensor.is_stuck = False


def _lose_range(world: FaultEffects, fault: Any) -> None:
    world.range_sensor.is_lost = True


def _find_range(world: FaultEffects, fault: Any) -> None:
    world.range_sensor.is_lost = False


def _weaken(world: FaultEffects, fault: Any) -> None:
    world.vehicle.motor_health = _with_motor(world.vehicle.motor_health, fault.motor, fault.efficiency)


def _strengthen(world: FaultEffects, fault: Any) -> None:
    world.vehicle.motor_health = _with_motor(world.vehicle.motor_health, fault.motor, 1.0)


def _with_motor(health: tuple[float, ...], motor: int, efficiency: float) -> tuple[float, float, float, float]:
    changed = [efficiency if i == motor - 1 else value for i, value in enumerate(health)]
    return (changed[0], changed[1], changed[2], changed[3])


def _lose_gps(world: FaultEffects, fault: Any) -> None:
    world.autopilot.estimator.gnss_available = False


def _find_gps(world: FaultEffects, fault: Any) -> None:
    world.autopilot.estimator.gnss_available = True


def _jump(world: FaultEffects, fault: Any) -> None:
    world.autopilot.estimator.jump_position(fault.north_m, fault.east_m)


def _jump_back(world: FaultEffects, fault: Any) -> None:
    world.autopilot.estimator.jump_position(-fault.north_m, -fault.east_m)


def _reset_estimate(world: FaultEffects, fault: Any) -> None:
    estimator = world.autopilot.estimator
    if fault.north_m or fault.east_m:
        estimator.jump_position(fault.north_m, fault.east_m)
    if fault.down_m:
        estimator.jump_height(fault.down_m)
    if fault.yaw_deg:
        estimator.jump_yaw(math.radians(fault.yaw_deg))


def _keep(world: FaultEffects, fault: Any) -> None:
    """What has happened stays."""


def _drain(world: FaultEffects, fault: Any) -> None:
    world.autopilot.battery.force_charge(fault.remaining)


def _recharge(world: FaultEffects, fault: Any) -> None:
    world.autopilot.battery.force_charge(None)


def _take_sticks(world: FaultEffects, fault: Any) -> None:
    sticks = Sticks(fault.roll, fault.pitch, fault.yaw, fault.throttle)
    world.autopilot.set_pilot(sticks, mode=fault.mode, kill=fault.kill)


def _leave_sticks(world: FaultEffects, fault: Any) -> None:
    world.autopilot.set_pilot(None)


EFFECTS: dict[type[Any], tuple[Effect, Effect]] = {
    faults.CameraFreeze: (_freeze, _thaw),
    faults.CameraStop: (_stop_camera, _start_camera),
    faults.CameraBlackout: (_blacken, _brighten),
    faults.MarkerCovered: (_cover, _uncover),
    faults.BeaconLost: (_silence_beacon, _wake_beacon),
    faults.BeaconJump: (_move_beacon, _restore_beacon),
    faults.RangeStuck: (_stick_range, _free_range),
    faults.RangeLost: (_lose_range, _find_range),
    faults.MotorWeak: (_weaken, _strengthen),
    faults.GpsLoss: (_lose_gps, _find_gps),
    faults.GpsJump: (_jump, _jump_back),
    faults.EstimatorReset: (_reset_estimate, _keep),
    faults.BatteryLow: (_drain, _recharge),
    faults.PilotInput: (_take_sticks, _leave_sticks),
}
