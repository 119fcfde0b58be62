"""`companion init`: a commented configuration from a few answers, given as flags, asked on a terminal, or left at their defaults.

What is written is read back with the same checks as any configuration before it is kept: a wrong answer is said at once.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import typer

from companion.config import ConfigError, load
from companion.io.address import parse_address
from companion.io.cameras import CAMERAS
from companion.io.link import LinkError
from companion.io.links import LINKS


class AnswerError(ValueError):
    """An answer that cannot be used; the text says what is expected."""


@dataclass(frozen=True, slots=True)
class Question:
    """One answer. `check` raises AnswerError; texts are what people type."""

    name: str
    asks: str
    default: str
    check: Callable[[str], object]


def _link(text: str) -> None:
    try:
        parse_address(text, LINKS)
    except LinkError as error:
        raise AnswerError(str(error)) from error


def _camera(text: str) -> None:
    if text.partition(":")[0] not in CAMERAS:
        raise AnswerError(f"{text!r}: begins with one of {', '.join(f'{name}:' for name in CAMERAS)}")


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.strip().isdecimal() and height.strip().isdecimal()):
        raise AnswerError(f"{text!r}: write width x height in pixels, as 1280x720")
    return int(width), int(height)


def _degrees(text: str) -> float:
    angle_deg = _number(text)
    if not 5.0 <= angle_deg <= 150.0:
        raise AnswerError(f"{text!r}: between 5 and 150 degrees")
    return angle_deg


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise AnswerError(f"{text!r}: a number is needed") from None
    if not math.isfinite(value):
        raise AnswerError(f"{text!r}: a number is needed")
    return value


def _vector(text: str) -> tuple[float, ...]:
    values = tuple(_number(part) for part in text.split(","))
    if len(values) != 3:
        raise AnswerError(f"{text!r}: three numbers, forward,right,down in metres")
    return values


def _markers(text: str) -> list[tuple[int, float]]:
    """`45:1.2,7:0.24` -> [(45, 1.2), (7, 0.24)]."""
    found = []
    for part in text.split(","):
        number, _, size = part.partition(":")
        if not number.strip().isdecimal():
            raise AnswerError(f"{part!r}: write id:size in metres, as 45:1.2,7:0.24")
        found.append((int(number), _number(size)))
    return found


def _yes(text: str) -> bool:
    if text.lower() not in ("y", "yes", "n", "no"):
        raise AnswerError(f"{text!r}: yes or no")
    return text.lower() in ("y", "yes")


def _anything(text: str) -> str:
    return text


QUESTIONS = (
    Question("link", "How is the autopilot reached (serial, udpin, udpout, tcp)?", "udpin://0.0.0.0:14540", _link),
    Question(
        "camera", "Where do camera frames come from (v4l2, rtsp, http, gstreamer)?", "v4l2:///dev/video0", _camera
    ),
    Question("calibration", "Calibration file of the camera, empty if there is none yet", "", _anything),
    Question("size", "Size of its pictures in pixels", "1280x720", _size),
    Question("field_of_view", "Its horizontal field of view, degrees", "70", _degrees),
    Question("delay", "Delay of its pictures in seconds, if known (companion calibrate delay)", "0.05", _number),
    Question("position", "Where it sits in the vehicle: forward,right,down of the autopilot, m", "0,0,0.05", _vector),
    Question("markers", "Markers on the pad, id:size in metres", "45:1.2,7:0.24", _markers),
    Question("deck", "Size of the deck in metres (a square of this side)", "1.5", _number),
    Question("legs", "How far the feet reach below the autopilot, m", "0.22", _number),
    Question("water", "Is all but the pad water, or otherwise no place to land?", "no", _yes),
    Question("dashboard", "A page in the browser?", "yes", _yes),
)


def write(path: Path, given: Mapping[str, str], *, ask: bool, overwrite: bool) -> None:
    """The command. ValueErrors say what is wrong with an answer, or that the file exists."""
    unknown = sorted(set(given) - {question.name for question in QUESTIONS})
    if unknown:
        raise AnswerError(f"{unknown[0]}: no such question; there are {', '.join(q.name for q in QUESTIONS)}")
    if path.exists() and not overwrite:
        raise ConfigError(f"{path}: exists already; --force replaces it")
    write_config(path, answered(given, _asked if ask else None))


def _asked(question: Question) -> str:
    """On the terminal, again until the answer can be used."""
    while True:
        text = str(typer.prompt(question.asks, default=question.default, show_default=question.default != ""))
        try:
            question.check(text)
        except AnswerError as error:
            typer.echo(f"  {error}")
        else:
            return text


def answered(given: Mapping[str, str], ask: Callable[[Question], str] | None) -> dict[str, str]:
    """An answer to every question: given, else asked where there is somebody to ask, else the default.

    AnswerError for a given answer that cannot be used; a person is asked again by `ask` itself.
    """
    answers: dict[str, str] = {}
    for question in QUESTIONS:
        needless = question.name in ("size", "field_of_view") and answers["calibration"] != ""
        text = given.get(question.name)
        if text is None:
            text = question.default if ask is None or needless else ask(question)
        try:
            question.check(text)
        except AnswerError as error:
            raise AnswerError(f"{question.name}: {error}") from error
        answers[question.name] = text
    return answers


def write_config(path: Path, answers: Mapping[str, str]) -> None:
    """Write the file if it passes as a configuration; ConfigError where it does not, and the file before stays."""
    trial = path.with_name(f".{path.name}.new")
    try:
        trial.write_text(config_text(answers), encoding="utf-8")
        load([trial])
        trial.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
    except ConfigError as error:
        raise ConfigError(str(error).replace(str(trial), str(path))) from error
    finally:
        trial.unlink(missing_ok=True)


def config_text(answers: Mapping[str, str]) -> str:
    """The file. What is commented out shows a default that people often change."""
    return TEMPLATE.format(
        link=json.dumps(answers["link"]),
        camera=json.dumps(answers["camera"]),
        lens=_lens(answers),
        delay=_number(answers["delay"]),
        position=list(_vector(answers["position"])),
        deck=_number(answers["deck"]),
        markers="\n\n".join(
            f"[[pad.markers]]\nid = {number}\nsize_m = {size_m}" for number, size_m in _markers(answers["markers"])
        ),
        legs=_number(answers["legs"]),
        water=str(_yes(answers["water"])).lower(),
        dashboard=str(_yes(answers["dashboard"])).lower(),
    )


def _lens(answers: Mapping[str, str]) -> str:
    if answers["calibration"]:
        return f"calibration_file = {json.dumps(answers['calibration'])}   # beside this file; it decides size and lens"
    width, height = _size(answers["size"])
    focal_px = round(0.5 * width / math.tan(math.radians(_degrees(answers["field_of_view"])) / 2.0), 1)
    return (
        "# From the field of view alone: good enough to see the pad, not to land on it. Calibrate, then name the file:\n"
        '# calibration_file = "down.yaml"       # companion calibrate lens ...\n'
        f"width_px = {width}\nheight_px = {height}\n"
        f"fx_px = {focal_px}\nfy_px = {focal_px}\ncx_px = {(width - 1) / 2}\ncy_px = {(height - 1) / 2}"
    )


TEMPLATE = """\
# Companion's configuration, written by `companion init`. Only what differs from the defaults need stand here:
#   companion check-config -c THIS      is it usable, and what is it in full
#   companion doctor -c THIS            before each flight: link, clock, camera, pad, parameters
#   companion run -c THIS               fly; START is said on the page, over the broker, or with --start

