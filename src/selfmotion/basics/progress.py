"""What long work tells about itself while it runs."""

from collections.abc import Callable

Progress = Callable[[str, int, int], object]
"""Called with a stage, how much of it has begun, and of how many: ``("start", 3, 24)``.

It may raise `KeyboardInterrupt` to stop the work, as the keyboard does.
"""


def silent(stage: str, done: int, total: int) -> None:
    """Tell nothing."""
