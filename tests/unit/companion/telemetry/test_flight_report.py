"""The report: what it says first, what it holds, and that it needs nobody."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from companion.cli import app
from companion.messages import (
    Health,
    MeasurementVerdict,
    ObservationSource,
    PadEstimate,
    PadNotSeen,
    PadObservation,
    Phase,
    PhaseChanged,
    VehicleState,
    VelocitySetpoint,
)
from companion.telemetry.findings import look_first
from companion.telemetry.flight_record import MOST_POINTS, MOST_SAMPLES, FlightRecord, Values
from companion.telemetry.report import report_html

REPO = Path(__file__).resolve().parents[4]
SECOND_NS = 10**9
LEVEL = (1.0, 0.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)
SECTIONS = (
    "What to look at first",
    "Path",
    "Against the pad",
    "Estimate: errors and innovations with their bounds",
    "Detection",
    "Setpoints against response",
    "Delays",
    "Health",
    "Phases",
    "Requests to the autopilot",
    "Figures",
)


def flight(seconds: int = 10) -> FlightRecord:
    """A vehicle that flies north at 1 m/s as asked, above a pad that stands."""
    record = FlightRecord()
    for tick in range(50 * seconds):
        t_ns = tick * SECOND_NS // 50
        record.add(VehicleState(t_ns, (t_ns / 1e9, 0.0, -5.0), (1.0, 0.0, 0.0), LEVEL, ZERO))
        record.add(VelocitySetpoint(t_ns, t_ns + 10**8, (1.0, 0.0, 0.0), 0.0))
        record.add(seen(t_ns))
    record.add(PhaseChanged(0, Phase.IDLE, Phase.DESCEND, "in_cone: test"))
    return record


def seen(t_ns: int) -> PadObservation:
    corners = ((30.0, 30.0), (60.0, 30.0), (60.0, 60.0), (30.0, 60.0))
    return PadObservation(t_ns, "down", "aruco", (0.0, 0.0, 5.0), ((0.1, 0.0, 0.0),) * 3, corners_px=corners)


def texts(record: FlightRecord, **figures: Any) -> str:
    return " ".join(look.text for look in look_first(record, {"outcome": "landed", **figures}))


def test_nothing_stands_out_in_a_flight_as_it_should_be() -> None:
    assert texts(flight()) == ""


def test_the_worst_comes_first() -> None:
    record = flight()
    record.add(Health(SECOND_NS, "camera down", 1, "3 gaps"))
    record.add(Health(2 * SECOND_NS, "camera down", 2, "no frame for 0.6 s"))
    looks = look_first(record, {"outcome": "crashed", "forced_disarm_in_air": True})
    assert [look.weight for look in looks] == sorted((look.weight for look in looks), reverse=True)
    assert "motors were stopped" in looks[0].text
    assert "did not land: crashed" in looks[1].text
    assert "no frame for 0.6 s" in looks[2].text
    assert "3 gaps" in looks[-1].text


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ({"touchdown_error_m": 0.8}, "0.80 m from the centre"),
        ({"touchdown_relative_speed_vertical_m_s": 1.9}, "1.90 m/s down"),
        ({"outcome": "held"}, "did not land: held"),
    ],
)
def test_figures_that_are_out_of_bounds_are_named(figures: dict[str, Any], said: str) -> None:
    assert said in texts(flight(), **figures)


def test_a_pad_out_of_sight_in_the_descent_is_named_with_its_duration() -> None:
    record = flight()
    record.seen_s = [t_s for t_s in record.seen_s if not 4.0 < t_s < 6.5]
    assert "out of sight for 2.5 s in descend" in texts(record)


def test_setpoints_that_pause_are_named() -> None:
    record = flight()
    record.add(VelocitySetpoint(10_380_000_000, 0, (1.0, 0.0, 0.0), 0.0))
    assert "1 pauses of the setpoints, the longest 400 ms" in texts(record)


def test_an_estimator_that_is_too_sure_is_named_by_its_source() -> None:
    record = flight()
    for i in range(100):
        nis = 12.0 if i % 3 == 0 else 1.0
        record.add(
            MeasurementVerdict(i * 10**7, ObservationSource.VISION_POSE, True, "fused", nis=nis, innovation=(0.1,) * 3)
        )
    assert "bound: vision_pose 34 %" in texts(record)


def test_every_verdict_its_innovation_and_the_models_are_in_the_page() -> None:
    record = flight()
    beacon, vision = ObservationSource.BEACON, ObservationSource.VISION_POSE
    for i in range(3):
        record.add(MeasurementVerdict(i * 10**7, vision, True, "fused", nis=1.0, innovation=(0.1, 0.2, 0.3)))
    record.add(MeasurementVerdict(10**8, beacon, False, "older than the history"))
    record.add(MeasurementVerdict(10**8, beacon, True, "outside gate: east", nis=20.0, innovation=(0.0, 9.0, 0.1)))
    record.add(PadEstimate(
        0, ZERO, ZERO, ZERO, 0.0, 0.0, ((1.0,) * 6,) * 6, 0.0, None, "constant_velocity", (("constant_velocity", 0.7), ("coordinated_turn", 0.3)),
    ))  # fmt: skip
    page = report_html(record, {}, title="", line="")
    for row in (
        ("vision pose", "fused", "3"),
        ("beacon", "older than the history", "1"),
        ("beacon", "outside gate: east", "1"),
    ):
        assert "".join(f"<td>{cell}</td>" for cell in row) in page
    titles = re.findall(r'class="title"[^>]*>([^<]*)<', page)
    for source in ("vision pose", "beacon"):
        assert f"Innovations: {source}, 3 components" in titles
        assert f"Innovations squared: {source}, 3 components" in titles
    assert "Probability of each motion model" in titles
    assert "coordinated turn" in page


def test_the_page_has_every_section_and_asks_nobody_for_anything() -> None:
    record = flight()
    record.add_frame(record.start_ns or 0, np.full((120, 160), 128, np.uint8))
    page = report_html(record, {"outcome": "landed"}, title="a <flight>", line="landed")
    assert re.findall(r"<h2>(.*?)</h2>", page) == list(SECTIONS)
    assert "http" not in page
    assert "<canvas" in page
    assert "data:image/jpeg;base64," in page
    assert "a &lt;flight&gt;" in page


def test_a_long_flight_keeps_a_page_that_opens_quickly() -> None:
    record = flight(600)
    noise = np.random.default_rng(1).integers(0, 255, (480, 752), np.uint8)
    for t_s in range(600):
        record.add_frame(t_s * SECOND_NS, noise)
    assert MOST_SAMPLES / 3 < len(record.samples) <= MOST_SAMPLES
    assert record.samples[-1].t_s > 560.0
    assert len(report_html(record, {}, title="long", line="")) < 3_000_000


def test_a_series_never_grows_without_bound_and_keeps_its_whole_span() -> None:
    series = Values()
    for i in range(100_000):
        series.add(float(i), 2.0 * i)
    assert MOST_POINTS / 2 <= len(series.t_s) <= MOST_POINTS
    assert series.t_s[0] == 0.0
    assert series.t_s[-1] > 99_900.0
    assert series.values == [2.0 * t_s for t_s in series.t_s]


def test_an_empty_record_is_a_page_too() -> None:
    assert "Nothing stands out" in report_html(FlightRecord(), {}, title="empty", line="")


def test_a_frame_in_which_nothing_was_seen_says_so() -> None:
    record = FlightRecord()
    record.add(PadNotSeen(0, "down", "aruco"))
    record.add_frame(0, np.zeros((48, 64), np.uint8))
    assert "0.0 s, not seen" in report_html(record, {}, title="", line="")
    record.add(seen(0))
    assert "0.0 s, seen" in report_html(record, {}, title="", line="")


def report(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["report", *arguments])


@pytest.mark.parametrize("log", ["tests/replay/line.mcap", "tests/data/px4/takeoff_land.tlog"])
def test_a_log_becomes_a_page(log: str, tmp_path: Path) -> None:
    result = report(str(REPO / log), "--out", str(tmp_path / "page.html"))
    assert result.exit_code == 0, result.stderr
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<canvas" in page
    assert 50_000 < len(page) < 3_000_000


def test_what_is_no_log_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"not this")
    for path in (tmp_path, tmp_path / "x.mcap", tmp_path / "nowhere.tlog", tmp_path / "y.txt"):
        result = report(str(path))
        assert result.exit_code == 2
        assert str(path) in result.stderr
