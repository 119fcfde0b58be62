"""Statistics of a campaign: success with Wilson intervals, percentiles of what was touched. Survivors and all are kept apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Z_95 = 1.959963984540054


def wilson(successes: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson score interval of a proportion; (0, 1) for n = 0. 95 % by default."""
    if n == 0:
        return 0.0, 1.0
    p = successes / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def percentile(values: Sequence[float], fraction: float) -> float | None:
    """Linear between order statistics; None for no values."""
    if not values:
        return None
    ordered = sorted(values)
    at = fraction * (len(ordered) - 1)
    low = math.floor(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])


@dataclass(frozen=True, slots=True)
class CellStatistics:
    """One combination of a campaign. Percentiles are over all flights that touched the pad, landed or not."""

    cell: str
    n: int
    landed: int
    wilson_low: float
    wilson_high: float
    error_p50_m: float | None
    error_p95_m: float | None
    error_mean_m: float | None
    speed_horizontal_p95_m_s: float | None
    speed_vertical_p95_m_s: float | None
    tilt_p95_deg: float | None
    time_p50_s: float | None
    first_sight_to_touchdown_p50_s: float | None
    real_time_factor_p50: float | None
    forced_disarms_in_air: int
    down_in_no_land_zone: int
    """Flights that touched pad or ground in a no-land zone into which they had flown."""
    lowest_in_no_land_zone_m: float | None
    outcomes: dict[str, int]


def cell_statistics(cell: str, rows: Sequence[dict[str, Any]]) -> CellStatistics:
    """Statistics of the rows of one cell."""
    landed = sum(1 for row in rows if row["outcome"] == "landed")
    low, high = wilson(landed, len(rows))
    errors = _numbers(rows, "touchdown_error_m")
    heights_in_zones = _numbers(rows, "lowest_in_no_land_zone_m")
    outcomes: dict[str, int] = {}
    for row in rows:
        outcomes[row["outcome"]] = outcomes.get(row["outcome"], 0) + 1
    return CellStatistics(
        cell=cell,
        n=len(rows),
        landed=landed,
        wilson_low=low,
        wilson_high=high,
        error_p50_m=percentile(errors, 0.5),
        error_p95_m=percentile(errors, 0.95),
        error_mean_m=sum(errors) / len(errors) if errors else None,
        speed_horizontal_p95_m_s=percentile(_numbers(rows, "touchdown_relative_speed_horizontal_m_s"), 0.95),
        speed_vertical_p95_m_s=percentile(_numbers(rows, "touchdown_relative_speed_vertical_m_s"), 0.95),
        tilt_p95_deg=percentile(_numbers(rows, "touchdown_tilt_deg"), 0.95),
        time_p50_s=percentile(_numbers(rows, "time_to_touchdown_s"), 0.5),
        first_sight_to_touchdown_p50_s=percentile(_numbers(rows, "first_sight_to_touchdown_s"), 0.5),
        real_time_factor_p50=percentile(_numbers(rows, "real_time_factor"), 0.5),
        forced_disarms_in_air=sum(1 for row in rows if row["forced_disarm_in_air"]),
        down_in_no_land_zone=sum(1 for height_m in heights_in_zones if height_m == 0.0),
        lowest_in_no_land_zone_m=min(heights_in_zones, default=None),
        outcomes=outcomes,
    )


def _numbers(rows: Sequence[dict[str, Any]], key: str) -> list[float]:
    """Rows of lost flights have no figures."""
    return [float(row[key]) for row in rows if row.get(key) is not None]
