"""By how much a plan falls short of a required margin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number
from selfmotion.model.collision import DisplacedBodies
from selfmotion.planning.result import Plan
from selfmotion.work.margins.least import Size, least_scale
from selfmotion.work.margins.subjects import base_of, models_of, part_of, tool_of

# Margins are computed up to this multiple of the required one: an excess tells motions apart.
_BEYOND = 1.3


@dataclass(frozen=True)
class Margin:
    """How far something may be displaced: by a translation and a rotation at once.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        [rad].

    Raises
    ------
    ProblemError
        A number is negative, or both are 0.
    """

    position: float = 0.0
    rotation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "rotation"):
            value = as_number(getattr(self, name), f"margin: {name}", least=0.0)
            object.__setattr__(self, name, value)
        if not self.position and not self.rotation:
            raise ProblemError("margin: position and rotation are 0, expected one that is not")


@dataclass(frozen=True)
class Shortfall:
    """Two bodies that displacements of a wanted size bring together.

    Attributes
    ----------
    of : str
        What is displaced.
    pair : (str, str)
    time : float
        When [s].
    scale : float
        What the displacements may be multiplied by; proved.
    used : float
        What they take off the distance of both [m].
    """

    of: str
    pair: tuple[str, str]
    time: float
    scale: float
    used: float

    def __str__(self) -> str:
        """Return it in words."""
        first, second = self.pair
        return (
            f"the {self.of} has {self.scale:.0%} of it before '{first}' meets '{second}' at "
            f"{self.time:.4g} s"
        )


class Shortfalls(NamedTuple):
    """The first contact, and the largest distance of the path from the centre of rotation [m].

    Of each subject the pair that meets first, where displacements that are little larger than
    wanted do so.
    """

    nearest: tuple[Shortfall, ...]
    lever: float

    @property
    def items(self) -> tuple[Shortfall, ...]:
        """The subjects that fall short."""
        return tuple(item for item in self.nearest if item.scale < 1.0)

    @property
    def least(self) -> float:
        """The factor by which the required displacements may be multiplied, at most 1.3."""
        return min((item.scale for item in self.nearest), default=_BEYOND)


def shortfalls(
    plan: Plan,
    wanted: Margin,
    of: Sequence[str],
    *,
    part: Sequence[str] | None = None,
    tool: Sequence[str] | None = None,
    center: Array | None = None,
    clearance: float = 0.0,
) -> Shortfalls:
    """Return how far a verified plan falls short of a margin: the worst pair of each subject."""
    subjects = {
        "part": lambda: part_of(plan, part, center),
        "tool": lambda: tool_of(plan, tool),
        "base": lambda: base_of(plan),
    }
    size, found, lever = Size(wanted.position, wanted.rotation), [], 0.0
    for name in of:
        subject = subjects[name]()
        lever = max([lever, *(miss.lever for miss in subject.misses)])
        for model in models_of(plan):
            bodies = DisplacedBodies(model, subject.bodies, subject.joint, subject.center)
            least = least_scale(bodies, plan.trajectory, size, clearance, _BEYOND)
            if least.pair and least.moment is not None:
                first, second = least.pair
                turned = float(np.linalg.norm(least.moment))
                used = wanted.position + turned * wanted.rotation
                found.append(Shortfall(name, (first, second), least.time, least.scale, used))
    return Shortfalls(tuple(found), lever)
