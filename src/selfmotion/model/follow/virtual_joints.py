"""A tolerance is a virtual joint between the tool and its path.

Relaxed rows become joints that follow the tool's, or precede the arm's, and their tip is exactly on
the path: a row of position in world axes is a prismatic joint under the arm, one in tool axes a
prismatic joint behind the tool; a row of rotation is a hinge behind the tool. The rotation from the
tool's orientation to the path's is exp(-[δ]×), and two rows of δ are a joint that tilts without
twist: with hinges about the rows' axes i and j,

    exp([δ]×) = R_i(α) R_j(2β) R_i(α),   δ = 2 θ/sin θ (sin α cos β, sin β),   cos θ = cos α cos β,

since a product of quaternions that reads the same from both sides has no part along the third axis.
Its first and last hinge share one coordinate: a joint that is split. Where the third row is
relaxed, too, a hinge about it comes first. Of a task that prescribes where
the tool's axis points, tilting it needs no third hinge, unless rows have bands of their own.

A virtual joint's coordinate is 1 at the tool's band, or at a radian, or at the distance that a
radian of the arm moves, whichever is less. So wide bands, narrow bands and both kinds of joints
have similar weight in the shortest motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Flags, ProblemError
from selfmotion.model.robot import AXIS, JOINT, POSITION, ROTATION, Chain
from selfmotion.model.task import POSITION_ROWS, ROW_NAMES, Relaxation, Task

# A window's end may be off by this share of the motion, from rounding.
_ROUNDING = 1e-9
# Angles below this use the series of θ / sin θ; a half turn has no unique axis.
_SMALL = 1e-2


@dataclass(frozen=True)
class VirtualJoint:
    """One of the virtual joints.

    Attributes
    ----------
    name : str
    axis : int
        0, 1 or 2, in the axes of the frame that it is in.
    turns : bool
        Whether it is a hinge.
    scale : float
        How far it goes [rad or m] where its coordinate is 1.
    row : int or None
        Row x, y, z, rx, ry, rz that is 0 while it is held; None for one that always moves.
    limit : float
        Of |coordinate|.
    sign : float
        Of its axis.
    is_split : bool
        Whether it is two hinges, before and after the next one, that turn by half each.
    """

    name: str
    axis: int
    turns: bool
    scale: float
    row: int | None = None
    limit: float = np.inf
    sign: float = 1.0
    is_split: bool = False


class VirtualJoints:
    """The virtual joints of a task's relaxations.

    Parameters
    ----------
    task : Task
    relaxations : sequence of Relaxation
    duration : float
        Duration of the motion [s].
    lever : float
        Distance that is equivalent to a radian [m].

    Attributes
    ----------
    task : Task
        The rows in which the last joint's tip follows the path.
    under, behind : tuple of VirtualJoint
        Those under the arm, and those behind its tool, in the order of the chain.
    """

    def __init__(
        self, task: Task, relaxations: Sequence[Relaxation], duration: float, lever: float
    ) -> None:
        self.relaxations, self._duration, self._lever = tuple(relaxations), duration, lever
        in_tool = any(item.in_tool_axes for item in relaxations)
        rows = sorted({k for item in relaxations for k in item.indices})
        slides = [_slide(self, row) for row in rows if row < 3]
        self.under = () if in_tool else tuple(slides)
        hinges, self.task = _hinges(self, task, [row - 3 for row in rows if row >= 3], in_tool)
        self.behind = (*hinges, *(slides if in_tool else ()))

    def __repr__(self) -> str:
        """Return the names of the joints."""
        return f"VirtualJoints({', '.join(joint.name for joint in self.each)})"

    @property
    def each(self) -> tuple[VirtualJoint, ...]:
        """All of them, in the order of their coordinates."""
        return (*self.under, *self.behind)

    def label(self, number: int) -> str:
        """Return in words the deviation that one of them allows."""
        row = self.each[number].row
        return "a turn that is not prescribed" if row is None else f"the deviation {ROW_NAMES[row]}"

    def held(self, t: Array) -> Flags:
        """Return the mask of joints held at times t (K,), outside of all windows, (K, v)."""
        relaxed = _relaxed(self, t)
        rows = [joint.row for joint in self.each]
        free = [np.ones(len(t), bool) if row is None else relaxed[:, row] for row in rows]
        return np.asarray(~np.stack(free, axis=1))

    @cached_property
    def windowed(self) -> Flags:
        """Mask of joints that are held at some time, (v,)."""
        ends = {x for item in self.relaxations for x in item.window(self._duration)}
        # Where a window begins or ends later or earlier than the motion, its joints are held.
        return np.asarray(self.held(np.array(sorted(ends))).any(axis=0))

    @cached_property
    def at_zero(self) -> Flags:
        """Which joints are at 0 where the tool is on its path itself, (v,)."""
        return np.array([joint.row is not None for joint in self.each])

    def table(self, chain: Chain, first: int) -> Array:
        """Return the table of an arm's chain with them; coordinates start at number `first`."""
        own, passed = chain.table, _passed(self)
        count = len(self.under)
        extra = np.zeros((len(passed), 6, 3))
        extra[:, ROTATION:] = np.eye(3)
        for row, (k, share) in zip(extra, passed, strict=True):
            joint = self.each[k]
            row[JOINT] = first + k, joint.turns, share * joint.scale
            row[AXIS, joint.axis] = joint.sign
        table = np.concatenate([extra[:count], own[:-1], extra[count:], own[-1:]])
        if self.behind:
            # The arm's tip is where the first of them is.
            place = count + len(own) - 1
            table[place, POSITION], table[place, ROTATION:] = own[-1, POSITION], own[-1, ROTATION:]
            table[-1, POSITION], table[-1, ROTATION:] = 0.0, np.eye(3)
        return table

    def weights(self, metre: float) -> Array:
        """Return the weight of each coordinate, (v,): that of a joint of the arm with equal motion.

        `metre` is the weight of a metre [rad/m].
        """
        return np.array([joint.scale * (1.0 if joint.turns else metre) for joint in self.each])

    def widest(self, rows: Sequence[int]) -> float:
        """Return the largest common deviation of rows, over all times [rad or m].

        By the bands that hold then: rows that share one have another one in another window.
        """
        ends = sorted({x for item in self.relaxations for x in item.window(self._duration)})
        middles = [0.5 * (a + b) for a, b in pairwise(ends)]
        return max(_allowed(self, rows, time) for time in middles)

    def rows_of(self, item: Relaxation, s: Array) -> tuple[Array, Array]:
        """Return the deviation in a relaxation's rows at coordinates s (K, v): (K, k), (K, k, v).

        And its derivatives. Of the rows that tilt a pointing tool, as long as these are.
        """
        count = len(self.each)
        own = {joint.row: k for k, joint in enumerate(self.each) if joint.row is not None}
        turning = [k for k, joint in enumerate(self.each) if joint.name.startswith("tilt")]
        if not item.angular or not turning:
            places = [own[row] for row in item.indices]
            slopes = np.zeros((len(places), count))
            slopes[np.arange(len(places)), places] = [self.each[k].scale for k in places]
            return s @ slopes.T, np.broadcast_to(slopes, (len(s), *slopes.shape))
        vector, by = _tilted(self, s, turning, own)
        which = [row - 3 for row in item.indices]
        return vector[:, which], by[:, which]

    def coordinates(self, tool: tuple[Array, Array], path: tuple[Array, Array]) -> Array:
        """Return the coordinates that take tools to the path: rotations (K, 3, 3), places (K, 3).

        For tools that deviate from their path in relaxed rows alone.
        """
        from scipy.spatial.transform import Rotation

        (turns, places), (wanted, targets) = tool, path
        found = np.zeros((len(turns), len(self.each)))
        away = places - targets
        in_tool = (np.swapaxes(wanted, 1, 2) @ away[:, :, None])[:, :, 0]
        for k, joint in enumerate(self.each):
            if not joint.turns:
                rows = away if k < len(self.under) else in_tool
                found[:, k] = rows[:, joint.axis] / joint.scale
        hinges = [k for k, joint in enumerate(self.each) if joint.turns]
        if not hinges:
            return found
        q = Rotation.from_matrix(np.swapaxes(turns, 1, 2) @ wanted).as_quat(canonical=True)
        vector, real = q[:, :3], q[:, 3]
        tilting = [k for k in hinges if self.each[k].name.startswith("tilt")]
        for k in hinges:
            joint = self.each[k]
            if k in tilting:
                continue
            # A twist that precedes the rest, or is all of it.
            angle = 2.0 * np.arctan2(vector[:, joint.axis], real)
            found[:, k] = angle / joint.scale
            rest = Rotation.from_rotvec(-angle[:, None] * np.eye(3)[joint.axis])
            q = (rest * Rotation.from_quat(np.column_stack([vector, real]))).as_quat(canonical=True)
            vector, real = q[:, :3], q[:, 3]
        if tilting and self.each[tilting[0]].is_split:
            i, j = (self.each[k].axis for k in tilting)
            beta, alpha = np.arcsin(vector[:, j]), np.arctan2(vector[:, i], real)
            for k, half in zip(tilting, (alpha, beta), strict=True):
                found[:, k] = 2.0 * half / self.each[k].scale
        elif tilting:
            # R_i(a) R_j(b) takes the path's z axis to the tool's.
            axis = (np.swapaxes(turns, 1, 2) @ wanted[:, :, 2:])[:, :, 0]
            beta = np.arcsin(np.clip(axis[:, 0], -1.0, 1.0))
            alpha = np.arctan2(-axis[:, 1], axis[:, 2])
            for k, angle in zip(tilting, (alpha, beta), strict=True):
                found[:, k] = angle / self.each[k].scale
        return found


