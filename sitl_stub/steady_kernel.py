"""Many steps of steady flight in one call: estimate, control cascade and rigid body over flat state. For steady_flight.py.

The loop is plain Python or part of a compiled kernel (burst_kernel.py); `b`, `e`, `k` are the flat states of the body, the estimator
(estimate.py) and the cascade (steady_control.py).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from sitl_stub.autopilot.attitude_control import AttitudeGains
from sitl_stub.autopilot.estimate import ErrorModel, step_estimate
from sitl_stub.autopilot.hover_thrust import HoverSettings
from sitl_stub.autopilot.land_detector import follow_hover
from sitl_stub.autopilot.low_pass import Butterworth
from sitl_stub.autopilot.position_control import Motion, PositionGains
from sitl_stub.autopilot.rate_control import RateGains
from sitl_stub.autopilot.steady_control import STEP_S, Asked, LoopConstants, control
from sitl_stub.compiled import COMPILED, room, used_by_kernels
from sitl_stub.multirotor import Motors, advance
from sitl_stub.rotation import Vec3
from sitl_stub.wind import blow

STEP_US = 4000
BODY_SIZE = 20
DECISION_PERIOD_US = 8000.0


class GroundContactLimits(NamedTuple):
    """When the land detector would see ground contact, were the range right too."""

    low_thrust: float
    vertical_m_s: float
    horizontal_m_s: float


class FlightConstants(NamedTuple):
    """All that stays the same while the vehicle flies steadily."""

    body: tuple[float, ...]
    """Of a Body; a plain tuple is taken apart faster."""
    health: Motors
    model: ErrorModel
    loops: LoopConstants
    contact: GroundContactLimits


@used_by_kernels
def _constants_from_flat(c: Any) -> FlightConstants:
    """The constants from their numbers one after the other: a compiled kernel takes an array faster than tuples in tuples."""
    body = (c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16])
    health = (c[17], c[18], c[19], c[20])
    model = ErrorModel(
        (c[21], c[22], c[23], c[24], c[25]),
        (c[26], c[27], c[28], c[29], c[30]),
        (c[31], c[32], c[33], c[34], c[35], c[36], c[37]),
        (c[38], c[39], c[40], c[41], c[42], c[43], c[44]),
        (c[45], c[46], c[47], c[48], c[49], c[50], c[51]),
        c[52],
        (c[53], c[54], c[55]),
        (c[56], c[57], c[58]),
        Butterworth(c[59], c[60], c[61], c[62], c[63]),
        c[64],
    )
    rate = RateGains(
        (c[65], c[66], c[67]),
        (c[68], c[69], c[70]),
        (c[71], c[72], c[73]),
        (c[74], c[75], c[76]),
        (c[77], c[78], c[79]),
        c[80],
    )
    attitude = AttitudeGains(c[81], c[82], c[83], c[84], c[85], c[86], c[87])
    position = PositionGains(c[88], c[89], c[90], c[91], c[92], c[93], c[94], c[95], c[96], c[97] > 0.5)
    hover = HoverSettings(c[98], c[99], c[100], c[101], c[102], c[103], c[104])
    loops = LoopConstants(
        rate, attitude, position, hover, c[105] > 0.5, c[106], c[107], c[108], c[109], c[110], c[111], c[112], c[113]
    )
    return FlightConstants(body, health, model, loops, GroundContactLimits(c[114], c[115], c[116]))


@used_by_kernels
def _asked_from_flat(c: Any) -> Asked:
    return Asked(Motion(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]), c[9], c[10], c[11] > 0.5, c[12] > 0.5)


def _same(value: Any) -> Any:
    return value


def _flat(value: Any) -> list[float]:
    """The numbers of tuples in tuples, one after the other."""
    return [number for part in value for number in _flat(part)] if isinstance(value, tuple) else [float(value)]


_constants_of = _constants_from_flat if COMPILED else _same
_asked_of = _asked_from_flat if COMPILED else _same


def flown_by_kernel(asked: Asked) -> Any:
    return room(asked[0] + asked[1:]) if COMPILED else asked


def for_kernel(value: Any) -> Any:
    """Constants as the kernel takes them."""
    return room(_flat(value)) if COMPILED else value


@used_by_kernels
def _seems_landed(k: Any, e: Any, limits: GroundContactLimits, asked: Asked) -> bool:
    """The land detector's first condition; it decides, this only calls it."""
    if not (asked.is_near_ground and asked.descends and k[10] <= limits.low_thrust):
        return False
    vx, vy, most = e[53], e[54], limits.horizontal_m_s
    slow = abs(e[55]) <= limits.vertical_m_s or abs(e[59]) <= limits.vertical_m_s
    return bool(slow and vx * vx + vy * vy <= most * most * 1.000001)


