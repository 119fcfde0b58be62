"""One UDP link of the server as an option: its name and its ports."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkOptions:
    """The port that is bound, and where datagrams go until somebody has spoken."""

    name: str
    local_port: int
    remote_port: int


PX4_LINKS = (LinkOptions("onboard", 14580, 14540), LinkOptions("ground", 18570, 14550))
"""As a stock PX4 SITL, instance 0."""
