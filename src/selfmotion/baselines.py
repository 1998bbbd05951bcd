"""Other works' methods.

A door: what it names is made in `selfmotion.paper.baselines`.
"""

from selfmotion.paper.baselines import *  # noqa: F403
from selfmotion.paper.baselines import __all__ as __all__
