"""How far along a path the arm can reach at all, pose by pose."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.problem import Problem
from selfmotion.search.obstruction import cause
from selfmotion.search.settings import ABOUT, BISECTIONS, LOOKS, POSES
from selfmotion.search.single_poses import SinglePoses
from selfmotion.search.starts import start_candidates


@dataclass(frozen=True, eq=False)
class Reach:
    """How far along the path single poses can be reached at all.

    Attributes
    ----------
    time : float
        The last time up to which every pose has a configuration within the limits [s].
    starts : list of (n,)
        Configurations at the start of the path.
    reason : str
        What is beyond; "" where nothing is.
    """

    time: float
    starts: list[Array]
    reason: str


def reachable(
    problem: Problem, starts: int, rng: np.random.Generator, suspect: float = 0.0
) -> Reach:
    """Return how far single poses of the path can be reached, within the joint limits.

    With what tolerances allow. Inverse kinematics from the solutions of the pose before, and from
    elsewhere where these do not go on: a pose that nothing leads to is out of reach, as far as can
    be told. Poses all along the path, and more about the time `suspect` [s], where a motion had
    trouble.
    """
    poses = SinglePoses(problem, rng, clear=False)
    path, given = problem.path, poses.problem.given_start
    first = [given] if given is not None else start_candidates(poses.follows, starts, rng)
    about = np.clip(suspect / path.duration + np.array(ABOUT), 0.0, 1.0)
    times = path.duration * np.union1d(np.linspace(0.0, 1.0, POSES + 1), about)
    known, last = np.array(first), 0.0
    for t in times[1:]:
        found = poses.look(t, known)
        if not len(found.free):
            known, last = _edge(poses, (last, t), known)
            # From right before it, a pose that only seemed out of reach is found.
            found = poses.look(t, known)
        if not len(found.free):
            found = poses.look_closely(t, found)
        if not len(found.free):
            return Reach(last, first, _out_of_reach(poses, last, known[0], times[times > last]))
        known, last = found.free, float(t)
    return Reach(path.duration, first, "")


def _edge(poses: SinglePoses, interval: tuple[float, float], known: Array) -> tuple[Array, float]:
    """Return solutions at the last time of an interval that there are any, and this time."""
    last, beyond = interval
    for _ in range(BISECTIONS):
        middle = 0.5 * (last + beyond)
        found = poses.look(middle, known)
        if len(found.free):
            known, last = found.free, middle
        else:
            beyond = middle
    return known, last


def _out_of_reach(poses: SinglePoses, time: float, q: Array, beyond: Array) -> str:
    """Return in words that later poses are out of reach, by how much, and what the arm looks like.

    q (n,) is its configuration at `time`, the last one; `beyond` are later times.
    """
    begin = f"from t = {time:.6g} s on the pose is out of reach{cause(poses, q)}"
    if len(poses.problem.asked.follows.items) > 1:
        names = poses.follows.names
        return f"{begin}: no configuration was found that puts {names} on their paths"
    looks = beyond[np.unique(np.linspace(0, len(beyond) - 1, LOOKS).round().astype(int))]
    misses = [(*poses.nearest(float(t))[1][0], float(t)) for t in looks]
    position, rotation, when = max(misses, key=lambda miss: miss[0] + miss[1])
    turned = f" and {rotation:.2g} rad" if poses.problem.asked.task.angular else ""
    return (
        f"{begin}: the nearest configuration found misses it by up to "
        f"{1e3 * position:.3g} mm{turned}, at t = {when:.4g} s"
    )
