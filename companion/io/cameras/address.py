"""What stands in a camera's URL: a place and options."""

from __future__ import annotations

from collections.abc import Collection
from urllib.parse import parse_qsl, unquote, urlsplit

from companion.io.cameras.frame import CameraError


def split(url: str) -> tuple[str, dict[str, str]]:
    """`file://a/b.mp4?pace=1` is ("a/b.mp4", {"pace": "1"}); relative and absolute places both work."""
    parts = urlsplit(url)
    return unquote(parts.netloc + parts.path), dict(parse_qsl(parts.query, keep_blank_values=True))


def refuse_unknown(url: str, options: Collection[str], known: Collection[str]) -> None:
    """CameraError with what is allowed: a misspelt option that is ignored costs a day."""
    for key in options:
        if key not in known:
            raise CameraError(f"{url}: {key!r} is not an option; allowed: {', '.join(known) or 'none'}")


def numbers(url: str, options: dict[str, str]) -> dict[str, float]:
    """All values as positive numbers; CameraError names the one that is none."""
    values: dict[str, float] = {}
    for key, text in options.items():
        try:
            values[key] = float(text)
        except ValueError:
            values[key] = -1.0
        if not 0.0 < values[key] < 1e9:
            raise CameraError(f"{url}: {key} = {text!r} must be a positive number")
    return values
