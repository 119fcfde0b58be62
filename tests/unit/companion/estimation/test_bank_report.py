"""What a track tells, and the way from O to W."""

from __future__ import annotations

from dataclasses import fields, replace

from pads import frames, line, ns, sights

from companion.config import Estimation
from companion.estimation import ESTIMATORS
from companion.estimation.bank_report import moved


def test_moving_an_estimate_to_w_leaves_all_but_position_and_velocity() -> None:
    estimator = ESTIMATORS["imm"](Estimation())
    for measurement in sights(line(2.0), frames(0.0, 1.0), seed=1):
        estimator.observe(measurement)
    estimate = estimator.estimate(ns(1.0))
    assert estimate is not None
    estimate = replace(estimate, beacon_age_s=0.4, roll_rad=0.1, pitch_rad=0.2)
    after = moved(estimate, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    changed = {field.name for field in fields(after) if getattr(after, field.name) != getattr(estimate, field.name)}
    assert changed == {"position_ned_m", "velocity_ned_m_s"}
    assert after.position_ned_m[2] == estimate.position_ned_m[2] + 3.0
    assert after.velocity_ned_m_s[0] == estimate.velocity_ned_m_s[0] + 0.1
