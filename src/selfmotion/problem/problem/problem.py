"""Problem: an arm, a tool motion, its prescribed rows, costs and constraints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self
from warnings import warn

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    FormerUseWarning,
    ProblemError,
    Progress,
    as_flag,
    as_several,
    read_only,
    shown,
    silent,
)
from selfmotion.certificate import (
    AtRest,
    Certificate,
    Requirement,
    Tolerance,
    certify,
)
from selfmotion.model.follow import Follow, Follows
from selfmotion.model.motion import NullMotion, Trajectory
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Damping, DampingLaw, Relaxation, Task, feedback_rate
from selfmotion.problem.constraints import (
    MOVED_CLEARANCE,
    NO_OVERLAP,
    Clearance,
    Constraint,
    as_clearances,
    separate_clearances,
)
from selfmotion.problem.costs import BeyondLimits, Cost, JointVelocity, OffPath
from selfmotion.problem.problem.defaults import ANY_NULL_MOTION, KEPT, USUAL_COSTS
from selfmotion.problem.problem.digest import conditions_digest
from selfmotion.problem.problem.end_checks import check_end, check_start
from selfmotion.problem.problem.end_constraints import prescribed_end
from selfmotion.problem.problem.envelopes import envelope_of_problem, envelope_without_arm
from selfmotion.problem.problem.feed_checks import check_feeds
from selfmotion.problem.problem.first_follow import first_follow
from selfmotion.problem.problem.fit import check_fit
from selfmotion.problem.problem.of_start import misses_of_start, too_near_at
from selfmotion.problem.problem.parameter_checks import (
    SEQUENCES,
    check_costs,
    check_kinds,
    check_requirements,
)
from selfmotion.problem.problem.remarks import remarks_on
from selfmotion.problem.problem.rest import arm_rest_orders

# Stiffness of springs that hold joints of a damped motion within limits, in shares of a limit of
# speed, or radians.
_BEYOND_LIMITS = 1e4


class _TaskField:
    """A task that may be given by its name."""

    def __get__(self, problem: Any, owner: Any = None) -> Task:
        # On the class, the descriptor gives the default.
        return Task.POSE if problem is None else problem.__dict__["_task"]

    def __set__(self, problem: Any, task: Task | str) -> None:
        problem.__dict__["_task"] = Task.of(task)


@dataclass(frozen=True, eq=False)
class Problem:
    """A planning problem.

    Parameters
    ----------
    robot : RobotModel
    path : Path
        The tool's motion.
    task : Task or str
        The rows of it that are prescribed; ``"pose"`` by default.
    start : (n,) or "free", optional
        q(0) [rad or m]; must put the tool on the start of the path. By default free: starts are
        sampled, and the best ones optimised with the rest of the motion.
    null_motion : NullMotion
        The parameterisation of the self-motion. By default any, optimised at nodes.
    costs : sequence of Cost
        Their integrals are added up. By default ∫ ½ q̇ᵀq̇ dt; see `JointVelocity.usual`.
    constraints : sequence of Constraint
        Conditions on the motion, each judged by the certificate. By default the URDF's limits of
        joint position and velocity, and the limits of acceleration and jerk that the arm's maker
        publishes (`RobotModel.acceleration_limit`). The URDF's always apply in addition, unless
        these replace limits of position or velocity.
    relaxations : sequence of Relaxation
        Rows in which the tool may leave its path, by how much and when. Each is one more joint
        between tool and path, which costs nothing, so that the deviation is part of the
        self-motion. By default none. A given start, or an end configuration, may use them; with
        other conditions there, the end is on the path itself; on a closed path, the deviation is
        closed, too. Of several paths the first is relaxed.
    clearance : Clearance or sequence of Clearance, optional
        Minimum distance of the arm from itself and from obstacles: by default its links must not
        overlap, where its URDF has bodies. None to leave that out; the verdict then says so.
    rest : bool
        Whether the arm is at rest where the path starts or ends at rest, which a controller needs,
        for, unless a constraint says how fast it is there: the null motion then vanishes, and its
        derivative too where the tool does not accelerate either. The paper's does not.
    also : sequence of Follow
        Further task frames of the arm that follow paths at the same time: their rows are prescribed
        in addition. A list of `Follow` in place of the path is the same; its first one is then the
        tool.
    damping : Damping, optional
        Go through singular poses, and past the edge of the workspace, at the price of the path: by
        default the tool stays on the path, and there is no motion through such poses. Adds the
        cost "path error".

    Raises
    ------
    RedundancyError
        The task leaves no self-motion, and no row is relaxed.
    StartError
        `start` is off the path.
    ProblemError
        The arm cannot move in all the rows, two costs share a name, a cost, constraint or
        relaxation does not fit the arm, the path or the task.

    Notes
    -----
    Attributes other than its parameters, `certify` and `digest` may change before 1.0.
    """

    robot: RobotModel
    path: Path
    task: _TaskField = _TaskField()  # a descriptor, meant to be shared
    start: npt.ArrayLike | str | None = None
    null_motion: NullMotion = ANY_NULL_MOTION
    costs: Sequence[Cost] = USUAL_COSTS
    constraints: Sequence[Constraint] = KEPT
    relaxations: Sequence[Relaxation] = ()
    damping: Damping | None = None
    clearance: Clearance | Sequence[Clearance] | None = NO_OVERLAP
    rest: bool = True
    also: Sequence[Follow] = ()

    def __post_init__(self) -> None:
        if isinstance(self.path, list | tuple):
            several = as_several(self.path, "path", Follow)
            first, robot = first_follow(several, self.robot)
            object.__setattr__(self, "robot", robot)
            object.__setattr__(self, "path", first.path)
            object.__setattr__(self, "task", first.task)
            object.__setattr__(self, "also", (*several[1:], *self.also))
        check_kinds(self)
        if self.costs is USUAL_COSTS:
            object.__setattr__(self, "costs", (JointVelocity.usual(self.robot),))
        for name, each in SEQUENCES.items():
            object.__setattr__(self, name, as_several(getattr(self, name), name, each))
        constraints, clearances = separate_clearances(self.constraints, self.clearance)
        if len(constraints) < len(self.constraints):
            object.__setattr__(self, "constraints", constraints)
            # Of who called the class.
            warn(MOVED_CLEARANCE.format("Problem"), FormerUseWarning, stacklevel=3)
        one = clearances if len(clearances) > 1 else (*clearances, None)[0]
        object.__setattr__(self, "clearance", one)
        check_fit(self.follows, self.relaxations, self.start)
        if isinstance(self.start, str):
            if self.start != "free":
                raise ProblemError(f"start is '{self.start}', expected numbers, 'free' or None")
            object.__setattr__(self, "start", None)
        object.__setattr__(self, "rest", as_flag(self.rest, "rest"))
        check_costs(self.follows, self.costs, self.all_costs)
        for item in self.constraints:
            item.check(self.follows)
            end = prescribed_end(self.robot, [item])
            if end is not None:
                check_end(self.follows, end, self.relaxations)
        # Now, not when the motion is finished: without a requirement nothing judges it.
        check_requirements(self.all_constraints, self._judging)
        if self.start is not None:
            start = read_only(self.robot.configuration(self.start))
            object.__setattr__(self, "start", start)
            check_start(self.follows, start, self.relaxations)
        for item in self.constraints:
            item.check_start(self.follows, self.given_start)

    def __repr__(self) -> str:
        return f"Problem({self.robot.name}, {self.path!r}, task '{self.task.value}')"

    def __copy__(self) -> Self:
        found = object.__new__(type(self))
        found.__dict__.update(self.__dict__)
        return found

    def __getstate__(self) -> tuple[dict[str, Any], bool, list[int]]:
        # Derived values are computed anew: placed bodies belong to a thread. The default clearance
        # and limits are identified by object identity.
        kept = {name: item for name, item in self.__dict__.items() if name not in _derived(self)}
        usual = [
            next((k for k, each in enumerate(KEPT) if each is item), -1)
            for item in self.constraints
        ]
        return kept, self.clearance is NO_OVERLAP, usual

    def __setstate__(self, state: tuple[dict[str, Any], bool, list[int]]) -> None:
        kept, is_usual, usual = state
        self.__dict__.update(kept)
        if is_usual:
            object.__setattr__(self, "clearance", NO_OVERLAP)
        pairs = zip(self.constraints, usual, strict=True)
        items = (KEPT[k] if k >= 0 else item for item, k in pairs)
        object.__setattr__(self, "constraints", tuple(items))

    @cached_property
    def follows(self) -> Follows:
        """Task frames of the arm: the input of planners."""
        return Follows.of(self.robot, self.path, self.task, self.also)

    def changed(self, **changes: Any) -> Problem:
        """Return the problem with other parameters."""
        return replace(self, **changes)

    @property
    def given_start(self) -> Array | None:
        """The start configuration (n,), or None where it is free."""
        return None if self.start is None else np.asarray(self.start, dtype=np.float64)

    @cached_property
    def all_costs(self) -> tuple[Cost, ...]:
        """The costs; with those of being off the path and beyond limits where it is damped."""
        if self.damping is None or self.damping_law is None:
            return tuple(self.costs)
        rate = feedback_rate(self.path.duration)
        weight = self.damping.path_weight * (rate / self.damping_law.threshold) ** 2
        kept = envelope_of_problem(self)
        limits = BeyondLimits(_BEYOND_LIMITS, kept.lower, kept.upper, kept.speed)
        return (*self.costs, OffPath(float(weight), self.follows.dimension), limits)

    @property
    def clearances(self) -> tuple[Clearance, ...]:
        """All that is given as `clearance`."""
        return as_clearances(self.clearance)

    @property
    def all_constraints(self) -> tuple[Constraint, ...]:
        """The constraints, and then the clearances, that apply to the arm."""
        every = (*self.constraints, *self.clearances)
        return tuple(item for item in every if item.applies(self.robot))

    @cached_property
    def rest_orders(self) -> tuple[int, int]:
        """Orders of rest of the arm at the start and at the end; see `rest_orders`."""
        return arm_rest_orders(self.follows, self.constraints) if self.rest else (0, 0)

    @cached_property
    def damping_law(self) -> DampingLaw | None:
        """The damping in numbers [m, rad] for this arm and task."""
        if self.damping is None:
            return None
        best = self.follows.jacobian(self.robot.dexterous_configuration(self.task))
        return self.damping.law(float(np.linalg.svd(best, compute_uv=False)[-1]))

    @cached_property
    def requirements(self) -> tuple[Requirement, ...]:
        """Requirements of the certificate besides the path: rest, and one for each constraint."""
        return (*_rest(self, *self.rest_orders), *self._judging)

    @cached_property
    def _judging(self) -> tuple[Requirement, ...]:
        return tuple(item.requirement(self.robot) for item in self.all_constraints)

    def requirement_of(self, constraint: Constraint) -> Requirement:
        """Return the requirement of one of its constraints, or clearances, that apply."""
        own = zip(self.all_constraints, self._judging, strict=True)
        return next(requirement for item, requirement in own if item is constraint)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes before planning: overlapping links, suspicious limits or placements."""
        envelope = envelope_of_problem(self)
        found = remarks_on(self.robot, self.follows, self.constraints, self.requirements, envelope)
        return tuple(dict.fromkeys(found))

    def certify(
        self,
        trajectory: Trajectory,
        tolerance: Tolerance | None = None,
        ending: str = "",
        besides: Sequence[Requirement] = (),
        progress: Progress = silent,
    ) -> Certificate:
        """Return the certificate of a motion, by all conditions of the problem; see `certify`.

        Also by requirements `besides`, and by its start if one is given. A motion with an `ending`
        stops before the end of the path, and need not rest there.
        """
        start, end = self.rest_orders
        rests = _rest(self, start, 0 if ending else end)
        certificate = certify(
            self.robot,
            self.path,
            self.task,
            trajectory,
            tolerance,
            (*rests, *self._judging, *besides),
            also=self.also,
            relaxations=self.relaxations,
            damping=self.damping_law,
            ending=ending,
            progress=progress,
        )
        given = self.given_start
        if given is not None:
            failures = (*misses_of_start(self.robot, given, trajectory), *certificate.failures)
            notes = (*certificate.notes, *too_near_at(given, certificate, self._judging))
            certificate = replace(certificate, failures=failures, notes=notes)
        return replace(certificate, problem=self.digest)

    @cached_property
    def digest(self) -> str:
        """Identifier of the certificate's conditions; see `conditions_digest`."""
        return conditions_digest(self)


