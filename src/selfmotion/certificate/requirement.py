"""What a requirement is: something that a finished motion must keep, and that judges whether."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate.findings import Extreme, Finding
from selfmotion.collision import Obstacle
from selfmotion.motion import Trajectory
from selfmotion.robot import RobotModel

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
