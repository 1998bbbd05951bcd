"""Progress, counters and interruption of long work; threads of linear algebra."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import FrameType
from typing import Any

from selfmotion.basics.arrays import as_called

Progress = Callable[[str, int, int], object]
"""Called with a stage, how much of it has begun, and of how many: ``("start", 3, 24)``.

Of 0 where that is not known. Number 0 of 0 is no stage but news: what is known already, long before
all is done, such as that no motion passes some pose of the path. It may raise `KeyboardInterrupt`
to stop the work, as the keyboard does.
"""


class _Silent:
    """Progress without output; an object, so that signatures show it as `silent`."""

    def __call__(self, *obeyed: object) -> None:
        pass

    def __repr__(self) -> str:
        return "silent"


silent = _Silent()


# Work done, counted where it is done.


@dataclass
class Counts:
    """Work done over all starts and grids; whoever works adds to it.

    Attributes
    ----------
    evaluations, gradients : int
        Number of evaluations of F and ∇F.
    jacobians : int
        Number of evaluations of the frame Jacobian by Pinocchio.
    """

    evaluations: int = 0
    gradients: int = 0
    jacobians: int = 0

    def evaluated(self) -> None:
        """Count the start of an evaluation of F."""
        self.evaluations += 1


# Ctrl-C while compiled code runs: noted at once, obeyed between two steps of the work.
#
# Python raises KeyboardInterrupt wherever the main thread happens to be. Within the call of a
# compiled kernel that ends as a fault of the call (`SystemError`: a result with an exception
# set), within its compilation it is lost.


class _Interruption:
    """Whether Ctrl-C was pressed, and is not obeyed yet."""

    def __init__(self) -> None:
        self.noted, self.count = False, 0

    def note(self, number: int, frame: FrameType | None) -> None:
        """Note it; the second time, obey at once."""
        self.count += 1
        if self.noted:
            raise KeyboardInterrupt
        self.noted = True


_pressed = _Interruption()


@contextmanager
def held_interruption() -> Iterator[None]:
    """Within this, Ctrl-C is obeyed where `obey_interruption` is called; at once the second time.

    In the main thread, and unless the signal has another handler; nothing changes elsewhere. A
    pending interruption is raised at the end.

    Raises
    ------
    KeyboardInterrupt
        See above.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _pressed.note)
    try:
        yield
        obey_interruption()
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _pressed.noted = False


def obey_interruption() -> None:
    """Raise KeyboardInterrupt, once, if Ctrl-C was pressed."""
    if was_interrupted():
        raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Return, once, whether Ctrl-C was pressed and is not obeyed yet."""
    noted, _pressed.noted = _pressed.noted, False
    return noted


def presses() -> int:
    """Return the number of held Ctrl-C so far, for code that stops by itself."""
    return _pressed.count


def obeying(progress: Progress) -> Progress:
    """Return a progress that raises on Ctrl-C, too; ProblemError if not callable."""
    as_called(progress, "progress")

    def obeyed(stage: str, done: int, total: int) -> None:
        progress(stage, done, total)
        obey_interruption()

    return obeyed


# Threads of linear algebra.


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS compute in the thread that calls it.

    Matrices of a plan are small: handing them to other threads takes longer than to multiply them,
    most of all where other processes keep the cores busy.
    """
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
