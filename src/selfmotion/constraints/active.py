"""What binds, from the multipliers of conditions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints.active_constraint import ActiveConstraint
from selfmotion.constraints.conditions import BoundConstraint, easing_of

# A condition binds where its price is above this share of what it is at most: interior points leave
# a little everywhere.
_BINDS = 1e-3


class Priced(NamedTuple):
    """What the conditions of a constraint cost.

    Attributes
    ----------
    item : BoundConstraint
    prices : (K, C)
    times : (K,)
        When [s], increasing; one for what is asked of the whole motion.
    used : (K, C)
        Where what is asked for is used up, as far as prices say.
    """

    item: BoundConstraint
    prices: Array
    times: Array
    used: Flags


def active_of(each: Sequence[Priced], span: Array, least: float) -> tuple[ActiveConstraint, ...]:
    """Return what binds, the most expensive first; what would save less than `least` is left out.

    `span` (2,) is when the motion begins and ends [s].
    """
    found: dict[tuple[str, str], tuple[float, Array, Array, Array]] = {}
    for item, signed, times, used in each:
        prices = np.abs(signed)
        for column in np.flatnonzero(prices.any(axis=0)):
            amount, words = easing_of(item, int(column))
            none = 0.0, np.zeros(len(prices)), np.zeros(len(prices)), times
            saving, price, at, _ = found.get((item.name, words), none)
            own = prices[:, column]
            at = np.maximum(at, np.where(used[:, column], own, 0.0))
            found[item.name, words] = (
                *(saving + amount * float(own.sum()), np.maximum(price, own)),
                *(at, times),
            )
    kept = []
    for (name, words), (saving, price, at, times) in found.items():
        if saving >= least:
            binds = (at if at.any() else price) > _BINDS * price.max()
            spans = _spans(binds if binds.any() else price == price.max(), times, span)
            kept.append(ActiveConstraint(name, words, saving, spans))
    return tuple(sorted(kept, key=lambda item: -item.saving))


def _spans(binds: Flags, times: Array, span: Array) -> tuple[tuple[float, float], ...]:
    """Return the stretches of times that bind, `span` of one; one free time between is none."""
    if len(binds) == 1:
        return ((float(span[0]), float(span[-1])),)
    nodes = np.flatnonzero(binds)
    parts = np.split(nodes, np.flatnonzero(np.diff(nodes) > 2) + 1)
    return tuple((float(times[part[0]]), float(times[part[-1]])) for part in parts)
