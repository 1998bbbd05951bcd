"""Active constraints, from the multipliers of conditions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints.conditions import BoundConstraint, easing_of

# A condition is active where its multiplier is above this share of its largest one: interior points
# leave a little everywhere.
_ACTIVE = 1e-3


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
        What that relaxation would take off F, to first order: the sum of the Lagrange multipliers
        times its amount.
    spans : tuple of (float, float)
        First and last time [s] of each stretch on which it is active.
    """

    constraint: str
    easing: str
    saving: float
    spans: tuple[tuple[float, float], ...]


class Multipliers(NamedTuple):
    """What the conditions of a constraint cost.

    Attributes
    ----------
    item : BoundConstraint
    multipliers : (K, C)
    times : (K,)
        When [s], increasing; one for what is asked of the whole motion.
    used : (K, C)
        Where what is asked for is used up, as far as multipliers say.
    """

    item: BoundConstraint
    multipliers: Array
    times: Array
    used: Flags


def active_of(
    each: Sequence[Multipliers], span: Array, least: float
) -> tuple[ActiveConstraint, ...]:
    """Return what is active, what saves most first; what would save less than `least` is left out.

    `span` (2,) is when the motion begins and ends [s].
    """
    found: dict[tuple[str, str], tuple[float, Array, Array, Array]] = {}
    for item, signed, times, used in each:
        multipliers = np.abs(signed)
        for column in np.flatnonzero(multipliers.any(axis=0)):
            amount, words = easing_of(item, int(column))
            none = 0.0, np.zeros(len(multipliers)), np.zeros(len(multipliers)), times
            saving, multiplier, at, _ = found.get((item.name, words), none)
            own = multipliers[:, column]
            at = np.maximum(at, np.where(used[:, column], own, 0.0))
            found[item.name, words] = (
                *(saving + amount * float(own.sum()), np.maximum(multiplier, own)),
                *(at, times),
            )
    kept = []
    for (name, words), (saving, multiplier, at, times) in found.items():
        if saving >= least:
            active = (at if at.any() else multiplier) > _ACTIVE * multiplier.max()
            spans = _spans(active if active.any() else multiplier == multiplier.max(), times, span)
            kept.append(ActiveConstraint(name, words, saving, spans))
    return tuple(sorted(kept, key=lambda item: -item.saving))


def _spans(active: Flags, times: Array, span: Array) -> tuple[tuple[float, float], ...]:
    """Return the stretches of active times, `span` of one; one free time between is none."""
    if len(active) == 1:
        return ((float(span[0]), float(span[-1])),)
    nodes = np.flatnonzero(active)
    parts = np.split(nodes, np.flatnonzero(np.diff(nodes) > 2) + 1)
    return tuple((float(times[part[0]]), float(times[part[-1]])) for part in parts)
