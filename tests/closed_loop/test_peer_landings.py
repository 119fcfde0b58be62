"""The law of PX4's precision landing, as re-stated in configs/peers, does on the simulated SIH vehicle what the real PX4 did."""

from __future__ import annotations

from pathlib import Path

from companion.campaign.runner import fly
from companion.config import load_with
from sitl_stub.scenario import load, with_overrides

PRESET = Path(__file__).parents[2] / "configs" / "peers" / "px4_precision_landing.toml"
RECORDED_WORST_MISS_M = 0.97
"""Real PX4, PLD_HACC_RAD 0.2, pads of 0 to 0.3 m/s, nine landings (tests/data/px4/landing_laws.csv)."""


def test_px4s_precision_landing_re_stated_comes_down_on_a_still_pad() -> None:
    world = {"vehicle.airframe": "sih_quadx", "duration_limit_s": 90.0, "path.speed_m_s": 0.0}
    result = fly(with_overrides(load("line"), world), load_with([PRESET], {}), seed=1)
    assert result.verdict.touchdown_error_m is not None
    assert result.verdict.touchdown_error_m <= RECORDED_WORST_MISS_M
    assert not result.verdict.forced_disarm_in_air
