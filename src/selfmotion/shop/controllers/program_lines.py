"""Programs of controllers, read line by line by the grammar of the subset that is written."""

import re
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any, ClassVar

import numpy as np

from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.commented_lines import Lines
from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.feed_segments import Ramps, times_at
from selfmotion.shop.controllers.program_facts import Load
from selfmotion.shop.controllers.program_texts import PLANNED
from selfmotion.shop.controllers.read_segments import (
    Pose,
    PoseRow,
    Row,
    SlowRow,
)

# Accelerations have so few digits that they may be off by this share.
_ROUNDED = 1e-2


def switched(at: float, given: Sequence[str]) -> Switch:
    """Return the output and its value, or the name of the event, at a time [s]."""
    if len(given) == 1:
        return Switch(at, given[0].strip())
    output, value = given
    return Switch(at, output, value.upper() in ("TRUE", "1"))


class ProgramReader:
    """Reads a program line by line; `state` says where it is.

    Attributes
    ----------
    grammar : tuple of (states, pattern, method)
        What is read: in which states, a pattern of the whole line, and the method that takes its
        groups. All else is refused.
    comment, last : str
        What a comment begins with, and what ends the file.
    """

    grammar: ClassVar[tuple[tuple[tuple[str, ...], str, Any], ...]] = ()
    comment, last = "", ""

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        self.lines = Lines(file, self.comment)
        self.robot = robot
        self.name, self.state = "", "before"
        self.present: list[str] = []
        self.rows: list[Row | PoseRow | SlowRow] = []
        # Where the arm is: by its axes, by a pose, or by both.
        self.at: list[float] | None = None
        self.pose_at: Pose | None = None
        self.tool: SE3 | None = None
        self.work: SE3 | None = None
        # Whether an axis carries the work object, where a program says it.
        self.is_carried: bool | None = None
        self.switches: list[Switch] = []
        # The load at the flange, and the mechanical unit of the work object, if it is stated.
        self.load: Load | None = None
        self.unit = ""

    def program(self) -> ControllerProgram:
        """Read all of it.

        Raises
        ------
        FileFormatError
            A line is none of those that are read, or something is missing.
        """
        for line in self.lines:
            text = " ".join(line.split())
            for states, pattern, method in self.grammar:
                found = re.fullmatch(pattern, text, re.IGNORECASE) if self.state in states else None
                if found:
                    method(self, found.groups())
                    break
            else:
                is_own = any(note.startswith("selfmotion: ") for note in self.lines.notes)
                other = (
                    "selfmotion did not write this program, and only the statements that it writes "
                    "are read; of another one judge the recorded motion, a table of t and a column "
                    "per joint (.csv, .npz, .json, .yaml of ROS, .mcap); "
                )
                raise self.lines.fault(
                    f"'{text[:60]}' is not read: {'' if is_own else other}page 'Files' of the docs "
                    f"lists what is (read_motion)"
                )
        if self.state != "after":
            raise self.lines.fault(f"is the last one, expected {self.last}")
        places = self.lines.places(self.tool, self.work)
        places.is_carried = self.is_carried
        facts = self.lines.facts()
        if facts is not None and self.unit and facts.positioner not in ("", self.unit):
            raise self.lines.fault(
                f"its work object is carried by mechanical unit '{self.unit}', it was written for "
                f"'{facts.positioner}'"
            )
        given = self.name, self.present, self.rows, self.switches, places, self.robot, self.load
        return self.lines.program(*given)

    @property
    def clock(self) -> float:
        """How long the motion takes up to here [s]."""
        return sum(sum(row.seconds) for row in self.rows)

    def switch(self, given: Sequence[str]) -> None:
        """Take what is switched now: an output and its value, or the name of an event."""
        self.switches.append(switched(self.clock, given))

    def load_is(self, mass: str, center: Sequence[str], metres: float) -> None:
        """Set the load at the flange: its mass [kg] and centre, in units of `metres` [m]."""
        at = [metres * self.lines.coordinate(text) for text in center]
        self.load = Load(self.lines.number_of(mass), np.array(at))

    def skip(self, _: Sequence[str]) -> None:
        """Take a line that says nothing of the motion."""

    def end(self, _: Sequence[str]) -> None:
        """End the module."""
        self.state = "after"

    def wait(self, given: Sequence[str]) -> None:
        """Take a rest."""
        seconds = self.lines.duration(given[0])
        self.rows.append(Row(self.lines.step(), [], [seconds]))

    def begin_at(self, axes: list[float]) -> None:
        """Take where the arm begins, or goes slowly before it goes on by axis targets."""
        self.rows.append(SlowRow(axes))
        self.at, self.pose_at = axes, None

    def slowly(self, pose: Pose) -> None:
        """Take a pose that the arm goes to slowly before it goes on by poses."""
        self.rows.append(SlowRow(pose))
        self.at, self.pose_at = None, pose

    def drive(
        self,
        poses: list[Pose],
        speeds: list[float],
        vias: list[Pose | None],
        happens: Sequence[tuple[int, Sequence[str]]] = (),
        *,
        is_spline: bool = False,
        acceleration: float = np.inf,
    ) -> None:
        """Take a segment of poses at speeds [m/s], and what is switched at which of them.

        With the `acceleration` [m/s²] that a program gives the tool has to come to its speed:
        ramps are the controller's, but the seam between them is judged at its feed.
        """
        planned = self.lines.planned()
        if self.pose_at is None:
            raise self.lines.fault("a pose after axis targets, expected a slow motion there first")
        if planned is None:
            raise self.lines.fault(
                f"a motion at a speed needs the comment '{PLANNED}… s' before it, which says how "
                f"long all up to the next stop was planned to take"
            )
        every = [self.pose_at, *poses]
        round_ones = np.array([[np.nan] * 3 if via is None else via.place for via in vias])
        own = times_at(np.array([pose.place for pose in every]), round_ones, speeds)
        if not (np.diff(own) > 0.0).all():
            k = int(np.argmin(np.diff(own)))
            raise self.lines.fault(
                f"target {k + 1} of a seam at its speed is where the one before is, expected a way "
                f"to go: at a speed a step of no length takes no time"
            )
        if not 0.0 < own[-1] < planned:
            raise self.lines.fault(
                f"at these speeds it takes {own[-1]:.6g} s without ramps, planned are "
                f"{planned:.6g} s; after a change of speeds plan anew, with the feed that is wanted"
            )
        # Half of the way to come to the slowest of its speeds, half to stop.
        least = min(speeds) ** 2 / float(np.diff(own) @ np.array(speeds))
        if not acceleration >= (1.0 - _ROUNDED) * least:
            raise self.lines.fault(
                f"its acceleration is {acceleration:g} m/s², expected {least:.4g} or more: with "
                f"less the tool never is at its speed"
            )
        at = Ramps(float(own[-1]), planned).times(own)
        for number, what in happens:
            self.switches.append(switched(self.clock + float(at[number]), what))
        row = PoseRow(self.lines.step(), every, [planned], speeds, round_ones, is_spline)
        self.rows.append(row)
        self.at, self.pose_at = None, poses[-1]

    def follow(self, poses: list[Pose], seconds: list[float]) -> None:
        """Take a segment of poses."""
        if self.pose_at is None:
            raise self.lines.fault("a pose after axis targets, expected a slow motion there first")
        self.rows.append(PoseRow(self.lines.step(), [self.pose_at, *poses], seconds))
        self.at, self.pose_at = None, poses[-1]

    def join(self, targets: list[list[float]], seconds: list[float]) -> None:
        """Take a segment of axis targets."""
        if self.at is None:
            raise self.lines.fault("axis targets after a pose, expected a slow motion there first")
        self.rows.append(Row(self.lines.step(), [self.at, *targets], seconds))
        self.at, self.pose_at = targets[-1], None

    def others_of(self, values: dict[str, float]) -> list[float]:
        """Return the external axes of a pose, which are those of the axis target before."""
        asked = [name for name in self.present if name.startswith("E")]
        if sorted(values) != sorted(asked):
            raise self.lines.fault(
                f"has external axes {', '.join(values) or 'none'}, expected "
                f"{', '.join(asked) or 'none'}"
            )
        return [values[name] for name in asked]

    def same_axes(self, present: list[str]) -> None:
        """Refuse a target with other axes than those before."""
        self.present = self.present or present
        if present != self.present:
            raise self.lines.fault(
                f"has axes {', '.join(present)}, expected {', '.join(self.present)}"
            )


