"""Compiling the numerical kernels with numba: once per machine, announced when it happens."""

import contextlib
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import event

_Function = TypeVar("_Function", bound=Callable[..., Any])


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


def kernel(function: _Function) -> _Function:
    """Compile a numeric function when it is first called.

    The machine code is kept in numba's cache; where neither the package folder nor the user's
    cache folder can be written, each process compiles anew. Division follows NumPy (no error).
    With NUMBA_DISABLE_JIT=1 kernels run as they are written, for a debugger.
    """
    if numba.config.DISABLE_JIT:
        return function
    try:
        compiled: _Function = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        compiled = numba.njit(cache=False, error_model="numpy")(function)
    else:
        _forgive(compiled)
    return compiled


def _forgive(compiled: Any) -> None:
    """Let a cache that is damaged, or on a full disk, cost time instead of the run."""
    cache = compiled._cache
    load, save = cache.load_overload, cache.save_overload

    def load_or_compile(*given: Any) -> Any:
        # A garbled file raises whatever unpickling it meets.
        try:
            return load(*given)
        except Exception:
            with contextlib.suppress(OSError):
                cache.flush()
            return None

    def save_if_possible(*given: Any) -> None:
        with contextlib.suppress(OSError):
            save(*given)

    cache.load_overload, cache.save_overload = load_or_compile, save_if_possible


def inlined(function: _Function) -> _Function:
    """Make a small numeric function one that kernels can call: LLVM puts it into each of them.

    It has no wrapper for Python, which spares a good part of its compilation; from Python it runs
    as it is written, uncompiled. Division in kernels follows NumPy.
    """
    return _callable(function, forced=True)


def called(function: _Function) -> _Function:
    """Make a longer numeric function one that kernels can call.

    Like `inlined`, but LLVM puts it where that pays: longer ones in each place take seconds to
    compile, and run no faster.
    """
    return _callable(function, forced=False)


def _callable(function: _Function, *, forced: bool) -> _Function:
    made: _Function = numba.extending.register_jitable(
        error_model="numpy", forceinline=forced, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )(function)
    return made


event.register("numba:compile", _Announcement())
