"""URScript for arms of Universal Robots: a stream of ``servoj``, or linear motions in a feature."""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, ProblemError, write_text
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, log3
from selfmotion.shop.controllers.controller_program import Draft, before, head, with_begins
from selfmotion.shop.controllers.feed_segments import ZONE, FeedSegment
from selfmotion.shop.controllers.program_facts import held_in_words
from selfmotion.shop.controllers.program_lines import StopReader
from selfmotion.shop.controllers.program_settings import AXES, ProgramSettings, tool_from_flange
from selfmotion.shop.controllers.program_texts import as_word, pin_values, plain
from selfmotion.shop.controllers.read_segments import Pose, pose_of_values
from selfmotion.shop.controllers.segments import PoseSegment, Segment
from selfmotion.shop.controllers.thinning import TIME_DIGITS
from selfmotion.shop.controllers.tool_frames import urscript_numbers, urscript_pose

# URScript for arms of Universal Robots: a stream of ``servoj`` at a fixed rate.
#
# After Universal Robots' script manual (e-Series, 5.11): ``set_tcp`` is the tool's pose in the
# flange as position [m] and rotation vector [rad], ``movej`` goes to the start at a joint speed
# and acceleration [rad/s, rad/s²], ``set_standard_digital_out`` switches an output.

# servoj smooths by looking ahead [s]: the default of the manual.
_LOOK_AHEAD = 0.1
# Standard digital outputs are 0 to this one.
_LAST_OUTPUT = 7
# It follows with this gain: the default of the manual.
_GAIN = 300
_JOINTS = 6
# Speed that `approach` is a share of [rad/s]: joints of these arms turn by π rad/s at least.
_FASTEST_JOINT = 3.14
# Acceleration of the approach: movej's default [rad/s²].
_JOINT_ACCELERATION = 1.4


def script(
    robot: RobotModel,
    joints: Sequence[str],
    q: Array,
    rate: float,
    settings: ProgramSettings | None = None,
    events: Sequence[tuple[int, str]] = (),
) -> str:
    """Return a program that moves to the start, slowly, and then streams the samples.

    Parameters
    ----------
    robot : RobotModel
    joints : sequence of str
        Six revolute joints of it, in the controller's order: base to wrist.
    q : (K, 6)
        [rad]
    rate : float
        [Hz]
    settings : ProgramSettings, optional
        Flange, load, outputs, and how fast to the start.
    events : sequence of (int, str)
        Before which sample what happens. Outputs are switched as late as the arm follows.

    Raises
    ------
    ProblemError
        The arm has other joints, or an event no output.
    """
    asked = ProgramSettings() if settings is None else settings
    check_joints(robot, joints)
    period = repr(1.0 / rate)
    center = ", ".join(f"{value:.6g}" for value in asked.center)
    lines = [
        f"# {plain(robot.name)}: {len(q)} setpoints, "
        f"joints {', '.join(map(as_word, joints))} [rad].",
        f"# servoj at {rate:g} Hz (t = {period} s), lookahead_time = {_LOOK_AHEAD} s, "
        f"gain = {_GAIN}:",
        f"# the arm follows about {_LOOK_AHEAD} s late, and rounds what is faster than that;",
        "# outputs are switched as much later, when the arm is there.",
        *([f"# {plain(held_in_words(robot))}"] if robot.locked else []),
        "def selfmotion():",
        *_tool(robot, joints, asked),
        *([] if asked.mass is None else [f"  set_payload({asked.mass:.6g}, [{center}])"]),
        slow_joints(q[0], asked),
    ]
    late = round(_LOOK_AHEAD * rate)
    switched = {k + late: [name for at, name in events if at == k] for k, _ in events}
    # The last setpoint is held until the arm is where the last events are.
    held = max([len(q), *(k + 1 for k in switched)])
    for k in range(held):
        row = q[min(k, len(q) - 1)]
        lines += [f"  {event_line(name, asked)}" for name in switched.get(k, ())]
        lines.append(
            f"  servoj({_vector(row)}, t={period}, lookahead_time={_LOOK_AHEAD}, gain={_GAIN})"
        )
    return "\n".join([*lines, "  stopj(2.0)", "end", ""])


