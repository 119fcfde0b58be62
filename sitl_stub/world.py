"""The whole simulator, sans-IO: datagrams in, datagrams and camera frames out, and a step of time.

`World(scenario, seed).step(dt_s, datagrams_in)` moves vehicle, autopilot, carrier, wind, sensors, cameras and faults by
whole physics steps of 4 ms (1 ms while something touches). No clock, no socket, no global state: the same scenario, seed
and datagrams give the same bytes, however the time is cut into calls. W is local NED, its origin on the ground where the
vehicle starts; `t_us` is the autopilot's boot clock. Driven in lockstep by tests and campaigns, in real time by server.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sitl_stub.beacon import Beacon
from sitl_stub.camera.scene import CameraView
from sitl_stub.camera_setup import camera_channels, light_of
from sitl_stub.capture import CameraChannel, CameraFrame, Capture, turned_back
from sitl_stub.carriers.deck import DeckState
from sitl_stub.contact import ContactState
from sitl_stub.datagram_faults import Datagram, DatagramChannel
from sitl_stub.fault_effects import FaultEffects
from sitl_stub.faults import FaultSchedule
from sitl_stub.geodesy import Origin
from sitl_stub.multirotor import VehicleTruth
from sitl_stub.pad_layout import PadLayout
from sitl_stub.randomness import generator
from sitl_stub.rotation import Quaternion, Vec3, from_euler, rotate_back
from sitl_stub.scenario import Scenario, load_pad
from sitl_stub.sensors import distance_down
from sitl_stub.shelter import sheltered
from sitl_stub.start import Start, draw_start, vehicle_pose
from sitl_stub.steady_flight import SteadyFlight
from sitl_stub.vehicle_setup import make_autopilot, make_wind, read_vehicle
from sitl_stub.verdict import Judge, Verdict
from sitl_stub.wind import still_air
from sitl_stub.world_setup import deck_shape, make_body, make_contact, make_deck, make_range_sensor

STEP_US = 4000
STEP_S = 0.004
_CONTACT_STEPS = 4
_FAULT_PERIOD_US = 20_000
_NEVER_US = 1 << 62
# Nothing accelerates towards a surface faster than this; it bounds how long clearance lasts.
_CLOSING_MARGIN_M_S = 8.0
_LONGEST_CLEAR_S = 0.4
_named = tuple.__new__
"""`Datagram._make` without its checks, for pairs that are right: a third of the time."""


@dataclass(slots=True)
class StepOutput:
    """What came out of a step, in order of time."""

    datagrams: list[Datagram] = field(default_factory=list)
    frames: list[CameraFrame] = field(default_factory=list)
    captures: list[Capture] = field(default_factory=list)
    """Pictures taken but not rendered, for a caller that renders elsewhere (`World(..., render=False)`)."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What is true now: for scoring and display only. W local NED; the pad's yaw is its direction of travel's."""

    t_us: int
    vehicle: VehicleTruth
    pad_position_ned_m: Vec3
    pad_velocity_ned_m_s: Vec3
    pad_q_ned_pad: Quaternion
    pad_angular_velocity_ned_rad_s: Vec3
    contact: ContactState
    vehicle_in_pad_m: Vec3
    """p_PB: where the vehicle is, in the pad's frame (x along travel, y right, z down)."""
    mode: str
    is_armed: bool
    wind_ned_m_s: Vec3


