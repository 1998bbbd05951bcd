"""Where to put the part, or the arm: the place whose motions cost least."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    DeadlineError,
    PlanError,
    ProblemError,
    Progress,
    as_called,
    as_choice,
    as_numbers,
    as_several,
    check_executor,
    nearest,
    shown,
    silent,
)
from selfmotion.planning.planner import Deadline, PlanRequest
from selfmotion.problem.problem import Problem
from selfmotion.work.batch import Item
from selfmotion.work.placement.places import (
    COORDINATES,
    Places,
    Tried,
    described,
    places_of,
    restored,
)
from selfmotion.work.placement.results import Placement, flat_along, on_bounds
from selfmotion.work.placement.search import Box, Descent, best_place

# Places that this process was sent before, by their description.
_sent: dict[str, Places] = {}


def place(
    problems: Problem | Sequence[Problem],
    within: Mapping[str, npt.ArrayLike],
    *,
    of: str = "part",
    part: Sequence[str] | None = None,
    center: npt.ArrayLike | None = None,
    executor: Executor | None = None,
    deadline: float | None = None,
    progress: Progress = silent,
) -> Placement:
    """Look for the place of the part, or of the arm's base, at which the motions cost least.

    Places all over the box are planned; from the best ones the cost goes downhill by BFGS, with
    motions that begin as those of the place before. The costs of several problems are added up; a
    place counts only where all of their motions are verified. The motions may begin anywhere: a
    start that is given holds for one place alone.

    Parameters
    ----------
    problems : Problem or sequence of Problem
        One or several seams, of one arm.
    within : dict
        Coordinate → its lowest and highest value, how far to move from where it stands: x, y, z
        [m] in world axes, roll, pitch, yaw [rad] as URDFs have them. Others stay.
    of : {"part", "base"}
        What moves: the paths and the obstacles of the part; or the arm.
    part : sequence of str, optional
        The obstacles that belong to the part and move along; required where some stand in the
        world, () for none.
    center : (3,), optional
        What is turned about, in world axes [m]; by default the middle of all paths, or the arm's
        base.
    executor : concurrent.futures.Executor, optional
        Where to plan: processes of this machine, or ``distributed.Client(…).get_executor()``. By
        default in this process.
    deadline : float, optional
        Time by the clock after which the best place so far is the result [s]; looked at after each
        place, in other processes after several.
    progress : callable, optional
        Called with ``("places", done, 0)``.

    Returns
    -------
    Placement

    Raises
    ------
    DeadlineError
        The deadline came before there was a place with verified motions.
    PlanError
        No place that was tried has verified motions; says what stands against the one where it is,
        or another.
    ProblemError
        An argument is not what it should be, or a path is given in a frame that moves.
    KeyboardInterrupt
        It was interrupted.
    """
    several = as_several(problems, "problems", Problem)
    if not several:
        raise ProblemError("place: problems is empty, expected one or several")
    as_choice(of, "place: of", ("part", "base"))
    check_executor(executor)
    as_called(progress, "progress")
    names, box = _box(within)
    about = None if center is None else as_numbers(center, "place: center", "(3,) [m]", (3,))
    listed = None if part is None else _names(part)
    places = places_of(several, of, listed, about, names)
    clock = Deadline.after(deadline)
    told = clock.checked_by(progress)
    run = _Here(places, box, told) if executor is None else _There(places, box, executor, told)
    # The present place is planned thoroughly: its cost is reported.
    here = np.zeros(len(names))
    begun = [places.tried(here, thorough=True)] if box.holds(here) else []
    try:
        best, tried = best_place(places, box, run.every, run.near, run.descents, begun)
    except KeyboardInterrupt:
        if not clock.passed:
            raise
        tried = [*begun, *run.tried]
        best = _best_so_far(tried, deadline)
    if not np.isfinite(best.cost):
        raise PlanError(
            f"place: no verified motion at any of {len(tried)} places that were tried; at "
            f"{_told(names, tried[0].place)}: {tried[0].reason}; widen the box, or ask less"
        )
    best = _planned(places, best)
    plans = best.plans
    return Placement(
        of,
        dict(zip(names, best.place.tolist(), strict=True)),
        places.displacement(best.place),
        tuple(item.problem for item in plans),
        plans,
        sum(item.report.cost for item in plans),
        min((item.cost for item in tried if not item.place.any()), default=np.nan),
        on_bounds(places, box, best.place),
        tuple(replace(item, plans=()) for item in tried),
        places,
        box,
        best,
        flat_along(places, box, best),
    )


def _best_so_far(tried: Sequence[Tried], deadline: float | None) -> Tried:
    """Return the cheapest place with verified motions when a deadline came; or DeadlineError."""
    sound = [item for item in tried if np.isfinite(item.cost)]
    if not sound:
        raise DeadlineError(
            f"place: the deadline of {deadline} s came before there was a verified motion at "
            f"any of {len(tried)} places; allow more time, or ask less"
        ) from None
    return min(sound, key=lambda item: item.cost)


def _planned(places: Places, best: Tried) -> Tried:
    """Return a place with its plans, which may have been made elsewhere."""
    if best.plans:
        return best
    best_tried = places.tried(best.place, thorough=True)
    if not np.isfinite(best_tried.cost):
        raise PlanError(f"place: the best place is not verified here: {best_tried.reason}")
    return best_tried


def _box(within: Any) -> tuple[tuple[str, ...], Box]:
    if not isinstance(within, Mapping) or not within:
        raise ProblemError(
            f"place: within is {shown(within)}, expected lowest and highest value of some of "
            f"{', '.join(COORDINATES)}: within={{'x': (-0.2, 0.2)}} (--within x=-0.2,0.2)"
        )
    for name in within:
        if name not in COORDINATES:
            raise ProblemError(
                f"place: within: there is no coordinate {shown(name)}"
                f"{nearest(str(name), COORDINATES)}; expected {', '.join(COORDINATES)}"
            )
    names = tuple(name for name in COORDINATES if name in within)
    ends = np.array(
        [as_numbers(within[name], f"place: within: {name}", "(2,)", (2,)) for name in names]
    )
    for name, (low, high) in zip(names, ends.tolist(), strict=True):
        if not low < high:
            raise ProblemError(f"place: within: {name} is from {low:g} to {high:g}: nothing varies")
    return names, Box(ends[:, 0], ends[:, 1])


def _names(part: Any) -> tuple[str, ...]:
    if isinstance(part, str) or not all(isinstance(name, str) for name in part):
        raise ProblemError(f"place: part is {shown(part)}, expected names of obstacles")
    return tuple(part)


def _told(names: Sequence[str], place: Array) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in zip(names, place, strict=True))


class _Here:
    """Plans in this process."""

    def __init__(self, places: Places, box: Box, progress: Progress) -> None:
        self._places, self._box, self._progress = places, box, progress
        self.tried = list[Tried]()

    def _tell(self, place: Tried) -> None:
        self.tried.append(place)
        self._progress("places", len(self.tried), 0)

    def every(self, wanted: Sequence[Array]) -> list[Tried]:
        """Plan at places, each on its own."""
        tried = []
        for each in wanted:
            tried.append(self._places.tried(each))
            self._tell(tried[-1])
        return tried

    def near(self, wanted: Sequence[tuple[Array, Tried]]) -> list[Tried]:
        """Plan at places, each from the motions of another one."""
        tried = []
        for each, other in wanted:
            tried.append(self._places.tried(each, other.plans))
            self._tell(tried[-1])
        return tried

    def descents(self, begun: Sequence[Tried]) -> list[tuple[Tried, list[Tried]]]:
        """Go downhill from places."""
        tried = []
        for each in begun:
            descent = Descent(self._places, self._box, self._tell)
            tried.append((descent.run(each), descent.tried))
        return tried


class _There:
    """Plans in other processes."""

    def __init__(self, places: Places, box: Box, executor: Executor, progress: Progress) -> None:
        items = [Item("place", lambda p=item: PlanRequest(p)) for item in places.problems]  # type: ignore[misc]
        descriptions = [item.description for item in items]
        sent = described(places, [each["problem"] for each in descriptions])
        self._modules = sorted({name for each in descriptions for name in each["modules"]})
        self._sent, self._box, self._executor = json.dumps(sent), box, executor
        self._progress = progress
        self.tried = list[Tried]()

    def _known(self, tried: list[Tried]) -> list[Tried]:
        self.tried += tried
        self._progress("places", len(self.tried), 0)
        return tried

    def every(self, wanted: Sequence[Array]) -> list[Tried]:
        """Plan at places, each on its own."""
        jobs = [
            self._executor.submit(_try_there, self._sent, self._modules, each) for each in wanted
        ]
        return self._known([job.result() for job in jobs])

    def near(self, wanted: Sequence[tuple[Array, Tried]]) -> list[Tried]:
        """Plan at places, each from the motions of another one."""
        jobs = [
            self._executor.submit(_try_near, self._sent, self._modules, each, other.place)
            for each, other in wanted
        ]
        return self._known([job.result() for job in jobs])

    def descents(self, begun: Sequence[Tried]) -> list[tuple[Tried, list[Tried]]]:
        """Go downhill from places."""
        jobs = [
            self._executor.submit(
                _descend_there, self._sent, self._modules, self._box.low, self._box.high, each.place
            )
            for each in begun
        ]
        return [job.result() for job in jobs]


def _received(sent: str, modules: Sequence[str]) -> Places:
    import importlib

    for name in modules:
        importlib.import_module(name)
    if sent not in _sent:
        _sent.clear()
        _sent[sent] = restored(json.loads(sent), {})
    return _sent[sent]


def _try_there(sent: str, modules: Sequence[str], at: Array) -> Tried:
    """Plan at a place in another process; its plans stay there."""
    return replace(_received(sent, modules).tried(at), plans=())


def _try_near(sent: str, modules: Sequence[str], at: Array, other: Array) -> Tried:
    """Plan at a place in another process, from the motions of another place."""
    places = _received(sent, modules)
    near = places.tried(other)
    tried = places.tried(at, near.plans) if near.plans else near
    return replace(tried, place=at, plans=())


def _descend_there(
    sent: str, modules: Sequence[str], low: Array, high: Array, at: Array
) -> tuple[Tried, list[Tried]]:
    """Go downhill from a place in another process."""
    places = _received(sent, modules)
    descent = Descent(places, Box(low, high), silent_of)
    begun = places.tried(at)
    if not np.isfinite(begun.cost):
        return replace(begun, plans=()), []
    return replace(descent.run(begun), plans=()), descent.tried


def silent_of(_: Tried) -> None:
    """Say nothing of a place."""
