"""The arm as a chain with one coordinate per joint, on Pinocchio's model of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, Flags, random_numbers
from selfmotion.model.robot.chain import WORLD, Chain
from selfmotion.model.robot.configurations import (
    as_configuration,
    as_configurations,
    joint_weights,
    part_weights,
    speed_weights,
)
from selfmotion.model.robot.dexterity import can_follow, most_dexterous, null_space_at, redundancy
from selfmotion.model.robot.full_model import readable_visuals, reduced_geometry, stand_in
from selfmotion.model.robot.inverse_kinematics import inverse_kinematics
from selfmotion.model.robot.mimic import Coupling
from selfmotion.model.robot.named import home_of
from selfmotion.model.robot.position_based import position_based_limits
from selfmotion.model.robot.tree_arrays import TreeArrays, tree_arrays
from selfmotion.model.robot.urdf import Urdf
from selfmotion.model.task import Task

# Limits of a URDF that other ones may replace.
LIMITS = ("lower", "upper", "velocity_limit", "effort_limit")


@dataclass(frozen=True, eq=False)
class RobotModel:
    """An arm from its root to a tool frame, every joint with one coordinate.

    Made by `load_robot`. Frames: poses and Jacobians are those of the tool frame in the URDF's
    root frame ("world"). Units: [rad] or [m] per joint, [s].

    Attributes
    ----------
    name : str
        Name from the URDF.
    tools : tuple of str
        Tool frames; `tool` is the first.
    reference : str or None
        The link in whose frame poses and paths are given; None for the world.
    joint_names : tuple of str
        The n joints, base to tool; those that mimic one of them (`coupling`) are not among them.
    lower, upper : (n,)
        Position limits [rad or m]; ±inf for continuous joints.
    velocity_limit : (n,)
        Speed limits [rad/s or m/s]; inf where the URDF gives none.
    locked : dict
        Joint name → coordinate at which it is held.
    model : pinocchio.Model
        The tree of its joints and of those that mimic them, nq = nv = N. Not to be modified.
    urdf : Urdf
        Its source.
    touching : tuple of (str, str)
        Pairs of links whose bodies overlap by design, which no check includes.
    effort_limit : (n,)
        Torque or force limits [Nm or N]; inf where the URDF gives none.
    acceleration_limit, jerk_limit : (n,)
        Limits that the maker of a named arm publishes [rad/s² or m/s², rad/s³ or m/s³]; inf where
        none are known.
    coupling : Coupling
        The positions of the model's joints at q.
    """

    name: str
    tools: tuple[str, ...]
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity_limit: Array
    locked: Mapping[str, float]
    model: Any = field(repr=False)
    urdf: Urdf = field(repr=False)
    effort_limit: Array
    acceleration_limit: Array
    jerk_limit: Array
    touching: tuple[tuple[str, str], ...] = ()
    reference: str | None = None
    coupling: Coupling = field(repr=False, kw_only=True)

    def __repr__(self) -> str:
        """Return one line: name, tool and joints."""
        return f"RobotModel({self.name}, tool '{self.tool}', joints {', '.join(self.joint_names)})"

    @property
    def tool(self) -> str:
        """The tool frame that paths are for where nothing else is said."""
        return self.tools[0]

    @cached_property
    def chain(self) -> Chain:
        """From the reference to the tool."""
        return self.chain_to(self.tool, self.reference)

    def chain_to(self, tool: str, reference: str | None = None) -> Chain:
        """Return the chain from a link, or the world, to another link.

        Raises
        ------
        RobotError
            There is no such link.
        """
        tip, base = (WORLD if link is None else self._frame(link) for link in (tool, reference))
        return Chain(self.model, tip, base, self.coupling)

    def _frame(self, link: str) -> int:
        self.urdf.check_tool(link)
        return int(self.model.getFrameId(link, pin.FrameType.BODY))

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return len(self.joint_names)

    @cached_property
    def tree(self) -> TreeArrays:
        """Arrays of all joints for compiled kinematics, placed in the world."""
        return tree_arrays(self.model, self.coupling)

    @cached_property
    def links(self) -> list[tuple[int, float]]:
        """Parent of each joint, 0 the world, else 1 + its number, and how far it is from it [m]."""
        parents, places = list(self.model.parents)[1:], list(self.model.jointPlacements)[1:]
        lengths = [float(np.linalg.norm(place.translation)) for place in places]
        return list(zip(map(int, parents), lengths, strict=True))

    @property
    def is_revolute(self) -> Flags:
        """Which joints' coordinates are angles, (n,)."""
        return np.asarray(self.tree.is_revolute[self.coupling.masters])

    def is_prismatic(self, joint: str) -> bool:
        """Whether a joint's coordinate is a length [m]."""
        return self.urdf.joints[joint].kind == "prismatic"

    def unit_of(self, *joints: str) -> str:
        """Return the unit of joints' coordinates, by default of all: rad, m, or rad or m."""
        found = {"m" if self.is_prismatic(name) else "rad" for name in joints or self.joint_names}
        return found.pop() if len(found) == 1 else "rad or m"

    def label(self, k: int) -> str:
        """Return the name of a coordinate's joint in messages."""
        return f"joint '{self.joint_names[k]}'"

    @property
    def reach(self) -> float:
        """Largest distance of the tool from its root [m]: an upper bound, link by link."""
        return self.reach_of(self.chain)

    def reach_of(self, chain: Chain) -> float:
        """Return the largest distance of a chain's tip from its base [m]."""
        slides = ~self.tree.is_revolute
        farthest = np.maximum(np.abs(self.lower), np.abs(self.upper))[self.coupling.coordinates]
        farthest = np.abs(self.coupling.scales) * farthest + np.abs(self.coupling.offsets)
        return float(chain.arrays.link_lengths.sum() + farthest[slides].sum())

    @property
    def coordinate_sizes(self) -> Array:
        """Motion of each joint per unit of its coordinate, (n,) [rad or m]: 1."""
        return np.ones(self.dof)

    @property
    def joint_weights(self) -> Array:
        """Weight of each joint's unit in sums over joints, (n,).

        1 for a revolute joint. A metre of a prismatic one has the weight of the radians that move
        the tool by a metre at the arm's mean lever: the mean over revolute joints of the lengths of
        all links beyond [rad/m].
        """
        return joint_weights(self)

    @property
    def speed_weights(self) -> Array:
        """Weight of each joint's unit by the limits of speed, (n,).

        1 for a revolute joint. A metre of a prismatic one has the weight of the radians that
        revolute joints turn in the same time, each at its limit of speed: the mean of their limits
        over its own, at most 10 [rad/m]. One without a limit has that of `joint_weights`.
        """
        return speed_weights(self)

    def part_weights(self, weights: Mapping[str, float]) -> Array:
        """Return `joint_weights`, those of some parts or joints times a number, (n,).

        For costs that weigh joints: ``JointVelocity(robot.part_weights({"table": 0.1}))``.

        Raises
        ------
        RobotError
            No joint belongs to a part of that name, nor has the name.
        """
        return part_weights(self, weights)

    @cached_property
    def position_based_limits(self) -> Array:
        """Numbers of velocity limits that depend on the position, by its maker, (4, n).

        Decelerations, offsets, and where the curves end below and above, of the elements
        ``<position_based_velocity_limits>`` of the URDF, as libfranka reads them; ends are ±inf of
        joints without. See `selfmotion.constraints.PositionDependentVelocityLimits`.

        Raises
        ------
        RobotError
            Such an element has a number that is none, or no ends.
        """
        return position_based_limits(self.urdf, self.joint_names, self.lower, self.upper)

    @property
    def home(self) -> Array:
        """The configuration (n,) that the arm's maker calls ready [rad or m].

        In a cell that of each part; tables and rails are at zero, or at their limit nearest to it.

        Raises
        ------
        RobotError
            A part has none.
        """
        return home_of(self.urdf, self.joint_names, self.lower, self.upper)

    def configuration(self, q: npt.ArrayLike) -> Array:
        """Return `q` as a float64 vector of n finite numbers.

        Raises
        ------
        RobotError
            The shape is not (n,), or a number is not finite; the joint is named.
        """
        return as_configuration(self, q)

    def pose(self, q: npt.ArrayLike) -> Any:
        """Return the tool's pose at `q` (n,) as an SE3; at (K, n) a list of K."""
        given = as_configurations(self, q)
        if given.ndim == 1:
            return self.chain.place(given)
        return [self.chain.place(row) for row in given]

    def jacobian(self, q: npt.ArrayLike) -> Array:
        """Return the tool's Jacobian at `q` (n,), (6, n); at (K, n), (K, 6, n).

        Its rows are [v, ω] in world axes; v is the velocity of the tool frame's origin (Pinocchio's
        LOCAL_WORLD_ALIGNED).
        """
        given = as_configurations(self, q)
        return (self.chain.at if given.ndim == 1 else self.chain.along)(given)[0]

    def task_jacobian(self, q: npt.ArrayLike, task: Task | str) -> Array:
        """Return the rows of the Jacobian that `task` prescribes, (m, n) or (K, m, n)."""
        given, task = as_configurations(self, q), Task.of(task)
        if given.ndim == 1:
            jacobian, rotation, _ = self.chain.at(given)
            return task.select(jacobian, rotation)
        jacobians, rotations, _ = self.chain.along(given)
        return task.select_along(jacobians, rotations)

    def null_space(self, q: npt.ArrayLike, task: Task | str = Task.POSE) -> Array:
        """Return an orthonormal basis N of the null space of the task's Jacobian at `q`.

        J N = 0 and NᵀN = I: joint velocities N z do not move the tool in the rows that `task`
        prescribes. The columns are the right singular vectors of the singular value 0; their order
        and signs are arbitrary, and need not be continuous along a motion.

        Parameters
        ----------
        q : (n,) or (K, n)
            [rad or m].
        task : Task or str

        Returns
        -------
        (n, r) or (K, n, r)
            r = n - rank J. At a singular configuration it is larger than `redundancy`.

        Raises
        ------
        RobotError
            `q` is no configuration; or the rank differs between the K, so that there is no array of
            all bases: call it for each of them.
        """
        return null_space_at(self, as_configurations(self, q), Task.of(task))

    def redundancy(self, task: Task | str) -> int:
        """Return n - rank J of the task at generic configurations (0: no self-motion)."""
        return redundancy(self, Task.of(task))

    def can_follow(self, task: Task | str) -> bool:
        """Return whether the arm can move the tool in every row of the task.

        ``planar_pose`` also needs an arm that moves in the x-y plane: elsewhere no angle about z
        has the rate ωz.
        """
        return can_follow(self, Task.of(task))

    def generic_configurations(self) -> Array:
        """Return a few configurations within the limits, at none of which anything is special."""
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
        manipulability √det(JJᵀ) of the task: a start for motions with a free one.
        """
        return most_dexterous(self, Task.of(task))

    def inverse_kinematics(
        self,
        pose: pin.SE3 | npt.ArrayLike,
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
        pose : SE3 or (4, 4)
            Where the tool should be, in world axes.
        task : Task or str
            The rows that count.
        seed : (n,), optional
            Where to start; by default the middle of the limits.
        rng : Generator or int
            Source of the restarts; the same one gives the same answer.
        attempts : int
            Number of starts.

        Returns
        -------
        (n,)
            The error from the pose is below 1e-10 (m and rad).

        Raises
        ------
        InverseKinematicsError
            No attempt converged; with the error of the best one.
        RobotError
            The pose is invalid.
        """
        return inverse_kinematics(self, pose, Task.of(task), seed, random_numbers(rng), attempts)

    def carrier_of(self, link: str) -> tuple[int, pin.SE3]:
        """Return the joint that moves a link, 0 for none, and the link's place in its frame.

        Raises
        ------
        RobotError
            There is no such link.
        """
        frame = self.model.frames[self._frame(link)]
        return int(frame.parentJoint), pin.SE3(frame.placement)

    def link_of(self, frame: int) -> str:
        """Return the link that a piece of `geometry` belongs to, by its frame."""
        return str(self.model.frames[frame].name)

    def joint_poses(self, q: Array) -> Array:
        """Return the frames of the model's joints in the world at q (K, n): (K, N, 7).

        Positions [m] and quaternions (x, y, z, w).
        """
        count = self.model.nv
        data, found = self.model.createData(), np.empty((len(q), count, 7))
        for k, configuration in enumerate(self.coupling.spread(q)):
            pin.forwardKinematics(self.model, data, configuration)
            found[k] = [pin.SE3ToXYZQUAT(data.oMi[joint + 1]) for joint in range(count)]
        return found

    def all_joints(self, q: Array) -> dict[str, Array]:
        """Return the positions of all joints that move at q (K, n), by name, (K,) each.

        Those of the joints that mimic others, too.
        """
        return dict(zip(list(self.model.names)[1:], self.coupling.spread(q).T, strict=True))

    def all_joints_rates(self, qd: Array) -> dict[str, Array]:
        """Return the velocities, or accelerations, of all joints that move; see `all_joints`."""
        return dict(zip(list(self.model.names)[1:], self.coupling.rates(qd).T, strict=True))

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
        return reduced_geometry(self.urdf, self.locked, kind)

    def visuals(self) -> tuple[Any, tuple[str, ...]]:
        """Return the visual geometry with all readable meshes, and the missing ones.

        Where nothing is left, collision bodies stand for it, or joints and their axes.

        Returns
        -------
        geometry : pinocchio.GeometryModel
            See `geometry`.
        missing : tuple of str
            Link, file and cause of each missing mesh, and the replacement of the whole.
        """
        geometry, missing = readable_visuals(self.urdf, self.locked)
        if not geometry.ngeoms:
            geometry, said = stand_in(self.urdf, self.locked, self.model, self.chain.tip)
            missing = (*missing, said)
        return geometry, missing
