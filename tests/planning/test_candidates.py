"""A free start is never worse, and repeats."""

import dataclasses
from collections.abc import Callable

import numpy as np

import selfmotion as sm

Circle = Callable[..., sm.Problem]


def test_free_start_is_never_worse_and_repeats(panda_circle: Circle) -> None:
    fixed = sm.plan(panda_circle())
    free = sm.plan(dataclasses.replace(panda_circle(), start="free"))
    again = sm.plan(dataclasses.replace(panda_circle(), start=None))
    assert free.report.cost <= fixed.report.cost
    assert free.certificate.verified
    np.testing.assert_array_equal(free.trajectory.q, again.trajectory.q)
