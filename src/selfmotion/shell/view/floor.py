"""Where else a part or an arm could stand while it is dragged: a coarse look, without bodies."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.follow import is_plain
from selfmotion.model.path import spread_along
from selfmotion.planning.search import Manifold, spread
from selfmotion.problem.problem import Problem
from selfmotion.shell.replay import Json, Payload
from selfmotion.shell.view.handles import Handle

# Places are as far apart as this share of the arm's reach, and so many from the middle to the end.
_APART, _FAR = 1.0 / 8.0, 8
# Poses of all paths that are looked at, and of each at least.
_POSES, _FEWEST = 12, 3
# Seeds of a pose that is not reached from the motion as it is.
_SEEDS = 12
# Places that are looked at while nothing newer is asked for.
_AT_ONCE = 24
# What moves paths and the arm apart when it is dragged.
_DRAGGED = ("part", "path", "base")


class Floor:
    """Places of what is dragged, and whether all of the path is in reach there.

    They are looked at some at a time, the nearest ones first. The places stay where they are while
    it is moved to and fro.

    Parameters
    ----------
    problems : sequence of Problem
        Their paths move together.
    near : sequence of (K, n)
        Configurations near their paths, spread along them.
    handle : Handle
        What is dragged, where it is by now; see `can_move`.

    Attributes
    ----------
    places : (K, 2)
        In world axes [m].
    reached : (K,)
        Whether single poses of all paths are within the joints' limits; bodies are not looked at.
    size : float
        How far apart places are [m].
    looked : int
        At how many of them was looked; the others count as not reached.
    """

    def __init__(self, problems: Sequence[Problem], near: Sequence[Array], handle: Handle) -> None:
        self._problems, self._near = tuple(problems), tuple(near)
        robot, self.looked = problems[0].robot, 0
        # From the arm to the middle of the paths; all that is farther than it reaches is left out.
        middles = [
            problem.follows.items[0].chain.base_placement.act(_middle(problem))
            for problem in problems
        ]
        middle = np.mean(middles, axis=0)[:2]
        arm = robot.joint_poses(self._near[0][:1, : robot.dof])[0, 0, :2]
        self.size = _APART * robot.reach
        steps = self.size * np.arange(-_FAR, _FAR + 1)
        by = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
        moved = by[np.linalg.norm(by, axis=1) <= robot.reach] + arm - middle
        self._moved = moved[np.argsort(np.linalg.norm(moved, axis=1), kind="stable")]
        # The path is as far from an arm that is moved as the other way round.
        way = -1.0 if handle.kind == "base" else 1.0
        self.places = (handle.prefix * handle.pose).translation[:2] + way * self._moved
        self.reached = np.zeros(len(self.places), dtype=bool)

    @staticmethod
    def can_move(problems: Sequence[Problem], handle: Handle) -> bool:
        """Whether a handle moves paths away from the arm, or the arm from these."""
        return (
            handle.kind in _DRAGGED
            and handle.joint < 0
            and all(
                len(problem.follows.items) == 1
                and problem.follows.items[0].chain.carrier < 0
                and is_plain(problem.follows)
                for problem in problems
            )
        )

    @property
    def is_done(self) -> bool:
        """Whether all places were looked at."""
        return self.looked >= len(self.places)

    def look(self) -> None:
        """Look at some more places."""
        here = slice(self.looked, self.looked + _AT_ONCE)
        self.looked += _AT_ONCE
        moved = self._moved[here]
        reached = np.ones(len(moved), dtype=bool)
        count = max(_POSES // len(self._problems), _FEWEST)
        for problem, motion in zip(self._problems, self._near, strict=True):
            if not reached.any():
                break
            reached[reached] = _reached(problem, motion, moved[reached], count)
        self.reached[here] = reached

    def json(self, payload: Payload) -> Json:
        """Return what the page draws: the places in reach."""
        return {"places": payload.array(self.places[self.reached]), "size": self.size}


def _middle(problem: Problem) -> Array:
    """Return the mean of poses of a path (3,) [m], in its axes."""
    places = problem.path.samples(spread_along(problem.path, _POSES)).translation
    return np.asarray(places.mean(axis=0))


def _reached(problem: Problem, near: Array, by: Array, count: int) -> Flags:
    """Return at which displacements (K, 2) of a path [m] poses of it are in reach."""
    robot, follows = problem.robot, problem.follows
    times = spread_along(problem.path, count)
    rows = np.linspace(0, len(near) - 1, count).round().astype(int)
    # Along the axes in which the path is followed.
    turn = follows.items[0].chain.base_placement.rotation
    shift = np.pad(by, ((0, 0), (0, 1))) @ turn
    targets = np.repeat(follows.targets(times)[None], len(by), axis=0)
    targets[:, :, :3] += shift[:, None]
    targets = targets.reshape(len(by) * count, -1)
    manifold = Manifold(follows, robot.lower, robot.upper)
    q = np.tile(near[rows], (len(by), 1))
    _, arrived = manifold.project(q, targets, far=True)
    arrived, targets = arrived.reshape(-1, count), targets.reshape(len(by), count, -1)
    seeds = spread(follows.coordinates, _SEEDS, np.random.default_rng(0))
    reached = np.ones(len(by), dtype=bool)
    # One pose of each place after the other: most that are out of reach are so at the first.
    for _ in range(count):
        here = np.flatnonzero(reached & ~arrived.all(axis=1))
        if not len(here):
            break
        pose = np.argmin(arrived[here], axis=1)
        wanted = np.repeat(targets[here, pose], len(seeds), axis=0)
        _, found = manifold.project(np.tile(seeds, (len(here), 1)), wanted, far=True)
        arrived[here, pose] = reached[here] = found.reshape(len(here), -1).any(axis=1)
    return reached
