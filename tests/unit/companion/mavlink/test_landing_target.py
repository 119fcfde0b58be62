"""LANDING_TARGET in both dialects of meaning, with facts a person can check."""

from __future__ import annotations

import math
from typing import Any

import pytest

from companion.mavlink.landing_target import ardupilot_angles_form, ardupilot_form, px4_form
from companion.messages import PadReport, VehicleState

FACING_EAST = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def pad_at(north: float, east: float, down: float) -> PadReport:
    return PadReport(0, (north, east, down))


def vehicle(q: Any = FACING_EAST) -> VehicleState:
    return VehicleState(0, (10.0, 20.0, -5.0), (0.0,) * 3, q, (0.0,) * 3)


def test_px4_gets_the_pad_in_its_local_frame() -> None:
    target = px4_form(pad_at(13.0, 20.0, -1.0), vehicle(), 777)
    assert (target.frame, target.position_valid, target.time_usec) == (1, 1, 777)
    assert (target.x, target.y, target.z) == (13.0, 20.0, -1.0)
    assert target.distance == pytest.approx(5.0)


def test_ardupilot_gets_the_pad_in_the_body() -> None:
    """Nose east, pad 4 m below and 4 m south: to the right at 45 degrees."""
    target = ardupilot_form(pad_at(6.0, 20.0, -1.0), vehicle(), 777)
    assert target.frame == 12
    assert (target.x, target.y, target.z) == pytest.approx((0.0, 4.0, 4.0), abs=1e-9)
    assert (target.angle_x, target.angle_y) == pytest.approx((math.pi / 4, 0.0), abs=1e-9)


def test_the_form_with_angles_says_so_and_carries_no_position() -> None:
    full, angles = (form(pad_at(6.0, 20.0, -1.0), vehicle(), 0) for form in (ardupilot_form, ardupilot_angles_form))
    assert (angles.position_valid, angles.x, angles.y, angles.z) == (0, 0.0, 0.0, 0.0)
    assert (angles.angle_x, angles.angle_y, angles.distance) == (full.angle_x, full.angle_y, full.distance)


def test_a_pad_ahead_is_at_the_top_of_the_image() -> None:
    target = ardupilot_form(pad_at(10.0, 24.0, -1.0), vehicle(), 0)
    assert (target.angle_x, target.angle_y) == pytest.approx((0.0, -math.pi / 4), abs=1e-9)


def test_the_session_sends_it_with_the_time_on_the_autopilots_clock(connected: Any) -> None:
    assert not connected.session.send_landing_target("px4", pad_at(1.0, 2.0, -1.0), connected.now_ns)
    connected.session.receive_datagram(odometry_bytes(connected), connected.now_ns)
    assert connected.session.send_landing_target("px4", pad_at(1.0, 2.0, -1.0), connected.now_ns)
    connected.collect()
    (sent,) = connected.of_type("LANDING_TARGET")
    assert (sent.frame, sent.position_valid, sent.x, sent.y, sent.z) == (1, 1, 1.0, 2.0, -1.0)


def odometry_bytes(wire: Any) -> bytes:
    from pymavlink.dialects.v20 import development as mav

    nan = [math.nan] * 21
    message = mav.MAVLink_odometry_message(
        wire.boot_ms * 1000, 1, 1, 0.0, 0.0, -5.0, [1.0, 0, 0, 0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nan, nan
    )
    packed: bytes = wire.bytes_of(message)
    return packed
