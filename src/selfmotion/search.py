"""Where to begin: starts, self-motions, chains.

A door: what it names is made in `selfmotion.planning.search`.
"""

from selfmotion.planning.search import *  # noqa: F403