def _passed(joints: VirtualJoints) -> list[tuple[int, float]]:
    """Return the joints as the chain passes them: the number of each, and the share of its angle.

    A joint that is split is passed twice.
    """
    passed = [(k, 1.0) for k in range(len(joints.each))]
    for k, joint in enumerate(joints.each):
        if joint.is_split:
            place = passed.index((k, 1.0))
            passed[place : place + 2] = [(k, 0.5), passed[place + 1], (k, 0.5)]
    return passed


def _bands(joints: VirtualJoints, row: int) -> list[float]:
    return [item.band for item in joints.relaxations if row in item.indices]


def _scale(joints: VirtualJoints, row: int) -> float:
    return min(*_bands(joints, row), joints._lever if row < 3 else 1.0)


def _slide(joints: VirtualJoints, row: int) -> VirtualJoint:
    scale = _scale(joints, row)
    limit = max(_bands(joints, row)) / scale
    return VirtualJoint(f"relaxed {ROW_NAMES[row]}", row, False, scale, row, limit, -1.0)


def _hinges(
    joints: VirtualJoints, task: Task, axes: list[int], in_tool: bool
) -> tuple[list[VirtualJoint], Task]:
    """Return the hinges, and the rows of the frame behind them that are on the path."""
    if task is Task.POINTING:
        together = {item.rows for item in joints.relaxations if item.angular}
        alone = bool(axes) and {frozenset(rows) for rows in together} != {frozenset(_TILT)}
        across = [item for item in joints.relaxations if item.in_tool_axes]
        turned = any(set(item.rows) not in _ROUND for item in across)
        if not (alone or turned):
            return (_tilt(joints, *axes) if axes else []), task
        return [_heading(), *_about(joints, axes)], Task.POSE
    if task is Task.POSITION and in_tool:
        # The band is in its path's axes, from which the tool may be rotated by any angle.
        free = [VirtualJoint(f"tilt {k}", k, True, 1.0, is_split=k == 0) for k in range(2)]
        return [_heading(), *free], Task.POSE
    return _about(joints, axes), task


