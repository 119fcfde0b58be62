"""The power model of the `guo` paper: P = 1/2 C_D A rho v^3 + sqrt((m g)^3 / (2 pi r^2 rho)). SI.

Its second term, what it costs to stay up, is here once; how the vehicle's drag is known differs between those who ask.
"""

from __future__ import annotations

import math

AIR_KG_M3 = 1.225
GRAVITY_M_S2 = 9.80665


def hover_power_w(mass_kg: float, rotor_radius_m: float) -> float:
    """Induced power of one disc that carries the weight."""
    weight_n = mass_kg * GRAVITY_M_S2
    return math.sqrt(weight_n**3 / (2.0 * math.pi * rotor_radius_m**2 * AIR_KG_M3))
