"""What carries the pad, one carrier per file, chosen by `[carrier] kind` of a scenario."""

from sitl_stub.carriers.boat import BoatSettings
from sitl_stub.carriers.motion import Carrier, CarrierMotion
from sitl_stub.carriers.rover import RoverSettings
from sitl_stub.carriers.still import StillCarrierSettings
from sitl_stub.carriers.truck import TruckSettings
from sitl_stub.section import Section

CarrierSettings = StillCarrierSettings | RoverSettings | TruckSettings | BoatSettings

CARRIERS: dict[str, type[Section]] = {
    "still": StillCarrierSettings,
    "rover": RoverSettings,
    "truck": TruckSettings,
    "boat": BoatSettings,
}

__all__ = ["CARRIERS", "Carrier", "CarrierMotion", "CarrierSettings"]