def _about(joints: VirtualJoints, axes: list[int]) -> list[VirtualJoint]:
    """Return the hinges of rows of rotation about up to three axes."""
    if len(axes) < 2:
        return [_hinge(joints, axis) for axis in axes]
    if len(axes) == 2:
        return _tilt(joints, *axes, twists=False)
    last = _twisted(joints)
    first, second = (axis for axis in axes if axis != last)
    return [_hinge(joints, last), *_tilt(joints, first, second, twists=False)]


def _hinge(joints: VirtualJoints, axis: int) -> VirtualJoint:
    row = 3 + axis
    scale = _scale(joints, row)
    limit = max(_bands(joints, row)) / scale
    return VirtualJoint(f"relaxed {ROW_NAMES[row]}", axis, True, scale, row, limit)


def _tilt(joints: VirtualJoints, i: int, j: int, *, twists: bool = True) -> list[VirtualJoint]:
    """Return the joints that tilt about two axes; the first is split where no twist may come in."""
    scale = min(_scale(joints, 3 + i), _scale(joints, 3 + j))
    return [
        VirtualJoint(
            f"tilt {ROW_NAMES[3 + axis]}",
            axis,
            True,
            scale,
            3 + axis,
            max(_bands(joints, 3 + axis)) / scale,
            is_split=axis == i and not twists,
        )
        for axis in (i, j)
    ]


