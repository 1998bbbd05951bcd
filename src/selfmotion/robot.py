"""Robot models and their coordinates.

A door: what it names is made in `selfmotion.model.robot`.
"""

from selfmotion.model.robot import *  # noqa: F403
from selfmotion.model.robot import __all__ as __all__
