"""Keeps a carrier on its path: speed and turn rate from the error in its own frame.

The law of Kanayama et al. (1990): v = v_r cos e_h + k_x e_x, w = w_r + v_r (k_y e_y + k_h sin e_h), where e_x, e_y is the
reference seen from the carrier and e_h the heading error. k_y = 1 / s^2 and k_h = 1.6 / s close an error over the way s,
which must be long against the way a carrier makes in its lags. The lag in speed is led by `lead_s` of the reference.
"""

from __future__ import annotations

import math

from sitl_stub.paths import PathReference

_ALONG_GAIN_HZ = 0.8
_DAMPING = 1.6


def follow(
    reference: PathReference, north_m: float, east_m: float, heading_rad: float, *, lead_s: float, settle_m: float
) -> tuple[float, float]:
    """Wanted speed (m/s) and turn rate (rad/s)."""
    reference_north_m, reference_east_m, reference_heading_rad, v, acceleration_m_s2, curvature_1_m = reference
    dn, de = reference_north_m - north_m, reference_east_m - east_m
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    ahead, right = c * dn + s * de, c * de - s * dn
    error = math.remainder(reference_heading_rad - heading_rad, math.tau)
    turn = v * (curvature_1_m + right / settle_m**2 + _DAMPING * math.sin(error) / settle_m)
    if v <= 0.0 and abs(ahead) < 0.05:
        ahead = 0.0
    # A driver who is late does not race: the gap closes at a tenth of the speed, or half a metre per second.
    catch_up = slew(0.0, _ALONG_GAIN_HZ * ahead, 0.5 + 0.1 * v)
    return v * math.cos(error) + catch_up + lead_s * acceleration_m_s2, turn


def slew(value: float, wanted: float, largest_step: float) -> float:
    """`wanted`, or as near as one step comes."""
    least, most = value - largest_step, value + largest_step
    wanted = least if wanted < least else wanted
    return most if wanted > most else wanted
