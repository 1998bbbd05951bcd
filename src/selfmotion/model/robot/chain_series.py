"""Majorant series of a chain's motion: bounds of all derivatives."""

from functools import cached_property

import numpy as np

from selfmotion.basics import Array, series
from selfmotion.model.robot.chain import WORLD, Chain
from selfmotion.model.robot.model import RobotModel


class ChainSeries:
    """Majorants of a chain's motion over I intervals of time; see `selfmotion.basics.series`.

    A joint's rotation by q is bounded by exp(Q), a product of rotations by the exponential of the
    sum, a position by the sum of products of carried offset and carrier.

    Parameters
    ----------
    robot : RobotModel
    joints : (n, K + 1, I)
        The joints' own series.
    half : (I,)
        Half the width of each interval [s].
    """

    def __init__(self, robot: RobotModel, joints: Array, half: Array) -> None:
        self.robot, self.joints, self.half = robot, joints, half
        coupling, tree = robot.coupling, robot.tree
        self._is_revolute = tree.is_revolute.tolist()
        # Those of the model's joints.
        self._every = joints
        if not coupling.is_plain:
            self._every = np.abs(coupling.scales)[:, None, None] * joints[coupling.coordinates]
            self._every[:, 0] += np.where(tree.is_revolute, 0.0, np.abs(coupling.offsets))[:, None]

    @cached_property
    def turned(self) -> list[Array]:
        """The orientation of the world and of each joint's frame, (K + 1, I) each."""
        sums = [np.zeros_like(self.joints[0])]
        for joint, parent, _ in self._links:
            sums.append(sums[parent] + self._every[joint] * self._is_revolute[joint])
        return [series.exponential(total) for total in sums]

    @cached_property
    def steps(self) -> list[Array]:
        """From the parent's frame to each joint's, world axes [m]; of the world 0."""
        found = [np.zeros_like(self.joints[0])]
        for joint, parent, length in self._links:
            step = length * self.turned[parent]
            if not self._is_revolute[joint]:
                step = step + series.product(self._every[joint], self.turned[parent])
            found.append(step)
        return found

    @cached_property
    def places(self) -> list[Array]:
        """The places of the world and of each joint's frame [m]."""
        found = [self.steps[0]]
        for joint, parent, _ in self._links:
            found.append(found[parent] + self.steps[joint + 1])
        return found

    @cached_property
    def spins(self) -> list[Array]:
        """The angular velocities of the world and of each joint's frame [rad/s]."""
        found = [np.zeros_like(self.joints[0][1:])]
        for joint, parent, _ in self._links:
            spin = found[parent]
            if self._is_revolute[joint]:
                spin = spin + series.product(self.rate(joint), self.turned[parent])
            found.append(spin)
        return found

    def is_revolute(self, joint: int) -> bool:
        """Return whether a joint is revolute."""
        return bool(self._is_revolute[joint])

    def parent(self, joint: int) -> int:
        """Return the parent of a joint, 0 for the world, else 1 + its number."""
        return int(self.robot.model.parents[joint + 1])

    def rate(self, joint: int) -> Array:
        """Return the velocity of a joint of the model."""
        return series.derivative(self._every[joint], self.half)

    def place(self, frame: int) -> Array:
        """Return the position of a frame [m], by its number."""
        at = self.robot.model.frames[frame]
        length = float(np.linalg.norm(at.placement.translation))
        parent = int(at.parentJoint)
        return np.asarray(self.places[parent] + length * self.turned[parent])

    def orientation(self, frame: int) -> Array:
        """Return the orientation of a frame."""
        return self.turned[int(self.robot.model.frames[frame].parentJoint)]

    def spin(self, frame: int) -> Array:
        """Return the angular velocity of a frame [rad/s]."""
        return self.spins[int(self.robot.model.frames[frame].parentJoint)]

    def relative(self, chain: Chain) -> tuple[Array, Array]:
        """Return the position of a chain's tip in its base frame [m], and its orientation there."""
        if chain.base == WORLD:
            return self.place(chain.tip), self.orientation(chain.tip)
        tree, _, last = chain.arrays
        total = np.zeros_like(self.joints[0])
        place = np.zeros_like(total)
        for joint, position in zip(chain.model_joints.tolist(), tree.positions, strict=True):
            turned = series.exponential(total)
            place += float(np.linalg.norm(position)) * turned
            if self._is_revolute[joint]:
                total = total + self._every[joint]
            else:
                place += series.product(self._every[joint], turned)
        turned = series.exponential(total)
        return place + float(np.linalg.norm(last)) * turned, turned

    def relative_spin(self, chain: Chain) -> Array:
        """Return the angular velocity of a chain's tip in its base frame [rad/s]."""
        if chain.base == WORLD:
            return self.spin(chain.tip)
        total, spin = np.zeros_like(self.joints[0]), np.zeros_like(self.joints[0][1:])
        for joint in chain.model_joints.tolist():
            if self._is_revolute[joint]:
                spin = spin + series.product(self.rate(joint), series.exponential(total))
                total = total + self._every[joint]
        return np.asarray(spin)

    @cached_property
    def _links(self) -> list[tuple[int, int, float]]:
        """Each joint with its parent and how far it is from there [m]."""
        return [(joint, *link) for joint, link in enumerate(self.robot.links)]
