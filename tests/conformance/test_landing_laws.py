"""Landing laws over moving pads, with the estimate's errors on: the simulated PX4 lands on the pads that the real one landed on.

Single rows of the table of docs/landing-laws.md, flown by benchmarks/landing_laws.py. Each is recorded as three of three or none.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from landing_laws import RECORDED, Flight, Pad  # noqa: E402

LANDED = [
    ("precland hacc 0.2", "line0", 0.97),
    ("precland hacc 0.2", "line0.3", 1.2),
    ("precland hacc 1.0", "line0.5", 1.8),
    ("naive", "line0.1", 0.43),
    ("good", "line1.0", 0.3),
    ("good", "circle1", 0.5),
    ("good with acceleration", "line2.0", 0.3),
]
NOT_LANDED = [("precland hacc 0.2", "line0.5"), ("precland hacc 1.0", "line2.0"), ("naive", "line1.0")]


@pytest.mark.parametrize(("law", "pad", "most_m"), LANDED)
def test_a_pad_that_was_landed_on_is_landed_on(law: str, pad: str, most_m: float) -> None:
    run = Flight(law, pad, seed=1).run()
    assert run.landed
    assert run.miss_m < most_m


@pytest.mark.parametrize(("law", "pad"), NOT_LANDED)
def test_a_pad_that_was_never_landed_on_is_not(law: str, pad: str) -> None:
    assert not Flight(law, pad, seed=1).run().landed


def test_precision_landing_lags_two_seconds_and_more_behind_a_pad() -> None:
    """Recorded: 2.2 s at 0.5 m/s."""
    lag_s = Flight("precland hacc 0.2", "line0.5", seed=2).run().lag_s
    assert lag_s is not None
    assert 1.9 < lag_s < 3.0


def test_every_row_of_the_recording_names_a_pad_that_can_be_flown() -> None:
    pads = [line.split(",")[1] for line in RECORDED.read_text(encoding="ascii").splitlines()[1:]]
    assert len(pads) == 52
    for name in set(pads):
        pad = Pad(name, np.random.default_rng(0))
        assert sum(v * v for v in pad.velocity(0.0)) == pytest.approx(pad.speed_m_s**2, rel=0.01, abs=1e-9)
