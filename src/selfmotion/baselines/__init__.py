"""Other works' ways to resolve redundancy, each usable as ``plan(problem, method=…)``."""

from selfmotion.baselines.base import Method, Motion, plan_by
from selfmotion.baselines.extended import ExtendedJacobian
from selfmotion.baselines.integration import start_of
from selfmotion.baselines.lagrange import LagrangianOptimum
from selfmotion.baselines.local import DampedLeastSquares, GradientProjection, PseudoInverse

__all__ = [
    "DampedLeastSquares",
    "ExtendedJacobian",
    "GradientProjection",
    "LagrangianOptimum",
    "Method",
    "Motion",
    "PseudoInverse",
    "plan_by",
    "start_of",
]
