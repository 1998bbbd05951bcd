"""Laws for what users write.

A door: what it names is made in `selfmotion.shell.testing`.
"""

from selfmotion.shell.testing import *  # noqa: F403
