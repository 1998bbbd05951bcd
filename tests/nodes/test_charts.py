"""Nodes on their self-motion manifolds, on every arm and task."""

import numpy as np

from support.arms import Case
from support.nodes import centred, moved, nodes_of, problem_of, random_step

# Newton's method stops there [m, rad]; what follows from it is rounding.
ON_PATH = 1e-11
# Central differences at this distance are right to its square, and rounding over it.
NEAR, DIFFERENCE = 1e-5, 1e-7


def test_nodes_are_on_the_path_wherever_they_go(case: Case) -> None:
    motion = nodes_of(problem_of(case))
    for seed in range(3):
        step = random_step(motion, seed, 0.05)
        place = moved(motion, step).place
        for k, t in enumerate(motion.grid.t):
            item = motion.grid.problem.follows.items[0]
            assert np.abs(item.error(t, place.q[k])).max() < ON_PATH
        r = motion.nu.shape[1]
        away = place.q - motion.charts.q
        coordinates = np.einsum("knr,kn->kr", motion.charts.bases, away)
        np.testing.assert_allclose(coordinates, step[:, :r], atol=ON_PATH)


def test_they_move_by_equation_4(case: Case) -> None:
    robot, task, _, path = case
    motion = nodes_of(problem_of(case))
    motion = moved(motion, random_step(motion, 1, 0.05))
    target = path.samples(motion.grid.t)
    for k, (q, qd) in enumerate(zip(motion.place.q, motion.place.qd, strict=True)):
        jacobian = robot.task_jacobian(q, task)
        twist = task.select(target.twist[k][:, None], robot.pose(q).rotation)[:, 0]
        inverse, epsilon = np.linalg.pinv(jacobian), motion.epsilon[k]
        expected = inverse @ twist + epsilon - inverse @ (jacobian @ epsilon)
        np.testing.assert_allclose(qd, expected, atol=1e-9)


def test_accelerations_are_those_of_the_path(case: Case) -> None:
    """With J⁺(ẍ - J̇q̇) and any null acceleration, q(t) is on the path to third order."""
    motion = nodes_of(problem_of(case), 8)
    motion = centred(moved(motion, random_step(motion, 5, 0.05)))
    q, qd, t = motion.place.q[1:-1], motion.place.qd[1:-1], motion.grid.t[1:-1]
    qdd = motion.grid.manifolds.accelerations(motion.place)[1:-1]
    null = motion.charts.bases[1:-1, :, 0]
    item, errors = motion.grid.problem.follows.items[0], []
    for step in np.array([2e-2, 1e-2]) / max(1.0, np.abs(qd).max()):
        later = q + step * qd + 0.5 * step**2 * (qdd + 0.3 * null)
        each = [item.error(x + step, y) for x, y in zip(t, later, strict=True)]
        errors.append(np.abs(each).max())
    if errors[0] > 1e-9:
        assert np.log2(errors[0] / errors[1]) > 2.8, errors


def test_tangents_and_pullbacks_are_central_differences(case: Case) -> None:
    motion = nodes_of(problem_of(case))
    motion = moved(motion, random_step(motion, 2, 0.02))
    step, rng = random_step(motion, 3), np.random.default_rng(4)
    by_q, by_qd = rng.normal(size=(2, *motion.place.q.shape))
    here = centred(motion)
    above, below = (moved(here, sign * NEAR * step).place for sign in (1.0, -1.0))
    change_q, change_qd = (above.q - below.q) / (2 * NEAR), (above.qd - below.qd) / (2 * NEAR)
    r = here.nu.shape[1]
    tangent = (here.place.tangents @ step[:, :r, None])[:, :, 0]
    np.testing.assert_allclose(tangent, change_q, atol=DIFFERENCE * np.abs(change_q).max())
    pulled = here.charts.pulled(here.place, by_q, by_qd)
    # Of what is held nothing moves: z of the start and nothing else.
    expected = np.sum(by_q * change_q) + np.sum(by_qd * change_qd)
    assert abs(np.sum(pulled * step) - expected) < DIFFERENCE * np.abs(pulled).max() * step.size
    # The same with a wrong cotangent is seen.
    wrong = here.charts.pulled(here.place, by_q, 1.01 * by_qd)
    assert abs(np.sum(wrong * step) - expected) > 1e-4


def test_charts_around_nodes_are_of_the_same_motion(case: Case) -> None:
    """What of ε does not act is left out, and what is known there is what eq. 4 says anew."""
    motion = nodes_of(problem_of(case))
    step, r = random_step(motion, 5, 0.05), motion.nu.shape[1]
    there = moved(motion, step)
    found = there.charts.centred(step[:, :r], there.epsilon)
    assert found is not None
    charts, nu, place = found
    again = charts.at(np.zeros_like(nu), nu)
    assert again is not None
    for one in (place, again):
        np.testing.assert_allclose(one.q, there.place.q, atol=ON_PATH)
        np.testing.assert_allclose(one.qd, there.place.qd, atol=1e-9)
        np.testing.assert_allclose(one.tangents, charts.bases, atol=1e-9)
    by_q, by_qd = np.random.default_rng(8).normal(size=(2, *place.q.shape))
    slopes = [charts.pulled(one, by_q, by_qd) for one in (place, again)]
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-8 * np.abs(slopes[1]).max())
    jacobians = np.array([motion.grid.problem.follows.jacobian(q) for q in place.q])
    np.testing.assert_allclose(jacobians @ charts.bases, 0.0, atol=1e-9)
    unit = np.swapaxes(charts.bases, 1, 2) @ charts.bases
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(unit.shape[1]), unit.shape), atol=1e-12)


def test_other_null_motions_of_the_same_nodes_change_nothing_else(case: Case) -> None:
    motion = centred(nodes_of(problem_of(case)))
    wanted, none = np.random.default_rng(9).normal(size=motion.place.q.shape), 0.0 * motion.nu
    found = motion.charts.moving(motion.place, wanted)
    expected = motion.charts.centred(none, wanted)
    assert expected is not None
    np.testing.assert_allclose(found.nu, expected.nu, atol=1e-9)
    for name in ("q", "qd", "tangents"):
        own, other = (getattr(one.place, name) for one in (found, expected))
        np.testing.assert_allclose(own, other, atol=1e-9)
    slopes = [each.charts.pulled(each.place, wanted, wanted[::-1]) for each in (found, expected)]
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-8 * np.abs(slopes[1]).max())


def test_towards_a_configuration(case: Case) -> None:
    robot, _, start, path = case
    grid = nodes_of(problem_of(case), 60).grid
    lower, upper = robot.finite_limits()
    wanted = 0.5 * (lower + upper)
    quick = grid.motion_towards(start, wanted, 0.1 * path.duration)
    slow = grid.motion_towards(start, wanted, 1e6 * path.duration)
    assert quick is not None
    assert slow is not None
    np.testing.assert_allclose(quick.place.q[0], start, atol=1e-9)
    apart = [np.linalg.norm(one.place.q[-1] - wanted) for one in (quick, slow)]
    assert apart[0] <= apart[1] + 1e-9