[link]
url = {link}
# target_system = 1                # MAV_SYS_ID of the autopilot
# beacon_system = 2                # MAVLink system of the pad's own beacon, if it has one
# signing_key_file = "link.key"    # MAVLink 2 signing (docs/links.md)

[cameras.down]
source = {camera}
{lens}
delay_s = {delay}                   # from the exposure to the hand-over, for frames without a capture time
position_frd_m = {position}   # forward, right, down of the autopilot
# mount_deg = [0.0, 0.0, 0.0]      # roll, pitch, yaw against "looks straight down, top of the picture to the nose"

[pad]
length_m = {deck}
width_m = {deck}
# family = "DICT_4X4_50"           # others: docs/vision.md

# Sizes are those of the black square's side, measured on the print. companion make-pad draws them at true scale.
{markers}

[mission]
vehicle_leg_height_m = {legs}      # of the feet below the autopilot
# takeoff_height_m = 6.0
# approach_height_m = 8.0
# max_go_arounds = 4
# disarm = "auto"                  # force, never (docs/safety.md)

[safety]
only_the_pad_is_land = {water}
# geofence_radius_m = 500.0        # from where START was said
# ceiling_m = 60.0
# min_battery = 0.2

# [guidance]
# form = "px4"                     # the autopilot's own precision landing flies; Companion only tells (docs/guidance.md)

[dashboard]
enabled = {dashboard}              # http://127.0.0.1:8080, with a token (docs/dashboard.md)

# [mqtt]
# enabled = true                   # docs/mqtt.md
# host = "127.0.0.1"
"""
