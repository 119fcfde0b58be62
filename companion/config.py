"""Configuration: TOML -> frozen, validated sections.

One Struct a section; a key that is not listed here is refused with file, key, value and what is allowed. Every physical
key carries its unit. Angles are degrees here and nowhere else (`_deg`). `load` overlays files on the defaults, so that a
user's file holds only what differs.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from companion.io import camera_info
from companion.io.camera_info import CalibrationError, CameraInfo

Positive = Annotated[float, Meta(gt=0.0)]
NonNegative = Annotated[float, Meta(ge=0.0)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Port = Annotated[int, Meta(ge=1, le=65535)]
SystemId = Annotated[int, Meta(ge=1, le=255)]


class ConfigError(ValueError):
    """The configuration cannot be used. The text names the file, the key, the value and what is allowed."""


class _Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of all sections: immutable, and an unknown key is an error."""


class Link(_Section, frozen=True):
    """How to reach the autopilot. `signing_key_file` (32 bytes or 64 hexadecimal digits, relative to the file that names
    it) turns on MAVLink 2 signing: what is not signed with that key, the beacon included, is refused."""

    url: str = "udpin://0.0.0.0:14540"
    system_id: SystemId = 1
    component_id: SystemId = 191
    target_system: SystemId = 1
    target_component: SystemId = 1
    beacon_system: SystemId = 2
    state_rate_hz: Positive = 50.0
    status_rate_hz: Positive = 10.0
    command_timeout_s: Positive = 0.5
    command_attempts: Annotated[int, Meta(ge=1, le=20)] = 5
    lost_after_s: Positive = 2.0
    beacon_sigma_m: Positive = 1.5
    beacon_clock: Literal["autopilot", "own"] = "autopilot"
    signing_key_file: str | None = None


class Camera(_Section, frozen=True):
    """One camera: where frames come from, its lens, and how it is mounted.

    `mount_deg` is roll, pitch, yaw of the camera's *optical axis frame* against a camera that looks straight down with the
    top of its image towards the nose; pitch 90 looks forward. `calibration_file` (ROS camera_info YAML,
    relative to the file that names it) decides model, size, focal lengths, centre and distortion; `load` reads it.
    """

    source: str = "http://127.0.0.1:8554/down"
    model: Literal["pinhole", "kannala_brandt", "scaramuzza"] = "pinhole"
    width_px: Annotated[int, Meta(ge=16)] = 752
    height_px: Annotated[int, Meta(ge=16)] = 480
    fx_px: Positive = 420.0
    fy_px: Positive = 420.0
    cx_px: float = 375.5
    cy_px: float = 239.5
    distortion: tuple[float, ...] = ()
    calibration_file: str | None = None
    position_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.05)
    mount_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    clock: Literal["autopilot", "monotonic", "arrival"] = "autopilot"
    delay_s: NonNegative = 0.0
    timeout_s: Positive = 0.5


class Marker(_Section, frozen=True):
    """One marker on the pad. Position is its centre in P (x along travel, y right), yaw about z down; at yaw 0 the top edge
    of its image points along +x. One that faces "back" stands upright on the deck, seen by a vehicle that comes from
    behind: position is the point of the deck below its centre, `height_m` the centre's height over the deck."""

    id: Annotated[int, Meta(ge=0)]
    size_m: Positive
    position_m: tuple[float, float] = (0.0, 0.0)
    yaw_deg: float = 0.0
    facing: Literal["up", "back"] = "up"
    height_m: NonNegative = 0.0


class Pad(_Section, frozen=True):
    """What is painted on the pad, and how large the deck is. `family` is one of OpenCV's marker families by name, or
    CIRCLE_CROSS, or RED_DISC. `deck_center_m` is the deck's centre in P where the landing point lies elsewhere;
    `board_size_m` (width, height) and `deck_brightness` (grey level) matter to whoever draws the pad."""

    family: str = "DICT_4X4_50"
    markers: tuple[Marker, ...] = (Marker(id=45, size_m=1.2), Marker(id=7, size_m=0.24))
    length_m: Positive = 1.5
    width_m: Positive = 1.5
    deck_height_m: NonNegative = 0.5
    deck_center_m: tuple[float, float] = (0.0, 0.0)
    board_size_m: tuple[float, float] | None = None
    deck_brightness: Positive = 225.0


class Vision(_Section, frozen=True):
    """Finding the pad in a frame. `stereo_baseline_m` is the distance between the two cameras of detector "stereo"."""

    detector: str = "aruco"
    camera: str = "down"
    refine: Literal["edges", "subpix", "none"] = "edges"
    track: bool = True
    pixel_sigma_px: Positive = 0.3
    max_reprojection_error_px: Positive = 3.0
    stereo_baseline_m: NonNegative = 0.0


