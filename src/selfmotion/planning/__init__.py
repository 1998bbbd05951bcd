"""From a problem to a plan."""

from selfmotion.planning.fastest import Fastest, fastest
from selfmotion.planning.parts import plan_in_parts
from selfmotion.planning.run import plan
from selfmotion.planning.settings import Search

__all__ = ["Fastest", "Search", "fastest", "plan", "plan_in_parts"]
