"""Work during which nobody looks for reference cycles: a replay, a flight of a campaign.

They make none (tests hold that), what they make lives as long as they do, and the search for cycles goes through all of it again
and again: a twentieth of a flight, a tenth of a replay.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Reference counting alone; afterwards as it was before."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
