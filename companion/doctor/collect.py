"""Evidence from the real link, camera and computer. Sends heartbeats, requests for streams, TIMESYNC and parameter reads: no
setpoint, no command."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import time
from pathlib import Path

from companion.config import Config
from companion.doctor.evidence import Evidence, FrameSample, percentile
from companion.doctor.geofence import NAMES as FENCE_NAMES
from companion.doctor.parameters import RULES
from companion.io.cameras import CameraError, CameraFrame, CaptureClock, frames
from companion.io.link import LinkError
from companion.io.links import open_link
from companion.io.signing_key import signing_of
from companion.mavlink.session import Session
from companion.messages import CameraImage, PadObservation, SensorInput, VehicleStatus
from companion.vision_worker import build_detector

FRAMES_KEPT = 12
"""For the detector, which runs when the listening is over so that it does not disturb the timing."""
SETTLE_S = 2.0
"""Until streams flow and clocks agree; counts begin afterwards."""


async def collect(config: Config, *, pad_speed_m_s: float, duration_s: float, runs: Path) -> Evidence:
    """Listen for so long, then look at the frames."""
    listener = Listener(config, Evidence(config, pad_speed_m_s, duration_s))
    evidence = listener.evidence
    evidence.disk_free_bytes = _free_bytes(runs)
    camera = asyncio.create_task(listener.watch_camera())
    try:
        await listener.listen(SETTLE_S + duration_s)
    except LinkError as error:
        evidence.link_error = str(error)
        await asyncio.sleep(duration_s)
    camera.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await camera
    listener.search_frames()
    return evidence


class Listener:
    """State: the session, what has been counted, the frames kept."""

    def __init__(self, config: Config, evidence: Evidence) -> None:
        self.evidence = evidence
        self._config = config
        self._session = Session(config.link, time.monotonic_ns(), signing=signing_of(config.link))
        self._session.parameters.want([*RULES, *FENCE_NAMES])
        self._count_from_ns = time.monotonic_ns() + round(SETTLE_S * 1e9)
        self._offset_steps_s: list[float] = []
        self._reference: tuple[int, int] | None = None
        self._kept: list[CameraFrame] = []

    async def listen(self, duration_s: float) -> None:
        """The link at the control loop's pace; LinkError where it cannot be opened."""
        period_s = 1.0 / self._config.control.rate_hz
        async with open_link(self._config.link.url, self._on_datagram) as link:
            due_s = time.monotonic()
            end_s = due_s + duration_s
            while due_s < end_s:
                due_s += period_s
                await asyncio.sleep(max(0.0, due_s - time.monotonic()))
                self.evidence.tick_late_s.append(max(0.0, time.monotonic() - due_s))
                self._take(self._session.handle_timer(time.monotonic_ns()))
                self._note_offset()
                for data in self._session.datagrams_to_send():
                    link.send(data)
        self._conclude()

    def _on_datagram(self, data: bytes) -> None:
        self._take(self._session.receive_datagram(data, time.monotonic_ns()))

    def _take(self, messages: list[SensorInput]) -> None:
        counts = self.evidence.message_counts
        for message in messages:
            if isinstance(message, VehicleStatus):
                self.evidence.status = message
            if time.monotonic_ns() >= self._count_from_ns:
                counts[type(message).__name__] = counts.get(type(message).__name__, 0) + 1

    def _note_offset(self) -> None:
        """By how much the same recent instant of the autopilot's clock has moved on ours since the last time."""
        zero_ns = self._session.companion_ns_from_boot_us(0)
        if zero_ns is None or time.monotonic_ns() < self._count_from_ns:
            return
        if self._reference is not None:
            boot_us, before_ns = self._reference
            moved_ns = (self._session.companion_ns_from_boot_us(boot_us) or before_ns) - before_ns
            self._offset_steps_s.append(moved_ns / 1e9)
        boot_us = (time.monotonic_ns() - zero_ns) // 1000
        self._reference = boot_us, self._session.companion_ns_from_boot_us(boot_us) or 0

    def _conclude(self) -> None:
        evidence, session = self.evidence, self._session
        evidence.clock = session.clock
        evidence.bytes_skipped = session.counters.bytes_skipped
        evidence.frames_refused = session.counters.frames_refused
        evidence.parameters = dict(session.parameters.values)
        evidence.missing_parameters = frozenset(session.parameters.missing)
        if self._offset_steps_s:
            evidence.offset_jitter_s = percentile([abs(step_s) for step_s in self._offset_steps_s], 0.99)

    # ---------------------------------------------------------------------------------------------------------- camera

    async def watch_camera(self) -> None:
        """Frames until cancelled; what is wrong is evidence."""
        try:
            async for frame in frames(self._config.cameras[self._config.vision.camera].source):
                if frame.arrived_ns >= self._count_from_ns:
                    self._note_frame(frame)
        except CameraError as error:
            self.evidence.camera_error = str(error)

    def _note_frame(self, frame: CameraFrame) -> None:
        self._kept = [*self._kept[-FRAMES_KEPT + 1 :], frame]
        self.evidence.frames.append(FrameSample(frame.arrived_ns, self._delay_s(frame), (0, 0), 0.0))

    def _delay_s(self, frame: CameraFrame) -> float | None:
        if frame.clock is CaptureClock.MONOTONIC:
            return (frame.arrived_ns - frame.capture_ns) / 1e9
        if frame.clock is not CaptureClock.AUTOPILOT:
            return None
        captured_ns = self._session.companion_ns_from_boot_us(frame.capture_ns // 1000)
        return None if captured_ns is None else (frame.arrived_ns - captured_ns) / 1e9

    def search_frames(self) -> None:
        """What the last frames show, and how long it takes to see."""
        evidence, configured = self.evidence, {marker.id for marker in self._config.pad.markers}
        if not self._kept:
            return
        detector = build_detector(self._config)
        for number, frame in enumerate(self._kept):
            image = frame.image()
            if image is None:
                evidence.camera_error = "a frame is not a readable picture"
                return
            size = (image.shape[1], image.shape[0])
            evidence.frames[number - len(self._kept)] = FrameSample(
                frame.arrived_ns, self._delay_s(frame), size, float(image.mean())
            )
            began_s = time.perf_counter()
            seen = detector.detect(CameraImage(frame.arrived_ns, self._config.vision.camera, image, number), None)
            if number > 1:  # the first ones load libraries
                evidence.detect_s.append(time.perf_counter() - began_s)
            if isinstance(seen, PadObservation):
                evidence.marker_ids_seen |= set(seen.marker_ids) & configured
                evidence.foreign_ids_seen |= set(seen.marker_ids) - configured
                evidence.reprojection_errors_px.append(seen.reprojection_error_px)
        evidence.frames = _with_levels(evidence.frames)


def _with_levels(samples: list[FrameSample]) -> list[FrameSample]:
    """Frames that were not opened take size and brightness from the last that was."""
    last = samples[-1]
    return [
        sample
        if sample.size_px != (0, 0)
        else FrameSample(sample.arrived_ns, sample.delay_s, last.size_px, last.mean_level)
        for sample in samples
    ]


def _free_bytes(folder: Path) -> int | None:
    """Of the disk that the folder, or what exists of its path, lies on."""
    place = next((path for path in (folder.absolute(), *folder.absolute().parents) if path.exists()), None)
    return None if place is None else shutil.disk_usage(place).free
