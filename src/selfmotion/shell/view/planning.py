"""The planner of the page: what a document says is planned again whenever it is changed.

First coarsely: the motion before, put onto the new path by Newton's method; then in whole. The
whole plan is made anew, just as `selfmotion plan` does, so that the one that is shown in the end
is `plan()` of what is saved: of the ways that lead to it, nothing is left.
"""

import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import ProblemError, SelfmotionError
from selfmotion.model.follow import is_plain
from selfmotion.model.motion import Trajectory
from selfmotion.planning.optimise import Iteration
from selfmotion.planning.planner import PlanRequest, plan
from selfmotion.planning.result import Plan, retime
from selfmotion.planning.search import Manifold
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents import job_of
from selfmotion.shell.replay.whole import unproved

# Times of a coarse motion.
_TIMES = 41
# What takes longer is told where nothing else is asked for in this time [s].
_CALM = 0.25
# So many arms are kept for documents to come: one for each place of a base that is dragged.
_KEPT = 16
# What the page can plan of what a document may ask for.
GOALS = ("best", "retimed")


@dataclass(frozen=True, eq=False)
class Request:
    """A document to plan.

    Attributes
    ----------
    number : int
        Requests are counted; the last one counts.
    document : dict
    """

    number: int
    document: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Found:
    """What came of a request.

    Attributes
    ----------
    request : Request
    kind : {"coarse", "whole", "none"}
        A first motion; the plan; or no motion at all.
    words : str
        The verdict, or what stops it.
    plan : Plan or None
        None where the document describes no problem. Without a motion, the arm standing in its
        place, along with what it has to follow.
    job : PlanRequest or None
    is_brief : bool
        Whether there is more to tell of it, which takes longer: distances, the redundancy map.
    """

    request: Request
    kind: str
    words: str
    plan: Plan | None
    job: PlanRequest | None
    is_brief: bool = True


class NewerRequest(BaseException):
    """Leaves a plan that nobody waits for any more; no error, so that nothing catches it."""


class Planning:
    """Plans the latest request, in a thread of its own.

    Parameters
    ----------
    file : Path
        Where documents come from: files that they name are beside it.
    allow_code : bool
        Whether code that documents name is run.
    tell : callable
        Called in that thread with each `Found`.
    """

    def __init__(self, file: Path, allow_code: bool, tell: Callable[[Found], None]) -> None:
        self._file, self._allow_code, self._tell = file, allow_code, tell
        self._wanted: Request | None = None
        self._change = threading.Condition()
        self._closed = False
        self._memory: dict[str, Any] = {}
        self.last: Plan | None = None
        self._thread = threading.Thread(target=self._run, name="planning", daemon=True)

    def start(self) -> None:
        """Begin to plan what is asked for."""
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
        while True:
            with self._change:
                while not self._closed and (self._wanted is None or self._wanted.number == done):
                    self._change.wait()
                if self._closed or self._wanted is None:
                    return
                request = self._wanted
            done = request.number
            try:
                self.answer(request)
            except NewerRequest:
                continue
            except Exception as error:
                # A fault of the program ends this plan, not the page.
                traceback.print_exc()
                words = f"selfmotion failed, which is a fault of the program: {error}"
                self._tell(Found(request, "none", words, None, None))

    def answer(self, request: Request) -> None:
        """Tell of the motions that are found for a request."""
        if len(self._memory) > _KEPT:
            self._memory.clear()
        try:
            job = job_of(
                request.document, self._file, allow_code=self._allow_code, memory=self._memory
            )
            if job.goal not in GOALS:
                raise ProblemError(
                    f"goal: is '{job.goal}', of which the page shows nothing; expected "
                    f"{' or '.join(GOALS)} (`selfmotion plan` plans it)"
                )
        except SelfmotionError as error:
            self._tell(Found(request, "none", self._told(error), None, None))
            return
        coarse = self._coarse(job.problem)
        self._leave(request)
        if coarse is not None:
            self._tell(Found(request, "coarse", coarse.report.message, coarse, job))
        self._leave(request)
        try:
            found = self._whole(request, job)
        except SelfmotionError as error:
            words = f"not verified: {self._told(error)}"
            stands = standing(job.problem, self.last, words)
            self._tell(Found(request, "none", words, stands, job))
            return
        self.last = found
        told = Found(request, "whole", found.certificate.verdict, found, job)
        self._tell(told)
        if self._is_calm(request):
            self._tell(replace(told, is_brief=False))

    def _is_calm(self, request: Request) -> bool:
        """Wait a moment; return whether nothing newer is asked for by then."""
        with self._change:
            if self._thread.is_alive():
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
        def stage(_: str, __: int, ___: int) -> None:
            self._leave(request)

        def iteration(_: Iteration) -> bool:
            self._leave(request)
            return False

        found = plan(job.problem, progress=stage, callback=iteration, **job.settings)
        return retime(found) if job.goal == "retimed" else found

    def _leave(self, request: Request) -> None:
        wanted = self._wanted
        if self._closed or (wanted is not None and wanted.number != request.number):
            raise NewerRequest

    def _told(self, error: SelfmotionError) -> str:
        return str(error).removeprefix(f"{self._file}: ")


def coarse(problem: Problem, before: Trajectory) -> Plan:
    """Return the motion before, put onto the path of a problem time by time; nothing is proved.

    Its message says where it cannot be: where Newton's method finds no configuration near, which
    stays where it was then.
    """
    robot, follows, path = problem.robot, problem.follows, problem.path
    share = np.linspace(0.0, 1.0, _TIMES)
    times = share * path.duration
    near = before(before.t[0] + share * (before.t[-1] - before.t[0]))
    manifold = Manifold(follows, robot.lower, robot.upper)
    reached, arrived = manifold.project(near, follows.targets(times), held=follows.held(times))
    q = np.where(arrived[:, None], reached, near)
    motion = Trajectory(times, q, np.gradient(q, times, axis=0), robot.joint_names)
    words = "planning …"
    if not arrived.all():
        words = (
            f"planning …; out of reach near the motion before, from t = {times[~arrived][0]:.3g} s"
        )
    return unproved(problem, motion, words)


def standing(problem: Problem, last: Plan | None, words: str) -> Plan:
    """Return a plan in which the arm stands, for a page that has no motion to show.

    It stands where the motion before began, else where the problem does; its certificate says why.
    """
    robot, duration = problem.robot, problem.path.duration
    q = robot.home
    if problem.given_start is not None:
        q = problem.given_start
    elif last is not None and last.robot.joint_names == robot.joint_names:
        q = last.trajectory.q[0]
    still = np.tile(q, (2, 1))
    motion = Trajectory(np.array([0.0, duration]), still, np.zeros_like(still), robot.joint_names)
    return unproved(problem, motion, words)
