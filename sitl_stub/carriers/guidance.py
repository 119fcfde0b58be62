"""Keeps a carrier on its path: speed and turn rate from the error in its own frame.

The law of Kanayama et al. (1990): v = v_r cos e_h + k_x e_x, w = w_r + v_r (k_y e_y + k_h sin e_h), where e_x, e_y is the
reference seen from the carrier and e_h the heading error. The lag of the carrier is led by `lead_s` of the reference.
"""

from __future__ import annotations

import math

from sitl_stub.paths import PathReference

_ALONG_GAIN_HZ = 0.8
_ACROSS_GAIN_1_M2 = 0.4
_HEADING_GAIN_1_M = 1.2


def follow(
    reference: PathReference, north_m: float, east_m: float, heading_rad: float, lead_s: float
) -> tuple[float, float]:
    """Wanted speed (m/s) and turn rate (rad/s)."""
    dn, de = reference.north_m - north_m, reference.east_m - east_m
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    ahead, right = c * dn + s * de, c * de - s * dn
    error = math.remainder(reference.heading_rad - heading_rad, math.tau)
    v = reference.speed_m_s
    turn = v * reference.curvature_1_m + v * (_ACROSS_GAIN_1_M2 * right + _HEADING_GAIN_1_M * math.sin(error))
    if v <= 0.0 and abs(ahead) < 0.05:
        ahead = 0.0
    return v * math.cos(error) + _ALONG_GAIN_HZ * ahead + lead_s * reference.acceleration_m_s2, turn


def slew(value: float, wanted: float, largest_step: float) -> float:
    """`wanted`, or as near as one step comes."""
    return min(max(wanted, value - largest_step), value + largest_step)
