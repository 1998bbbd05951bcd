"""The command `selfmotion`: Ctrl-C ends it in one line from the start, also while it imports.

Outside the package, whose import takes most of that time; nothing is imported here before.
"""

import os
import signal
import sys
from types import FrameType

# Of a process that Ctrl-C ended, as shells count it.
INTERRUPTED = 128 + signal.SIGINT


def main() -> None:
    """Import the command line and run it."""
    # An exception would go through extension modules that make something else of it.
    before = signal.signal(signal.SIGINT, _end)
    from selfmotion.shell.cli import main as command

    signal.signal(signal.SIGINT, before)
    command()


def _end(number: int, frame: FrameType | None) -> None:
    """Say one line, and end at once."""
    sys.stderr.write("interrupted\n")
    sys.stderr.flush()
    os._exit(INTERRUPTED)
