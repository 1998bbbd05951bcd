"""What keeps every motion from following a path: a pose that the arm cannot be at."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.collision import how_near
from selfmotion.problem import Problem
from selfmotion.search.remedies import remedies
from selfmotion.search.settings import AT_LIMIT, COARSE_POSES, MOST_LOOKED_AT, STRETCHED
from selfmotion.search.single_poses import Found, SinglePoses


@dataclass(frozen=True, eq=False)
class Obstruction:
    """A pose of a path at which no configuration was found.

    Attributes
    ----------
    time : float
        When [s].
    is_met : bool
        Whether the pose is in reach, but for bodies that are met.
    poses : SinglePoses
        What looked for it.
    found : Found
        What there is at the pose.
    times : (K,)
        When to look again, if something is changed, this time first [s].
    """

    time: float
    is_met: bool
    poses: SinglePoses
    found: Found
    times: Array

    @cached_property
    def _nearest(self) -> tuple[Array, Array]:
        return self.poses.nearest(self.time)

    @property
    def misses(self) -> tuple[float, float]:
        """What the nearest configuration misses the pose by, (m, rad)."""
        position, rotation = self._nearest[1][0]
        return float(position), float(rotation)

    @property
    def reason(self) -> str:
        """What is in the way at that pose, and how closely it was looked at."""
        poses, found = self.poses, self.found
        name = poses.robot.tool
        if self.is_met:
            return (
                f"each configuration that was found to put '{name}' there, from {found.tries} "
                f"tries, meets something: {_roomiest(poses, found.met)}"
            )
        q, _ = self._nearest
        position, rotation = self.misses
        turned = f" and {rotation:.2g} rad" if poses.problem.asked.task.angular else ""
        return (
            f"none was found that puts '{name}' there, from {found.tries} tries"
            f"{cause(poses, q[0])}: the nearest misses it by {1e3 * position:.3g} mm{turned}"
        )

    @cached_property
    def help(self) -> str:
        """What would help, each by itself; "" for nothing that is known."""
        found = remedies(self.poses, self.time, self.times)
        return f"; what would help: {', or '.join(found)}" if found else ""


def _roomiest(poses: SinglePoses, met: Array) -> str:
    """Return what is met at the configuration (of K, n) that bodies are least near to."""
    # The last ones were moved aside from what they met.
    _, worst, asked = max((poses.room(q) for q in met[-MOST_LOOKED_AT:]), key=lambda each: each[0])
    return (
        f"at best '{worst.first}' and '{worst.second}' {how_near(worst.value)} (wanted: "
        f"{1e3 * asked:.3g} mm)"
    )


def obstruction(problem: Problem, rng: np.random.Generator) -> Obstruction | None:
    """Return a pose of the path that no configuration was found for; None where there is none.

    Poses all along the path, the first, then those that are farthest from the others. A
    pose is given up when thousands of tries lead nowhere: Newton's method from all over the
    limits, and of the bands of tolerances; where self-motions are curves, these as a whole; and
    what met bodies least, moved aside.
    """
    poses = SinglePoses(problem, rng)
    times = np.linspace(0.0, problem.path.duration, COARSE_POSES)
    known: dict[float, Array] = {}
    order = _worst_first(problem, times)
    for t in order:
        near = min(known, key=lambda other: abs(other - t), default=None)
        found = poses.look(t, np.empty((0, poses.robot.dof)) if near is None else known[near])
        if not len(found.free):
            found = poses.look_closely(t, found)
        if not len(found.free):
            again = np.array([t, *(other for other in order if other != t)])
            return Obstruction(t, len(found.met) > 0, poses, found, again)
        known[t] = found.free
    return None


def _worst_first(problem: Problem, times: Array) -> list[float]:
    """Return times [s], after the first of the poses farthest from the middle of all.

    Where the path cannot be begun, no part of it can be planned; else, what is too far, too near or
    in the way is mostly so at an end.
    """
    places = problem.path.samples(times).translation
    away = np.linalg.norm(places - places.mean(axis=0), axis=1)
    away[0] = np.inf
    return [float(t) for t in times[np.argsort(-away, kind="stable")]]


def cause(poses: SinglePoses, q: Array) -> str:
    """Return what keeps the arm from reaching further at q (n,); "" where nothing shows."""
    robot, follows, causes = poses.robot, poses.follows, []
    near = np.minimum(q - robot.lower, robot.upper - q)[: poses.problem.asked.robot.dof] < AT_LIMIT
    if np.any(near):
        names = ", ".join(f"'{robot.joint_names[k]}'" for k in np.flatnonzero(near))
        causes.append(f"at its limit: joint {names}")
    best = robot.dexterous_configuration(poses.problem.asked.task)
    here, there = (
        float(np.linalg.svd(follows.jacobian(x), compute_uv=False)[-1]) for x in (q, best)
    )
    if here < STRETCHED * there:
        causes.append(f"arm stretched or folded, smallest singular value {here:.2g}")
    return f" ({'; '.join(causes)})" if causes else ""