@used_by_kernels
def _follow_hover(k: Any, loops: LoopConstants, asked: Asked) -> None:
    """The land detector's memory, at a decision that is left out."""
    is_valid = loops.uses_hover_estimate and k[37] > 0.0
    k[53], knows = follow_hover(k[53], k[54] > 0.5, k[35], is_valid, asked.descends)
    k[54] = 1.0 if knows else 0.0


@used_by_kernels
def _put_body_numbers(row: Any, state: tuple[float, ...], acceleration: Vec3) -> None:
    row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8] = state[:9]
    row[9], row[10], row[11], row[12], row[13], row[14], row[15], row[16] = state[9:]
    row[17], row[18], row[19] = acceleration


def _put_body_slices(row: Any, state: tuple[float, ...], acceleration: Vec3) -> None:
    row[:17], row[17:] = state, acceleration


@used_by_kernels
def _state_numbers(b: Any) -> tuple[float, ...]:
    return (
        b[0],
        b[1],
        b[2],
        b[3],
        b[4],
        b[5],
        b[6],
        b[7],
        b[8],
        b[9],
        b[10],
        b[11],
        b[12],
        b[13],
        b[14],
        b[15],
        b[16],
    )


def _state_slice(b: Any) -> tuple[float, ...]:
    return tuple(b[:17])


# Tuples out of arrays number by number, out of lists by slices: each is the quick way where it is used.
put_body = _put_body_numbers if COMPILED else _put_body_slices
_state_of = _state_numbers if COMPILED else _state_slice


@used_by_kernels
def fly_steadily(
    b: Any,
    e: Any,
    k: Any,
    rows: Any,
    tape: Any,
    at: int,
    constants: Any,
    wanted: Any,
    wanted_next: Any,
    air: Any,
    gusts: Any,
    gust_at: int,
    steps: int,
    quiet_steps: int,
    is_estimated: bool,
    kept_from: int,
) -> tuple[int, bool, int, int]:
    """Up to `steps` steps; gives how many were made, whether it waits for a decision, and the places on the tapes: estimator's, gusts'.

    Decisions of the first `quiet_steps` steps are known to change nothing but the setpoint, to `wanted_next`. `is_estimated`: the first step's estimate and
    decision are made. From step `kept_from` on, the state that messages are made of is kept in `rows`.
    """
    c, asked = _constants_of(constants), _asked_of(wanted)
    state = _state_of(b)
    acceleration = (b[17], b[18], b[19])
    rows_b, rows_e, rows_k = rows
    body, health, model, loops, limits = c
    done, waits = 0, False
    for i in range(steps):
        if i > 0 or not is_estimated:
            at = step_estimate(e, model, tape, at, state, acceleration, STEP_S, True, False)
            k[52] += 4000.0
            if k[52] >= DECISION_PERIOD_US:
                if i >= quiet_steps or _seems_landed(k, e, limits, asked):
                    waits = True
                    break
                k[52] = 0.0
                asked = _asked_of(wanted_next)
                _follow_hover(k, loops, asked)
        control(k, e, loops, asked)
        if i >= kept_from:
            put_body(rows_b[i], state, acceleration)
            rows_e[i][:] = e
            rows_k[i][:] = k
        gust_at = blow(air, gusts, gust_at, STEP_S, -state[2])
        loads = (air[0], air[1], air[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        state, acceleration = advance(state, body, (k[28], k[29], k[30], k[31]), health, loads, STEP_S)
        done += 1
    put_body(b, state, acceleration)
    return done, waits, at, gust_at