def check_joints(robot: RobotModel, joints: Sequence[str], what: str = "") -> None:
    """Refuse joints, of the robot or of `what`, that are not those of an arm of UR."""
    slides = [name for name in joints if robot.is_prismatic(name)]
    if len(joints) != _JOINTS or slides:
        raise ProblemError(
            f"{what or robot.name}: URScript is for arms of {_JOINTS} revolute joints, this one "
            f"has {len(joints)} joints"
            + (f", of which '{slides[0]}' slides" if slides else "")
            + "; tables (.csv) and ROS 2 messages (.yaml) are for any joints"
        )


def slow_joints(q: Array, settings: ProgramSettings) -> str:
    """Return the line that goes slowly to a configuration (6,)."""
    speed, push = settings.approach * _FASTEST_JOINT, settings.approach * _JOINT_ACCELERATION
    return f"  movej({_vector(q)}, a={push:.4g}, v={speed:.4g})"


def _tool(robot: RobotModel, joints: Sequence[str], settings: ProgramSettings) -> list[str]:
    """Return the line of the tool; none for one arm of a cell, whose tool may be another's."""
    if len(joints) < robot.dof:
        return []
    tool = tool_from_flange(robot, settings)
    place = [*tool.translation.tolist(), *log3(tool.rotation).tolist()]
    return [f"  set_tcp(p[{', '.join(f'{value + 0.0:.9f}' for value in place)}])"]


def event_line(event: str, settings: ProgramSettings) -> str:
    """Return the lines that switch an event's output, or its comment."""
    signal = settings.signal(event)
    if signal is None:
        return f"# event: {' '.join(event.split())}"
    output, value = signal
    if not isinstance(output, int) or output > _LAST_OUTPUT:
        raise ProblemError(
            f"signals: '{event}' switches {output!r}; standard outputs of Universal Robots are "
            f"numbers from 0 to {_LAST_OUTPUT}"
        )
    return f"set_standard_digital_out({output}, {value})"


def _vector(values: Array) -> str:
    return f"[{', '.join(repr(value) for value in values.tolist())}]"


# URScript of linear motions in a feature: targets that a shop can shift and touch up.
#
# After Universal Robots' script manual (e-Series, 5.11): ``movel`` goes straight to a pose, given
# as position [m] and rotation vector [rad] in the base's frame, in the time t [s] where that is
# given, and blends with the next motion within the radius r [m]; ``pose_trans(feature, p)`` is
# pose p of a feature; ``movej`` with t and r likewise between joint positions. A seam at a feed
# has its speed v [m/s] in place of times, and ``movec`` through a via pose where it goes round,
# whose orientation turns evenly to that of its end (mode 0).

# Largest speed of the approach [m/s].
_FASTEST = 0.5
# Acceleration of the approach [m/s²].
_ACCELERATION = 1.2
# Largest radius of a blend [m].
_BLEND = 1e-3
# Largest share of the distance to the next target that a blend takes: two may not overlap.
_SHARE = 0.45
# Factor of speeds, which are written in four digits.
_UP = 1.001
# Length of path at which the arm goes on where the tool turns in place [m].
_LEAST = 1e-5


def write_urscript(file: FilePath, draft: Draft) -> None:
    """Write a program of linear motions, and of joint ones where poses do not keep a free move."""
    joints = [axis.joint for axis in draft.program.axes]
    check_joints(draft.robot, joints)
    settings, first = draft.settings, draft.program.segments[0]
    center = ", ".join(f"{value:.6g}" for value in settings.center)
    lines = [
        *(f"# {line}" for line in head(draft)),
        "def selfmotion():",
        f"  set_tcp({_pose(draft.tool if draft.frames is None else draft.frames.tool)})",
        *([] if settings.mass is None else [f"  set_payload({settings.mass:.6g}, [{center}])"]),
        *([] if draft.frames is None else [f"  feature = {_pose(draft.frames.work)}"]),
        _slowly(draft, first, by_axes=True),
    ]
    for segment, begun in with_begins(draft.program.segments):
        lines.append(f"  # step: {plain(segment.name)}")
        lines += [f"  # {line}" for line in before(segment)]
        if begun is not None:
            lines.append(_slowly(draft, begun, by_axes=not isinstance(begun, PoseSegment)))
        lines += _moves(draft, segment)
    write_text(file, "\n".join([*lines, "end", ""]))


