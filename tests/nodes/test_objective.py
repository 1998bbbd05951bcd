"""The cost of nodes, its gradient and its curvature."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.model.robot import has_masses
from selfmotion.planning.formulation import Formulation, with_springs
from selfmotion.planning.nodes import NodeGrid, NodeMotion, objective, on_grid
from selfmotion.planning.nodes.motion import slopes_of, terms_of
from selfmotion.planning.nodes.node_matrix import NodeMatrix
from selfmotion.planning.nodes.quadratic import QuadraticForms
from selfmotion.planning.nodes.spline import Quintic
from selfmotion.planning.optimise import Banded
from selfmotion.problem.costs import Partials, Samples
from support.arms import PANDA_HOME, Case
from support.nodes import along, around_of, centred, moved, nodes_of, problem_of, random_step

NEAR = 1e-5
# Of central differences at that distance, relative to the largest entry.
GRADIENT, CURVATURE = 1e-7, 1e-6


def costs_of(robot: sm.RobotModel) -> tuple[sm.costs.Cost, ...]:
    weight = np.linspace(0.5, 2.0, robot.dof)
    posture = np.full(robot.dof, 0.2)
    return (
        sm.costs.JointVelocity(weight),
        sm.costs.JointAcceleration(0.01),
        sm.costs.Posture(posture=posture, weight=0.3),
    )


def force_of(motion):
    """Return λ = ∂F/∂(q, q̇, q̈) of the nodes."""
    return motion.grid.spline.scatter(slopes_of(motion))


def gradient(motion):
    return np.einsum("konw,kon->kw", around_of(motion).changes, force_of(motion))


def matrix_of(motion) -> Banded:
    """Return the matrix of second derivatives."""
    around = around_of(motion, force_of(motion))
    by = motion.grid.spline.changes(around.changes)
    curvature = NodeMatrix.zeros(*around.curvature.shape[:2])
    motion.grid.cost.add_curvature(curvature, by, motion.sampled, motion.partials)
    matrix = curvature.banded()
    matrix.add(0, 0, around.curvature)
    return matrix


@pytest.mark.parametrize("rest", [False, True])
def test_gradient_and_curvature_are_central_differences(case: Case, rest: bool) -> None:
    costs = (sm.costs.JointVelocity(),) if rest else costs_of(case[0])
    motion = nodes_of(problem_of(case, costs=costs, rest=rest))
    motion = centred(moved(motion, random_step(motion, 1, 0.02)))
    # As large in q, q̇ and q̈ between the nodes.
    step = random_step(motion, 2) * motion.grid.scale
    above, below = (moved(motion, sign * NEAR * step) for sign in (1.0, -1.0))
    slope = (above.objective - below.objective) / (2 * NEAR)
    own = gradient(motion)
    allowed = GRADIENT * np.abs(own * step).sum() + 1e-9 * motion.objective
    assert abs(np.sum(own * step) - slope) < allowed
    bent = (above.objective - 2.0 * motion.objective + below.objective) / NEAR**2
    product = float(step.ravel() @ matrix_of(motion).dense() @ step.ravel())
    assert product == pytest.approx(bent, rel=1e-4, abs=1e-4 * motion.objective)
    # The change of what the cost weighs along a step is that of its ends.
    change = (above.curve_ends - below.curve_ends) / (2 * NEAR)
    found = along(motion, around_of(motion).changes, step)
    np.testing.assert_allclose(found, change, atol=1e-6 * np.abs(change).max())


@pytest.mark.parametrize("kind", ["manipulability", "energy", "function", "limits"])
def test_curvature_of_other_costs_is_right_to_second_order(case: Case, kind: str) -> None:
    """Differences along the self-motion are all there is of it, as intervals become short."""
    robot = case[0]
    costs = {
        "manipulability": sm.costs.InverseManipulability(0.1),
        "energy": sm.costs.KineticEnergy(robot) if has_masses(robot) else None,
        "function": sm.costs.FunctionCost(
            lambda qd, q, t: np.sum(qd**4 + np.cos(q) * qd**2, axis=1)
        ),
        "limits": sm.costs.JointLimitDistance(np.full(robot.dof, -4.0), np.full(robot.dof, 4.0)),
    }
    cost = costs[kind]
    if cost is None:
        return
    off = []
    for count in (12, 48):
        motion = nodes_of(problem_of(case, costs=(sm.costs.JointVelocity(), cost)), count)
        shape = np.sin(np.linspace(0.0, 3.0, count + 1))[:, None]
        step = shape * np.ones(3 * motion.nu.shape[1])
        dense = matrix_of(motion).dense()
        above, below = (moved(motion, sign * 1e-4 * step).objective for sign in (1.0, -1.0))
        bent = (above - 2.0 * motion.objective + below) / 1e-8
        product = float(step.ravel() @ dense @ step.ravel())
        off.append(abs(product - bent) / max(abs(bent), motion.objective))
    assert off[1] < max(0.3 * off[0], 1e-3), off
    assert off[1] < 0.05


def test_what_is_minimised_besides_is_no_cost(case: Case) -> None:
    resting, motion = nodes_of(problem_of(case, rest=True)), nodes_of(problem_of(case))
    # At rest, starts and stops count; elsewhere nothing does unless the motion is to be calm.
    assert resting.objective > resting.cost
    assert motion.objective == motion.cost
    smoothed = on_grid(motion, motion.grid.on(motion.grid.t, smoothed=True))
    assert smoothed is not None
    assert smoothed.cost < smoothed.objective < 1.01 * smoothed.cost


def test_the_cost_converges_quickly(case: Case) -> None:
    """Of the motion at x = 0, in the norm that it minimises: twice the nodes, an eighth of it off.

    In another norm, as where a metre of a lift counts ten radians, it is off by the motion's error.
    """
    same = problem_of(case, costs=(sm.costs.JointVelocity(),))
    costs = [nodes_of(same, count).cost for count in (8, 16, 32, 256)]
    errors = np.abs(np.array(costs[:-1]) - costs[-1])
    if errors[-1] > 1e-8 * costs[-1]:
        orders = np.log2(errors[:-1] / errors[1:])
        assert orders.min() > 2.5, (errors, orders)


def test_the_number_of_passes_changes_nothing(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    costs = (sm.costs.JointVelocity(), sm.costs.InverseManipulability(0.1))
    motion = nodes_of(problem_of((panda, "position", PANDA_HOME, path), costs=costs), 6)
    at_once = matrix_of(motion).dense()
    monkeypatch.setattr(objective, "_TOGETHER", 1)
    np.testing.assert_allclose(matrix_of(motion).dense(), at_once, rtol=1e-12)


def test_directions_between_nodes_hardly_move_the_tool(panda: sm.RobotModel) -> None:
    """To second order in the length of an interval, of the self-motions at its two nodes."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    moved = []
    for count in (16, 32):
        motion = nodes_of(problem_of((panda, "pose", PANDA_HOME, path)), count)
        by = motion.grid.spline.changes(around_of(motion).changes)
        directions = objective._directions(motion.grid.cost, by)
        units = np.einsum("sni,snj->sij", directions, directions)
        np.testing.assert_allclose(units, np.broadcast_to(np.eye(1), units.shape), atol=1e-12)
        jacobians = [panda.task_jacobian(q, sm.Task.POSE) for q in motion.sampled.arm.q]
        moved.append(max(np.abs(j @ d).max() for j, d in zip(jacobians, directions, strict=True)))
    assert moved[1] < 0.3 * moved[0] < 0.1


