"""An arm that meets itself is seen, whatever else is judged of its motion."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner import judging
from support.arms import robot_named

# A Panda whose flange is 14 mm inside its forearm.
FOLDED = [1.05924655, 1.12845906, -0.41389145, -0.79416621, 2.19314128, 0.36824611, 2.02676761]


@pytest.mark.parametrize("feed", [None, 0.05])
def test_an_arm_that_meets_itself_is_seen_with_feeds_and_without(feed: float | None) -> None:
    panda = robot_named("panda")
    begin = panda.pose(np.array(FOLDED))
    end = begin.copy()
    end.translation = begin.translation + np.array([0.0, 0.0, 0.02])
    path: sm.paths.Path = sm.paths.Line(begin, end, 2.0)
    if feed is not None:
        path = sm.paths.Feed(path, feed)
    limits = [sm.constraints.JointPositionLimits()]
    through = sm.plan(
        sm.Problem(panda, path, "position", FOLDED, constraints=limits, clearance=None)
    )
    assert through.certificate.verified
    problem = sm.Problem(panda, path, "position")
    certificate = problem.certify(through.trajectory)
    (failure,) = certificate.failures
    assert "overlap" in failure
    assert judging._meets_itself(Formulation.of(problem), certificate)
    kept = sm.plan(problem)
    assert kept.certificate.verified
    assert not judging._meets_itself(Formulation.of(problem), kept.certificate)
