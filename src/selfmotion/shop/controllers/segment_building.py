"""Segments built from the targets of a file; joints of tool poses by inverse kinematics."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from selfmotion.basics import Array, FileFormatError, Flags, RobotError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.arcs import put_on_arcs
from selfmotion.shop.controllers.controller_axes import Axis, tool_from_flange
from selfmotion.shop.controllers.feed_segments import FeedSegment, nominal_target_times
from selfmotion.shop.controllers.pose_segments import PoseSegment, aligned_quaternions, linear_poses
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.segments import Segment, subdivided
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Name in messages of inserted slow motions between the segments of a shifted program.
_SLOW_NAME = "a slow motion"
# Distance below which a slow motion is omitted: rounding of digits [rad or m].
_SAME_PLACE = 1e-5
# Assumed speed of slow motions, of which only the path matters [m/s, rad/s].
_SLOW_SPEED = 0.05
# Shortest duration of a slow motion to a pose [s].
_SHORTEST = 0.1
# Inverse kinematics is solved at so many poses per interval between two targets.
_SAMPLES = 16
# The same of an interval at a speed, as a multiple.
_SAMPLES_AT_SPEED = 8
# Joint step above which poses are solved one after another, each from the previous one [rad].
_LARGE_STEP = 0.2
# Joint step that is a jump to another branch of the inverse kinematics [rad].
_JUMP = 0.5


@dataclass
class Pose:
    """A tool pose of a file.

    Attributes
    ----------
    position : (3,)
        [m]
    quaternion : (4,)
        x, y, z, w.
    external : list of float
        External axes [deg or mm].
    line : int
        Line of the file.
    """

    position: Array
    quaternion: Array
    external: list[float]
    line: int


@dataclass
class Row:
    """A motion from rest to rest as a file has it, a pause, or an inserted slow motion.

    Attributes
    ----------
    name : str
        Name of the seam or move.
    targets : list
        Initial target and further ones: axes [deg or mm], or poses. Empty for a pause; of a slow
        motion the last one only.
    seconds : list of float
        Durations between targets [s]; of a motion at speeds its planned duration.
    speeds : list of float
        Speed of each step [m/s]; empty for steps with durations.
    vias : (K, 3)
        Via point of each circular step [m]; NaN for linear steps.
    is_spline : bool
        Whether the targets are joined by a spline, not by lines.
    is_slow : bool
        Whether it is a slow motion to the beginning of the next one.
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
        """All targets where they are poses, else an empty list."""
        return [target for target in self.targets if isinstance(target, Pose)]

    @property
    def axes(self) -> list[list[float]]:
        """All targets where they are axes, else an empty list."""
        return [target for target in self.targets if not isinstance(target, Pose)]

    def with_axes(self, columns: Sequence[int]) -> "Row":
        """Return the row with a selection of the axes of its targets."""
        targets = [
            target if isinstance(target, Pose) else [target[k] for k in columns]
            for target in self.targets
        ]
        return replace(self, targets=targets)


