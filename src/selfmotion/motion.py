"""Trajectories and null motions.

A door: what it names is made in `selfmotion.model.motion`.
"""

from selfmotion.model.motion import *  # noqa: F403
from selfmotion.model.motion import __all__ as __all__
