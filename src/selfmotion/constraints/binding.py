"""What a constraint that binds costs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Binding:
    """A constraint that keeps the plan from a lower cost, with its price.

    Attributes
    ----------
    constraint : str
        Its name.
    easing : str
        What asking for a little less would be, in words, with the joint or the pair.
    saving : float
        What that would take off F, to first order: the multipliers' sum times the amount.
    spans : tuple of (float, float)
        First and last time [s] of each stretch on which it binds.
    """

    constraint: str
    easing: str
    saving: float
    spans: tuple[tuple[float, float], ...]