class Estimation(_Section, frozen=True):
    """Where the pad is and will be. `lag_s` is how late a measurement may come and still be worked in; the vehicle sigmas
    say how far the autopilot's own estimate may be off (measured on a real PX4). `ground_down_m` is the pad's height in local
    NED, for the estimator that sees bearings only, until a range sensor tells better."""

    estimator: str = "imm"
    gate_probability: Annotated[float, Meta(gt=0.5, lt=1.0)] = 0.999
    history_s: Positive = 1.5
    lag_s: Positive = 1.0
    beacon_bias_sigma_m: Positive = 1.5
    beacon_bias_time_s: Positive = 60.0
    beacon_noise_sigma_m: Positive = 0.3
    vehicle_tilt_sigma_deg: NonNegative = 1.2
    vehicle_yaw_sigma_deg: NonNegative = 3.0
    vehicle_velocity_sigma_m_s: NonNegative = 0.3
    ground_down_m: float = 0.0
    lost_after_s: Positive = 15.0


class Planning(_Section, frozen=True):
    """The reference relative to the predicted pad, and what the sum of reference and pad motion may ask of the vehicle.

    `follower = "ground"` leaves a plan where it is until the pad has moved `deviation_threshold_m`. The two headings are for
    planners that leave and arrive along a direction, where the vehicle's velocity and the pad's say none."""

    planner: str = "bspline"
    follower: str = "pad"
    deviation_threshold_m: Positive = 1.0
    min_duration_s: Positive = 0.4
    start_heading_deg: float | None = None
    end_heading_deg: float | None = None
    degree: Annotated[int, Meta(ge=3, le=7)] = 3
    control_points: Annotated[int, Meta(ge=6, le=24)] = 10
    replan_hz: Positive = 10.0
    max_speed_m_s: Positive = 12.0
    max_climb_m_s: Positive = 2.5
    max_descent_m_s: Positive = 1.4
    max_acceleration_m_s2: Positive = 4.0
    max_jerk_m_s3: Positive = 20.0
    relative_speed_m_s: Positive = 4.0
    thrust_to_weight: Annotated[float, Meta(gt=1.0)] = 1.85
    min_thrust_to_weight: Fraction = 0.3
    max_body_rate_deg_s: Positive = 200.0
    end_times: Annotated[int, Meta(ge=1, le=1000)] = 40
    horizon_s: Positive = 12.0
    approach_directions: Annotated[int, Meta(ge=1, le=64)] = 5
    approach_speed_m_s: NonNegative = 0.2
    switch_distance_m: NonNegative = 0.1
    duration_weight: NonNegative = 2.0
    snap_threshold_m: Positive = 2.0
    snap_rounds: Annotated[int, Meta(ge=0, le=12)] = 4
    snap_split: Literal["all", "worst"] = "all"
    corridor_half_width_m: Positive = 1.5
    bezier_ratio: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5
    clearance_m: Positive = 0.5


class Control(_Section, frozen=True):
    """Reference and estimate to velocity setpoint. `trajectory_gain_hz` is that of `position_target` alone; of `guo` alone are
    `marker_ahead_m`, how far before the landing point the marker stands, and `max_axis_speed_m_s`, forward and sideways. The pad's
    heave is sent `vertical_lead_s` ahead: thrust answers at once where a lean takes time, and with the acceleration in the same
    setpoint what is sent too early arrives too early."""

    controller: str = "velocity"
    rate_hz: Positive = 50.0
    position_gain_hz: Positive = 1.8
    vertical_gain_hz: Positive = 1.2
    trajectory_gain_hz: Positive = 0.5
    damping: NonNegative = 0.5
    integral_gain_hz2: NonNegative = 0.15
    max_integral_m_s: NonNegative = 0.6
    lead_s: NonNegative = 0.3
    vertical_lead_s: NonNegative = 0.1
    acceleration_feedforward: bool = True
    acceleration_preview_s: NonNegative = 0.3
    max_acceleration_m_s2: Positive = 5.0
    demand_time_s: NonNegative = 0.4
    max_demand_m_s2: Positive = 5.0
    adaptive_bandwidth_hz: Positive = 0.1
    max_adaptive_m_s: NonNegative = 2.0
    marker_ahead_m: NonNegative = 0.0
    max_axis_speed_m_s: Positive = 0.7
    max_speed_m_s: Positive = 12.0
    max_climb_m_s: Positive = 3.0
    max_descent_m_s: Positive = 1.5
    max_slew_m_s2: Positive = 8.0
    yaw: str = "hold"
    yaw_gain_hz: Positive = 1.0
    max_yaw_rate_deg_s: Positive = 60.0
    setpoint_valid_s: Positive = 0.1


