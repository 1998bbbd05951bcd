"""Of motions that cost the same, the one that people expect is taken."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Counts, silent
from selfmotion.model.follow import Coordinates, within_limits
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.rough import far_from_usual, wound_back
from selfmotion.planning.planner.screening import Ranking
from selfmotion.planning.search import Stacked, start_candidates
from support.arms import robot_named
from support.cones import downhand

WHOLE = 2.0 * np.pi


@pytest.mark.parametrize("name", ["panda", "ur5", "kinova", "planar_3r"])
def test_joints_are_wound_back_within_their_limits_and_the_tool_stays(name: str) -> None:
    robot = robot_named(name)
    rng = np.random.default_rng(3)
    for _ in range(20):
        begin = robot.generic_configurations()[0]
        motion = begin + np.linspace(0.0, 1.0, 7)[:, None] * rng.uniform(-0.2, 0.2, robot.dof)
        wound = motion + WHOLE * rng.integers(-2, 3, robot.dof) * robot.is_revolute
        own = Coordinates.of(robot)
        back = wound_back(own, wound)
        for q, other in zip(wound, back, strict=True):
            np.testing.assert_allclose(
                robot.pose(other).homogeneous, robot.pose(q).homogeneous, atol=1e-12
            )
        # As near to the usual posture as any whole turns within the limits would bring it.
        turns = WHOLE * np.arange(-4, 5)
        for joint in range(robot.dof):
            lower, upper = robot.lower[joint], robot.upper[joint]
            fits = [
                abs(np.mean(wound[:, joint] + turn) - own.usual()[joint])
                for turn in (turns if robot.is_revolute[joint] else [0.0])
                if lower <= (wound[:, joint] + turn).min()
                and (wound[:, joint] + turn).max() <= upper
            ]
            if fits:
                middle = 0.5 * (back[:, joint].min() + back[:, joint].max())
                away = abs(middle - own.usual()[joint])
                assert away <= min(fits) + 0.5 * np.ptp(wound[:, joint]) + 1e-9


def test_the_nearest_of_mirror_images_is_taken() -> None:
    """On a UR5 a free start begins near home, not with its wrists a turn away."""
    arm = robot_named("ur5")
    here = arm.pose(arm.home + np.array([0.3, 0.6, -1.2, 0.2, -1.4, 0.1]))
    end = here.copy()
    end.translation = here.translation + np.array([0.0, 0.15, 0.05])
    plan = sm.plan(sm.Problem(arm, sm.paths.Line(here, end, 3.0), "pointing")).require()
    q = plan.trajectory.q
    assert np.abs(q[:, 3:] - arm.home[3:]).max() < np.pi
    # None of its joints could be a turn nearer.
    own = Coordinates.of(arm)
    np.testing.assert_array_equal(wound_back(own, q), q)
    assert far_from_usual(own, q[None])[0] <= far_from_usual(own, q[None] + WHOLE)[0]


def test_whole_turns_are_told_by_the_limits_that_are_asked_for() -> None:
    """A table that turns without end has to stay within a window of less than two turns."""
    cell = downhand(0.5)
    turn = cell.robot.joint_names.index("table/turn")
    lower, upper = cell.robot.lower.copy(), cell.robot.upper.copy()
    lower[turn], upper[turn] = 2.0, 12.0
    limits = sm.constraints.JointPositionLimits(lower, upper)
    problem = Formulation.of(cell.changed(constraints=(limits, *cell.constraints[1:])))
    t, envelope = np.linspace(0.0, problem.path.duration, 49), problem.envelope
    task = Stacked(problem.follows, envelope.quantities, lower, upper, np.ones(8))
    arm = within_limits(problem.follows, envelope.lower, envelope.upper)
    starts, kept = task.placed(
        np.array(start_candidates(arm, 24, np.random.default_rng(0))), float(t[0])
    )
    motions, arrived = task.carried(starts[kept], t)
    ranking = Ranking(problem, Effort(None, None, None, Counts()), silent)
    assert ranking.run_along(motions[arrived], t, 1)
    (best,) = ranking.ranked
    assert best.violation <= 0.0
    assert (best.place.q[:, turn] >= 2.0).all()
