"""Steady flight in one call for many steps: estimate, control cascade and rigid body as one kernel over flat state.

`World` asks `fly` for as many 4 ms steps as nothing else happens in (no contact near, no sensor, beacon or camera due, no gust
drawn). The kernel stops early at a step in which the autopilot has to decide something; the step goes on after `Autopilot.decide`.
What the vehicle's messages are made of is kept for each step and packed afterwards. Between `enter` and `leave` the flat state is
the vehicle's; `Multirotor`, `Estimator` and `Cascade` show it when somebody may look. Bytes are the same as without it.
"""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from sitl_stub.autopilot.attitude_control import AttitudeGains
from sitl_stub.autopilot.autopilot import Autopilot
from sitl_stub.autopilot.estimate import MOST_NUMBERS_A_STEP, ErrorModel, step_estimate
from sitl_stub.autopilot.estimate import SIZE as ESTIMATE_SIZE
from sitl_stub.autopilot.hover_thrust import HoverSettings, HoverState
from sitl_stub.autopilot.land_detector import CLOSE_TO_GROUND_M, follow_hover
from sitl_stub.autopilot.low_pass import Butterworth
from sitl_stub.autopilot.position_control import UNSET_MOTION, Motion, PositionGains
from sitl_stub.autopilot.rate_control import RateGains
from sitl_stub.autopilot.steady_control import SIZE as CONTROL_SIZE
from sitl_stub.autopilot.steady_control import STEP_S, Asked, LoopConstants, control
from sitl_stub.compiled import COMPILED, compiled, room, used_by_kernels
from sitl_stub.datagram_faults import Datagram
from sitl_stub.message_burst import MessageBurst
from sitl_stub.multirotor import BodyState, Motors, Multirotor, advance, truth_of
from sitl_stub.rotation import Vec3

STEP_US = 4000
MOST_STEPS = 50
_BODY_SIZE = 20
_DECISION_PERIOD_US = 8000.0


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


def _flown_by_kernel(asked: Asked) -> Any:
    return room([*asked[0], *asked[1:]]) if COMPILED else asked


def _for_kernel(value: Any) -> Any:
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
_put_body = _put_body_numbers if COMPILED else _put_body_slices
_state_of = _state_numbers if COMPILED else _state_slice


