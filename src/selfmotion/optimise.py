"""Minimisers that know only numbers.

A door: what it names is made in `selfmotion.planning.optimise`.
"""

from selfmotion.planning.optimise import *  # noqa: F403
from selfmotion.planning.optimise import __all__ as __all__
