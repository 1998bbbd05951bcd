"""From a problem to a plan."""

from selfmotion.planning.branches import (
    branches as branches,
    from_start as from_start,
    like_before as like_before,
    near_start as near_start,
)
from selfmotion.planning.candidate import check_joints as check_joints
from selfmotion.planning.effort import Search as Search
from selfmotion.planning.fastest import Fastest as Fastest, fastest as fastest
from selfmotion.planning.parts import plan_in_parts as plan_in_parts
from selfmotion.planning.request import GOALS as GOALS, PlanRequest as PlanRequest
from selfmotion.planning.run import plan as plan
