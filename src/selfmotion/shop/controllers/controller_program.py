"""A joint motion as a program of a controller has it, whichever its language."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.task import SE3
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.program_facts import Load, ProgramFacts
from selfmotion.shop.controllers.program_settings import Axis
from selfmotion.shop.controllers.segments import (
    NO_DEVIATION,
    Deviations,
    Knots,
    Segment,
    by_interpolation,
    deviation_of,
)
from selfmotion.shop.controllers.thinning import operations_of
from selfmotion.shop.controllers.tool_frames import WORLD
from selfmotion.work.job import Program


class Switch(NamedTuple):
    """An output or event that a program switches.

    Attributes
    ----------
    at : float
        From the begin of its motion [s].
    output : str
        What is switched; of an event that is a comment only its name.
    value : bool or None
        To what; None for a comment.
    """

    at: float
    output: str
    value: bool | None = None


@dataclass(frozen=True, eq=False)
class ControllerProgram:
    """A motion by a controller's program file.

    Attributes
    ----------
    name : str
        Of the module.
    axes : tuple of Axis
        In the order of the file: A1 … A6, E1 … E6.
    segments : tuple of Segment
        From rest to rest, coordinates in the order of the axes.
    deviation : Deviations
        How far targets are off the motion, as the file states it.
    switches : tuple of Switch
        What is switched when, in order.
    shift : SE3 or None
        By how much the work object is elsewhere than it was planned, in the frame of its carrier;
        None where it is not.
    carrier : str
        The link that the work object is fixed to, or ``"world"``.
    remark : str
        Reason why targets are joints in place of poses.
    within : Tolerance or None
        Within what seams at speeds keep what is prescribed, by their certificates; None where none
        is at a speed.
    timed : tuple of str
        Why seams with a feed have times all the same, each reason once.
    approach : float
        How far joints go slowly from the axis target at its begin to its first pose [rad or m].
    facts : ProgramFacts or None
        What its head states that it rests on; None where it states nothing.
    load : Load or None
        What it says that the flange carries; None where it leaves that to the controller.
    """

    name: str
    axes: tuple[Axis, ...]
    segments: tuple[Segment, ...]
    deviation: Deviations
    switches: tuple[Switch, ...] = ()
    shift: SE3 | None = None
    carrier: str = WORLD
    remark: str = ""
    within: Tolerance | None = None
    timed: tuple[str, ...] = ()
    approach: float = 0.0
    facts: ProgramFacts | None = None
    load: Load | None = None

    @property
    def targets(self) -> int:
        """Number of targets."""
        return sum(len(segment.t) - 1 for segment in self.segments if not segment.is_rest)

    @property
    def start_fault(self) -> str:
        """Reason why the axis target at its begin does not fit its first pose; empty for none.

        Of a shifted work object the motion to the shifted begin is to be expected.
        """
        if self.shift is not None or self.approach <= _TAUGHT:
            return ""
        return (
            f"its first axis target is {self.approach:.3g} rad or m from where its first pose has "
            f"the arm, and nothing has judged the way between: begin it where that pose is"
        )

    @property
    def trajectory(self) -> Trajectory:
        """The motion as the cubic spline through the targets of each segment, at rest in between.

        Raises
        ------
        FileFormatError
            There is none.
        """
        return self._motion([next(own) for own in self._joined(None)])

    def motions(self, path: Path | None = None) -> list[Trajectory]:
        """Return the motions of a controller, one for each interpolation between targets.

        The cubic spline comes first. With a path, seams at speeds are at its pace: ramps are those
        of the plan.

        Raises
        ------
        FileFormatError
            There is none, or a speed is another one than the path has.
        """
        return [self._motion(parts) for parts in by_interpolation(self._joined(path))]

    def _joined(self, path: Path | None) -> Iterator[Iterator[Knots]]:
        """Yield the motions of each segment, one for each interpolation."""
        begin = 0.0
        for segment in self.segments:
            if path is not None and isinstance(segment, FeedSegment):
                yield segment.along(path, begin)
            elif segment.is_rest:
                yield iter([Knots(segment.t, segment.q, 0.0 * segment.q)])
            else:
                yield segment.motions()
            begin += segment.duration

    def _motion(self, parts: Sequence[Knots]) -> Trajectory:
        t, q, qd = [np.zeros(1)], [parts[0].q[:1]], [0.0 * parts[0].q[:1]]
        for times, places, rates in parts:
            t.append(t[-1][-1] + times[1:])
            q.append(places[1:])
            qd.append(rates[1:])
        names = tuple(axis.joint for axis in self.axes)
        return Trajectory(np.concatenate(t), np.concatenate(q), np.concatenate(qd), names)

    def deviation_of(self, plan: Plan | Parts | Move | Program) -> Deviations:
        """Return how far it is off the motion of a plan, parts, a move or a program.

        Raises
        ------
        FileFormatError
            It has other joints, or other segments.
        """
        operations = operations_of(plan)
        names = [axis.joint for axis in self.axes]
        known = plan.robot.joint_names
        if sorted(names) != sorted(known):
            raise FileFormatError(f"has joints {', '.join(names)}, expected {', '.join(known)}")
        order = [names.index(name) for name in known]
        worst, at, k = Deviations(NO_DEVIATION, NO_DEVIATION), 0.0, 0
        for number, segment in enumerate(self.segments):
            if segment.is_slow and self.shift is None:
                after = self.segments[min(number + 1, len(self.segments) - 1)].name
                raise FileFormatError(
                    f"the arm is not where '{after}' begins, by the poses before: it is singular "
                    f"there"
                )
            same = segment.in_order(order)
            operation = operations[min(k, len(operations) - 1)]
            found = deviation_of(
                same, operation.motion, operation.chains, operation.motion.t[0] + at
            )
            both = (
                Deviations(NO_DEVIATION, found)
                if operation.is_move
                else Deviations(found, NO_DEVIATION)
            )
            worst = worst.worse(both)
            at += segment.duration
            if at >= operation.motion.duration - _MOMENT:
                at, k = 0.0, k + 1
        if k > len(operations):
            raise FileFormatError("goes on when the motion has ended")
        if k < len(operations):
            raise FileFormatError(
                f"ends {len(operations) - k} seams or moves before the motion does"
            )
        return worst


# Largest distance of a first pose that was taught anew from the axis target before [rad or m].
_TAUGHT = 0.02
# Rest of an operation that counts as none [s].
_MOMENT = 1e-4
