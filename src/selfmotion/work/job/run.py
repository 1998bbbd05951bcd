"""`plan_job`: seams become one program, in the best order and directions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    DeadlineError,
    PlanError,
    ProblemError,
    Progress,
    as_choice,
    as_number,
    as_path,
    as_several,
    as_whole,
    check_executor,
    held_interruption,
    nearest,
    obeying,
    shown,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import Obstacle
from selfmotion.model.robot import RobotModel
from selfmotion.planning.planner import Deadline
from selfmotion.planning.result import arm_digest
from selfmotion.planning.transfer import FreeMotions
from selfmotion.problem.constraints import (
    NO_OVERLAP,
    Clearance,
    Constraint,
    as_clearances,
    clearances_among,
)
from selfmotion.problem.problem import KEPT, check_all_times, check_feeds, envelope_without_arm
from selfmotion.work.job.earlier_program import EarlierProgram, check_earlier
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.program_builder import Builder
from selfmotion.work.job.result_cache import ResultCache
from selfmotion.work.job.seam import Seam
from selfmotion.work.job.specification import Specification
from selfmotion.work.job.work import JobSettings, Work, check_can_be_sent


def plan_job(
    robot: RobotModel,
    seams: Sequence[Seam],
    *,
    start: npt.ArrayLike | None = None,
    end: npt.ArrayLike | None = None,
    order: str = "free",
    constraints: Sequence[Constraint] = KEPT,
    clearance: Clearance | Sequence[Clearance] | None = NO_OVERLAP,
    branches: int = 4,
    seconds_per_cost: float = 0.0,
    move_seconds: float = 10.0,
    deadline: float | None = None,
    folder: str | Path | None = None,
    executor: Executor | None = None,
    warm_start: Program | None = None,
    rng: int = 0,
    progress: Progress = silent,
) -> Program:
    """Plan a job: every seam once, in the best order and directions, with moves in between.

    For each seam several motions are planned that begin in different configurations, and each may
    be made either way. From the end of each to the start of each other the least time that the
    limits allow is known. The order, the directions and the motions that take the least are found
    exactly for up to twelve seams, and beyond that by insertion and exchange, with a bound told.
    Then the moves are planned. Where one takes longer than it should, or is not found, the order is
    looked for again: up to twelve seams the one that results is the best of all orders of the
    motions that are known, by the times of the moves themselves. Where seams leave
    something behind, motions that meet it come before it: the order is looked for again until
    every seam and move can be made past what stands there by then.

    Parameters
    ----------
    robot : RobotModel
    seams : sequence of Seam
    start, end : (n,), optional
        Configurations in which the program begins and ends [rad or m]; by default where the first
        seam begins, and the last one ends.
    order : {"free", "given"}
        Whether the order is looked for, within what seams say comes after others, or is that of the
        list. In either case `Seam.either_way` says whether directions are free.
    constraints : sequence of Constraint
        What all seams and moves must keep; see `Problem`.
    clearance : Clearance or sequence of Clearance, optional
        What keeps the arm apart from obstacles and itself; see `Problem.clearance`. What seams
        leave behind is kept clear of as the first one says.
    branches : int
        Motions in different configurations that are planned for each seam.
    seconds_per_cost : float
        What a unit of a seam's cost counts, beside the time of moves [s]; by default only time
        counts.
    move_seconds : float
        After so many seconds of the processor a move counts as not found. A move that takes nearly
        as long to find may be found on one machine, or on one day, and not on another.
    deadline : float, optional
        Time by the clock after which planning stops [s], as soon as the seam or move that is at
        work is finished. With a folder, planning again goes on from there.
    folder : path, optional
        Keeps every plan and move there as soon as it is finished; a job that is begun again takes
        what it finds, and ends in the same program.
    executor : Executor, optional
        Plans seams and moves at the same time; any of `concurrent.futures`, or a Dask client's. The
        program is the same.
    warm_start : Program, optional
        An earlier program of this job, or of one like it, as when a part was moved: seams and moves
        that did not change are kept bit for bit and in their directions, in its order where it
        made the same seams, in any other one else; other seams begin at its motions. Only where no
        verified program comes of that, what is kept is made the other way round, or all is
        replanned. `Program.kept` says what of it was kept, and why the rest was not.
    rng : int
        Seed of all random numbers.
    progress : callable, optional
        Told the stage, as in `plan`, and what it is about: ``("seam 'left'", 3, 12)``,
        ``("move 'left → right'", 1, 11)``.

    Returns
    -------
    Program
        Also where seams could not be made, or moves not be found: `Program.verdict` names them and
        says why, and `Program.require` raises.

    Raises
    ------
    FeedError
        A seam asks for a feed that its path cannot have; before anything is planned. Of several
        the slowest one is told: where all ask for one feed, what is possible there is for all.
    PlanError
        No seam has a motion; `DeadlineError` where the deadline came before there was a program.
    ProblemError
        An argument is not what it should be, or what has to come first is circular.
    KeyboardInterrupt
        It was interrupted; what is finished by then is in the folder, where there is one.
    """
    if not isinstance(robot, RobotModel):
        raise ProblemError(f"robot is {shown(robot)}, expected a RobotModel")
    listed = as_several(seams, "seams", Seam)
    clearances = as_clearances(clearance)
    _check_names(listed, clearances)
    settings = JobSettings(
        robot,
        _checked_constraints(constraints),
        clearances,
        as_whole(branches, "branches", 1, 1000),
        as_number(move_seconds, "move_seconds", above=0.0),
        as_whole(rng, "rng", 0, 2**63),
    )
    check_executor(executor)
    clock = Deadline.after(deadline)
    reported = clock.checked_by(obeying(progress))
    _check_seams(settings, listed, sent=folder is not None or executor is not None)
    is_free = as_choice(order, "order", ("free", "given")) == "free"
    ends = tuple(None if q is None else robot.configuration(q) for q in (start, end))
    weight = as_number(seconds_per_cost, "seconds_per_cost", least=0.0)
    _check_ends(settings, ends)
    # Processes and schedulers wait for Ctrl-C themselves.
    with nullcontext() if executor is not None else held_interruption():
        cache = ResultCache(None if folder is None else as_path(folder), Tolerance(), {})
        specification = Specification(
            listed,
            not is_free,
            start=ends[0],
            end=ends[1],
            constraints=settings.constraints,
            clearances=settings.clearances,
            arm=arm_digest(robot),
        )
        work_like = partial(Work, settings, cache, executor, reported)
        try:
            return _program(specification, work_like, ends, weight, warm_start)
        except KeyboardInterrupt:
            if not clock.passed:
                raise
            raise _deadline_passed(robot, deadline, folder) from None


def _deadline_passed(
    robot: RobotModel, deadline: float | None, folder: str | Path | None
) -> DeadlineError:
    hint = (
        "give a folder= to keep what is planned"
        if folder is None
        else f"what was planned by then is in '{folder}'"
    )
    return DeadlineError(
        f"{robot.name}: the deadline of {deadline} s came before there was a program; {hint}: "
        f"plan again, or allow more time"
    )


def _check_seams(settings: JobSettings, seams: Sequence[Seam], *, sent: bool) -> None:
    """Raise FeedError for the slowest seam whose path cannot have its feed.

    Where seams are `sent` to other processes, raise ProblemError for a cost that cannot be.
    """
    for seam in sorted(seams, key=_slowest):
        kept = envelope_without_arm(settings.robot, [*settings.constraints, *seam.constraints])
        check_feeds(f"seam '{seam.name}'", [seam.path], kept.tool_speed)
    for seam in seams if sent else ():
        check_can_be_sent(seam.costs or ())


def _check_ends(settings: JobSettings, ends: Sequence[Array | None]) -> None:
    """Raise ProblemError where no move may begin at the job's start, or end at its end."""
    moves = FreeMotions(settings.robot, settings.move_constraints(()), np.random.default_rng(0))
    for name, q in zip(("start", "end"), ends, strict=True):
        refused = "" if q is None else moves.refusal(q)
        if refused:
            raise ProblemError(f"{settings.robot.name}: the job's {name}: {refused}")


