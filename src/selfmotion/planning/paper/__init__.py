"""The published method, whole: eq. 4 rolled out, F and its exact gradient, given ends eliminated.

Read `rollout`, `minimum_norm`, `objective`, `ends` and `solution` in this order.
"""

from selfmotion.planning.paper.ends import Eliminated as Eliminated, closed as closed
from selfmotion.planning.paper.minimum_norm import (
    MOST_HALVINGS as MOST_HALVINGS,
    FixedStart as FixedStart,
    FreeStart as FreeStart,
    Guide as Guide,
    MinimumNormMotion as MinimumNormMotion,
    Start as Start,
    converged_minimum_norm as converged_minimum_norm,
)
from selfmotion.planning.paper.objective import (
    Objective as Objective,
    node_tangents as node_tangents,
)
from selfmotion.planning.paper.rollout import Rollout as Rollout
from selfmotion.planning.paper.solution import (
    Method as Method,
    Solution as Solution,
    solve as solve,
)
