"""What the simulated cameras see. `PROJECTIONS` maps the `model` of a camera to its geometry; camera.py puts it together."""

from __future__ import annotations

from sitl_stub.camera.kannala_brandt import kannala_brandt
from sitl_stub.camera.pinhole import pinhole
from sitl_stub.camera.projection import ProjectionFactory
from sitl_stub.camera.scaramuzza import scaramuzza

PROJECTIONS: dict[str, ProjectionFactory] = {
    "pinhole": pinhole,
    "kannala_brandt": kannala_brandt,
    "scaramuzza": scaramuzza,
}
