"""From a problem to a plan."""

from selfmotion.planning.run import plan

__all__ = [
    "plan",
]
