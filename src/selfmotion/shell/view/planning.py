"""The planner of the page: what a document says is planned again whenever it is changed.

First coarsely: the motion before, put onto the new path by Newton's method; then in whole. The
whole plan is made anew, just as `selfmotion plan` does, so that the one that is shown in the end
is `plan()` of what is saved: of the ways that lead to it, nothing is left.
"""

import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from selfmotion.basics import Array, ProblemError, Progress, SelfmotionError
from selfmotion.model.follow import is_plain
from selfmotion.planning.optimise import Iteration
from selfmotion.planning.planner import PlanRequest, plan
from selfmotion.planning.result import Plan, retime
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents import SeamJob, plan_request_of, seam_job_of
from selfmotion.shell.replay import PlanReplay
from selfmotion.shell.view.document import is_job
from selfmotion.shell.view.handles import handles_of
from selfmotion.shell.view.maps import maps_soon
from selfmotion.shell.view.motions import (
    coarse,
    coarse_program,
    shown_program,
    standing,
    standing_program,
)
from selfmotion.shell.view.placement_map import PlacementMap
from selfmotion.shell.view.requests import NewerRequest, Outcome, Request
from selfmotion.work.job import Program

# What takes longer is reported where nothing else is asked for in this time [s].
_CALM = 0.25
# So many arms are kept for documents to come: one for each place of a base that is dragged.
_KEPT = 16
# What the page can plan of what a document may ask for.
GOALS = ("best", "retimed")