def test_springs_of_tolerances_are_part_of_the_cost_and_its_derivatives(
    panda: sm.RobotModel,
) -> None:
    """F rises by ½ ∫ Σ k δ² dt; its gradient and curvature are differences of that."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    band = sm.Relaxation(("rx", "ry"), 0.2)
    problem = problem_of((panda, "pose", PANDA_HOME, path), relaxations=[band])
    without = moved(nodes_of(problem), 0.03 * np.ones((13, 9)))
    grid = without.grid
    stiff = NodeGrid(
        with_springs(grid.formulation, 3.0), grid.t, grid.conditions, free=False, counts=Counts()
    )
    motion = on_grid(centred(without), stiff)
    assert motion is not None
    deviations, weights = motion.sampled.tolerances.q, motion.sampled.arm.weights
    springs = stiff.formulation.springs
    assert springs is not None
    assert (springs > 0.0).all()
    assert np.abs(deviations).max() > 1e-3
    extra = 0.5 * float(weights @ (deviations**2 @ springs))
    assert summed(motion) - without.objective == pytest.approx(extra, rel=1e-6)
    step = random_step(motion, 2) * motion.grid.scale
    above, below = (summed(moved(motion, sign * NEAR * step)) for sign in (1.0, -1.0))
    slope = (above - below) / (2 * NEAR)
    own = gradient(motion)
    assert abs(np.sum(own * step) - slope) < GRADIENT * np.abs(own * step).sum() + 1e-8
    bent = (above - 2.0 * summed(motion) + below) / NEAR**2
    product = float(step.ravel() @ matrix_of(motion).dense() @ step.ravel())
    assert product == pytest.approx(bent, rel=1e-3)


def summed(motion: NodeMotion) -> float:
    """Return the integral of all that is minimised of motions with springs."""
    return float(motion.quadratic.costs.sum())


class Doubled(sm.costs.JointVelocity):
    """A cost of one's own that derives from a quadratic one, and is evaluated otherwise."""

    def value(self, samples: Samples) -> Array:
        return 2.0 * super().value(samples)

    def gradient(self, samples: Samples) -> Partials:
        return Partials(qd=2.0 * super().gradient(samples).qd)


