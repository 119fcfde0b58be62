"""Bad cameras are noticed and named: by hand-made frames, and by the simulator's camera faults."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.campaign.runner import fly
from companion.config import load_with
from companion.messages import CameraImage, Health
from companion.vision.frame_watch import ArrivalWatch, PictureWatch
from sitl_stub.scenario import load as load_scenario
from sitl_stub.scenario import with_overrides

MS = 1_000_000
PERIOD = 33 * MS


def noise(seed: int, level: int = 100, width: int = 64, height: int = 48) -> Any:
    scene = np.random.default_rng(seed).normal(level, 2.0, (height, width))
    return np.clip(np.rint(scene), 0, 255).astype(np.uint8)


def image(t_ns: int, pixels: Any) -> CameraImage:
    return CameraImage(t_ns, "down", pixels, 0)


def watch() -> PictureWatch:
    return PictureWatch("down", width_px=64, height_px=48)


def arrivals() -> ArrivalWatch:
    return ArrivalWatch("down", timeout_ns=500 * MS, start_ns=0)


def texts(health: list[Health]) -> list[tuple[int, str]]:
    return [(message.level, message.text.partition(":")[0]) for message in health]


def test_a_camera_that_shows_a_changing_scene_is_fine() -> None:
    seen = watch()
    assert [seen.look(image(k * PERIOD, noise(k))) for k in range(30)] == [(None, [])] * 30


def test_a_frozen_camera_is_refused_at_once_named_after_300_ms_once_and_well_again_when_it_moves() -> None:
    seen = watch()
    results = [seen.look(image(k * PERIOD, noise(1))) for k in range(20)]
    assert results[0] == (None, [])
    assert {reason for reason, _ in results[1:]} == {"the same picture as before"}
    named = [(k, texts(health)) for k, (_, health) in enumerate(results) if health]
    assert named == [(10, [(2, "frozen")])]
    reason, health = seen.look(image(20 * PERIOD, noise(2)))
    assert (reason, texts(health)) == (None, [(0, "no longer frozen")])


def test_one_changed_pixel_anywhere_is_a_new_picture() -> None:
    seen = watch()
    first = noise(1)
    second = first.copy()
    second[3, 5] += 1
    seen.look(image(0, first))
    assert seen.look(image(PERIOD, second)) == (None, [])


def test_a_black_picture_is_refused_and_named_but_a_faint_scene_is_not() -> None:
    seen = watch()
    reason, health = seen.look(image(0, noise(1, level=0)))
    assert (reason, texts(health)) == ("black picture", [(2, "black")])
    faint = noise(2, level=1)
    faint[:16, :16] = 30
    reason, health = seen.look(image(PERIOD, faint))
    assert (reason, texts(health)) == (None, [(0, "no longer black")])


def test_a_picture_of_another_size_than_calibrated_is_refused_and_says_both_sizes() -> None:
    reason, health = watch().look(image(0, noise(1, width=80)))
    assert reason == "wrong size: 80 x 48 px, but its calibration is for 64 x 48 px"
    assert texts(health) == [(2, "wrong size")]


def test_a_frame_that_is_no_picture_is_named_and_forgotten_when_pictures_come() -> None:
    seen = watch()
    assert texts(seen.unreadable(0, "not a JPEG")) == [(2, "unreadable")]
    assert seen.unreadable(PERIOD, "not a JPEG") == []
    assert texts(seen.look(image(2 * PERIOD, noise(1)))[1]) == [(0, "no longer unreadable")]


def test_a_camera_that_never_sends_and_one_that_falls_silent_are_dead_and_can_come_back() -> None:
    seen = arrivals()
    assert seen.check(400 * MS) == []
    assert texts(seen.check(600 * MS)) == [(2, "dead")]
    assert seen.check(700 * MS) == []
    assert texts(seen.arrived(800 * MS)) == [(0, "no longer dead")]
    (health,) = seen.check(1400 * MS)
    assert health.text == "dead: no frame for 0.6 s"


def test_even_frames_are_no_stall_and_repeated_gaps_are() -> None:
    seen = arrivals()
    t_ns, said = 0, []
    for k in range(120):
        t_ns += 150 * MS if k >= 60 and k % 10 == 0 else PERIOD
        said += [(k, message.level, message.text) for message in seen.arrived(t_ns)]
    ((k, level, text),) = said
    assert (k, level) == (80, 1)
    assert text.startswith("stalling: 3 gaps among")


@settings(max_examples=100, deadline=None)
@given(
    frames=st.lists(
        st.tuples(
            st.integers(0, 10**9),
            st.sampled_from([(48, 64), (1, 1), (48, 64, 3), (7, 9), (480, 752)]),
            st.integers(0, 255),
        ),
        max_size=12,
    )
)
def test_frames_of_any_size_at_any_times_never_raise(frames: list[tuple[int, tuple[int, ...], int]]) -> None:
    seen = watch()
    for t_ns, shape, level in frames:
        reason, _ = seen.look(image(t_ns, np.full(shape, level, np.uint8)))
        assert reason is not None or shape[:2] == (48, 64)


class HealthSink:
    """Keeps what was said of the camera, by seconds of flight."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None: ...

    def journal(self, entries: Any) -> None:
        self.said += [
            entry.message.text.partition(":")[0]
            for entry in entries
            if isinstance(entry.message, Health) and entry.message.subject == "camera down"
        ]

    def truth(self, now_ns: int, truth: Any) -> None: ...

    def close(self) -> None: ...


def test_each_camera_fault_of_the_simulator_is_named_when_it_begins_and_when_it_ends() -> None:
    windows = (("camera_freeze", 1.0, 0.7), ("camera_blackout", 2.0, 0.4), ("camera_stop", 2.8, 0.9))
    faults = [{"kind": kind, "start_s": start, "duration_s": duration} for kind, start, duration in windows]
    overrides = {"duration_limit_s": 4.2, "faults": faults, "cameras": {"down": {"rate_hz": 15.0}}}
    sink = HealthSink()
    fly(with_overrides(load_scenario("line"), overrides), load_with([], {}), seed=1, sinks=[sink])
    assert sink.said == ["frozen", "no longer frozen", "black", "no longer black", "dead", "no longer dead"]
