"""Chains of trees: between any two frames, as places and as derivatives."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.robot import Chain, Kinematics, ToolRates
from support.arms import central_difference
from support.own_kinematics import Arm
from support.random_cells import LEFT, RIGHT, random_cell
from support.two_arms import baxter_with_both_arms

# Rounding of a dozen products of rotations and lengths [m, rad].
EXACT = 1e-12
# Central differences of places, relative to lengths of a metre.
DIFFERENCE = 1e-7
CELLS = range(20)


def cell(seed: int, folder: Path) -> tuple[sm.RobotModel, Array, np.random.Generator]:
    rng = np.random.default_rng(seed)
    robot = sm.load_robot(random_cell(rng, folder), tool=(LEFT, RIGHT))
    return robot, np.array(rng.uniform(robot.lower, robot.upper)), rng


def chains(robot: sm.RobotModel) -> list[Chain]:
    pairs = ((LEFT, None), (RIGHT, None), (LEFT, RIGHT), (RIGHT, LEFT))
    return [robot.chain_to(tool, reference) for tool, reference in pairs]


@pytest.mark.parametrize("seed", CELLS)
def test_the_tip_is_where_yourdfpy_has_it(seed: int, tmp_path: Path) -> None:
    """In the base's frame, and by the arrays that compiled kinematics take."""
    robot, q, _ = cell(seed, tmp_path)
    arm = Arm(robot)
    for chain in chains(robot):
        turn, at = (x[0] for x in arm.place(chain.tip_name, q[None]))
        if chain.base:
            base, origin = (x[0] for x in arm.place(robot.model.frames[chain.base].name, q[None]))
            turn, at = base.T @ turn, base.T @ (at - origin)
        found = chain.place(q)
        np.testing.assert_allclose(found.rotation, turn, atol=EXACT)
        np.testing.assert_allclose(found.translation, at, atol=EXACT)
        np.testing.assert_allclose(serial(chain, q).homogeneous, found.homogeneous, atol=EXACT)


def serial(chain: Chain, q: Array) -> pin.SE3:
    """Return the tip's place by the chain's arrays."""
    tree, rotation, position = chain.arrays
    place = pin.SE3.Identity()
    rows = zip(
        tree.joints, tree.rotations, tree.positions, tree.axes, tree.is_revolute, strict=True
    )
    for joint, turn, at, axis, is_revolute in rows:
        moved = q[joint] * axis
        own = (pin.exp3(moved), np.zeros(3)) if is_revolute else (np.eye(3), moved)
        place = place * pin.SE3(turn, at) * pin.SE3(*own)
    return place * pin.SE3(rotation, position)


@pytest.mark.parametrize("seed", CELLS)
def test_jacobians_are_derivatives_of_places(seed: int, tmp_path: Path) -> None:
    """[v, ω] in the base's axes, also where the base moves."""
    robot, q, _ = cell(seed, tmp_path)
    for chain in chains(robot):
        jacobian, rotation, _ = chain.at(q)

        def moved(row: int, chain: Chain = chain, rotation: Array = rotation) -> Any:
            def value(x: Array) -> float:
                place = chain.place(x)
                turn = pin.log3(place.rotation @ rotation.T)
                return float(np.concatenate([place.translation, turn])[row])

            return value

        expected = np.array([central_difference(moved(row), q) for row in range(6)])
        np.testing.assert_allclose(jacobian, expected, atol=DIFFERENCE)
        assert not jacobian[:, chain.signs == 0.0].any()


