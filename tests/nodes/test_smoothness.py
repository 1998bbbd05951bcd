"""What keeps accelerations from jumping at nodes: exact derivatives, and nothing of smooth ones."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.nodes import NodeMotion
from selfmotion.nodes.objective import scattered
from support.arms import PANDA_HOME, Case
from support.nodes import around_of, nodes_of, problem_of

# Central differences of jumps, which go with the square of the number of nodes.
STEP, ALIKE = 1e-5, 1e-6


def continuous(motion: NodeMotion) -> NodeMotion:
    found = motion.grid.continuous.near(motion.place.q, motion.place.qd)
    assert found is not None
    return found


@pytest.mark.parametrize("rest", [False, True])
def test_tangents_are_central_differences(case: Case, rest: bool) -> None:
    motion = continuous(nodes_of(problem_of(case, rest=rest), 12))
    continuity, charts = motion.grid.continuity, motion.charts
    around = around_of(motion)
    assert continuity is not None
    tangents = continuity.tangents(around.changes)
    step = np.random.default_rng(5).normal(size=(13, around.changes.shape[3]))
    r = motion.nu.shape[1]
    sides = []
    for sign in (1.0, -1.0):
        nu = motion.nu + sign * STEP * step[:, r:]
        place = charts.at(sign * STEP * step[:, :r], nu)
        assert place is not None
        sides.append(continuity.jumps(motion.grid.at(charts, nu, place).samples))
    expected = (sides[0] - sides[1]) / (2.0 * STEP)
    padded = np.pad(step, ((1, 1), (0, 0)))
    near = np.concatenate([padded[:-2], step, padded[2:]], axis=1)
    found = (tangents @ near[:, :, None])[:, :, 0]
    np.testing.assert_allclose(found, expected, atol=ALIKE * np.abs(expected).max())
    # So are the slopes of half the squares.
    by = scattered(continuity.slopes(motion.samples))
    pulled = charts.pulled(motion.place, by[:, 0], by[:, 1])
    jumps = continuity.jumps(motion.samples)
    # Rounding of what hardly jumps is all there is to see.
    allowed = ALIKE * np.abs(jumps).max() * np.abs(found).max() * step.size + 1e-12
    assert float(np.sum(pulled * step)) == pytest.approx(np.sum(jumps * found), abs=allowed)


def test_jumps_are_those_of_the_spline(panda: sm.RobotModel) -> None:
    """None of one cubic on all intervals; at rest also none of what begins and ends with q̈ = 0."""
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    for rest in (False, True):
        problem = sm.Problem(panda, path, "pose", PANDA_HOME, constraints=(), rest=rest)
        motion = continuous(nodes_of(problem, 12))
        continuity, t = motion.grid.continuity, motion.grid.t
        assert continuity is not None
        ones = np.ones(7)
        q, qd = (t[:, None] ** 3) * ones, (3.0 * t[:, None] ** 2) * ones
        samples = type(motion.samples)(motion.grid.manifolds.follows, motion.grid.spline, q, qd)
        jumps = np.abs(continuity.jumps(samples)).max(axis=1)
        assert jumps[:-1].max() <= 1e-10
        # q̈ = 6 t: at rest it would have to be 0 in the end.
        assert (jumps[-1] > 1e-3) == rest
