"""What is known of one motion of an objective."""

from dataclasses import dataclass

from selfmotion.basics import Array
from selfmotion.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A motion of the objective, on its own: nothing done later changes it.

    Attributes
    ----------
    x : (size,)
        The decision vector.
    terms : dict
        What each cost contributes to F.
    trajectory : Trajectory
        Its nodes put onto the path, unless damped.
    damped : bool
        Whether the inverse was damped anywhere.
    """

    x: Array
    terms: dict[str, float]
    trajectory: Trajectory
    damped: bool

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.terms.values())
