"""Given ends are eliminated: exact gradients, the optimum of other solvers, ends to rounding."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import PolynomialNullMotion
from selfmotion.planning.formulation import Formulation, bound_conditions
from selfmotion.planning.optimise import inverse_metric
from selfmotion.planning.paper import Eliminated, PublishedMotion, closed
from selfmotion.planning.paper.ends import from_unknowns, to_unknowns
from selfmotion.planning.paper.objective import residual_tangents, residuals, unmet
from selfmotion.planning.rollout import FreeStart, converged_minimum_norm
from support.arms import PANDA_HOME, central_difference, robot_named
from support.published_method import solve

# Exact gradients against extrapolated differences, relative to the largest entry.
GRADIENT = 1e-7
# The optimum against that of SciPy's, relative: both stop where steps gain less than a share of it.
OPTIMUM = 1e-7
# Ends are met to this [rad, rad/s, rad/s²].
CLOSED = 1e-11
# A few products of well-conditioned matrices.
ALGEBRA = 1e-9
# A basis is orthonormal at the nodes; between them its entries follow a spline.
BETWEEN = 1e-5

CLOSED_PATHS = {
    "closed": [sm.constraints.ClosedPath(velocity=False)],
    "closed in velocity": [sm.constraints.ClosedPath()],
    "at rest": [sm.constraints.StartVelocity(), sm.constraints.EndVelocity()],
    "accelerations": [
        sm.constraints.ClosedPath(velocity=False),
        sm.constraints.StartAcceleration(),
        sm.constraints.EndAcceleration(),
    ],
}


def problem_of(name: str) -> sm.Problem:
    """Return the paper's arm there and back, or a Panda on a circle in some rows."""
    if name == "planar":
        return sm.sample_problem(duration=2.0)
    robot = robot_named("panda")
    circle = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    null_motion = PolynomialNullMotion()
    return sm.Problem(robot, circle, name, PANDA_HOME, null_motion, constraints=(), rest=False)


def solved(
    name: str, asked: list[sm.constraints.Constraint], *, free: bool = False, **options
) -> PublishedMotion:
    problem = problem_of(name)
    formulation = Formulation.of(problem)
    minimum_norm, _ = converged_minimum_norm(formulation, np.array(problem.given_start))
    own = sm.constraints.Conditions.joined(item.conditions(problem.robot) for item in asked)
    ends = bound_conditions(formulation, own, minimum_norm.start, minimum_norm.end).ends
    return solve(formulation, minimum_norm, ends=ends, free=free, **options)


def eliminated(found: PublishedMotion) -> Eliminated:
    """Return the unknowns around x = 0 on a solution's grid, whose motion misses the ends."""
    return Eliminated(found.objective, np.zeros_like(found.x))


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("asked", CLOSED_PATHS)
@pytest.mark.parametrize("name", ["planar", "pose", "position"])
def test_the_gradient_is_that_of_motions_that_meet_the_ends(
    name: str, asked: str, free: bool
) -> None:
    function = eliminated(solved(name, CLOSED_PATHS[asked], free=free, most=1))
    y = 0.1 * np.random.default_rng(0).normal(size=function.size)
    exact = function.gradient(y)
    fine, coarse = (central_difference(function.value, y, step) for step in (1e-4, 2e-4))
    differences = (4.0 * fine - coarse) / 3.0
    assert np.abs(exact - differences).max() <= GRADIENT * max(np.abs(differences).max(), 1.0)
    direction = np.random.default_rng(1).normal(size=function.size)
    assert function.slope(y, direction) == pytest.approx(float(exact @ direction), rel=ALGEBRA)


@pytest.mark.parametrize(
    ("name", "asked", "free"),
    [
        ("planar", "closed", False),
        ("planar", "closed in velocity", False),
        ("planar", "closed", True),
        ("planar", "at rest", False),
        ("pose", "closed", False),
        ("pose", "closed in velocity", False),
        ("pose", "closed", True),
        ("position", "closed in velocity", False),
    ],
)
def test_the_optimum_is_that_of_another_solver(name: str, asked: str, free: bool) -> None:
    """SciPy's SLSQP on all unknowns, with the ends as equalities, from x = 0."""
    found = solved(name, CLOSED_PATHS[asked], free=free)
    assert found.status is sm.optimise.Status.CONVERGED
    objective = found.objective
    # In coordinates in which the cost is about as steep in all directions.
    values, vectors = np.linalg.eigh(inverse_metric(objective.metric(found.x)))
    scale = vectors * np.sqrt(values)
    other = minimize(
        lambda u: objective.value(scale @ u),
        np.zeros(objective.size),
        jac=lambda u: scale.T @ objective.gradient(scale @ u),
        constraints={
            "type": "eq",
            "fun": lambda u: residuals(objective, scale @ u),
            "jac": lambda u: residual_tangents(objective, scale @ u) @ scale,
        },
        method="SLSQP",
        options={"ftol": 1e-13, "maxiter": 300},
    )
    assert np.abs(residuals(objective, scale @ other.x)).max() < 1e-8
    assert found.cost == pytest.approx(float(other.fun), rel=OPTIMUM)
    assert np.abs(residuals(objective, found.x)).max() <= CLOSED


@pytest.mark.parametrize("asked", CLOSED_PATHS)
@pytest.mark.parametrize("name", ["planar", "pose", "pointing", "position"])
def test_ends_are_met_to_rounding_on_any_grid(name: str, asked: str) -> None:
    found = solved(name, CLOSED_PATHS[asked])
    assert found.unmet == ()
    finer = found.refined(np.arange(found.steps) % 3 == 0).refined()
    for solution in (found, finer, finer.optimised()):
        assert np.abs(residuals(solution.objective, solution.x)).max() <= CLOSED
    assert finer.steps > 2 * found.steps


