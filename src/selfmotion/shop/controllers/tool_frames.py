"""Work objects in which controllers express tool poses, and inverse kinematics of such poses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints, ProblemError, nearest
from selfmotion.model.path import Joined, Path, Placed
from selfmotion.model.robot import Chain, RobotModel
from selfmotion.model.task import SE3, Quaternion, log3, rotation_vectors, skews
from selfmotion.shop.controllers.pose_numbers import Rounding
from selfmotion.shop.controllers.program_settings import (
    AXES,
    OF_PATH,
    Axis,
    ProgramSettings,
    tool_from_flange,
)

# Smallest angle between frames above rounding [rad].
_ANGLE_TOLERANCE = 1e-6
# Largest difference of equal frames [m, parts of quaternions].
_FRAME_TOLERANCE = 1e-9

# Distance of a work object that must be in another unit, as a multiple of the arm's reach.
_FAR_IN_REACHES = 20.0

# A controller expresses tool poses in a work object, which is fixed in the controller's base frame
# or on an external axis that carries the part (a positioner). A tool pose and the external axes
# determine the six joints of the arm near known ones. They are found by Newton's method, Δq = J⁻¹
# [Δp; log(R_wanted Rᵀ)], with J the six columns of the arm's joints.

# Name of the fixed frame, which is no link.
WORLD = "world"
_JOINTS = 6
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


def carrier_in_reference(robot: RobotModel, carrier: str) -> SE3 | None:
    """Return the pose of a work object's carrier in the frame of paths; None if it moves."""
    link = robot.urdf.root if carrier == WORLD else carrier
    between = robot.chain_to(link, robot.reference)
    return None if len(between.joints) else between.place(np.zeros(robot.dof))


@dataclass(frozen=True, eq=False)
class ToolFrames:
    """A work object, its carrier, and the tool that moves in it.

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
        """Return the frames by the settings of a program.

        `path_frame` is the pose of the path's frame in its carrier link, for a work object that is
        the frame of the path.

        Raises
        ------
        ProblemError
            The work object rides on what carries the tool, or there is no such link.
        """
        given, tool = settings.work_object, tool_from_flange(robot, settings)
        carrier, work = base_of(robot), SE3.Identity()
        name, inside = carrier, SE3.Identity()
        if given is None:
            given = robot.reference or work
        elif isinstance(given, SE3):
            _check_near(robot, given)
            name = "given"
        elif given == OF_PATH:
            given, inside = robot.reference or robot.urdf.root, path_frame or inside
            name = OF_PATH
        else:
            _check_link(robot, given)
            name = given
        if isinstance(given, SE3):
            work = SE3(given)
        elif robot.carrier_of(given)[0] == 0:
            name = given if name == carrier else name
            base = robot.chain_to(given, None if carrier == WORLD else carrier)
            work = base.place(np.zeros(robot.dof)) * inside
        else:
            name = given if name == carrier else name
            carrier, work = given, inside
            _check_beside(robot, given)
        return cls(robot, tuple(axes), carrier, work, name, tool, tool)

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
        between = own_joint(self.robot, self.axes)
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

        _, rotations, translations = self._tool_along(q)
        rotation = np.asarray(self.work.rotation)
        positions = (translations - self.work.translation) @ rotation
        return positions, Rotation.from_matrix(rotation.T @ rotations).as_quat()

    def solved(self, positions: Array, quaternions: Array, near: Array) -> tuple[Array, Flags]:
        """Return joints (K, n) for tool poses by Newton's method, and whether it converged, (K,).

        From seeds `near` (K, n), whose external axes are kept.
        """
        from scipy.spatial.transform import Rotation

        rotation = np.asarray(self.work.rotation)
        wanted = positions @ rotation.T + self.work.translation
        wanted_rotations = rotation @ Rotation.from_quat(quaternions).as_matrix()
        q = np.array(near)
        for step_number in range(_MAX_ITERATIONS + 1):
            jacobian, rotations, translations = self._tool_along(q)
            turned = rotation_vectors(wanted_rotations @ rotations.transpose(0, 2, 1))
            residual = np.hstack([wanted - translations, turned])
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
        return self._rates(self._tool_along(q)[0], turned)

    def regularity(self, q: Array) -> Array:
        """Return the smallest singular values of the arm's Jacobian, in m and rad, (K,).

        0 in a singular pose.
        """
        own = self._tool_along(q)[0][:, :, self.arm]
        return np.asarray(np.linalg.svd(own, compute_uv=False)[:, -1])

    def speeds(self, q: Array, qd: Array) -> Array:
        """Return how fast the tool is in the work object at q and qd (K, n), (K,) [m/s]."""
        moved = np.einsum("kcn,kn->kc", self._tool_along(q)[0][:, :3], qd)
        return np.asarray(np.linalg.norm(moved, axis=1))

    @staticmethod
    def turned(first: Array, last: Array) -> Array:
        """Return the rotation vectors from quaternions to others (K, 4) in the work object."""
        from scipy.spatial.transform import Rotation

        found: Array = (Rotation.from_quat(last) * Rotation.from_quat(first).inv()).as_rotvec()
        return found

    def _rates(self, jacobian: Array, rates: Array) -> Array:
        own = jacobian[:, :, self.arm]
        gram = own @ own.transpose(0, 2, 1) + _DAMPING * np.eye(6)
        solved = np.linalg.solve(gram, rates[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("kji,kj->ki", own, solved))

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

    def _tool_along(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobians (K, 6, n) and poses of the program's tool in the carrier's frame."""
        jacobian, rotations, translations = self.chain.along(q)
        other = self.flange_to_tool.inverse() * self.tool
        lever = rotations @ np.asarray(other.translation)
        moved = jacobian.copy()
        moved[:, :3] -= skews(lever) @ jacobian[:, 3:]
        return moved, rotations @ np.asarray(other.rotation), translations + lever


