"""What a job asks for, checked before anything is planned."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError, as_several, nearest
from selfmotion.model.collision import Obstacle
from selfmotion.planning.transfer import FreeMotions
from selfmotion.problem.constraints import Clearance, Constraint, clearances_among
from selfmotion.problem.problem import check_all_times, check_feeds, envelope_without_arm
from selfmotion.work.job.seam import Seam
from selfmotion.work.job.work import JobSettings, check_can_be_sent


def _slowest(seam: Seam) -> float:
    """Return the speed of a seam that does not keep its feed [m/s]; inf for one that does."""
    return min((found.slowest for found in seam.path.feeds if not found.kept), default=math.inf)


def checked_constraints(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints of a job; ProblemError for what only a seam can be asked for."""
    listed = as_several(constraints, "constraints", Constraint)
    check_all_times(listed, "give it to a seam that has one direction (either_way=False)")
    if clearances_among(listed):
        raise ProblemError(
            "a Clearance is among the constraints of the job; give it as clearance=, so that "
            "what seams leave behind is kept clear of as well"
        )
    return listed


def check_names(seams: Sequence[Seam], clearances: Sequence[Clearance]) -> None:
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


def check_seams(settings: JobSettings, seams: Sequence[Seam], *, sent: bool) -> None:
    """Raise FeedError for the slowest seam whose path cannot have its feed.

    Where seams are `sent` to other processes, raise ProblemError for a cost that cannot be.
    """
    for seam in sorted(seams, key=_slowest):
        kept = envelope_without_arm(settings.robot, [*settings.constraints, *seam.constraints])
        check_feeds(f"seam '{seam.name}'", [seam.path], kept.tool_speed)
    for seam in seams if sent else ():
        check_can_be_sent(seam.costs or ())


def check_ends(settings: JobSettings, ends: Sequence[Array | None]) -> None:
    """Raise ProblemError where no move may begin at the job's start, or end at its end."""
    moves = FreeMotions(settings.robot, settings.move_constraints(()), np.random.default_rng(0))
    for name, q in zip(("start", "end"), ends, strict=True):
        refused = "" if q is None else moves.refusal(q)
        if refused:
            raise ProblemError(f"{settings.robot.name}: the job's {name}: {refused}")
