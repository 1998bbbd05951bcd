"""Requirements on a finished motion, and findings."""

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


@dataclass(frozen=True)
class Tolerance:
    """Allowed error of a verified motion from the path, at any time.

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


# Default tolerance.
USUAL = Tolerance()


@dataclass(frozen=True)
class Extreme:
    """The worst value of a quantity along a motion.

    Attributes
    ----------
    value : float
    time : float
        Its time [s].
    name : str
        Its subject: a joint, a frame, a pair of bodies.
    """

    value: float
    time: float
    name: str


@dataclass(frozen=True)
class Finding:
    """Result of one requirement on a motion.

    Attributes
    ----------
    requirement : str
        Its name.
    subject : str
        Its subject at the worst place: a joint, a pair of bodies.
    time : float
        When that is [s].
    amount : float
        Value there.
    allowed : float
        Limit there.
    satisfied : bool
        Whether the requirement is satisfied at all times.
    text : str
        In words: subject, amount, time, limit, and a remedy.
    of_pace : bool
        Whether a slower pace may satisfy what is violated.
    factor : float
        Factor by which the motion has to take longer at the same pace profile; 1 if satisfied, inf
        if unknown.
    at_least : bool
        Whether the limit is a lower bound of the value, rather than an upper one.
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
        """The worst value, its time and its subject."""
        return Extreme(self.amount, self.time, self.subject)


@dataclass(frozen=True)
class DampedStretch:
    """An interval of time on which the inverse was damped.

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
        """Return the interval in words."""
        return (
            f"{self.start:.3f} to {self.end:.3f} s (smallest singular value "
            f"{self.singular_value:.3g}, λ up to {self.factor:.3g})"
        )


# Points per interval of the trajectory's samples: odd, so that only the samples are symmetric.
_REFINEMENT = 5
# Above this number of samples, none are inserted.
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

    The certificate judges each requirement, and a motion is verified only when all are satisfied. A
    user's own class gives `name` and `judge`; it is returned by `Constraint.requirement`, or passed
    to `certify`. `selfmotion.testing.check_constraint` shows that it refuses what its constraint
    does.

    Attributes
    ----------
    name : str
        Its name in findings.
    """

    name: str

    @abstractmethod
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the finding on a motion, at its worst place."""

    def approaches(self, motion: FinishedMotion) -> Mapping[str, Extreme]:
        """Return the smallest distances of bodies at all times, in detail.

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
        """Checks that a verdict may claim; by default its name."""
        return (self.name,)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes on its gaps, for readers of the certificate."""
        return ()


def approaches(
    requirements: Sequence[Requirement], motion: FinishedMotion
) -> Mapping[str, Extreme]:
    """Return the smallest distances of bodies, the nearest first; see `Requirement.approaches`."""
    found: dict[str, Extreme] = {}
    for requirement in requirements:
        for name, each in requirement.approaches(motion).items():
            if name not in found or each.value < found[name].value:
                found[name] = each
    return dict(sorted(found.items(), key=lambda item: item[1].value))


def of_some(name: str) -> str:
    """Return the claim for rates of which not every joint has a limit."""
    return f"{name} of some joints"


def covered_by(requirements: Sequence[Requirement]) -> tuple[str, ...]:
    """Return the claims of all requirements; a claim for all joints replaces that for some."""
    found = dict.fromkeys(what for item in requirements for what in item.covers)
    return tuple(what for what in found if what not in map(of_some, found))
