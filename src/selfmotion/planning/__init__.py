"""How a motion is found, and what comes out."""

from selfmotion.planning.planner import *  # noqa: F403
