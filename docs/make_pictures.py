"""Makes the pictures of the README from one simulated flight.

    python docs/make_pictures.py [--scenario line] [--seed 1]

docs/images/landing.svg   the path from above and from the side
README.md                 the line in which the flight ends
docs/images/camera.jpg    what the camera saw in each phase, with the detected outline
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from companion.campaign.flight_sinks import ReportSink
from companion.campaign.runner import fly
from companion.campaign.summary import summary, summary_line
from companion.config import Config
from companion.messages import Image, PadObservation, Phase, PhaseChanged
from companion.onboard import JournalEntry
from companion.telemetry.report import picture
from sitl_stub.scenario import load
from sitl_stub.world import Truth

IMAGES = Path(__file__).parent / "images"
BEGIN, END = "<!-- demo-line:begin -->", "<!-- demo-line:end -->"
SHOWN = (Phase.APPROACH, Phase.FOLLOW, Phase.DESCEND, Phase.COMMIT)
GREEN, WHITE = (60, 220, 60), (255, 255, 255)


class FilmStrip:
    """Keeps the last frame of each phase in which the pad was seen."""

    def __init__(self) -> None:
        self.phase = Phase.IDLE
        self.newest: dict[int, Image] = {}
        self.kept: dict[Phase, npt.NDArray[np.uint8]] = {}

    def datagram(self, now_ns: int, data: bytes, *, outgoing: bool) -> None:
        pass

    def frame(self, camera: str, now_ns: int, t_ns: int, image: Image) -> None:
        self.newest = {t_ns: image}

    def journal(self, entries: Sequence[JournalEntry]) -> None:
        for entry in entries:
            message = entry.message
            if isinstance(message, PhaseChanged):
                self.phase = message.after
            elif isinstance(message, PadObservation) and message.t_ns in self.newest and self.phase in SHOWN:
                self.kept[self.phase] = _labelled(self.newest[message.t_ns], message, self.phase)

    def truth(self, now_ns: int, truth: Truth) -> None:
        pass

    def close(self) -> None:
        pass

    def strip(self) -> npt.NDArray[np.uint8]:
        small = [cv2.resize(self.kept[phase], (376, 240), interpolation=cv2.INTER_AREA) for phase in SHOWN]
        return np.hstack(small).astype(np.uint8)


def _labelled(frame: Image, seen: PadObservation, phase: Phase) -> npt.NDArray[np.uint8]:
    image = frame.copy() if frame.ndim == 3 else cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR)
    corners = np.round(np.array(seen.corners_px).reshape(-1, 4, 2)).astype(np.int32)
    cv2.polylines(image, list(corners), True, GREEN, 2, cv2.LINE_AA)
    cv2.putText(image, str(phase), (14, 42), cv2.FONT_HERSHEY_SIMPLEX, 1.3, (0, 0, 0), 6, cv2.LINE_AA)
    cv2.putText(image, str(phase), (14, 42), cv2.FONT_HERSHEY_SIMPLEX, 1.3, WHITE, 2, cv2.LINE_AA)
    return np.asarray(image, np.uint8)


def _into_readme(line: str) -> None:
    readme = IMAGES.parents[1] / "README.md"
    text = readme.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    readme.write_text(f"{before}{BEGIN}\n```\n{line}\n```\n{END}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="line")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    film, report = FilmStrip(), ReportSink()
    started = time.perf_counter()
    result = fly(load(options.scenario), Config(), seed=options.seed, sinks=(film, report))
    wall_s = time.perf_counter() - started
    line = summary_line(summary(result, scenario=options.scenario, seed=options.seed, wall_s=wall_s))
    print(line)
    _into_readme(line)
    IMAGES.mkdir(exist_ok=True)
    (IMAGES / "landing.svg").write_text(picture(report.record), encoding="utf-8")
    cv2.imwrite(str(IMAGES / "camera.jpg"), film.strip(), [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main()