class World:
    """One flight."""

    def __init__(self, scenario: Scenario, seed: int, *, render: bool = True) -> None:
        self.scenario = scenario
        self.seed = seed
        self.t_us = 0
        self._renders = render
        place = scenario.place
        self.origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
        self.pad: PadLayout = load_pad(scenario)
        self._shape = deck_shape(self.pad)

        start = draw_start(scenario, generator(seed, "start"))
        self._deck = make_deck(scenario, seed, start, self.pad)
        self._make_vehicle(start)
        self._wind = make_wind(scenario, start.wind_from_rad, generator(seed, "wind"))
        self._shelter = scenario.pad.shelter
        self._sheltered_air = still_air()
        self._range = make_range_sensor(scenario, seed)
        self._beacon = Beacon(scenario.beacon, self.origin, generator(seed, "beacon"))
        self._waiting_beacon: list[tuple[int, list[bytes]]] = []
        self._cameras: list[CameraChannel] = camera_channels(scenario, self.pad, seed)
        self._light = light_of(scenario.light)
        self._waiting_captures: list[Capture] = []
        self._to_vehicle = DatagramChannel("to_vehicle", generator(seed, "link to vehicle"))
        self._from_vehicle = DatagramChannel("from_vehicle", generator(seed, "link from vehicle"))
        self._faults = FaultSchedule(scenario.faults, generator(seed, "faults"))
        self._effects = FaultEffects(
            vehicle=self.vehicle,
            autopilot=self.autopilot,
            cameras=self._cameras,
            range_sensor=self._range,
            beacon=self._beacon,
            links=(self._to_vehicle, self._from_vehicle),
            pad=self.pad,
        )
        self._actions: dict[str, Callable[[StepOutput], None]] = {
            "faults": self._do_faults,
            "range": self._do_range,
            "beacon": self._do_beacon,
            "beacon_sent": self._do_beacon_sent,
            "cameras": self._do_cameras,
            "frames": self._do_frames,
        }
        self._due_us = self._first_due_us()
        self._next_due_us = 0
        self._clear_until_us = 0
        self._wind_ahead: Vec3 | None = None
        self._steady = SteadyFlight(self.vehicle, self.autopilot)

    def _make_vehicle(self, start: Start) -> None:
        scenario, seed = self.scenario, self.seed
        in_air = scenario.vehicle.start == "air"
        airframe = read_vehicle(scenario)
        pose = vehicle_pose(scenario, start, airframe, self._deck.at(0.0))
        self.vehicle = make_body(airframe, pose, in_air=in_air)
        rng = generator(seed, "autopilot")
        self.autopilot = make_autopilot(scenario, airframe, self.vehicle.truth(), self.origin, rng)
        self._contact = make_contact(scenario, airframe, self._shape)
        self._judge = Judge(scenario.success, scenario.duration_limit_s, starts_in_air=in_air)

    def _first_due_us(self) -> dict[str, int]:
        """What happens at a time of its own, and when it happens first; the step looks at the earliest only."""
        scenario = self.scenario
        return {
            "faults": 0 if self._faults else _NEVER_US,
            "range": 0 if scenario.range_sensor.fitted else _NEVER_US,
            "beacon": self._beacon_phase_us() if scenario.beacon.fitted else _NEVER_US,
            "beacon_sent": _NEVER_US,
            "cameras": min((camera.next_us for camera in self._cameras), default=_NEVER_US),
            "frames": _NEVER_US,
        }

    # --------------------------------------------------------------------------------------------------------- stepping

    def step(self, dt_s: float, datagrams_in: Sequence[Datagram] = ()) -> StepOutput:
        """Take in what was sent to the vehicle, go on by `dt_s` (a multiple of 4 ms), give out what came of it.

        Raises ValueError where `dt_s` is no such multiple.
        """
        steps = round(dt_s / STEP_S)
        if steps < 1 or abs(steps * STEP_S - dt_s) > 1e-9:
            raise ValueError(f"dt_s = {dt_s}: must be a positive multiple of {STEP_S} s")
        output = StepOutput()
        for datagram in datagrams_in:
            self._take_in(datagram)
        end_us = self.t_us + steps * STEP_US
        while self.t_us < end_us:
            if not self._fly_steadily(end_us, output):
                self._physics_step()
                self._finish_step(output)
        return output

    def _finish_step(
        self, output: StepOutput, waiting: Sequence[Datagram] = (), *, links_are_empty: bool = False
    ) -> None:
        """What is due; then the vehicle's datagrams, those that wait already first."""
        is_due = self.t_us >= self._next_due_us
        if is_due:
            self._do_what_is_due(output)
        output.datagrams += waiting
        if is_due or not links_are_empty:
            self._give_out(self.autopilot.datagrams(), output)

    def _take_in(self, datagram: Datagram) -> None:
        if self._to_vehicle.is_clear():
            self._steady.show(self.t_us)
            self.autopilot.receive(datagram.link, datagram.data, self.t_us)
            self._steady.look_again(self.t_us)
        else:
            self._to_vehicle.send(datagram, self.t_us)

    def _give_out(self, sent: list[tuple[str, bytes]], output: StepOutput) -> None:
        channel = self._from_vehicle
        if channel.is_clear():
            if sent:
                output.datagrams += [_named(Datagram, pair) for pair in sent]
            return
        for link, data in sent:
            channel.send(Datagram(link, data), self.t_us)
        output.datagrams += channel.due(self.t_us)

    def _physics_step(self) -> None:
        vehicle, t_us = self.vehicle, self.t_us
        if not self._to_vehicle.is_clear():
            for datagram in self._to_vehicle.due(t_us):
                self.autopilot.receive(datagram.link, datagram.data, t_us)
        self._move(self.autopilot.step(t_us, vehicle.truth(), self._range.value_m, STEP_S))

    def _move(self, motors: tuple[float, float, float, float]) -> None:
        """The second half of a step: wind, contact, rigid body."""
        vehicle, t_us = self.vehicle, self.t_us
        wind = self._wind_here()
        self._wind_ahead = None
        self.t_us = t_us + STEP_US
        if t_us < self._clear_until_us or self._is_clear(t_us):
            vehicle.step(STEP_S, motors, wind)
            self._judge.free(self.t_us * 1e-6, motors_run=max(motors) > 0.0)
        else:
            self._touching_step(t_us, motors, wind)

    def _wind_here(self) -> Vec3:
        """The wind of the coming step, drawn once."""
        if self._wind_ahead is None:
            wind = self._wind.step(STEP_S, -self.vehicle.state.z)
            if self._shelter > 0.0:
                deck = self._deck.at(self.t_us * 1e-6)
                wind = sheltered(wind, self._shelter, self.vehicle.position_ned_m, deck, self._shape)
                self._sheltered_air.hold(wind)
            self._wind_ahead = wind
        return self._wind_ahead

    # ---------------------------------------------------------------------------------------------------- steady flight

    def _fly_steadily(self, end_us: int, output: StepOutput) -> bool:
        """Make all steps at once until something happens, at the latest at `end_us`; False where each step counts."""
        t_us, steady = self.t_us, self._steady
        is_free = self._to_vehicle.is_clear() and (t_us < self._clear_until_us or self._is_clear(t_us))
        if not is_free or not steady.enter():
            steady.leave(t_us)
            return False
        range_m, sends = self._range.value_m, self._from_vehicle.is_clear()
        wind = self._wind
        if self._shelter > 0.0:
            wind = self._sheltered_air
            self._wind_here()
        done, waits = steady.fly(t_us, self._free_steps(t_us, end_us), wind, range_m, sends=sends)
        if done:
            self._wind_ahead = None
            self._end_steady_steps(t_us, done, range_m, output, together=sends)
        if waits and not steady.decide(self.t_us):
            truth = self.vehicle.truth()
            self._move(self.autopilot.finish_step(self.t_us, truth, self._range.value_m, STEP_S))
            self._finish_step(output)
        return True

    def _free_steps(self, t_us: int, end_us: int) -> int:
        """How many steps nothing happens in but the flight; what is due comes at the end of the last of them."""
        until_us = min(end_us, self._clear_until_us, max(self._next_due_us, t_us + 1))
        if t_us < self._judge.limit_us:
            until_us = min(until_us, self._judge.limit_us)
        steps = -((t_us - until_us) // STEP_US)
        return 1 if self._shelter > 0.0 else steps

    def _end_steady_steps(
        self, t_us: int, done: int, range_m: float | None, output: StepOutput, *, together: bool
    ) -> None:
        """Messages of the steps made since t_us, and what is due at the end of the last one."""
        steady, last_us = self._steady, t_us + (done - 1) * STEP_US
        at_us, waiting = t_us, list[Datagram]()
        while True:
            if together:
                at_us, sent, waiting = steady.send_many(at_us, last_us, range_m)
                output.datagrams += sent
            if at_us >= last_us:
                break
            steady.send(at_us, range_m)
            self.t_us = at_us = at_us + STEP_US
            self._give_out(self.autopilot.datagrams(), output)
        is_all_sent = at_us > last_us
        if not is_all_sent:
            steady.send(last_us, range_m)
        self.t_us = last_us + STEP_US
        self._judge.free(self.t_us * 1e-6, motors_run=True)
        self._finish_step(output, waiting, links_are_empty=is_all_sent)

    def _is_clear(self, t_us: int) -> bool:
        """Whether nothing can touch during the coming step; looks ahead as far as the distance allows."""
        vehicle = self.vehicle
        deck = self._deck.at(t_us * 1e-6)
        clearance = self._contact.clearance_m(vehicle.position_ned_m, deck)
        closing = math.hypot(*vehicle.velocity_ned_m_s) + math.hypot(*deck.velocity_ned_m_s) + _CLOSING_MARGIN_M_S
        clear_s = min(clearance / closing, _LONGEST_CLEAR_S)
        if clear_s < STEP_S:
            return False
        self._clear_until_us = t_us + int(clear_s * 1e6)
        if vehicle.on_surface:
            vehicle.on_surface = False
            self._contact.release()
        return True

    def _touching_step(self, t_us: int, motors: tuple[float, float, float, float], wind: Vec3) -> None:
        vehicle, contact, dt_s = self.vehicle, self._contact, STEP_S / _CONTACT_STEPS
        runs = max(motors) > 0.0
        for i in range(_CONTACT_STEPS):
            t_s = t_us * 1e-6 + i * dt_s
            deck = self._deck.at(t_s)
            position, velocity, q = vehicle.position_ned_m, vehicle.velocity_ned_m_s, vehicle.q_ned_frd
            touch = contact.step(position, velocity, q, vehicle.rates_frd_rad_s, deck)
            self._judge.update(
                t_s,
                dt_s,
                position_ned_m=position,
                velocity_ned_m_s=velocity,
                q_ned_frd=q,
                deck=deck,
                contact=touch,
                motors_run=runs,
                is_armed=self.autopilot.is_armed,
            )
            vehicle.step(dt_s, motors, wind, touch.force_ned_n, touch.torque_frd_nm)
        vehicle.on_surface = contact.state.is_touching

    # ------------------------------------------------------------------------------------------ what happens at its time

    def _do_what_is_due(self, output: StepOutput) -> None:
        for name, action in self._actions.items():
            if self._due_us[name] <= self.t_us:
                action(output)
        self._next_due_us = min(self._due_us.values())

    def _do_faults(self, output: StepOutput) -> None:
        t_s = self.t_us * 1e-6
        changed = self._faults.update(t_s, -self._in_pad(self._deck.at(t_s))[2])
        if changed:
            self._steady.leave(self.t_us)
        for window in changed:
            self._effects.change(window, self._faults.active())
        self._due_us["faults"] += _FAULT_PERIOD_US

    def _do_range(self, output: StepOutput) -> None:
        vehicle = self.vehicle
        deck = self._deck.at(self.t_us * 1e-6)
        self._range.sample(distance_down(vehicle.position_ned_m, vehicle.q_ned_frd, deck, self._shape))
        self.autopilot.see_range(self.t_us, self._range.value_m)
        self._due_us["range"] += self._range.period_us

    def _beacon_phase_us(self) -> int:
        return int(generator(self.seed, "beacon phase").integers(self._beacon.period_us))

    def _do_beacon(self, output: StepOutput) -> None:
        frames = self._beacon.frames(self._deck.at(self.t_us * 1e-6), self.t_us)
        self._waiting_beacon.append((self.t_us + self._beacon.delay_us, frames))
        self._due_us["beacon"] += self._beacon.period_us
        self._due_us["beacon_sent"] = self._waiting_beacon[0][0]

    def _do_beacon_sent(self, output: StepOutput) -> None:
        while self._waiting_beacon and self._waiting_beacon[0][0] <= self.t_us:
            _, frames = self._waiting_beacon.pop(0)
            self._give_out([(link, data) for link in ("onboard", "ground") for data in frames], output)
        self._due_us["beacon_sent"] = self._waiting_beacon[0][0] if self._waiting_beacon else _NEVER_US

    def _do_cameras(self, output: StepOutput) -> None:
        for camera in self._cameras:
            while camera.next_us <= self.t_us:
                capture = camera.capture(self._view(camera))
                if capture is None:
                    continue
                if self._renders:
                    self._waiting_captures.append(capture)
                else:
                    output.captures.append(capture)
        self._due_us["cameras"] = min(camera.next_us for camera in self._cameras)
        self._due_us["frames"] = min((capture.due_us for capture in self._waiting_captures), default=_NEVER_US)

    def _do_frames(self, output: StepOutput) -> None:
        ready = [capture for capture in self._waiting_captures if capture.due_us <= self.t_us]
        self._waiting_captures = [capture for capture in self._waiting_captures if capture.due_us > self.t_us]
        output.frames += [capture.render() for capture in ready]
        self._due_us["frames"] = min((capture.due_us for capture in self._waiting_captures), default=_NEVER_US)

    def _view(self, camera: CameraChannel) -> CameraView:
        """Poses at mid-exposure, a few milliseconds before now: carried back at constant velocity."""
        back_s = (self.t_us - camera.next_us) * 1e-6
        vehicle, deck = self.vehicle, self._deck.at(self.t_us * 1e-6)
        position, velocity = vehicle.position_ned_m, vehicle.velocity_ned_m_s
        rates = vehicle.rates_frd_rad_s
        deck_q = from_euler(*deck.rpy_rad)
        deck_rates = rotate_back(deck_q, deck.angular_velocity_ned_rad_s)
        return CameraView(
            t_us=camera.next_us,
            vehicle_position_ned_m=carried_back(position, velocity, back_s),
            vehicle_q_ned_frd=turned_back(vehicle.q_ned_frd, rates, back_s),
            deck_position_ned_m=carried_back(deck.position_ned_m, deck.velocity_ned_m_s, back_s),
            deck_q_ned_pad=turned_back(deck_q, deck_rates, back_s),
            vehicle_velocity_ned_m_s=velocity,
            vehicle_angular_velocity_frd_rad_s=rates,
            deck_velocity_ned_m_s=deck.velocity_ned_m_s,
            deck_angular_velocity_pad_rad_s=deck_rates,
            light=self._light,
            covers=self._effects.covers,
            is_black=camera.is_black,
        )

    # ---------------------------------------------------------------------------------------------------------- looking

    def _in_pad(self, deck: DeckState) -> Vec3:
        r, o, p = deck.rotation_ned_deck, deck.position_ned_m, self.vehicle.position_ned_m
        dx, dy, dz = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        return (
            r[0] * dx + r[3] * dy + r[6] * dz,
            r[1] * dx + r[4] * dy + r[7] * dz,
            r[2] * dx + r[5] * dy + r[8] * dz,
        )

    def truth(self) -> Truth:
        """What is true now."""
        deck = self._deck.at(self.t_us * 1e-6)
        return Truth(
            t_us=self.t_us,
            vehicle=self.vehicle.truth(),
            pad_position_ned_m=deck.position_ned_m,
            pad_velocity_ned_m_s=deck.velocity_ned_m_s,
            pad_q_ned_pad=from_euler(*deck.rpy_rad),
            pad_angular_velocity_ned_rad_s=deck.angular_velocity_ned_rad_s,
            contact=self._contact.state,
            vehicle_in_pad_m=self._in_pad(deck),
            mode=self.autopilot.mode_name,
            is_armed=self.autopilot.is_armed,
            wind_ned_m_s=(self._sheltered_air if self._shelter > 0.0 else self._wind).now,
        )

    def verdict(self) -> Verdict:
        """How the flight ended, or that it has not, and the touchdown in numbers."""
        return self._judge.verdict(self.t_us * 1e-6)


def carried_back(position: Vec3, velocity: Vec3, dt_s: float) -> Vec3:
    return (position[0] - velocity[0] * dt_s, position[1] - velocity[1] * dt_s, position[2] - velocity[2] * dt_s)
