"""What can go wrong: every error is a `selfmotion.SelfmotionError`, and says what to do.

A door: what it names is made in `selfmotion.basics.errors`.
"""

from selfmotion.basics.errors import *  # noqa: F403
from selfmotion.basics.errors import __all__ as __all__
