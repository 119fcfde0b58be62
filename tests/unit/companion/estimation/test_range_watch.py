"""A range sensor that is stuck is told from one that stands above a still deck."""

from companion.estimation.range_watch import RangeWatch


def test_one_reading_repeated_while_the_vehicle_sinks_is_stuck_until_it_changes() -> None:
    watch = RangeWatch()
    stuck = [watch.is_stuck(3.0, -4.0 + 0.025 * k) for k in range(40)]
    assert not any(stuck[:12])
    assert all(stuck[14:])
    assert not watch.is_stuck(2.1, -3.0)


def test_a_hovering_vehicle_may_read_the_same_for_long() -> None:
    watch = RangeWatch()
    assert not any(watch.is_stuck(3.0, -4.0 + 0.1 * (k % 2)) for k in range(1000))


def test_readings_that_follow_the_descent_are_believed() -> None:
    watch = RangeWatch()
    assert not any(watch.is_stuck(round(4.0 - 0.025 * k, 2), -4.0 + 0.025 * k) for k in range(150))


def test_no_reading_is_not_a_stuck_one() -> None:
    watch = RangeWatch()
    assert not any(watch.is_stuck(None, -4.0 + 0.1 * k) for k in range(50))
