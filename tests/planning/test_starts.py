"""A free start is never worse, and repeats."""

import dataclasses
from collections.abc import Callable

import numpy as np

import selfmotion as sm
from selfmotion.planning.standing import score

Circle = Callable[..., sm.Problem]


def test_free_start_is_never_worse_and_repeats(panda_circle: Circle) -> None:
    fixed = sm.plan(panda_circle())
    free = sm.plan(dataclasses.replace(panda_circle(), start="free"))
    again = sm.plan(dataclasses.replace(panda_circle(), start=None))
    assert free.report.cost <= fixed.report.cost
    assert free.certificate.verified
    np.testing.assert_array_equal(free.trajectory.q, again.trajectory.q)


@dataclasses.dataclass(frozen=True)
class Found:
    """A motion of which only this is known."""

    cost: float
    penalty: float

    @property
    def violations(self) -> tuple[str, ...]:
        return ("clearance",) if self.penalty else ()

    def merit(self) -> float:
        return self.cost + self.penalty


def test_of_two_that_violate_constraints_the_nearer_is_kept() -> None:
    """A cheap motion through a body is no better start than a dearer one that touches it."""
    through, touching, free = Found(1.0, 50.0), Found(2.0, 0.1), Found(9.0, 0.0)
    assert sorted((through, touching, free), key=score) == [free, touching, through]
