"""Compiling the numerical kernels with numba: once per machine, announced when it happens.

No two processes compile the same kernel: the second one waits for the first, and compiles others in
the meantime. So a second process that starts with the largest kernels does about half of the work.
"""

import contextlib
import hashlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache as cached
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import numba
import numpy as np
from llvmlite.binding import get_host_cpu_features
from numba.core import event

_Function = TypeVar("_Function", bound=Callable[..., Any])


# Target processor of the kernels in a prebuilt wheel; written by `build_kernels.py`.
BUILT_FOR = Path(__file__).parents[1] / "kernels.json"


def use_built_kernels(file: Path = BUILT_FOR) -> bool:
    """Make numba use the target processor of a prebuilt wheel; return whether it does.

    Only if this processor has its features, and no other target is configured. Otherwise kernels
    are compiled for this processor.
    """
    if numba.config.CPU_NAME is not None:
        return False
    try:
        built = json.loads(file.read_text())
        cpu, features = str(built["cpu"]), str(built["features"])
    except (OSError, ValueError, KeyError, TypeError):
        return False
    here = get_host_cpu_features()
    if not all(here.get(name.removeprefix("+")) for name in features.split(",") if name):
        return False
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = cpu, features
    return True


use_built_kernels()


class _ReentrantTimer:
    """Time spent compiling and loading, by a clock; nested use counts once."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._ended, self._depth, self._began = 0.0, 0, 0.0

    @property
    def seconds(self) -> float:
        """Time so far [s], including the present interval."""
        return self._ended + (self._clock() - self._began if self._depth else 0.0)

    def __enter__(self) -> None:
        if not self._depth:
            self._began = self._clock()
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if not self._depth:
            self._ended += self._clock() - self._began


_spent, _waited = _ReentrantTimer(time.process_time), _ReentrantTimer(time.monotonic)


def seconds_of_kernels() -> float:
    """Return the processor time [s] of this process for compiling and loading kernels.

    Limits of processor time leave it out: it occurs once.
    """
    return _spent.seconds


def seconds_waited_for_kernels() -> float:
    """Return the time [s] that this process has waited for kernels.

    By the clock, including the time in which another process compiled them; estimates of remaining
    time exclude it.
    """
    return _waited.seconds


class _Announcement(event.Listener):  # type: ignore[misc]  # numba ships no types
    """Prints on the terminal why the first call takes seconds."""

    def __init__(self) -> None:
        self._is_printed = False

    def on_start(self, event: Any) -> None:
        _spent.__enter__()
        _waited.__enter__()
        ours = event.data["dispatcher"].py_func.__module__.startswith("selfmotion")
        if ours and not self._is_printed:
            self._is_printed = True
            sys.stderr.write(
                "selfmotion: compiling numerical kernels for this kind of problem, once per "
                "machine (`selfmotion warm-up` compiles all) …\n"
            )
            sys.stderr.flush()
            other = compile_in_background(FIRST_WORKS)
            if other is not None:
                # Nobody else waits for the process that ends.
                threading.Thread(target=other.communicate, daemon=True).start()

    def on_end(self, event: Any) -> None:
        _spent.__exit__()
        _waited.__exit__()


def kernel(function: _Function) -> _Function:
    """Compile a numeric function when it is first called.

    The machine code is stored in numba's cache; if neither the package folder nor the user's cache
    folder is writable, each process compiles anew. Division follows NumPy (no error). With
    NUMBA_DISABLE_JIT=1 kernels are interpreted, for a debugger.
    """
    if numba.config.DISABLE_JIT:
        # As compiled: what is not finite is found in what a kernel returns, and warned of nowhere.
        interpreted: _Function = np.errstate(all="ignore")(function)
        return interpreted
    try:
        compiled: _Function = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        compiled = numba.njit(cache=False, error_model="numpy")(function)
    else:
        _make_cache_robust(compiled)
    return compiled


def _make_cache_robust(compiled: Any) -> None:
    """Make a damaged cache, or a full disk, cause compilation and no error.

    Loading also takes the lock between processes, and extends numba's stamp of the sources.
    """
    cache = compiled._cache
    load, save = cache.load_overload, cache.save_overload
    lock = contextlib.ExitStack()
    # Functions that it calls may be defined later in its module.
    is_stamped = False

    def stamp() -> None:
        nonlocal is_stamped
        if not is_stamped:
            is_stamped = True
            file = cache._cache_file
            file._source_stamp = file._source_stamp, source_stamp(compiled.py_func)

    def load_if_possible(*given: Any) -> Any:
        # A damaged file raises any exception of unpickling.
        try:
            return load(*given)
        except Exception:
            with contextlib.suppress(OSError):
                cache.flush()
            return None

    def load_or_compile(*given: Any) -> Any:
        with _spent, _waited:
            stamp()
            return load_locked(*given)

    def load_locked(*given: Any) -> Any:
        found = load_if_possible(*given)
        if found is None:
            # After an interruption the lock is still held.
            lock.close()
            lock.enter_context(_compile_lock(cache))
            found = load_if_possible(*given)
        if found is not None:
            lock.close()
        return found

    def save_if_possible(*given: Any) -> None:
        with lock, contextlib.suppress(OSError):
            save(*given)

    cache.load_overload, cache.save_overload = load_or_compile, save_if_possible


def source_stamp(function: Callable[..., Any]) -> str:
    """Return a digest of all that a kernel is compiled of: its file, and those that it calls into.

    Numba's own stamp is of the kernel's file alone: after a change of a function or a number that
    it takes from another file, in an upgrade too, the old code would run on.
    """
    files, constants, seen = set[str](), list[str](), set[object]()
    _collect(function, files, constants, seen)
    parts = sorted(map(_digest_of_source, files)) + sorted(constants)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _collect(function: Any, files: set[str], constants: list[str], seen: set[object]) -> None:
    """Collect source files and constants of a function and of all functions of ours it calls."""
    function = getattr(function, "py_func", function)
    if not isinstance(function, FunctionType) or function in seen:
        return
    seen.add(function)
    files.add(function.__code__.co_filename)
    package, names = function.__module__.partition(".")[0], _names(function.__code__)
    # Also attributes of our modules that the code uses.
    found = {name: function.__globals__[name] for name in names & function.__globals__.keys()}
    for module in [x for x in found.values() if isinstance(x, ModuleType)]:
        if module.__name__.partition(".")[0] == package:
            found |= {
                f"{module.__name__}.{n}": vars(module)[n] for n in names & vars(module).keys()
            }
    for name, value in found.items():
        if isinstance(value, int | float | str | tuple):
            constants.append(f"{name} = {value!r}")
        elif str(getattr(value, "__module__", "")).partition(".")[0] == package:
            _collect(value, files, constants, seen)


def _names(code: CodeType) -> set[str]:
    """Return the names that code uses, with the code within it."""
    inner = [x for x in code.co_consts if isinstance(x, CodeType)]
    return set(code.co_names).union(*map(_names, inner))


@cached
def _digest_of_source(file: str) -> str:
    """Return the digest of a file; "" of one within an archive, which numba's own stamp covers."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ""


