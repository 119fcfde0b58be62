"""Statistics against published values and by hand."""

from __future__ import annotations

import pytest

from companion.campaign.statistics import cell_statistics, percentile, wilson


@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (8, 10, 0.4901, 0.9433), (99, 100, 0.9455, 0.9982)],
)
def test_wilson_interval_agrees_with_tables(successes: int, n: int, low: float, high: float) -> None:
    assert wilson(successes, n) == pytest.approx((low, high), abs=5e-4)


def test_nothing_flown_means_nothing_known() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(("fraction", "value"), [(0.0, 1.0), (0.5, 2.5), (1.0, 4.0), (0.95, 3.85)])
def test_percentiles_are_linear_between_order_statistics(fraction: float, value: float) -> None:
    assert percentile([4.0, 1.0, 3.0, 2.0], fraction) == pytest.approx(value)


def row(outcome: str, error: float | None) -> dict[str, object]:
    return {
        "outcome": outcome,
        "touchdown_error_m": error,
        "touchdown_relative_speed_horizontal_m_s": error,
        "touchdown_relative_speed_vertical_m_s": error,
        "time_to_touchdown_s": 20.0,
        "real_time_factor": 9.0,
        "forced_disarm_in_air": outcome == "fell_after_motors_off",
    }


def test_failures_count_in_the_rate_and_their_touchdowns_in_the_error() -> None:
    cell = cell_statistics(
        "x", [row("landed", 0.1), row("slid_off", 0.9), row("timeout", None), row("fell_after_motors_off", None)]
    )
    assert (cell.n, cell.landed, cell.forced_disarms_in_air) == (4, 1, 1)
    assert cell.error_mean_m == pytest.approx(0.5)
    assert cell.outcomes == {"landed": 1, "slid_off": 1, "timeout": 1, "fell_after_motors_off": 1}
