"""Steady flight in one call for many steps: estimate, control cascade and rigid body as one kernel over flat state.

`World` asks `fly` for as many 4 ms steps as nothing else happens in (no contact near, no sensor, beacon or camera due, no gust
drawn). The kernel stops early at a step in which the autopilot has to decide something; the step goes on after `Autopilot.decide`.
What the vehicle's messages are made of is kept for each step and packed afterwards. Between `enter` and `leave` the flat state is
the vehicle's; `Multirotor`, `Estimator` and `Cascade` show it when somebody may look. Bytes are the same as without it.
"""

from __future__ import annotations

from typing import Any

from sitl_stub.autopilot.autopilot import Autopilot
from sitl_stub.autopilot.estimate import MOST_NUMBERS_A_STEP, ErrorModel
from sitl_stub.autopilot.estimate import SIZE as ESTIMATE_SIZE
from sitl_stub.autopilot.hover_thrust import HoverState
from sitl_stub.autopilot.land_detector import CLOSE_TO_GROUND_M
from sitl_stub.autopilot.position_control import UNSET_MOTION
from sitl_stub.autopilot.steady_control import SIZE as CONTROL_SIZE
from sitl_stub.autopilot.steady_control import Asked
from sitl_stub.burst_kernel import NO_STEP
from sitl_stub.compiled import COMPILED, room
from sitl_stub.datagram_faults import Datagram
from sitl_stub.message_burst import FlightArrays, MessageBurst, Sent
from sitl_stub.multirotor import Multirotor, truth_of
from sitl_stub.steady_kernel import (
    BODY_SIZE,
    DECISION_PERIOD_US,
    STEP_US,
    FlightConstants,
    GroundContactLimits,
    flown_by_kernel,
    fly_steadily,
    for_kernel,
    put_body,
)
from sitl_stub.wind import NUMBERS_A_STEP, Wind, still_air

MOST_STEPS = 50


def _rows(width: int) -> Any:
    return room([[0.0] * width for _ in range(MOST_STEPS)])


def _plain(values: Any) -> list[float]:
    """A flat state as a list of floats."""
    return values.tolist() if COMPILED else values  # type: ignore[no-any-return]