def null_motion_metric(found: PublishedMotion) -> Array:
    """Return ∫ (∂ε/∂x)ᵀ (∂ε/∂x) dt, (size, size)."""
    matrix = found.objective.null_motion.matrix()
    return np.einsum("s,sid,sie->de", found.objective.grid.weights, matrix, matrix)


def test_unknowns_move_along_the_ends_and_are_orthonormal() -> None:
    found = solved("position", CLOSED_PATHS["closed in velocity"])
    function = Eliminated(found.objective, found.x)
    y = np.zeros(function.size)
    assert function.size == len(found.x) - 8
    np.testing.assert_allclose(function.point(y), found.x, atol=ALGEBRA)
    tangent = function.tangent(y)
    own = tangent.T @ null_motion_metric(found) @ tangent
    np.testing.assert_allclose(own, np.eye(function.size), atol=BETWEEN)
    away = 0.1 * np.random.default_rng(2).normal(size=function.size)
    for place in (y, away):
        rows = residual_tangents(found.objective, function.point(place))
        np.testing.assert_allclose(rows @ function.tangent(place), 0.0, atol=ALGEBRA)
        assert np.abs(residuals(found.objective, function.point(place))).max() <= CLOSED


def test_an_inverse_hessian_comes_back_from_decision_vectors() -> None:
    found = solved("position", CLOSED_PATHS["closed in velocity"])
    function = Eliminated(found.objective, found.x)
    root = np.random.default_rng(3).normal(size=(function.size, function.size))
    known = from_unknowns(function, np.zeros(function.size), root @ root.T)
    np.testing.assert_allclose(to_unknowns(function, known), root @ root.T, atol=1e-8)


def test_a_closed_point_is_the_nearest_in_the_metric() -> None:
    """To first order: half as far away, the difference to the nearest is a quarter of it."""
    found = solved("position", CLOSED_PATHS["closed"])
    objective, rng, off = found.objective, np.random.default_rng(4), []
    step = rng.normal(size=objective.size)
    for size in (1e-2, 5e-3):
        x = found.x + size * step
        rows, inverse = residual_tangents(objective, x), np.linalg.inv(null_motion_metric(found))
        spread = inverse @ rows.T
        linear = x - spread @ np.linalg.solve(rows @ spread, residuals(objective, x))
        off.append(np.linalg.norm(closed(objective, x) - linear))
    assert off[1] < 0.3 * off[0]


def test_where_no_motion_meets_the_ends_the_cost_is_infinite() -> None:
    function = eliminated(solved("pose", CLOSED_PATHS["closed"], free=True, most=1))
    far = np.full(function.size, 1e4)
    assert not function.is_met(far)
    assert function.value(far) == np.inf
    assert np.isnan(function.gradient(far)).all()


def test_ends_that_follow_from_others_change_nothing() -> None:
    """A motion at rest at both ends has equal velocities there."""
    asked = [sm.constraints.ClosedPath(velocity=False), *CLOSED_PATHS["at rest"]]
    for name in ("planar", "position"):
        plain, twice = solved(name, asked), solved(name, [*asked, sm.constraints.ClosedPath()])
        assert twice.status is sm.optimise.Status.CONVERGED
        # What follows does so but for the error of the grid.
        assert twice.cost == pytest.approx(plain.cost, rel=1e-6)
        assert twice.unmet == ()


def configuration_along(problem: sm.Problem, z: float) -> Array:
    """Return an end so far along the self-motion."""
    target = problem.follows.targets(np.zeros(1))[0]
    found = FreeStart(problem.follows, PANDA_HOME).configuration(np.array([z]), target)
    assert found is not None
    return found


@pytest.mark.parametrize("z", [-1.5, -0.3, 0.3, 1.5])
def test_a_given_end_is_reached(z: float) -> None:
    end = configuration_along(problem_of("pose"), z)
    found = solved("pose", [sm.constraints.EndConfiguration(end)])
    assert found.status is sm.optimise.Status.CONVERGED
    # What the integration leaves of the path error, put onto the path.
    np.testing.assert_allclose(found.evaluation.trajectory.q[-1], end, atol=1e-9)


def test_ends_that_contradict_each_other_are_named() -> None:
    end = configuration_along(problem_of("pose"), 0.3)
    found = solved("pose", [sm.constraints.EndConfiguration(end), sm.constraints.ClosedPath()])
    assert found.status is sm.optimise.Status.INFEASIBLE
    assert [text.split(":")[0] for text in found.unmet] == ["end configuration", "closed path"]
    # The nearest motion is one, all the same.
    assert np.isfinite(found.refined().optimised().cost)


def test_an_end_that_is_missed_is_named_on_either_side() -> None:
    objective = solved("pose", CLOSED_PATHS["closed"], most=1).objective
    signs = set()
    for seed in range(6):
        x = 0.05 * np.random.default_rng(seed).normal(size=objective.size)
        signs.add(float(np.sign(residuals(objective, x)[0])))
        assert unmet(objective, x)[0].startswith("closed path: the configuration at the end")
    assert signs == {-1.0, 1.0}


def test_limits_are_refused() -> None:
    found = solved("pose", [])
    limits = sm.constraints.JointVelocityLimits().conditions(found.objective.rollout.robot).limits
    method = replace(found.method, ends=limits)
    with pytest.raises(sm.errors.ProblemError, match="'joint velocity limits' is none on the ends"):
        method.on(found.objective.grid)
