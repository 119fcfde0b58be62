"""Setpoints: NaN is "not controlled"."""

from math import nan

from sitl_stub.autopilot.setpoint import TrajectorySetpoint


def test_an_empty_setpoint_asks_for_nothing() -> None:
    setpoint = TrajectorySetpoint()
    assert not setpoint.wants_climb
    assert not setpoint.is_above(0.0)


def test_climb_is_asked_for_by_velocity_acceleration_or_height() -> None:
    assert TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, -0.1)).wants_climb
    assert TrajectorySetpoint(acceleration_ned_m_s2=(nan, nan, -1.0)).wants_climb
    assert not TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, 0.0)).wants_climb
    assert TrajectorySetpoint(position_ned_m=(0.0, 0.0, -5.0)).is_above(-4.9)
    assert not TrajectorySetpoint(position_ned_m=(0.0, 0.0, -5.0)).is_above(-5.1)
