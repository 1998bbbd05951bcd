"""Clearance from obstacles that move."""

from collections.abc import Mapping, Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError, nearest
from selfmotion.model.collision import ClearanceModel, CollisionModel, how_near
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, as_pose
from selfmotion.problem.costs import Samples
from selfmotion.realtime.settings import CLEAR_FOR, CLEARANCE_MARGIN, LEAVING, LEVEL, NEARER


class Surroundings:
    """Minimum distance of the arm from itself and from obstacles at their present poses.

    During a plan they are taken to be at rest. Links are their convex hulls, and obstacles hulls,
    or convex pieces that contain them.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of (CollisionModel, float)
        The bodies, with obstacles where they are at first, and the distance to keep [m].

    Attributes
    ----------
    blocked : bool
        Whether the last plan violates the distance soon.
    message : str
        The violated pair, and its time.
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[tuple[CollisionModel, float]]) -> None:
        # Own models: those of the certificate have fixed obstacles.
        exact = [CollisionModel(robot, own.obstacles, own.disabled) for own, _ in bodies]
        self._models = [
            (ClearanceModel(own, far + LEVEL), far)
            for own, (_, far) in zip(exact, bodies, strict=True)
        ]
        self._names = [{item.name for item in own.obstacles} for own in exact]
        self._standing = [own.standing for own in exact]
        for (model, _), standing in zip(self._models, self._standing, strict=True):
            for link, obstacle in model.left_out:
                if obstacle in standing:
                    raise ProblemError(
                        f"{robot.name}: while the arm moves obstacles are their convex hulls, and "
                        f"that of '{obstacle}' always contains '{link}': close its mesh, which is "
                        f"then taken apart, or give its parts as obstacles of their own"
                    )
        self.blocked, self.message = False, ""

    def move(self, obstacles: Mapping[str, SE3]) -> None:
        """Put obstacles somewhere else: name → pose in world axes, or in the frame of its link."""
        known = sorted(set().union(*self._names))
        for name, pose in obstacles.items():
            if name not in known:
                hint = nearest(name, known)
                raise ProblemError(
                    f"obstacle '{name}' is none of the clearance's: {', '.join(known)}{hint}"
                )
            for (model, _), names in zip(self._models, self._names, strict=True):
                if name in names:
                    model.move(name, as_pose(pose, f"obstacle '{name}'"))

    def distances(self, q: Array) -> Array:
        """Return the smallest distance at configurations (K, n), levelled off, (K,) [m]."""
        each = [model.clearances(q).values.min(axis=1, initial=np.inf) for model, _ in self._models]
        return np.asarray(np.min(each, axis=0))

    def rows(self, samples: Samples, by_q: Array) -> tuple[Array, Array]:
        """Return the constraints of a step of the plan: rows (R, d) and upper limits (R,).

        Notes whether the plan is blocked as it is.
        """
        self.blocked, self.message = False, ""
        found = [
            self._rows(model, far, standing, samples, by_q)
            for (model, far), standing in zip(self._models, self._standing, strict=True)
        ]
        rows, room = zip(*found, strict=True)
        return np.concatenate(rows), np.concatenate(room)

    def _rows(
        self,
        model: ClearanceModel,
        distance: float,
        standing: frozenset[str],
        samples: Samples,
        by_q: Array,
    ) -> tuple[Array, Array]:
        """Return the rows of one model."""
        nodes = samples.nodes
        found = model.clearances(samples.q[nodes])
        values = found.values
        times = samples.sampling.node_times
        soon = values[times <= CLEAR_FOR]
        allowed = np.minimum(distance, soon[0] - NEARER) if soon.size else soon
        if (soon[1:] < allowed).any():
            row, pair = np.argwhere(soon[1:] < allowed)[0]
            first, second = model.pairs[pair]
            self.blocked = True
            near = how_near(float(soon[row + 1, pair]), digits=1).replace("are ", "be ")
            self.message = (
                f"'{first}' and '{second}' would {near} in {times[row + 1]:.2f} s, wanted "
                f"{distance * 1e3:.1f} mm"
            )
        rows = -(found.slopes[:, None] @ by_q[nodes[found.rows]])[:, 0]
        # At the present pose the only requirement is not to come nearer. Obstacles that came too
        # near are left at this speed; links need not be.
        leaving = np.array([LEAVING * (pair[1] in standing) for pair in model.pairs])
        reached = values[0] + times[:, None] * leaving
        room = values - np.minimum(distance + CLEARANCE_MARGIN, reached)
        later = found.rows > 0
        return rows[later], room[found.rows, found.columns][later]
