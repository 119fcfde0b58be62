"""MAVSDK, the client most PX4 users write for, against the simulated vehicle over real UDP, at four times real time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from udp_vehicle import UdpVehicle, free_port

pytestmark = [pytest.mark.sockets, pytest.mark.timeout(240)]


@asynccontextmanager
async def connected() -> AsyncIterator[tuple[UdpVehicle, Any]]:
    """Vehicle and MAVSDK's view of it."""
    port = free_port()
    configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
    with UdpVehicle(port) as vehicle:
        async with Mavsdk(configuration) as client:
            await client.add_any_connection(f"udpin://127.0.0.1:{port}")
            system = await client.first_autopilot(timeout_s=60.0)
            assert system is not None
            yield vehicle, system


def fly(mission: Callable[[UdpVehicle, Any], Awaitable[None]]) -> None:
    async def run() -> None:
        async with connected() as (vehicle, system):
            await mission(vehicle, system)

    asyncio.run(asyncio.wait_for(run(), 200.0))


async def until(condition: Callable[[], bool], what: str, timeout_s: float = 60.0) -> None:
    """Wait on the vehicle itself."""
    for _ in range(int(timeout_s / 0.02)):
        if condition():
            return
        await asyncio.sleep(0.02)
    raise AssertionError(f"{what}: not within {timeout_s} s")


def test_mavsdk_connects_arms_takes_off_flies_offboard_and_lands() -> None:
    async def mission(vehicle: UdpVehicle, system: Any) -> None:
        rig = vehicle.rig
        action, offboard = ActionAsync(system), OffboardAsync(system)
        await action.set_takeoff_altitude(4.0)
        await action.arm()
        assert rig.is_armed
        await action.takeoff()
        await until(lambda: rig.height_m > 3.0, "take-off")
        await offboard.set_velocity_ned(VelocityNedYaw(2.0, 0.0, 0.0, 90.0))
        await offboard.start()
        await until(lambda: rig.autopilot.mode_name == "OFFBOARD", "offboard")
        await until(lambda: rig.vehicle.state.vx > 1.4, "northward flight")
        await until(lambda: abs(rig.autopilot.estimator.estimate.yaw_rad - 1.5708) < 0.15, "turn to the east")
        await offboard.set_velocity_body(VelocityBodyYawspeed(2.0, 0.0, 0.0, 0.0))
        await until(lambda: rig.vehicle.state.vy > 1.3, "flight to the front")
        await offboard.stop()
        await until(lambda: rig.autopilot.mode_name == "AUTO_LOITER", "hold")
        await action.land()
        await until(lambda: rig.autopilot.mode_name == "AUTO_LAND", "landing")
        await until(lambda: not rig.is_armed, "disarming")
        assert rig.height_m < 0.1

    fly(mission)


def test_mavsdk_refuses_offboard_without_a_setpoint_and_sees_denials() -> None:
    async def mission(vehicle: UdpVehicle, system: Any) -> None:
        rig = vehicle.rig
        action = ActionAsync(system)
        await action.arm()
        await action.takeoff()
        await until(lambda: rig.height_m > 1.5, "take-off")
        with pytest.raises(Exception, match=r"(?i)denied"):
            await action.disarm()
        assert rig.is_armed
        await action.kill()
        await until(lambda: not rig.is_armed, "kill")

    fly(mission)


def test_mavsdk_reads_telemetry_and_health() -> None:
    async def mission(vehicle: UdpVehicle, system: Any) -> None:
        telemetry = TelemetryAsync(system)
        async for state in telemetry.subscribe_position_velocity_ned():
            assert abs(state.position.north_m) < 2.0
            break
        async for position in telemetry.subscribe_position():
            assert abs(position.latitude_deg - 47.397742) < 1e-3
            assert abs(position.absolute_altitude_m - 489.4) < 3.0
            break
        async for battery in telemetry.subscribe_battery():
            assert battery.remaining_percent == pytest.approx(100.0)
            break
        async for healthy in telemetry.subscribe_health_all_ok():
            if healthy:
                break
        async for home in telemetry.subscribe_home():
            assert abs(home.latitude_deg - 47.397742) < 1e-3
            break

    fly(mission)


def test_mavsdk_reads_and_writes_parameters() -> None:
    async def mission(vehicle: UdpVehicle, system: Any) -> None:
        parameters = ParamAsync(system)
        assert await parameters.get_param_int("SYS_AUTOSTART") == 10040
        assert await parameters.get_param_float("MPC_XY_VEL_MAX") == pytest.approx(12.0)
        await parameters.set_param_int("COM_OBL_RC_ACT", 4)
        await parameters.set_param_float("MPC_XY_VEL_MAX", 8.0)
        assert vehicle.rig.autopilot.parameters["COM_OBL_RC_ACT"] == 4
        assert vehicle.rig.autopilot.parameters["MPC_XY_VEL_MAX"] == pytest.approx(8.0)

    fly(mission)
