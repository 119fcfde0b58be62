"""One gate of one component: what it lets through and when it gives in."""

from companion.estimation.gate import AxisGate, Decision, judge

R = 0.001
LIMIT = 3.29
FRAME_NS = 33_000_000


def feed(gate: AxisGate, values: list[float], start: int = 0, *, both_axes: bool = False) -> list[Decision]:
    return [
        judge(gate, t_ns=(start + k) * FRAME_NS, y=y, S=2.0 * R, R=R, limit=LIMIT, both_axes=both_axes)
        for k, y in enumerate(values)
    ]


def confirmed(seconds: float) -> tuple[AxisGate, int]:
    gate, count = AxisGate(), round(seconds * 1e9 / FRAME_NS)
    assert set(feed(gate, [0.0] * count)) == {Decision.ACCEPT}
    return gate, count


def test_five_sigma_is_rejected_and_two_sigma_accepted() -> None:
    gate, k = confirmed(1.0)
    assert feed(gate, [5.0 * (2.0 * R) ** 0.5, 2.0 * (2.0 * R) ** 0.5], k) == [Decision.REJECT, Decision.ACCEPT]


def test_a_steady_offset_is_kept_out_as_long_as_the_track_was_confirmed() -> None:
    gate, k = confirmed(7.0)
    decisions = feed(gate, [1.0] * 300, k)
    first = decisions.index(Decision.REACQUIRE)
    assert 6.9 <= first * FRAME_NS / 1e9 <= 7.1


def test_a_fresh_track_gives_in_at_once() -> None:
    gate, k = confirmed(0.1)
    assert Decision.REACQUIRE in feed(gate, [1.0] * 8, k)


def test_values_that_contradict_each_other_never_convince() -> None:
    gate, k = confirmed(1.0)
    assert set(feed(gate, [1.0, -1.0] * 300, k)) == {Decision.REJECT}


def test_what_leaves_the_gate_gradually_is_followed_soon() -> None:
    gate, k = confirmed(10.0)
    decisions = feed(gate, [0.02 * i for i in range(30)], k)
    assert decisions.index(Decision.REACQUIRE) - decisions.index(Decision.REJECT) <= 5


def test_a_jump_on_both_axes_is_believed_after_a_second_and_a_half() -> None:
    gate, k = confirmed(10.0)
    decisions = feed(gate, [1.0] * 100, k, both_axes=True)
    assert 1.4 <= decisions.index(Decision.REACQUIRE) * FRAME_NS / 1e9 <= 1.6


def test_after_the_outliers_the_axis_is_accepted_again() -> None:
    gate, k = confirmed(10.0)
    assert set(feed(gate, [1.0] * 150, k)) == {Decision.REJECT}
    assert feed(gate, [0.05], k + 150) == [Decision.ACCEPT]
