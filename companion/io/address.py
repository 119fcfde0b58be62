"""Link URLs: scheme, host or device, and a number (port or baud rate)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from companion.io.link import LinkError


@dataclass(frozen=True, slots=True)
class Address:
    """`serial:///dev/ttyAMA0:921600` is ("serial", "/dev/ttyAMA0", 921600)."""

    scheme: str
    place: str
    number: int

    def __str__(self) -> str:
        return f"{self.scheme}://{self.place}:{self.number}"


def parse_address(url: str, schemes: Collection[str]) -> Address:
    """LinkError with what is allowed where the URL cannot be read."""
    scheme, separator, rest = url.partition("://")
    if not separator or scheme not in schemes:
        raise LinkError(f"{url!r}: a link is one of {', '.join(f'{name}://' for name in schemes)}")
    is_serial = scheme.endswith("serial")
    place, _, digits = rest.rpartition(":")
    if not place or not digits.isdecimal():
        form = f"{scheme}:///dev/ttyAMA0:921600" if is_serial else f"{scheme}://127.0.0.1:14540"
        raise LinkError(f"{url!r}: must be written like {form}")
    number = int(digits)
    if not is_serial and not 1 <= number <= 65535:
        raise LinkError(f"{url!r}: port {number} is not in 1..65535")
    return Address(scheme, place if is_serial else place.strip("[]"), number)
