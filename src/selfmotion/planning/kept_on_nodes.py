"""Which conditions a motion of nodes keeps, and what it costs."""

import numpy as np

from selfmotion.basics import Flags, Ints
from selfmotion.nodes import NodeMotion
from selfmotion.planning.on_nodes import MotionOnNodes
from selfmotion.planning.settings import ENDS_MET, NEARLY


def too_much(motion: NodeMotion, columns: Ints | Flags) -> bool:
    """Whether some of the conditions are not for nodes.

    Along a limit of jerk, what quintics on few nodes do jumps. Distances of bodies bend too much
    between the few bodies that count for interior points.
    """
    of_bodies = motion.grid.conditions.of_bodies()
    return bool((motion.orders[columns] > 2).any() or of_bodies[columns].any())


def broken_by(motion: NodeMotion) -> Flags:
    """Return which columns of the conditions are not kept, (C,)."""
    # Written so that NaN is not.
    return np.asarray(~(motion.h <= motion.grid.conditions.tolerances).all(axis=0))


def meets_ends(motion: NodeMotion) -> bool:
    """Whether the ends are what is asked for."""
    return bool(np.abs(motion.c).max(initial=0.0) <= ENDS_MET)


def nearly_broken(motion: NodeMotion) -> Flags:
    """Return which columns of the conditions are nearly broken, (C,)."""
    return np.asarray((motion.h > -NEARLY).any(axis=0))


def cost_of(standing: MotionOnNodes) -> float:
    """Return F of a motion that stands, to sort by."""
    return standing.cost


def aim_of(motion: NodeMotion) -> float:
    """Return what is minimised, to sort by."""
    return motion.aim
