"""Results of a job so far: plans and moves kept in a folder while it is planned."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    SelfmotionError,
    digest_of_file,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import (
    Move,
    Plan,
    arm_differences,
    files_of,
    key_of,
    load_move,
    load_plan,
    missing_constraints,
    read_kept,
    write_kept,
)
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import Problem

# Rounding of the end of a move [rad or m].
_JOINED = 1e-9


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
    arms : mutable mapping
        Arms that are loaded already, shared by all files; `known` of `load_plan`.
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
        """Return the stored plans of a problem, or no plan and the reason why there is none.

        None where nothing is stored, or what is stored does not hold any more.
        """
        record = _record(file)
        if record is None:
            return None
        file, stored = record
        try:
            files = _checked_archives(stored, file)
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
        for plan, archive in zip(plans, _archive_names(file, len(plans)), strict=True):
            plan.save(archive)
        _write(file, len(plans), {"reason": reason})

    def move(self, file: Path | None, wanted: Move, ends: Array) -> Move | None:
        """Return the stored move between ends (2, n), or `wanted` with the reason for none.

        None where nothing is stored, or what is stored does not hold any more.
        """
        record = _record(file)
        if record is None:
            return None
        file, stored = record
        try:
            if stored["trouble"]:
                return replace(wanted, reason=str(stored["trouble"]))
            (archive,) = _checked_archives(stored, file)
            move = load_move(archive, known=self._arms)
        except (FileFormatError, KeyError, TypeError, ValueError):
            return None
        return move if serves(move, wanted, ends) else None

    def store_move(self, file: Path | None, move: Move) -> None:
        """Store a move, or why there is none."""
        if file is None:
            return
        count = int(move.trajectory is not None)
        for archive in _archive_names(file, count):
            move.save(archive)
        _write(file, count, {"trouble": "" if count else move.trouble})


def serves(move: Move, wanted: Move, ends: Array) -> bool:
    """Whether a verified move joins ends (2, n), for arm and constraints of a `wanted` one."""
    if move.trajectory is None or any(arm_differences(move.robot, wanted.robot)):
        return False
    if float(np.abs(move.motion.q[[0, -1]] - ends).max()) > _JOINED:
        return False
    return move.verified and not any(missing_constraints(move.constraints, wanted.constraints))


def _record(file: Path | None) -> tuple[Path, Mapping[str, Any]] | None:
    """Return the file of a task and what it says; None where nothing is stored."""
    stored = None if file is None else read_kept(file)
    return None if file is None or stored is None else (file, stored)


def _archive_names(file: Path, count: int) -> list[Path]:
    """Return the files of the plans or moves of one task."""
    return [file.with_suffix(f".{number}.npz") for number in range(count)]


def _write(file: Path, count: int, values: Mapping[str, Any]) -> None:
    """Write the record of a result, last, with the digest of each of its archives."""
    digests = [digest_of_file(archive) for archive in _archive_names(file, count)]
    write_kept(file, {"digests": digests, **values})


def _checked_archives(stored: Mapping[str, Any], file: Path) -> list[Path]:
    """Return the archives that were written with a record.

    Digests are compared: an archive that was exchanged for another one would be sound as well.
    """
    digests = list(stored["digests"])
    archives = _archive_names(file, len(digests))
    for archive, digest in zip(archives, digests, strict=True):
        if digest_of_file(archive) != digest:
            raise FileFormatError(f"{archive}: is not the one that was written with {file.name}")
    return archives
