"""Kernels as they are compiled, or as they are written."""

from collections.abc import Callable
from typing import Any

import numba


def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that kernels call as they have it, not as Python runs it."""
    function: Callable[..., Any] = numba.njit(error_model="numpy")(lambda *given: kernel(*given))
    return function