def own_joint(robot: RobotModel, axes: Sequence[Axis]) -> str:
    """Return the external axis between the first and the last of A1 to A6; "" for none."""
    carrying = robot.chain_to(robot.tool).joints.tolist()
    arm = [k for k, joint in enumerate(carrying) if axes[joint].name.startswith("A")]
    inside = carrying[arm[0] : arm[-1]] if arm else []
    return next((axes[joint].joint for joint in inside if axes[joint].name.startswith("E")), "")


def base_of(robot: RobotModel) -> str:
    """Return the controller's base frame: the link ``base``, or the world.

    By the conventions of ROS-Industrial ``base`` is the controller's frame.
    """
    part = robot.tool.rpartition("/")[0]
    link = f"{part}/base" if part else "base"
    known = link in robot.urdf.links and robot.carrier_of(link)[0] == 0
    return link if known else WORLD


def turned_base(robot: RobotModel) -> str:
    """Return how the controller's base is rotated from the root, in words; "" if it is not."""
    base = base_of(robot)
    if base == WORLD:
        return ""
    pose = robot.chain_to(base).place(np.zeros(robot.dof))
    angle = float(np.linalg.norm(log3(pose.rotation)))
    if angle < _ANGLE_TOLERANCE:
        return ""
    return (
        f"work objects are counted in '{base}', the controller's frame, which is turned by "
        f"{np.degrees(angle):.4g}° from '{robot.urdf.root}', in which --frame counts; --wobj "
        f"{OF_PATH} is the frame of the path"
    )


def frame_of_paths(paths: Sequence[Path]) -> SE3:
    """Return the frame that paths are given in, in the link that they ride on.

    Raises
    ------
    ProblemError
        They are given in several frames.
    """
    frames = [_placed(path) for path in paths] or [SE3.Identity()]
    for frame in frames[1:]:
        if np.abs(frame.homogeneous - frames[0].homogeneous).max() > _FRAME_TOLERANCE:
            raise ProblemError(
                f"work_object '{OF_PATH}': paths are given in several frames, expected one; give "
                f"the name of a link, or a pose"
            )
    return frames[0]


def _placed(path: Path) -> SE3:
    """Return the frame that a path is given in."""
    if isinstance(path, Placed):
        return path.frame * _placed(path.original)
    if isinstance(path, Joined):
        return frame_of_paths(path.pieces)
    inner = getattr(path, "original", None)
    return SE3.Identity() if inner is None else _placed(inner)


def _check_near(robot: RobotModel, work: SE3) -> None:
    """Raise ProblemError for a work object that the arm is far from reaching."""
    far = float(np.linalg.norm(work.translation))
    if far > _FAR_IN_REACHES * robot.reach:
        raise ProblemError(
            f"{robot.name}: the work object is {far:.4g} m away, but the arm reaches "
            f"{robot.reach:.3g} m; in millimetres? It is in m (position_mm in files)"
        )


def _check_link(robot: RobotModel, link: str) -> None:
    links = list(robot.urdf.links)
    if link not in links:
        raise ProblemError(
            f"{robot.name}: work_object '{link}' is none of its links{nearest(link, links)}; "
            f"expected one of {', '.join(links)}, '{OF_PATH}' (the frame of the path), or a pose"
        )


def _check_beside(robot: RobotModel, link: str) -> None:
    """Refuse a link that moves with the arm, or with what carries it."""
    own = set(robot.chain_to(link).joints.tolist())
    both = own & set(robot.chain_to(robot.tool).joints.tolist())
    if both:
        joint = robot.joint_names[min(both)]
        raise ProblemError(
            f"{robot.name}: work_object '{link}' moves with joint '{joint}', which carries the "
            f"tool as well; expected a link that stands still, or that another axis carries"
        )
