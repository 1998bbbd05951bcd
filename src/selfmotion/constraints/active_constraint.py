"""What an active constraint costs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ActiveConstraint:
    """An active constraint: one that keeps the plan from a lower cost.

    Attributes
    ----------
    constraint : str
        Its name.
    easing : str
        A small relaxation of it in words, with the joint or the pair.
    saving : float
        What that relaxation would take off F, to first order: the sum of the Lagrange multipliers
        times its amount.
    spans : tuple of (float, float)
        First and last time [s] of each stretch on which it is active.
    """

    constraint: str
    easing: str
    saving: float
    spans: tuple[tuple[float, float], ...]
