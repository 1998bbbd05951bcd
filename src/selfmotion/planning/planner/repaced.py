"""Problems along their path at another pace, which is as smooth as the path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from selfmotion.model.path import Path, Retimed
from selfmotion.problem.problem import Problem, along_other_paths

# Intervals of a smoothed pace.
_INTERVALS = 32
# Degree of its spline.
_DEGREE = 5

# Map of a path to another pace.
PaceMap = Callable[[Path], Path]


def same_pace(path: Path) -> Path:
    """Return a path at its own pace: itself."""
    return path


def smoothed_pace(original: Path, current: Path, fastest: Path) -> PaceMap:
    """Return the map of paths to about the pace of `fastest`, by a spline.

    The spline is as smooth as the path: its accelerations do not jump from limit to limit, as those
    of a fastest pace do.

    Parameters
    ----------
    original : Path
        The path that is mapped, or another one with the same times.
    current : Path
        The original at the present pace.
    fastest : Path
        `current` at its fastest pace, a `Retimed` path.
    """
    from scipy.interpolate import make_interp_spline

    if not isinstance(fastest, Retimed):
        raise TypeError(f"a retimed motion has a {type(fastest).__name__}")
    t = np.linspace(0.0, fastest.duration, _INTERVALS + 1)
    sigma = np.clip(fastest.pace(t), 0.0, current.duration)
    if isinstance(current, Retimed) and current is not original:
        sigma = current.pace(sigma)
    sigma = np.maximum.accumulate(sigma)
    sigma[0], sigma[-1] = 0.0, original.duration
    at_rest: Any = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(t, sigma, _DEGREE, bc_type=(at_rest, at_rest))
    rate, bend = np.maximum(spline(t, 1), 0.0), spline(t, 2)
    return lambda path: Retimed(path, t, sigma, rate, bend)


def repaced(problem: Problem, pace: PaceMap) -> Problem:
    """Return a problem along a path at another pace, with the windows of its tolerances there.

    Raises
    ------
    PathError
        The path cannot have this pace.
    """
    path = pace(problem.path)
    when = path.when if isinstance(path, Retimed) else np.asarray
    return replace(problem, **along_other_paths(problem, pace, when))
