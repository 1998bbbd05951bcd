"""From a problem to a plan."""

from selfmotion.planning.planner.branches import (
    branches as branches,
    from_start as from_start,
    like_before as like_before,
    near_start as near_start,
)
from selfmotion.planning.planner.effort import Deadline as Deadline, Search as Search
from selfmotion.planning.planner.fastest import Fastest as Fastest, fastest as fastest
from selfmotion.planning.planner.guess import check_joints as check_joints
from selfmotion.planning.planner.parts import plan_in_parts as plan_in_parts
from selfmotion.planning.planner.request import GOALS as GOALS, PlanRequest as PlanRequest
from selfmotion.planning.planner.run import plan as plan
from selfmotion.planning.planner.steps import (
    LOOK_AT_POSES as LOOK_AT_POSES,
    NOTHING_IN_THE_WAY as NOTHING_IN_THE_WAY,
)
