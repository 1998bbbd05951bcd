"""The paper, run again.

A door: what it names is made in `selfmotion.paper.study`.
"""

from selfmotion.paper.study import *  # noqa: F403
