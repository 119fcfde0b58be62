"""A scenario file: everything about a simulated flight but its seed. TOML -> frozen, validated structs.

One struct a table; a key that is not listed here is refused with file, key, value and what is allowed. Angles are degrees
here, radians elsewhere. `seeded` values (absent keys) are drawn by `World` from the seed, one generator per purpose.
A name without a slash or a suffix means a file of the project's configs/ (`pad = "nested"`, `airframe = "x500"`).
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from sitl_stub.carriers import CARRIERS, CarrierSettings
from sitl_stub.carriers.rover import RoverSettings
from sitl_stub.faults import FAULTS, Fault
from sitl_stub.pad_layout import PadLayout, pad_layout_from_toml
from sitl_stub.paths import PATHS, PathSettings
from sitl_stub.paths.line import LineSettings
from sitl_stub.section import Count, Fraction, NonNegative, Positive, Section

PROJECT = FilePath(__file__).resolve().parent.parent


class ScenarioError(ValueError):
    """The scenario cannot be used. The text names the file, the key, the value and what is allowed."""


class Vehicle(Section, frozen=True):
    """[vehicle]: which multirotor, with which parameters, and how the flight begins."""

    airframe: str = "x500"
    """A file of configs/airframes, or a path."""
    start: Literal["air", "ground", "deck"] = "air"
    """air: flying in AUTO.LOITER, armed. ground: standing, disarmed, at the origin. deck: standing on the pad, disarmed."""
    start_height_m: NonNegative = 10.0
    """Height above the ground for start = "air"."""
    start_yaw_deg: float | None = None
    """Absent: seeded."""
    cold_boot: bool = False
    """Boot as the real one does, ready 4 s after power-on; false: ready at once."""
    parameters: dict[str, float | int] = msgspec.field(default_factory=dict)
    """PX4 parameters that differ from the airframe's."""


class Wind(Section, frozen=True):
    """[wind]: mean at 6 m height (less below, more above) and turbulence."""

    mean_m_s: NonNegative = 3.0
    from_deg: float | None = None
    """Where it comes from; absent: seeded."""
    gust_sigma_m_s: NonNegative = 0.5
    """Standard deviation of each horizontal component."""
    vertical_gust_sigma_m_s: NonNegative | None = None
    """Absent: half of the horizontal one."""
    model: Literal["dryden", "none"] = "dryden"
    """dryden: gusts of MIL-F-8785C at low altitude. none: still air."""


class Place(Section, frozen=True):
    """[place]: where the local frame lies on Earth, and where the pad is when the scenario begins."""

    latitude_deg: float = 47.397742
    longitude_deg: float = 8.545594
    altitude_m: float = 488.0
    """Above mean sea level, of the ground."""
    pad_distance_m: NonNegative = 30.0
    """Horizontal, from the vehicle's start."""
    pad_bearing_deg: float | None = None
    """Absent: seeded."""
    path_heading_deg: float | None = None
    """Direction in which the carrier sets out; absent: seeded."""


class Pad(Section, frozen=True):
    """[pad]: the deck's markers and size, its height, and what standing on it is like."""

    file: str = "nested"
    """A file of configs/pads, or a path."""
    deck_height_m: NonNegative | None = None
    """Top above the ground or the mean water; absent: as in the pad's file."""
    friction: NonNegative = 0.7
    """Coulomb coefficient between the feet and the deck (static and sliding)."""
    ground_friction: NonNegative = 0.8
    shelter: Fraction = 0.0
    """Part of the air's motion against the deck that a cab or a wind screen takes away on it; 0: it stands in the wind."""
    restitution: Fraction = 0.15
    """Rebound speed over impact speed when all feet touch at once."""


class Camera(Section, frozen=True):
    """[cameras.<name>]: lens, mount, sensor. The names of the keys are those of the application's [cameras.<name>]."""

    model: Literal["pinhole", "kannala_brandt", "scaramuzza"] = "pinhole"
    width_px: Count = 752
    height_px: Count = 480
    fx_px: Positive = 420.0
    fy_px: Positive = 420.0
    cx_px: float = 375.5
    cy_px: float = 239.5
    distortion: tuple[float, ...] = ()
    position_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.05)
    mount_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw against a camera that looks straight down, image top to the nose; pitch 90 looks forward."""
    colour: bool = False
    rate_hz: Positive = 30.0
    delay_s: NonNegative = 0.05
    """From the middle of the exposure to the hand-over."""
    delay_spread_s: NonNegative = 0.0
    """What `delay_kind` makes of it."""
    delay_kind: Literal["constant", "uniform", "exponential"] = "constant"
    """uniform: up to `delay_spread_s` more. exponential: that much more on average."""
    drop_probability: Fraction = 0.0
    exposure_s: NonNegative = 0.003
    """Motion during the exposure blurs."""
    noise_sigma: NonNegative = 1.5
    """Of a black pixel, grey levels."""
    shot_noise_sigma: NonNegative = 3.0
    """What light adds at full scale."""
    vignetting: Fraction = 0.0
    """Light lost in the corners."""
    softness_px: NonNegative = 0.0
    """The lens's blur."""
    readout_s: NonNegative = 0.0
    """Rolling shutter: time from the first row to the last."""
    jpeg_quality: Annotated[int, Meta(ge=0, le=100)] = 0
    """Compress and decompress, as a network camera does; 0: not compressed."""
    motion_blur: bool = True
    stereo_baseline_m: NonNegative = 0.0
    """Above 0: a second camera so far to the right of this one, its picture beside this one's in one frame. `width_px` is then the
    whole frame's, lens and place are the left camera's."""

    def __post_init__(self) -> None:
        if self.stereo_baseline_m > 0.0 and self.width_px % 2:
            raise ValueError("an even number of pixels, two pictures beside each other - at `$.width_px`")


