"""URScript of linear motions in a feature: targets that a shop can shift and touch up."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_arms import check_joints
from selfmotion.shop.controllers.feed_segments import ZONE, FeedSegment
from selfmotion.shop.controllers.pose_numbers import TIME_DIGITS, urscript_numbers, urscript_pose
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_reader import ProgramReader, Target
from selfmotion.shop.controllers.program_settings import AXES, ProgramSettings
from selfmotion.shop.controllers.program_texts import pose_values
from selfmotion.shop.controllers.program_writer import ProgramWriter, WrittenPose
from selfmotion.shop.controllers.segment_building import Pose, pose_of_values
from selfmotion.shop.controllers.segments import Segment
from selfmotion.shop.controllers.statements import (
    Field,
    Language,
    Statement,
    number,
    seconds,
    truth,
    word,
)

# After Universal Robots' script manual (e-Series, 5.11): ``movel`` goes straight to a pose, given
# as position [m] and rotation vector [rad] in the base's frame, in the time t [s] where that is
# given, and blends with the next motion within the radius r [m]; ``pose_trans(feature, p)`` is
# pose p of a feature; ``movej`` with t and r likewise between joint positions. A seam at a feed
# has its speed v [m/s] in place of times, and ``movec`` through a via pose where it goes round,
# whose orientation turns evenly to that of its end (mode 0).

# Number of axes of these arms.
_JOINTS = 6
# Last of the standard digital outputs, which begin at 0.
_LAST_OUTPUT = 7
# Speed that `approach` is a share of [rad/s]: joints of these arms turn by π rad/s at least.
_FASTEST_JOINT = 3.14
# Acceleration of the approach by joints: movej's default [rad/s²].
_JOINT_ACCELERATION = 1.4
# Largest speed of the linear approach [m/s].
_FASTEST = 0.5
# Acceleration of the linear approach [m/s²].
_ACCELERATION = 1.2
# Largest radius of a blend [m].
_BLEND = 1e-3
# Largest share of the distance to the next target that a blend takes: two may not overlap.
_SHARE = 0.45
# Factor of speeds, which are written in four digits.
_UP = 1.001
# Length of path at which the arm goes on where the tool turns in place [m].
_MIN_LENGTH = 1e-5


def _six(reader: ProgramReader, text: str) -> list[float]:
    """Return the numbers in the innermost brackets of a text."""
    values = re.findall(r"\[([^\[\]]*)\]", text)[0].split(",")
    if len(values) != _JOINTS:
        raise reader.lines.fault(f"has {len(values)} numbers, expected {_JOINTS}")
    return [reader.lines.coordinate(item) for item in values]


def _read_axes(reader: ProgramReader, text: str) -> list[float]:
    return [float(np.degrees(value)) for value in _six(reader, text)]


def _read_pose(reader: ProgramReader, text: str) -> Pose:
    position, quaternion = urscript_pose(np.array(_six(reader, text)))
    return Pose(position, quaternion, [], reader.lines.number)


def _read_frame(reader: ProgramReader, text: str) -> SE3:
    position, quaternion = urscript_pose(np.array(_six(reader, text)))
    return pose_of_values([*position.tolist(), *quaternion.tolist()])


def _write_numbers(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:.9f}' for value in values)}]"


def _write_exactly(values: Array) -> str:
    return f"[{', '.join(map(repr, values.tolist()))}]"


def _write_pose(pose: WrittenPose) -> str:
    numbers = urscript_numbers(pose.position, pose.quaternion)
    return f"pose_trans(feature, p{_write_numbers(numbers)})"


def _write_frame(pose: SE3) -> str:
    values = np.array(pose_values(pose))
    return f"p{_write_numbers(urscript_numbers(values[:3], values[3:]))}"


_LIST = r"\[[^\[\]]*\]"
# States of a reader: before the program, in its head, between motions.
_BEFORE = ("before",)
_HEAD = ("head",)
_BODY = ("body",)
_PROGRAM = ("head", "body")
URSCRIPT = Language(
    comment="#",
    last="end",
    outputs=f"standard outputs of Universal Robots are numbers from 0 to {_LAST_OUTPUT}",
    has_output=lambda output: isinstance(output, int) and output <= _LAST_OUTPUT,
    fields={
        "name": word("selfmotion"),
        "event": word(".*"),
        "output": word(f"[0-{_LAST_OUTPUT}]"),
        "value": truth("False", "True"),
        "mass": number(".6g"),
        "length": number(".6g"),
        "seconds": seconds(TIME_DIGITS),
        "acceleration": number(".4g"),
        "speed": number(".7g"),
        "radius": number(".6f"),
        "stream": word(".*"),
        "start": Field(_LIST, _read_axes, _write_exactly),
        "axes": Field(_LIST, _read_axes, _write_numbers),
        "pose": Field(rf"pose_trans ?\( ?feature ?, ?p ?{_LIST} ?\)", _read_pose, _write_pose),
        "frame": Field(rf"p ?{_LIST}", _read_frame, _write_frame),
    },
    statements=(
        Statement("begin", "def <name>():", _BEFORE, then="head"),
        Statement("set", "set_tcp(<tool:frame>)", _HEAD),
        Statement("set", "set_payload(<mass>, [<x:length>, <y:length>, <z:length>])", _HEAD),
        Statement("set", "feature = <work:frame>", _HEAD),
        Statement(
            "joint approach", "movej(<axes:start>, a=<acceleration>, v=<speed>)", _PROGRAM, "body"
        ),
        Statement("joint", "movej(<axes>, t=<seconds>, r=<radius>)", _BODY),
        Statement("linear approach", "movel(<pose>, a=<acceleration>, v=<speed>)", _BODY),
        Statement("linear", "movel(<pose>, t=<seconds>, r=<radius>)", _BODY),
        Statement("linear", "movel(<pose>, a=<acceleration>, v=<speed>, r=<radius>)", _BODY),
        Statement(
            "circular",
            "movec(<via:pose>, <pose>, a=<acceleration>, v=<speed>, r=<radius>, mode=0)",
            _BODY,
        ),
        Statement("stream", "servoj(<stream>)", _PROGRAM),
        Statement("wait", "sleep(<seconds>)", _BODY),
        Statement("output", "set_standard_digital_out(<output>, <value>)", _BODY),
        Statement("event", "# event: <event>", _BODY),
        Statement("leave", "end", _BODY, then="after"),
    ),
)


def joint_approach(q: Array, settings: ProgramSettings) -> str:
    """Return the line that goes slowly to a configuration (6,)."""
    speed, ramp = settings.approach * _FASTEST_JOINT, settings.approach * _JOINT_ACCELERATION
    limits = {"acceleration": ramp, "speed": _four_digits(speed)}
    return f"  {URSCRIPT.text('joint approach', axes=q, **limits)}"


def payload(settings: ProgramSettings) -> list[str]:
    """Return the line of the load at the flange; none where settings have none."""
    if settings.mass is None:
        return []
    x, y, z = settings.center
    return [f"  {URSCRIPT.text('set', mass=settings.mass, x=x, y=y, z=z)}"]


def _four_digits(value: float) -> float:
    return float(f"{value:.4g}")


class UrscriptWriter(ProgramWriter):
    """Writer of linear motions, and of joint ones where poses do not keep a free move."""

    language = URSCRIPT

    def __init__(self, draft: Draft, name: str) -> None:
        super().__init__(draft, name)
        # Of the segment that is written [m].
        self._radii = np.zeros(0)

    @override
    def opening(self) -> list[str]:
        draft, frames = self.draft, self.draft.frames
        return [
            *(line.strip() for line in self.head()),
            URSCRIPT.text("begin", name=self.name),
            self.line("set", tool=draft.tool if frames is None else frames.tool),
            *payload(draft.settings),
            *([] if frames is None else [self.line("set", work=frames.work)]),
            *self.joint_approach(self.program.segments[0]),
        ]

    @override
    def closing(self) -> list[str]:
        return [URSCRIPT.text("leave")]

    @override
    def joint_approach(self, segment: Segment) -> list[str]:
        return [joint_approach(segment.q[0], self.draft.settings)]

    @override
    def linear_approach(self, segment: PoseSegment) -> list[str]:
        settings = self.draft.settings
        ramp, speed = settings.approach * _ACCELERATION, settings.approach * _FASTEST
        values = {"acceleration": ramp, "speed": _four_digits(speed)}
        return [self.line("linear approach", pose=self.pose(segment, 0), **values)]

    @override
    def motion(self, segment: Segment) -> list[str]:
        self._radii = self._blends(segment)
        return super().motion(segment)

    @override
    def pace(self, segment: Segment, k: int) -> dict[str, Any]:
        if not isinstance(segment, FeedSegment):
            return {"seconds": segment.t[k] - segment.t[k - 1], "radius": self._radii[k]}
        # The acceleration is that of the ramps.
        ramp = segment.speeds.max() / segment.ramps.each
        speed = segment.speeds[k - 1]
        return {"acceleration": ramp, "speed": speed, "radius": self._radii[k]}

    @override
    def joint_target(self, segment: Segment, k: int) -> list[float]:
        q: list[float] = segment.q[k].tolist()
        return q

    def _blends(self, segment: Segment) -> Array:
        """Return the radius of the blend at each target [m]; without one the arm stops there."""
        if isinstance(segment, PoseSegment):
            positions = segment.positions
        else:
            order = [
                self.draft.robot.joint_names.index(axis.joint) for axis in self.draft.program.axes
            ]
            positions = self.draft.robot.chain.along(segment.q[:, np.argsort(order)])[2]
        lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        radii = np.zeros(len(segment.t))
        most = ZONE if isinstance(segment, FeedSegment) else _BLEND
        radii[1:-1] = np.clip(_SHARE * np.minimum(lengths[:-1], lengths[1:]), _MIN_LENGTH, most)
        return radii


def write_urscript(file: FilePath, draft: Draft) -> None:
    """Write a program of linear motions for a controller of Universal Robots."""
    check_joints(draft.robot, [axis.joint for axis in draft.program.axes])
    UrscriptWriter(draft, "selfmotion").write(file)


class UrscriptReader(ProgramReader):
    """Reader of linear motions: of what `write_urscript` writes, spaces and numbers aside."""

    language = URSCRIPT
    moving = "the last r is not 0"
    metres = 1.0

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self.axes = list(AXES[:_JOINTS])
        # Of motions since the last stop [m].
        self._blends: list[float] = []

    @override
    def actions(self) -> Mapping[str, Callable[..., None]]:
        return {
            **super().actions(),
            "joint approach": self._joint_approach,
            "linear approach": self._linear_approach,
            "joint": self._take_axes,
            "linear": self._take_pose,
            "circular": self._take_pose,
            "stream": self._refuse_stream,
            "leave": partial(self.check_stopped, "the program ends"),
        }

    def _approach(
        self, target: list[float] | Pose, most: tuple[float, float], unit: str, *values: float
    ) -> None:
        """Take a slow motion; nothing has judged one that is faster than those."""
        if not all(0.0 < value <= _UP * limit for value, limit in zip(values, most, strict=True)):
            raise self.lines.fault(
                f"a motion to where the program goes on has a={values[0]:g}, v={values[1]:g}, "
                f"expected at most {most[0]:g} {unit}² and {most[1]:g} {unit}: nothing has "
                f"judged it"
            )
        self.approach(target)

    def _joint_approach(self, axes: list[float], acceleration: float, speed: float) -> None:
        most = _JOINT_ACCELERATION, _FASTEST_JOINT
        self._approach(axes, most, "rad/s", acceleration, speed)

    def _linear_approach(self, pose: Pose, acceleration: float, speed: float) -> None:
        self._approach(pose, (_ACCELERATION, _FASTEST), "m/s", acceleration, speed)

    def _take_axes(self, axes: list[float], seconds: float, radius: float) -> None:
        self._take(Target(axes, seconds), radius)

    def _take_pose(
        self,
        pose: Pose,
        radius: float,
        seconds: float = 0.0,
        speed: float = 0.0,
        acceleration: float = np.inf,
        via: Pose | None = None,
    ) -> None:
        if not seconds and not speed > 0.0:
            raise self.lines.fault(f"v is {speed:g} m/s, expected a number above 0")
        if speed and not 0.0 <= radius <= ZONE:
            raise self.lines.fault(
                f"r is {radius:.6f} m, expected 0 to {ZONE:g}: corners of seams at speeds are "
                f"judged as rounded by that at most"
            )
        self._take(Target(pose, seconds, speed, via, acceleration), radius)

    def _take(self, target: Target, radius: float) -> None:
        self._blends.append(radius)
        self.take(target, stops=False)
        if radius == 0.0:
            self._check_blends()
            self.stop()

    def _check_blends(self) -> None:
        """Refuse blends past the middle of a step: with them a controller leaves targets out.

        Where no arm is known, those that are larger than any that is written.
        """
        radii, self._blends = np.array(self._blends[:-1]), []
        most, positions = np.full(len(radii), _BLEND), self._places()
        if positions is not None:
            lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
            most = np.maximum(0.5 * np.minimum(lengths[:-1], lengths[1:]), _MIN_LENGTH)
        far = (radii > most) | (radii < 0.0)
        if far.any():
            k = int(np.argmax(far))
            raise self.lines.fault(
                f"a blend before this stop has r={radii[k]:g} m, expected at most {most[k]:.4g} m, "
                f"half of the way to the next target: blends that overlap leave targets out"
            )

    def _places(self) -> Array | None:
        """Return positions of the tool at the last stop and since, (K + 1, 3); None if unknown."""
        places = self._run_places()
        positions = [place.position for place in places if isinstance(place, Pose)]
        axes = [place for place in places if isinstance(place, list)]
        if len(positions) == len(places):
            return np.array(positions)
        stated_axes = self.comments.axes()
        joints = [stated_axes[axis][0] for axis in self.axes if axis in stated_axes]
        is_known = self.robot is not None and sorted(joints) == sorted(self.robot.joint_names)
        if self.robot is None or not is_known or len(axes) < len(places):
            return None
        order = [joints.index(name) for name in self.robot.joint_names]
        return self.robot.chain.along(np.radians(np.array(axes)[:, order]))[2]

    def _refuse_stream(self, stream: str) -> None:
        raise self.lines.fault(
            "a stream of servoj is not read; only programs of linear motions are, which "
            "export --set targets=poses writes"
        )