class Mission(_Section, frozen=True):
    """When to do what. Heights are above the pad unless a key says otherwise. `search_cone_s` is how long the search goes on
    drifting with the pad's last known velocity, `lost_action` what follows a search that found nothing; `commit_heave_m_s`
    and `commit_deck_tilt_deg` say which motion of the deck may be touched. From `bent_acceleration_m_s2` of the
    pad on, the descent waits at `straight_height_m` until it is below `straight_acceleration_m_s2`, at most for the first
    `straight_wait_s`. `sight = "beacon"` lets the pad's own report stand in for the camera: only where both positions are good to decimetres (RTK, a hall with localisation).
    `follow_to_the_end` lets the descent begin only when the plan to above the pad has been flown to its end. `follow_behind_m` puts
    the place to wait for the descent behind the pad instead of above it, for a camera that looks forward at an upright marker.
    `sight_lost_action` is what follows a descent without sight: climb and try again, or the autopilot's Hold until the pad is
    seen again. `approach_waypoints_m` (north, east in local NED) are flown in order after the start while nothing is known of
    the pad; the search then begins around the last."""

    start_wait_s: NonNegative = 5.0
    sight: Literal["camera", "beacon"] = "camera"
    follow_to_the_end: bool = False

    takeoff_height_m: Positive = 6.0
    approach_waypoints_m: tuple[tuple[float, float], ...] = ()
    search_height_m: Positive = 10.0
    search_radius_m: Positive = 25.0
    search_speed_m_s: Positive = 3.0
    search_spacing_m: Positive = 8.0
    search_pattern: Literal["expanding_square", "spiral", "lawnmower"] = "expanding_square"
    search_cone_s: NonNegative = 20.0
    search_time_s: Positive = 120.0
    lost_action: Literal["hold", "return"] = "hold"
    approach_height_m: Positive = 8.0
    follow_height_m: Positive = 5.0
    follow_behind_m: NonNegative = 0.0
    follow_radius_m: Positive = 0.5
    follow_speed_m_s: Positive = 0.6
    follow_time_s: NonNegative = 0.6
    cone_radius_m: Positive = 0.25
    cone_slope: NonNegative = 0.15
    descent_speed_m_s: Positive = 1.4
    final_descent_speed_m_s: Positive = 0.5
    press_speed_m_s: Positive = 1.4
    press_acceleration_m_s2: NonNegative = 2.0
    commit_height_m: Positive = 0.8
    commit_miss_m: Positive = 0.35
    commit_relative_speed_m_s: Positive = 0.6
    commit_tilt_deg: Positive = 25.0
    commit_heave_m_s: Positive = 0.6
    commit_deck_tilt_deg: Positive = 8.0
    bent_acceleration_m_s2: Positive = 1.7
    straight_acceleration_m_s2: Positive = 1.1
    straight_height_m: Positive = 2.0
    straight_wait_s: NonNegative = 12.0
    max_go_arounds: Annotated[int, Meta(ge=0)] = 4
    max_commit_s: Positive = 6.0
    blind_height_m: Positive = 0.5
    sight_time_s: NonNegative = 0.3
    vision_hold_s: Positive = 0.4
    vision_lost_descend_s: Positive = 2.5
    vision_lost_follow_s: Positive = 4.0
    sight_lost_action: Literal["go_around", "hold"] = "go_around"
    pad_lost_s: Positive = 10.0
    touchdown_time_s: Positive = 0.4
    vehicle_leg_height_m: NonNegative = 0.22
    vehicle_foot_radius_m: NonNegative = 0.2
    disarm: Literal["auto", "force", "never"] = "auto"


class Zone(_Section, frozen=True):
    """Where not to land ("no_land") or not to fly ("no_fly"): a circle (centre and radius) or a polygon. In metres north and
    east in local NED, or in degrees (latitude, longitude), placed around the autopilot's home."""

    name: str = "a zone"
    kind: Literal["no_land", "no_fly"] = "no_land"
    center_m: tuple[float, float] | None = None
    center_deg: tuple[float, float] | None = None
    radius_m: Positive | None = None
    polygon_m: tuple[tuple[float, float], ...] = ()
    polygon_deg: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        centres = [centre for centre in (self.center_m, self.center_deg) if centre is not None]
        polygons = [polygon for polygon in (self.polygon_m, self.polygon_deg) if polygon]
        if len(centres) + len(polygons) != 1:
            raise ValueError("a zone needs exactly one of center_m, center_deg, polygon_m, polygon_deg")
        if bool(centres) != (self.radius_m is not None):
            raise ValueError("a zone needs radius_m with a centre, and with nothing else")
        if any(len(polygon) < 3 for polygon in polygons):
            raise ValueError("a zone's polygon needs three corners or more")


