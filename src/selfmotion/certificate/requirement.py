"""What a finished motion must keep, and what was found of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, as_number
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel

# What a certificate is made of: tolerances, and what was found.


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
    def of(cls, tolerance: Tolerance | float | None) -> Tolerance:
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


# What a requirement is: something that a finished motion must keep, and that judges whether.

# Points per interval of the trajectory's samples: odd, so that none but the samples are symmetric.
_REFINEMENT = 5
# Of more samples than this, nothing is put between.
_MANY = 20_000


@dataclass(frozen=True, eq=False)
class FinishedMotion:
    """A motion as requirements see it.

    Attributes
    ----------
    robot : RobotModel
    trajectory : Trajectory
        Known at all times, with its exact extremes.
    """

    robot: RobotModel
    trajectory: Trajectory

    @cached_property
    def t(self) -> Array:
        """Times [s] on a grid finer than the trajectory's samples, unless these are many, (K,)."""
        samples = self.trajectory.t
        refinement = _REFINEMENT if len(samples) <= _MANY else 1
        fractions = np.arange(refinement) / refinement
        inner = samples[:-1, None] + np.diff(samples)[:, None] * fractions
        return np.append(inner.ravel(), samples[-1])

    @cached_property
    def q(self) -> Array:
        """Joint coordinates at `t`, (K, n) [rad or m]."""
        return self.trajectory(self.t)

    @cached_property
    def qd(self) -> Array:
        """Joint velocities at `t`, (K, n) [rad/s or m/s]."""
        return self.trajectory(self.t, order=1)


class Requirement(ABC):
    """Something that a finished motion must keep besides its path.

    The certificate asks each requirement, and a motion is verified only when all are kept. One of
    your own gives `name` and `judge`; it is made by `Constraint.requirement`, or handed to
    `certify`. `selfmotion.testing.check_constraint` shows that it refuses what its constraint does.

    Attributes
    ----------
    name : str
        What to call it in findings.
    """

    name: str

    @abstractmethod
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return what there is to say about a motion, on its worst place."""

    def approaches(self, motion: FinishedMotion) -> Mapping[str, Extreme]:
        """Return how near bodies come at all times, in detail.

        Of each obstacle, each carried body and the arm itself: the distance [m], when, and which
        two bodies. It takes about as long as to judge them.
        """
        return {}

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that it is about, for whoever draws them."""
        return ()

    @property
    def covers(self) -> tuple[str, ...]:
        """What a verdict may say was checked, when this was; by default its name."""
        return (self.name,)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What it leaves out or cannot know, for whoever reads the certificate."""
        return ()


def approaches(
    requirements: Sequence[Requirement], motion: FinishedMotion
) -> Mapping[str, Extreme]:
    """Return how near bodies come, in detail, the nearest first; see `Requirement.approaches`."""
    found: dict[str, Extreme] = {}
    for requirement in requirements:
        for name, each in requirement.approaches(motion).items():
            if name not in found or each.value < found[name].value:
                found[name] = each
    return dict(sorted(found.items(), key=lambda item: item[1].value))


def of_some(name: str) -> str:
    """Return what is covered of such rates where not every joint has a limit."""
    return f"{name} of some joints"


def covered_by(requirements: Sequence[Requirement]) -> tuple[str, ...]:
    """Return what requirements cover together; what one covers of all joints is not of some."""
    found = dict.fromkeys(what for item in requirements for what in item.covers)
    return tuple(what for what in found if what not in map(of_some, found))
