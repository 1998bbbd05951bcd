"""Minimisation; knows only numbers."""

from selfmotion.planning.optimise.banded import (
    BandedRows as BandedRows,
    banded_optimum as banded_optimum,
)
from selfmotion.planning.optimise.base import (
    Callback as Callback,
    Function as Function,
    Iteration as Iteration,
    Minimum as Minimum,
    Optimizer as Optimizer,
    Status as Status,
    inverse_metric as inverse_metric,
)
from selfmotion.planning.optimise.blocks import Banded as Banded
from selfmotion.planning.optimise.quadratic import minimize_quadratic as minimize_quadratic
from selfmotion.planning.optimise.quasi_newton import (
    LineSearch as LineSearch,
    QuasiNewton as QuasiNewton,
)

__all__ = [
    "Function",
    "Iteration",
    "LineSearch",
    "Minimum",
    "Optimizer",
    "Status",
]
