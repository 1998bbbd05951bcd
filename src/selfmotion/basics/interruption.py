"""Counters of work, and its interruption by Ctrl-C.

Ctrl-C while compiled code runs is noted at once, and obeyed between two steps of the work. Python
raises KeyboardInterrupt wherever the main thread happens to be: within the call of a compiled
kernel that ends as a fault of the call (`SystemError`: a result with an exception set), within its
compilation it is lost.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from selfmotion.basics.inputs import as_called
from selfmotion.basics.progress import Progress


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
