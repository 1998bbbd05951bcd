"""The cost of nodes, its gradient and its curvature."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.nodes.objective import scattered
from selfmotion.optimise import Banded
from selfmotion.robot import has_masses
from support.arms import Case
from support.nodes import around_of, centred, moved, nodes_of, problem_of, random_step

NEAR = 1e-5
# Of central differences at that distance, relative to the largest entry.
GRADIENT, CURVATURE = 1e-7, 1e-6


def costs_of(robot: sm.RobotModel) -> tuple[sm.Cost, ...]:
    weight = np.linspace(0.5, 2.0, robot.dof)
    posture = np.full(robot.dof, 0.2)
    return (
        sm.JointVelocity(weight),
        sm.JointAcceleration(0.01),
        sm.Posture(posture=posture, weight=0.3),
    )


def gradient(motion):
    slopes = scattered(motion.grid.cost.slopes(motion.samples, motion.partials))
    return motion.charts.pulled(motion.place, slopes[:, 0], slopes[:, 1])


@pytest.mark.parametrize("rest", [False, True])
def test_gradient_and_curvature_are_central_differences(case: Case, rest: bool) -> None:
    costs = (sm.JointVelocity(),) if rest else costs_of(case[0])
    motion = nodes_of(problem_of(case, costs=costs, rest=rest))
    motion = centred(moved(motion, random_step(motion, 1, 0.02)))
    step = random_step(motion, 2)
    above, below = (moved(motion, sign * NEAR * step) for sign in (1.0, -1.0))
    slope = (above.aim - below.aim) / (2 * NEAR)
    own = gradient(motion)
    assert abs(np.sum(own * step) - slope) < GRADIENT * np.abs(own).max() * step.size
    # Charts around the same motion: ν there is another function of z, but its zero is the same.
    slopes = scattered(motion.grid.cost.slopes(motion.samples, motion.partials))
    around = around_of(motion, slopes)
    matrix = Banded(len(motion.nu), step.shape[1], 1)
    matrix.add(0, 0, around.curvature)
    matrix.add_pairs(0, motion.grid.cost.curvature(motion.samples, motion.partials, around.changes))
    change = (gradient(above) - gradient(below)) / (2 * NEAR)
    product = matrix.dense() @ step.ravel()
    np.testing.assert_allclose(product, change.ravel(), atol=CURVATURE * np.abs(product).max())


@pytest.mark.parametrize("kind", ["manipulability", "energy", "function", "limits"])
def test_curvature_of_other_costs_is_right_to_second_order(case: Case, kind: str) -> None:
    """Differences along the self-motion are all there is of it, as intervals become short."""
    robot = case[0]
    costs = {
        "manipulability": sm.InverseManipulability(0.1),
        "energy": sm.KineticEnergy(robot) if has_masses(robot) else None,
        "function": sm.FunctionCost(lambda qd, q, t: np.sum(qd**4 + np.cos(q) * qd**2, axis=1)),
        "limits": sm.JointLimitDistance(np.full(robot.dof, -4.0), np.full(robot.dof, 4.0)),
    }
    cost = costs[kind]
    if cost is None:
        return
    off = []
    for count in (12, 48):
        motion = nodes_of(problem_of(case, costs=(sm.JointVelocity(), cost)), count)
        shape = np.sin(np.linspace(0.0, 3.0, count + 1))[:, None]
        step = shape * np.ones(2 * motion.nu.shape[1])
        slopes = scattered(motion.grid.cost.slopes(motion.samples, motion.partials))
        around = around_of(motion, slopes)
        intervals = motion.grid.cost.curvature(motion.samples, motion.partials, around.changes)
        matrix = Banded(count + 1, step.shape[1], 1)
        matrix.add(0, 0, around.curvature)
        matrix.add_pairs(0, intervals)
        change = gradient(moved(motion, NEAR * step)) - gradient(moved(motion, -NEAR * step))
        change = change.ravel() / (2 * NEAR)
        product = matrix.dense() @ step.ravel()
        # Along some self-motions a cost is the same: what is left of two terms that cancel.
        size = np.abs(matrix.dense()).max()
        off.append(np.abs(product - change).max() / size)
    assert off[1] < max(0.3 * off[0], 1e-4), off
    assert off[1] < 0.05


def test_what_is_minimised_besides_is_no_cost(case: Case) -> None:
    motion = nodes_of(problem_of(case, rest=True))
    assert motion.aim > motion.cost
    assert nodes_of(problem_of(case)).aim == nodes_of(problem_of(case)).cost


def test_the_cost_is_of_fourth_order(case: Case) -> None:
    """Of the motion at x = 0: twice the nodes, a sixteenth of the error."""
    costs = [nodes_of(problem_of(case), count).cost for count in (8, 16, 32, 256)]
    errors = np.abs(np.array(costs[:-1]) - costs[-1])
    if errors[-1] > 1e-12 * costs[-1]:
        orders = np.log2(errors[:-1] / errors[1:])
        assert orders.min() > 3.0, (errors, orders)


def test_in_lots_the_curvature_is_the_same(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = nodes_of(problem_of(case))
    changes = around_of(motion).changes
    at_once = motion.grid.cost.curvature(motion.samples, motion.partials, changes)
    monkeypatch.setattr("selfmotion.nodes.objective._LOT", 5)
    found = motion.grid.cost.curvature(motion.samples, motion.partials, changes)
    np.testing.assert_array_equal(found, at_once)