def _twisted(joints: VirtualJoints) -> int:
    """Return the axis of the row that is never relaxed with one other row of rotation alone.

    Raises
    ------
    ProblemError
        There is none.
    """
    ends = sorted({x for item in joints.relaxations for x in item.window(joints._duration)})
    middles = np.array([0.5 * (a + b) for a, b in pairwise(ends)])
    pairs = set()
    for relaxed in _relaxed(joints, middles)[:, 3:]:
        if relaxed.sum() == 2:
            pairs.add(int(np.flatnonzero(~relaxed)[0]))
    if len(pairs) > 1:
        raise ProblemError(
            "relaxations: of the rows rx, ry and rz, two and another two are relaxed at "
            "different times; give all three one window, or relax no more than two of them"
        )
    return pairs.pop() if pairs else 2


def _relaxed(joints: VirtualJoints, t: Array) -> Flags:
    """Return the mask of relaxed rows at times t (K,), (K, 6)."""
    found = np.zeros((len(t), 6), dtype=np.bool_)
    near = _ROUNDING * joints._duration
    for item in joints.relaxations:
        first, last = item.window(joints._duration)
        started = (t > first + near) | (first <= near)
        lasts = (t < last - near) | (last >= joints._duration - near)
        found[:, item.indices] |= (started & lasts)[:, None]
    return found


def _allowed(joints: VirtualJoints, rows: Sequence[int], time: float) -> float:
    """Return the allowed deviation of rows at a time, 0 where they are not relaxed."""
    windows = [(item, item.window(joints._duration)) for item in joints.relaxations]
    here = [item for item, (first, last) in windows if first < time < last]
    each = [min((x.band for x in here if row in x.indices), default=0.0) for row in rows]
    shared = (item.band for item in here if set(rows) <= set(item.indices))
    return min([float(np.linalg.norm(each)), *shared])


def joint_of(joints: VirtualJoints, item: Relaxation) -> tuple[int, float] | None:
    """Return the number of the joint by which a relaxation's one row is off, and its scale.

    None for several rows, or a deviation that is not one joint's coordinate.
    """
    tilts = any(joint.name.startswith("tilt") for joint in joints.each)
    if len(item.rows) > 1 or (item.angular and tilts):
        return None
    number = next(k for k, joint in enumerate(joints.each) if joint.row == item.indices[0])
    return number, joints.each[number].scale


