"""Files of a job: saved programs, results so far, and what an earlier program provides."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    ProblemError,
    SelfmotionError,
    as_path,
    description_of,
    digest_of,
    digest_of_file,
    shown,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import obstacle_from_dict
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.planner import check_joints
from selfmotion.planning.result import (
    Move,
    Plan,
    another_tool,
    arm_digest,
    files_of,
    key_of,
    load_move,
    load_plan,
    not_judged_by,
    read_bundle,
    read_kept,
    write_kept,
)
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost, FunctionCost
from selfmotion.problem.problem import Problem
from selfmotion.work.job.program import Program
from selfmotion.work.job.program_files import FORMAT
from selfmotion.work.job.seam import Seam, Step, precedences
from selfmotion.work.job.specification import Specification

# Saved programs, and the results of a job so far.

# Rounding of the end of a move [rad or m].
_JOINED = 1e-9


def load_program(file: str | Path) -> Program:
    """Read a program that `Program.save` wrote, and judge all of it anew.

    A file that was changed is never verified.

    Raises
    ------
    FileFormatError
        The file is missing, is no program, lacks something, or was written by another version.
    """
    path = as_path(file)
    description, made, changed = read_bundle(path, "program", FORMAT)
    try:
        pairs = zip(description["steps"], made, strict=True)
        steps = tuple(_step(values, item) for values, item in pairs)
        missing = {str(name): str(why) for name, why in description["missing"].items()}
        notes, bound = tuple(map(str, description["notes"])), float(description["bound"])
        unjudged = tuple(map(str, description.get("unjudged", ())))
        values = description["specification"]
        robot = made[0].robot
        specification = None if values is None else Specification.from_dict(values, robot)
        if not math.isfinite(bound):
            raise ValueError(f"bound is {bound}, not finite")
    except (SelfmotionError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: is a damaged program: {error!r}") from error
    if changed:
        missing[path.name] = "the file was changed after the program was written"
    return Program(made[0].robot, steps, missing, bound, notes, specification, unjudged=unjudged)


def _step(values: Mapping[str, Any], made: Plan | Move) -> Step:
    return Step(
        str(values["name"]),
        made,
        bool(values["turned"]),
        tuple((str(name), float(at)) for name, at in values["events"]),
        tuple(obstacle_from_dict(item) for item in values["leaves"]),
        tuple(map(str, values["may_meet"])),
    )


class ResultCache:
    """A folder with the plans and moves that a job has finished, by the description of each task.

    A stored result is used only if it was written for this very task, is complete and unchanged,
    and is verified when it is measured again with the present tolerance. Otherwise it is planned
    again.

    Parameters
    ----------
    folder : Path or None
        None stores nothing.
    tolerance : Tolerance
        Largest deviation of a seam from its path.
    known : mapping
        Arms and constraints that are loaded already; see `load_plan`.
    """

    def __init__(
        self, folder: Path | None, tolerance: Tolerance, arms: MutableMapping[str, Any]
    ) -> None:
        self._folder, self._tolerance, self._arms = folder, tolerance, arms
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise FileFormatError(f"{folder}: cannot be made: {error.strerror}") from error

    def file(
        self,
        name: str,
        describe: Callable[[], Any],
        robot: RobotModel,
        constraints: Sequence[Constraint],
    ) -> Path | None:
        """Return the file of a task by its JSON-safe description; None without a folder.

        Its name has a digest of the description and of the files of all bodies.
        """
        if self._folder is None:
            return None
        key = key_of((describe(), asdict(self._tolerance)), self.files(robot, constraints))[:16]
        plain = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:40]
        return self._folder / f"{plain}.{key}.json"

    def files(self, robot: RobotModel, constraints: Sequence[Constraint]) -> dict[str, str]:
        """Return the digests of the files of an arm's bodies and of its obstacles."""
        return files_of(robot, constraints, self._arms)

    def plans(self, file: Path | None, problem: Problem) -> tuple[list[Plan], str] | None:
        """Return the stored plans of a problem, and why there are none.

        None where nothing is stored.
        """
        stored = None if file is None else read_kept(file)
        if file is None or stored is None:
            return None
        try:
            files = _stored_archives(stored, file)
            plans, reason = [self._plan(name) for name in files], str(stored["reason"])
            # Each has its own start.
            problems = [replace(plan.problem, start=problem.start) for plan in plans]
        except (SelfmotionError, KeyError, TypeError, ValueError):
            return None
        same = all(stored_problem.digest == problem.digest for stored_problem in problems)
        sound = same and all(plan.certificate.verified for plan in plans)
        return (plans, reason) if sound else None

    def _plan(self, file: Path) -> Plan:
        plan = load_plan(file, known=self._arms)
        if plan.tolerance == self._tolerance:
            return plan
        return replace(plan, certificate=plan.check(self._tolerance))

    def store_plans(self, file: Path | None, result: tuple[Sequence[Plan], str]) -> None:
        """Store plans, or why there are none."""
        if file is None:
            return
        plans, reason = result
        for plan, archive in zip(plans, _archives(file, len(plans)), strict=True):
            plan.save(archive)
        _write(file, len(plans), {"reason": reason})

    def move(self, file: Path | None, missing: Move, ends: Array) -> Move | None:
        """Return the stored move between ends (2, n), or `missing` with the reason.

        None where nothing is stored.
        """
        stored = None if file is None else read_kept(file)
        if file is None or stored is None:
            return None
        try:
            if stored["trouble"]:
                return replace(missing, reason=str(stored["trouble"]))
            (archive,) = _stored_archives(stored, file)
            move = load_move(archive, known=self._arms)
        except (FileFormatError, KeyError, TypeError, ValueError):
            return None
        return move if satisfies(move, missing, ends) else None

    def store_move(self, file: Path | None, move: Move) -> None:
        """Store a move, or why there is none."""
        if file is None:
            return
        count = int(move.trajectory is not None)
        for archive in _archives(file, count):
            move.save(archive)
        _write(file, count, {"trouble": "" if count else move.trouble})


