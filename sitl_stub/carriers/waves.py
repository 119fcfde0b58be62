"""A long-crested sea: JONSWAP spectrum (Hasselmann et al., 1973), deep water, as a sum of sines with seeded phases.

S(w) ~ w^-5 exp(-5/4 (wp/w)^4) gamma^r, scaled so that the significant height is what the scenario asks. Elevation is up;
the phase of each component is w t - k x + e with k = w^2 / g and x the way along the direction in which the waves run, so
that a boat under way meets them at its own encounter frequency.
"""

from __future__ import annotations

import math

import numpy as np

_GRAVITY_M_S2 = 9.80665
_PEAKEDNESS = 3.3
_COMPONENTS = 20


class Sea:
    """Elevation and slopes of the water, averaged over a hull of the given length and beam.

    Averaging over the waterplane is what makes a hull ignore waves shorter than itself: each component is scaled by
    sinc(k L cos mu / 2) sinc(k B sin mu / 2), with mu the angle between the hull and the waves.
    """

    def __init__(
        self, significant_height_m: float, peak_period_s: float, toward_rad: float, rng: np.random.Generator
    ) -> None:
        omega, amplitude = components(significant_height_m, peak_period_s, rng)
        phase = rng.uniform(0.0, math.tau, len(omega))
        self._waves = [
            (a, w, w * w / _GRAVITY_M_S2, e)
            for a, w, e in zip(amplitude.tolist(), omega.tolist(), phase.tolist(), strict=True)
        ]
        self._cos, self._sin = math.cos(toward_rad), math.sin(toward_rad)
        self._toward_rad = toward_rad

    def largest_elevation_m(self) -> float:
        return float(sum(wave[0] for wave in self._waves))

    def hull(
        self,
        t_s: float,
        north_m: float,
        east_m: float,
        velocity_m_s: tuple[float, float],
        heading_rad: float,
        length_m: float,
        beam_m: float,
    ) -> tuple[float, float, float, float, float, float]:
        """Elevation (m, up), pitch (rad, nose up) and roll (rad, right side down) of the mean plane under the hull.

        Then the rates of the three as the hull moves with `velocity_m_s` (north, east).
        """
        along = self._cos * north_m + self._sin * east_m
        along_rate = self._cos * velocity_m_s[0] + self._sin * velocity_m_s[1]
        mu = self._toward_rad - heading_rad
        c, s = math.cos(mu), math.sin(mu)
        half_length, half_beam = 0.5 * length_m * c, 0.5 * beam_m * s
        up = slope = up_rate = slope_rate = 0.0
        for a, w, k, e in self._waves:
            angle = w * t_s - k * along + e
            rate = w - k * along_rate
            felt = a * _sinc(k * half_length) * _sinc(k * half_beam)
            ca, sa = felt * math.cos(angle), felt * math.sin(angle)
            up += ca
            up_rate -= sa * rate
            slope += k * sa
            slope_rate += k * ca * rate
        return up, slope * c, -slope * s, up_rate, slope_rate * c, -slope_rate * s


def components(
    significant_height_m: float, peak_period_s: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Angular frequencies (rad/s) and amplitudes (m); frequencies are jittered so that the sea does not repeat."""
    peak = math.tau / peak_period_s
    edges = np.linspace(0.6 * peak, 3.0 * peak, _COMPONENTS + 1)
    omega = edges[:-1] + rng.random(_COMPONENTS) * np.diff(edges)
    width = np.where(omega <= peak, 0.07, 0.09)
    r = np.exp(-0.5 * ((omega - peak) / (width * peak)) ** 2)
    spectrum = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * _PEAKEDNESS**r
    energy = spectrum * np.diff(edges)
    # Hs = 4 sqrt(m0) and m0 is the sum of a^2 / 2.
    amplitude = np.sqrt(2.0 * energy * (significant_height_m / 4.0) ** 2 / energy.sum())
    return omega, amplitude


def _sinc(x: float) -> float:
    return math.sin(x) / x if abs(x) > 1e-6 else 1.0