def _slowly(draft: Draft, segment: Segment, *, by_axes: bool) -> str:
    if by_axes:
        return slow_joints(segment.q[0], draft.settings)
    share = draft.settings.approach
    return (
        f"  movel({_target(segment, 0)}, a={share * _ACCELERATION:.4g}, v={share * _FASTEST:.4g})"
    )


def _moves(draft: Draft, segment: Segment) -> list[str]:
    happens: dict[int, list[str]] = {k: [] for k in range(len(segment.t))}
    for item in segment.events:
        happens[item.target].append(item.name)
    lines = [f"  {event_line(name, draft.settings)}" for name in happens[0]]
    radii = _radii(draft, segment)
    for k in range(1, len(segment.t)):
        seconds = f"{segment.t[k] - segment.t[k - 1]:.{TIME_DIGITS}f}"
        word = "movel" if isinstance(segment, PoseSegment) else "movej"
        if isinstance(segment, FeedSegment):
            lines.append(f"  {_at_speed(segment, k)}, r={radii[k]:.6f}{_mode(segment, k)})")
        elif segment.is_rest:
            lines.append(f"  sleep({seconds})")
        else:
            lines.append(f"  {word}({_target(segment, k)}, t={seconds}, r={radii[k]:.6f})")
        lines += [f"  {event_line(name, draft.settings)}" for name in happens[k]]
    return lines


def _at_speed(segment: FeedSegment, k: int) -> str:
    """Return a motion at a speed, but for its blend; the acceleration is that of the ramps."""
    pace = f"a={segment.speeds.max() / segment.ramps.each:.4g}, v={segment.speeds[k - 1]:.7g}"
    if not segment.goes_round(k):
        return f"movel({_target(segment, k)}, {pace}"
    return f"movec({_target(segment.middles, k - 1)}, {_target(segment, k)}, {pace}"


def _mode(segment: FeedSegment, k: int) -> str:
    """Return how the orientation of a circular motion turns: evenly to that of its end."""
    return ", mode=0" if segment.goes_round(k) else ""


def _radii(draft: Draft, segment: Segment) -> Array:
    """Return the radius of the blend at each target [m]; without one the arm stops there."""
    if isinstance(segment, PoseSegment):
        places = segment.places
    else:
        order = [draft.robot.joint_names.index(axis.joint) for axis in draft.program.axes]
        places = draft.robot.chain.along(segment.q[:, np.argsort(order)])[2]
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    radii = np.zeros(len(segment.t))
    most = ZONE if isinstance(segment, FeedSegment) else _BLEND
    radii[1:-1] = np.clip(_SHARE * np.minimum(ways[:-1], ways[1:]), _LEAST, most)
    return radii


def _target(segment: Segment, k: int) -> str:
    if not isinstance(segment, PoseSegment):
        return f"[{', '.join(f'{value:.9f}' for value in segment.q[k].tolist())}]"
    numbers = urscript_numbers(segment.places[k], segment.turns[k])
    return f"pose_trans(feature, p[{', '.join(f'{value:.9f}' for value in numbers)}])"


def _pose(pose: SE3) -> str:
    values = np.array(pin_values(pose))
    numbers = urscript_numbers(values[:3], values[3:])
    return f"p[{', '.join(f'{value:.9f}' for value in numbers)}]"


