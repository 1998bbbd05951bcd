"""Whether a plan is what a job of a batch asks for."""

from dataclasses import replace

from selfmotion.certificate import USUAL
from selfmotion.documents import Job
from selfmotion.path import Path as ToolPath, Retimed
from selfmotion.problem import Problem
from selfmotion.result import Asked, Plan


def is_made_for(plan: Plan, job: Job) -> bool:
    """Whether a plan is of a job's problem, judged by all that it asks within its tolerance.

    Of a fastest motion: along the same path, at whatever pace.
    """
    asked, made = job.problem, plan.problem
    tolerance = job.tolerance or USUAL
    if job.goal == "best":
        return made.digest == asked.digest and plan.tolerance == tolerance
    wanted = _at_its_own_pace(asked, asked)
    # Its certificate is of another problem then; what it was judged by is told all the same.
    alike = replace(plan, problem=_at_its_own_pace(made, asked))
    held = Asked(
        wanted.robot,
        wanted.path,
        wanted.task,
        wanted.relaxations,
        wanted.all_constraints,
        tolerance=tolerance,
        also=wanted.also,
        rest=wanted.rest and wanted.damping is None,
    )
    rows = [(item.rows, item.band, item.axes) for item in asked.relaxations]
    same = rows == [(item.rows, item.band, item.axes) for item in made.relaxations]
    return same and not list(held.failures(alike))


def _at_its_own_pace(problem: Problem, asked: Problem) -> Problem:
    """Return a problem along what its paths are made of, with the windows that were asked for."""
    return replace(problem, **problem.along(_original), relaxations=tuple(asked.relaxations))


def _original(path: ToolPath) -> ToolPath:
    while isinstance(path, Retimed):
        path = path.original
    return path
