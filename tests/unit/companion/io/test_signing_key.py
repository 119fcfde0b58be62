"""Key files: raw, hexadecimal, and what is no key."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from companion.config import ConfigError
from companion.io.signing_key import read_signing
from companion.mavlink import codec, dialect

KEY = bytes(range(32))


@pytest.mark.parametrize("content", [KEY, KEY.hex().encode() + b"\n", KEY.hex().upper().encode()])
def test_raw_and_hexadecimal_keys_sign_for_each_other(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "raw").write_bytes(KEY)
    (tmp_path / "key").write_bytes(content)
    now_ns = time.monotonic_ns()
    frame = read_signing(tmp_path / "raw").signed(codec.encode(dialect.Timesync(1, 2), 0, 1, 1), 34, now_ns)
    assert read_signing(tmp_path / "key").accepts(frame, now_ns)


@pytest.mark.parametrize("content", [b"", b"secret", KEY + b"\n", KEY.hex().encode()[:-2], b"zz" * 32])
def test_what_is_no_key_is_a_configuration_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "key").write_bytes(content)
    with pytest.raises(ConfigError, match="64 hexadecimal digits"):
        read_signing(tmp_path / "key")


def test_a_missing_file_is_a_configuration_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_signing(tmp_path / "nowhere")
