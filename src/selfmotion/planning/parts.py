"""A path that no motion follows as a whole, in the fewest parts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    ProblemError,
    Progress,
    as_number,
    as_numbers,
    held_interruption,
    obeying,
    random_numbers,
    silent,
)
from selfmotion.certificate import Tolerance
from selfmotion.planning.moves import Retreat
from selfmotion.planning.part_planner import PartPlanner
from selfmotion.planning.run import plan
from selfmotion.planning.search import Search
from selfmotion.planning.settings import ATTEMPTS, MISSED_CUTS
from selfmotion.problem import Problem, check_feeds_of, check_problem
from selfmotion.result import Parts, Plan
from selfmotion.search import Stretch, Stretches, has_curves

# Where the tool leaves the path to, in its own axes.
_BACK = (0.0, 0.0, -1.0)


def plan_in_parts(
    problem: Problem,
    *,
    retreat: float = 0.0,
    axis: npt.ArrayLike | None = None,
    ramp: float = 0.5,
    rng: np.random.Generator | int = 0,
    tolerance: Tolerance | None = None,
    progress: Progress = silent,
) -> Parts:
    """Plan a path in the fewest parts, with changes of configuration in between.

    The global search looks for the fewest chains of configurations that together follow the path,
    and among these for the shortest, none of which has a step that no motion takes. Where one will
    do, or the samples of the search may have missed that, `plan` comes first, and its plan is the
    only part if it is verified. Else each chain becomes a plan. At a cut the tool comes to rest
    on the path and goes on from there in another configuration. The move to that is a joint motion
    from rest to rest that keeps what the problem asks of all times, judged like a plan: straight,
    or by a few stops where that meets something.

    The number of parts is the least among the samples of the search; nothing proves that no
    continuous motion slips between them.

    Parameters
    ----------
    problem : Problem
        Conditions on the start or the end hold for the first or the last part. For a `ClosedPath`
        a last move leads back to the start. At cuts the arm rests, whatever `rest` says.
    retreat : float
        How far the tool leaves the path along `axis` before each move, and from how far it comes
        back [m]; by default the move begins on the path.
    axis : (3,), optional
        Where to, in tool axes: by default back along the tool's z axis.
    ramp : float
        How long the tool takes to come to rest at a cut, and to be up to speed again [s].
    rng : Generator or int
        Shifts the seeds of the searches.
    tolerance : Tolerance, optional
        What a motion may miss the path by.
    progress : callable, optional
        As in `plan`.

    Returns
    -------
    Parts
        Also where a part could not be planned or a move not be found: `Parts.verdict` says so, and
        `Parts.require` raises.

    Raises
    ------
    FeedError
        The path asks for a feed that it cannot have, whatever the arm; before anything is searched.
    NoSequenceError
        No parts, however many, follow the path: some pose of it is out of reach, beyond limits or
        blocked in every configuration, or its neighbours are beyond the step limits. Tells when
        and why.
    ProblemError
        An argument is not what it should be, the problem is damped, or has no self-motion to
        search.
    """
    retreats = _checked(problem, retreat, axis)
    ramp = as_number(ramp, "ramp", above=0.0)
    random_numbers(rng)
    check_feeds_of(problem)
    tolerance = Tolerance.of(tolerance)
    with held_interruption():
        return _parts(problem, retreats, ramp, rng, tolerance, obeying(progress))


def _parts(
    problem: Problem,
    retreats: Retreat | None,
    ramp: float,
    rng: np.random.Generator | int,
    tolerance: Tolerance,
    progress: Progress,
) -> Parts:
    # Samples of curves tell whether parts are needed; those of larger spaces may miss a way or two.
    missed = 0 if has_curves(problem) else MISSED_CUTS
    refused, chains = None, []
    try:
        stretches = Stretches.of(problem, rng, progress)
        chains = stretches.fewest(set())
    except NoSequenceError as error:
        if not missed:
            raise
        refused = error
    if len(chains) <= 1 + missed:
        whole = _whole(problem, rng, tolerance, progress)
        if whole is not None:
            return Parts(problem, (whole,), tolerance=tolerance)
    if refused is not None:
        raise refused
    planner = PartPlanner(problem, stretches, retreats, ramp, rng, tolerance, progress)
    return _best_of(planner, stretches, chains)


def _best_of(planner: PartPlanner, stretches: Stretches, chains: list[Stretch]) -> Parts:
    """Return the parts along chains, or along others where some of these fail."""
    best: Parts | None = None
    forbidden: set[int] = set()
    for _ in range(ATTEMPTS):
        found, failed = planner.plan(chains)
        if found is not None and (best is None or _standing(found) < _standing(best)):
            best = found
        if failed <= forbidden:
            break
        forbidden |= failed
        try:
            chains = stretches.fewest(forbidden)
        except NoSequenceError:
            break
    if best is None:
        raise planner.failure
    return best


def _checked(problem: Problem, retreat: float, axis: npt.ArrayLike | None) -> Retreat | None:
    check_problem(problem)
    if problem.damping is not None:
        raise ProblemError(
            "damping= leads through what cannot be followed by leaving the path, parts by another "
            "configuration; leave the damping out, or call plan"
        )
    if problem.also:
        raise ProblemError(
            f"{len(problem.follows.items)} frames follow paths at once, which the moves between "
            f"parts would not keep; call plan"
        )
    if problem.follows.redundancy == 0:
        raise ProblemError(
            f"{problem.robot.name}: task '{problem.task.value}' leaves no self-motion to search "
            f"for parts; choose one with fewer rows, or call plan"
        )
    length = as_number(retreat, "retreat", least=0.0)
    given = _BACK if axis is None else axis
    direction = as_numbers(given, "axis", "three finite numbers", (3,))
    if not np.any(direction):
        raise ProblemError("axis is zero, expected a direction in tool axes")
    if axis is not None and length == 0.0:
        raise ProblemError("axis has no effect without a retreat; give retreat=, or leave it out")
    return Retreat(length, direction / np.linalg.norm(direction)) if length > 0.0 else None


def _whole(
    problem: Problem, rng: np.random.Generator | int, tolerance: Tolerance, progress: Progress
) -> Plan | None:
    """Return a verified plan of the whole path, None where none is found."""
    search = Search(rng=rng) if problem.given_start is None else None
    try:
        found = plan(problem, search=search, tolerance=tolerance, progress=progress)
    except (BreakdownError, InverseKinematicsError, NoSequenceError):
        return None
    return found if found.certificate.verified else None


def _standing(parts: Parts) -> tuple[int, int, int]:
    """Return how many parts and moves are missing or not verified, and how many parts there are."""
    plans = sum(not part.certificate.verified for part in parts.plans)
    moves = sum(not move.verified for move in parts.moves)
    return plans, moves, len(parts.plans)