def along_other_paths(
    problem: Problem, other: Callable[[Path], Path], when: Callable[[Array], Array] | None = None
) -> dict[str, Any]:
    """Return, for `dataclasses.replace`, other paths in place of all that are followed.

    With `when`, also the windows of tolerances at other times; those that become empty are
    left out.
    """
    others = tuple(
        item.along(other(bound.path))
        for item, bound in zip(problem.also, problem.follows.items[1:], strict=True)
    )
    found: dict[str, Any] = {"path": other(problem.path), "also": others}
    if when is not None:
        moved = (item.moved(when) for item in problem.relaxations)
        found["relaxations"] = tuple(item for item in moved if item is not None)
    return found


def _derived(problem: Problem) -> set[str]:
    """Names of cached derived values."""
    several = (vars(cls).items() for cls in type(problem).__mro__)
    return {name for each in several for name, item in each if isinstance(item, cached_property)}


def _rest(problem: Problem, start: int, end: int) -> tuple[Requirement, ...]:
    """Return the requirements of rest of given orders; see `rest_orders`."""
    # A damped motion off its path is still moving.
    if problem.damping is not None or not (start or end):
        return ()
    return (AtRest(start > 0, end > 0, (start > 1, end > 1)),)


# Signature in help() of a field that is a descriptor.
Problem.__init__.__annotations__["task"] = "Task | str"


def check_feeds_of(problem: Problem) -> None:
    """Refuse feeds that no motion has; see `check_feeds`."""
    paths = [item.path for item in problem.follows.items if item.path.feeds]
    if not paths:
        return
    limits = envelope_without_arm(problem.robot, problem.all_constraints)
    check_feeds(problem.robot.name, paths, limits.tool_speed)


def check_problem(problem: object) -> None:
    """Raise ProblemError where something else was given for a problem."""
    if not isinstance(problem, Problem):
        raise ProblemError(f"problem is {shown(problem)}, expected a Problem(robot, path, …)")
