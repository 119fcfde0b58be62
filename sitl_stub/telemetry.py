"""What the vehicle's messages are made of: references to the autopilot's parts and the last step's values.

Written by the autopilot each step, read by stream_contents. W local NED, B FRD, boot clock in microseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from sitl_stub.autopilot.battery import Battery
from sitl_stub.autopilot.cascade import PositionSetpointEcho
from sitl_stub.autopilot.commander import Commander
from sitl_stub.autopilot.home import Home
from sitl_stub.autopilot.noise import NormalTape
from sitl_stub.autopilot.vehicle_estimate import VehicleEstimate
from sitl_stub.geodesy import Origin
from sitl_stub.multirotor import VehicleTruth

Vec3 = tuple[float, float, float]

LANDED_UNDEFINED, ON_GROUND, IN_AIR, TAKEOFF, LANDING = range(5)


@dataclass(slots=True)
class Telemetry:
    """State of the vehicle for the wire."""

    estimate: VehicleEstimate
    commander: Commander
    battery: Battery
    home: Home
    origin: Origin
    imu_noise: NormalTape
    imu_noise_scale: float
    unix_start_us: int
    t_us: int = 0
    truth: VehicleTruth | None = None
    landed_state: int = ON_GROUND
    attitude_setpoint: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    rates_setpoint: Vec3 = (0.0, 0.0, 0.0)
    thrust: float = 0.0
    position_setpoint: PositionSetpointEcho = field(default_factory=PositionSetpointEcho)
    motors: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    range_m: float | None = None
    has_range_sensor: bool = False
    has_gps: bool = True
    has_target: bool = False
    estimate_resets: int = 0
    event_sequence: int = 0
    pending: Callable[[], None] | None = None
    """Fills in what is not the estimate's, when a message needs it: steady flight leaves that undone."""

    def complete(self) -> None:
        """Fill in what is pending."""
        pending, self.pending = self.pending, None
        if pending is not None:
            pending()

    @property
    def boot_ms(self) -> int:
        return self.t_us // 1000
