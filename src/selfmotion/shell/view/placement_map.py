"""Placement map: where a dragged part or base may stand so that all paths are within reach.

Collisions are ignored.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.follow import is_plain
from selfmotion.model.path import spread_along
from selfmotion.planning.search import Manifold, spread
from selfmotion.problem.problem import Problem
from selfmotion.shell.replay import Json, Payload
from selfmotion.shell.view.handles import Handle

# Distance between positions, as a share of the arm's reach.
_SPACING = 1.0 / 8.0
# Positions from the centre of the map to its edge: one reach.
_HALF_WIDTH = 8
# Poses of all paths that are tested together.
_POSES = 12
# Smallest number of poses tested of each path.
_MIN_POSES = 3
# Seeds of inverse kinematics where it fails from the present motion.
_SEEDS = 12
# Positions per batch: after one, a newer request is looked for.
_BATCH = 24
# Handles that move the paths relative to the arm.
_DRAGGED = ("part", "path", "base")


class PlacementMap:
    """Reachability of paths at a square grid of positions of a dragged part or base.

    Positions are tested in batches, the nearest first. The grid stays where it is in the world
    while the handle moves.

    Parameters
    ----------
    problems : sequence of Problem
        Their paths move together.
    motions : sequence of (K, n)
        Configurations along the present motion of each problem.
    handle : Handle
        What is dragged, at its present pose; see `can_move`.

    Attributes
    ----------
    positions : (K, 2)
        Of the handle, in world axes [m].
    is_reachable : (K,)
        Whether all tested poses are within joint limits; False before a test.
    spacing : float
        Distance between neighbouring positions [m].
    tested : int
        Number of positions tested.
    """

    def __init__(
        self, problems: Sequence[Problem], motions: Sequence[Array], handle: Handle
    ) -> None:
        self._problems, self._motions = tuple(problems), tuple(motions)
        self.spacing, self.tested = _SPACING * problems[0].robot.reach, 0
        self._displacements = _displacements(problems, self._motions[0], self.spacing)
        # A displacement of the base is the opposite displacement of the paths.
        sign = -1.0 if handle.kind == "base" else 1.0
        position = (handle.prefix * handle.pose).translation[:2]
        self.positions = position + sign * self._displacements
        self.is_reachable = np.zeros(len(self.positions), dtype=bool)

    @staticmethod
    def can_move(problems: Sequence[Problem], handle: Handle) -> bool:
        """Whether a handle moves the paths relative to the arm."""
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
        """Whether all positions are tested."""
        return self.tested >= len(self.positions)

    def test_next(self) -> None:
        """Test the next batch of positions."""
        batch = slice(self.tested, self.tested + _BATCH)
        self.tested += _BATCH
        displacements = self._displacements[batch]
        reachable = np.ones(len(displacements), dtype=bool)
        count = max(_POSES // len(self._problems), _MIN_POSES)
        for problem, motion in zip(self._problems, self._motions, strict=True):
            if not reachable.any():
                break
            left = displacements[reachable]
            reachable[reachable] = _is_reachable(problem, motion, left, count)
        self.is_reachable[batch] = reachable

    def json(self, payload: Payload) -> Json:
        """Return the reachable positions and their spacing, for the page."""
        reachable = payload.array(self.positions[self.is_reachable])
        return {"places": reachable, "size": self.spacing}


def _displacements(problems: Sequence[Problem], motion: Array, spacing: float) -> Array:
    """Return the displacements (K, 2) of the paths that keep them near the arm, nearest first [m].

    Such that the centre of the paths is within the arm's reach of its first joint.
    """
    robot = problems[0].robot
    centres = [
        problem.follows.items[0].chain.base_placement.act(_centre(problem)) for problem in problems
    ]
    centre = np.mean(centres, axis=0)[:2]
    base = robot.joint_poses(motion[:1, : robot.dof])[0, 0, :2]
    steps = spacing * np.arange(-_HALF_WIDTH, _HALF_WIDTH + 1)
    offsets = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    near = offsets[np.linalg.norm(offsets, axis=1) <= robot.reach] + base - centre
    return np.asarray(near[np.argsort(np.linalg.norm(near, axis=1), kind="stable")])


def _centre(problem: Problem) -> Array:
    """Return the mean position of a path (3,) [m], in its axes."""
    positions = problem.path.samples(spread_along(problem.path, _POSES)).translation
    return np.asarray(positions.mean(axis=0))


def _is_reachable(problem: Problem, motion: Array, displacements: Array, count: int) -> Flags:
    """Return at which displacements (K, 2) [m] of a path all of `count` poses are reachable, (K,).

    `motion` (M, n) are configurations along the path where it is now.
    """
    robot, follows = problem.robot, problem.follows
    targets = _targets_at(problem, displacements, count)
    manifold = Manifold(follows, robot.lower, robot.upper)
    rows = np.linspace(0, len(motion) - 1, count).round().astype(int)
    q = np.tile(motion[rows], (len(displacements), 1))
    _, found = manifold.project(q, targets.reshape(len(q), -1), far=True)
    converged = found.reshape(-1, count)
    seeds = spread(follows.coordinates, _SEEDS, np.random.default_rng(0))
    reachable = np.ones(len(displacements), dtype=bool)
    # Poses are tried again one at a time: most positions out of reach fail at the first.
    for _ in range(count):
        open_positions = np.flatnonzero(reachable & ~converged.all(axis=1))
        if not len(open_positions):
            break
        pose = np.argmin(converged[open_positions], axis=1)
        repeated = np.repeat(targets[open_positions, pose], len(seeds), axis=0)
        every = np.tile(seeds, (len(open_positions), 1))
        _, found = manifold.project(every, repeated, far=True)
        any_seed = found.reshape(len(open_positions), -1).any(axis=1)
        converged[open_positions, pose] = reachable[open_positions] = any_seed
    return reachable


def _targets_at(problem: Problem, displacements: Array, count: int) -> Array:
    """Return targets of `count` poses of a path at displacements (K, 2) [m], (K, count, 12)."""
    follows = problem.follows
    # In the axes in which the path is followed.
    rotation = follows.items[0].chain.base_placement.rotation
    shift = np.pad(displacements, ((0, 0), (0, 1))) @ rotation
    targets = follows.targets(spread_along(problem.path, count))
    displaced = np.repeat(targets[None], len(displacements), axis=0)
    displaced[:, :, :3] += shift[:, None]
    return displaced
