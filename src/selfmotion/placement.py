"""Where to put the part, or the arm.

A door: what it names is made in `selfmotion.work.placement`.
"""

from selfmotion.work.placement import *  # noqa: F403
from selfmotion.work.placement import __all__ as __all__
