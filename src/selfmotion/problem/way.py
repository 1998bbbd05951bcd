"""How far a tool goes along its path."""

import numpy as np

from selfmotion.path import Path

# Samples of the way to begin with and at most; more of them would make it longer by less.
_SAMPLES, _MOST_SAMPLES, _GROWS = 101, 100_000, 1.05


def way_of(path: Path) -> float:
    """Return how far the tool goes [m], through so many points that more hardly lengthen it."""
    way, before, samples = 0.0, -1.0, _SAMPLES
    # Loops are many or few: the way through more and more points, of which none are the same.
    while way > _GROWS * before and samples < _MOST_SAMPLES:
        places = path.samples(np.linspace(0.0, path.duration, samples)).translation
        before, way = way, float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        samples = 2 * samples + 1
    return way
