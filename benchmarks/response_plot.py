"""Two curves over time as a small SVG, for docs/simulator.md: the recording dark, the simulator orange. Needs no library."""

from __future__ import annotations

from pathlib import Path

import numpy as np

_WIDTH, _HEIGHT, _LEFT, _TOP, _BOTTOM = 520, 220, 44, 24, 24
_RECORDED, _STUB = "#333333", "#d9730d"


def write_plot(path: Path, title: str, t_s: np.ndarray, recorded: np.ndarray, stub: np.ndarray) -> None:
    """One line per column of `recorded` and `stub` (shape (n, lines))."""
    low, high = float(min(recorded.min(), stub.min())), float(max(recorded.max(), stub.max()))
    span = max(high - low, 1e-6)
    x = _LEFT + (t_s - t_s[0]) / (t_s[-1] - t_s[0]) * (_WIDTH - _LEFT - 8)

    def line(values: np.ndarray, colour: str) -> str:
        y = _TOP + (high - values) / span * (_HEIGHT - _TOP - _BOTTOM)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[::3], y[::3], strict=True))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.2"/>'

    marks = [
        f'<text x="{_LEFT - 4}" y="{_TOP + (high - value) / span * (_HEIGHT - _TOP - _BOTTOM) + 4:.1f}" text-anchor="end">{value:.1f}</text>'
        for value in (low, high)
    ]
    marks += [
        f'<text x="{_LEFT}" y="{_HEIGHT - 6}">{t_s[0]:.1f} s</text>',
        f'<text x="{_WIDTH - 8}" y="{_HEIGHT - 6}" text-anchor="end">{t_s[-1]:.1f} s</text>',
        f'<text x="{_LEFT}" y="14">{title}</text>',
        f'<text x="{_WIDTH - 90}" y="{_TOP + 12}" fill="{_RECORDED}">PX4</text>',
        f'<text x="{_WIDTH - 60}" y="{_TOP + 12}" fill="{_STUB}">simulator</text>',
    ]
    lines = [line(recorded[:, i], _RECORDED) + line(stub[:, i], _STUB) for i in range(recorded.shape[1])]
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{_HEIGHT}" font-family="sans-serif" font-size="10">'
        f'<rect width="100%" height="100%" fill="white"/>{"".join(lines)}{"".join(marks)}</svg>\n',
        encoding="utf-8",
    )