_meanwhile: list[Callable[[], object]] = []


def meanwhile(work: Callable[[], object]) -> Callable[[], object]:
    """Register a function to call while waiting for another process.

    It calls kernels that are needed soon, and so compiles them.
    """
    _meanwhile.append(work)
    return work


@contextlib.contextmanager
def _compile_lock(cache: Any) -> Iterator[None]:
    """Wait until no other process compiles the same kernel; the lock ends with its process."""
    with contextlib.ExitStack() as opened:
        if sys.platform != "win32":
            import fcntl

            # Where there are no locks, both compile.
            with contextlib.suppress(OSError):
                cache._impl.locator.ensure_cache_path()
                file = opened.enter_context(open(cache._cache_file._index_path + ".lock", "w"))
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    while _meanwhile:
                        _meanwhile.pop(0)()
                    fcntl.flock(file, fcntl.LOCK_EX)
        yield


# Kernels of a first plan.
FIRST_WORKS = "first"
# All kernels.
ALL_WORKS = "all"
_IS_ALONE = False


def compile_in_background(works: str) -> "subprocess.Popen[str] | None":
    """Compile kernels in another process, in parallel; it prints their number.

    Those of `FIRST_WORKS` or `ALL_WORKS`, see `selfmotion.realtime.warm`. None with a single
    processor, or without a cache.
    """
    if _IS_ALONE or os.cpu_count() == 1 or numba.config.DISABLE_JIT or not sys.executable:
        return None
    package = str(Path(__file__).parents[2])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    try:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "selfmotion.realtime.warm", works],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
    except OSError:
        return None


def compile_alone() -> None:
    """Start no other process when something is compiled, and print nothing."""
    global _IS_ALONE
    _IS_ALONE = True
    event.unregister("numba:compile", _announcement)


def inlined(function: _Function) -> _Function:
    """Make a small numeric function callable from kernels, always inlined by LLVM.

    It has no wrapper for Python, which saves much of its compilation; from Python it runs
    uncompiled. Division in kernels follows NumPy.
    """
    return _callable(function, forced=True)


def called(function: _Function) -> _Function:
    """Make a longer numeric function callable from kernels, inlined where LLVM finds it worthwhile.

    Inlining longer ones everywhere takes seconds to compile, and runs no faster.
    """
    return _callable(function, forced=False)


def _callable(function: _Function, *, forced: bool) -> _Function:
    compiled: _Function = numba.extending.register_jitable(
        error_model="numpy", forceinline=forced, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )(function)
    return compiled


_announcement = _Announcement()
event.register("numba:compile", _announcement)
