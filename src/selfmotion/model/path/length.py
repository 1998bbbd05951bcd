"""Length of a path."""

import numpy as np

from selfmotion.model.path.base import Path
from selfmotion.model.path.rates import spread_along

# First number of samples.
_SAMPLES = 101
# Largest number of samples.
_MAX_SAMPLES = 100_000
# Ratio of successive lengths below which the length has converged.
_CONVERGED_RATIO = 1.05


def path_length(path: Path) -> float:
    """Return the path length of the tool [m], by samples that are refined until it converges."""
    length, previous, samples = 0.0, -1.0, _SAMPLES
    while length > _CONVERGED_RATIO * previous and samples < _MAX_SAMPLES:
        positions = path.samples(spread_along(path, samples)).translation
        previous = length
        length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
        # N and 2N + 1 samples share hardly any times: a loop that one grid misses, the next sees.
        samples = 2 * samples + 1
    return length
