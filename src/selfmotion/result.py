"""Plans, reports, and what is made of them.

A door: what it names is made in `selfmotion.planning.result`.
"""

from selfmotion.planning.result import *  # noqa: F403
from selfmotion.planning.result import __all__ as __all__
