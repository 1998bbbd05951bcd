"""Other works' methods of redundancy resolution, each usable as ``plan(problem, method=…)``."""

from selfmotion.paper.baselines.base import (
    Method as Method,
    Motion as Motion,
    plan_by as plan_by,
    start_of as start_of,
)
from selfmotion.paper.baselines.extended_jacobian import ExtendedJacobian as ExtendedJacobian
from selfmotion.paper.baselines.lagrange import LagrangianOptimum as LagrangianOptimum
from selfmotion.paper.baselines.local import (
    DampedLeastSquares as DampedLeastSquares,
    GradientProjection as GradientProjection,
    PseudoInverse as PseudoInverse,
)

__all__ = [
    "DampedLeastSquares",
    "ExtendedJacobian",
    "GradientProjection",
    "LagrangianOptimum",
    "Method",
    "Motion",
    "PseudoInverse",
]
