"""A program of a controller as segments of joint motion, whichever its language."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_axes import Axis
from selfmotion.shop.controllers.deviations import Deviations
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.program_facts import Load, ProgramFacts
from selfmotion.shop.controllers.segments import Knots, Segment, by_interpolation
from selfmotion.shop.controllers.work_objects import WORLD

# Largest distance of a first pose that was taught anew from the axis target before [rad or m].
_MAX_START_GAP = 0.02


class Switch(NamedTuple):
    """An output or event that a program switches.

    Attributes
    ----------
    time : float
        Since the start of the motion [s].
    output : str
        Name of the output; of an event that is only a comment, its name.
    value : bool or None
        The new value; None for a comment.
    """

    time: float
    output: str
    value: bool | None = None


@dataclass(frozen=True, eq=False)
class ControllerProgram:
    """The motion of a program file.

    Attributes
    ----------
    name : str
        Of the module.
    axes : tuple of Axis
        In the order of the file: A1 … A6, E1 … E6.
    segments : tuple of Segment
        From rest to rest, coordinates in the order of the axes.
    deviation : Deviations
        Deviation of the targets from the motion, as the file states it.
    switches : tuple of Switch
        Outputs that are switched, in order of time.
    shift : SE3 or None
        Displacement of the work object from the plan, in the frame of its carrier; None for none.
    carrier : str
        The link that the work object is fixed to, or ``"world"``.
    remark : str
        Why targets are joints in place of poses.
    feed_tolerance : Tolerance or None
        Path tolerance that is certified for seams with a programmed feed; None if there are none.
    timed_reasons : tuple of str
        Why seams with a feed are programmed with times, each reason once.
    start_gap : float
        Joint distance of the slow move from the initial axis target to the first pose [rad or m].
    facts : ProgramFacts or None
        Preconditions that the header states, such as held joints and the flange; None for none.
    load : Load or None
        The load at the flange; None where the program leaves it to the controller.
    """

    name: str
    axes: tuple[Axis, ...]
    segments: tuple[Segment, ...]
    deviation: Deviations
    switches: tuple[Switch, ...] = ()
    shift: SE3 | None = None
    carrier: str = WORLD
    remark: str = ""
    feed_tolerance: Tolerance | None = None
    timed_reasons: tuple[str, ...] = ()
    start_gap: float = 0.0
    facts: ProgramFacts | None = None
    load: Load | None = None

    @property
    def targets(self) -> int:
        """Number of targets."""
        return sum(len(segment.t) - 1 for segment in self.segments if not segment.is_rest)

    @property
    def start_fault(self) -> str:
        """Why the first axis target does not fit the first pose; "" where it does.

        With a shifted work object, a move to the shifted start is expected.
        """
        if self.shift is not None or self.start_gap <= _MAX_START_GAP:
            return ""
        return (
            f"its first axis target is {self.start_gap:.3g} rad or m from where its first pose has "
            f"the arm, and nothing has judged the way between: begin it where that pose is"
        )

    @property
    def trajectory(self) -> Trajectory:
        """The motion as a cubic spline through the targets of each segment, at rest in between.

        Raises
        ------
        FileFormatError
            There is none.
        """
        return self._joined([next(motions) for motions in self._segment_motions(None)])

    def motions(self, path: Path | None = None) -> list[Trajectory]:
        """Return the motions of a controller, one for each interpolation between targets.

        The cubic spline comes first. With a path, seams with a programmed feed have its pace, with
        the ramps of the plan.

        Raises
        ------
        FileFormatError
            There is none, or a speed is not that of the path.
        """
        segments_by_interpolation = by_interpolation(self._segment_motions(path))
        return [self._joined(segments) for segments in segments_by_interpolation]

    def _segment_motions(self, path: Path | None) -> Iterator[Iterator[Knots]]:
        """Yield the motions of each segment, one for each interpolation."""
        elapsed = 0.0
        for segment in self.segments:
            if path is not None and isinstance(segment, FeedSegment):
                yield segment.along(path, elapsed)
            elif segment.is_rest:
                yield iter([Knots(segment.t, segment.q, 0.0 * segment.q)])
            else:
                yield segment.motions()
            elapsed += segment.duration

    def _joined(self, segments: Sequence[Knots]) -> Trajectory:
        """Return the motions of all segments as one, one after the other."""
        t, q, qd = [np.zeros(1)], [segments[0].q[:1]], [0.0 * segments[0].q[:1]]
        for segment in segments:
            t.append(t[-1][-1] + segment.t[1:])
            q.append(segment.q[1:])
            qd.append(segment.qd[1:])
        names = tuple(axis.joint for axis in self.axes)
        return Trajectory(np.concatenate(t), np.concatenate(q), np.concatenate(qd), names)
