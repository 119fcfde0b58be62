"""The laws of others: each trails a moving pad by what its document (or its measurement on a real PX4) says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from plant import DT_S, Plant

from companion.config import Control
from companion.control import CONTROLLERS, YAW_LAWS, ControlInput, Reference, YawInput
from companion.geometry import ZERO

STILL = Reference(ZERO, ZERO, ZERO)
SPEED_M_S = 1.0


def lag_s(name: str, **settings: float) -> float:
    """How far the vehicle trails a pad in steady motion, in seconds of the pad's motion."""
    law = CONTROLLERS[name](Control(**settings))  # type: ignore[arg-type]
    plant, pad_m = Plant(velocity_m_s=SPEED_M_S), 0.0
    for _ in range(round(30.0 / DT_S)):
        out = law.update(
            ControlInput(
                dt_s=DT_S,
                relative_position_m=(plant.position_m - pad_m, 0.0, 0.0),
                relative_velocity_m_s=(plant.velocity_m_s - SPEED_M_S, 0.0, 0.0),
                reference=STILL,
                reference_ahead=STILL,
                pad_velocity_ahead_m_s=(SPEED_M_S, 0.0, 0.0),
                pad_acceleration_ahead_m_s2=ZERO,
                position_ned_m=(plant.position_m, 0.0, 0.0),
                velocity_ned_m_s=(plant.velocity_m_s, 0.0, 0.0),
                q_ned_frd=plant.q_ned_frd,
                goal_position_m=ZERO,
            )
        )
        plant.step(out.velocity_ned_m_s[0], out.acceleration_ned_m_s2[0])
        pad_m += SPEED_M_S * DT_S
    return (pad_m - plant.position_m) / SPEED_M_S


@pytest.mark.parametrize(
    ("name", "settings", "expected_s"),
    [
        ("p_follow", {"position_gain_hz": 1.0}, 1.0),  # measured on a real PX4: 1.0 to 1.1 s
        ("p_follow", {"position_gain_hz": 0.5}, 2.0),
        ("position_target", {"trajectory_gain_hz": 0.5, "position_gain_hz": 0.95}, 2.0),  # 1 / MPC_XY_TRAJ_P
        ("dalang", {"position_gain_hz": 0.8, "damping": 0.27}, 1.27 / 0.8),  # the paper's own figures give 1.59 s
        ("target_velocity", {"position_gain_hz": 1.0}, 0.0),
        ("velocity", {}, 0.0),
    ],
)
def test_lag_behind_a_moving_pad(name: str, settings: dict[str, float], expected_s: float) -> None:
    assert lag_s(name, **settings) == pytest.approx(expected_s, abs=0.03)


def test_followers_look_at_the_goal_and_not_at_the_plan() -> None:
    law = CONTROLLERS["p_follow"](Control(position_gain_hz=1.0, vertical_gain_hz=1.0))
    planned = Reference((5.0, 0.0, -8.0), (0.5, 0.0, 0.3), ZERO)
    given = ControlInput(
        dt_s=DT_S,
        relative_position_m=(6.0, 1.0, -8.5),
        relative_velocity_m_s=ZERO,
        reference=planned,
        reference_ahead=planned,
        pad_velocity_ahead_m_s=(9.0, 9.0, 9.0),
        pad_acceleration_ahead_m_s2=ZERO,
        goal_position_m=ZERO,
    )
    assert law.update(given).velocity_ned_m_s == pytest.approx((-6.0, -1.0, 0.3 + 0.5))
    assert law.update(replace(given, goal_position_m=None)).velocity_ned_m_s == pytest.approx((-1.0, -1.0, 0.8))


YAW = YawInput(
    yaw_rad=0.2,
    initial_yaw_rad=0.0,
    pad_yaw_rad=0.5,
    velocity_ned_m_s=(3.0, 0.0, 0.0),
    yaw_rate_rad_s=0.4,
    commanded_velocity_ned_m_s=(0.0, 2.0, 0.0),
    relative_position_m=(0.0, 0.0, -0.3),
)


def test_dalang_turns_to_the_commanded_direction_with_its_damping() -> None:
    rate = 2.5 * YAW_LAWS["dalang"](YAW)
    assert rate == pytest.approx(2.5 * (1.5707963 - 0.2) - 0.5 * 0.4, abs=1e-6)
    slow = replace(YAW, commanded_velocity_ned_m_s=ZERO)
    assert 2.5 * YAW_LAWS["dalang"](slow) == pytest.approx(-0.2)


@pytest.mark.parametrize(
    ("relative_m", "inside"),
    [
        ((0.0, 0.0, -0.3), True),
        ((0.14, 0.0, -0.3), True),
        ((0.16, 0.0, -0.3), False),
        ((-0.09, 0.0, -0.3), True),
        ((-0.11, 0.0, -0.3), False),
        ((0.0, 0.24, -0.3), True),
        ((0.0, -0.26, -0.3), False),
        ((0.0, 0.0, -0.61), False),
    ],
)
def test_guo_corrects_yaw_only_inside_the_box(relative_m: tuple[float, float, float], inside: bool) -> None:
    error = YAW_LAWS["guo"](replace(YAW, pad_yaw_rad=0.0, relative_position_m=relative_m))
    assert error == (pytest.approx(-0.2) if inside else 0.0)


def test_guos_box_turns_with_the_pad() -> None:
    """A pad that heads east: 20 cm north of its centre is across, not ahead."""
    east = replace(YAW, pad_yaw_rad=1.5707963267948966, relative_position_m=(0.2, 0.0, -0.3))
    assert YAW_LAWS["guo"](east) != 0.0
    assert YAW_LAWS["guo"](replace(east, relative_position_m=(0.0, 0.2, -0.3))) == 0.0
    assert YAW_LAWS["guo"](replace(east, pad_yaw_rad=None)) == 0.0
