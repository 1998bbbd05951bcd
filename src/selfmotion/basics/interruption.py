"""Ctrl-C while compiled code runs: noted at once, obeyed between two steps of the work.

Python raises KeyboardInterrupt wherever the main thread happens to be. Within the call of a
compiled kernel that ends as a fault of the call (`SystemError`: a result with an exception set),
within its compilation it is lost.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from selfmotion.basics.inputs import as_called
from selfmotion.basics.progress import Progress


class _Interruption:
    """Whether Ctrl-C was pressed, and is not obeyed yet."""

    def __init__(self) -> None:
        self.noted = False

    def note(self, number: int, frame: FrameType | None) -> None:
        """Note it; the second time, obey at once."""
        if self.noted:
            raise KeyboardInterrupt
        self.noted = True


_pressed = _Interruption()


@contextmanager
def held_interruption() -> Iterator[None]:
    """Within this, Ctrl-C is obeyed where `obey_interruption` is called; at once the second time.

    In the main thread, and where nobody else handles the signal; nothing changes elsewhere. What
    was not obeyed by the end is so there.

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


def obeying(progress: Progress) -> Progress:
    """Return a progress that obeys Ctrl-C, too; ProblemError for what cannot be called."""
    as_called(progress, "progress")

    def told(stage: str, done: int, total: int) -> None:
        progress(stage, done, total)
        obey_interruption()

    return told
