"""Tool poses in a program's work object from joints, and the joints of such poses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.robot import Chain, RobotModel
from selfmotion.model.task import SE3, Quaternion, rotation_vectors, skews
from selfmotion.shop.controllers.controller_axes import Axis, tool_from_flange
from selfmotion.shop.controllers.pose_numbers import Rounding
from selfmotion.shop.controllers.program_settings import AXES, ProgramSettings
from selfmotion.shop.controllers.work_objects import WORLD, WorkObject

_JOINTS = 6

# Inverse kinematics of a controller: a tool pose and the external axes determine the six joints of
# the arm near known ones, whatever the joints' limits are. Newton's method finds them for many
# poses at once, Δq = J⁻¹ [Δp; log(R_wanted Rᵀ)], with J the six columns of the arm's joints. What
# searches an arm's whole range for one pose is `RobotModel.inverse_kinematics`.

# Largest number of Newton steps.
_MAX_ITERATIONS = 20
# Largest change of a joint in one step [rad or m].
_MAX_STEP = 0.3
# Error at which the steps end [m, rad].
_CONVERGED = 1e-10
# Damping, added to the diagonal: steps stay finite in singular configurations.
_DAMPING = 1e-14
# Largest error of a solution, by the digits of files [m, rad].
_SOLVED = 1e-8


@dataclass(frozen=True, eq=False)
class ToolFrames:
    """A program's work object and its tool: poses of the one in the other, and joints of poses.

    Attributes
    ----------
    robot : RobotModel
    axes : tuple of Axis
        In the order of the robot's joints.
    carrier : str
        The link that the work object is fixed to, or ``"world"``.
    work : SE3
        Pose of the work object in its carrier.
    name : str
        Of the work object.
    tool : SE3
        The tool in the flange, as the program has it.
    flange_to_tool : SE3
        The same as the robot has it.
    """

    robot: RobotModel
    axes: tuple[Axis, ...]
    carrier: str
    work: SE3
    name: str
    tool: SE3
    flange_to_tool: SE3

    @classmethod
    def of(
        cls,
        robot: RobotModel,
        axes: Sequence[Axis],
        settings: ProgramSettings,
        path_frame: SE3 | None = None,
    ) -> "ToolFrames":
        """Return the frames by the settings of a program; `WorkObject.of` has the parameters."""
        tool = tool_from_flange(robot, settings)
        work_object = WorkObject.of(robot, settings.work_object, path_frame)
        return cls(robot, tuple(axes), *work_object, tool, tool)

    @property
    def is_carried(self) -> bool:
        """Whether an axis moves the work object."""
        return self.carrier != WORLD and self.robot.carrier_of(self.carrier)[0] != 0

    @cached_property
    def chain(self) -> Chain:
        """From the work object's carrier to the tool."""
        carrier = None if self.carrier == WORLD else self.carrier
        return self.robot.chain_to(self.robot.tool, carrier)

    @cached_property
    def arm(self) -> Ints:
        """The arm's joints A1 to A6 among the robot's, in this order."""
        names = [axis.name for axis in self.axes]
        return np.array([names.index(name) for name in AXES[:_JOINTS] if name in names])

    @cached_property
    def external(self) -> Ints:
        """The others."""
        return np.array([k for k in range(len(self.axes)) if k not in self.arm], dtype=np.int64)

    def undetermined(self) -> str:
        """Return why poses do not determine the arm's joints, in words; empty where they do."""
        name, arm = self.robot.name, self.arm
        if len(arm) != _JOINTS:
            return f"{name} has {len(arm)} axes A1 to A6, and poses are for arms of six"
        carrying = self.robot.chain_to(self.robot.tool).joints.tolist()
        if not set(arm.tolist()) <= set(carrying):
            # A tool that stands still, while the arm holds the part, has poses of another kind.
            return f"not all of A1 to A6 of {name} carry its tool"
        between = axis_inside_arm(self.robot, self.axes)
        if between:
            return (
                f"joint '{between}' is in the arm itself, so that its controller chooses the elbow "
                f"of a pose"
            )
        if self.chain.is_coupled:
            return f"joints of {name} mimic others"
        return ""

    def tool_poses(self, q: Array) -> tuple[Array, Array]:
        """Return the tool in the work object at q (K, n): positions (K, 3), quaternions (K, 4).

        Quaternions are x, y, z, w.
        """
        from scipy.spatial.transform import Rotation

        _, rotations, translations = self._jacobians_and_poses(q)
        rotation = np.asarray(self.work.rotation)
        positions = (translations - self.work.translation) @ rotation
        return positions, Rotation.from_matrix(rotation.T @ rotations).as_quat()

    def inverse_kinematics(
        self, positions: Array, quaternions: Array, near: Array
    ) -> tuple[Array, Flags]:
        """Return joints (K, n) for tool poses by Newton's method, and whether it converged, (K,).

        From seeds `near` (K, n), whose external axes are kept.
        """
        from scipy.spatial.transform import Rotation

        rotation = np.asarray(self.work.rotation)
        required_positions = positions @ rotation.T + self.work.translation
        required_rotations = rotation @ Rotation.from_quat(quaternions).as_matrix()
        q = np.array(near)
        for step_number in range(_MAX_ITERATIONS + 1):
            jacobian, rotations, translations = self._jacobians_and_poses(q)
            turned = rotation_vectors(required_rotations @ rotations.transpose(0, 2, 1))
            residual = np.hstack([required_positions - translations, turned])
            if step_number == _MAX_ITERATIONS or np.abs(residual).max() < _CONVERGED:
                break
            step = self._rates(jacobian, residual)
            size = np.maximum(np.abs(step).max(axis=1) / _MAX_STEP, 1.0)
            q[:, self.arm] += step / size[:, None]
        return q, np.asarray(np.abs(residual).max(axis=1) < _SOLVED)

    def joint_rates(self, q: Array, rates: Array) -> Array:
        """Return rates of the tool in the work object (K, 6) as rates of the arm's joints."""
        rotation = np.asarray(self.work.rotation)
        turned = np.hstack([rates[:, :3] @ rotation.T, rates[:, 3:] @ rotation.T])
        return self._rates(self._jacobians_and_poses(q)[0], turned)

    def smallest_singular_values(self, q: Array) -> Array:
        """Return the smallest singular value of the Jacobian of A1 to A6 at each q, (K,).

        Its rows are in m and rad; it is 0 in a singular pose.
        """
        jacobian = self._jacobians_and_poses(q)[0][:, :, self.arm]
        return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[:, -1])

    def speeds(self, q: Array, qd: Array) -> Array:
        """Return how fast the tool is in the work object at q and qd (K, n), (K,) [m/s]."""
        moved = np.einsum("kcn,kn->kc", self._jacobians_and_poses(q)[0][:, :3], qd)
        return np.asarray(np.linalg.norm(moved, axis=1))

    @staticmethod
    def turned(first: Array, last: Array) -> Array:
        """Return the rotation vectors from quaternions to others (K, 4) in the work object."""
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_quat(last) * Rotation.from_quat(first).inv()
        return np.asarray(turns.as_rotvec())

    def _rates(self, jacobian: Array, rates: Array) -> Array:
        """Return rates of the tool in the carrier's axes (K, 6) as rates of the arm's joints."""
        jacobian = jacobian[:, :, self.arm]
        gram = jacobian @ jacobian.transpose(0, 2, 1) + _DAMPING * np.eye(6)
        multipliers = np.linalg.solve(gram, rates[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("kji,kj->ki", jacobian, multipliers))

    def rounded(self, rounding: Rounding) -> "ToolFrames":
        """Return the frames with work object and tool rounded as in files."""
        poses = (self.work, self.tool)
        quaternions = np.array([Quaternion(pose.rotation).coeffs() for pose in poses])
        positions, turned = rounding(np.array([pose.translation for pose in poses]), quaternions)
        both = (
            SE3(Quaternion(quaternion).toRotationMatrix(), position)
            for position, quaternion in zip(positions, turned, strict=True)
        )
        work, tool = both
        return replace(self, work=work, tool=tool)

    def _jacobians_and_poses(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobians (K, 6, n) and poses of the program's tool in the carrier's frame."""
        jacobian, rotations, translations = self.chain.along(q)
        offset = self.flange_to_tool.inverse() * self.tool
        lever = rotations @ np.asarray(offset.translation)
        moved = jacobian.copy()
        moved[:, :3] -= skews(lever) @ jacobian[:, 3:]
        return moved, rotations @ np.asarray(offset.rotation), translations + lever


def axis_inside_arm(robot: RobotModel, axes: Sequence[Axis]) -> str:
    """Return the external axis between the first and the last of A1 to A6; "" for none."""
    carrying = robot.chain_to(robot.tool).joints.tolist()
    arm = [k for k, joint in enumerate(carrying) if axes[joint].name.startswith("A")]
    inside = carrying[arm[0] : arm[-1]] if arm else []
    return next((axes[joint].joint for joint in inside if axes[joint].name.startswith("E")), "")
