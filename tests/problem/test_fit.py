"""Paths and relaxations that fit, or do not."""

from collections.abc import Callable

import pytest

import selfmotion as sm
from selfmotion.problem.problem.relaxation_checks import check_relaxations


@pytest.mark.parametrize(
    ("task", "relaxations", "message"),
    [
        ("position", [sm.Relaxation("rx")], "does not prescribe rx"),
        ("pointing", [sm.Relaxation("rz", 0.1)], "does not prescribe rz"),
        ("planar_pose", [sm.Relaxation("rz", 0.1)], "does not prescribe rz"),
        ("planar", [sm.Relaxation("x", 0.1, axes="tool")], "tool axes need"),
        ("pose", [sm.Relaxation("x", during=(1.0, 4.5))], "ends at 4.5 s"),
        ("pose", [sm.Relaxation("x", 0.1), sm.Relaxation(("x", "y"), 0.1)], "relaxed twice"),
        ("pose", [sm.Relaxation("x", 0.1), sm.Relaxation("y", 0.1, axes="tool")], "choose one"),
    ],
)
def test_relaxations_that_misfit_are_refused(
    panda_circle: Callable, task: str, relaxations: list, message: str
) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        check_relaxations(relaxations, panda_circle().path, sm.Task.of(task))


def test_problem_refuses_what_is_no_relaxation(panda_circle: Callable) -> None:
    with pytest.raises(sm.errors.ProblemError, match="relaxations"):
        panda_circle(relaxations=[0.1])
