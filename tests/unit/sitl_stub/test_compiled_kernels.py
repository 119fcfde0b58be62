"""The pure kernels of dynamics and control give the same numbers compiled by numba as in plain Python."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from sitl_stub.airframe import read_airframe
from sitl_stub.autopilot.attitude_control import attitude_gains
from sitl_stub.autopilot.low_pass import butterworth
from sitl_stub.autopilot.parameters import Parameters
from sitl_stub.autopilot.position_control import UNSET_MOTION, Motion, PositionLimits, position_gains
from sitl_stub.autopilot.rate_control import RateState, rate_gains
from sitl_stub.multirotor import BodyState, Loads, body_of
from sitl_stub.rotation import from_euler

numba = pytest.importorskip("numba")

PX4 = Parameters().as_mapping()
BODY = body_of(read_airframe(Path(__file__).parents[3] / "configs" / "airframes" / "x500.toml"))
Q, QD = from_euler(0.1, -0.2, 0.7), from_euler(-0.1, 0.3, 1.5)
STATE = BodyState(1.0, 2.0, -3.0, 4.0, 0.5, -0.5, *Q, 0.3, -0.2, 0.1, 0.5, 0.6, 0.4, 0.5)
AT = Motion(0.0, 1.0, -30.0, 1.0, 0.5, 0.2, 0.1, 0.2, 0.3)
LIMITS = PositionLimits(12.0, 3.0, 1.5, 0.785, 0.12, 1.0)

KERNELS: list[tuple[str, str, tuple[Any, ...]]] = [
    ("sitl_stub.rotation", "rotate", (Q, (1.0, 2.0, 3.0))),
    (
        "sitl_stub.multirotor",
        "advance",
        (
            STATE,
            BODY,
            (0.5, 0.6, 0.7, 0.4),
            (1.0, 0.9, 1.0, 1.0),
            Loads(1.0, 2.0, 0.1, 0.5, 0.0, -1.0, 0.01, 0.0, 0.0),
            0.004,
        ),
    ),
    (
        "sitl_stub.autopilot.position_control",
        "control_position",
        (UNSET_MOTION._replace(vx=9.0, vy=-8.0, vz=-2.0), AT, (0.1, 0.2, 0.3), 0.5, position_gains(PX4), LIMITS, 0.008),
    ),
    (
        "sitl_stub.autopilot.position_control",
        "control_position",
        (
            Motion(5.0, 5.0, -33.0, 10.0, 3.0, *(math.nan,) * 4),
            AT,
            (0.1, 0.2, 0.3),
            0.5,
            position_gains(PX4),
            LIMITS,
            0.008,
        ),
    ),
    ("sitl_stub.autopilot.position_control", "attitude_from_thrust", (0.2, -0.1, -0.5, 1.0)),
    ("sitl_stub.autopilot.attitude_control", "control_attitude", (Q, QD, 0.3, attitude_gains(PX4))),
    (
        "sitl_stub.autopilot.rate_control",
        "control_rates",
        (
            RateState(),
            (0.1, 0.2, 0.3),
            (1.0, -2.0, 0.5),
            (5.0, 4.0, 1.0),
            (0.0, -1.0, 1.0),
            False,
            rate_gains(PX4),
            0.004,
        ),
    ),
    ("sitl_stub.autopilot.mixer", "mix", (0.5, (0.02, 0.01, 0.03))),
    ("sitl_stub.autopilot.mixer", "mix", (0.9, (0.8, -0.5, 0.7))),
    ("sitl_stub.autopilot.low_pass", "filter_sample", (butterworth(40.0, 250.0), 1.0, 0.2, 0.1)),
]


def _flat(value: Any) -> list[float]:
    return [number for part in value for number in _flat(part)] if isinstance(value, tuple) else [float(value)]


def _compile(module: ModuleType, name: str, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Compile a kernel with every function of this package that its module calls."""
    for other, function in list(vars(module).items()):
        is_ours = getattr(function, "__module__", "").startswith("sitl_stub")
        if callable(function) and not isinstance(function, type) and is_ours and hasattr(function, "__code__"):
            monkeypatch.setattr(module, other, numba.njit(function))
    return getattr(module, name)  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("module", "name", "arguments"), KERNELS, ids=[f"{name}-{i}" for i, (_, name, _) in enumerate(KERNELS)]
)
def test_compiled_kernel_agrees_with_the_plain_one(
    module: str, name: str, arguments: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = importlib.import_module(module)
    plain = _flat(getattr(loaded, name)(*arguments))
    compiled = _flat(_compile(loaded, name, monkeypatch)(*arguments))
    assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-15)
