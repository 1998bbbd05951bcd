"""What the optimisations of one plan share."""

from dataclasses import dataclass

from selfmotion.basics import Counts
from selfmotion.optimise import Callback, Optimizer


@dataclass(frozen=True)
class Effort:
    """What the sessions of a plan share.

    Attributes
    ----------
    optimizer : Optimizer or None
        Of the published method, where one is asked for.
    callback : callable or None
        Called with each `Iteration`.
    max_evaluations : int or None
        Limit on evaluations of each session.
    counts : Counts
        Where work is added up.
    apart : bool
        Whether the optimisation keeps the arm apart from itself where only the default asks for it.
    """

    optimizer: Optimizer | None
    callback: Callback | None
    max_evaluations: int | None
    counts: Counts
    apart: bool = False
