"""Compiling the numerical kernels with numba: once per machine, announced when it happens."""

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])


class _Announcement(event.Listener):  # type: ignore[misc]  # numba ships no types
    """Says on the terminal why the first call takes seconds."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: Any) -> None:
        ours = event.data["dispatcher"].py_func.__module__.startswith("selfmotion")
        if ours and not self._said:
            self._said = True
            sys.stderr.write("selfmotion: compiling numerical kernels, once per machine …\n")
            sys.stderr.flush()

    def on_end(self, event: Any) -> None:
        pass


def kernel(function: Function) -> Function:
    """Compile `function` with numba, cached on disk where a folder for that can be written."""
    try:
        return numba.njit(cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]
    except RuntimeError:
        # "no locator available": neither the package folder nor HOME is writable
        return numba.njit(error_model="numpy")(function)  # type: ignore[no-any-return]


event.register("numba:compile", _Announcement())
