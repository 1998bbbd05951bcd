"""What a certificate is made of: tolerances, and what was found."""

from dataclasses import dataclass

from selfmotion.basics import as_number


@dataclass(frozen=True)
class Tolerance:
    """What a verified motion may miss the path by, at any time.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        [rad].
    """

    position: float = 1e-6
    rotation: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("position", "rotation"):
            value = as_number(getattr(self, name), f"tolerance: {name}", above=0.0)
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, tolerance: "Tolerance | float | None") -> "Tolerance":
        """Return the tolerance that was given: one number is for both [m and rad].

        Raises
        ------
        ProblemError
            It is neither a tolerance nor a number above 0.
        """
        if isinstance(tolerance, cls):
            return tolerance
        if tolerance is None:
            return cls()
        value = as_number(tolerance, "tolerance", above=0.0)
        return cls(value, value)


# What a motion may miss its path by where nobody says otherwise.
USUAL = Tolerance()


@dataclass(frozen=True)
class Extreme:
    """The worst value of a quantity along a motion.

    Attributes
    ----------
    value : float
    time : float
        When [s].
    name : str
        Of what: a joint, a frame, a pair of bodies.
    """

    value: float
    time: float
    name: str


@dataclass(frozen=True)
class Finding:
    """What one requirement found on a motion.

    Attributes
    ----------
    requirement : str
        Its name.
    subject : str
        What it is about at the worst place: a joint, a pair of bodies.
    time : float
        When that is [s].
    amount : float
        What was found there.
    allowed : float
        What is allowed.
    satisfied : bool
        Whether the requirement is satisfied at all times.
    text : str
        In words: who, how much, when, what was wanted, and what to do about it.
    of_pace : bool
        Whether a slower pace may keep what is not kept.
    factor : float
        By what factor it takes longer where it is kept, at the same pace but slower; 1 where it is
        kept, inf where that is not known.
    at_least : bool
        Whether no less than what is allowed has to be found, rather than no more.
    unit : str
        Of both, such as "rad/s²"; "" of shares.
    """

    requirement: str
    subject: str
    time: float
    amount: float
    allowed: float
    satisfied: bool
    text: str
    of_pace: bool = False
    factor: float = 1.0
    at_least: bool = False
    unit: str = ""

    @property
    def extreme(self) -> Extreme:
        """The worst value, when, and of what."""
        return Extreme(self.amount, self.time, self.subject)


@dataclass(frozen=True)
class DampedStretch:
    """A stretch of time over which the inverse was damped.

    Attributes
    ----------
    start, end : float
        [s].
    singular_value : float
        Smallest singular value σ of the task Jacobian on it [m, rad].
    factor : float
        Largest damping λ on it [m, rad].
    """

    start: float
    end: float
    singular_value: float
    factor: float

    def __str__(self) -> str:
        """Return the stretch in words."""
        return (
            f"{self.start:.3f} to {self.end:.3f} s (smallest singular value "
            f"{self.singular_value:.3g}, λ up to {self.factor:.3g})"
        )