class Safety(_Section, frozen=True):
    """Limits that end a landing attempt. `only_the_pad_is_land`: all else is water. After `stall_hold_s` without a tick or a
    plan the vehicle is held relative to the pad, after `stall_silence_s` nothing is sent until a person says START."""

    ceiling_m: Positive = 60.0
    geofence_radius_m: Positive = 500.0
    min_battery: Fraction = 0.2
    max_flight_time_s: Positive = 600.0
    stall_hold_s: Positive = 0.3
    stall_silence_s: Positive = 1.0
    only_the_pad_is_land: bool = False
    zones: tuple[Zone, ...] = ()


class Guidance(_Section, frozen=True):
    """With a `form`, Companion flies nothing: it tells the autopilot's own precision landing where the pad is (LANDING_TARGET),
    as often as `rate_hz` and only while a camera has seen the pad within `sight_age_s` (docs/guidance.md)."""

    form: Literal["off", "px4", "ardupilot", "ardupilot_angles"] = "off"
    rate_hz: Positive = 20.0
    sight_age_s: Positive = 0.4


class Mqtt(_Section, frozen=True):
    """Telemetry to a broker, commands and pad beacon from it (docs/mqtt.md). The password stands in a file of its own, so
    that it does not end up in run folders. A broker elsewhere needs `tls` and `user`, or `insecure` where one knows better.
    """

    enabled: bool = False
    host: str = "127.0.0.1"
    port: Port = 1883
    tls: bool = False
    ca_file: str | None = None
    certificate_file: str | None = None
    key_file: str | None = None
    user: str | None = None
    password_file: str | None = None
    insecure: bool = False
    prefix: Annotated[str, Meta(pattern="^[^/+#$][^+#]*$", max_length=200)] = "companion"
    client_id: str = ""
    accept: tuple[Literal["command", "pad"], ...] = ("command", "pad")
    queue: Annotated[int, Meta(ge=1, le=100_000)] = 256
    keepalive_s: Annotated[int, Meta(ge=2, le=3600)] = 10
    timeout_s: Positive = 3.0
    max_backoff_s: Positive = 15.0


class Dashboard(_Section, frozen=True):
    """The page in a browser (docs/dashboard.md). `token_file` holds the token; without one, a new token is made for every
    run. An address that is not this computer's own needs `certificate_file` and `key_file`, or `insecure`."""

    enabled: bool = False
    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)] = 8080
    token_file: str | None = None
    certificate_file: str | None = None
    key_file: str | None = None
    insecure: bool = False
    rate_hz: Annotated[float, Meta(gt=0.0, le=30.0)] = 10.0


class Config(_Section, frozen=True):
    """All of it."""

    link: Link = Link()
    cameras: dict[str, Camera] = msgspec.field(default_factory=lambda: {"down": Camera()})
    pad: Pad = Pad()
    vision: Vision = Vision()
    estimation: Estimation = Estimation()
    planning: Planning = Planning()
    control: Control = Control()
    mission: Mission = Mission()
    safety: Safety = Safety()
    guidance: Guidance = Guidance()
    mqtt: Mqtt = Mqtt()
    dashboard: Dashboard = Dashboard()


def load(files: Sequence[Path] = (), overrides: Mapping[str, str] | None = None) -> Config:
    """Defaults, then each file in order, then `section.key=value` overrides; ConfigError says what is wrong and where."""
    return load_with(files, {key: parse_value(text) for key, text in (overrides or {}).items()})


def load_with(files: Sequence[Path], overrides: Mapping[str, Any]) -> Config:
    """As `load`, with values instead of text."""
    merged: dict[str, Any] = {}
    origin = "defaults"
    for path in files:
        origin = str(path)
        merged = _overlay(merged, _beside(path, read_toml(path)))
        _convert(merged, origin)
    for key, value in overrides.items():
        origin = f"override {key}={value}"
        merged = _overlay(merged, _nested(key, value))
    return _calibrated(_convert(merged, origin))


