"""Constraints: quantities within limits.

A door: what it names is made in `selfmotion.problem.constraints`.
"""

from selfmotion.problem.constraints import *  # noqa: F403
from selfmotion.problem.constraints import __all__ as __all__
