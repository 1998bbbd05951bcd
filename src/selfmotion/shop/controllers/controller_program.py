"""A joint motion as programs of robot controllers say it, whichever language they speak."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from selfmotion.basics import FileFormatError, Flags, ProblemError, Progress, nearest, silent
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.problem.constraints import Constraint
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.feed_thinning import paced_section
from selfmotion.shop.controllers.program_facts import Load, ProgramFacts, check_load, with_checksum
from selfmotion.shop.controllers.program_settings import (
    OF_PATH,
    Axis,
    ProgramSettings,
    Signal,
    axes_of,
    in_order,
    tool_from_flange,
)
from selfmotion.shop.controllers.program_texts import (
    BECAUSE,
    KEPT,
    PLANNED,
    as_word,
    folded,
    pin_values,
    plain,
    rounded_up,
    stated,
)
from selfmotion.shop.controllers.segments import (
    NO_MISS,
    Knots,
    Misses,
    Segment,
    by_interpolation,
    miss_of,
)
from selfmotion.shop.controllers.targets import (
    NotByPosesError,
    PosedSections,
    PoseSection,
    segments_of,
)
from selfmotion.shop.controllers.thinning import TIME_DIGITS, Operation, Section, operations_of
from selfmotion.shop.controllers.tool_frames import (
    ROUNDINGS,
    WORLD,
    ToolFrames,
    frame_of_paths,
    own_joint,
)
from selfmotion.work.job import Program, are_opposite


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
    miss : Misses
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
    miss: Misses
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
        """How many targets it has."""
        return sum(len(segment.t) - 1 for segment in self.segments if not segment.is_rest)

    @property
    def begins_elsewhere(self) -> str:
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

    def miss_of(self, plan: Plan | Parts | Move | Program) -> Misses:
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
        worst, at, k = Misses(NO_MISS, NO_MISS), 0.0, 0
        for number, segment in enumerate(self.segments):
            if segment.is_slow and self.shift is None:
                after = self.segments[min(number + 1, len(self.segments) - 1)].name
                raise FileFormatError(
                    f"the arm is not where '{after}' begins, by the poses before: it is singular "
                    f"there"
                )
            same = segment.in_order(order)
            operation = operations[min(k, len(operations) - 1)]
            found = miss_of(same, operation.motion, operation.chains, operation.motion.t[0] + at)
            both = Misses(NO_MISS, found) if operation.is_move else Misses(found, NO_MISS)
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


@dataclass(frozen=True, eq=False)
class Draft:
    """All that a writer needs: the program, the arm, what else is said; frames of tool poses."""

    program: ControllerProgram
    robot: RobotModel
    tool: SE3
    settings: ProgramSettings
    verdict: str
    facts: ProgramFacts
    frames: ToolFrames | None = None

    def signal(self, event: str) -> Signal | None:
        """Return the outputs that an event switches."""
        return self.settings.signal(event)


class Joints(NamedTuple):
    """Joint targets instead of poses: of free moves only, or of all; with the reason."""

    moves_only: bool
    why: str


def drafted(
    plan: Plan | Parts | Move | Program,
    name: str,
    form: str,
    settings: ProgramSettings,
    verdict: str,
    progress: Progress = silent,
    otherwise: Joints | None = None,
) -> Draft:
    """Return the program of a motion, named as its file is.

    With settings for poses, `otherwise` says which operations have joint targets all the same.

    Raises
    ------
    ProblemError
        The arm has axes that controllers have not, an event has no signal, or the motion does not
        rest where it should.
    PlanError
        A move was not found.
    """
    check_controller(plan.robot, form, settings)
    robot, operations = plan.robot, operations_of(plan)
    axes = axes_of(robot, settings)
    happens = {event: item.name for item in operations for _, event in item.events}
    check_signals(happens, settings)
    slides = np.array([axis.slides for axis in axes])
    given = operations, slides, settings.deviation, settings.move_deviation, progress
    frames, why = None, ""
    if settings.by_poses:
        of_path = settings.work_object == OF_PATH
        path_frame = frame_of_paths(_paths_of(plan)) if of_path else None
        frames = ToolFrames.of(robot, axes, settings, path_frame).rounded(ROUNDINGS[form])
        why = frames.undetermined()
        if otherwise is not None and not otherwise.moves_only:
            why = why or otherwise.why
    if frames is not None and not why:
        try:
            made = PoseSection if settings.targets == "timed-poses" else paced_section
            posed: PosedSections = partial(made, frames=frames, rounding=ROUNDINGS[form])
            if otherwise is not None:
                posed = partial(_but_of_moves, posed, otherwise.why)
            segments, miss = segments_of(*given, posed)
        except NotByPosesError as error:
            why = str(error)
    if frames is None or why:
        frames = None
        segments, miss = segments_of(*given)
    order = in_order(axes)
    sorted_ones = tuple(item.in_order(order) for item in segments)
    ordered = tuple(axes[k] for k in order)
    stated = Misses(miss.path.stated, miss.moves.stated)
    at_speeds = any(isinstance(item, FeedSegment) for item in sorted_ones)
    within = settings.deviation if at_speeds else None
    program = ControllerProgram(
        name, ordered, sorted_ones, stated, remark=plain(why), within=within
    )
    tool = tool_from_flange(robot, settings)
    facts = ProgramFacts.of(robot, settings, list(happens), by_poses=frames is not None)
    if settings.mass is not None:
        load = Load(settings.mass, np.array(settings.center))
        check_load(load, robot, constraints_of(plan), facts.flange)
    return Draft(program, robot, tool, settings, verdict, facts, frames)


def constraints_of(plan: Plan | Parts | Move | Program) -> list[Constraint]:
    """Return all that the parts of a motion had to keep."""
    match plan:
        case Plan():
            return list(plan.problem.constraints)
        case Move():
            return list(plan.constraints)
        case Program():
            return [item for step in plan.steps for item in constraints_of(step.made)]
    parts: list[Plan | Move] = [*plan.plans, *plan.moves]
    return [item for part in parts for item in constraints_of(part)]


def _paths_of(plan: Plan | Parts | Move | Program) -> list[Path]:
    """Return the paths that a motion follows; those of other tools than the first are beside it."""
    match plan:
        case Plan():
            return [plan.problem.path]
        case Move():
            return []
        case Program():
            return [step.made.problem.path for step in plan.steps if isinstance(step.made, Plan)]
    return [part.problem.path for part in plan.plans]


def _but_of_moves(
    posed: PosedSections, why: str, operation: Operation, slides: Flags, first: float, last: float
) -> Section:
    """Return the section of poses of a seam; NotByPosesError of a free move."""
    if operation.is_move:
        raise NotByPosesError(why)
    return posed(operation, slides, first, last)


def check_controller(robot: RobotModel, form: str, settings: ProgramSettings) -> None:
    """Refuse what a controller has no program for, or what its program has to say and does not.

    Raises
    ------
    ProblemError
        An arm of seven joints as KRL, or no mass for a controller of ABB.
    """
    if form == "rapid" and settings.mass is None:
        raise ProblemError(
            f"{robot.name}: a tooldata has the mass of what the flange carries, and a controller "
            f"of ABB moves by it; give export --mass KG, or mass in the file of --settings "
            f"(ProgramSettings(mass=…))"
        )
    joint = own_joint(robot, axes_of(robot, settings)) if form == "krl" else ""
    if joint:
        raise ProblemError(
            f"{robot.name}: joint '{joint}' is in the arm itself: KRL is for arms of six axes with "
            f"external ones, and KUKA's arms of seven (LBR iiwa) are programmed in Java (Sunrise); "
            f"write .yaml (ROS 2) or .csv for the driver of such an arm"
        )


def check_signals(seams: Mapping[str, str], settings: ProgramSettings) -> None:
    """Refuse events (event → seam) of which nothing says what they switch."""
    spare = [event for event in settings.signals or {} if event not in seams]
    for event, seam in seams.items():
        if not settings.knows(event):
            raise ProblemError(
                f"seam '{seam}': event '{event}' has no signal{nearest(event, spare)}; say in the "
                f"file of --settings what it switches, [signals] '{event}' = [output, true], or "
                f"false for a comment only (ProgramSettings(signals=…))"
            )
    for one, other in combinations(seams, 2):
        first = settings.signal(one)
        if first is not None and first == settings.signal(other) and are_opposite(one, other):
            raise ProblemError(
                f"signals: '{one}' and '{other}' both switch {first[0]!r} to {first[1]}; one of "
                f"them has to be {not first[1]}, or of another output"
            )


# Texts around the motion: the head of a program, and the comments before a segment.


def head(draft: Draft) -> list[str]:
    """Return the comments at the head of a program, without what marks them as such."""
    program = draft.program
    axes = ", ".join(
        f"{axis.name} = {as_word(axis.joint)} [{'mm' if axis.slides else 'deg'}]"
        for axis in program.axes
    )
    moves = program.miss.moves
    targets = "target" if program.targets == 1 else "targets"
    notes = [
        plain(f"selfmotion: {draft.robot.name}, {program.targets} {targets}"),
        plain(draft.verdict),
        plain(f"axes: {axes}"),
        *draft.facts.notes,
        *_of_speeds(program),
        f"deviation: {stated(program.miss.path)}",
        *([] if moves == NO_MISS else [f"deviation of moves: {stated(moves)}"]),
        f"(of the tool from the plan, straight {_lines(draft)}, rounded corners or a spline",
        "through the targets, at the times of the plan; of seams at speeds where the tool has gone",
        "as far)",
        *([f"{BECAUSE}{program.remark}"] if program.remark else []),
        *_of_poses(draft),
        "Angles are those of the URDF: compare zeros and signs with the controller's.",
    ]
    return [line for note in with_checksum(notes) for line in folded(note)]


def speeds_of(program: ControllerProgram) -> list[float]:
    """Return the speeds of its seams, each once [m/s]."""
    at_speeds = (item for item in program.segments if isinstance(item, FeedSegment))
    return sorted({float(speed) for item in at_speeds for speed in item.speeds})


def goes_round(program: ControllerProgram) -> bool:
    """Whether it has circular motions."""
    at_speeds = (item for item in program.segments if isinstance(item, FeedSegment))
    return any(bool(np.isfinite(item.vias).any()) for item in at_speeds)


def before(segment: Segment) -> list[str]:
    """Return the comments before a segment, without what marks them as such."""
    planned = isinstance(segment, FeedSegment)
    return [
        *([plain(segment.remark)] if segment.remark else []),
        *([f"{PLANNED}{segment.duration:.{TIME_DIGITS}f} s"] if planned else []),
    ]


def _of_speeds(program: ControllerProgram) -> list[str]:
    """Return the lines of the head about seams at speeds."""
    within = program.within
    if within is None:
        return []
    return [
        f"{KEPT}{rounded_up(1e3 * within.position, 6)} mm, {rounded_up(within.rotation, 9)} rad",
        "(seams are at their feeds, and keep that of what is prescribed; where the tool may turn,",
        "and the arm's self-motion, are off the plan by what follows. Run-up and run-down, and so",
        "when the tool is where, are the controller's)",
    ]


def _lines(draft: Draft) -> str:
    return "joint lines" if draft.frames is None else "lines of the tool"


def _of_poses(draft: Draft) -> list[str]:
    """Return the lines of the head about the frames of poses, from which the reader takes them."""
    frames = draft.frames
    if frames is None:
        return []
    place = ", ".join(f"{value:.9f}" for value in pin_values(frames.work))
    names = (frames.name, frames.carrier, draft.settings.flange or "-")
    work, carrier, flange = map(as_word, names)
    return [
        f"poses: work object {work} of {carrier}, flange {flange}",
        f"planned work object: {place}",
        "(m, and quaternion x, y, z, w, in that frame; shift the work object to shift the motion)",
        "Poses are reached in the arm's configuration at the begin, by axes.",
    ]