def _program(
    specification: Specification,
    work_like: Callable[..., Work],
    ends: tuple[Array | None, ...],
    weight: float,
    warm_start: Program | None,
) -> Program:
    """Return the program of a job: first with the unchanged motions of an earlier one, if any.

    `work_like` returns the `Work` that plans seams and moves, given the earlier program; `weight`
    is that of a seam's cost against time [s].
    """
    if warm_start is None:
        return _planned_anew(specification, work_like(), ends, weight)
    check_earlier(warm_start, work_like().settings.robot)
    earlier = EarlierProgram(warm_start)
    program, changed, reason = _as_before(specification, work_like(earlier), ends, weight, earlier)
    program = program or _planned_anew(specification, work_like(), ends, weight)
    return replace(program, kept=earlier.kept_seams(program, changed, reason))


def _planned_anew(
    specification: Specification, work: Work, ends: tuple[Array | None, ...], weight: float
) -> Program:
    """Return the program of a job without an earlier one.

    Raises
    ------
    PlanError
        No seam has a motion.
    """
    ordering = Ordering(specification.seams, work, ends, weight, not specification.in_order)
    if not ordering.states:
        name = work.settings.robot.name
        reasons = "".join(f"\n  '{seam}': {why}" for seam, why in ordering.missing.items())
        raise PlanError(f"{name}: no seam has a motion:{reasons}")
    return replace(Builder(ordering, work, ends).program(), specification=specification)