@compiled
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
    wind: Vec3,
    steps: int,
    quiet_steps: int,
    is_estimated: bool,
    kept_from: int,
) -> tuple[int, bool, int]:
    """Up to `steps` steps; gives how many were made, whether it waits for a decision, and the place on the tape.

    Decisions of the first `quiet_steps` steps are known to change nothing but the setpoint, to `wanted_next`. `is_estimated`: the first step's estimate and
    decision are made. From step `kept_from` on, the state that messages are made of is kept in `rows`.
    """
    c, asked = _constants_of(constants), _asked_of(wanted)
    state = _state_of(b)
    acceleration = (b[17], b[18], b[19])
    loads = (wind[0], wind[1], wind[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rows_b, rows_e, rows_k = rows
    body, health, model, loops, limits = c
    done, waits = 0, False
    for i in range(steps):
        if i > 0 or not is_estimated:
            at = step_estimate(e, model, tape, at, state, acceleration, STEP_S, True, False)
            k[52] += 4000.0
            if k[52] >= _DECISION_PERIOD_US:
                if i >= quiet_steps or _seems_landed(k, e, limits, asked):
                    waits = True
                    break
                k[52] = 0.0
                asked = _asked_of(wanted_next)
                _follow_hover(k, loops, asked)
        control(k, e, loops, asked)
        if i >= kept_from:
            _put_body(rows_b[i], state, acceleration)
            rows_e[i][:] = e
            rows_k[i][:] = k
        state, acceleration = advance(state, body, (k[28], k[29], k[30], k[31]), health, loads, STEP_S)
        done += 1
    _put_body(b, state, acceleration)
    return done, waits, at


def _rows(width: int) -> Any:
    return room([[0.0] * width for _ in range(MOST_STEPS)])


def _plain(values: Any) -> list[float]:
    """A flat state as a list of floats."""
    return values.tolist() if COMPILED else values  # type: ignore[no-any-return]


class SteadyFlight:
    """One vehicle's flat state, and the way in and out of it."""

    def __init__(self, vehicle: Multirotor, autopilot: Autopilot) -> None:
        self._vehicle, self._autopilot = vehicle, autopilot
        self._b, self._k = room([0.0] * _BODY_SIZE), room([0.0] * CONTROL_SIZE)
        self._rows = (_rows(_BODY_SIZE), _rows(ESTIMATE_SIZE), _rows(CONTROL_SIZE))
        self._asked = Asked(UNSET_MOTION, 0.0, 0.0, False, False)
        self._wanted = _for_kernel(self._asked)
        self._asked_next: Asked | None = None
        """What the next decision will have flown, where it is certain: it need not be made."""
        self._wanted_next = self._wanted
        self._is_in = False
        self._is_estimated = False
        self._is_shown = True
        self._calm_until_us = 0
        self._task_waits = False
        self._from_us = 0
        self._pending: tuple[int, float | None, Any, Any, Asked] = (0, None, None, None, self._asked)
        self._seen: object = None
        self._reasons: object = None
        self._burst: MessageBurst | None = None
        self._slow_is_known = False
        if COMPILED:
            self._burst = MessageBurst(autopilot.telemetry, autopilot.endpoint, self._rows, MOST_STEPS)
            self._warm_up()

    def _warm_up(self) -> None:
        """Have the kernel loaded or compiled before the first flight, not in it."""
        if fly_steadily.signatures:  # type: ignore[attr-defined]
            return
        estimator = self._autopilot.estimator
        b, e, k = (room([0.0] * size) for size in (_BODY_SIZE, ESTIMATE_SIZE, CONTROL_SIZE))
        tape = room([0.0] * MOST_NUMBERS_A_STEP)
        asked = _for_kernel(Asked(UNSET_MOTION, 0.0, 0.0, False, False))
        fly_steadily(
            b,
            e,
            k,
            self._rows,
            tape,
            0,
            _for_kernel(self._constants(estimator.model)),
            asked,
            asked,
            (0.0, 0.0, 0.0),
            0,
            0,
            False,
            0,
        )

    def _constants(self, model: ErrorModel) -> FlightConstants:
        autopilot, vehicle = self._autopilot, self._vehicle
        detector = autopilot.land_detector
        limits = GroundContactLimits(*detector.contact_limits())
        return FlightConstants(
            tuple(vehicle.body), vehicle.motor_health, model, autopilot.cascade.loop_constants(), limits
        )

    # In and out -----------------------------------------------------------------------------------------------------

    def enter(self) -> bool:
        """Take the state over, if the flight is steady; True while it is in here."""
        if self._is_in:
            return True
        autopilot, vehicle = self._autopilot, self._vehicle
        if vehicle.on_surface or not autopilot.is_steady():
            return False
        self._c = _for_kernel(self._constants(autopilot.estimator.model))
        _put_body(self._b, vehicle.state, vehicle.acceleration_ned_m_s2)
        autopilot.cascade.put_flat(self._k)
        self._k[52] = float(autopilot.since_decision_us)
        self._remember_hover()
        self._ask(autopilot.asked())
        self._seen = autopilot.disturbances()
        self._is_in, self._is_shown, self._is_estimated, self._calm_until_us = True, True, False, 0
        self._slow_is_known = False
        return True

    def _remember_hover(self) -> None:
        """The land detector's memory into the kernel, which goes on with it at decisions that are left out."""
        hover, knows_hover = self._autopilot.land_detector.hover
        self._k[53], self._k[54] = hover, float(knows_hover)

    def _ask(self, asked: Asked) -> None:
        if asked != self._asked:
            self._slow_is_known = self._slow_is_known and asked.motion[:3] == self._asked.motion[:3]
            self._asked, self._wanted = asked, _flown_by_kernel(asked)

    def leave(self, t_us: int) -> None:
        """Give the state back. While it waits the step must be gone on with `Autopilot.finish_step`."""
        if not self._is_in:
            return
        # First what messages are still to say of an earlier step: it passes through the cascade.
        self._autopilot.telemetry.complete()
        self.show(t_us)
        k = _plain(self._k)
        self._autopilot.cascade.take_flat(k, self._asked)
        self._autopilot.since_decision_us = round(k[52])
        self._autopilot.land_detector.take_hover(k[53], k[54] > 0.5)
        self._is_in = self._is_estimated = False
        self._asked_next = None

    def show(self, t_us: int) -> None:
        """Let the estimate be that of the last step, for somebody who reads it."""
        if self._is_in and not self._is_shown:
            self._autopilot.show(t_us - (0 if self._is_estimated else STEP_US), self._autopilot.estimator.flat)
            self._is_shown = True

    def look_again(self, t_us: int) -> None:
        """Something was received: its setpoint is flown, and more than a setpoint is decided about or ends the steady flight."""
        waited, self._task_waits, self._asked_next = self._task_waits, False, None
        if not self._is_in:
            return
        autopilot = self._autopilot
        if autopilot.reasons_to_decide() != self._reasons:
            self._calm_until_us = 0
            self._slow_is_known = False
        if autopilot.disturbances() != self._seen:
            self.leave(t_us)
        elif waited and t_us < self._calm_until_us:
            self._look_ahead(autopilot.asked_next())

    def _look_ahead(self, asked: Asked | None) -> None:
        """Have the next decision made in the kernel, where it can only be to fly this."""
        now = self._asked
        # A position is in the messages of the steps before, too, and a descent that begins is the land detector's.
        if asked is not None and asked.descends == now.descends and asked.motion[:3] == now.motion[:3]:
            self._asked_next = asked._replace(is_near_ground=now.is_near_ground)
            self._wanted_next = _flown_by_kernel(self._asked_next)
            self._task_waits = True

    # Flying ---------------------------------------------------------------------------------------------------------

    def fly(self, t_us: int, steps: int, wind: Vec3, range_m: float | None) -> tuple[int, bool]:
        """Fly up to so many steps from t_us; gives how many were flown, and whether the last one waits for `decide`."""
        autopilot = self._autopilot
        autopilot.estimator.estimate.height_above_bottom_m = range_m
        tape = autopilot.estimator.tape
        steps = min(steps, MOST_STEPS)
        tape.reserve(steps * MOST_NUMBERS_A_STEP)
        self._from_us = t_us
        kept_from = max(0, -((t_us - autopilot.next_message_us()) // STEP_US))
        quiet_steps = max(0, -((t_us - self._calm_until_us) // STEP_US)) if self._task_waits else 0
        near = range_m is None or range_m < CLOSE_TO_GROUND_M
        if near != self._asked.is_near_ground:
            self._ask(self._asked._replace(is_near_ground=near))
            if self._asked_next is not None:
                self._asked_next = self._asked_next._replace(is_near_ground=near)
                self._wanted_next = _flown_by_kernel(self._asked_next)
        since_decision_us = float(self._k[52])
        estimates_left_out = int(self._is_estimated)
        done, waits, tape.at = fly_steadily(
            self._b,
            autopilot.estimator.flat,
            self._k,
            self._rows,
            tape.numbers,
            tape.at,
            self._c,
            self._wanted,
            self._wanted if self._asked_next is None else self._wanted_next,
            wind,
            steps,
            quiet_steps,
            self._is_estimated,
            kept_from,
        )
        self._is_estimated, self._is_shown = False, False
        if since_decision_us + (done - estimates_left_out) * STEP_US >= _DECISION_PERIOD_US:
            self._take_next()
        b = _plain(self._b)
        self._vehicle.state = BodyState._make(b[:17])
        self._vehicle.acceleration_ned_m_s2 = (b[17], b[18], b[19])
        return done, waits

    def _take_next(self) -> None:
        """The kernel has made the next decision."""
        if self._asked_next is not None:
            self._autopilot.take_next()
            self._ask(self._asked_next)
            self._asked_next = None

    def next_message_step_us(self, t_us: int) -> int:
        """The first step from t_us on in which a message is due."""
        due_us = self._autopilot.next_message_us()
        return t_us if due_us <= t_us else t_us - (t_us - due_us) // STEP_US * STEP_US

    def send_many(self, t_us: int, last_us: int, range_m: float | None) -> tuple[int, list[Datagram], list[Datagram]]:
        """Messages of the steps from t_us to last_us, as far as they can be made together.

        Gives the first step that is left and has a message to send (or the last one), and the datagrams of the steps before
        the last one, and of that. Nothing is left where that time lies beyond the last step.
        """
        burst, autopilot = self._burst, self._autopilot
        if burst is None or not autopilot.endpoint.sends_streams_only:
            return min(self.next_message_step_us(t_us), last_us), [], []
        if autopilot.next_message_us() > last_us:
            return last_us + STEP_US, [], []
        if not self._slow_is_known:
            burst.set_slow(self._slow())
            self._slow_is_known = True
        first, last = (t_us - self._from_us) // STEP_US, (last_us - self._from_us) // STEP_US
        stopped_at, at, before, held = burst.send(self._from_us, first, last, nan if range_m is None else range_m)
        if at >= 0:
            row_b, row_k = self._rows[0][at].copy(), self._rows[2][at].copy()
            self._pending = (self._from_us + at * STEP_US, range_m, row_b, row_k, self._asked)
            autopilot.telemetry.pending = self._complete
        return self._from_us + stopped_at * STEP_US, before, held

    def _slow(self) -> list[float]:
        """What messages say besides the state, as burst_kernel.py takes it."""
        autopilot, t = self._autopilot, self._autopilot.telemetry
        c, home, asked = autopilot.commander, autopilot.home, self._asked.motion
        has_global = autopilot.estimator.estimate.has_position and c.health.is_ready
        values = (
            *t.origin.numbers,
            home.is_set,
            home.altitude_amsl_m,
            has_global,
            autopilot.estimator.gnss_available,
            c.armed,
            c.armed or c.can_arm_now,
            autopilot.landed_state,
            autopilot.has_target,
            t.imu_noise_scale if c.armed else 0.0,
            autopilot.estimate_resets,
            *autopilot.battery.drain,
            autopilot.battery_full_since_us,
            t.has_range_sensor,
            asked.x,
            asked.y,
            asked.z,
        )
        return [float(value) for value in values]

    def send(self, t_us: int, range_m: float | None) -> None:
        """Messages of the step at t_us of the last flight, if any are due."""
        autopilot = self._autopilot
        if t_us < autopilot.next_message_us():
            return
        i = (t_us - self._from_us) // STEP_US
        autopilot.show(t_us, self._rows[1][i])
        self._pending = (t_us, range_m, self._rows[0][i].copy(), self._rows[2][i].copy(), self._asked)
        autopilot.telemetry.pending = self._complete
        autopilot.endpoint.step(t_us)

    def _complete(self) -> None:
        """What messages say besides the estimate, for the step they are of."""
        t_us, range_m, row_b, row_k, asked = self._pending
        autopilot, b, k = self._autopilot, _plain(row_b), _plain(row_k)
        autopilot.cascade.show_flat(k, asked)
        autopilot.drain_battery(t_us - round(k[52]))
        truth = truth_of(tuple(b[:17]), (b[17], b[18], b[19]), False)
        autopilot.fill_telemetry(truth, range_m, (k[28], k[29], k[30], k[31]))

    def decide(self, t_us: int, range_m: float | None) -> bool:
        """The decision that the flight waits for; False when it is no longer steady (and the state has been given back)."""
        autopilot = self._autopilot
        autopilot.show(t_us, autopilot.estimator.flat)
        self._is_shown = self._is_estimated = True
        autopilot.estimator.estimate.height_above_bottom_m = range_m
        k = _plain(self._k)
        autopilot.cascade.thrust_setpoint = k[10]
        autopilot.cascade.hover_thrust_estimator.state = HoverState(*k[35:42])
        autopilot.land_detector.take_hover(k[53], k[54] > 0.5)
        dt_s = k[52] * 1e-6
        self._k[52] = 0.0
        self._asked_next = None
        if t_us < self._calm_until_us and not self._task_waits:
            autopilot.decide_task(t_us, dt_s)
            if not autopilot.stays_calm(self._reasons, t_us):
                self._calm_until_us = 0
            self._slow_is_known = self._slow_is_known and autopilot.task_waits
        else:
            autopilot.decide(t_us, dt_s)
            self._slow_is_known = False
            self._calm_until_us = autopilot.calm_until_us(t_us)
            self._reasons = autopilot.reasons_to_decide()
        self._task_waits = autopilot.task_waits
        self._remember_hover()
        if not autopilot.is_steady() or autopilot.disturbances() != self._seen:
            self.leave(t_us)
            return False
        self._ask(autopilot.asked())
        return True
