"""Progress of long work."""

from collections.abc import Callable

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
