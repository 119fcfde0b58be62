"""Cox-de Boor as printed, and the paper's two words for a landing."""

from __future__ import annotations

import pytest

from companion.reproduce.dalang import basis, basis_slope, verdict_of


@pytest.mark.parametrize("t", [0.0, 0.2, 0.5, 0.99, 1.0])
def test_the_basis_adds_up_to_one_and_its_slopes_to_none(t: float) -> None:
    assert sum(basis(i, 3, t) for i in range(4)) == pytest.approx(1.0)
    assert sum(basis_slope(i, 3, t, 3.0) for i in range(4)) == pytest.approx(0.0, abs=1e-12)


def test_the_slope_has_the_degree_as_factor_and_not_one_less() -> None:
    h = 1e-6
    for index in range(4):
        measured = (basis(index, 3, 0.4 + h) - basis(index, 3, 0.4 - h)) / (2.0 * h)
        assert basis_slope(index, 3, 0.4, 3.0) == pytest.approx(measured, abs=1e-8)
        assert basis_slope(index, 3, 0.4, 2.0) != pytest.approx(measured, abs=1e-3)


@pytest.mark.parametrize(
    ("outcome", "pad_speed_m_s", "word"),
    [
        ("landed", 0.1, "Success"),
        ("landed", 0.0, "MPS"),
        ("timeout", None, "timeout"),
        ("off_pad", 0.1, "off_pad"),
    ],
)
def test_success_is_a_landing_while_the_pad_moves(outcome: str, pad_speed_m_s: float | None, word: str) -> None:
    assert verdict_of({"outcome": outcome, "pad_speed_m_s": pad_speed_m_s}) == word
