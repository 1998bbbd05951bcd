"""Compiled functions, kept on disk where that is possible."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a numeric function when it is first called.

    The machine code is kept in numba's cache; where neither the package folder nor the user's
    cache folder can be written, each process compiles anew.
    """
    try:
        compiled: _Function = numba.njit(cache=True)(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        compiled = numba.njit(cache=False)(function)
    return compiled
