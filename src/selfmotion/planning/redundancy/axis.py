"""The coordinate along a self-motion that a redundancy map has upwards, and which one it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Ints, ProblemError, nearest, shown
from selfmotion.model.follow import Follows, completed
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import SwivelAngle, null_space
from selfmotion.model.task import Task
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.redundancy.kernels import OWN, SWIVEL, TURN_OF_TOOL
from selfmotion.planning.redundancy.slices import slices_of
from selfmotion.problem.constraints import ActiveConstraint

# Names by which the coordinates other than joints are chosen.
TOOL, ELBOW = "tool", "elbow"
# Times of a motion at which the coordinate is chosen.
_FEW_TIMES = 17
# Least distance of the elbow from the line of shoulder and wrist, as a share of the arm's reach, at
# which a swivel says where the elbow is.
_BENT = 0.01
# Joints of an arm with shoulder, elbow and wrist.
_JOINTS = 7
# A whole turn [rad].
_TURN = 2.0 * np.pi
# Room beyond limits and lines at the ends of the coordinate's range, as a share of it.
_ROOM = 0.04
# Range about the plan of a coordinate without limits that is a length [m].
_AROUND = 1.0


@dataclass(frozen=True, eq=False)
class Axis:
    """A coordinate along the self-motion: what a redundancy map has upwards.

    Attributes
    ----------
    name : str
        By which it is chosen.
    label : str
        In words.
    unit : str
        ``"rad"`` or ``"m"``.
    code : (4,)
        For the compiled kernels: its kind, and which joints it is of.
    reference : (3,)
        Where the swivel is 0, in the axes of the chain's base.
    lower, upper : float
        Limits [rad or m]; ±inf for none.
    size : float
        Its value per unit of what the kernels compute: tolerances count in units of their bands.
    """

    name: str
    label: str
    unit: str
    code: Ints
    reference: Array
    lower: float = -np.inf
    upper: float = np.inf
    size: float = 1.0

    @property
    def turns(self) -> bool:
        """Whether values that differ by whole turns are the same."""
        return bool(self.code[0] != OWN)

    def along(self, follows: Follows, t: Array, z: Array) -> Array:
        """Return its values (K,) along a motion z (K, n) at times t (K,), without jumps."""
        n = follows.robot.dof
        if self.code[0] == OWN:
            return np.asarray(self.size * z[:, self.code[1]])
        if self.code[0] == SWIVEL:
            return np.asarray(np.unwrap(SwivelAngle()(follows.robot, z[:, :n])[0]))
        (item,) = follows.items
        _, turns, _ = item.chain.along(z)
        relative = np.einsum("kji,kjl->kil", item.target(t).rotation, turns)
        about = relative[:, 1, 0] - relative[:, 0, 1]
        return np.asarray(np.unwrap(np.arctan2(about, relative[:, 0, 0] + relative[:, 1, 1])))

    def grid(self, lines: list[Array], count: int) -> Array:
        """Return `count` values (M,) over its limits, or a turn, and over the plan's lines."""
        ends = [(float(line.min()), float(line.max())) for line in lines if len(line)]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        middle = 0.5 * (ends[0][0] + ends[0][1])
        around = 0.5 * _TURN if self.unit == "rad" else _AROUND
        first = self.lower if np.isfinite(self.lower) else middle - around
        last = self.upper if np.isfinite(self.upper) else middle + around
        low, high = min(low, first), max(high, last)
        is_turn = self.turns and high - low <= _TURN
        room = 0.0 if is_turn else _ROOM * (high - low)
        return np.linspace(low - room, high + room, count)


def axis_of(
    formulation: Formulation,
    motion: Trajectory,
    chosen: str | None,
    active: Sequence[ActiveConstraint] = (),
) -> Axis:
    """Return the coordinate of a map: the `chosen` one, or the first of `coordinates_of`.

    Parameters
    ----------
    formulation : Formulation
    motion : Trajectory
        Of the arm.
    chosen : str or None
        ``"tool"``, ``"elbow"``, or the name of a joint.
    active : sequence of ActiveConstraint
        What keeps the motion from a lower cost, the most expensive first.

    Raises
    ------
    ProblemError
        There is no such coordinate here.
    """
    name = coordinates_of(formulation, motion, active)[0] if chosen is None else chosen
    return _named(formulation, _along(formulation, motion)[1], name)


def coordinates_of(
    formulation: Formulation, motion: Trajectory, active: Sequence[ActiveConstraint]
) -> tuple[str, ...]:
    """Return the coordinates of maps by name, the one that tells most first.

    With one degree of redundancy that is one: the rotation of the tool about its axis for pointing
    tasks; else the deviation where one tolerance is all of it, the external axis where one joint
    alone is a part of the cell, or is the only prismatic one, and the swivel of the elbow for arms
    of seven revolute joints; else, the joint that the self-motion moves most where it moves it
    least. With more degrees maps are slices: first along the joints that active constraints name,
    by their multipliers; then the rotation of the tool where it is free; then the joints along
    whose self-motion the cost changes most. Parameters as in `axis_of`.
    """
    follows, names = formulation.follows, formulation.coordinates.names
    times, z = _along(formulation, motion)
    tool = [TOOL] if _turns_tool(follows) else []
    if follows.redundancy > 1:
        limited, moved = slices_of(formulation, times, z, active)
        first, last = ([names[k] for k in joints] for joints in (limited, moved))
        return tuple(dict.fromkeys([*first, *tool, *last]))
    if tool:
        return (TOOL,)
    external = _external(formulation)
    if external is not None:
        return (names[external],)
    if has_elbow(formulation, z):
        return (ELBOW,)
    basis = np.abs(null_space(follows.jacobians(z)))[:, :, 0]
    return (names[int(np.argmax(basis.min(axis=0)))],)


