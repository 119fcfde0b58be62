"""CRC-16/MCRF4XX, the checksum of MAVLink, at C speed from the standard library.

`binascii.crc_hqx` is the same polynomial (0x1021) with the bits of each byte the other way round, so bytes are mirrored going in
and the result is mirrored coming out.
"""

from __future__ import annotations

from binascii import crc_hqx

_MIRROR = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def crc16(data: bytes) -> int:
    """Checksum of `data` (frame without its start byte, followed by the message's CRC_EXTRA byte)."""
    return int.from_bytes(crc16_bytes(data), "little")


def crc16_bytes(data: bytes) -> bytes:
    """The same as it stands in a frame, low byte first."""
    return crc_hqx(data.translate(_MIRROR), 0xFFFF).to_bytes(2, "big").translate(_MIRROR)
