"""Nodes on their self-motion manifolds, on every arm and task."""

import numpy as np

import selfmotion as sm
from selfmotion.model.follow import null_basis
from selfmotion.planning.nodes import null_motion_of
from support.arms import Case, robot_named, start_of
from support.nodes import around_of, centred, moved, nodes_of, problem_of, random_step

# Newton's method stops there [m, rad]; what follows from it is rounding.
ON_PATH = 1e-11
# Central differences at this distance are right to its square, and rounding over it.
NEAR, DIFFERENCE = 1e-5, 1e-7
# Second differences, of which those along the manifold lose twice as many digits.
BENT = 1e-5


def test_nodes_are_on_the_path_wherever_they_go(case: Case) -> None:
    motion = nodes_of(problem_of(case))
    for seed in range(3):
        step = random_step(motion, seed, 0.05)
        place = moved(motion, step).place
        for k, t in enumerate(motion.grid.t):
            item = motion.grid.formulation.follows.items[0]
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
        inverse, epsilon = np.linalg.pinv(jacobian), null_motion_of(motion)[k]
        expected = inverse @ twist + epsilon - inverse @ (jacobian @ epsilon)
        np.testing.assert_allclose(qd, expected, atol=1e-9)


def test_accelerations_are_those_of_the_path(case: Case) -> None:
    """With q̈ = J⁺(ẍ - J̇q̇) + (I - J⁺J) N0 α, q(t) is on the path to third order."""
    motion = nodes_of(problem_of(case), 8)
    motion = centred(moved(motion, random_step(motion, 5, 0.05)))
    # Also at both ends of the path, where it is known to one side alone.
    signs = np.where(motion.grid.t < 0.5 * motion.grid.t[-1], 1.0, -1.0)
    place, item = motion.place, motion.grid.formulation.follows.items[0]
    errors = []
    for size in np.array([2e-2, 1e-2]) / max(1.0, np.abs(place.qd).max()):
        step = size * signs[:, None]
        later = place.q + step * place.qd + 0.5 * step**2 * place.qdd
        times = motion.grid.t + step[:, 0]
        each = [item.error(x, y) for x, y in zip(times, later, strict=True)]
        errors.append(np.abs(each).max())
    if errors[0] > 1e-9:
        assert np.log2(errors[0] / errors[1]) > 2.8, errors


def test_tangents_are_central_differences(case: Case) -> None:
    """Γ = ∂(q, q̇, q̈)/∂(z, ν, α)."""
    motion = nodes_of(problem_of(case))
    here = centred(moved(motion, random_step(motion, 2, 0.02)))
    step = random_step(motion, 3)
    above, below = (moved(here, sign * NEAR * step).place.nodes for sign in (1.0, -1.0))
    expected = (above - below) / (2 * NEAR)
    found = np.einsum("konw,kw->kon", around_of(here).changes, step)
    np.testing.assert_allclose(found, expected, atol=DIFFERENCE * np.abs(expected).max())
    # A wrong step is seen.
    wrong = np.einsum("konw,kw->kon", around_of(here).changes, 1.01 * step)
    assert np.abs(wrong - expected).max() > 1e-4 * np.abs(expected).max()


def test_what_nodes_bend_by_is_a_central_difference(case: Case) -> None:
    """∂(Γᵀλ)/∂w, at charts around the nodes: of λᵀ(q, q̇, q̈) the second derivatives."""
    motion = nodes_of(problem_of(case))
    here = centred(moved(motion, random_step(motion, 2, 0.02)))
    step = random_step(motion, 3)
    force = np.random.default_rng(4).normal(size=here.place.nodes.shape)

    def value(size: float) -> np.ndarray:
        return np.sum(force * moved(here, size * step).place.nodes, axis=(1, 2))

    def bent(size: float) -> np.ndarray:
        return (value(size) - 2.0 * value(0.0) + value(-size)) / size**2

    # Without the error of second order.
    expected = (4.0 * bent(3e-4) - bent(6e-4)) / 3.0
    curvature = around_of(here, force).curvature
    found = np.einsum("kv,kvw,kw->k", step, curvature, step)
    np.testing.assert_allclose(found, expected, atol=BENT * max(1.0, np.abs(expected).max()))
    np.testing.assert_allclose(curvature, np.swapaxes(curvature, 1, 2), atol=1e-9)


def test_charts_around_nodes_are_of_the_same_motion(case: Case) -> None:
    """What of ε and a does not act is left out, and what is known there is what eq. 4 says anew."""
    motion = nodes_of(problem_of(case))
    step, r = random_step(motion, 5, 0.05), motion.nu.shape[1]
    there = moved(motion, step)
    given = null_motion_of(there), there.charts.spread(there.alpha)
    found = there.charts.centred(step[:, :r], *given)
    assert found is not None
    charts, nu, alpha, place = found
    again = charts.at(np.zeros_like(nu), nu, alpha)
    assert again is not None
    for one in (place, again):
        np.testing.assert_allclose(one.q, there.place.q, atol=ON_PATH)
        np.testing.assert_allclose(one.qd, there.place.qd, atol=1e-9)
        np.testing.assert_allclose(one.qdd, there.place.qdd, atol=1e-8)
        np.testing.assert_allclose(one.tangents, charts.bases, atol=1e-9)
    jacobians = np.array([motion.grid.formulation.follows.jacobian(q) for q in place.q])
    np.testing.assert_allclose(jacobians @ charts.bases, 0.0, atol=1e-9)
    unit = np.swapaxes(charts.bases, 1, 2) @ charts.bases
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(unit.shape[1]), unit.shape), atol=1e-12)


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


def test_from_rest_to_rest_where_no_time_is_given() -> None:
    """Along a self-motion of a path that stands still, as 10 u³ - 15 u⁴ + 6 u⁵ rises."""
    robot = robot_named("planar_3r")
    start = start_of(robot, "planar")
    still = sm.paths.Dwell(robot.pose(start), 2.0)
    grid = nodes_of(problem_of((robot, sm.Task.PLANAR, start, still)), 40).grid
    wanted = start + 0.01 * null_basis(grid.formulation.follows, start)[:, 0]
    motion = grid.motion_towards(start, wanted)
    assert motion is not None
    u = grid.t / grid.t[-1]
    way = (motion.place.q - start) @ (wanted - start) / np.sum((wanted - start) ** 2)
    np.testing.assert_allclose(way, u**3 * (10.0 - 15.0 * u + 6.0 * u**2), atol=1e-2)
    assert way[-1] > 0.99


def test_charts_of_motions_side_by_side_are_those_of_each_alone(case: Case) -> None:
    """Each begins anew, with the basis that its first node has."""
    motion = nodes_of(problem_of(case), 6)
    many = motion.grid.copied(3).manifolds
    own = motion.place.q, motion.place.qd, motion.place.qdd
    together = many.near(*(np.tile(x, (3, 1)) for x in own))
    alone = motion.grid.manifolds.near(*own)
    assert together is not None
    assert alone is not None
    for k in range(3):
        rows = slice(7 * k, 7 * (k + 1))
        np.testing.assert_allclose(together.charts.bases[rows], alone.charts.bases, atol=1e-9)
        np.testing.assert_allclose(together.nu[rows], alone.nu, atol=1e-9)
