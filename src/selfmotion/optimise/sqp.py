"""Sequential quadratic programming: the quasi-Newton method where conditions bind."""

from dataclasses import dataclass

from selfmotion.basics import Array, ProblemError
from selfmotion.optimise.base import (
    Callback,
    ConstrainedFunction,
    Minimum,
    Status,
)
from selfmotion.optimise.sqp_state import Minimisation


@dataclass(frozen=True)
class SequentialQuadratic:
    """Sequential quadratic programming with a trust region and a quasi-Newton matrix.

    Each step minimises a quadratic model of the Lagrangian where the linearised conditions hold
    (`best_step`), is judged by an exact penalty function (`ExactPenalty`) and corrected once for
    the curvature of the conditions (second-order correction). The model's matrix is renewed by
    Broyden's family with Fletcher's switch on the Lagrangian, damped. Variables are scaled by the
    first estimate of the inverse Hessian; far from where that was made, the matrix is made anew.
    Where conditions stay violated because they pull in opposite directions, a quadratic penalty
    leads elsewhere (`restored`).

    J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., chapter 18; R. H. Byrd,
    J. Nocedal and R. A. Waltz, "Steering exact penalty methods for nonlinear programming",
    Optimization Methods and Software 23, 2008.

    Parameters
    ----------
    tolerance : float
        Converged when all conditions are kept and the decrease that the model predicts is below
        this times |F|.
    max_iterations : int
    restorations : int
        How often it may begin again elsewhere where conditions pull in opposite directions.
    """

    tolerance: float = 1e-7
    max_iterations: int = 200
    restorations: int = 3

    def __post_init__(self) -> None:
        if not self.tolerance > 0.0:
            raise ProblemError(f"optimiser: tolerance is {self.tolerance}, expected > 0")

    def minimize(
        self,
        function: ConstrainedFunction,
        x0: Array,
        inverse_hessian: Array | None = None,
        *,
        max_evaluations: int | None = None,
        callback: Callback | None = None,
    ) -> Minimum:
        """Minimise `function` from `x0` where its conditions are kept.

        Parameters
        ----------
        function : ConstrainedFunction
        x0 : (size,)
            F(x0) must be finite; conditions may be violated.
        inverse_hessian : (size, size), optional
            By default the inverse of the function's Gauss-Newton matrix at the start.
        max_evaluations : int, optional
            Limit on `Function.evaluations`.
        callback : callable, optional
            Called with each `Iteration`; returning True stops.

        Returns
        -------
        Minimum
            With multipliers, one per condition. Where it did not converge: the best point found,
            which is the cheapest that keeps all conditions, or the one that violates them least.
        """
        run = Minimisation(self, function, x0, max_evaluations, callback)
        try:
            status = run.until_done(inverse_hessian)
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        return run.minimum(status)
