"""Which problems are optimised on nodes, and on how many."""

from collections.abc import Sequence

from selfmotion.constraints import BoundConstraint
from selfmotion.motion import FreeNullMotion
from selfmotion.nodes import NodeEnds
from selfmotion.optimise import QuasiNewton
from selfmotion.planning.effort import Effort
from selfmotion.planning.settings import MOST_NODES
from selfmotion.problem import Problem


def takes(problem: Problem, effort: Effort, constraints: Sequence[BoundConstraint]) -> bool:
    """Whether a problem is one for nodes.

    Not where the user asks for another null motion or optimiser, the tool leaves the path, nothing
    is free, a cost weighs jerks, which cubic splines do not have, or a condition is on the whole
    motion.
    """
    dof = problem.robot.dof
    orders = [order for cost in problem.all_costs for order in cost.curvature(dof)]
    return (
        isinstance(problem.null_motion, FreeNullMotion)
        and effort.optimizer == QuasiNewton()
        and problem.damping is None
        and problem.follows.redundancy == dof - problem.follows.dimension > 0
        and max(orders, default=0) < 3
        and all(NodeEnds.takes(item) for item in constraints if item.equality)
    )


def most_nodes(problem: Problem) -> int:
    """Return how many nodes are as many as a path may need: more, the longer it is."""
    return int(MOST_NODES * (len(problem.knots) + problem.way_in_reaches))