def read_toml(path: Path) -> dict[str, Any]:
    """The file as a dictionary; ConfigError where it cannot be read or is not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text (byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not valid TOML: {error}") from error


def _beside(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Names of calibration files and of the signing key, seen from the file that names them."""
    link = data.get("link")
    if isinstance(link, dict) and isinstance(name := link.get("signing_key_file"), str):
        link["signing_key_file"] = str(path.parent / name)
    cameras = data.get("cameras")
    for camera in cameras.values() if isinstance(cameras, dict) else ():
        if isinstance(camera, dict) and isinstance(name := camera.get("calibration_file"), str):
            camera["calibration_file"] = str(path.parent / name)
    return data


def _calibrated(config: Config) -> Config:
    """Cameras with what their calibration files say."""
    cameras = {}
    for name, camera in config.cameras.items():
        try:
            cameras[name] = calibrated(camera)
        except CalibrationError as error:
            raise ConfigError(f"[cameras.{name}] calibration_file: {error}") from error
    return msgspec.structs.replace(config, cameras=cameras)


def calibrated(camera: Camera) -> Camera:
    """The camera with the lens of its `calibration_file`, itself where it names none. CalibrationError as `camera_info.read`."""
    return with_lens(camera, camera_info.read(Path(camera.calibration_file))) if camera.calibration_file else camera


def with_lens(camera: Camera, lens: CameraInfo) -> Camera:
    """The configured camera with the calibrated lens in place of its own."""
    return msgspec.structs.replace(
        camera,
        model=lens.model,
        width_px=lens.width_px,
        height_px=lens.height_px,
        fx_px=lens.fx_px,
        fy_px=lens.fy_px,
        cx_px=lens.cx_px,
        cy_px=lens.cy_px,
        distortion=lens.distortion,
    )


def parse_value(text: str) -> Any:
    """A TOML value from the command line; bare words are strings."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _nested(dotted: str, value: Any) -> dict[str, Any]:
    for key in reversed(dotted.split(".")):
        value = {key: value}
    return dict(value)


def _overlay(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merge, everything else is replaced."""
    result = dict(base)
    for key, value in top.items():
        below = result.get(key)
        both_tables = isinstance(value, Mapping) and isinstance(below, Mapping)
        result[key] = _overlay(below, value) if both_tables else value  # type: ignore[arg-type]
    return result


def _convert(data: Mapping[str, Any], origin: str) -> Config:
    problems = [text for section, content in data.items() for text in _section_problems(section, content, origin)]
    if problems:
        raise ConfigError("\n".join(problems))
    return msgspec.convert(data, Config)


_SECTIONS: dict[str, Any] = {field.name: field.type for field in msgspec.structs.fields(Config)}


def _section_problems(section: str, content: Any, origin: str) -> list[str]:
    """Each section is checked alone, so that several mistakes show at once."""
    if section not in _SECTIONS:
        return [f"{origin}: [{section}] is not a section; {_allowed(section, _SECTIONS)}"]
    unknown = _unknown_keys(section, content, origin)
    if unknown:
        return unknown
    if section == "cameras" and isinstance(content, Mapping):
        return [text for name, table in content.items() for text in _problem(f"cameras.{name}", table, Camera, origin)]
    return _problem(section, content, _SECTIONS[section], origin)


def _problem(name: str, content: Any, kind: Any, origin: str) -> list[str]:
    try:
        msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        return [_explain(name, content, str(error), origin)]
    return []


def _unknown_keys(section: str, content: Any, origin: str) -> list[str]:
    tables = (
        {f"cameras.{name}": value for name, value in content.items()} if section == "cameras" else {section: content}
    )
    struct = Camera if section == "cameras" else _SECTIONS[section]
    known = [field.encode_name for field in msgspec.structs.fields(struct)]
    return [
        f"{origin}: [{name}] {key} = {value!r} is not a key; {_allowed(key, known)}"
        for name, table in tables.items()
        if isinstance(table, Mapping)
        for key, value in table.items()
        if key not in known
    ]


def _explain(section: str, content: Any, error: str, origin: str) -> str:
    """msgspec says what is expected and where (`$.key[0]`); add the file and the value that stands there."""
    expected, _, where = error.partition(" - at `$")
    path = where.rstrip("`").lstrip(".")
    value: Any = content
    for part in path.replace("[", ".").replace("]", "").split("."):
        if isinstance(value, Mapping) and part in value:
            value = value[part]
        elif isinstance(value, Sequence) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
    return f"{origin}: [{section}] {path} = {value!r}: {expected[:1].lower()}{expected[1:]}"


def _allowed(name: str, known: Any) -> str:
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}allowed: {', '.join(names)}"