class Light(Section, frozen=True):
    """[light]: what the cameras see by, and what the ground looks like."""

    brightness: Positive = 1.0
    """1: well exposed; over 1 burns out; 0.05: night."""
    noise_gain: Positive = 1.0
    """The sensor's amplification that goes with it."""
    ground: Literal["field", "asphalt", "water"] = "field"
    """What the cameras see around the pad."""
    shadow_remaining: Fraction | None = None
    """Part of the light that a large shadow leaves, whose straight edge lies over the deck; absent: no shadow."""
    shadow_direction_deg: float = 30.0
    """Seen from the pad's centre, clockwise from its x axis: where the shade is."""
    shadow_offset_m: float = 0.1
    """The edge's distance from the pad's centre along that direction."""
    glare_strength: NonNegative = 0.0
    """The sun mirrored by the deck: part of full scale added at the middle of the spot; 0: none."""
    glare_position_m: tuple[float, float] = (0.2, 0.1)
    glare_radius_m: Positive = 0.3


class RangeSensor(Section, frozen=True):
    """[range_sensor]: distance along B +z to the deck or the ground."""

    fitted: bool = True
    rate_hz: Positive = 20.0
    min_m: NonNegative = 0.1
    max_m: Positive = 40.0
    noise_sigma_m: NonNegative = 0.02


class Beacon(Section, frozen=True):
    """[beacon]: the pad's own GNSS on the air as a second MAVLink system."""

    fitted: bool = True
    system_id: Count = 2
    rate_hz: Positive = 5.0
    odometry_rate_hz: NonNegative = 0.0
    """ODOMETRY in the vehicle's local frame beside it; 0: none."""
    position_sigma_m: NonNegative = 1.5
    """Slowly varying horizontal error, each axis divided by sqrt 2."""
    position_time_s: Positive = 60.0
    noise_sigma_m: NonNegative = 0.05
    velocity_sigma_m_s: NonNegative = 0.1
    heading_sigma_deg: NonNegative = 3.0
    delay_s: NonNegative = 0.1


class Estimate(Section, frozen=True):
    """[estimate]: error of what the autopilot believes about itself."""

    error_scale: NonNegative = 1.0
    """1: as large as that of a PX4 in simulation; 0: truth."""


class Success(Section, frozen=True):
    """[success]: what counts as a landing on the pad, over and above staying on it upright."""

    max_touchdown_error_m: Positive | None = None
    """Absent: anywhere on the deck."""
    max_vertical_speed_m_s: Positive = 3.0
    settle_s: NonNegative = 2.0
    """How long the vehicle must have stood with its motors stopped before the ending is named."""


class Scenario(Section, frozen=True):
    """All of it. The defaults are the scenario `line` without turbulence of its carrier's."""

    name: str = "line"
    description: str = ""
    duration_limit_s: Positive = 180.0
    vehicle: Vehicle = Vehicle()
    place: Place = Place()
    wind: Wind = Wind()
    carrier: CarrierSettings = RoverSettings()
    path: PathSettings = LineSettings(speed_m_s=1.5)
    pad: Pad = Pad()
    cameras: dict[str, Camera] = msgspec.field(default_factory=lambda: {"down": Camera()})
    light: Light = Light()
    range_sensor: RangeSensor = RangeSensor()
    beacon: Beacon = Beacon()
    estimate: Estimate = Estimate()
    faults: tuple[Fault, ...] = ()
    success: Success = Success()


def load(name_or_path: str | FilePath) -> Scenario:
    """The scenario of that name in configs/scenarios, or in that file; ScenarioError says what is wrong and where."""
    file = find("scenarios", str(name_or_path))
    return from_toml(read(file), str(file), file.parent)


def find(folder: str, name: str) -> FilePath:
    """`name` as a path if it looks like one, else configs/<folder>/<name>.toml of the project or of the package."""
    if name.endswith(".toml") or "/" in name:
        return FilePath(name)
    for root in _roots(folder):
        if (root / f"{name}.toml").is_file():
            return root / f"{name}.toml"
    known = names(folder)
    raise ScenarioError(f"{name!r} is not one of {folder}; {_allowed(name, known)}; or give a path that ends in .toml")


