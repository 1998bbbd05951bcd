"""The published method: F of the coefficients and its exact gradient, given ends eliminated.

It optimises the motions of `rollout`. Read `objective`, `ends` and `solution` in this order.
"""

from selfmotion.planning.paper.ends import Eliminated as Eliminated, closed as closed
from selfmotion.planning.paper.objective import (
    Objective as Objective,
    node_tangents as node_tangents,
    parts_of as parts_of,
)
from selfmotion.planning.paper.solution import (
    MethodInputs as MethodInputs,
    PublishedMotion as PublishedMotion,
)
