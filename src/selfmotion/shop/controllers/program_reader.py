"""Programs of controllers, read line by line by the table of their language."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, ClassVar

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_axes import Axis
from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.feed_segments import nominal_target_times
from selfmotion.shop.controllers.program_comments import Comments
from selfmotion.shop.controllers.program_facts import Load
from selfmotion.shop.controllers.program_lines import Lines
from selfmotion.shop.controllers.program_texts import DURATION_HEADING
from selfmotion.shop.controllers.ramps import Ramps
from selfmotion.shop.controllers.segment_building import Pose, ProgramFrames, Row, SegmentBuilder
from selfmotion.shop.controllers.statements import Language
from selfmotion.shop.controllers.work_objects import WORLD

# Relative error of accelerations by their few digits.
_ROUNDED = 1e-2


@dataclass
class Target:
    """A target of a motion while it is read.

    Attributes
    ----------
    place : list of float or Pose
        Axes [deg or mm], or a tool pose.
    seconds : float
        Time from the target before [s]; 0 where it has a speed.
    speed : float
        Speed of the tool from the target before [m/s]; 0 where it has a time.
    via : Pose or None
        Point of a circular step to it.
    acceleration : float
        Of the tool [m/s²]; infinite where the program does not state it.
    """

    place: list[float] | Pose
    seconds: float = 0.0
    speed: float = 0.0
    via: Pose | None = None
    acceleration: float = np.inf

    def is_like(self, other: "Target") -> bool:
        """Whether both are axes or both poses, and both have times or both speeds."""
        same_kind = isinstance(self.place, Pose) == isinstance(other.place, Pose)
        return same_kind and (self.speed > 0.0) == (other.speed > 0.0)


class ProgramReader:
    """Reader of a language: a state machine over the kinds of its statements.

    Targets gather in `run` until the arm stops at one of them.

    Attributes
    ----------
    language : Language
    moving : str
        What says in the language that the arm does not stop at a target.
    metres : float
        Unit of lengths [m].
    """

    language: ClassVar[Language]
    moving: ClassVar[str] = ""
    metres: ClassVar[float] = 1e-3

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        self.lines = Lines(file, self.language.comment)
        self.comments = Comments(self.lines)
        self.robot = robot
        self.name, self.state = "", "before"
        # Axes of targets, by their names.
        self.axes: list[str] = []
        self.rows: list[Row] = []
        # Time of the motion up to the last stop [s].
        self.clock = 0.0
        # Target at which the arm stopped last; None before the first one.
        self.last_stop: list[float] | Pose | None = None
        # Targets since then, and what is switched at which of them.
        self.run: list[Target] = []
        self.run_switches: list[tuple[int, Switch]] = []
        self.switches: list[Switch] = []
        # What statements have set: of each value the last one, by its name.
        self.settings: dict[str, Any] = {}

    def actions(self) -> Mapping[str, Callable[..., None]]:
        """Return the action of each kind of statement: it takes the statement's values."""
        return {
            "begin": self.begin,
            "comment": self.no_action,
            "set": self.settings.update,
            "wait": self.wait,
            "output": self.switch_output,
            "event": self.pass_event,
            "end": self.no_action,
        }

    def program(self) -> ControllerProgram:
        """Read the whole program.

        Raises
        ------
        FileFormatError
            A line is none of those that are read, or something is missing.
        """
        actions = self.actions()
        for line in self.lines:
            text = " ".join(line.split())
            match = self.language.find(text, self.state)
            if match is None:
                raise self.lines.fault(self._unread(text))
            statement, texts = match
            self.check(statement.kind)
            values: dict[str, Any] = {
                name: self.language.fields[field].read(self, texts[name])
                for name, field in statement.values.items()
            }
            actions[statement.kind](**values)
            self.state = statement.then or self.state
        if self.state != "after":
            raise self.lines.fault(f"is the last one, expected {self.language.last}")
        program_frames = self.comments.program_frames(self.tool, self.work)
        program_frames.is_carried = self.is_carried
        facts, unit = self.comments.facts(), self.settings.get("unit", "")
        if facts is not None and unit and facts.positioner not in ("", unit):
            raise self.lines.fault(
                f"its work object is carried by mechanical unit '{unit}', it was written for "
                f"'{facts.positioner}'"
            )
        return self._program(program_frames)

    def _program(self, program_frames: ProgramFrames) -> ControllerProgram:
        """Return the program of the rows of targets, and of what is switched.

        Raises
        ------
        FileFormatError
            Something is missing, or the arm cannot follow.
        """
        stated_axes, present, file = self.comments.axes(), self.axes, self.lines.file
        # Robots of fewer axes have numbers in the places of those they lack.
        columns = [k for k, axis in enumerate(present) if axis in stated_axes or not stated_axes]
        axes = tuple(
            Axis(present[k], *stated_axes.get(present[k], (present[k], False))) for k in columns
        )
        if not axes:
            raise FileFormatError(f"{file}: has no axes of those that its comments name")
        self._check_unnamed(columns)
        frames = None
        if any(row.poses for row in self.rows):
            if self.robot is None:
                raise FileFormatError(
                    f"{file}: has tool poses, whose joint positions need the robot: give it "
                    f"(read_motion(file, robot=…), check --robot)"
                )
            frames = program_frames.frames(self.robot, axes, file)
        builder = SegmentBuilder(file, axes, frames)
        for row in self.rows:
            builder.add(row.with_axes(columns))
        if not builder.segments:
            raise FileFormatError(f"{file}: has no targets with times")
        return ControllerProgram(
            self.name,
            axes,
            tuple(builder.segments),
            self.comments.deviations(),
            tuple(self.switches),
            program_frames.shift,
            WORLD if frames is None else program_frames.carrier,
            next(iter(self.comments.texts_of("joint targets")), ""),
            self.comments.tolerance(),
            tuple(dict.fromkeys(self.comments.texts_of("times"))),
            builder.start_gap,
            self.comments.facts(),
            self.load,
        )

    def _check_unnamed(self, columns: Sequence[int]) -> None:
        """Refuse axes that move, and that no comment gives a joint: nothing judges them.

        Robots of fewer than six axes have 0 in the places of those they lack.
        """
        for k, axis in enumerate(self.axes):
            if k in columns:
                continue
            if axis.startswith("E") or any(q[k] for row in self.rows for q in row.axes):
                raise FileFormatError(
                    f"{self.lines.file}: axis {axis} has targets, and the comment 'axes: …' names "
                    f"no joint that it is: nothing has judged its motion"
                )

    @property
    def tool(self) -> SE3 | None:
        """Tool in the flange; None where it is not stated."""
        tool: SE3 | None = self.settings.get("tool")
        return tool

    @property
    def work(self) -> SE3 | None:
        """Work object, in the world or in what carries it; None where it is not stated."""
        work: SE3 | None = self.settings.get("work")
        return work

    @property
    def is_carried(self) -> bool | None:
        """Whether an axis carries the work object; None where the program does not say it."""
        return None

    @property
    def load(self) -> Load | None:
        """Load at the flange; None where it is not stated."""
        if "mass" not in self.settings:
            return None
        center = [self.metres * self.settings[name] for name in "xyz"]
        return Load(self.settings["mass"], np.array(center))

    def _unread(self, text: str) -> str:
        is_own = any(note.startswith("selfmotion: ") for note in self.lines.notes)
        other = (
            "selfmotion did not write this program, and only the statements that it writes "
            "are read; of another one judge the recorded motion, a table of t and a column "
            "per joint (.csv, .npz, .json, .yaml of ROS, .mcap); "
        )
        return (
            f"'{text[:60]}' is not read: {'' if is_own else other}page 'Files' of the docs "
            f"lists what is (read_motion)"
        )

    def check(self, kind: str) -> None:
        """Refuse a kind of statement where it may not stand, before its values are read."""

    def no_action(self, **_: object) -> None:
        """Go on: the statement changes the state alone."""

    def begin(self, name: str) -> None:
        """Begin a program of a name."""
        self.name = name

    def wait(self, seconds: float) -> None:
        """Take a rest [s]."""
        self.check_stopped("the arm is to rest")
        self.rows.append(Row(self.comments.last_step(), [], [seconds]))
        self.clock += seconds

    def switch_output(self, output: str, value: bool) -> None:
        """Take an output that is switched at the last target."""
        self.add_switch(Switch(0.0, output, value))

    def pass_event(self, event: str) -> None:
        """Take an event that is a comment at the last target."""
        self.add_switch(Switch(0.0, event.strip()))

    def add_switch(self, switch: Switch, ahead: int = 0) -> None:
        """Take an output or event at the last target, or at one that is `ahead`."""
        if self.run or ahead:
            self.run_switches.append((len(self.run) + ahead, switch))
        else:
            self.switches.append(switch._replace(time=self.clock))

    def approach(self, target: list[float] | Pose) -> None:
        """Take where the arm begins, or goes slowly before targets of the other kind."""
        self.check_stopped("a slow motion")
        self.rows.append(Row("", [target], [], is_slow=True))
        self.last_stop = target

    def take(self, target: Target, *, stops: bool) -> None:
        """Take a target, and end the motion where the arm `stops` there.

        Raises
        ------
        FileFormatError
            Targets before, at which it does not stop, are of another kind.
        """
        if self.run and not self.run[0].is_like(target):
            raise self.lines.fault(f"a target of another kind than the one before: {self.moving}")
        self.run.append(target)
        if stops:
            self.stop()

    def stop(self, *, is_spline: bool = False) -> None:
        """End a motion at its last target, at which the arm stops."""
        run, switches, self.run, self.run_switches = self.run, self.run_switches, [], []
        times = self._paced(run, is_spline=is_spline) if run[0].speed else self._timed(run)
        for number, switch in switches:
            self.switches.append(switch._replace(time=self.clock + times[number]))
        self.clock += sum(self.rows[-1].seconds)
        self.last_stop = run[-1].place

    def _timed(self, run: list[Target]) -> list[float]:
        """Add a motion at times; return when its targets are reached [s]."""
        seconds = [target.seconds for target in run]
        self.rows.append(Row(self.comments.last_step(), self._places_of(run), seconds))
        return [sum(seconds[:k]) for k in range(len(run) + 1)]

    def _places_of(self, run: list[Target]) -> list[list[float] | Pose]:
        """Return where a motion begins, and its targets.

        Raises
        ------
        FileFormatError
            It begins at a target of the other kind.
        """
        begins_by_pose, by_poses = isinstance(self.last_stop, Pose), isinstance(run[0].place, Pose)
        if self.last_stop is None or begins_by_pose != by_poses:
            kinds = ("a pose", "axis targets")
            kind, before = kinds if by_poses else kinds[::-1]
            raise self.lines.fault(f"{kind} after {before}, expected a slow motion there first")
        return [self.last_stop, *(target.place for target in run)]

    def _run_places(self) -> list[list[float] | Pose | None]:
        """Return where the motion that is read begins, and its targets so far."""
        return [self.last_stop, *(target.place for target in self.run)]

    def _paced(self, run: list[Target], *, is_spline: bool) -> list[float]:
        """Add a motion at speeds; return when its targets are reached, by even ramps [s].

        Ramps are the controller's, but the seam between them is judged at its feed.
        """
        planned = self.comments.take_planned_time()
        places = self._places_of(run)
        if planned is None:
            raise self.lines.fault(
                f"a motion at a speed needs the comment '{DURATION_HEADING}… s' before it, which "
                f"says how long all up to the next stop was planned to take"
            )
        speeds = [target.speed for target in run]
        vias = np.array([[np.nan] * 3 if x.via is None else x.via.position for x in run])
        feed_times = nominal_target_times(
            np.array([x.position for x in places if isinstance(x, Pose)]), vias, speeds
        )
        if not (np.diff(feed_times) > 0.0).all():
            k = int(np.argmin(np.diff(feed_times)))
            raise self.lines.fault(
                f"target {k + 1} of a seam at its speed is where the one before is, expected a way "
                f"to go: at a speed a step of no length takes no time"
            )
        if not 0.0 < feed_times[-1] < planned:
            raise self.lines.fault(
                f"at these speeds it takes {feed_times[-1]:.6g} s without ramps, planned are "
                f"{planned:.6g} s; after a change of speeds plan anew, with the feed that is wanted"
            )
        # Half of the length to come to the slowest of its speeds, half to stop.
        least = min(speeds) ** 2 / float(np.diff(feed_times) @ np.array(speeds))
        acceleration = min(target.acceleration for target in run)
        if not acceleration >= (1.0 - _ROUNDED) * least:
            raise self.lines.fault(
                f"its acceleration is {acceleration:g} m/s², expected {least:.4g} or more: with "
                f"less the tool never is at its speed"
            )
        self.rows.append(Row(self.comments.last_step(), places, [planned], speeds, vias, is_spline))
        times: list[float] = Ramps(float(feed_times[-1]), planned).times(feed_times).tolist()
        return times

    def check_stopped(self, what: str) -> None:
        """Refuse `what` where the arm does not stop."""
        if self.run:
            raise self.lines.fault(f"{what} where it does not stop: {self.moving}")

    def external_axes(self, values: Mapping[str, float]) -> list[float]:
        """Return the external axes of a pose, which are those of the axis target before."""
        expected = [name for name in self.axes if name.startswith("E")]
        if sorted(values) != sorted(expected):
            raise self.lines.fault(
                f"has external axes {', '.join(values) or 'none'}, expected "
                f"{', '.join(expected) or 'none'}"
            )
        return [values[name] for name in expected]

    def check_axes(self, names: list[str]) -> None:
        """Refuse a target with other axes than those before."""
        self.axes = self.axes or names
        if names != self.axes:
            raise self.lines.fault(f"has axes {', '.join(names)}, expected {', '.join(self.axes)}")
