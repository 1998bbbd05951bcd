"""How far part, tool and base may be off.

A door: what it names is made in `selfmotion.work.margins`.
"""

from selfmotion.work.margins import *  # noqa: F403
from selfmotion.work.margins import __all__ as __all__
