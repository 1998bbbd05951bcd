"""How a tool's velocity changes, and pieces of a path by which steps in time are measured."""

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.path.base import Path

# Marks nearer to each other than this share of the duration are one: times know no better.
_SAME = 1e-9
# Differences are taken over this share of the piece that a time is in, however long the path
# around it lasts: a loop is one of many, and all of them are seen.
_STEP = 2e-5
# But not over less than this share of the duration, beside which times are rounded, and never over
# more than leaves room for all that a difference takes.
_LEAST_STEP, _ROOM = 1e-8, 5.0
# Where values are taken: in steps from the middle of a difference.
_OFFSETS = np.arange(-2.0, 3.0)


def edges_of(times: Array) -> Array:
    """Return the knots or marks of a path, each once, (E,) [s]: from 0 to the duration.

    A step in time that is to see what the tool does is a share of what lies between two of them: a
    path may be a short motion beside a long wait.
    """
    times, near = np.asarray(times), _SAME * float(times[-1])
    inner = times[(times > near) & (times < times[-1] - near)]
    apart = np.append(True, np.diff(inner) > near)[: len(inner)]
    return np.concatenate([[0.0], inner[apart], times[-1:]])


def spread_along(path: Path, count: int) -> Array:
    """Return so many times at which a path is looked at, from 0 to the duration, (count,) [s].

    Half of them are spread evenly in time, and half evenly over the pieces of the path: what lasts
    a moment beside a long wait is looked at as well as the wait. Evenly in time where there is but
    one piece.
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


def _rates_within(path: Path, edges: Array, piece: Ints, t: Array) -> Array:
    """Return the rates at times t (K,) as they are within pieces (K,), (K, 6)."""
    first, last = edges[piece], edges[piece + 1]
    step = np.maximum(_STEP * (last - first), _LEAST_STEP * path.duration)
    step = np.minimum(step, (last - first) / _ROOM)
    # Half a step off the edges: an edge itself belongs to one of its pieces only.
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
            kept = np.delete(others, left)
            found[:, k] += np.prod(x[:, None] - kept, axis=1) / scale
    return found
