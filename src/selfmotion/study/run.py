"""Runs the study, part by part."""

import time
from collections.abc import Callable

from selfmotion.study import (
    claims,
    comparison,
    expense,
    questions,
    surging,
    trajectory,
)
from selfmotion.study.context import Context
from selfmotion.study.engine import Scale
from selfmotion.study.results import Section, Study

_PARTS: dict[str, Callable[[Context], Section]] = {
    "sample trajectory": trajectory.section,
    "claims": claims.section,
    "surging": surging.section,
    "cost of the method": expense.section,
    "open questions": questions.section,
    "other works": comparison.section,
}

# Part names in order, for a progress bar.
PARTS = tuple(_PARTS)


def run(scale: Scale | None = None, progress: Callable[[str], None] | None = None) -> Study:
    """Run the study.

    Parameters
    ----------
    scale : Scale, optional
        ``Scale.full()`` by default: minutes.
    progress : callable, optional
        Called with the name of each part (see `PARTS`) as it begins.

    Returns
    -------
    Study
    """
    began = time.perf_counter()
    scale = scale or Scale.full()
    context = Context(scale)
    sections = []
    for name, part in _PARTS.items():
        if progress is not None:
            progress(name)
        sections.append(part(context))
    return Study(tuple(sections), time.perf_counter() - began, scale.name)
