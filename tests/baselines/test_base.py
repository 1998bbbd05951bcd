"""Other works' methods: plans like any, and bad parameters are refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shell.replay import write_replay


def test_plans_by_a_method_are_plans_like_any(tmp_path: Path) -> None:
    found = sm.plan_by(sm.sample_problem(), sm.baselines.PseudoInverse())
    assert write_replay(found, tmp_path / "replay.html").is_file()
    file = tmp_path / "plan.npz"
    found.save(file)
    again = sm.load_plan(file)
    np.testing.assert_array_equal(again.trajectory.q, found.trajectory.q)
    assert again.report.message == found.report.message


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (lambda: sm.baselines.DampedLeastSquares(0.0), "damping is 0.0"),
        (lambda: sm.baselines.DampedLeastSquares(0.1, -1.0), "threshold is -1.0"),
        (lambda: sm.baselines.GradientProjection(gain=-1.0), "gain is -1.0"),
    ],
)
def test_bad_parameters(method: Callable[[], object], message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        method()
