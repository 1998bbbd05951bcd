"""Plans in several parts, with changes of configuration in between."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    PlanError,
    SelfmotionError,
    as_path,
)
from selfmotion.certificate import USUAL, Tolerance, first_of
from selfmotion.model.motion import Trajectory, joined_motions
from selfmotion.model.path import Path, Retimed
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result.bundles import read_bundle, write_bundle
from selfmotion.planning.result.continuity import (
    CheckedMotion,
    continuity_faults,
    end_position_faults,
)
from selfmotion.planning.result.equality import arm_differences, comparison_times, same_poses
from selfmotion.planning.result.move import Move
from selfmotion.planning.result.plan import Plan, reached_text
from selfmotion.planning.result.specification import MotionSpecification, missing_constraints
from selfmotion.problem.problem import (
    START_TOLERANCE,
    Problem,
    along_other_paths,
    at_all_times,
    constraints_of_part,
    problem_from_dict,
    problem_to_dict,
    times_along,
)

# Version of the format: raised with every change that older versions cannot read.
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class Parts:
    """A motion along a path with as few changes of configuration as were found to be needed.

    Attributes
    ----------
    problem : Problem
        The specification, for the whole path.
    plans : tuple of Plan
        One for each part of the path, in order, each with a problem of its own.
    moves : tuple of Move
        From the end of each part to the start of the next, and back to the first one's start where
        the path has to be closed and its motion is not.
    cuts : tuple of float
        Times of the path at which each part but the last ends, and the next starts [s].
    endings : tuple of str
        Why each part but the last goes no further.
    altered : str
        Why the file that they were read from is not the one that was written; "" where it is.
    tolerance : Tolerance
        Allowed error of each plan from the path.
    """

    problem: Problem
    plans: tuple[Plan, ...]
    moves: tuple[Move, ...] = ()
    cuts: tuple[float, ...] = ()
    endings: tuple[str, ...] = ()
    altered: str = ""
    tolerance: Tolerance = USUAL

    def __repr__(self) -> str:
        """Return a few lines: the parts, where they are cut and why, and the verdict."""
        lines = [f"Parts({self.problem!r}, {len(self.plans)} with {len(self.moves)} moves)"]
        lines += [
            f"  cut at t = {cut:.6g} s: {ending}"
            for cut, ending in zip(self.cuts, self.endings, strict=False)
        ]
        return "\n".join([*lines, f"  {self.verdict}"])

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.problem.robot

    @property
    def verified(self) -> bool:
        """Whether the parts are as specified, and satisfy all conditions at all times."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, with the path error; or the violations by part."""
        if self.verified:
            return (
                f"verified at all times: {len(self.plans)} part{'s' * (len(self.plans) != 1)}, and "
                f"all moves in between; {reached_text(self.plans, self.tolerance)}"
            )
        return f"not verified: {'; '.join(self.failures)}"

    @property
    def summary(self) -> str:
        """The verdict in short, with the first violation."""
        return self.verdict if self.verified else first_of(self.failures)

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Violations; empty for verified parts."""
        parts = [
            f"part {number}: {plan.certificate.verdict}"
            for number, plan in enumerate(self.plans, 1)
            if not plan.certificate.verified
        ]
        moves = [
            f"move {number}: {move.trouble}"
            for number, move in enumerate(self.moves, 1)
            if not move.verified
        ]
        altered = [self.altered] if self.altered else []
        return (*altered, *parts, *moves, *PartsAsked(self).failures())

    @property
    def trajectory(self) -> Trajectory:
        """All parts and moves as one motion from t = 0 on.

        Raises
        ------
        PlanError
            A move was not found.
        """
        return joined_motions(self._motions)

    @property
    def begins(self) -> tuple[float, ...]:
        """Start time of each part in `trajectory` [s].

        Raises
        ------
        PlanError
            A move was not found.
        """
        durations = [motion.duration for motion in self._motions]
        # Motions are parts and moves by turns.
        return tuple(accumulate(durations[:-1], initial=0.0))[::2]

    @property
    def _motions(self) -> list[Trajectory]:
        motions = []
        for number, plan in enumerate(self.plans):
            motions.append(plan.trajectory)
            if number < len(self.moves):
                move = self.moves[number]
                if move.trajectory is None:
                    raise PlanError(f"move {number + 1} was not found: {move.trouble}")
                motions.append(move.trajectory)
        return motions

    def require(self) -> "Parts":
        """Return the parts themselves if all of them, and all moves, are verified.

        Raises
        ------
        PlanError
            They are not; the message is the verdict.
        """
        if not self.verified:
            raise PlanError(f"{self.problem.robot.name}: {self.verdict}")
        return self

    def save(self, file: str | FilePath) -> None:
        """Write all parts and moves to one file that `load_parts` reads; atomically.

        Raises
        ------
        PlanError
            A move was not found.
        """
        description = {
            "problem": problem_to_dict(self.problem),
            "tolerance": asdict(self.tolerance),
            "cuts": list(self.cuts),
            "endings": list(self.endings),
            **({"altered": self.altered} if self.altered else {}),
        }
        for number, move in enumerate(self.moves, 1):
            if move.trajectory is None:
                raise PlanError(f"move {number} was not found: {move.trouble}")
        write_bundle(as_path(file), "parts", _FORMAT, description, [*self.plans, *self.moves])


def load_parts(file: str | FilePath) -> Parts:
    """Read parts that `Parts.save` wrote, and judge all of them anew.

    A file that was changed is never verified.

    Raises
    ------
    FileFormatError
        The file is missing, holds no parts, lacks something, or was written by another version.
    """
    path = as_path(file)
    description, items, changed = read_bundle(path, "parts", _FORMAT)
    try:
        problem = problem_from_dict(description["problem"])
        cuts = tuple(map(float, description["cuts"]))
        endings = tuple(map(str, description["endings"]))
        # Files of older versions have none: the default.
        tolerance = Tolerance(**description.get("tolerance", {}))
        altered = str(description.get("altered", ""))
    except (KeyError, TypeError, ValueError, OverflowError, SelfmotionError) as error:
        raise FileFormatError(f"{path}: are damaged parts: {error!r}") from error
    plans = tuple(item for item in items if isinstance(item, Plan))
    moves = tuple(item for item in items if isinstance(item, Move))
    if changed:
        altered = f"{path.name} was changed after the parts were written"
    return Parts(problem, plans, moves, cuts, endings, altered, tolerance)


# Largest pace of a part relative to the path's.
_OWN_PACE = 1.0 + 1e-9


class PartsAsked:
    """Holds parts against their problem: the whole path in order, and one move after another.

    Parameters
    ----------
    parts : Parts
    """

    def __init__(self, parts: "Parts") -> None:
        self._parts, self._problem = parts, parts.problem

    def failures(self) -> Iterator[str]:
        """Yield the deviations from the specification."""
        parts = self._parts
        if not parts.plans:
            yield "there is no part"
            return
        stops = [0.0, *parts.cuts, self._problem.path.duration]
        if len(stops) != len(parts.plans) + 1 or not np.all(np.diff(stops) > 0.0):
            yield (
                f"{len(parts.plans)} parts are cut at {list(parts.cuts)} s, expected a time "
                f"between each two, in order, within 0..{stops[-1]:.6g} s"
            )
            return
        for number, (plan, ends) in enumerate(zip(parts.plans, pairwise(stops), strict=True), 1):
            for text in self._of_part(plan, ends, number):
                yield f"part {number}: {text}"
        yield from self._of_moves()

    def _of_part(self, plan: Plan, ends: tuple[float, float], number: int) -> Iterator[str]:
        problem, items = self._problem, plan.problem
        is_first, is_last = number == 1, number == len(self._parts.plans)
        path = items.path
        if not (is_first and is_last):
            if not _is_part(path, problem.path, ends):
                yield f"it is not the path from {ends[0]:.6g} to {ends[1]:.6g} s"
                return
            if isinstance(path, Retimed):
                moved = along_other_paths(problem, lambda _: path, times_along(path, ends))
                relaxed = moved["relaxations"]
            else:
                relaxed = tuple(problem.relaxations)
            constraints = tuple(constraints_of_part(problem, is_first, is_last))
        else:
            path, relaxed = problem.path, tuple(problem.relaxations)
            constraints = tuple(problem.constraints)
        wanted = (*constraints, *problem.clearances)
        required = MotionSpecification(
            problem.robot,
            path,
            problem.task,
            relaxed,
            tuple(item for item in wanted if item.applies(problem.robot)),
            tolerance=self._parts.tolerance,
            also=problem.also,
            rest=problem.rest and problem.damping is None,
        )
        yield from required.failures(plan)
        start = problem.given_start
        if is_first and start is not None:
            # The correction of a start given near the path.
            first = CheckedMotion("it", plan.trajectory)
            yield from end_position_faults(problem.robot, first, 0, start, START_TOLERANCE)

    def _of_moves(self) -> Iterator[str]:
        parts, problem = self._parts, self._problem
        plans, moves = parts.plans, parts.moves
        is_closed = any(item.ends.closes for item in problem.constraints) and len(plans) > 1
        wanted = len(plans) if is_closed else len(plans) - 1
        if len(moves) != wanted:
            yield f"{len(plans)} parts have {len(moves)} moves in between, expected {wanted}"
            return
        required = (*at_all_times(problem.constraints), *problem.clearances)
        kept = [item for item in required if item.applies(problem.robot)]
        for number, move in enumerate(moves, 1):
            for text in arm_differences(move.robot, problem.robot):
                yield f"move {number}: {text}"
            if move.trajectory is not None:
                for text in missing_constraints(move.constraints, kept):
                    yield f"move {number}: {text}"
        pieces = []
        for number, plan in enumerate(plans, 1):
            pieces.append(CheckedMotion.of(f"part {number}", plan))
            pieces += [
                CheckedMotion.of(f"move {number}", move) for move in moves[number - 1 : number]
            ]
        if is_closed:
            pieces.append(CheckedMotion.of("part 1", plans[0]))
        found = [motion_ for motion_ in pieces if motion_ is not None]
        # A missing move has a message already.
        if len(found) == len(pieces):
            yield from continuity_faults(problem.robot, found)


def _is_part(part: Path, whole: Path, ends: tuple[float, float]) -> bool:
    """Whether a path is another one from one of its times to another, or slower."""
    t = comparison_times(part)
    first, last = ends
    passed = part.pace(t) if isinstance(part, Retimed) else t
    # A gap at either end is bridged by a move.
    reached = np.array([passed[0], passed[-1]])
    if not np.abs(reached - [0.0, last - first]).max() <= 1e-9 * whole.duration:
        return False
    if isinstance(part, Retimed) and not np.all(part.pace(t, 1) <= _OWN_PACE):
        return False
    return same_poses(part, t, whole, np.clip(first + passed, first, last))
