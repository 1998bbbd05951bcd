"""`plan_job`: seams become one program, in the best order and directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

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
    obeying,
    shown,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.robot import RobotModel
from selfmotion.planning.planner import Deadline
from selfmotion.planning.result import arm_digest
from selfmotion.problem.constraints import (
    NO_OVERLAP,
    Clearance,
    Constraint,
    as_clearances,
)
from selfmotion.problem.problem import KEPT
from selfmotion.work.job.checks import (
    check_ends,
    check_names,
    check_seams,
    checked_constraints,
)
from selfmotion.work.job.earlier_program import EarlierProgram, check_earlier
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.program_builder import build_program
from selfmotion.work.job.result_cache import ResultCache
from selfmotion.work.job.seam import Seam
from selfmotion.work.job.specification import Specification
from selfmotion.work.job.work import JobSettings, Work


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
        the slowest one is named: where all ask for one feed, what is possible there is for all.
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
    check_names(listed, clearances)
    settings = JobSettings(
        robot,
        checked_constraints(constraints),
        clearances,
        as_whole(branches, "branches", 1, 1000),
        as_number(move_seconds, "move_seconds", above=0.0),
        as_whole(rng, "rng", 0, 2**63),
    )
    check_executor(executor)
    clock = Deadline.after(deadline)
    reported = clock.checked_by(obeying(progress))
    check_seams(settings, listed, sent=folder is not None or executor is not None)
    is_free = as_choice(order, "order", ("free", "given")) == "free"
    ends = tuple(None if q is None else robot.configuration(q) for q in (start, end))
    weight = as_number(seconds_per_cost, "seconds_per_cost", least=0.0)
    check_ends(settings, ends)
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
        planner = _JobPlanner(specification, settings, cache, executor, reported, ends, weight)
        try:
            return planner.program(warm_start)
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


@dataclass(frozen=True, eq=False)
class _JobPlanner:
    """Plans a job: first with the unchanged motions of an earlier program, if there is one.

    Attributes
    ----------
    specification : Specification
    settings : JobSettings
    cache : ResultCache
    executor : Executor or None
    progress : Progress
    ends : (start, end)
        Configurations (n,) in which the program begins and ends; None where any will do.
    seconds_per_cost : float
        What a unit of a seam's cost counts [s].
    """

    specification: Specification
    settings: JobSettings
    cache: ResultCache
    executor: Executor | None
    progress: Progress
    ends: tuple[Array | None, ...]
    seconds_per_cost: float

    def program(self, warm_start: Program | None) -> Program:
        """Return the program of the job."""
        if warm_start is None:
            return self._anew()
        check_earlier(warm_start, self.settings.robot)
        earlier = EarlierProgram(warm_start)
        kept, changed, reason = self._as_before(earlier)
        program = kept or self._anew()
        return replace(program, kept=earlier.kept_seams(program, changed, reason))

    def _work(self, earlier: EarlierProgram | None = None) -> Work:
        """Return what plans seams and moves, the unchanged ones as before."""
        return Work(self.settings, self.cache, self.executor, self.progress, earlier)

    def _ordering(self, seams: Sequence[Seam], work: Work, *, is_free: bool) -> Ordering:
        return Ordering(seams, work, self.ends, self.seconds_per_cost, is_free)

    @property
    def _is_free(self) -> bool:
        return not self.specification.in_order

    def _anew(self) -> Program:
        """Return the program of a job without an earlier one.

        Raises
        ------
        PlanError
            No seam has a motion.
        """
        work = self._work()
        ordering = self._ordering(self.specification.seams, work, is_free=self._is_free)
        if not ordering.states:
            reasons = "".join(f"\n  '{seam}': {why}" for seam, why in ordering.missing.items())
            raise PlanError(f"{self.settings.robot.name}: no seam has a motion:{reasons}")
        program = build_program(ordering, work, self.ends)
        return replace(program, specification=self.specification)

    def _as_before(self, earlier: EarlierProgram) -> tuple[Program | None, dict[str, str], str]:
        """Return a verified program with the unchanged motions of an earlier one; None for none.

        Also the seams that have changed, each with the reason, and why the first attempt failed, if
        it did.
        """
        seams, work = self.specification.seams, self._work(earlier)
        order = earlier.order_of(seams) if self._is_free else None
        ordering = self._ordering(order or seams, work, is_free=self._is_free and not order)
        reason = ""
        for program in self._programs_as_before(ordering, work):
            if program.verified:
                whole = replace(program, specification=self.specification)
                return whole, ordering.changed, reason
            reason = reason or program.summary
        return None, ordering.changed, reason

    def _programs_as_before(self, ordering: Ordering, work: Work) -> Iterator[Program]:
        """Yield programs with the unchanged motions of an earlier one.

        First in its order, where it has the same seams; then in any order; then with the unchanged
        motions reversed as well. Where nothing is unchanged, only the first. Each further program
        frees the ordering in place.
        """
        if not ordering.states:
            return
        yield build_program(ordering, work, self.ends)
        if ordering.has_unchanged and self._is_free and not ordering.is_free:
            ordering.free(order=True, directions=False)
            yield build_program(ordering, work, self.ends)
        if ordering.has_unchanged:
            ordering.free(order=self._is_free, directions=True)
            yield build_program(ordering, work, self.ends)
