"""Active constraints, from the multipliers of conditions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.problem.constraints.conditions import BoundConstraint

# A condition is active if its multiplier is above this share of its largest one: interior points
# leave small multipliers everywhere.
_ACTIVE = 1e-3
# Number at the start of the words of a relaxation.
_SIZE = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class ActiveConstraint:
    """An active constraint: one that keeps the plan from a lower cost.

    Attributes
    ----------
    constraint : str
        Its name.
    easing : str
        A small relaxation of it in words, with the joint or the pair.
    saving : float
        Decrease of F by that relaxation, to first order: the sum of the Lagrange multipliers times
        its amount. A larger relaxation saves less than in proportion; the amount is so small that
        this is some hundredth of F at most.
    spans : tuple of (float, float)
        First and last time [s] of each interval on which it is active.
    """

    constraint: str
    easing: str
    saving: float
    spans: tuple[tuple[float, float], ...]


class Multipliers(NamedTuple):
    """Lagrange multipliers of a constraint's conditions.

    Attributes
    ----------
    item : BoundConstraint
    multipliers : (K, C)
    times : (K,)
        Times [s], increasing; a single one for a condition on the whole motion.
    used : (K, C)
        Mask of conditions without room, as far as multipliers show.
    """

    item: BoundConstraint
    multipliers: Array
    times: Array
    used: Flags


def active_of(
    each: Sequence[Multipliers], span: Array, least: float, most: float = np.inf
) -> tuple[ActiveConstraint, ...]:
    """Return the active constraints by decreasing saving, without those that save below `least`.

    `span` (2,) is the time of start and end of the motion [s]. A relaxation that would save more
    than `most` is reduced: a first derivative is not valid that far.
    """
    found: dict[tuple[str, str], tuple[float, Array, Array, Array]] = {}
    for item, signed, times, used in each:
        multipliers = np.abs(signed)
        for column in np.flatnonzero(multipliers.any(axis=0)):
            amount, words = item.easing(int(column))
            none = 0.0, np.zeros(len(multipliers)), np.zeros(len(multipliers)), times
            saving, multiplier, at, _ = found.get((item.name, words), none)
            own = multipliers[:, column]
            at = np.maximum(at, np.where(used[:, column], own, 0.0))
            found[item.name, words] = (
                *(saving + amount * float(own.sum()), np.maximum(multiplier, own)),
                *(at, times),
            )
    selected = []
    for (name, words), (saving, multiplier, at, times) in found.items():
        if saving >= least:
            active = (at if at.any() else multiplier) > _ACTIVE * multiplier.max()
            spans = _intervals(
                active if active.any() else multiplier == multiplier.max(), times, span
            )
            selected.append((saving, ActiveConstraint(name, *_eased(words, saving, most), spans)))
    return tuple(item for _, item in sorted(selected, key=lambda item: -item[0]))


def _eased(words: str, saving: float, most: float) -> tuple[str, float]:
    """Return a relaxation in words and its saving, reduced so that it saves at most `most`."""
    size = _SIZE.match(words)
    if size is None or saving <= most:
        return words, saving
    whole = float(size[0])
    reported = f"{whole * most / saving:.2g}"
    return reported + words[size.end() :], saving * float(reported) / whole


def _intervals(active: Flags, times: Array, span: Array) -> tuple[tuple[float, float], ...]:
    """Return the intervals of active times, `span` for a single one; gaps of one are closed."""
    if len(active) == 1:
        return ((float(span[0]), float(span[-1])),)
    nodes = np.flatnonzero(active)
    parts = np.split(nodes, np.flatnonzero(np.diff(nodes) > 2) + 1)
    return tuple((float(times[part[0]]), float(times[part[-1]])) for part in parts)