@pytest.mark.parametrize("seed", CELLS)
def test_rates_of_a_tip_are_derivatives_in_its_base(seed: int, tmp_path: Path) -> None:
    """|v|, |ω| and accelerations along a polynomial, and their derivatives."""
    robot, q, rng = cell(seed, tmp_path)
    qd, qdd, h = *rng.normal(size=(2, robot.dof)), 1e-4
    for chain in chains(robot)[2:]:
        rates = ToolRates(chain)
        velocity, acceleration = rates(q[None], qd[None], qdd[None])

        def twist(t: float, chain: Chain = chain) -> Array:
            jacobian, rotation, _ = chain.at(q + t * qd + 0.5 * t * t * qdd)
            return np.array(
                [rotation.T @ part for part in (jacobian @ (qd + t * qdd)).reshape(2, 3)]
            )

        turn = chain.place(q).rotation
        np.testing.assert_allclose(velocity[0].reshape(2, 3), twist(0.0), atol=EXACT * 10)
        change = [
            [chain.place(q + t * qd + 0.5 * t * t * qdd).rotation @ part for part in twist(t)]
            for t in (h, -h)
        ]
        expected = (np.array(change[0]) - np.array(change[1])) / (2 * h) @ turn
        np.testing.assert_allclose(acceleration[0].reshape(2, 3), expected, atol=1e-5)
        by_q = rates.derivatives(q[None], qd[None], qdd[None])[1][0][0]

        def row(k: int, rates: ToolRates = rates) -> Callable[[Array], float]:
            return lambda x: float(rates(x[None], qd[None], qdd[None])[1][0, k])

        slopes = np.array([central_difference(row(k), q) for k in range(6)])
        np.testing.assert_allclose(by_q, slopes, atol=1e-6 * max(1.0, np.abs(slopes).max()))


def test_joints_that_move_both_frames_drop_out() -> None:
    """Baxter's hands: 7 joints each, seven passed from the far side."""
    robot = baxter_with_both_arms()
    chain = robot.chain_to("right_gripper", "left_gripper")
    assert sorted(chain.joints.tolist()) == list(range(14))
    assert (chain.signs == -1.0).sum() == (chain.signs == 1.0).sum() == 7
    np.testing.assert_array_equal(chain.joints[:7], chain.joints[:7][np.argsort(-chain.joints[:7])])


class ByHand(Kinematics):
    """Another library's kinematics: places by the chain's arrays, derivatives by differences."""

    __slots__ = ("asked",)

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self.asked = 0
        self.jacobian = np.zeros((6, chain.dof), order="F")
        self.rotation, self.translation = np.zeros((3, 3), order="F"), np.zeros(3)

    def refresh(self, q: Array) -> None:
        self.asked += 1
        place = serial(self.chain, q)
        for k, step in enumerate(1e-6 * np.eye(self.chain.dof)):
            change = serial(self.chain, q + step) * serial(self.chain, q - step).inverse()
            self.jacobian[:, k] = pin.log6(change).vector / 2e-6
        self.rotation[:], self.translation[:] = place.rotation, place.translation

    def march(
        self, q: Array, step: Callable[..., bool], *arguments: Any, beside: Any = ()
    ) -> int | None:
        for s, configuration in enumerate(q):
            self.refresh(configuration)
            if not step(s, 0, self.jacobian, self.rotation, self.translation, *arguments):
                return s
        return None


def test_another_library_is_one_class(panda: sm.RobotModel) -> None:
    """Whoever marches along configurations sees the same, up to the differences."""
    q = np.random.default_rng(0).uniform(0.5 * panda.lower, 0.5 * panda.upper, (5, 7))

    def seen(tip: Kinematics) -> Array:
        found = []

        def step(s: int, f: int, *where: Array) -> bool:
            found.append(np.concatenate([part.ravel() for part in where]))
            return True

        assert tip.march(q, step) is None
        return np.array(found)

    other = ByHand(panda.chain)
    np.testing.assert_allclose(seen(other), seen(panda.chain.kinematics()), atol=1e-8)
    assert other.asked == len(q)


def test_a_march_ends_where_a_step_says_so(panda: sm.RobotModel) -> None:
    tip = panda.chain.kinematics()
    assert tip.march(np.zeros((5, 7)), lambda s, *_: s < 2) == 2
