"""Programs of controllers, written segment by segment by the table of their language."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, ClassVar, NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError, write_text
from selfmotion.shop.controllers.controller_axes import written
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_heads import comments_before, head_comments
from selfmotion.shop.controllers.program_settings import Signal
from selfmotion.shop.controllers.program_texts import plain
from selfmotion.shop.controllers.segments import Segment
from selfmotion.shop.controllers.statements import Language


class WrittenPose(NamedTuple):
    """A tool pose for a file.

    Attributes
    ----------
    position, quaternion : (3,), (4,)
        Position [m], and quaternion x, y, z, w.
    axes : mapping
        Axis → its coordinate, as text.
    configuration : str
        Of the arm, in the language.
    """

    position: Array
    quaternion: Array
    axes: Mapping[str, str]
    configuration: str = ""


class ProgramWriter(ABC):
    """Writer of a language.

    Attributes
    ----------
    language : Language
    indent : str
        Spaces before each statement.
    """

    language: ClassVar[Language]

    def __init__(self, draft: Draft, name: str) -> None:
        self.draft, self.program, self.name = draft, draft.program, name
        self.indent = "  "

    def write(self, file: FilePath) -> None:
        """Write the program."""
        lines = self.opening()
        for segment, approached in with_approaches(self.program.segments):
            lines += self.before_step()
            notes = [f"step: {plain(segment.name)}", *comments_before(segment)]
            lines += [self.comment(note) for note in notes]
            if approached is not None:
                lines += self.approach(approached)
            lines += self.motion(segment)
        write_text(file, "\n".join([*lines, *self.closing(), ""]))

    @abstractmethod
    def opening(self) -> list[str]:
        """Return the lines up to where the motion begins."""

    @abstractmethod
    def closing(self) -> list[str]:
        """Return the lines after the motion."""

    def before_step(self) -> list[str]:
        """Return the lines before the comments of a step."""
        return []

    def approach(self, segment: Segment) -> list[str]:
        """Return the slow motion to where a segment begins, of another kind than the one before."""
        if isinstance(segment, PoseSegment):
            return self.linear_approach(segment)
        return self.joint_approach(segment)

    @abstractmethod
    def joint_approach(self, segment: Segment) -> list[str]:
        """Return the slow motion of joints to where a segment begins."""

    @abstractmethod
    def linear_approach(self, segment: PoseSegment) -> list[str]:
        """Return the slow motion along a line to where a segment of poses begins."""

    def motion(self, segment: Segment) -> list[str]:
        """Return the lines of a motion from rest to rest, or of a rest."""
        lines = self.events(segment, 0)
        for k, interval in enumerate(np.diff(segment.t), 1):
            if segment.is_rest:
                lines.append(self.line("wait", seconds=interval))
            else:
                lines.append(self.step(segment, k, **self.pace(segment, k)))
            lines += self.events(segment, k)
        return lines

    def pace(self, segment: Segment, k: int) -> dict[str, Any]:
        """Return the values of the statement of a step besides its target; none by default."""
        return {}

    def step(self, segment: Segment, k: int, linear: str = "linear", **values: Any) -> str:
        """Return the line of a step to a target: by joints, circular, or `linear`."""
        if not isinstance(segment, PoseSegment):
            return self.line("joint", axes=self.joint_target(segment, k), **values)
        pose = self.pose(segment, k)
        if not (isinstance(segment, FeedSegment) and segment.is_circular(k)):
            return self.line(linear, pose=pose, **values)
        return self.line("circular", via=self.pose(segment.middles, k - 1), pose=pose, **values)

    def joint_target(self, segment: Segment, k: int) -> Any:
        """Return a target of joints, as its field is written."""
        return self.axes(segment, k)

    def line(self, kind: str, **values: Any) -> str:
        """Return the line of a statement."""
        return f"{self.indent}{self.language.text(kind, **values)}"

    def comment(self, text: str) -> str:
        """Return the line of a comment."""
        return f"{self.indent}{self.language.comment} {text}"

    def head(self) -> list[str]:
        """Return the comments at the head."""
        return [self.comment(note) for note in head_comments(self.draft)]

    def events(self, segment: Segment, target: int) -> list[str]:
        """Return the lines of what happens at a target of a segment."""
        names = (item.name for item in segment.events if item.target == target)
        return [self.event(name) for name in names]

    def event(self, event: str) -> str:
        """Return the line that switches the output of an event, or names it."""
        return f"{self.indent}{event_text(self.language, event, self.draft.signal(event))}"

    def axes(self, segment: Segment, k: int) -> dict[str, str]:
        """Return the coordinates of the axes at a target, as texts."""
        values = written(segment.q[k], self.program.axes)
        return {axis.name: text for axis, text in zip(self.program.axes, values, strict=True)}

    def pose(self, segment: PoseSegment, k: int, configuration: str = "") -> WrittenPose:
        """Return the pose of a target."""
        axes = self.axes(segment, k)
        return WrittenPose(segment.positions[k], segment.quaternions[k], axes, configuration)

    def positioner(self, kind: type[int] | type[str], hint: str) -> Any:
        """Return the mechanical unit that carries the work object.

        Raises
        ------
        ProblemError
            Settings name none of that kind.
        """
        unit, frames = self.draft.settings.positioner, self.draft.frames
        if frames is None or not isinstance(unit, kind):
            name = "" if frames is None else frames.name
            raise ProblemError(
                f"{self.draft.robot.name}: an axis carries work object '{name}', and {hint}, in "
                f"the file of --settings (ProgramSettings(positioner=…))"
            )
        return unit


def event_text(language: Language, event: str, signal: Signal | None) -> str:
    """Return the statement that switches the output of an event, or the comment that names it.

    Raises
    ------
    ProblemError
        The controller has no such output.
    """
    if signal is None:
        return language.text("event", event=plain(event))
    output, value = signal
    if not language.has_output(output):
        raise ProblemError(f"signals: '{event}' switches {output!r}; {language.outputs}")
    return language.text("output", output=output, value=value)


def with_approaches(segments: Sequence[Segment]) -> Iterator[tuple[Segment, Segment | None]]:
    """Yield each segment, and the one to whose begin the arm goes slowly before it; else None.

    That is where targets of the other kind follow, poses after joints or joints after poses, rests
    in between included: where the work object was shifted, the arm is elsewhere by the other ones.
    A program begins by joints.
    """
    by_poses = False
    for k, segment in enumerate(segments):
        moving = next((item for item in segments[k:] if not item.is_rest), None)
        approached = None
        if moving is not None and by_poses != isinstance(moving, PoseSegment):
            by_poses, approached = not by_poses, moving
        yield segment, approached


def speeds_of(program: ControllerProgram) -> list[float]:
    """Return the speeds of its seams, each once [m/s]."""
    at_speeds = (item for item in program.segments if isinstance(item, FeedSegment))
    return sorted({float(speed) for item in at_speeds for speed in item.speeds})


def goes_round(program: ControllerProgram) -> bool:
    """Whether it has circular motions."""
    at_speeds = (item for item in program.segments if isinstance(item, FeedSegment))
    return any(bool(np.isfinite(item.vias).any()) for item in at_speeds)