class StopReader(ProgramReader):
    """Reads a program whose targets belong together up to the next one that the arm stops at.

    They are of one kind, which the first of them decides: axis targets or poses with times, or
    poses at speeds.
    """

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self.axes: list[list[float]] = []
        self.poses: list[Pose] = []
        self.times: list[float] = []
        # Of motions at speeds: how fast [m/s], through where, and what is switched at which.
        self.speeds: list[float] = []
        self.vias: list[Pose | None] = []
        self.happens: list[tuple[int, Sequence[str]]] = []
        # The least that the program gives of them [m/s²].
        self.acceleration = np.inf

    @property
    def is_moving(self) -> bool:
        """Whether the arm has not stopped at the target that was read last."""
        return bool(self.times or self.speeds)

    @property
    def clock(self) -> float:
        """See `ProgramReader.clock`: with the targets since the last stop."""
        return super().clock + sum(self.times)

    def take_axes(self, axes: list[float], seconds: float, *, stops: bool) -> None:
        """Take an axis target with its time [s]."""
        self.axes.append(axes)
        self.times.append(seconds)
        if stops:
            self.join(self.axes, self.times)
            self.axes, self.times = [], []

    def take_pose(self, pose: Pose, seconds: float, *, stops: bool) -> None:
        """Take a pose with its time [s]."""
        self.poses.append(pose)
        self.times.append(seconds)
        if stops:
            self.follow(self.poses, self.times)
            self.poses, self.times = [], []

    def take_pose_at_speed(
        self,
        pose: Pose,
        via: Pose | None,
        speed: float,
        *,
        stops: bool,
        acceleration: float = np.inf,
    ) -> None:
        """Take a pose at a speed [m/s], straight or round through another one."""
        self.acceleration = min(self.acceleration, acceleration)
        self.poses.append(pose)
        self.vias.append(via)
        self.speeds.append(speed)
        if stops:
            given = self.poses, self.speeds, self.vias, self.happens
            self.drive(*given, acceleration=self.acceleration)
            self.poses, self.speeds, self.vias, self.happens = [], [], [], []
            self.acceleration = np.inf

    def switch(self, given: Sequence[str]) -> None:
        """See `ProgramReader.switch`: between motions at speeds when these are known."""
        if self.speeds:
            self.happens.append((len(self.speeds), given))
        else:
            super().switch(given)
