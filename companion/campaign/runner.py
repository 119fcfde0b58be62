"""One flight in lockstep: the simulator's world and the onboard program take turns, as fast as they can.

    world.step(4 ms) -> datagrams and frames -> onboard -> datagrams -> world ...

Time is the world's. The companion's clock runs with it but starts elsewhere, so that code which mixes the two fails here
and not in the air. Same scenario, configuration and seed: the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from companion.campaign.no_land_watch import NoLandWatch
from companion.config import Config
from companion.io.mcap_log import FrameSink
from companion.messages import (
    CameraImage,
    CommandKind,
    Health,
    Image,
    OperatorAction,
    PadNotSeen,
    Phase,
    VehicleCommand,
)
from companion.onboard import JournalEntry, Onboard
from companion.vision.frame_watch import ArrivalWatch
from companion.vision.watched_detector import WatchedDetector
from companion.vision_worker import build_detector
from sitl_stub.datagram_faults import Datagram
from sitl_stub.scenario import Scenario
from sitl_stub.verdict import Verdict
from sitl_stub.world import Truth, World

STEP_S = 0.004
CLOCK_OFFSET_NS = 5_000_000_000_000
"""The companion's clock minus the world's: any number but zero."""

START_AFTER_S = 1.0
"""The operator says START this long after the autopilot was first heard."""

SETTLE_AFTER_END_S = 1.0


class Sink(Protocol):
    """Somebody who watches a flight: recorder, live view, report."""

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None: ...

    def journal(self, entries: Sequence[JournalEntry]) -> None: ...

    def truth(self, now_ns: int, truth: Truth) -> None: ...

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Operator:
    """What a person does during the flight: (seconds since the start of the world, action)."""

    actions: tuple[tuple[float, OperatorAction], ...] = ()
    start: bool = True


@dataclass(slots=True)
class FlightResult:
    """How a flight in the simulator ended. `verdict` is the simulator's, which knows the truth."""

    outcome: str
    verdict: Verdict
    phase: Phase
    simulated_s: float
    go_arounds: int
    frames: int
    frames_with_pad: int
    first_sight_s: float | None
    start_s: float | None
    touchdown_s: float | None
    forced_disarms: int
    lowest_in_no_land_zone_m: float | None = None
    notes: list[str] = field(default_factory=list)


OUTCOMES: dict[str, str] = {
    "landed": "stands on the pad, disarmed",
    "off_pad": "stands beside the pad",
    "tipped": "fell over on the pad or the ground",
    "slid_off": "stood on the pad and slid off it",
    "hit_side": "flew into the side of the deck",
    "fell_after_motors_off": "motors were stopped in the air",
    "crashed": "hit the ground or the deck too hard",
    "held": "Companion stopped its attempt and left the vehicle in Hold, Return or the pilot's hands",
    "timeout": "still flying when the scenario's time was over",
    "interrupted": "ended by the user; the vehicle was left in Hold",
}
"""Every name that `outcome` can take, and what it means."""


