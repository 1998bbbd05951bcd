"""Work done, counted where it is done."""

from dataclasses import dataclass


@dataclass
class Counts:
    """Work done over all starts and grids; whoever works adds to it.

    Attributes
    ----------
    evaluations, gradients : int
        How often F and ∇F were computed.
    jacobians : int
        How often Pinocchio was asked for the frame Jacobian.
    """

    evaluations: int = 0
    gradients: int = 0
    jacobians: int = 0

    def evaluated(self) -> None:
        """Count an evaluation of F that begins."""
        self.evaluations += 1
