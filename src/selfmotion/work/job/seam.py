"""One of the seams of a job."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, ProblemError, as_flag, as_number, as_several, read_only, shown
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import NodeNullMotion, NullMotion, reversed_motion
from selfmotion.model.path import REST_SPEED, Path, Reversed
from selfmotion.model.task import Relaxation, Task
from selfmotion.planning.result import Plan
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.costs import Cost
from selfmotion.problem.problem import Problem, along_other_paths, rest_orders
from selfmotion.work.job.stops import Precedences

# Names of the ends of a job, which no seam may have.
JOB_START = "job start"
JOB_END = "job end"
# Names are columns of tables, and words of files and pages [characters].
_LONGEST_NAME = 200


@dataclass(frozen=True, eq=False)
class Seam:
    """A stroke, a weld, an edge: a tool motion that a job has to make once.

    Parameters
    ----------
    name : str
        What to call it; each seam of a job has its own name.
    path : Path
        The tool's motion, with its leads where it has some (`with_leads`). It begins and ends at
        rest.
    task : Task or str
        The rows of it that are prescribed.
    relaxations : sequence of Relaxation
        Rows in which the tool may leave the path.
    costs : sequence of Cost, optional
        What is minimised along it; by default that of a `Problem`.
    constraints : sequence of Constraint
        What it has to keep besides what the job asks for.
    either_way : bool
        Whether it may be made from its end to its start.
    after : sequence of str
        Names of the seams that have to be made before it.
    after_any : sequence of str
        Names of seams of which one has to be made before it: what it stands on.
    wait : float
        How long the arm rests after it [s].
    events : sequence of (str, float)
        What happens how long after its start [s], whichever way it is made: ``("arc on", 0.1)``.
    leaves : sequence of Obstacle
        What stands there when it is made, for all that comes later.
    may_meet : sequence of str
        Names of what others leave that it may meet, and the moves that lead to and from it.

    Raises
    ------
    ProblemError
        An argument is not what it should be.
    """

    name: str
    path: Path
    task: Task | str = Task.POSE
    relaxations: Sequence[Relaxation] = ()
    costs: Sequence[Cost] | None = None
    constraints: Sequence[Constraint] = ()
    either_way: bool = True
    after: Sequence[str] = ()
    after_any: Sequence[str] = ()
    wait: float = 0.0
    events: Sequence[tuple[str, float]] = ()
    leaves: Sequence[Obstacle] = ()
    may_meet: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ProblemError(f"seam: name is {shown(self.name)}, expected a text")
        if len(self.name) > _LONGEST_NAME:
            raise ProblemError(
                f"seam: name '{self.name[:20]}…' has {len(self.name)} characters, expected at most "
                f"{_LONGEST_NAME}"
            )
        if self.name in (JOB_START, JOB_END):
            raise ProblemError(f"seam: '{self.name}' is an end of the job; give another name")
        what = f"seam '{self.name}'"
        if not isinstance(self.path, Path):
            raise ProblemError(f"{what}: path is {shown(self.path)}, expected a Path (Line, …)")
        object.__setattr__(self, "task", Task.of(self.task))
        kinds = {"relaxations": Relaxation, "constraints": Constraint, "leaves": Obstacle}
        if self.costs is not None:
            kinds["costs"] = Cost
        for name, kind in kinds.items():
            object.__setattr__(self, name, as_several(getattr(self, name), name, kind))
        object.__setattr__(self, "either_way", as_flag(self.either_way, f"{what}: either_way"))
        for name in ("after", "after_any", "may_meet"):
            object.__setattr__(self, name, _names(getattr(self, name), f"{what}: {name}"))
        wait = as_number(self.wait, f"{what}: wait", least=0.0)
        object.__setattr__(self, "wait", wait)
        object.__setattr__(self, "events", self._checked_events(what))
        self._check_rest(what)
        if self.either_way and any(one_way(item) for item in self.constraints):
            raise ProblemError(
                f"{what}: a constraint is on one end of it, so that it can be made one way only; "
                f"give either_way=False"
            )

    def __repr__(self) -> str:
        return f"Seam('{self.name}', {self.path!r}, task '{Task.of(self.task).value}')"

    def _check_rest(self, what: str) -> None:
        """Raise ProblemError where the tool moves at an end."""
        orders = rest_orders(self.path, Task.of(self.task))
        times = (0.0, self.path.duration)
        for time, verb, order in zip(times, ("begins", "ends"), orders, strict=True):
            speed, turning = map(float, np.linalg.norm(self.path.twist(time).reshape(2, 3), axis=1))
            # Rotation that the task leaves free is not the arm's.
            if speed > REST_SPEED or order == 0:
                raise ProblemError(
                    f"{what}: its path {verb} at {speed:.3g} m/s and {turning:.3g} rad/s, expected "
                    f"rest: time_law='minimum_jerk', Feed(path, …), or section_at_rest(path)"
                )

    def _checked_events(self, what: str) -> tuple[tuple[str, float], ...]:
        found = []
        for event in self.events:
            if not (isinstance(event, list | tuple) and len(event) == 2):
                raise ProblemError(f"{what}: event {shown(event)}, expected a text and a time [s]")
            name, seconds = event
            if not isinstance(name, str):
                raise ProblemError(f"{what}: event {shown(name)}, expected a text and a time [s]")
            at = as_number(seconds, f"{what}: event '{name}'", least=0.0, most=self.path.duration)
            found.append((name, at))
        _check_switched(found, what)
        return tuple(found)


def _check_switched(events: Sequence[tuple[str, float]], what: str) -> None:
    """Refuse what is switched on and off at once: the one that comes first has no effect."""
    for k, (first, at) in enumerate(events):
        for later, then in events[k + 1 :]:
            if at == then and are_opposite(first, later):
                raise ProblemError(
                    f"{what}: events '{first}' and '{later}' are both at {at:.6g} s, so that the "
                    f"first has no effect; give them different times (in a table different rows)"
                )


def are_opposite(one: str, other: str) -> bool:
    """Whether of two events one switches on what the other switches off, by their names."""
    words = (one.lower().split(), other.lower().split())
    opposite = {each[-1] for each in words if each} == {"on", "off"}
    return opposite and words[0][:-1] == words[1][:-1]


def one_way(constraint: Constraint) -> bool:
    """Whether a constraint asks something of one end of a motion."""
    return constraint.ends.is_about(0) or constraint.ends.is_about(1)


def reversing(duration: float) -> Callable[[Array], Array]:
    """Return when windows (first, last) of a path of a duration [s] are open on its way back."""
    return lambda times: (duration - times)[::-1]


def backwards(problem: Problem) -> Problem:
    """Return the problem of a path the other way round."""
    turned = along_other_paths(problem, Reversed, reversing(problem.path.duration))
    return replace(problem, **turned, start=None)


def backwards_plan(plan: Plan, problem: Problem) -> Plan:
    """Return a plan the other way round, judged anew, with its report by the new times.

    `problem` is that of the other way.
    """
    duration = plan.trajectory.duration
    null_motion, coefficients = _turned_null_motion(plan)
    active = [
        replace(item, spans=tuple((duration - b, duration - a) for a, b in item.spans[::-1]))
        for item in plan.report.active
    ]
    turned = replace(
        plan,
        problem=problem,
        trajectory=reversed_motion(plan.trajectory),
        initial_trajectory=reversed_motion(plan.initial_trajectory),
        coefficients=coefficients,
    )
    report = replace(turned.report.with_found(plan.report, active), null_motion=null_motion)
    return replace(turned, report=report, certificate=turned.check())


def _turned_null_motion(plan: Plan) -> tuple[NullMotion | None, Array]:
    """Return the null motion of a plan the other way round, -ε(T - t), and its coefficients.

    None and no coefficients for one whose functions are along the motion x = 0 of the first way.
    """
    given = plan.report.null_motion
    if not isinstance(given, NodeNullMotion):
        return None, read_only([])
    values = plan.coefficients.reshape(-1, len(given.times))
    times = tuple(1.0 - time for time in given.times[::-1])
    return NodeNullMotion(times), read_only(-values[:, ::-1].ravel())


def _names(given: object, what: str) -> tuple[str, ...]:
    if not isinstance(given, list | tuple) or not all(isinstance(name, str) for name in given):
        raise ProblemError(f"{what} is {shown(given)}, expected a list of names")
    return tuple(given)


def precedences(seams: Sequence[Seam]) -> Precedences:
    """Return the precedences of seams, by their places in the list."""
    places = {seam.name: k for k, seam in enumerate(seams)}
    after, after_any = (
        [frozenset(places[name] for name in wanted if name in places) for wanted in several]
        for several in ([seam.after for seam in seams], [seam.after_any for seam in seams])
    )
    return Precedences(after, after_any)
