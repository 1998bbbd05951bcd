"""Rows of targets as a file has them, made into segments; poses by inverse kinematics."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from selfmotion.basics import Array, FileFormatError, Flags, RobotError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.feed_segments import FeedSegment, times_at
from selfmotion.shop.controllers.program_settings import Axis, ProgramSettings, tool_from_flange
from selfmotion.shop.controllers.segments import PoseSegment, Segment, finer, on_one_side, straight
from selfmotion.shop.controllers.steps import put_on_arcs
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Name in messages of slow motions to where a shifted program goes on.
_SLOWLY = "a slow motion"
# Length below which a slow motion takes no time: rounding of digits [rad or m].
_THERE = 1e-5
# Speed of slow motions in shifted files: only their path is read [m/s, rad/s].
_SLOW = 0.05
# Number of poses between two targets at which inverse kinematics is solved.
_BETWEEN = 16
# Step of a joint above which poses are solved one after another [rad].
_STEP = 0.2
# Step of a joint that is a jump to another branch [rad].
_JUMP = 0.5
# Factor of that number for steps at speeds.
_FINER = 8


@dataclass
class Pose:
    """A tool pose of a file: position [m], quaternion x, y, z, w, external axes [deg or mm]."""

    place: Array
    turn: Array
    others: list[float]
    line: int


@dataclass
class Row:
    """A motion from rest to rest while it is read, a rest, or a slow motion.

    Attributes
    ----------
    name : str
        Of the seam or move.
    targets : list
        Where it begins, and its targets: axes [deg or mm], or poses. None for a rest; of a slow
        motion where it ends alone.
    seconds : list of float
        Times between targets [s]; of a motion at speeds the one that was planned for all of it.
    speeds : list of float
        Speed of each step [m/s]; none for times.
    vias : (K, 3)
        Point of each circular step [m]; no numbers for straight ones.
    is_spline : bool
        Whether it goes smoothly through its targets, not straight between them.
    is_slow : bool
        Whether it goes slowly to where the next motion begins.
    """

    name: str
    targets: list[list[float] | Pose]
    seconds: list[float]
    speeds: list[float] = field(default_factory=list)
    vias: Array = field(default_factory=lambda: np.zeros((0, 3)))
    is_spline: bool = False
    is_slow: bool = False

    @property
    def poses(self) -> list[Pose]:
        """Targets that are poses: all of them, or none."""
        return [target for target in self.targets if isinstance(target, Pose)]

    @property
    def axes(self) -> list[list[float]]:
        """Targets that are axes: all of them, or none."""
        return [target for target in self.targets if not isinstance(target, Pose)]

    def with_axes(self, columns: Sequence[int]) -> "Row":
        """Return it with some of the axes of its targets."""
        targets = [
            target if isinstance(target, Pose) else [target[k] for k in columns]
            for target in self.targets
        ]
        return replace(self, targets=targets)


@dataclass
class Places:
    """The frames of a file: the tool in the flange, the work object in its carrier.

    And whether it says that an axis carries the work object; None where it does not say.
    """

    carrier: str = ""
    work_name: str = ""
    flange: str = "-"
    planned: SE3 | None = None
    tool: SE3 | None = None
    work: SE3 | None = None
    is_carried: bool | None = None

    @property
    def shift(self) -> SE3 | None:
        """By how much the work object is elsewhere than planned; None for not at all."""
        if self.planned is None or self.work is None:
            return None
        shift = self.work * self.planned.inverse()
        is_same = np.abs(shift.homogeneous - np.eye(4)).max() < _REST
        return None if is_same else shift

    def frames(self, robot: RobotModel, axes: Sequence[Axis], file: object) -> ToolFrames:
        """Return the frames for a robot whose joints the axes are.

        Raises
        ------
        FileFormatError
            The file does not say enough, or says what the robot has not.
        """
        by_joint = {axis.joint: axis for axis in axes}
        if sorted(by_joint) != sorted(robot.joint_names):
            known = ", ".join(robot.joint_names)
            raise FileFormatError(f"{file}: has joints {', '.join(by_joint)}, expected {known}")
        if not self.carrier or self.work is None or self.tool is None:
            raise FileFormatError(
                f"{file}: poses need the comment 'poses: work object NAME of LINK, flange LINK', "
                f"the work object and the tool before them"
            )
        settings = ProgramSettings(flange=None if self.flange == "-" else self.flange)
        try:
            flange_to_tool = tool_from_flange(robot, settings)
            own = tuple(by_joint[name] for name in robot.joint_names)
            found = ToolFrames(
                robot, own, self.carrier, self.work, self.work_name, self.tool, flange_to_tool
            )
            why = found.undetermined()
        except RobotError as error:
            raise FileFormatError(f"{file}: {error}") from error
        if why:
            raise FileFormatError(f"{file}: has poses, but {why}")
        if self.is_carried not in (None, found.is_carried):
            stands, carried = "stands in the world", "is carried by an axis"
            says, expected = (carried, stands) if self.is_carried else (stands, carried)
            raise FileFormatError(
                f"{file}: its work object {says}, expected one that {expected}: its comments "
                f"say that it is of '{self.carrier}'"
            )
        return found


# Digits of poses leave this [m, parts of a turn].
_REST = 2e-6


@dataclass
class Follower:
    """Makes segments of rows, one after the other, from where the arm is.

    Parameters
    ----------
    file : path
    axes : tuple of Axis
        In the order of the file.
    frames : ToolFrames or None
        None where there are no poses.
    segments : list of Segment
        What is made so far.
    at : (n,) or None
        Where the arm is.
    approach : float
        How far it goes slowly from its first axis target to its first pose [rad or m].
    """

    file: object
    axes: tuple[Axis, ...]
    frames: ToolFrames | None
    segments: list[Segment] = field(default_factory=list)
    at: Array | None = None
    approach: float = 0.0

    def take(self, row: Row) -> None:
        """Take a row.

        Raises
        ------
        FileFormatError
            The arm cannot follow it.
        """
        if row.is_slow:
            self._slowly(row)
            return
        if row.poses:
            segment: Segment = self._segment(row)
        else:
            t = times_of(row.seconds)
            if not row.axes and self.at is None:
                raise FileFormatError(f"{self.file}: rests before it has a target")
            given = np.array(row.axes, dtype=np.float64)
            q = self.in_si(given) if row.axes else np.array([self.at] * len(t))
            segment = Segment(row.name, t, q)
        self.segments.append(segment)
        self.at = segment.q[-1]

    def in_si(self, values: Array, columns: Sequence[int] | None = None) -> Array:
        """Return coordinates in rad or m."""
        axes = self.axes if columns is None else [self.axes[k] for k in columns]
        return np.asarray(values * [1e-3 if axis.slides else np.pi / 180.0 for axis in axes])

    def _slowly(self, row: Row) -> None:
        before, (target,) = self.at, row.targets
        if not isinstance(target, Pose):
            self.at = self.in_si(np.array(target, dtype=np.float64))
            if before is not None and np.abs(self.at - before).max() > _THERE:
                seconds = float(np.abs(self.at - before).max()) / _SLOW
                both = np.array([before, self.at])
                self.segments.append(Segment(_SLOWLY, times_of([seconds]), both, is_slow=True))
            return
        frames, _ = self._known()
        if before is None:
            raise FileFormatError(f"{self.file}: begins with a pose, expected an axis target")
        place, turn = frames.places(self._by_robot(before[None]))
        far = float(np.linalg.norm(place[0] - target.place))
        angle = float(np.linalg.norm(frames.turned(turn, target.turn[None])))
        # Slowly from where the arm is, however far that is.
        seconds = max(far / _SLOW, angle / _SLOW, 0.1)
        moves = bool(self.segments) and max(far, angle) > _THERE
        here = Pose(place[0], turn[0], self._others(before), target.line)
        found = self._segment(Row(_SLOWLY, [here, target], [seconds]))
        segment = replace(found, is_slow=True)
        if not self.segments:
            self.approach = float(np.abs(segment.q[-1] - before).max())
        if moves:
            self.segments.append(segment)
        self.at = segment.q[-1]

    def _segment(self, row: Row) -> PoseSegment:
        """Return the segment of poses, its joints followed from where the arm is."""
        frames, order = self._known()
        places = np.array([pose.place for pose in row.poses])
        at_speeds = bool(row.speeds)
        t = times_at(places, row.vias, row.speeds) if at_speeds else times_of(row.seconds)
        turns = on_one_side(np.array([pose.turn for pose in row.poses]))
        outer = [k for k, axis in enumerate(self.axes) if axis.name.startswith("E")]
        if any(len(pose.others) != len(outer) for pose in row.poses):
            raise FileFormatError(f"{self.file}: poses have axes that its comments do not name")
        others = self.in_si(np.array([pose.others for pose in row.poses]), outer)
        # In the robot's order, as frames have them.
        in_file = {self.axes[k].joint: c for c, k in enumerate(outer)}
        columns = [in_file[frames.axes[k].joint] for k in frames.external.tolist()]
        others = others[:, columns]
        # Steps at speeds may be as long as the segment.
        count = _BETWEEN * (_FINER if at_speeds else 1)
        times = finer(t, np.linspace(0.0, 1.0, count, endpoint=False))
        rows = straight(times, t, np.hstack([places, turns, others]))
        if at_speeds:
            put_on_arcs(rows, times, t, places, row.vias)
        assert self.at is not None
        q = self._followed(frames, rows, self._by_robot(self.at[None])[0], row, count)
        every = q[np.arange(0, len(times), count)]

        def near(wanted: Array) -> Array:
            return np.stack([np.interp(wanted, times, column) for column in q.T], axis=1)

        segment = PoseSegment(
            row.name,
            t,
            every,
            places=places,
            turns=turns,
            frames=frames,
            near=near,
            order=np.arange(every.shape[1]),
        )
        if at_speeds:
            speeds, seconds = np.array(row.speeds), sum(row.seconds)
            segment = FeedSegment(
                **vars(segment),
                speeds=speeds,
                vias=row.vias,
                seconds=seconds,
                is_spline=row.is_spline,
            )
        return segment.in_order(order)

    def _followed(
        self, frames: ToolFrames, rows: Array, first: Array, row: Row, count: int
    ) -> Array:
        """Return the robot's joints along poses: from one target to the next at once, if they join.

        Else each found from the one before. From one target to the next are `count` poses.
        """
        found = np.empty((len(rows), len(first)))
        at = np.array(first)
        for k in range(0, len(rows), _BETWEEN):
            block = rows[k : k + _BETWEEN]
            q, arrived = self._solved(frames, block, at)
            steps = np.diff(np.vstack([at, q]), axis=0)[:, frames.arm]
            # The arm may be somewhere else before its first pose: of a shifted work object.
            if not arrived.all() or np.abs(steps[1 if k == 0 else 0 :]).max(initial=0.0) > _STEP:
                q = self._one_by_one(frames, block, at, row, (k, count))
            found[k : k + _BETWEEN] = q
            at = q[-1]
        return found

    def _solved(self, frames: ToolFrames, poses: Array, at: Array) -> tuple[Array, Flags]:
        seeds = np.repeat(at[None], len(poses), axis=0)
        seeds[:, frames.external] = poses[:, 7:]
        return frames.solved(poses[:, :3], poses[:, 3:7], seeds)

    def _one_by_one(
        self, frames: ToolFrames, poses: Array, at: Array, row: Row, place: tuple[int, int]
    ) -> Array:
        found, (first, count) = np.empty((len(poses), len(at))), place
        for k, pose in enumerate(poses, first):
            q, arrived = self._solved(frames, pose[None], at)
            far = np.abs(q[0] - at)[frames.arm].max()
            if not arrived[0] or (far > _JUMP and k):
                line = row.poses[min(k // count + 1, len(row.poses) - 1)].line
                raise FileFormatError(
                    f"{self.file}: line {line}: the arm does not follow to this pose: it is out of "
                    f"reach, or singular on the way"
                )
            found[k - first] = at = q[0]
        return found

    def _known(self) -> tuple[ToolFrames, list[int]]:
        """Return the frames, and which of the robot's joints each axis of the file is."""
        if self.frames is None:
            raise FileFormatError(f"{self.file}: has poses, whose joint positions need the robot")
        names = self.frames.robot.joint_names
        return self.frames, [names.index(axis.joint) for axis in self.axes]

    def _by_robot(self, q: Array) -> Array:
        _, order = self._known()
        return q[:, np.argsort(order)]

    def _others(self, q: Array) -> list[float]:
        """Return the external axes of joints in the file's order [deg, mm]."""
        return [
            float(value) * (1e3 if axis.slides else 180.0 / np.pi)
            for value, axis in zip(q, self.axes, strict=True)
            if axis.name.startswith("E")
        ]


def times_of(seconds: Sequence[float]) -> Array:
    """Return when targets are reached, of times between them, in whole microseconds."""
    return np.round(np.append(0.0, np.cumsum(seconds)), 6)


def pose_of_values(values: Sequence[float]) -> SE3:
    """Return a pose of position [m] and quaternion x, y, z, w."""
    x, y, z, w = values[3:7]
    turn = Quaternion(w, x, y, z)
    turn.normalize()
    return SE3(turn.toRotationMatrix(), np.array(values[:3]))
