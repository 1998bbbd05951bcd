"""Runs the study, part by part."""

import time
from collections.abc import Callable

from selfmotion.paper.study import claims, expense, other_works, questions, trajectory
from selfmotion.paper.study.context import Context, Scale
from selfmotion.paper.study.results import Chapter, Study

_PARTS: dict[str, Callable[[Context], Chapter]] = {
    "sample trajectory": trajectory.chapter,
    "claims": claims.chapter,
    "surging": questions.surging,
    "cost of the method": expense.chapter,
    "open questions": questions.chapter,
    "other works": other_works.other_works,
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
        Called with the name of each part (see `PARTS`) at its start.

    Returns
    -------
    Study
    """
    began = time.perf_counter()
    scale = scale or Scale.full()
    context = Context(scale)
    chapters = []
    for name, part in _PARTS.items():
        if progress is not None:
            progress(name)
        chapters.append(part(context))
    return Study(tuple(chapters), time.perf_counter() - began, scale.name)