class UrscriptReader(StopReader):
    """Reads a program of linear motions: what `write_urscript` writes, spaces and numbers aside."""

    comment, last = "#", "end"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        # Of timed motions since the last stop [m].
        self._blends: list[float] = []

    def begin(self, _: Sequence[str]) -> None:
        """Begin the program."""
        self.name, self.state, self.present = "selfmotion", "head", list(AXES[:_JOINTS])

    def tool_is(self, given: Sequence[str]) -> None:
        """Take the tool in the flange."""
        self.tool = self._frame(given[0])

    def work_is(self, given: Sequence[str]) -> None:
        """Take the feature."""
        self.work = self._frame(given[0])

    def loaded(self, given: Sequence[str]) -> None:
        """Take what the flange carries."""
        center = given[1].split(",")
        if len(center) != 3:
            raise self.lines.fault(f"set_payload has {len(center)} numbers, expected 3")
        self.load_is(given[0], center, 1.0)

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by joints."""
        self._check_stopped()
        self._check_slow(given[1:], (_JOINT_ACCELERATION, _FASTEST_JOINT), "rad/s")
        self.begin_at(self._joints(given[0]))
        self.state = "body"

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        self._check_stopped()
        self._check_slow(given[1:], (_ACCELERATION, _FASTEST), "m/s")
        self.slowly(self._pose(given[0]))

    def _check_slow(self, given: Sequence[str], most: tuple[float, float], unit: str) -> None:
        """Refuse a motion to where the program goes on that is faster than slow ones are."""
        push, speed = (self.lines.number_of(text) for text in given)
        if not (0.0 < push <= _UP * most[0] and 0.0 < speed <= _UP * most[1]):
            raise self.lines.fault(
                f"a motion to where the program goes on has a={push:g}, v={speed:g}, expected at "
                f"most {most[0]:g} {unit}² and {most[1]:g} {unit}: nothing has judged it"
            )

    def move(self, given: Sequence[str]) -> None:
        """Take a joint target."""
        if self.poses:
            raise self.lines.fault("a joint target after a pose with a blend, expected r=0")
        axes, taken = self._joints(given[0]), self.lines.duration(given[1])
        radius = self.lines.number_of(given[2])
        self._blends.append(radius)
        if radius == 0.0:
            self._check_blends(self._places([self.at, *self.axes, axes]))
        self.take_axes(axes, taken, stops=radius == 0.0)

    def move_linear(self, given: Sequence[str]) -> None:
        """Take a pose."""
        if self.axes or self.speeds:
            raise self.lines.fault("a pose after another kind with a blend, expected r=0")
        pose, taken = self._pose(given[0]), self.lines.duration(given[1])
        radius = self.lines.number_of(given[2])
        self._blends.append(radius)
        if radius == 0.0:
            before = [] if self.pose_at is None else [self.pose_at]
            self._check_blends(np.array([item.place for item in (*before, *self.poses, pose)]))
        self.take_pose(pose, taken, stops=radius == 0.0)

    def _places(self, targets: Sequence[list[float] | None]) -> Array | None:
        """Return positions of the tool at joint targets [deg], (K, 3); None if no arm is known."""
        joints = self.lines.joints()
        named = [joints[axis][0] for axis in self.present if axis in joints]
        if self.robot is None or None in targets or sorted(named) != sorted(self.robot.joint_names):
            return None
        order = [named.index(name) for name in self.robot.joint_names]
        return self.robot.chain.along(np.radians(np.array(targets)[:, order]))[2]

    def _check_blends(self, places: Array | None) -> None:
        """Refuse blends that reach past the middle of a way: there a controller leaves targets out.

        Where no arm is known, those that are larger than any that is written.
        """
        radii = np.array(self._blends[:-1])
        self._blends = []
        most = np.full(len(radii), _BLEND)
        if places is not None and len(places) == len(radii) + 2:
            ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
            most = np.maximum(0.5 * np.minimum(ways[:-1], ways[1:]), _LEAST)
        far = radii > most
        if far.any() or (radii < 0.0).any():
            k = int(np.argmax(far))
            raise self.lines.fault(
                f"a blend before this stop has r={radii[k]:g} m, expected at most {most[k]:.4g} m, "
                f"half of the way to the next target: blends that overlap leave targets out"
            )

    def move_at_speed(self, given: Sequence[str]) -> None:
        """Take a pose at a speed, straight or round."""
        *poses, ramp, speed, radius = given
        if self.axes or self.times:
            raise self.lines.fault("a motion at a speed after one with a blend, expected r=0")
        pose, via = self._pose(poses[-1]), self._pose(poses[0]) if poses[1:] else None
        fast, blend = self.lines.number_of(speed), self.lines.number_of(radius)
        if not fast > 0.0:
            raise self.lines.fault(f"v is {fast:g} m/s, expected a number above 0")
        if not 0.0 <= blend <= ZONE:
            raise self.lines.fault(
                f"r is {radius} m, expected 0 to {ZONE:g}: corners of seams at speeds are judged "
                f"as rounded by that at most"
            )
        before = [] if self.pose_at is None else [self.pose_at]
        self._blends.append(blend)
        if blend == 0.0:
            self._check_blends(np.array([item.place for item in (*before, *self.poses, pose)]))
        acceleration = self.lines.number_of(ramp)
        self.take_pose_at_speed(pose, via, fast, stops=blend == 0.0, acceleration=acceleration)

    def stream(self, _: Sequence[str]) -> None:
        """Refuse a stream."""
        raise self.lines.fault(
            "a stream of servoj is not read; only programs of linear motions are, which "
            "export --targets poses writes"
        )

    def wait(self, given: Sequence[str]) -> None:
        """Take a rest."""
        self._check_stopped()
        super().wait(given)

    def leave(self, _: Sequence[str]) -> None:
        """End the program."""
        self._check_stopped()
        self.state = "after"

    def _check_stopped(self) -> None:
        if self.is_moving:
            raise self.lines.fault("the arm does not stop before this: the last r is not 0")

    def _joints(self, text: str) -> list[float]:
        return [float(np.degrees(value)) for value in self._six(text)]

    def _pose(self, text: str) -> Pose:
        place, turn = urscript_pose(np.array(self._six(text)))
        return Pose(place, turn, [], self.lines.number)

    def _six(self, text: str) -> list[float]:
        values = [self.lines.coordinate(item) for item in text.split(",")]
        if len(values) != _JOINTS:
            raise self.lines.fault(f"has {len(values)} numbers, expected {_JOINTS}")
        return values

    def _frame(self, text: str) -> SE3:
        place, turn = urscript_pose(np.array(self._six(text)))
        return pose_of_values([*place.tolist(), *turn.tolist()])


_LIST = r"\[([^\[\]]*)\]"
_TARGET = rf"pose_trans\(feature, ?p{_LIST}\)"
_SPEED = r"a=([\d.e-]+), ?v=([\d.e-]+)"
_RAMPED = r"a=([\d.e-]+)"
_PACED = r"v=([\d.e-]+), ?r=([\d.e-]+)"
_TIMED = r"t=([\d.e-]+), ?r=([\d.e-]+)"
UrscriptReader.grammar = (
    (("before",), r"def selfmotion\(\):", UrscriptReader.begin),
    (("head",), rf"set_tcp\(p{_LIST}\)", UrscriptReader.tool_is),
    (("head",), rf"set_payload\(([\d.e-]+), ?{_LIST}\)", UrscriptReader.loaded),
    (("head",), rf"feature = p{_LIST}", UrscriptReader.work_is),
    (("head", "body"), rf"movej\({_LIST}, ?{_SPEED}\)", UrscriptReader.go),
    (("body",), rf"movej\({_LIST}, ?{_TIMED}\)", UrscriptReader.move),
    (("body",), rf"movel\({_TARGET}, ?{_SPEED}\)", UrscriptReader.go_linear),
    (("body",), rf"movel\({_TARGET}, ?{_TIMED}\)", UrscriptReader.move_linear),
    (
        ("body",),
        rf"movel\({_TARGET}, ?{_RAMPED}, ?{_PACED}\)",
        UrscriptReader.move_at_speed,
    ),
    (
        ("body",),
        rf"movec\({_TARGET}, ?{_TARGET}, ?{_RAMPED}, ?{_PACED}, ?mode=0\)",
        UrscriptReader.move_at_speed,
    ),
    (("head", "body"), r"servoj\(.*\)", UrscriptReader.stream),
    (("body",), r"sleep\(([\d.e-]+)\)", UrscriptReader.wait),
    (
        ("body",),
        r"set_standard_digital_out\(([0-7]), ?(True|False)\)",
        UrscriptReader.switch,
    ),
    (("body",), r"# event: (.*)", UrscriptReader.switch),
    (("body",), r"end", UrscriptReader.leave),
)
