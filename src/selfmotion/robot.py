"""The arm: a URDF loaded into Pinocchio as a chain with one coordinate per joint."""

import dataclasses
import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.arrays import Array, read_only
from selfmotion.errors import InverseKinematicsError, RobotError
from selfmotion.task import Task
from selfmotion.urdf import Urdf, parse_urdf, read_urdf

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True)
class NamedArm:
    """An arm that `load_robot` knows by name.

    Attributes
    ----------
    urdf : str
        File below the folder of example-robot-data, or of this package for our own arms.
    tool : str
        The usual tool frame.
    """

    urdf: str
    tool: str


NAMED_ARMS: Mapping[str, NamedArm] = {
    "planar_3r": NamedArm("planar_3r.urdf", "tool"),
    "panda": NamedArm("panda_description/urdf/panda.urdf", "panda_hand_tcp"),
    "xarm7": NamedArm("xarm_description/urdf/xarm7.urdf", "link_eef"),
    "baxter": NamedArm("baxter_description/urdf/baxter.urdf", "left_gripper"),
    "tiago": NamedArm("tiago_description/robots/tiago.urdf", "arm_tool_link"),
    "pr2": NamedArm("pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame"),
    "ur5": NamedArm("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "ur10": NamedArm("ur_description/urdf/ur10_robot.urdf", "tool0"),
    "kinova": NamedArm("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    "z1": NamedArm("z1_description/urdf/z1.urdf", "gripperStator"),
}


@dataclass(frozen=True, eq=False)
class RobotModel:
    """An arm from its root to a tool frame, every joint with one coordinate.

    Made by `load_robot`. Frames: poses and Jacobians are those of the tool frame in the URDF's
    root frame ("world"). Units: [rad] or [m] per joint, [s].

    Attributes
    ----------
    name : str
        Name from the URDF.
    tool : str
        The tool frame.
    joint_names : tuple of str
        The n joints, base to tool.
    lower, upper : (n,)
        Position limits [rad or m]; ±inf for continuous joints.
    velocity_limit : (n,)
        Speed limits [rad/s or m/s]; inf where the URDF gives none.
    locked : dict
        Joint name → coordinate at which it is held.
    model : pinocchio.Model
        The chain, nq = nv = n. Not to be modified.
    tool_id : int
        Index of the tool frame in `model`.
    urdf : Urdf
        What it was made from.
    """

    name: str
    tool: str
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity_limit: Array
    locked: Mapping[str, float]
    model: Any = field(repr=False)
    tool_id: int = field(repr=False)
    urdf: Urdf = field(repr=False)
    _data: Any = field(repr=False)

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return len(self.joint_names)

    def configuration(self, q: npt.ArrayLike) -> Array:
        """Return `q` as a float64 vector of n finite numbers.

        Raises
        ------
        RobotError
            The shape is not (n,), or a number is not finite; the joint is named.
        """
        array = np.array(q, dtype=np.float64)
        if array.shape != (self.dof,):
            raise RobotError(
                f"configuration has shape {array.shape}, expected ({self.dof},) "
                f"for joints {', '.join(self.joint_names)}"
            )
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise RobotError(f"joint '{self.joint_names[bad[0]]}' is {array[bad[0]]}, not finite")
        return array

    def pose(self, q: npt.ArrayLike) -> pin.SE3:
        """Return the tool's pose at `q`."""
        pin.forwardKinematics(self.model, self._data, self.configuration(q))
        return pin.SE3(pin.updateFramePlacement(self.model, self._data, self.tool_id))

    def jacobian(self, q: npt.ArrayLike) -> Array:
        """Return the tool's Jacobian at `q`, (6, n): rows [v, ω] in world axes.

        v is the velocity of the tool frame's origin (Pinocchio's LOCAL_WORLD_ALIGNED).
        """
        pin.computeJointJacobians(self.model, self._data, self.configuration(q))
        jacobian: Array = pin.getFrameJacobian(self.model, self._data, self.tool_id, _AXES)
        return jacobian

    def kinematics(self, q: Array) -> tuple[Array, Array, Array]:
        """Return the Jacobian (6, n), rotation (3, 3) and translation (3,) of the tool at `q`.

        One pass for all three, and no check of `q`: for callers that ask thousands of times.
        """
        pin.computeJointJacobians(self.model, self._data, q)
        pose = pin.updateFramePlacement(self.model, self._data, self.tool_id)
        jacobian: Array = pin.getFrameJacobian(self.model, self._data, self.tool_id, _AXES)
        return jacobian, pose.rotation.copy(), pose.translation.copy()

    def task_jacobian(self, q: npt.ArrayLike, task: Task) -> Array:
        """Return the prescribed rows of the Jacobian at `q`, (m, n)."""
        jacobian = self.jacobian(q)
        pose = pin.updateFramePlacement(self.model, self._data, self.tool_id)
        return task.select(jacobian, pose.rotation)

    def redundancy(self, task: Task | str) -> int:
        """Return n - rank J of the task at generic configurations (0: no self-motion)."""
        task = Task.of(task)
        jacobians = [self.task_jacobian(q, task) for q in self._generic_configurations()]
        return self.dof - int(max(np.linalg.matrix_rank(jacobians, tol=_RANK_TOLERANCE)))

    def can_follow(self, task: Task | str) -> bool:
        """Return whether the arm can move the tool in every row that the task prescribes.

        ``planar_pose`` also wants an arm that moves in the x-y plane: elsewhere there is no angle
        about z that the rate ωz would be the derivative of.
        """
        task = Task.of(task)
        if task is Task.PLANAR_POSE:
            jacobians = np.array([self.jacobian(q) for q in self._generic_configurations()])
            if np.abs(jacobians[:, 2:5]).max() > _RANK_TOLERANCE:
                return False
        return self.dof - self.redundancy(task) == task.dimension

    def _generic_configurations(self) -> Array:
        lower, upper = self.finite_limits()
        return np.random.default_rng(0).uniform(lower, upper, (5, self.dof))

    def finite_limits(self) -> tuple[Array, Array]:
        """Return the position limits with ±π where a joint has none, for sampling."""
        return (
            np.where(np.isfinite(self.lower), self.lower, -np.pi),
            np.where(np.isfinite(self.upper), self.upper, np.pi),
        )

    def dexterous_configuration(self, task: Task | str = Task.POSE) -> Array:
        """Return a configuration well inside the limits and far from singular poses, (n,).

        Of 1000 samples (fixed seed) in the middle half of the limits, the one with the largest
        manipulability √det(JJᵀ) of the task: a start for motions that may begin anywhere.
        """
        task = Task.of(task)
        lower, upper = self.finite_limits()
        share = np.random.default_rng(0).uniform(0.25, 0.75, (1000, self.dof))
        samples = lower + (upper - lower) * share
        jacobians = np.array([self.task_jacobian(q, task) for q in samples])
        determinants = np.linalg.det(jacobians @ jacobians.transpose(0, 2, 1))
        return np.array(samples[np.argmax(determinants)])

    def inverse_kinematics(
        self,
        pose: pin.SE3,
        task: Task | str = Task.POSE,
        seed: npt.ArrayLike | None = None,
        rng: np.random.Generator | int | None = 0,
        attempts: int = 50,
    ) -> Array:
        """Return a configuration within the limits that puts the tool at `pose`.

        Levenberg-Marquardt on the rows of `task`, projected onto the joint limits; the first
        attempt starts at `seed`, later ones at uniform samples.

        Parameters
        ----------
        pose : pinocchio.SE3
            Where the tool should be, in world axes.
        task : Task or str
            The rows that count.
        seed : (n,), optional
            Where to start; by default the middle of the limits.
        rng : Generator or int
            Source of the restarts; the same one gives the same answer.
        attempts : int
            How many starts to try.

        Returns
        -------
        (n,)
            Misses the pose by less than 1e-10 (m and rad).

        Raises
        ------
        InverseKinematicsError
            No attempt arrived; says what the best one left over.
        """
        task = Task.of(task)
        rng = np.random.default_rng(rng)
        lower, upper = self.finite_limits()
        start = 0.5 * (lower + upper) if seed is None else self.configuration(seed)
        best = (np.inf, np.inf)
        for _ in range(attempts):
            q, miss = self._levenberg_marquardt(pose, task, start)
            if max(miss) < _IK_TOLERANCE:
                return q
            best = min(best, miss, key=sum)
            start = rng.uniform(lower, upper)
        raise InverseKinematicsError(
            f"{self.name}: no configuration within the limits puts '{self.tool}' at "
            f"{np.round(pose.translation, 4).tolist()} m for task '{task.value}': the best of "
            f"{attempts} attempts misses by {best[0]:.3g} m and {best[1]:.3g} rad; "
            f"move the pose into the workspace",
            position_miss=best[0],
            rotation_miss=best[1],
        )

    def _levenberg_marquardt(
        self, pose: pin.SE3, task: Task, start: Array, iterations: int = 100
    ) -> tuple[Array, tuple[float, float]]:
        q, damping = np.clip(start, self.lower, self.upper), 1e-3
        actual = self.pose(q)
        error = task.select(task.twist_error(pose, actual)[:, None], actual.rotation)[:, 0]
        for _ in range(iterations):
            if np.linalg.norm(error) < 0.01 * _IK_TOLERANCE:
                break
            jacobian = self.task_jacobian(q, task)
            gradient = jacobian.T @ error
            # Joints held at a limit that the step would leave take no part in it.
            free = ~((q <= self.lower) & (gradient < 0) | (q >= self.upper) & (gradient > 0))
            jacobian = jacobian * free
            normal = jacobian @ jacobian.T + damping * np.eye(task.dimension)
            trial = np.clip(q + jacobian.T @ np.linalg.solve(normal, error), self.lower, self.upper)
            actual = self.pose(trial)
            new = task.select(task.twist_error(pose, actual)[:, None], actual.rotation)[:, 0]
            if np.linalg.norm(new) < np.linalg.norm(error):
                q, error, damping = trial, new, max(0.1 * damping, 1e-14)
            else:
                damping *= 10.0
                if damping > 1e6:
                    break
        return q, task.miss(pose, self.pose(q))

    def geometry(self, kind: pin.GeometryType) -> Any:
        """Return the visual or collision geometry, all links, locked joints where they are held.

        Parameters
        ----------
        kind : pinocchio.GeometryType
            ``VISUAL`` or ``COLLISION``.

        Returns
        -------
        pinocchio.GeometryModel
            Objects placed relative to the joints of `model`.

        Raises
        ------
        RobotError
            A mesh file is missing or cannot be read.
        """
        full = pin.buildModelFromXML(self.urdf.text)
        try:
            geometry = pin.buildGeomFromUrdfString(
                full, self.urdf.text, kind, package_dirs=list(self.urdf.package_dirs)
            )
        except ValueError as error:
            raise RobotError(f"{self.urdf.source}: {error}") from error
        reference, locked_ids = _locked_configuration(full, self.locked)
        _, reduced = pin.buildReducedModel(full, [geometry], locked_ids, reference)
        return reduced[0]


# Singular values below this [m, rad] are zero.
_RANK_TOLERANCE = 1e-6

# What an inverse-kinematics solution may miss by, far below what a certificate accepts.
_IK_TOLERANCE = 1e-10


def load_robot(
    robot: str | Path,
    tool: str | None = None,
    lock: Mapping[str, float] | None = None,
) -> RobotModel:
    """Load an arm.

    Parameters
    ----------
    robot : str or Path
        A name from `NAMED_ARMS` (``"panda"``, ``"planar_3r"``, …) or the path of a ``.urdf`` file.
    tool : str, optional
        Tool frame (a link). Default: the named arm's usual one; for a file, its only leaf link.
    lock : dict, optional
        Joints to hold, with their coordinate [rad or m]. Joints off the chain to the tool are
        held anyway, at 0 or the nearest limit unless given here.

    Returns
    -------
    RobotModel

    Raises
    ------
    RobotError
        The name, file, frame or joint does not exist or cannot be used.

    Examples
    --------
    >>> load_robot("panda").dof
    7
    """
    if isinstance(robot, str) and robot in NAMED_ARMS:
        arm = NAMED_ARMS[robot]
        return build_robot(_read_named(arm), tool or arm.tool, lock or {})
    path = Path(robot)
    if path.suffix != ".urdf":
        raise RobotError(
            f"unknown robot '{robot}', expected a .urdf file or one of: {', '.join(NAMED_ARMS)}"
        )
    urdf = read_urdf(path)
    return build_robot(urdf, tool or _only_leaf(urdf), lock or {})


def build_robot(urdf: Urdf, tool: str, lock: Mapping[str, float]) -> RobotModel:
    """Build the chain from the root of a validated URDF to `tool`; see `load_robot`."""
    if tool not in urdf.links:
        raise RobotError(
            f"{urdf.source}: no link '{tool}' to use as tool frame; links: {', '.join(urdf.links)}"
        )
    full = pin.buildModelFromXML(urdf.text)
    _check_lock(urdf, full, lock)
    chain = [joint for joint in urdf.chain(tool) if joint.kind != "fixed"]
    for joint in chain:
        if joint.kind in ("floating", "planar"):
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' is {joint.kind}; an arm's joints are "
                f"revolute, continuous or prismatic"
            )
        if joint.mimics is not None and joint.name not in lock:
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' on the way to '{tool}' mimics "
                f"'{joint.mimics}'; choose a tool before it, or hold it with lock="
            )
    free = [joint.name for joint in chain if joint.name not in lock]
    if not free:
        raise RobotError(f"{urdf.source}: no joint is left free between the root and '{tool}'")
    locked = _locked_joints(full, free, lock)
    reference, locked_ids = _locked_configuration(full, locked)
    model = pin.buildReducedModel(full, locked_ids, reference)
    names = tuple(model.names[1:])
    if model.nq != len(free) or set(names) != set(free):
        raise RobotError(
            f"{urdf.source}: the chain to '{tool}' has joints {free}, but Pinocchio built "
            f"{list(names)}"
        )
    continuous = np.array([name in urdf.continuous() for name in names])
    velocity = np.array(model.velocityLimit, dtype=np.float64)
    return RobotModel(
        name=model.name,
        tool=tool,
        joint_names=names,
        lower=read_only(np.where(continuous, -np.inf, model.lowerPositionLimit)),
        upper=read_only(np.where(continuous, np.inf, model.upperPositionLimit)),
        velocity_limit=read_only(np.where(velocity > 0, velocity, np.inf)),
        locked=locked,
        model=model,
        tool_id=model.getFrameId(tool, pin.FrameType.BODY),
        urdf=urdf,
        _data=model.createData(),
    )


