"""An iteration of Newton's method, and where it ended."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from selfmotion.basics import Array
from selfmotion.nodes.motion import NodeMotion
from selfmotion.optimise import Status


class Step(NamedTuple):
    """An iteration.

    Attributes
    ----------
    motion : NodeMotion
    slope : float
        Norm of the gradient of what is minimised.
    length : float
        Share of Newton's step that was taken; 0 of the first.
    """

    motion: NodeMotion
    slope: float
    length: float


Told = Callable[[Step], bool]
"""Told of each iteration; True stops."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where Newton's method ended.

    Attributes
    ----------
    motion : NodeMotion
    prices : (N + 1, c)
        λ of the conditions that counted.
    status : Status
    promised : float
        By how much another step would lower the cost.
    end_prices : (E,)
        Of what is asked of the ends.
    """

    motion: NodeMotion
    prices: Array
    status: Status
    promised: float
    end_prices: Array
