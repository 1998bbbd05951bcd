"""Rates of a tool's velocity by differences, with steps by intervals of the path."""

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.path.base import Path

# Marks nearer to each other than this share of the duration are merged: rounding of times.
_SAME = 1e-9
# Step of differences, as a share of the interval that a time is in: a loop is one of many, and each
# is resolved.
_STEP = 2e-5
# Smallest step, as a share of the duration: times are rounded.
_MIN_STEP = 1e-8
# Steps that have to fit into an interval.
_ROOM = 5.0
# Offsets of a difference's samples from its middle, in steps.
_OFFSETS = np.arange(-2.0, 3.0)


def edges_of(times: Array) -> Array:
    """Return the knots or marks of a path, each once, (E,) [s]: from 0 to the duration.

    Steps in time for the tool's motion are shares of the distance of two of them: a path may be a
    short motion next to a long wait.
    """
    times, near = np.asarray(times), _SAME * float(times[-1])
    inner = times[(times > near) & (times < times[-1] - near)]
    distinct = np.append(True, np.diff(inner) > near)[: len(inner)]
    return np.concatenate([[0.0], inner[distinct], times[-1:]])


def spread_along(path: Path, count: int) -> Array:
    """Return `count` sample times of a path, from 0 to the duration, (count,) [s].

    Half of them are spread evenly in time, and half evenly over the intervals of the path: a short
    motion is resolved next to a long wait. Evenly in time for a single interval.
    """
    edges = edges_of(path.marks)
    share = edges / path.duration + np.linspace(0.0, 1.0, len(edges))
    times = np.interp(np.linspace(0.0, 2.0, count), share, edges)
    times[-1] = path.duration
    return np.asarray(times)


def twist_rates(path: Path, t: Array) -> Array:
    """Return the rates of a path's twists at times t (K,), (K, 6) [m/s², rad/s²].

    At each time the derivative of the polynomial of degree 4 through five twists beside it, within
    its piece of the path. Where pieces meet, rates may jump: there, they are the means of both
    sides.
    """
    edges, near = edges_of(path.marks), _SAME * path.duration
    most = len(edges) - 2
    before = np.clip(np.searchsorted(edges, t - near) - 1, 0, most)
    after = np.clip(np.searchsorted(edges, t + near, side="right") - 1, 0, most)
    two = np.flatnonzero(before < after)
    found = _rates_within(path, edges, np.append(after, before[two]), np.append(t, t[two]))
    rates = found[: len(t)]
    rates[two] = 0.5 * (rates[two] + found[len(t) :])
    return rates


def _rates_within(path: Path, edges: Array, interval: Ints, t: Array) -> Array:
    """Return the rates at times t (K,) as they are within pieces (K,), (K, 6)."""
    first, last = edges[interval], edges[interval + 1]
    step = np.maximum(_STEP * (last - first), _MIN_STEP * path.duration)
    step = np.minimum(step, (last - first) / _ROOM)
    # Half a step off the edges: an edge belongs to one interval only.
    middle = np.clip(t, first + 2.5 * step, last - 2.5 * step)
    times = middle[:, None] + step[:, None] * _OFFSETS
    twists = path.samples(np.clip(times.ravel(), 0.0, path.duration)).twist
    weights = _slopes((t - middle) / step) / step[:, None]
    return np.asarray(np.einsum("kp,kpc->kc", weights, twists.reshape(*times.shape, -1)))


def _slopes(x: Array) -> Array:
    """Return the weights of values at the offsets in their polynomial's derivative at x, (K, 5).

    The derivatives of Lagrange's polynomials.
    """
    found = np.zeros((len(x), len(_OFFSETS)))
    for k, own in enumerate(_OFFSETS):
        others = np.delete(_OFFSETS, k)
        scale = np.prod(own - others)
        for left in range(len(others)):
            selected = np.delete(others, left)
            found[:, k] += np.prod(x[:, None] - selected, axis=1) / scale
    return found
