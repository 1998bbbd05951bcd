"""How finer grids and more freedom are taken."""

from types import SimpleNamespace

import pytest

import selfmotion as sm
from selfmotion.engine import Counts
from selfmotion.optimise import QuasiNewton
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.effort import Effort
from selfmotion.planning.refinement import settle
from selfmotion.planning.session import Session
from selfmotion.planning.standing import RolledMotion


def test_a_null_motion_never_becomes_coarser(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left around a fine spline may look as if fewer intervals were enough.

    They are not: the optimum of these is dearer, from where the finer one is asked for again.
    """
    problem = sm.sample_problem(null_motion=sm.RefinedNullMotion())
    effort = Effort(QuasiNewton(), None, None, Counts())
    session = Session(Beginning.of(problem, effort, problem.given_start, free=False))
    asked: list[int] = []

    def left(rolled: RolledMotion, *, bound: bool) -> SimpleNamespace:
        asked.append(rolled.null_motion.fewest_steps)
        intervals = 32 if len(asked) == 1 else 8
        return SimpleNamespace(most=1.0, intervals=lambda share: intervals)

    monkeypatch.setattr(RolledMotion, "left", left)
    session.minimize()
    settle(session)
    assert session.standing.null_motion == sm.BSplineNullMotion(32)
    assert len(asked) == 2