def satisfies(move: Move, missing: Move, ends: Array) -> bool:
    """Whether a move is verified for the arm, constraints and ends (2, n) of a `missing` one."""
    if move.trajectory is None or any(another_tool(move.robot, missing.robot)):
        return False
    if float(np.abs(move.motion.q[[0, -1]] - ends).max()) > _JOINED:
        return False
    return move.verified and not any(not_judged_by(move.constraints, missing.constraints))


def _archives(file: Path, count: int) -> list[Path]:
    """Return the files of the plans or moves of one task."""
    return [file.with_suffix(f".{number}.npz") for number in range(count)]


def _write(file: Path, count: int, values: Mapping[str, Any]) -> None:
    """Write the record of a result, last, with the digest of each of its archives."""
    digests = [digest_of_file(archive) for archive in _archives(file, count)]
    write_kept(file, {"digests": digests, **values})


def _stored_archives(stored: Mapping[str, Any], file: Path) -> list[Path]:
    """Return the archives that were written with a record.

    An archive of another task has a sound motion as well, and may be of the same problem.
    """
    digests = list(stored["digests"])
    archives = _archives(file, len(digests))
    for archive, digest in zip(archives, digests, strict=True):
        if digest_of_file(archive) != digest:
            raise FileFormatError(f"{archive}: is not the one that was written with {file.name}")
    return archives


# Motions of seams and paths of moves from an earlier program of the same or a similar job.

# A move whose ends are farther away than this in all is of no use [rad or m].
_NEAR = 1.5
# Samples of an earlier move, from which its corners are found.
_SAMPLES = 65
# Deviation of the samples from the polyline of these corners [rad or m].
_STRAIGHT = 0.02


