"""Compiles a kernel where numba is installed (the extra `fast`) and leaves it alone where it is not.

A kernel is a function over floats and flat arrays. It runs the same statements either way, without reordering of floating
point operations, so that both give the same decisions. Machine code is cached beside the source.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, TypeVar, cast

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
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