class Planning:
    """Plans the latest request, in a thread of its own.

    Parameters
    ----------
    file : Path
        Where documents come from: files that they name are beside it.
    allow_code : bool
        Whether code that documents name is run.
    tell : callable
        Called in that thread with each `Outcome`.
    given : (dict, Plan), optional
        A document, and its plan that is there already.
    """

    def __init__(
        self,
        file: Path,
        allow_code: bool,
        tell: Callable[[Outcome], None],
        initial: tuple[Mapping[str, Any], Plan] | None = None,
    ) -> None:
        self._file, self._allow_code, self._tell = file, allow_code, tell
        self._wanted: Request | None = None
        self._change = threading.Condition()
        self._closed = False
        self._cache: dict[str, Any] = {}
        self._given = initial
        # The places in reach, and what they are of; those of the request that is answered.
        self._last_map: tuple[Any, PlacementMap | None] = None, None
        self._maps: dict[int, PlacementMap | None] = {}
        self._first: Outcome | None = None
        # What was planned last: the same document is not planned again.
        self._found: Outcome | None = None
        self.last: Plan | None = None
        self.last_program: Program | None = None
        self._thread = threading.Thread(target=self._run, name="planning", daemon=True)

    def start(self, first: Outcome | None = None) -> None:
        """Begin to plan what is asked for, and to find more of what was found first."""
        self._first = first
        self._thread.start()

    def ask(self, request: Request) -> None:
        """Plan this, and leave what was asked for before."""
        with self._change:
            self._wanted = request
            self._change.notify()

    def close(self) -> None:
        """Leave all plans; returns when the thread has ended."""
        with self._change:
            self._closed = True
            self._change.notify()
        self._thread.join()

    def _run(self) -> None:
        done = -1
        if self._first is not None:
            done = self._first.request.number
            self._tried(self._first.request, self._first)
        while True:
            with self._change:
                while not self._closed and (self._wanted is None or self._wanted.number == done):
                    self._change.wait()
                if self._closed or self._wanted is None:
                    return
                request = self._wanted
            done = request.number
            self._tried(request)

    def _tried(self, request: Request, outcome: Outcome | None = None) -> None:
        """Answer a request, where that is not `outcome` yet, and find more of it."""
        try:
            outcome = outcome or self.answer(request)
            self._more(outcome)
        except NewerRequest:
            return
        except Exception as error:
            # A fault of the program ends this plan, not the page.
            traceback.print_exc()
            words = f"selfmotion failed, which is a fault of the program: {error}"
            self._tell(Outcome(request, "none", words, None))

    def answer(self, request: Request) -> Outcome:
        """Tell of the motions that are found for a request; return the last one."""
        if len(self._cache) > _KEPT:
            self._cache.clear()
        outcome = Outcome(request, "none", "", None)
        for outcome in self._answers(request):
            outcome = replace(outcome, placements=self._maps.get(request.number))
            self._tell(outcome)
        self._leave(request)
        self._found = outcome
        return outcome

    def _answers(self, request: Request) -> Iterator[Outcome]:
        """Return what is found for a request, one after the other."""
        found = self._found
        if found is not None and found.verified and found.request.document == request.document:
            # Another handle is chosen, or one is released where it was.
            found = replace(found, request=request)
            self._maps = {request.number: self._placements_of(found)}
            return iter((found,))
        return (self._programs if is_job(request.document) else self._plans)(request)

    def _more(self, outcome: Outcome) -> None:
        """Tell what takes longer, where nothing newer is asked for."""
        if not self._is_calm(outcome.request):
            return
        if outcome.kind == "whole" and outcome.is_brief:
            outcome = self._found = replace(outcome, is_brief=False)
            self._tell(outcome)
        outcome = self._placed(outcome)
        if outcome.kind != "whole" or outcome.maps:
            return
        maps = tuple(maps_soon(outcome, self._stage(outcome.request)))
        if maps:
            self._leave(outcome.request)
            self._found = replace(outcome, maps=maps)
            self._tell(self._found)

    def _placed(self, outcome: Outcome) -> Outcome:
        """Return what is found with the whole placement map of the handle that is chosen."""
        placements = self._placements_of(outcome)
        if placements is None or (placements.is_done and outcome.placements is placements):
            return outcome
        while not placements.is_done:
            placements.test_next()
            self._leave(outcome.request)
        outcome = replace(outcome, placements=placements)
        self._tell(outcome)
        return outcome

    def _plans(self, request: Request) -> Iterator[Outcome]:
        """Yield what is found for a problem."""
        try:
            job = plan_request_of(
                request.document, self._file, allow_code=self._allow_code, cache=self._cache
            )
            if job.goal not in GOALS:
                raise ProblemError(
                    f"goal: is '{job.goal}', of which the page shows nothing; expected "
                    f"{' or '.join(GOALS)} (`selfmotion plan` plans it)"
                )
        except SelfmotionError as error:
            yield Outcome(request, "none", self._told(error), None)
            return
        if self._given is not None and self._given[0] == request.document:
            self.last = planned = self._given[1]
            yield Outcome(request, "whole", planned.certificate.verdict, PlanReplay(planned))
            return
        first = self._coarse(job.problem)
        if first is not None:
            begun = Outcome(request, "coarse", first.report.message, PlanReplay(first))
            yield from self._with_placements(begun, [job.problem], [first.trajectory.q])
        self._leave(request)
        try:
            planned = self._whole(request, job)
        except SelfmotionError as error:
            words = f"not verified: {self._told(error)}"
            still = standing(job.problem, self.last, words)
            yield Outcome(request, "none", words, PlanReplay(still))
            return
        self.last = planned
        yield Outcome(request, "whole", planned.certificate.verdict, PlanReplay(planned))

    def _programs(self, request: Request) -> Iterator[Outcome]:
        """Yield what is found for a job.

        The program before is planned anew where it has to be, which is soon there; then the best
        one from nothing, as `selfmotion job` does.
        """
        try:
            job = seam_job_of(
                request.document, self._file, allow_code=self._allow_code, cache=self._cache
            )
        except SelfmotionError as error:
            yield Outcome(request, "none", self._told(error), None)
            return
        before = self.last_program
        if before is not None and before.robot.joint_names == job.robot.joint_names:
            first = coarse_program(job, before)
            begun = Outcome(request, "coarse", first.verdict, first)
            near = {name: plan.trajectory.q for name, plan in before.plans.items()}
            kept = [k for k, seam in enumerate(job.seams) if seam.name in near]
            problems = [job.problems[k] for k in kept]
            yield from self._with_placements(
                begun, problems, [near[job.seams[k].name] for k in kept]
            )
            if request.is_held and not self._is_calm(request):
                # A plan of several seams is only left between two of them: a hand does not wait.
                raise NewerRequest
            self._leave(request)
            early = self._early(request, job, before)
            if early is not None:
                words = f"{early.verdict}; the best order is being looked for"
                shown = shown_program(early)
                yield Outcome(request, "early", words, shown, early)
                self._leave(request)
        try:
            program = job.plan(progress=self._stage(request))
        except SelfmotionError as error:
            words = f"not verified: {self._told(error)}"
            shown = standing_program(job, before, words)
            paths = tuple(seam.path for seam in job.seams)
            yield Outcome(request, "none", words, shown, unmade=paths)
            return
        self.last_program = program
        shown = shown_program(program)
        unmade = tuple(seam.path for seam in job.seams if seam.name in program.missing)
        yield Outcome(request, "whole", program.verdict, shown, program, unmade)

    def _with_placements(
        self, outcome: Outcome, problems: Sequence[Problem], near: Sequence[Array]
    ) -> Iterator[Outcome]:
        """Yield a first motion; while something is dragged, with its placement map."""
        request = outcome.request
        placements = self._placements(outcome, problems, near)
        self._maps = {request.number: placements}
        yield outcome
        # One batch at least, so that a drag without a rest has all of them in the end. What is
        # released is planned first.
        while request.is_held and placements is not None and not placements.is_done:
            placements.test_next()
            self._leave(request)
            if placements.is_done:
                yield outcome

    def _placements_of(self, outcome: Outcome) -> PlacementMap | None:
        """Return the placement map of the handle that is chosen, with the plans that are there."""
        plans = _plans_of(outcome)
        problems = [each.problem for each in plans]
        return self._placements(outcome, problems, [each.trajectory.q for each in plans])

    def _placements(
        self, outcome: Outcome, problems: Sequence[Problem], near: Sequence[Array]
    ) -> PlacementMap | None:
        """Return the placement map of the handle that is chosen; None where it has none.

        It is made once for all that is moved to and fro.
        """
        request, plan = outcome.request, outcome.plan
        if request.drag is None or plan is None or not problems:
            return None
        handle = handles_of(request.document, plan.problem).get(request.drag[1])
        if handle is None:
            return None
        pose = handle.prefix * handle.pose
        key = (request.drag, round(float(pose.translation[2]), 6), pose.rotation.round(6).tobytes())
        last_key, placements = self._last_map
        if last_key != key:
            can_move = PlacementMap.can_move(problems, handle)
            placements = PlacementMap(problems, near, handle) if can_move else None
            self._last_map = key, placements
        return placements

    def _early(self, request: Request, job: SeamJob, before: Program) -> Program | None:
        """Return a verified program in the order before; None where there is none."""
        if job.at_feed is not None or not before.verified:
            return None
        try:
            program = job.plan(warm_start=before, progress=self._stage(request))
        except SelfmotionError:
            # Planned from nothing it is told what is wrong.
            return None
        return program if program.verified else None

    def _is_calm(self, request: Request) -> bool:
        """Wait a moment; return whether nothing newer is asked for by then."""
        with self._change:
            self._change.wait(_CALM)
        return not self._closed and (self._wanted is None or self._wanted.number == request.number)

    def _coarse(self, problem: Problem) -> Plan | None:
        """Return a motion near the one before; None where there is none."""
        last, robot = self.last, problem.robot
        if last is None or last.robot.joint_names != robot.joint_names:
            return None
        if not is_plain(problem.follows):
            return None
        return coarse(problem, last.trajectory)

    def _whole(self, request: Request, job: PlanRequest) -> Plan:
        def iteration(_: Iteration) -> bool:
            self._leave(request)
            return False

        planned = plan(
            job.problem, progress=self._stage(request), callback=iteration, **job.settings
        )
        return retime(planned) if job.goal == "retimed" else planned

    def _stage(self, request: Request) -> Progress:
        """Return what leaves a request at the next stage of its plan."""

        def stage(_: str, __: int, ___: int) -> None:
            self._leave(request)

        return stage

    def _leave(self, request: Request) -> None:
        wanted = self._wanted
        if self._closed or (wanted is not None and wanted.number != request.number):
            raise NewerRequest

    def _told(self, error: SelfmotionError) -> str:
        return str(error).removeprefix(f"{self._file}: ")


def _plans_of(outcome: Outcome) -> Sequence[Plan]:
    """Return the plans whose paths move with the part; of what has no motion the stand-in."""
    if isinstance(outcome.made, Program):
        return tuple(outcome.made.plans.values())
    return (outcome.replayed.plan,) if isinstance(outcome.replayed, PlanReplay) else ()