def _along(formulation: Formulation, motion: Trajectory) -> tuple[Array, Array]:
    """Return a few times (K,) of a motion, and all coordinates then, (K, n)."""
    times = np.linspace(float(motion.t[0]), float(motion.t[-1]), _FEW_TIMES)
    return times, completed(formulation.follows, times, motion(times))


def _named(formulation: Formulation, z: Array, chosen: str) -> Axis:
    """Return the coordinate of a name."""
    robot, names = formulation.robot, formulation.coordinates.names
    if not isinstance(chosen, str):
        raise ProblemError(
            f"{robot.name}: coordinate is {shown(chosen)}, expected a joint, '{TOOL}' or '{ELBOW}'"
        )
    if chosen == TOOL:
        if not _turns_tool(formulation.follows):
            raise ProblemError(
                f"{robot.name}: coordinate '{TOOL}' is the rotation about the tool's axis, which "
                f"task '{formulation.problem.task.value}' does not leave free: only 'pointing' does"
            )
        return _tool()
    if chosen == ELBOW:
        if not has_elbow(formulation, z):
            raise ProblemError(
                f"{robot.name}: coordinate '{ELBOW}' is the swivel angle of an arm with seven "
                f"revolute joints that is not stretched"
            )
        return _elbow(formulation)
    if chosen not in names:
        raise ProblemError(
            f"{robot.name}: no coordinate '{chosen}'{nearest(chosen, names)}; expected a joint, "
            f"'{TOOL}' or '{ELBOW}'"
        )
    return _joint(formulation, names.index(chosen))


def _tool() -> Axis:
    code = np.array([TURN_OF_TOOL, 0, 0, 0], dtype=np.int64)
    return Axis(TOOL, "rotation of the tool about its axis", "rad", code, np.zeros(3))


def _joint(formulation: Formulation, k: int) -> Axis:
    coordinates, envelope = formulation.coordinates, formulation.envelope
    code = np.array([OWN, k, 0, 0], dtype=np.int64)
    size = float(coordinates.sizes[k]) if k >= formulation.robot.dof else 1.0
    limits = size * float(envelope.lower[k]), size * float(envelope.upper[k])
    label = coordinates.label(k).removeprefix("the ")
    return Axis(coordinates.names[k], label, coordinates.unit(k), code, np.zeros(3), *limits, size)


def _elbow(formulation: Formulation) -> Axis:
    # Joint j of the chain, from 0 on, has its frame at place j + 1.
    code = np.array([SWIVEL, 2, 4, 6], dtype=np.int64)
    upwards = np.asarray(SwivelAngle().reference, dtype=np.float64)
    base = formulation.follows.items[0].chain.base_placement
    reference = np.ascontiguousarray(base.rotation.T @ upwards)
    return Axis(ELBOW, SwivelAngle().name, "rad", code, reference)


def _turns_tool(follows: Follows) -> bool:
    return len(follows.items) == 1 and follows.items[0].task is Task.POINTING


def has_elbow(formulation: Formulation, z: Array) -> bool:
    """Whether an arm has seven revolute joints, in order, on a base that stands, and a bent elbow.

    At all of the configurations z (K, n).
    """
    robot, follows = formulation.robot, formulation.follows
    parts = {name.rpartition("/")[0] for name in robot.joint_names}
    chain = follows.items[0].chain
    plain = (
        len(follows.items) == len(parts) == 1
        and formulation.coordinates.dof == robot.dof == robot.model.nv == _JOINTS
        and bool(robot.is_revolute.all())
        and chain.carrier < 0
    )
    if not plain or chain.joints.tolist() != list(range(_JOINTS)):
        return False
    shoulder, elbow, wrist = np.moveaxis(robot.joint_poses(z)[:, [1, 3, 5], :3], 1, 0)
    line, arm = wrist - shoulder, elbow - shoulder
    away = np.linalg.norm(np.cross(line, arm), axis=1) / np.linalg.norm(line, axis=1)
    return bool((away > _BENT * robot.reach).all())


def _external(formulation: Formulation) -> int | None:
    """Return the one tolerance, joint that is a part of a cell, or joint that slides; else None."""
    robot, coordinates = formulation.robot, formulation.coordinates
    if coordinates.dof > robot.dof:
        return robot.dof if coordinates.dof == robot.dof + 1 else None
    parts = [name.rpartition("/")[0] for name in robot.joint_names]
    alone = [k for k, part in enumerate(parts) if parts.count(part) == 1]
    slides = np.flatnonzero(~robot.is_revolute).tolist()
    for found in (alone, slides):
        if len(found) == 1:
            return int(found[0])
    return None
