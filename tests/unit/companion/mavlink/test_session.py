"""The session against a hand-driven autopilot in virtual time: every message, timer and refusal."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.messages import (
    AccelerationReport,
    AutopilotMode,
    AutopilotText,
    CommandKind,
    CommandResult,
    LandedState,
    PadBeacon,
    RangeMeasurement,
    ThrustReport,
    VehicleCommand,
    VehicleState,
    VehicleStatus,
    VelocitySetpoint,
)

MS = 1_000_000
SECOND = 1_000_000_000
OFFBOARD, HOLD, RETURN = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 5 << 24
NAN = math.nan


def odometry(wire: Any, **changes: Any) -> mav.MAVLink_odometry_message:
    fields: dict[str, Any] = {
        "time_usec": wire.boot_ms * 1000,
        "frame_id": 1,
        "child_frame_id": 1,
        "x": 1.0,
        "y": 2.0,
        "z": -3.0,
        "q": [1.0, 0.0, 0.0, 0.0],
        "vx": 0.5,
        "vy": -0.25,
        "vz": 0.125,
        "rollspeed": 0.25,
        "pitchspeed": 0.5,
        "yawspeed": 0.75,
        "pose_covariance": [NAN] * 21,
        "velocity_covariance": [NAN] * 21,
        "reset_counter": 7,
        "estimator_type": 8,
        "quality": 0,
    }
    return mav.MAVLink_odometry_message(**(fields | changes))


def setpoint(wire: Any, **changes: Any) -> VelocitySetpoint:
    fields: dict[str, Any] = {
        "t_ns": wire.now_ns,
        "valid_until_ns": wire.now_ns + 100 * MS,
        "velocity_ned_m_s": (1.5, -0.5, 0.25),
        "yaw_rate_rad_s": 0.5,
    }
    return VelocitySetpoint(**(fields | changes))


def command(wire: Any, kind: CommandKind, **changes: Any) -> VehicleCommand:
    return VehicleCommand(t_ns=wire.now_ns, kind=kind, reason="test", **changes)


def settle_clock(wire: Any, *, seconds: float = 2.0, delay_ns: int = 0) -> None:
    """Answer every TIMESYNC question after `delay_ns` each way."""
    answered = len(wire.of_type("TIMESYNC"))
    for _ in range(round(seconds * 100)):
        wire.advance(10)
        for question in wire.of_type("TIMESYNC")[answered:]:
            boot_ns = question.ts1 + delay_ns + wire.boot_minus_companion_ns
            wire.now_ns = max(wire.now_ns, question.ts1 + 2 * delay_ns)
            wire.deliver(mav.MAVLink_timesync_message(boot_ns, question.ts1))
        answered = len(wire.of_type("TIMESYNC"))
        wire.heartbeat()


# ----------------------------------------------------------------------------------------------------------- the link


def test_a_heartbeat_goes_out_at_once_and_then_every_second(wire: Any) -> None:
    wire.advance(3_500)
    beats = wire.of_type("HEARTBEAT")
    assert len(beats) == 4
    assert (beats[0].type, beats[0].autopilot) == (18, 8)
    assert (beats[0].get_srcSystem(), beats[0].get_srcComponent()) == (1, 191)


def test_sequence_numbers_of_what_we_send_have_no_gap(connected: Any) -> None:
    connected.advance(2_000)
    sequence = [m.get_seq() for m in connected.sent]
    assert sequence == [i % 256 for i in range(len(sequence))]


def test_link_is_found_with_the_first_heartbeat_and_lost_after_two_seconds_of_silence(connected: Any) -> None:
    assert connected.received(VehicleStatus)[-1].connected
    connected.advance(1_990)
    assert connected.session.connected
    statuses = [m for m in connected.advance(20) if isinstance(m, VehicleStatus)]
    assert [s.connected for s in statuses] == [False]
    assert statuses[0].link_age_s == pytest.approx(2.0)


def test_link_is_found_again_and_streams_are_asked_again(connected: Any) -> None:
    connected.advance(5_000)
    asked_before = len(connected.commands(511))
    statuses = [m for m in connected.heartbeat() if isinstance(m, VehicleStatus)]
    assert [s.connected for s in statuses] == [True]
    connected.run_timers()
    assert len(connected.commands(511)) - asked_before == 9


def test_one_lost_heartbeat_is_no_lost_link_while_other_messages_come(connected: Any) -> None:
    for _ in range(40):
        connected.advance(100)
        connected.deliver(odometry(connected))
    assert connected.session.connected
    assert all(s.connected for s in connected.received(VehicleStatus))


@pytest.mark.parametrize(("system", "component"), [(255, 190), (1, 154), (1, 191), (3, 1)])
def test_heartbeats_of_others_are_not_the_autopilot(wire: Any, system: int, component: int) -> None:
    wire.deliver(mav.MAVLink_heartbeat_message(6, 8, 0x80, OFFBOARD, 4, 3), system, component)
    assert not wire.session.connected
    assert wire.session.counters.frames_of_others == 1


def test_status_comes_at_least_once_a_second(connected: Any) -> None:
    before = len(connected.received(VehicleStatus))
    for _ in range(50):
        connected.advance(100)
        connected.deliver(odometry(connected))
    assert len(connected.received(VehicleStatus)) - before == 5


# --------------------------------------------------------------------------------------------------------- the streams


def test_streams_are_asked_for_by_interval(connected: Any) -> None:
    asked = {int(m.param1): m.param2 for m in connected.commands(511)}
    assert asked[331] == pytest.approx(20_000.0)  # ODOMETRY at 50 Hz
    assert asked[436] == pytest.approx(100_000.0)  # CURRENT_MODE at 10 Hz
    assert {132, 83, 105, 245} <= set(asked)
    assert {int(m.param1) for m in connected.commands(512)} == {49}  # GPS_GLOBAL_ORIGIN once


def test_a_stream_that_does_not_come_is_asked_again_with_growing_pauses(connected: Any) -> None:
    for _ in range(300):
        connected.advance(100)
        connected.heartbeat()
    times = len([m for m in connected.commands(511) if int(m.param1) == 331])
    assert times == 5  # at 0, 2, 6, 14, 30 s


def test_a_stream_that_flows_is_left_alone(connected: Any) -> None:
    for _ in range(300):
        connected.advance(20)
        connected.deliver(odometry(connected))
    assert len([m for m in connected.commands(511) if int(m.param1) == 331]) == 1


def test_the_global_origin_is_requested_until_it_has_come(connected: Any) -> None:
    for _ in range(5):
        connected.advance(1_000)
        connected.heartbeat()
    assert len(connected.commands(512)) == 3
    connected.deliver(mav.MAVLink_gps_global_origin_message(473977418, 85455939, 489_000, 0))
    for _ in range(5):
        connected.advance(1_000)
        connected.heartbeat()
    assert len(connected.commands(512)) == 3


# ----------------------------------------------------------------------------------------------------- vehicle's state


def test_odometry_becomes_the_vehicle_state(connected: Any) -> None:
    (state,) = connected.deliver(odometry(connected))
    assert state == VehicleState(
        t_ns=connected.now_ns,
        position_ned_m=(1.0, 2.0, -3.0),
        velocity_ned_m_s=(0.5, -0.25, 0.125),
        q_ned_frd=(1.0, 0.0, 0.0, 0.0),
        angular_velocity_frd_rad_s=(0.25, 0.5, 0.75),
        reset_counter=7,
    )


@pytest.mark.parametrize("child_frame", [8, 12])
def test_body_velocity_is_turned_into_ned_by_the_attitude(connected: Any, child_frame: int) -> None:
    facing_east = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    message = odometry(connected, child_frame_id=child_frame, q=facing_east, vx=2.0, vy=0.0, vz=1.0)
    (state,) = connected.deliver(message)
    assert state.velocity_ned_m_s == pytest.approx((0.0, 2.0, 1.0), abs=1e-6)


@pytest.mark.parametrize(
    "broken",
    [{"x": NAN}, {"vz": math.inf}, {"q": [0.0] * 4}, {"q": [NAN] * 4}, {"frame_id": 20}, {"child_frame_id": 3}],
)
def test_odometry_that_cannot_be_used_is_no_state(connected: Any, broken: dict[str, Any]) -> None:
    assert connected.deliver(odometry(connected, **broken)) == []


def test_without_odometry_local_position_and_attitude_are_joined(connected: Any) -> None:
    boot_ms = connected.boot_ms
    connected.deliver(mav.MAVLink_attitude_quaternion_message(boot_ms, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3))
    position = mav.MAVLink_local_position_ned_message(boot_ms + 20, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    (state,) = connected.deliver(position)
    assert state.position_ned_m == (1.0, 2.0, 3.0)
    assert state.angular_velocity_frd_rad_s == pytest.approx((0.1, 0.2, 0.3))
    late = mav.MAVLink_local_position_ned_message(boot_ms + 200, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert connected.deliver(late) == []


def test_local_position_is_silent_while_odometry_flows(connected: Any) -> None:
    connected.deliver(odometry(connected))
    connected.deliver(mav.MAVLink_attitude_quaternion_message(connected.boot_ms, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert connected.deliver(mav.MAVLink_local_position_ned_message(connected.boot_ms, *[0.0] * 6)) == []


@pytest.mark.parametrize(
    ("current_cm", "quality", "distance_m"),
    [(250, 0, 2.5), (65535, 0, None), (10_001, 0, None), (5, 0, None), (250, 1, None), (250, 100, 2.5)],
)
def test_range_outside_the_sensor_is_none(
    connected: Any, current_cm: int, quality: int, distance_m: float | None
) -> None:
    message = mav.MAVLink_distance_sensor_message(
        connected.boot_ms, 10, 10_000, current_cm, 0, 0, 25, 0, signal_quality=quality
    )
    assert connected.deliver(message) == [RangeMeasurement(connected.now_ns, distance_m, 0.1, 100.0)]


def test_a_range_sensor_that_looks_forward_is_not_ours(connected: Any) -> None:
    assert connected.deliver(mav.MAVLink_distance_sensor_message(0, 10, 10_000, 250, 0, 0, 0, 0)) == []


def test_thrust_and_acceleration_are_reported(connected: Any) -> None:
    thrust = mav.MAVLink_attitude_target_message(connected.boot_ms, 0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.5)
    imu = mav.MAVLink_highres_imu_message(connected.boot_ms * 1000, 0.5, 0.25, -9.75, *[0.0] * 10, 7)
    assert connected.deliver(thrust) == [ThrustReport(connected.now_ns, 0.5)]
    assert connected.deliver(imu) == [AccelerationReport(connected.now_ns, (0.5, 0.25, -9.75))]


# ---------------------------------------------------------------------------------------------------- vehicle's status


def test_mode_change_shows_in_current_mode_before_the_heartbeat(connected: Any) -> None:
    (status,) = connected.current_mode(OFFBOARD)
    assert (status.mode, status.intended_mode) == (AutopilotMode.OFFBOARD, AutopilotMode.OFFBOARD)


def test_an_armed_vehicle_in_another_mode_than_intended_is_in_failsafe(connected: Any) -> None:
    connected.heartbeat(OFFBOARD, armed=True, status=4)
    (status,) = connected.current_mode(RETURN, intended=OFFBOARD)
    assert (status.mode, status.failsafe) == (AutopilotMode.RETURN, True)
    (status,) = connected.current_mode(OFFBOARD)
    assert not status.failsafe


def test_a_heartbeat_that_overtakes_current_mode_is_no_failsafe(connected: Any) -> None:
    connected.heartbeat(HOLD, armed=True, status=4)
    connected.current_mode(HOLD)
    (status,) = connected.heartbeat(OFFBOARD, armed=True, status=4)
    assert (status.mode, status.intended_mode, status.failsafe) == (AutopilotMode.OFFBOARD, None, False)
    (status,) = connected.current_mode(OFFBOARD)
    assert (status.intended_mode, status.failsafe) == (AutopilotMode.OFFBOARD, False)


def test_critical_heartbeat_is_failsafe(connected: Any) -> None:
    (status,) = connected.heartbeat(RETURN, armed=True, status=5)
    assert status.failsafe


def test_landed_state_battery_prearm_and_home_are_gathered(connected: Any) -> None:
    connected.deliver(mav.MAVLink_extended_sys_state_message(0, 2))
    connected.deliver(mav.MAVLink_sys_status_message(0, 0, 0x10000000, 0, 16200, -1, 80, *[0] * 6))
    battery = mav.MAVLink_battery_status_message(0, 1, 1, 32767, [16200] * 10, -100, -1, -1, 64)
    connected.deliver(battery)
    home = mav.MAVLink_home_position_message(473977456, 85455930, 489_000, 0.5, -0.25, 0.125, [1.0, 0, 0, 0], 0, 0, 0)
    connected.deliver(home)
    status = connected.received(VehicleStatus)[-1]
    assert status.landed_state is LandedState.IN_AIR
    assert status.ready_to_arm is True
    assert status.battery_fraction == 0.64
    assert status.home_position_ned_m == (0.5, -0.25, 0.125)


def test_the_first_home_before_the_estimator_is_ready_is_no_home(connected: Any) -> None:
    connected.deliver(mav.MAVLink_home_position_message(0, 0, 0, 0.0, 0.0, 0.0, [1.0, 0, 0, 0], 0, 0, 0))
    connected.advance(1_000)
    assert connected.received(VehicleStatus)[-1].home_position_ned_m is None


def test_accepted_arming_counts_before_the_next_heartbeat(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    inputs = connected.ack(400)
    assert [type(m) for m in inputs] == [CommandResult, VehicleStatus]
    assert inputs[1].armed
    connected.advance(10)
    connected.heartbeat(armed=False)  # was under way when the command was accepted
    assert connected.received(VehicleStatus)[-1].armed
    connected.advance(1_000)
    connected.heartbeat(armed=False)
    assert not connected.received(VehicleStatus)[-1].armed


# ------------------------------------------------------------------------------------------------------------ commands


def test_a_command_is_sent_again_with_confirmation_incremented_and_given_up(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    for _ in range(40):
        connected.advance(100)
        connected.heartbeat()
    assert [m.confirmation for m in connected.commands(400)] == [0, 1, 2, 3, 4]
    (result,) = connected.received(CommandResult)
    assert (result.kind, result.accepted, result.result, result.attempts) == (CommandKind.ARM, False, "timeout", 5)


def test_a_heartbeat_that_shows_it_armed_is_as_good_as_the_lost_answer(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    connected.heartbeat(armed=False)
    assert connected.received(CommandResult) == []
    connected.heartbeat(armed=True)
    assert connected.received(CommandResult)[0].accepted


def test_a_late_refusal_of_the_disarm_is_not_that_of_the_forced_one(connected: Any) -> None:
    connected.heartbeat(armed=True)
    connected.session.send_command(command(connected, CommandKind.DISARM), connected.now_ns)
    connected.advance(5)
    connected.ack(400, result=1)
    forced = command(connected, CommandKind.FORCE_DISARM, evidence=("on the deck",))
    connected.session.send_command(forced, connected.now_ns)
    connected.ack(400, result=1)  # the same refusal, doubled on the way
    connected.advance(5)
    connected.ack(400)
    results = [(r.kind, r.accepted) for r in connected.received(CommandResult)]
    assert results == [(CommandKind.DISARM, False), (CommandKind.FORCE_DISARM, True)]


def test_the_same_command_twice_is_one_command(connected: Any) -> None:
    for _ in range(3):
        connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    connected.ack(400)
    connected.ack(400)
    assert len(connected.commands(400)) == 1
    assert len(connected.received(CommandResult)) == 1


def test_refused_arming_says_why(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    connected.ack(400, result=1)
    (result,) = connected.received(CommandResult)
    assert (result.accepted, result.result) == (False, "temporarily_rejected")


def test_the_first_acceptance_of_a_mode_command_means_nothing(connected: Any) -> None:
    """PX4 answers a refused mode in flight with ACCEPTED and then TEMPORARILY_REJECTED."""
    connected.session.send_command(command(connected, CommandKind.OFFBOARD), connected.now_ns)
    connected.ack(176, result=0)
    assert connected.received(CommandResult) == []
    connected.ack(176, result=1)
    (result,) = connected.received(CommandResult)
    assert (result.accepted, result.result) == (False, "temporarily_rejected")


def test_a_mode_command_is_accepted_when_the_mode_is_seen(connected: Any) -> None:
    connected.current_mode(HOLD)
    connected.session.send_command(command(connected, CommandKind.OFFBOARD), connected.now_ns)
    connected.ack(176)
    connected.ack(176)
    assert connected.received(CommandResult) == []
    connected.current_mode(OFFBOARD)
    (result,) = connected.received(CommandResult)
    assert (result.kind, result.accepted) == (CommandKind.OFFBOARD, True)


def test_without_current_mode_the_second_acceptance_counts(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.HOLD), connected.now_ns)
    connected.heartbeat(OFFBOARD)
    connected.ack(176)
    connected.ack(176)
    (result,) = connected.received(CommandResult)
    assert result.accepted


def test_a_mode_that_only_failsafe_has_entered_is_not_the_answer(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.RETURN), connected.now_ns)
    connected.current_mode(RETURN, intended=OFFBOARD)
    assert connected.received(CommandResult) == []
    connected.current_mode(RETURN, intended=RETURN)
    assert connected.received(CommandResult)[0].accepted


@pytest.mark.parametrize(
    ("kind", "main", "sub"),
    [
        (CommandKind.OFFBOARD, 6, 0),
        (CommandKind.HOLD, 4, 3),
        (CommandKind.RETURN, 4, 5),
        (CommandKind.LAND, 4, 6),
    ],
)
def test_modes_go_out_as_do_set_mode(connected: Any, kind: CommandKind, main: int, sub: int) -> None:
    connected.session.send_command(command(connected, kind), connected.now_ns)
    connected.collect()
    (sent,) = connected.commands(176)
    assert (sent.param1, sent.param2, sent.param3) == (1.0, main, sub)
    assert (sent.target_system, sent.target_component) == (1, 1)


def test_hold_replaces_offboard_at_once_and_does_not_take_its_answer(connected: Any) -> None:
    connected.current_mode(RETURN)
    connected.session.send_command(command(connected, CommandKind.OFFBOARD), connected.now_ns)
    connected.session.send_command(command(connected, CommandKind.HOLD), connected.now_ns)
    connected.ack(176, result=0)
    connected.ack(176, result=1)  # the verdict on OFFBOARD
    assert [(r.kind, r.result) for r in connected.received(CommandResult)] == [(CommandKind.OFFBOARD, "superseded")]
    connected.current_mode(HOLD)
    result = connected.received(CommandResult)[-1]
    assert (result.kind, result.accepted) == (CommandKind.HOLD, True)


def test_the_acceptance_of_a_disarm_is_not_that_of_the_arming_that_follows(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.DISARM), connected.now_ns)
    connected.session.send_command(command(connected, CommandKind.ARM), connected.now_ns)
    connected.ack(400)
    assert not connected.received(VehicleStatus)[-1].armed
    connected.ack(400)
    assert connected.received(VehicleStatus)[-1].armed


def test_forced_disarm_carries_the_magic_and_needs_evidence(connected: Any) -> None:
    forced = command(connected, CommandKind.FORCE_DISARM, evidence=("thrust low", "deck under feet"))
    connected.session.send_command(command(connected, CommandKind.FORCE_DISARM), connected.now_ns)
    (result,) = [m for m in connected.advance(0) if isinstance(m, CommandResult)]
    assert (result.accepted, result.result) == (False, "no evidence")
    assert connected.commands(400) == []
    connected.session.send_command(forced, connected.now_ns)
    connected.collect()
    (sent,) = connected.commands(400)
    assert (sent.param1, sent.param2) == (0.0, 21196.0)


def test_takeoff_height_becomes_an_altitude_above_sea_level(connected: Any) -> None:
    connected.deliver(mav.MAVLink_gps_global_origin_message(473977418, 85455939, 489_000, 0))
    connected.deliver(odometry(connected, z=-0.5))
    connected.session.send_command(command(connected, CommandKind.TAKEOFF, height_m=6.0), connected.now_ns)
    connected.collect()
    (sent,) = connected.commands(22)
    assert sent.param7 == pytest.approx(495.5)
    assert all(math.isnan(value) for value in (sent.param4, sent.param5, sent.param6))


def test_takeoff_without_any_altitude_leaves_the_height_to_the_autopilot(connected: Any) -> None:
    connected.session.send_command(command(connected, CommandKind.TAKEOFF, height_m=6.0), connected.now_ns)
    connected.collect()
    assert math.isnan(connected.commands(22)[0].param7)


# ----------------------------------------------------------------------------------------------------------- setpoints


def test_velocity_and_yaw_rate_go_out_with_mask_1479(connected: Any) -> None:
    assert connected.session.send_setpoint(setpoint(connected), connected.now_ns)
    (sent,) = connected.collect()
    assert sent.type_mask == 1479
    assert sent.coordinate_frame == 1
    assert (sent.vx, sent.vy, sent.vz, sent.yaw_rate) == (1.5, -0.5, 0.25, 0.5)
    assert (sent.target_system, sent.target_component) == (1, 1)


def test_acceleration_goes_along_with_mask_1031(connected: Any) -> None:
    with_feedforward = setpoint(connected, acceleration_ned_m_s2=(0.5, 0.25, 0.0))
    connected.session.send_setpoint(with_feedforward, connected.now_ns)
    (sent,) = connected.collect()
    assert sent.type_mask == 1031
    assert (sent.afx, sent.afy, sent.afz) == (0.5, 0.25, 0.0)


def test_an_expired_setpoint_is_not_sent(connected: Any) -> None:
    old = setpoint(connected)
    connected.advance(100)
    connected.collect()
    assert not connected.session.send_setpoint(old, connected.now_ns)
    assert connected.collect() == []
    assert connected.session.counters.setpoints_expired == 1


def test_no_setpoint_is_ever_sent_again(connected: Any) -> None:
    connected.session.send_setpoint(setpoint(connected), connected.now_ns)
    connected.advance(5_000)
    assert len(connected.of_type("SET_POSITION_TARGET_LOCAL_NED")) == 1


@pytest.mark.parametrize(
    "broken",
    [
        {"velocity_ned_m_s": (NAN, 0.0, 0.0)},
        {"yaw_rate_rad_s": NAN},
        {"acceleration_ned_m_s2": (0.0, math.inf, 0.0)},
    ],
)
def test_a_setpoint_that_is_not_finite_is_not_sent(connected: Any, broken: dict[str, Any]) -> None:
    assert not connected.session.send_setpoint(setpoint(connected, **broken), connected.now_ns)
    assert connected.collect() == []


# ---------------------------------------------------------------------------------------------------------------- time


def test_before_the_clocks_agree_arrival_is_the_stamp(connected: Any) -> None:
    connected.deliver(odometry(connected, time_usec=(connected.boot_ms - 30) * 1000))
    assert connected.received(VehicleState)[-1].t_ns == connected.now_ns
    assert not connected.session.clock.converged
    assert connected.session.companion_ns_from_boot_us(1_000_000) is None


def test_after_the_clocks_agree_a_message_is_stamped_with_when_it_was_true(connected: Any) -> None:
    settle_clock(connected)
    assert connected.session.clock.converged
    true_ns = connected.now_ns - 30 * MS
    boot_us = (true_ns + connected.boot_minus_companion_ns) // 1000
    (state,) = connected.deliver(odometry(connected, time_usec=boot_us))
    assert state.t_ns == pytest.approx(true_ns, abs=10_000)
    assert connected.session.companion_ns_from_boot_us(boot_us) == pytest.approx(true_ns, abs=10_000)


def test_a_stamp_is_never_in_the_future(connected: Any) -> None:
    settle_clock(connected)
    ahead_us = (connected.now_ns + 40 * MS + connected.boot_minus_companion_ns) // 1000
    (state,) = connected.deliver(odometry(connected, time_usec=ahead_us))
    assert state.t_ns == connected.now_ns


def test_the_autopilots_own_time_question_is_answered_with_our_time(connected: Any) -> None:
    connected.deliver(mav.MAVLink_timesync_message(0, 59_592_000_000))
    answer = connected.of_type("TIMESYNC")[-1]
    assert (answer.tc1, answer.ts1) == (connected.now_ns, 59_592_000_000)


def test_answers_to_somebody_elses_time_question_do_not_count(connected: Any) -> None:
    for i in range(20):
        connected.advance(50)
        connected.deliver(mav.MAVLink_timesync_message(1_000_000 * (i + 1), connected.now_ns - 123))
    assert connected.session.clock.samples == 0


def test_time_is_asked_fast_at_first_and_slower_when_settled(connected: Any) -> None:
    settle_clock(connected, seconds=1.0)
    early = len(connected.of_type("TIMESYNC"))
    assert early == 11
    settle_clock(connected, seconds=5.0)
    middle = len(connected.of_type("TIMESYNC"))
    settle_clock(connected, seconds=2.0)
    assert len(connected.of_type("TIMESYNC")) - middle == 10


def test_a_rebooted_autopilot_gets_a_new_clock(connected: Any) -> None:
    settle_clock(connected, seconds=5.0)
    connected.boot_minus_companion_ns = -connected.now_ns + 2 * SECOND
    settle_clock(connected, seconds=2.0)
    clock = connected.session.clock
    assert (clock.converged, clock.restarts) == (True, 1)
    now_us = (connected.now_ns + connected.boot_minus_companion_ns) // 1000
    assert connected.session.companion_ns_from_boot_us(now_us) == pytest.approx(connected.now_ns, abs=100_000)


def test_ping_is_answered(connected: Any) -> None:
    connected.deliver(mav.MAVLink_ping_message(123_456, 7, 0, 0))
    (pong,) = connected.of_type("PING")
    assert (pong.time_usec, pong.seq, pong.target_system, pong.target_component) == (123_456, 7, 1, 1)
    connected.deliver(mav.MAVLink_ping_message(123_456, 7, 1, 191))
    assert len(connected.of_type("PING")) == 1


# ---------------------------------------------------------------------------------------------------------- the beacon


def beacon_position(connected: Any, **changes: Any) -> mav.MAVLink_global_position_int_message:
    fields = {
        "time_boot_ms": connected.boot_ms,
        "lat": 473977418 + 8993,  # 100 m north
        "lon": 85455939,
        "alt": 490_500,
        "relative_alt": 0,
        "vx": 150,
        "vy": -50,
        "vz": 0,
        "hdg": 27_000,
    }
    return mav.MAVLink_global_position_int_message(**(fields | changes))


def test_the_beacons_position_comes_in_the_autopilots_local_frame(connected: Any) -> None:
    connected.deliver(mav.MAVLink_gps_global_origin_message(473977418, 85455939, 489_000, 0))
    (beacon,) = connected.deliver(beacon_position(connected), system=2)
    assert isinstance(beacon, PadBeacon)
    assert beacon.position_ned_m == pytest.approx((100.0, 0.0, -1.5), abs=0.01)
    assert beacon.velocity_ned_m_s == pytest.approx((1.5, -0.5, 0.0))
    assert beacon.yaw_rad == pytest.approx(-math.pi / 2)
    assert beacon.position_sigma_m == 1.5


def test_without_the_global_origin_the_beacon_says_nothing(connected: Any) -> None:
    assert connected.deliver(beacon_position(connected), system=2) == []


def test_a_beacon_without_heading_or_fix(connected: Any) -> None:
    connected.deliver(mav.MAVLink_gps_global_origin_message(473977418, 85455939, 489_000, 0))
    (beacon,) = connected.deliver(beacon_position(connected, hdg=65535), system=2)
    assert beacon.yaw_rad is None
    assert connected.deliver(beacon_position(connected, lat=0, lon=0), system=2) == []


def test_odometry_of_the_beacon_is_placed_by_its_global_position(connected: Any) -> None:
    connected.deliver(mav.MAVLink_gps_global_origin_message(473977418, 85455939, 489_000, 0))
    local = odometry(connected, x=10.0, y=0.0, z=0.0, vx=1.5, vy=0.0, vz=0.0, child_frame_id=12, yawspeed=0.25)
    assert connected.deliver(local, system=2) == []
    assert connected.deliver(beacon_position(connected), system=2) == []
    connected.advance(100)
    later = odometry(connected, x=10.15, y=0.0, z=0.0, vx=1.5, vy=0.0, vz=0.0, child_frame_id=12, yawspeed=0.25)
    (beacon,) = connected.deliver(later, system=2)
    assert beacon.source == "odometry"
    assert beacon.position_ned_m == pytest.approx((100.15, 0.0, -1.5), abs=0.02)
    assert beacon.yaw_rate_rad_s == 0.25


# --------------------------------------------------------------------------------------------------------------- texts


def test_a_text_in_chunks_is_put_together_without_its_tab(connected: Any) -> None:
    text = b"Disarmed by auto preflight disarming, and a long tail\t"
    connected.deliver(mav.MAVLink_statustext_message(6, text[:50], 9, 0))
    assert connected.received(AutopilotText) == []
    connected.deliver(mav.MAVLink_statustext_message(6, text[50:], 9, 1))
    (line,) = connected.received(AutopilotText)
    assert (line.severity, line.text) == (6, "Disarmed by auto preflight disarming, and a long tail")


# ------------------------------------------------------------------------------------------------------------- garbage


def test_bytes_that_are_no_message_are_counted_and_the_next_message_is_read(connected: Any) -> None:
    good = connected.bytes_of(odometry(connected))
    damaged = bytearray(good)
    damaged[20] ^= 0x10
    inputs = connected.deliver_bytes(b"\x00\xfd\xfe garbage" + bytes(damaged) + good + good[:30])
    assert [type(m) for m in inputs] == [VehicleState]
    assert connected.session.counters.bytes_skipped > len(damaged)


def test_a_stream_may_cut_messages_anywhere(make_wire: Any) -> None:
    wire = make_wire(url="serial:///dev/ttyAMA0:921600")
    wire.heartbeat()
    data = b"".join(wire.bytes_of(odometry(wire, x=float(i))) for i in range(5))
    for i in range(len(data)):
        wire.deliver_bytes(data[i : i + 1])
    assert [s.position_ned_m[0] for s in wire.received(VehicleState)] == [0.0, 1.0, 2.0, 3.0, 4.0]
