"""Baselines: other authors' methods of redundancy resolution, for comparison.

Re-exports `selfmotion.paper.baselines`.
"""

from selfmotion.paper.baselines import *  # noqa: F403
from selfmotion.paper.baselines import __all__ as __all__
