"""Costs: integrands along a motion.

A door: what it names is made in `selfmotion.problem.costs`.
"""

from selfmotion.problem.costs import *  # noqa: F403
from selfmotion.problem.costs import __all__ as __all__