def _tilted(
    joints: VirtualJoints, s: Array, turning: list[int], own: dict[int, int]
) -> tuple[Array, Array]:
    """Return δ of a tilt, and of a twist before it where its row is relaxed, (K, 3)."""
    first, second = joints.each[turning[0]], joints.each[turning[1]]
    i, j = first.axis, second.axis
    k = 3 - i - j
    halves = first.is_split
    share = 0.5 if halves else 1.0
    slope_a, slope_b = share * first.scale, share * second.scale
    a, b = slope_a * s[:, turning[0]], slope_b * s[:, turning[1]]
    real, vector = np.cos(a) * np.cos(b), np.zeros((len(s), 3))
    vector[:, i], vector[:, j] = np.sin(a) * np.cos(b), np.sin(b)
    by_real, by_vector = np.zeros(s.shape), np.zeros((len(s), 3, s.shape[1]))
    by_real[:, turning[0]] = -slope_a * np.sin(a) * np.cos(b)
    by_real[:, turning[1]] = -slope_b * np.cos(a) * np.sin(b)
    by_vector[:, i, turning[0]] = slope_a * np.cos(a) * np.cos(b)
    by_vector[:, i, turning[1]] = -slope_b * np.sin(a) * np.sin(b)
    by_vector[:, j, turning[1]] = slope_b * np.cos(b)
    if halves and 3 + k in own:
        # A quaternion about the third axis comes first.
        place = own[3 + k]
        half = 0.5 * joints.each[place].scale
        c, z = np.cos(half * s[:, place])[:, None], np.sin(half * s[:, place])[:, None]
        axis, cross = np.eye(3)[k], np.cross(np.eye(3)[k], np.eye(3)).T
        turned = vector @ cross.T
        by_turned = cross @ by_vector
        whole = c[:, 0] * real
        by_whole = c * by_real
        by_whole[:, place] = -half * z[:, 0] * real
        by_both = c[:, :, None] * by_vector + z[:, :, None] * by_turned
        by_both += (z * by_real)[:, None, :] * axis[:, None]
        by_both[:, :, place] += half * (-z * vector + c * turned)
        by_both[:, :, place] += half * c * real[:, None] * axis
        vector = c * vector + z * turned + z * real[:, None] * axis
        # Of both quaternions of a rotation, the one below half a turn.
        side = np.where(whole < 0.0, -1.0, 1.0)
        real, vector = side * whole, side[:, None] * vector
        by_real, by_vector = side[:, None] * by_whole, side[:, None, None] * by_both
    size, slope = _angles(real, np.linalg.norm(vector, axis=1))
    factor = 2.0 if halves else 1.0
    by = size[:, None, None] * by_vector
    by += (slope[:, None] * by_real)[:, None, :] * vector[:, :, None]
    return factor * size[:, None] * vector, factor * by


_TILT = ("rx", "ry")
# Sets of rows that are invariant to a rotation about the tool's axis.
_ROUND: tuple[set[str], ...] = ({"z"}, {"x", "y"}, set(POSITION_ROWS))


def _heading() -> VirtualJoint:
    return VirtualJoint("heading", 2, True, 1.0)


def _angles(cosine: Array, sine: Array) -> tuple[Array, Array]:
    """Return θ / sin θ and its derivative by cos θ."""
    angle = np.arctan2(sine, cosine)
    small, square = angle < _SMALL, angle**2
    safe = np.where(small, 1.0, sine)
    size = np.where(small, 1.0 + square / 6.0 + 7.0 * square**2 / 360.0, angle / safe)
    slope = np.where(
        small,
        -(1.0 / 3.0 + 2.0 * square / 15.0),
        (angle * cosine - sine) / safe**3,
    )
    return size, slope


# Those of a path without tolerances.
NO_VIRTUAL_JOINTS = VirtualJoints(Task.POSE, (), 1.0, 1.0)
