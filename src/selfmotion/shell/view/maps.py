"""Redundancy maps for a page that waits for them: with as many pixels as take about a second."""

import time
from collections.abc import Iterator

import numpy as np

from selfmotion.basics import Progress
from selfmotion.planning.redundancy import PIXELS
from selfmotion.planning.result import Plan
from selfmotion.shell.replay import MAX_SEAMS, SLICES, SeamMaps, slices
from selfmotion.shell.view.requests import Outcome

# All maps of a page are made in about this time [s]; on machines that are busy it is more.
_SECONDS = 1.0
# Pixels to a side of the two maps that tell how long others take, and of the coarsest one.
_TRIED, _FEWEST = (5, 15), 15
# No pixel takes less than this [s].
_MIN_PIXEL_SECONDS = 1e-6


def maps_soon(outcome: Outcome, progress: Progress) -> Iterator[SeamMaps]:
    """Yield the maps of a plan or of the seams of a job; `progress` may leave them.

    Bodies that have to be far apart make each pixel take long: then there are fewer.
    """
    plans = [] if outcome.replayed is None else list(outcome.replayed.plans)
    if len(plans) > MAX_SEAMS:
        return
    for begin, name, plan in plans:
        side = _side(plan, _SECONDS / len(plans), progress)
        count = SLICES if side > _FEWEST else 1
        yield SeamMaps(begin, name, slices(plan, (side, side), progress, count))


def _side(plan: Plan, seconds: float, progress: Progress) -> int:
    """Return how many pixels to a side take so long."""
    took = []
    for side in _TRIED:
        began = time.perf_counter()
        plan.redundancy_map(shape=(side, side), progress=progress)
        took.append(time.perf_counter() - began)
    few, more = _TRIED
    each = max((took[1] - took[0]) / (more**2 - few**2), _MIN_PIXEL_SECONDS)
    return int(np.clip(np.sqrt(seconds / each), _FEWEST, PIXELS[0]))