class SteadyFlight:
    """One vehicle's flat state, and the way in and out of it."""

    def __init__(self, vehicle: Multirotor, autopilot: Autopilot) -> None:
        self._vehicle, self._autopilot = vehicle, autopilot
        self._b, self._k = room([0.0] * BODY_SIZE), room([0.0] * CONTROL_SIZE)
        self._rows = (_rows(BODY_SIZE), _rows(ESTIMATE_SIZE), _rows(CONTROL_SIZE))
        self._asked = Asked(UNSET_MOTION, 0.0, 0.0, False, False)
        self._wanted = for_kernel(self._asked)
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
        self._still_air = still_air()
        self._sent: Sent | None = None
        """Messages that were made while flying, until `send_many` hands them out."""
        if COMPILED:
            estimator = autopilot.estimator
            arrays = FlightArrays(self._b, estimator.flat, self._k, self._rows, estimator.tape)
            self._burst = MessageBurst(autopilot.telemetry, autopilot.endpoint, arrays, MOST_STEPS)
            constants = for_kernel(self._constants(estimator.model))
            self._burst.warm_up(constants, self._wanted, self._still_air)

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
        self._c = for_kernel(self._constants(autopilot.estimator.model))
        put_body(self._b, vehicle.state, vehicle.acceleration_ned_m_s2)
        autopilot.cascade.put_flat(self._k)
        self._k[52] = float(autopilot.since_decision_us)
        self._remember_hover()
        self._ask(autopilot.asked())
        autopilot.telemetry.estimate_resets = autopilot.estimate_resets
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
            self._asked, self._wanted = asked, flown_by_kernel(asked)

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
            self._look_ahead(autopilot.asked_next(is_near_ground=self._asked.is_near_ground))

    def _look_ahead(self, asked: Asked | None) -> None:
        """Have the next decision made in the kernel, where it can only be to fly this."""
        now = self._asked
        # A position is in the messages of the steps before, too, and a descent that begins is the land detector's.
        if asked is not None and asked.descends == now.descends and asked.motion[:3] == now.motion[:3]:
            self._asked_next, self._wanted_next, self._task_waits = asked, flown_by_kernel(asked), True

    # Flying ---------------------------------------------------------------------------------------------------------

    def fly(self, t_us: int, steps: int, wind: Wind, range_m: float | None, *, sends: bool = False) -> tuple[int, bool]:
        """Fly up to so many steps from t_us; gives how many were flown, and whether the last one waits for `decide`.

        `sends`: messages may be made at once, for `send_many`.
        """
        autopilot = self._autopilot
        tape = autopilot.estimator.tape
        steps = min(steps, MOST_STEPS)
        tape.reserve(steps * MOST_NUMBERS_A_STEP)
        wind.tape.reserve(steps * NUMBERS_A_STEP)
        self._from_us = t_us
        kept_from = max(0, -((t_us - autopilot.endpoint.next_due_us) // STEP_US))
        quiet_steps = max(0, -((t_us - self._calm_until_us) // STEP_US)) if self._task_waits else 0
        bottom_m = autopilot.estimator.estimate.height_above_bottom_m
        near = bottom_m is None or bottom_m < CLOSE_TO_GROUND_M
        if near != self._asked.is_near_ground:
            self._ask(self._asked._replace(is_near_ground=near))
            if self._asked_next is not None:
                self._asked_next = self._asked_next._replace(is_near_ground=near)
                self._wanted_next = flown_by_kernel(self._asked_next)
        since_decision_us, left_out = float(self._k[52]), int(self._is_estimated)
        wanted_next = self._wanted if self._asked_next is None else self._wanted_next
        burst, is_estimated = self._burst, self._is_estimated
        if burst is None:
            done, waits, tape.at, wind.tape.at = fly_steadily(
                self._b,
                autopilot.estimator.flat,
                self._k,
                self._rows,
                tape.numbers,
                tape.at,
                self._c,
                self._wanted,
                wanted_next,
                wind.flat,
                wind.tape.numbers,
                wind.tape.at,
                steps,
                quiet_steps,
                is_estimated,
                kept_from,
            )
        else:
            sends = sends and autopilot.endpoint.sends_streams_only
            if sends and not self._slow_is_known:
                self._know_slow(burst)
            done, waits, self._sent = burst.run(
                self._c,
                self._wanted,
                wanted_next,
                wind,
                steps,
                quiet_steps,
                is_estimated,
                kept_from,
                t_us,
                range_m,
                0 if sends else NO_STEP,
            )
        self._is_estimated, self._is_shown = False, False
        if self._asked_next is not None and since_decision_us + (done - left_out) * STEP_US >= DECISION_PERIOD_US:
            self._take_next(self._asked_next)
        self._vehicle.keep(self._b)
        return done, waits

    def _take_next(self, asked: Asked) -> None:
        """The kernel has made the next decision."""
        self._autopilot.take_next()
        self._asked, self._wanted, self._asked_next = asked, self._wanted_next, None

    def next_message_step_us(self, t_us: int) -> int:
        """The first step from t_us on in which a message is due."""
        due_us = self._autopilot.next_message_us()
        return t_us if due_us <= t_us else t_us - (t_us - due_us) // STEP_US * STEP_US

    def send_many(self, t_us: int, last_us: int, range_m: float | None) -> tuple[int, list[Datagram], list[Datagram]]:
        """Messages of the steps from t_us to last_us, as far as they can be made together.

        Gives the first step that is left and has a message to send (or the last one), and the datagrams of the steps before
        the last one, and of that. Nothing is left where that time lies beyond the last step.
        """
        burst, autopilot, sent = self._burst, self._autopilot, self._sent
        self._sent = None
        if sent is None:
            if burst is None or not autopilot.endpoint.sends_streams_only:
                return min(self.next_message_step_us(t_us), last_us), [], []
            if autopilot.next_message_us() > last_us:
                return last_us + STEP_US, [], []
            sent = self._send_flown(burst, t_us, last_us, range_m)
        stopped_at, at, before, held = sent
        if at >= 0:
            row_b, row_k = self._rows[0][at].copy(), self._rows[2][at].copy()
            self._pending = (self._from_us + at * STEP_US, range_m, row_b, row_k, self._asked)
            autopilot.telemetry.pending = self._complete
        return self._from_us + stopped_at * STEP_US, before, held

    def _send_flown(self, burst: MessageBurst, t_us: int, last_us: int, range_m: float | None) -> Sent:
        """Messages of steps that are flown."""
        if not self._slow_is_known:
            self._know_slow(burst)
        first, last = (t_us - self._from_us) // STEP_US, (last_us - self._from_us) // STEP_US
        wanted, air = self._wanted, self._still_air
        _, _, sent = burst.run(
            self._c, wanted, wanted, air, from_us=self._from_us, range_m=range_m, first=first, last=last
        )
        assert sent is not None
        return sent

    def _know_slow(self, burst: MessageBurst) -> None:
        burst.set_slow(self._slow())
        self._slow_is_known = True

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
            t.unix_start_us,
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

    def decide(self, t_us: int) -> bool:
        """The decision that the flight waits for; False when it is no longer steady (and the state has been given back)."""
        autopilot = self._autopilot
        autopilot.show(t_us, autopilot.estimator.flat)
        self._is_shown = self._is_estimated = True
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
