"""Compiles a kernel where numba is installed (the extra `fast`) and leaves it alone where it is not.

A kernel is a function over floats and flat arrays that calls only kernels of its own file: numba's cache looks at the date of
that one file. It does the same operations in the same order either way, so that both give the same decisions.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
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
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))


def room(values: list[float]) -> Any:
    """Floats for a kernel to work on: an array for a compiled one, a list (faster by element) for a plain one."""
    return np.array(values) if COMPILED else values