def test_what_derives_from_a_quadratic_cost_is_evaluated_as_it_says(case: Case) -> None:
    """By its own value and gradient: the curvature of its base is another one's."""
    once, twice = (
        nodes_of(problem_of(case, costs=[cost])) for cost in (sm.costs.JointVelocity(), Doubled())
    )
    assert once.grid.cost.is_quadratic
    assert not twice.grid.cost.is_quadratic
    assert twice.cost == pytest.approx(2.0 * once.cost, rel=1e-12)
    largest = np.abs(slopes_of(once)).max()
    np.testing.assert_allclose(slopes_of(twice), 2.0 * slopes_of(once), atol=1e-12 * largest)


def test_costs_by_their_forms_are_those_by_their_samples(case: Case) -> None:
    """Value and terms; also with a posture far away, and with joints that are coupled."""
    coupled = np.eye(case[0].dof) + 0.2
    costs = [*costs_of(case[0]), sm.costs.JointVelocity(coupled, name="coupled")]
    motion = nodes_of(problem_of(case, costs=costs, rest=True))
    motion = centred(moved(motion, random_step(motion, 1, 0.02)))
    assert motion.grid.cost.is_quadratic
    assert motion.cost == pytest.approx(sum(terms_of(motion).values()), rel=1e-12)


@pytest.mark.parametrize(
    ("cost", "integral"),
    [
        (sm.costs.JointVelocity(), 10.0 / 7.0),
        (sm.costs.JointAcceleration(), 120.0 / 7.0),
        (sm.costs.JointJerk(), 720.0),
    ],
)
@pytest.mark.parametrize("count", [1, 400])
def test_costs_by_their_forms_keep_their_digits_on_short_intervals(
    panda: sm.RobotModel, cost: sm.costs.Cost, integral: float, count: int
) -> None:
    """Of a rise of 1 in 1 s by 10 s³ - 15 s⁴ + 6 s⁵, whose integrals of squares are known."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 1.0, normal=(1.0, 0.0, 0.0))
    problem = problem_of((panda, "position", PANDA_HOME, path), costs=[cost])
    s = np.linspace(0.0, 1.0, count + 1)
    rise = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    each = np.stack([rise(s), rise.deriv(1)(s), rise.deriv(2)(s)], axis=1)
    nodes = np.tile(each[:, :, None], (1, 1, panda.dof))
    nodes[:, 0] += PANDA_HOME
    spline = Quintic(s)
    forms = QuadraticForms(Formulation.of(problem), spline, None)
    costs = forms.at(spline.ends(nodes)).costs
    # Rounding of q is 1e-16, and a jerk is a difference of q over the third power of 1/400 s.
    assert costs.sum() == pytest.approx(0.5 * panda.dof * integral, rel=1e-9)
