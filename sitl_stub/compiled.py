"""Compiles a kernel where numba is installed (the extra `fast`) and leaves it alone where it is not.

A kernel is a function over floats, tuples of floats and flat arrays; the functions it calls are marked `used_by_kernels` and stay
plain for everybody else. Same operations in the same order either way (no fast-math, no fused multiply-add), so that both give the
same bytes. Numba's own NUMBA_DISABLE_JIT=1 keeps everything plain.
"""

from __future__ import annotations

import importlib
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

numba: Any
try:
    numba = importlib.import_module("numba")
except ImportError:  # the extra is optional
    numba = None

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILED: bool = numba is not None and not numba.config.DISABLE_JIT
"""True where kernels run as machine code."""


def compiled(function: Function) -> Function:
    """The kernel, compiled at its first call if that is possible."""
    if not COMPILED:
        return function
    kernel = numba.njit(cache=True, error_model="numpy")(function)
    # Numba looks at the date of the kernel's own file only; here a change of any file it may call counts.
    kernel._cache._cache_file._source_stamp = _source_stamp()
    return cast(Function, kernel)


def used_by_kernels(function: Function) -> Function:
    """A plain function that kernels may call."""
    return cast(Function, numba.extending.register_jitable(function)) if COMPILED else function


def room(values: list[Any] | tuple[Any, ...]) -> Any:
    """Floats for a kernel to work on: an array for a compiled one, a list (faster by element) for a plain one."""
    return np.array(values) if COMPILED else values


@cache
def _source_stamp() -> tuple[int, int]:
    """Checksum and size of all files with code for kernels."""
    here = Path(__file__).parent
    texts = [path.read_bytes() for folder in (here, here / "autopilot") for path in sorted(folder.glob("*.py"))]
    kernels = b"".join(text for text in texts if b"import used_by_kernels" in text or b"compiled import" in text)
    return zlib.crc32(kernels), len(kernels)
