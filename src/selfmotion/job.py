"""Jobs: many seams as one program.

A door: what it names is made in `selfmotion.work.job`.
"""

from selfmotion.work.job import *  # noqa: F403
from selfmotion.work.job import __all__ as __all__
