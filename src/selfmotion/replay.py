"""Replays of plans as pages.

A door: what it names is made in `selfmotion.shell.replay`.
"""

from selfmotion.shell.replay import *  # noqa: F403
from selfmotion.shell.replay import __all__ as __all__
