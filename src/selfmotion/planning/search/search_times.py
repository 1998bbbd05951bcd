"""Times along a path at which the global search looks for configurations."""

from itertools import pairwise

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import has_windows
from selfmotion.model.path import Path, spread_along
from selfmotion.model.task import log3
from selfmotion.planning.formulation import Formulation

# Largest translation of the tool between two times [m], whatever the path's own waypoints: more
# times take longer, and chains are smoothed anyway …
STRIDE = 0.02
# … and its largest rotation [rad]; of translation and rotation, shares of these add up.
_TURN = 0.1
# Smallest number of times with self-motion curves, which resolve more than samples of larger
# spaces …
_MIN_TIMES_ON_CURVES = 150
# … and without: fewer would miss obstacles.
_MIN_TIMES = 60
# Largest number of times.
_MAX_TIMES = 400
# Samples of the path for the length of the tool's motion.
_PATH_SAMPLES = 2000
# What the whole duration counts, in strides, as a share of their number: so that times increase
# where the tool rests.
_REST_SHARE = 1e-3


def waypoint_times(formulation: Formulation) -> Array:
    """Return times (W,) [s] at which to search for a problem's configurations."""
    fewest = _MIN_TIMES_ON_CURVES if has_curves(formulation) else _MIN_TIMES
    return search_times(formulation.path, fewest)


def has_curves(formulation: Formulation) -> bool:
    """Whether the self-motions of a problem are curves, at all times."""
    return formulation.follows.redundancy == 1 and not has_windows(formulation.follows)


def search_times(path: Path, fewest: int) -> Array:
    """Return times (W,) [s] between which the tool moves about equally far.

    There are at least `fewest` intervals between them, and more where strides would be too long.
    """
    t = spread_along(path, _PATH_SAMPLES)
    tool = path.samples(t)
    moved = np.linalg.norm(np.diff(tool.translation, axis=0), axis=1) / STRIDE
    turned = np.array([np.linalg.norm(log3(a.T @ b)) for a, b in pairwise(tool.rotation)])
    strides = np.concatenate([[0.0], np.cumsum(moved + turned / _TURN)])
    count = int(np.clip(np.ceil(strides[-1]), fewest, _MAX_TIMES))
    strides += t * (_REST_SHARE * count / path.duration)
    times = np.interp(np.linspace(0.0, strides[-1], count + 1), strides, t)
    times[-1] = path.duration
    return np.asarray(times)