@dataclass(frozen=True, eq=False)
class EarlierProgram:
    """Results of an earlier program.

    Parameters
    ----------
    program : Program
    """

    program: Program

    @cached_property
    def _of_seams(self) -> dict[str, tuple[Plan, bool]]:
        steps = self.program.steps
        return {
            step.name: (step.made, step.turned) for step in steps if isinstance(step.made, Plan)
        }

    def plan_of(self, seam: Seam) -> tuple[Plan, bool] | None:
        """Return the plan of a seam by its name, and whether it is turned; None for none."""
        plan, turned = self._of_seams.get(seam.name, (None, False))
        return None if plan is None or (turned and not seam.either_way) else (plan, turned)

    def unchanged_plan(
        self,
        seam: Seam,
        problem: Problem,
        constraints: Sequence[Constraint],
        clearances: Sequence[Clearance],
    ) -> tuple[Plan | None, str]:
        """Return the plan of an unchanged seam, or the reason why there is none.

        It is certified anew for its `problem`, in its direction, since files of bodies may have
        changed. `constraints` and `clearances` are those of the job.
        """
        earlier_plan = self.plan_of(seam)
        if seam.name not in self._of_seams:
            return None, "the earlier program does not make it"
        if earlier_plan is None:
            return None, "it was made from its end to its start, and may not be any more"
        changed = self._changed(seam, problem.robot, constraints, clearances)
        if changed:
            return None, changed
        plan, _ = earlier_plan
        again = replace(plan, problem=replace(problem, start=plan.problem.start))
        again = replace(again, certificate=again.check())
        if again.certificate.verified:
            return again, ""
        return None, f"it is not verified any more: {again.certificate.summary}"

    def _changed(
        self,
        seam: Seam,
        robot: RobotModel,
        constraints: Sequence[Constraint],
        clearances: Sequence[Clearance],
    ) -> str:
        """Return in words what of a seam's specification has changed; "" for nothing."""
        before = self.program.specification
        if before is None:
            return "the earlier program does not say what was asked for"
        seam_before = next((item for item in before.seams if item.name == seam.name), None)
        if seam_before is None:
            return "the earlier program does not say what was asked of it"
        if before.arm != arm_digest(robot):
            return "the arm is another, or its tool, reference, limits or locked joints are"
        if Task.of(seam_before.task) is not Task.of(seam.task):
            return "its task is another"
        if not _cost_the_same(seam_before.costs, seam.costs):
            return "its costs are others"
        pairs: dict[str, tuple[Sequence[Any], Sequence[Any]]] = {
            "its path is another": ([seam_before.path], [seam.path]),
            "its tolerances are others": (seam_before.relaxations, seam.relaxations),
            "its constraints are others": (seam_before.constraints, seam.constraints),
            "the constraints of the job are others": (before.constraints, constraints),
            "what the job is kept clear of is another": (before.clearances, clearances),
        }
        for text, (some, others) in pairs.items():
            if _described(some) != _described(others):
                return text
        return ""

    def kept_seams(self, program: Program, changed: Mapping[str, str], why: str) -> dict[str, str]:
        """Return for each seam of a program "" where its motion is kept, else why it is not.

        `changed` has seams whose specification changed; `why` says what was wrong with a program
        of all unchanged motions.
        """
        kept = dict[str, str]()
        for name, plan in program.plans.items():
            plan_before, _ = self._of_seams.get(name, (None, False))
            motion = None if plan_before is None else plan_before.trajectory
            same = motion is not None and all(
                np.array_equal(getattr(motion, part), getattr(plan.trajectory, part))
                for part in ("t", "q", "qd")
            )
            reason = changed.get(name) or f"no program comes of what could be kept: {why}"
            kept[name] = "" if same else reason
        return kept

    def order_of(self, seams: Sequence[Seam]) -> list[Seam] | None:
        """Return the seams in its order, if it has the same seams and this order is allowed."""
        named, order = {seam.name: seam for seam in seams}, self.program.order
        if sorted(order) != sorted(named):
            return None
        listed = [named[name] for name in order]
        return listed if precedences(listed).keeps(range(len(listed))) else None

    def move_like(self, ends: Array) -> Move | None:
        """Return the move whose ends are nearest to others (2, n), or None for none near."""
        moves = [move for move in self.program.moves if _moves_the_arm(move)]
        far = [_distance(move.motion.q[[0, -1]], ends) for move in moves]
        k = int(np.argmin(far)) if far else -1
        return moves[k] if k >= 0 and far[k] < _NEAR else None


def _described(several: Sequence[Any]) -> str:
    """Return a digest of values."""
    return digest_of([description_of(item) for item in several])


def _cost_the_same(some: Sequence[Cost] | None, others: Sequence[Cost] | None) -> bool:
    """Whether costs are equal; functions are equal only if they are the same object."""
    if some is None or others is None:
        return some is others
    if len(some) != len(others):
        return False
    return all(
        one is other
        or (not isinstance(one, FunctionCost) and description_of(one) == description_of(other))
        for one, other in zip(some, others, strict=True)
    )


def check_earlier(earlier: object, robot: RobotModel) -> None:
    """Raise ProblemError where an earlier program is none, or one of another arm."""
    if not isinstance(earlier, Program):
        raise ProblemError(
            f"warm_start is {shown(earlier)}, expected a Program; load_program reads one"
        )
    check_joints(earlier.robot, robot)


def adapted_waypoints(motion: Trajectory, ends: Array) -> Array:
    """Return the corners (m, n) of a motion, moved so that it has other ends (2, n).

    The displacement of each end fades out towards the other one.
    """
    q = motion(np.linspace(motion.t[0], motion.t[-1], _SAMPLES))
    gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    even = np.linspace(0.0, 1.0, _SAMPLES)
    share = (gone / gone[-1] if gone[-1] > 0.0 else even)[:, None]
    points = q + (1.0 - share) * (ends[0] - q[0]) + share * (ends[1] - q[-1])
    return np.asarray(points[_corners(points, 0, _SAMPLES - 1)])


def _corners(points: Array, first: int, last: int) -> list[int]:
    """Return which of the points (m, n) a polyline needs (Ramer, Douglas and Peucker)."""
    share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    chord = points[first] + share * (points[last] - points[first])
    off = np.abs(points[first : last + 1] - chord).max(axis=1)
    k = first + int(np.argmax(off))
    if off.max() <= _STRAIGHT:
        return [first, last]
    return [*_corners(points, first, k)[:-1], *_corners(points, k, last)]


def _moves_the_arm(move: Move) -> bool:
    """Whether it is a move that was found, not a wait."""
    motion = move.trajectory
    return motion is not None and float(np.abs(motion.q[-1] - motion.q[0]).max()) > 0.0


def _distance(ends: Array, others: Array) -> float:
    """Return the distance of two pairs of ends (2, n), the sum of both [rad or m]."""
    return float(np.abs(ends - others).max(axis=1).sum())
