"""Problems and plans travel: by pickle, and as copies."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.problem.constraints import NO_OVERLAP
from selfmotion.problem.problem import KEPT, envelope_of_problem
from support.arms import PANDA_HOME, robot_named

WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "deep copy": copy.deepcopy,
    "copy": copy.copy,
}
Circle = Callable[..., sm.Problem]


def problem(**given: Any) -> sm.Problem:
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 3.0)
    return sm.Problem(panda, circle, given.pop("task", "position"), PANDA_HOME, **given)


def with_much() -> sm.Problem:
    box = sm.obstacles.Box("box", [0.8, 0.5, 0.1], [0.1, 0.1, 0.1])
    return problem(
        task="pose",
        clearance=sm.constraints.Clearance([box], 0.01),
        relaxations=[sm.Relaxation("rz", 0.3)],
        constraints=(*KEPT, sm.constraints.JointTorqueLimits(payload=1.0)),
        costs=[sm.costs.JointVelocity(), sm.costs.InverseManipulability()],
    )


@pytest.mark.parametrize("way", WAYS)
def test_problems_and_plans_are_the_same_afterwards(way: str) -> None:
    plain, much = problem(), with_much()
    plan = sm.plan(plain)
    # Also when all that follows from a problem is there already.
    assert envelope_of_problem(much).bodies
    for one in (plain, much):
        again = WAYS[way](one)
        assert again.digest == one.digest
        assert (again.clearance is NO_OVERLAP) == (one.clearance is NO_OVERLAP)
        for item, other in zip(again.constraints, one.constraints, strict=True):
            assert any(item is usual for usual in KEPT) == any(other is usual for usual in KEPT)
    made = WAYS[way](plan)
    assert made.certificate.verified
    assert made.certificate.verdict == plan.certificate.verdict
    np.testing.assert_array_equal(made.trajectory.q, plan.trajectory.q)
    judged = WAYS[way](plain).certify(plan.trajectory)
    assert judged.verified
