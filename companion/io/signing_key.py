"""The key file of MAVLink 2 signing: 32 bytes, or 64 hexadecimal digits as ground stations show them."""

from __future__ import annotations

import time
from pathlib import Path

from companion.config import ConfigError, Link
from companion.mavlink.signing import KEY_BYTES, Signing


def signing_of(link: Link) -> Signing | None:
    """What the section asks for; None where it names no key. ConfigError where the file holds none."""
    return None if link.signing_key_file is None else read_signing(Path(link.signing_key_file))


def read_signing(path: Path) -> Signing:
    """Signing with the key in the file, its timestamps from the wall clock now. ConfigError where there is no key."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: signing key cannot be read: {error.strerror}") from error
    return Signing(_key(raw, path), unix_ns=time.time_ns(), now_ns=time.monotonic_ns())


def _key(raw: bytes, path: Path) -> bytes:
    if len(raw) == KEY_BYTES:
        return raw
    try:
        key = bytes.fromhex(raw.decode("ascii").strip())
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise ConfigError(f"{path}: a signing key is {KEY_BYTES} bytes or {2 * KEY_BYTES} hexadecimal digits")
    return key
