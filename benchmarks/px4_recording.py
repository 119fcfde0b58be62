"""Recordings of a real PX4 in the format of the step campaign: one CSV, times in simulated seconds since the setpoint changed.

Columns: `cmd_*` what was sent (empty: ignored by the mask), `x..z, vx..vz, roll..yaw, p..r` PX4's estimate, `sp_*` its attitude
and thrust setpoint, `px4sp_*` its velocity and acceleration setpoint, `true_v*` ground truth. NED, SI, radians. Read by
px4_fidelity.py and by the conformance tests.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Array = np.ndarray
FRAME_BODY_NED = 8
_COMMAND = ("cmd_x", "cmd_y", "cmd_z", "cmd_vx", "cmd_vy", "cmd_vz", "cmd_yaw", "cmd_yaw_rate")
_ROW_S = 0.008


@dataclass(frozen=True, slots=True)
class Command:
    """One setpoint as it came over the wire; NaN where ignored. `t_s` is when the position loop first could see it."""

    t_s: float
    is_body_frame: bool
    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]
    yaw_rad: float
    yaw_rate_rad_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One file. `columns` holds each column as floats, NaN where empty."""

    name: str
    columns: dict[str, Array]
    commands: tuple[Command, ...]

    @property
    def t_s(self) -> Array:
        return self.columns["t_s"]

    def vector(self, *names: str) -> Array:
        """Columns side by side, shape (rows, len(names))."""
        return np.stack([self.columns[name] for name in names], axis=1)

    @property
    def start(self) -> int:
        """Last row before the first new command."""
        return max(int(np.searchsorted(self.t_s, self.commands[1].t_s - 1e-6)) - 1, 0)


def is_step_recording(path: Path) -> bool:
    """Has the columns of the step campaign."""
    with path.open(encoding="ascii") as file:
        header = file.readline()
    return "cmd_vx" in header and "true_vx" in header


def read_recording(path: Path) -> Recording:
    """Read one file; ValueError when it is not of this format or no command changes in it."""
    with path.open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows or "cmd_vx" not in rows[0]:
        raise ValueError(f"{path}: not a step recording")
    columns = {name: np.array([float(row[name]) if row[name] else np.nan for row in rows]) for name in rows[0]}
    commands = _commands(columns)
    if len(commands) < 2:
        raise ValueError(f"{path}: no command changes")
    return Recording(path.stem, columns, commands)


def _commands(columns: dict[str, Array]) -> tuple[Command, ...]:
    """Each change of the command columns. The row that shows it comes up to 8 ms after a missing row that would have shown it."""
    table = np.stack([columns[name] for name in ("frame", *_COMMAND)], axis=1)
    changed = np.any(~((table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))), axis=1)
    t_s = columns["t_s"]
    found = [_command(float(t_s[0]), table[0])]
    for row in np.flatnonzero(changed) + 1:
        found.append(_command(min(float(t_s[row]), float(t_s[row - 1]) + _ROW_S), table[row]))
    return tuple(found)


def _command(t_s: float, values: Array) -> Command:
    frame, x, y, z, vx, vy, vz, yaw, yaw_rate = (float(value) for value in values)
    return Command(t_s, frame == FRAME_BODY_NED, (x, y, z), (vx, vy, vz), yaw, yaw_rate)
