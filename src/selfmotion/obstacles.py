"""Bodies that stand around or ride along, and what measures their distances.

A door: what it names is made in `selfmotion.model.collision`.
"""

from selfmotion.model.collision import *  # noqa: F403
from selfmotion.model.collision import __all__ as __all__
