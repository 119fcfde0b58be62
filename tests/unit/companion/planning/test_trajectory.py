"""One type for all trajectories: evaluation, joints, and what happens outside."""

from __future__ import annotations

import pytest

from companion.planning.trajectory import Trajectory, derivative, horner, quintic

TWO_PIECES = Trajectory(
    start_ns=1_000,
    breaks_s=(0.0, 1.0, 3.0),
    pieces=(((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, -5.0)), ((0.0, 2.0, 1.0), (0.0, 2.0, 2.0), (1.0, 0.0, -5.0))),
)


def test_a_piece_is_evaluated_from_its_own_beginning() -> None:
    position, velocity, acceleration = TWO_PIECES.sample(2.0)
    assert position == (3.0, 4.0, -4.0)
    assert velocity == (2.0, 2.0, 2.0)
    assert acceleration == (0.0, 0.0, 2.0)


def test_before_the_start_the_start_state_holds() -> None:
    assert TWO_PIECES.sample(-3.0) == TWO_PIECES.sample(0.0) == ((0.0, 0.0, -5.0), (0.0, 2.0, 0.0), (2.0, 0.0, 0.0))


def test_at_the_end_the_end_state_is_exact_and_after_it_the_position_rests() -> None:
    assert TWO_PIECES.sample(3.0) == ((5.0, 6.0, -1.0), (2.0, 2.0, 4.0), (0.0, 0.0, 2.0))
    assert TWO_PIECES.sample(3.1) == ((5.0, 6.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_an_instant_of_the_clock_counts_from_the_start() -> None:
    assert TWO_PIECES.sample_at(1_000 + 2_000_000_000) == TWO_PIECES.sample(2.0)
    assert TWO_PIECES.end_ns == 3_000_001_000


def test_jerk_is_the_third_derivative_inside_and_zero_outside() -> None:
    cubic = Trajectory(0, (0.0, 2.0), (((1.0, 0.0, 0.0, 0.0), (0.0,) * 4, (-2.0, 1.0, 0.0, 0.0)),))
    assert cubic.jerk(1.0) == (6.0, 0.0, -12.0)
    assert cubic.jerk(-0.1) == cubic.jerk(2.1) == (0.0, 0.0, 0.0)


def test_a_quintic_meets_both_full_states() -> None:
    start, end, width = (1.0, -0.5, 0.3), (-2.0, 0.7, -0.4), 1.7
    c = quintic(width, start, end)
    for order in range(3):
        assert horner(derivative(c, order), 0.0) == pytest.approx(start[order], abs=1e-12)
        assert horner(derivative(c, order), width) == pytest.approx(end[order], abs=1e-12)
