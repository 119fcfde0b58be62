"""Base of every table of a scenario file: frozen, keyword only, and an unknown key is an error.

Units stand in the key names. Angles are degrees in files (`_deg`) and radians everywhere else.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0.0)]
NonNegative = Annotated[float, Meta(ge=0.0)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=1)]


class Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One table of a scenario file."""
