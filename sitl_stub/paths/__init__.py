"""Motions of a carrier in the plane, one per file, chosen by `[path] kind` of a scenario."""

from sitl_stub.paths.circle import CircleSettings
from sitl_stub.paths.figure8 import Figure8Settings
from sitl_stub.paths.line import LineSettings
from sitl_stub.paths.random_turns import RandomTurnsSettings
from sitl_stub.paths.recorded import RecordedSettings
from sitl_stub.paths.reference import Path, PathReference
from sitl_stub.paths.still import StillSettings
from sitl_stub.paths.stop_and_go import StopAndGoSettings
from sitl_stub.paths.waypoints import WaypointsSettings
from sitl_stub.section import Section

PathSettings = (
    StillSettings
    | LineSettings
    | CircleSettings
    | Figure8Settings
    | WaypointsSettings
    | StopAndGoSettings
    | RandomTurnsSettings
    | RecordedSettings
)

PATHS: dict[str, type[Section]] = {
    "still": StillSettings,
    "line": LineSettings,
    "circle": CircleSettings,
    "figure8": Figure8Settings,
    "waypoints": WaypointsSettings,
    "stop_and_go": StopAndGoSettings,
    "random_turns": RandomTurnsSettings,
    "recorded": RecordedSettings,
}

__all__ = ["PATHS", "Path", "PathReference", "PathSettings"]