def names(folder: str = "scenarios") -> list[str]:
    """What `find` knows by name."""
    return sorted({file.stem for root in _roots(folder) for file in root.glob("*.toml")})


def _roots(folder: str) -> list[FilePath]:
    """In a checkout, and in an installed package."""
    return [PROJECT / "configs" / folder, PROJECT / "companion" / "configs" / folder]


def read(file: FilePath) -> str:
    """The file's text; ScenarioError where it cannot be read."""
    try:
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{file}: is not UTF-8 text (byte {error.start})") from error


def from_toml(text: str, origin: str = "scenario", folder: FilePath | None = None) -> Scenario:
    """The scenario in a TOML text; paths of recorded tracks are relative to `folder`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{origin}: is not valid TOML: {error}") from error
    if folder is not None and data.get("path", {}).get("kind") == "recorded":
        data["path"]["file"] = str(folder / data["path"].get("file", ""))
    return from_table(data, origin)


def from_table(data: Mapping[str, Any], origin: str = "scenario") -> Scenario:
    """The scenario in a parsed file. Every wrong table is named, not only the first."""
    problems = [text for key, value in data.items() for text in _problems(key, value, origin)]
    if problems:
        raise ScenarioError("\n".join(problems))
    return msgspec.convert(data, Scenario)


def with_overrides(scenario: Scenario, overrides: Mapping[str, Any], origin: str = "override") -> Scenario:
    """A copy in which dotted keys (`path.speed_m_s`, `wind.mean_m_s`) have other values."""
    data = msgspec.to_builtins(scenario)
    for dotted, value in overrides.items():
        table = data
        *parents, last = dotted.split(".")
        for key in parents:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise ScenarioError(f"{origin}: {dotted} = {value!r}: {key!r} holds no keys")
        table[last] = value
    return from_table(data, origin)


def load_pad(scenario: Scenario) -> PadLayout:
    """The pad's layout from its file, at the height the scenario asks for."""
    file = find("pads", scenario.pad.file)
    layout = pad_layout_from_toml(read(file), str(file))
    height = scenario.pad.deck_height_m
    return layout if height is None else replace(layout, deck_height_m=height)


_FIELDS: dict[str, Any] = {field.name: field.type for field in msgspec.structs.fields(Scenario)}
_KINDS: dict[str, dict[str, type[Section]]] = {"carrier": CARRIERS, "path": PATHS, "faults": FAULTS}


def _problems(key: str, value: Any, origin: str) -> list[str]:
    if key not in _FIELDS:
        return [f"{origin}: {key} = {value!r} is not a key; {_allowed(key, _FIELDS)}"]
    if key == "cameras" and isinstance(value, Mapping):
        return [text for name, table in value.items() for text in _in_table(f"cameras.{name}", table, Camera, origin)]
    if key == "faults" and isinstance(value, Sequence):
        return [text for i, table in enumerate(value) for text in _of_kind(f"faults[{i}]", table, FAULTS, origin)]
    if key in _KINDS:
        return _of_kind(key, value, _KINDS[key], origin)
    return _in_table(key, value, _FIELDS[key], origin)


def _of_kind(where: str, table: Any, kinds: Mapping[str, type[Section]], origin: str) -> list[str]:
    """A table whose `kind` says which other keys it may have."""
    if not isinstance(table, Mapping) or "kind" not in table:
        return [f"{origin}: [{where}] needs kind; allowed: {', '.join(sorted(kinds))}"]
    kind = table["kind"]
    if kind not in kinds:
        return [f"{origin}: [{where}] kind = {kind!r}: {_allowed(str(kind), kinds)}"]
    return _in_table(where, table, kinds[kind], origin)


def _in_table(where: str, value: Any, kind: Any, origin: str) -> list[str]:
    is_table = isinstance(kind, type) and issubclass(kind, Section)
    if is_table and isinstance(value, Mapping):
        known = [field.encode_name for field in msgspec.structs.fields(kind)] + _tag(kind)
        unknown = [key for key in value if key not in known]
        if unknown:
            return [f"{origin}: [{where}] {k} = {value[k]!r} is not a key; {_allowed(k, known)}" for k in unknown]
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        return [_explain(where, value, str(error), origin)]
    return []


def _tag(kind: type[Section]) -> list[str]:
    field = kind.__struct_config__.tag_field
    return [] if field is None else [field]


def _explain(where: str, content: Any, error: str, origin: str) -> str:
    """msgspec says what is expected and where (`$.key[0]`); add the file and the value that stands there."""
    expected, _, place = error.partition(" - at `$")
    path = place.rstrip("`").lstrip(".")
    value = content
    for part in path.replace("[", ".").replace("]", "").split("."):
        if isinstance(value, Mapping) and part in value:
            value = value[part]
        elif isinstance(value, Sequence) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
    return f"{origin}: [{where}] {path} = {value!r}: {expected[:1].lower()}{expected[1:]}"


def _allowed(name: str, known: Any) -> str:
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}allowed: {', '.join(names)}"
