"""Planning of motions, and results."""

from selfmotion.planning.planner import (
    GOALS as GOALS,
    Fastest as Fastest,
    PlanRequest as PlanRequest,
    Search as Search,
    branches as branches,
    check_joints as check_joints,
    fastest as fastest,
    from_start as from_start,
    like_before as like_before,
    near_start as near_start,
    plan as plan,
    plan_in_parts as plan_in_parts,
)
