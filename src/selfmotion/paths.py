"""Tool motions over time: where the tool is to be, and how fast.

A door: what it names is made in `selfmotion.model.path`.
"""

from selfmotion.model.path import *  # noqa: F403
from selfmotion.model.path import __all__ as __all__