def _as_before(
    specification: Specification,
    work: Work,
    ends: tuple[Array | None, ...],
    weight: float,
    earlier: EarlierProgram,
) -> tuple[Program | None, dict[str, str], str]:
    """Return a verified program with the unchanged motions of an earlier one; None for none.

    Also the seams that have changed, each with the reason, and why the first attempt failed, if it
    did.
    """
    seams, is_free = specification.seams, not specification.in_order
    order = earlier.order_of(seams) if is_free else None
    ordering = Ordering(order or seams, work, ends, weight, is_free and not order)
    reason = ""
    for program in _programs_as_before(ordering, work, ends, is_free):
        if program.verified:
            whole = replace(program, specification=specification)
            return whole, ordering.changed, reason
        reason = reason or program.summary
    return None, ordering.changed, reason


def _programs_as_before(
    ordering: Ordering, work: Work, ends: tuple[Array | None, ...], is_free: bool
) -> Iterator[Program]:
    """Yield programs with the unchanged motions of an earlier one.

    First in its order, where it has the same seams; then in any order; then with the unchanged
    motions reversed as well. Where nothing is unchanged, only the first. Each further program frees
    the ordering in place.
    """
    if not ordering.states:
        return
    yield Builder(ordering, work, ends).program()
    if ordering.has_unchanged and is_free and not ordering.is_free:
        ordering.free(order=True, directions=False)
        yield Builder(ordering, work, ends).program()
    if ordering.has_unchanged:
        ordering.free(order=is_free, directions=True)
        yield Builder(ordering, work, ends).program()


def _slowest(seam: Seam) -> float:
    """Return the speed of a seam that does not keep its feed [m/s]; inf for one that does."""
    return min((found.slowest for found in seam.path.feeds if not found.kept), default=math.inf)


def _checked_constraints(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    listed = as_several(constraints, "constraints", Constraint)
    check_all_times(listed, "give it to a seam that has one direction (either_way=False)")
    if clearances_among(listed):
        raise ProblemError(
            "a Clearance is among the constraints of the job; give it as clearance=, so that "
            "what seams leave behind is kept clear of as well"
        )
    return listed


def _check_names(seams: Sequence[Seam], clearances: Sequence[Clearance]) -> None:
    """Raise ProblemError where names of seams or bodies are not unique, or lead nowhere."""
    _check_seam_names(seams)
    left = [item.name for seam in seams for item in seam.leaves]
    _check_bodies(left, clearances)
    _check_references(seams, left)


def _check_seam_names(seams: Sequence[Seam]) -> None:
    if not seams:
        raise ProblemError("there are no seams, expected one or more")
    names = [seam.name for seam in seams]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ProblemError(f"seam '{twice[0]}' is there twice; give each its own name")


def _check_bodies(left: Sequence[str], clearances: Sequence[Clearance]) -> None:
    """Check the names of bodies that seams leave, and of obstacles."""
    twice = sorted({name for name in left if left.count(name) > 1})
    if twice:
        raise ProblemError(f"'{twice[0]}' is left by two seams; give each body its own name")
    bodies: dict[str, Obstacle] = {}
    for item in (body for clearance in clearances for body in clearance.obstacles):
        if item.name in left:
            raise ProblemError(
                f"'{item.name}' is an obstacle of the clearance, and left by a seam; give each "
                f"body its own name"
            )
        if bodies.setdefault(item.name, item).to_dict() != item.to_dict():
            raise ProblemError(
                f"clearance: two different bodies are called '{item.name}'; give each its own name"
            )


def _check_references(seams: Sequence[Seam], left: Sequence[str]) -> None:
    """Check that seams meet bodies that are left, and come after seams of the job."""
    names = [seam.name for seam in seams]
    for seam in seams:
        for name in seam.may_meet:
            if name not in left:
                raise ProblemError(
                    f"seam '{seam.name}' may meet '{name}', which no seam leaves"
                    f"{nearest(name, left)}"
                )
        for name in (*seam.after, *seam.after_any):
            if name not in names or name == seam.name:
                raise ProblemError(
                    f"seam '{seam.name}' comes after '{name}', which is no other seam of the job"
                )
