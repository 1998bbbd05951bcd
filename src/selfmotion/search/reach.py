"""How far along a path the arm can reach at all, pose by pose."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.problem import Problem
from selfmotion.robot import RobotModel
from selfmotion.search.manifold import Manifold
from selfmotion.search.settings import (
    ABOUT,
    AT_LIMIT,
    BISECTIONS,
    BRANCHES,
    LOOKS,
    MORE_SEEDS,
    NEARLY,
    POSES,
    RESTARTS,
    SEEDS,
    STRETCHED,
)
from selfmotion.search.starts import spread, start_candidates


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

    Inverse kinematics from the solutions of the pose before, and from elsewhere where these do not
    go on: a pose that nothing leads to is out of reach, as far as can be told. Poses all along the
    path, and more about the time `suspect` [s], where a motion had trouble.
    """
    robot, path = problem.asked_envelope.arm(problem.robot), problem.path
    given = problem.given_start
    first = (
        start_candidates(problem.follows.for_robot(robot), starts, rng)
        if given is None
        else [given]
    )
    about = np.clip(suspect / path.duration + np.array(ABOUT), 0.0, 1.0)
    times = path.duration * np.union1d(np.linspace(0.0, 1.0, POSES + 1), about)
    poses = _Poses(robot, problem, rng)
    known, last = np.array(first), 0.0
    for t in times[1:]:
        found = poses.solutions(t, known)
        if not len(found):
            known, last = poses.edge((last, t), known)
            # From right before it, a pose that only seemed out of reach is found.
            found = poses.sure_solutions(t, known)
        if not len(found):
            beyond = times[times > last]
            return Reach(last, first, _out_of_reach(problem, robot, last, known[0], beyond))
        known, last = found, float(t)
    return Reach(path.duration, first, "")


class _Poses:
    """Inverse kinematics of the poses along a path."""

    def __init__(self, robot: RobotModel, problem: Problem, rng: np.random.Generator) -> None:
        self._robot, self._path, self._task, self._rng = robot, problem.path, problem.task, rng
        self._follows = problem.follows.for_robot(robot)
        self._manifold = Manifold(self._follows, robot.lower, robot.upper)
        self._seeds = np.array(list(spread(robot, SEEDS, rng)))

    def solutions(self, t: float, known: Array) -> Array:
        """Return configurations for the pose at t from those of a pose nearby, or any, (K, n)."""
        found = self._reached(t, known[:BRANCHES])
        return found if len(found) else self._reached(t, self._seeds, far=True)

    def sure_solutions(self, t: float, known: Array) -> Array:
        """Return configurations for the pose at t, also where Newton's method finds none."""
        found = self.solutions(t, known)
        if not len(found):
            seeds = np.array(list(spread(self._robot, MORE_SEEDS, self._rng)))
            found = self._reached(t, seeds, far=True)
        if len(found) or len(self._follows.items) > 1:
            return found
        try:
            q = self._robot.inverse_kinematics(
                self._path.pose(t), self._task, seed=known[0], rng=self._rng, attempts=RESTARTS
            )
        except InverseKinematicsError as error:
            # Where the arm is all but stretched, the last digits are not worth the search.
            nearly = error.position_miss + error.rotation_miss < NEARLY
            return known if nearly else np.empty((0, self._robot.dof))
        return q[None]

    def _reached(self, t: float, seeds: Array, *, far: bool = False) -> Array:
        """Return what Newton's method makes of seeds (K, n) for the pose at t, (K', n)."""
        target = self._follows.targets(np.array([t]))[0]
        found, arrived = self._manifold.project(seeds, target, far=far)
        return np.asarray(found[arrived])

    def edge(self, interval: tuple[float, float], known: Array) -> tuple[Array, float]:
        """Return solutions at the last time of an interval that there are any, and this time."""
        last, beyond = interval
        for _ in range(BISECTIONS):
            middle = 0.5 * (last + beyond)
            found = self.solutions(middle, known)
            if len(found):
                known, last = found, middle
            else:
                beyond = middle
        return known, last


def _out_of_reach(problem: Problem, robot: RobotModel, time: float, q: Array, beyond: Array) -> str:
    """Return in words that later poses are out of reach, by how much, and what the arm looks like.

    q (n,) is its configuration at `time`, the last one; `beyond` are later times.
    """
    misses = []
    for t in beyond[np.unique(np.linspace(0, len(beyond) - 1, LOOKS).round().astype(int))]:
        try:
            robot.inverse_kinematics(problem.path.pose(t), problem.task, seed=q, attempts=1)
        except InverseKinematicsError as error:
            misses.append((error.position_miss, error.rotation_miss, float(t)))
    begin = f"from t = {time:.6g} s on the pose is out of reach{_cause(problem, robot, q)}"
    if len(problem.follows.items) > 1:
        names = " and ".join(f"'{item.chain.tip_name}'" for item in problem.follows.items)
        return f"{begin}: no configuration was found that puts {names} on their paths"
    if not misses:
        return begin
    position, rotation, when = max(misses, key=lambda miss: miss[0] + miss[1])
    turned = f" and {rotation:.2g} rad" if np.any(problem.task.rows >= 3) else ""
    return (
        f"{begin}: the nearest configuration found misses it by up to "
        f"{1e3 * position:.3g} mm{turned}, at t = {when:.4g} s"
    )


def _cause(problem: Problem, robot: RobotModel, q: Array) -> str:
    """Return what keeps the arm from reaching further at q; "" where nothing shows."""
    task, causes = problem.task, []
    near = np.minimum(q - robot.lower, robot.upper - q) < AT_LIMIT
    if np.any(near):
        names = ", ".join(f"'{robot.joint_names[k]}'" for k in np.flatnonzero(near))
        causes.append(f"at its limit: joint {names}")
    here, best = (
        float(np.linalg.svd(problem.follows.jacobian(x), compute_uv=False)[-1])
        for x in (q, robot.dexterous_configuration(task))
    )
    if here < STRETCHED * best:
        causes.append(f"arm stretched or folded, smallest singular value {here:.2g}")
    return f" ({'; '.join(causes)})" if causes else ""