def rebuild_robot(
    text: str,
    package_dirs: Sequence[str],
    source: str,
    continuous: Sequence[str],
    tool: str,
    locked: Mapping[str, float],
) -> RobotModel:
    """Build an arm from what a saved plan carries of it."""
    urdf = parse_urdf(text, source=source, package_dirs=tuple(package_dirs))
    # The text has the continuous joints as revolute ones already.
    for name in continuous:
        urdf.joints[name] = dataclasses.replace(urdf.joints[name], kind="continuous")
    return build_robot(urdf, tool, locked)


def _read_named(arm: NamedArm) -> Urdf:
    own = Path(__file__).parent / "robots" / arm.urdf
    if own.is_file():
        return read_urdf(own)
    share = _example_robot_data()
    urdf = read_urdf(share / "robots" / arm.urdf)
    return Urdf(urdf.source, urdf.text, (str(share.parent), str(share)), urdf.joints)


def _example_robot_data() -> Path:
    """Return the data folder of example-robot-data, which installs no importable module."""
    for file in importlib.metadata.files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).resolve().parents[3]
    raise RobotError("example-robot-data is installed without its robots; reinstall the package")


def _only_leaf(urdf: Urdf) -> str:
    parents = {joint.parent for joint in urdf.joints.values()}
    leaves = [link for link in urdf.links if link not in parents]
    if len(leaves) != 1:
        raise RobotError(
            f"{urdf.source}: has {len(leaves)} end links ({', '.join(leaves)}); "
            f"name the tool frame with tool="
        )
    return leaves[0]


def _check_lock(urdf: Urdf, model: Any, lock: Mapping[str, float]) -> None:
    for name, value in lock.items():
        if not model.existJointName(name):
            raise RobotError(f"{urdf.source}: lock names joint '{name}', which is not movable here")
        if not np.isfinite(value):
            raise RobotError(f"{urdf.source}: lock holds joint '{name}' at {value}, not finite")


def _locked_joints(model: Any, free: list[str], lock: Mapping[str, float]) -> dict[str, float]:
    locked = {}
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        if name in free or joint.nq != 1:
            continue
        lower = model.lowerPositionLimit[joint.idx_q]
        upper = model.upperPositionLimit[joint.idx_q]
        locked[name] = float(lock.get(name, np.clip(0.0, lower, upper)))
    return locked


def _locked_configuration(model: Any, locked: Mapping[str, float]) -> tuple[Array, list[int]]:
    """Return a full configuration with the locked joints set, and the indices of those joints."""
    reference: Array = pin.neutral(model)
    ids = []
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        if name in locked:
            reference[joint.idx_q] = locked[name]
            ids.append(index)
        elif joint.nq != 1:
            ids.append(index)
    return reference, ids