def fly(
    scenario: Scenario,
    config: Config,
    *,
    seed: int,
    sinks: Sequence[Sink] = (),
    operator: Operator | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> FlightResult:
    """Fly one landing. `interrupted` is asked once per frame time; after it, the vehicle is put into Hold first."""
    return Flight(scenario, config, seed, sinks, operator).run(interrupted)


class Flight:
    """The two sides of one flight and the tally. Making it loads what has to be loaded; `run` flies."""

    def __init__(
        self,
        scenario: Scenario,
        config: Config,
        seed: int,
        sinks: Sequence[Sink] = (),
        operator: Operator | None = None,
    ) -> None:
        operator = operator or Operator()
        self._world = World(scenario, seed)
        self._limit_s = scenario.duration_limit_s
        self._no_land = NoLandWatch(config.safety.zones)
        self._onboard = Onboard(config, start_ns=CLOCK_OFFSET_NS)
        self._detectors: dict[str, WatchedDetector] = {config.vision.camera: build_detector(config)}
        self._arrivals = ArrivalWatch(
            config.vision.camera,
            timeout_ns=round(config.cameras[config.vision.camera].timeout_s * 1e9),
            start_ns=CLOCK_OFFSET_NS,
        )
        self._sinks = sinks
        self._frame_sinks = [sink for sink in sinks if isinstance(sink, FrameSink)]
        self._script = sorted(operator.actions)
        self._autostart = operator.start
        self._heard_s: float | None = None
        self._started_s: float | None = None
        self._first_sight_s: float | None = None
        self._frames = 0
        self._frames_with_pad = 0
        self._forced_disarms = 0
        self._ended_s: float | None = None
        self._last_truth_s = -1.0

    def run(self, interrupted: Callable[[], bool]) -> FlightResult:
        stopped_at: float | None = None
        while not self._is_over():
            self._turn()
            if stopped_at is None and interrupted():
                stopped_at = self._now_s
                self._onboard.operate(OperatorAction.HOLD, "keyboard", self._now_ns)
            if stopped_at is not None and self._now_s - stopped_at > 2.0:
                break
        for sink in self._sinks:
            sink.close()
        return self._result(interrupted=stopped_at is not None)

    @property
    def _now_ns(self) -> int:
        return CLOCK_OFFSET_NS + self._world.t_us * 1000

    @property
    def _now_s(self) -> float:
        return self._world.t_us / 1e6

    def _turn(self) -> None:
        """One step of the world, then everything of the companion that is due."""
        outgoing = self._onboard.datagrams_to_send()
        for data in outgoing:
            self._show_datagram(data, outgoing=True)
        stepped = self._world.step(STEP_S, [Datagram("onboard", data) for data in outgoing])
        now_ns = self._now_ns
        for datagram in stepped.datagrams:
            if datagram.link == "onboard":
                self._show_datagram(datagram.data, outgoing=False)
                self._onboard.receive_datagram(datagram.data, now_ns)
        for frame in stepped.frames:
            self._see(frame.camera, frame.image, frame.sequence, frame.t_capture_us)
        self._report(self._arrivals.check(now_ns))
        self._operate()
        if now_ns >= self._onboard.next_timer_ns():
            self._onboard.handle_timers(now_ns)
        self._show_journal()

    def _see(self, camera: str, image: Image, sequence: int, t_capture_us: int) -> None:
        detector = self._detectors.get(camera)
        if detector is None:
            return
        self._report(self._arrivals.arrived(self._now_ns))
        t_ns = self._onboard.capture_time_ns(camera, capture_boot_us=t_capture_us, arrived_ns=self._now_ns)
        for sink in self._frame_sinks:
            sink.frame(camera, self._now_ns, t_ns, image)
        frame = CameraImage(t_ns, camera, image, sequence)
        detection = detector.detect(frame, self._onboard.hint(camera, t_ns))
        self._report(detector.take_health())
        self._frames += 1
        if not isinstance(detection, PadNotSeen):
            self._frames_with_pad += 1
            if self._first_sight_s is None:
                self._first_sight_s = self._now_s
        self._onboard.receive(detection, self._now_ns)

    def _report(self, health: Sequence[Health]) -> None:
        entries = [JournalEntry(0, self._now_ns, "out", None, message) for message in health]
        for sink in self._sinks:
            sink.journal(entries)

    def _operate(self) -> None:
        if self._heard_s is None and self._onboard.session.connected:
            self._heard_s = self._now_s
        waiting = self._autostart and self._started_s is None and self._heard_s is not None
        if waiting and self._now_s - (self._heard_s or 0.0) >= START_AFTER_S:
            self._started_s = self._now_s
            self._onboard.operate(OperatorAction.START, "runner", self._now_ns)
        while self._script and self._script[0][0] <= self._now_s:
            self._onboard.operate(self._script.pop(0)[1], "script", self._now_ns)

    def _show_datagram(self, data: bytes, *, outgoing: bool) -> None:
        for sink in self._sinks:
            sink.datagram(self._now_ns, data, outgoing=outgoing)

    def _show_journal(self) -> None:
        entries = self._onboard.take_journal()
        for entry in entries:
            if isinstance(entry.message, VehicleCommand) and entry.message.kind is CommandKind.FORCE_DISARM:
                self._forced_disarms += 1
        if not self._sinks and not self._no_land:
            return
        truth = None
        if self._now_s - self._last_truth_s >= 0.0499:
            self._last_truth_s = self._now_s
            truth = self._world.truth()
            self._no_land.update(truth)
        for sink in self._sinks:
            sink.journal(entries)
            if truth is not None:
                sink.truth(self._now_ns, truth)

    def _is_over(self) -> bool:
        ended = self._world.verdict().ending != "flying"
        if ended and self._ended_s is None:
            self._ended_s = self._now_s
        if self._ended_s is not None and self._now_s - self._ended_s >= SETTLE_AFTER_END_S:
            return True
        return self._now_s >= self._limit_s

    def _result(self, *, interrupted: bool) -> FlightResult:
        verdict = self._world.verdict()
        pipeline = self._onboard.pipeline
        return FlightResult(
            outcome=_outcome(verdict, pipeline.phase, interrupted),
            verdict=verdict,
            phase=pipeline.phase,
            simulated_s=self._now_s,
            go_arounds=pipeline.go_arounds,
            frames=self._frames,
            frames_with_pad=self._frames_with_pad,
            first_sight_s=self._first_sight_s,
            start_s=self._started_s,
            touchdown_s=verdict.touchdown_s,
            forced_disarms=self._forced_disarms,
            lowest_in_no_land_zone_m=self._no_land.lowest_m,
        )


def _outcome(verdict: Verdict, phase: Phase, interrupted: bool) -> str:
    if verdict.ending == "on_pad":
        return "landed"
    if verdict.ending != "flying" and verdict.ending != "timeout":
        return verdict.ending
    if interrupted:
        return "interrupted"
    return "held" if phase in (Phase.IDLE, Phase.HOLD, Phase.RETURN) else "timeout"
