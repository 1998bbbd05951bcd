"""A free start is never worse, and repeats."""

import dataclasses
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

import selfmotion as sm
from selfmotion.planning.session import Session

Circle = Callable[..., sm.Problem]


def test_free_start_is_never_worse_and_repeats(panda_circle: Circle) -> None:
    fixed = sm.plan(panda_circle())
    free = sm.plan(dataclasses.replace(panda_circle(), start="free"))
    again = sm.plan(dataclasses.replace(panda_circle(), start=None))
    assert free.report.cost <= fixed.report.cost
    assert free.certificate.verified
    np.testing.assert_array_equal(free.trajectory.q, again.trajectory.q)


def test_of_two_that_violate_constraints_the_nearer_is_kept() -> None:
    """A cheap motion through a body is no better start than a dearer one that touches it."""

    def session(cost: float, penalty: float) -> SimpleNamespace:
        wrong = ("clearance",) if penalty else ()
        return SimpleNamespace(violations=wrong, merit=lambda: cost + penalty, _cost=lambda: cost)

    through, touching, free = session(1.0, 50.0), session(2.0, 0.1), session(9.0, 0.0)
    ranked = sorted((through, touching, free), key=Session.score)  # type: ignore[arg-type]
    assert ranked == [free, touching, through]