@dataclass
class ProgramFrames:
    """Frames of a file: the tool relative to the flange, the work object relative to its carrier.

    `is_carried` is whether the file states that an axis carries the work object; None where it
    states neither.
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
        """Displacement of the work object from its planned pose; None for none."""
        if self.planned is None or self.work is None:
            return None
        shift = self.work * self.planned.inverse()
        is_same = np.abs(shift.homogeneous - np.eye(4)).max() < _ROUNDING
        return None if is_same else shift

    def frames(self, robot: RobotModel, axes: Sequence[Axis], file: object) -> ToolFrames:
        """Return the tool frames of a robot with these axes.

        Raises
        ------
        FileFormatError
            A frame is missing in the file, or does not fit the robot.
        """
        by_joint = {axis.joint: axis for axis in axes}
        if sorted(by_joint) != sorted(robot.joint_names):
            joints = ", ".join(robot.joint_names)
            raise FileFormatError(f"{file}: has joints {', '.join(by_joint)}, expected {joints}")
        if not self.carrier or self.work is None or self.tool is None:
            raise FileFormatError(
                f"{file}: poses need the comment 'poses: work object NAME of LINK, flange LINK', "
                f"the work object and the tool before them"
            )
        settings = ProgramSettings(flange=None if self.flange == "-" else self.flange)
        try:
            flange_to_tool = tool_from_flange(robot, settings)
            in_order = tuple(by_joint[name] for name in robot.joint_names)
            frames = ToolFrames(
                robot, in_order, self.carrier, self.work, self.work_name, self.tool, flange_to_tool
            )
            why = frames.undetermined()
        except RobotError as error:
            raise FileFormatError(f"{file}: {error}") from error
        if why:
            raise FileFormatError(f"{file}: has poses, but {why}")
        if self.is_carried not in (None, frames.is_carried):
            stands, carried = "stands in the world", "is carried by an axis"
            says, expected = (carried, stands) if self.is_carried else (stands, carried)
            raise FileFormatError(
                f"{file}: its work object {says}, expected one that {expected}: its comments "
                f"say that it is of '{self.carrier}'"
            )
        return frames


# Rounding of poses to the digits of files [m, elements of a rotation].
_ROUNDING = 2e-6


@dataclass
class SegmentBuilder:
    """Builds segments from rows in sequence, each from the final configuration of the last.

    Parameters
    ----------
    file : path
    axes : tuple of Axis
        In the order of the file.
    frames : ToolFrames or None
        None where the file has no poses.
    segments : list of Segment
        Segments so far.
    last_q : (n,) or None
        Configuration in which the rows so far end; None before the first.
    start_gap : float
        Joint distance from the first axis target to the first pose [rad or m].
    """

    file: object
    axes: tuple[Axis, ...]
    frames: ToolFrames | None
    segments: list[Segment] = field(default_factory=list)
    last_q: Array | None = None
    start_gap: float = 0.0

    def add(self, row: Row) -> None:
        """Add the segment of a row.

        Raises
        ------
        FileFormatError
            Inverse kinematics has no continuous solution along it.
        """
        if row.is_slow:
            self._add_slow_motion(row)
            return
        if row.poses:
            segment: Segment = self._segment(row)
        else:
            t = times_of(row.seconds)
            if not row.axes and self.last_q is None:
                raise FileFormatError(f"{self.file}: rests before it has a target")
            values = np.array(row.axes, dtype=np.float64)
            q = self.in_si(values) if row.axes else np.array([self.last_q] * len(t))
            segment = Segment(row.name, t, q)
        self.segments.append(segment)
        self.last_q = segment.q[-1]

    def in_si(self, values: Array, columns: Sequence[int] | None = None) -> Array:
        """Return coordinates in rad or m."""
        axes = self.axes if columns is None else [self.axes[k] for k in columns]
        return np.asarray(values * [1e-3 if axis.slides else np.pi / 180.0 for axis in axes])

    def _add_slow_motion(self, row: Row) -> None:
        before, (target,) = self.last_q, row.targets
        if not isinstance(target, Pose):
            self.last_q = self.in_si(np.array(target, dtype=np.float64))
            if before is not None and np.abs(self.last_q - before).max() > _SAME_PLACE:
                seconds = float(np.abs(self.last_q - before).max()) / _SLOW_SPEED
                both = np.array([before, self.last_q])
                self.segments.append(Segment(_SLOW_NAME, times_of([seconds]), both, is_slow=True))
            return
        frames, _ = self._frames_and_order()
        if before is None:
            raise FileFormatError(f"{self.file}: begins with a pose, expected an axis target")
        position, quaternion = frames.tool_poses(self._by_robot(before[None]))
        far = float(np.linalg.norm(position[0] - target.position))
        angle = float(np.linalg.norm(frames.turned(quaternion, target.quaternion[None])))
        # Slowly from where the arm is, however far that is.
        seconds = max(far / _SLOW_SPEED, angle / _SLOW_SPEED, _SHORTEST)
        moves = bool(self.segments) and max(far, angle) > _SAME_PLACE
        begin = Pose(position[0], quaternion[0], self._external_axes(before), target.line)
        slow = self._segment(Row(_SLOW_NAME, [begin, target], [seconds]))
        segment = replace(slow, is_slow=True)
        if not self.segments:
            self.start_gap = float(np.abs(segment.q[-1] - before).max())
        if moves:
            self.segments.append(segment)
        self.last_q = segment.q[-1]

    def _segment(self, row: Row) -> PoseSegment:
        """Return the segment of poses, with joints by inverse kinematics from the current ones."""
        frames, order = self._frames_and_order()
        positions = np.array([pose.position for pose in row.poses])
        at_speeds = bool(row.speeds)
        t = (
            nominal_target_times(positions, row.vias, row.speeds)
            if at_speeds
            else times_of(row.seconds)
        )
        quaternions = aligned_quaternions(np.array([pose.quaternion for pose in row.poses]))
        externals = [k for k, axis in enumerate(self.axes) if axis.name.startswith("E")]
        if any(len(pose.external) != len(externals) for pose in row.poses):
            raise FileFormatError(f"{self.file}: poses have axes that its comments do not name")
        external = self.in_si(np.array([pose.external for pose in row.poses]), externals)
        # In the robot's order, as in ToolFrames.
        in_file = {self.axes[k].joint: c for c, k in enumerate(externals)}
        columns = [in_file[frames.axes[k].joint] for k in frames.external.tolist()]
        external = external[:, columns]
        # A step at a speed may be the whole segment.
        count = _SAMPLES * (_SAMPLES_AT_SPEED if at_speeds else 1)
        times = subdivided(t, np.linspace(0.0, 1.0, count, endpoint=False))
        rows = linear_poses(times, t, np.hstack([positions, quaternions, external]))
        if at_speeds:
            put_on_arcs(rows, times, t, positions, row.vias)
        if self.last_q is None:
            raise FileFormatError(f"{self.file}: begins with a pose, expected an axis target")
        q = self._inverse_kinematics(frames, rows, self._by_robot(self.last_q[None])[0], row, count)
        target_q = q[np.arange(0, len(times), count)]

        def near(seed_times: Array) -> Array:
            return np.stack([np.interp(seed_times, times, column) for column in q.T], axis=1)

        segment = PoseSegment(
            row.name,
            t,
            target_q,
            positions=positions,
            quaternions=quaternions,
            frames=frames,
            near=near,
            order=np.arange(target_q.shape[1]),
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

    def _inverse_kinematics(
        self, frames: ToolFrames, rows: Array, first: Array, row: Row, count: int
    ) -> Array:
        """Return the robot's joints along poses, of which there are `count` per interval.

        A block of poses is solved at once; where that is not continuous, one pose after another.
        """
        joints = np.empty((len(rows), len(first)))
        current = np.array(first)
        for k in range(0, len(rows), _SAMPLES):
            block = rows[k : k + _SAMPLES]
            q, arrived = self._solutions(frames, block, current)
            steps = np.diff(np.vstack([current, q]), axis=0)[:, frames.arm]
            # The arm may be elsewhere before its first pose: of a shifted work object.
            if (
                not arrived.all()
                or np.abs(steps[1 if k == 0 else 0 :]).max(initial=0.0) > _LARGE_STEP
            ):
                q = self._sequential_solutions(frames, block, current, row, (k, count))
            joints[k : k + _SAMPLES] = q
            current = q[-1]
        return joints

    def _solutions(self, frames: ToolFrames, poses: Array, current: Array) -> tuple[Array, Flags]:
        """Return the joints of poses, all from the current ones, and whether each converged."""
        seeds = np.repeat(current[None], len(poses), axis=0)
        seeds[:, frames.external] = poses[:, 7:]
        return frames.inverse_kinematics(poses[:, :3], poses[:, 3:7], seeds)

    def _sequential_solutions(
        self, frames: ToolFrames, poses: Array, current: Array, row: Row, position: tuple[int, int]
    ) -> Array:
        """Return the joints of poses, each from those of the pose before.

        `position` is the index of the first pose in its row, and the poses per interval.
        """
        joints, (first, count) = np.empty((len(poses), len(current))), position
        for k, pose in enumerate(poses, first):
            q, arrived = self._solutions(frames, pose[None], current)
            jump = np.abs(q[0] - current)[frames.arm].max()
            if not arrived[0] or (jump > _JUMP and k):
                line = row.poses[min(k // count + 1, len(row.poses) - 1)].line
                raise FileFormatError(
                    f"{self.file}: line {line}: the arm does not follow to this pose: it is out of "
                    f"reach, or singular on the way"
                )
            joints[k - first] = current = q[0]
        return joints

    def _frames_and_order(self) -> tuple[ToolFrames, list[int]]:
        """Return the tool frames, and the index of the robot's joint for each axis of the file."""
        if self.frames is None:
            raise FileFormatError(f"{self.file}: has poses, whose joint positions need the robot")
        names = self.frames.robot.joint_names
        return self.frames, [names.index(axis.joint) for axis in self.axes]

    def _by_robot(self, q: Array) -> Array:
        """Return configurations (K, n) in the robot's order of joints."""
        _, order = self._frames_and_order()
        return q[:, np.argsort(order)]

    def _external_axes(self, q: Array) -> list[float]:
        """Return the external axes of joints in the file's order [deg, mm]."""
        return [
            float(value) * (1e3 if axis.slides else 180.0 / np.pi)
            for value, axis in zip(q, self.axes, strict=True)
            if axis.name.startswith("E")
        ]


def times_of(seconds: Sequence[float]) -> Array:
    """Return the times of targets from the durations between them, in whole microseconds [s]."""
    return np.round(np.append(0.0, np.cumsum(seconds)), 6)


def pose_of_values(values: Sequence[float]) -> SE3:
    """Return a pose from position [m] and quaternion x, y, z, w."""
    x, y, z, w = values[3:7]
    quaternion = Quaternion(w, x, y, z)
    quaternion.normalize()
    return SE3(quaternion.toRotationMatrix(), np.array(values[:3]))
