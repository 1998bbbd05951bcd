"""Functions of time that bring a null motion to rest where a motion begins and ends."""

import numpy as np

from selfmotion.basics import Array

# A null motion that was found by a search fades in this share of the duration.
_FADE = 0.05


def resting_window(t: Array, duration: float, orders: tuple[int, int]) -> Array:
    """Return w(t) = c s^a (1 - s)^b with s = t / duration, (S,): at most 1.

    Where a null motion is multiplied by it, that comes to rest at the start with its first a - 1
    derivatives, and at the end with its first b - 1; `orders` are a and b.
    """
    a, b = orders
    s = np.asarray(t) / duration
    most = a**a * b**b / float((a + b) ** (a + b))
    return np.asarray(s**a * (1.0 - s) ** b / most)


def fading_window(t: Array, duration: float, ends: tuple[bool, bool]) -> Array:
    """Return w(t), (S,): 1, except near those `ends` where it falls smoothly to 0."""
    s = np.asarray(t) / duration
    start, end = (_fade(x) if falls else 1.0 for x, falls in zip((s, 1.0 - s), ends, strict=True))
    return np.asarray(np.ones(len(s)) * start * end)


def _fade(s: Array) -> Array:
    """Return a function of s (S,) that rises smoothly from 0 to 1 and stays there."""
    u = np.minimum(s / _FADE, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))
