"""Relaxations that do not fit are refused."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.problem.relaxed_rows import check_relaxations


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rows": "w"}, "expected some of x, y, z"),
        ({"rows": ()}, "expected some of"),
        ({"rows": ("x", "x")}, "each once"),
        ({"rows": ("x", "rx")}, "mix metres and radians"),
        ({"rows": "x", "band": 0.0}, "band is 0.0"),
        ({"rows": "x", "band": np.nan}, "band is nan"),
        ({"rows": "x", "axes": "base"}, "expected 'world' or 'tool'"),
        ({"rows": "x", "during": (2.0, 1.0)}, "0 ≤ first < last"),
        ({"rows": "x", "during": (1.0,)}, "expected two times"),
        ({"rows": "x", "during": (0.0, np.inf)}, "expected two times"),
        ({"rows": "x", "during": 1.0}, "expected two times"),
        ({"rows": "x", "during": "ab"}, "expected two times"),
        ({"rows": "x", "band": "a"}, "expected a number"),
        ({"rows": 3}, "expected names of rows"),
        ({"rows": "x", "intervals": 3}, "≥ 4"),
    ],
)
def test_bad_relaxations_are_refused(options: dict, message: str) -> None:
    with pytest.raises(sm.ProblemError, match=message):
        sm.Relaxation(**options)


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
    with pytest.raises(sm.ProblemError, match=message):
        check_relaxations(relaxations, panda_circle().path, sm.Task.of(task))


def test_problem_refuses_what_is_no_relaxation(panda_circle: Callable) -> None:
    with pytest.raises(sm.ProblemError, match="relaxations"):
        panda_circle(relaxations=[0.1])
