"""Drafts of programs: the targets of a motion, and all that a writer states besides."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Flags, ProblemError, Progress, nearest, silent
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.problem.constraints import Constraint
from selfmotion.shop.controllers.controller_arms import check_controller
from selfmotion.shop.controllers.controller_axes import axes_of, in_order, tool_from_flange
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.deviations import Deviations
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.feed_thinning import paced_section
from selfmotion.shop.controllers.operations import Operation, operations_of
from selfmotion.shop.controllers.pose_numbers import ROUNDINGS
from selfmotion.shop.controllers.program_facts import Load, ProgramFacts, check_load
from selfmotion.shop.controllers.program_settings import OF_PATH, ProgramSettings, Signal
from selfmotion.shop.controllers.program_texts import plain
from selfmotion.shop.controllers.targets import (
    NotByPosesError,
    PosedSections,
    PoseSection,
    segments_of,
)
from selfmotion.shop.controllers.thinning import Section
from selfmotion.shop.controllers.tool_frames import ToolFrames
from selfmotion.shop.controllers.work_objects import frame_of_paths
from selfmotion.work.job import Program, are_opposite


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
    event_seams = {event: item.name for item in operations for _, event in item.events}
    check_signals(event_seams, settings)
    slides = np.array([axis.slides for axis in axes])
    arguments = operations, slides, settings.deviation, settings.move_deviation, progress
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
            section = PoseSection if settings.targets == "timed-poses" else paced_section
            posed: PosedSections = partial(section, frames=frames, rounding=ROUNDINGS[form])
            if otherwise is not None:
                posed = partial(_but_of_moves, posed, otherwise.why)
            segments, deviation = segments_of(*arguments, posed)
        except NotByPosesError as error:
            why = str(error)
    if frames is None or why:
        frames = None
        segments, deviation = segments_of(*arguments)
    order = in_order(axes)
    sorted_segments = tuple(item.in_order(order) for item in segments)
    ordered = tuple(axes[k] for k in order)
    stated = Deviations(deviation.path.stated, deviation.moves.stated)
    at_speeds = any(isinstance(item, FeedSegment) for item in sorted_segments)
    within = settings.deviation if at_speeds else None
    program = ControllerProgram(
        name, ordered, sorted_segments, stated, remark=plain(why), feed_tolerance=within
    )
    tool = tool_from_flange(robot, settings)
    facts = ProgramFacts.of(robot, settings, list(event_seams), by_poses=frames is not None)
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
