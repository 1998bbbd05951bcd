"""Clearance of the arm from itself and from obstacles that move: rows of the plan, and a proof."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError, nearest
from selfmotion.model.collision import ClearanceModel, CollisionModel, how_near
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, as_pose
from selfmotion.problem.costs import Samples
from selfmotion.realtime.distance_proof import distance_proofs
from selfmotion.realtime.settings import CLEAR_FOR, CLEARANCE_MARGIN, LEAVING, LEVEL, NEARER


class _BodyPairs(NamedTuple):
    """Pairs of bodies that have to keep one distance.

    Attributes
    ----------
    model : ClearanceModel
    min_distance : float
        The distance to keep [m].
    names : set of str
        Of the obstacles.
    standing : frozenset of str
        Names of the obstacles that stand in the world.
    """

    model: ClearanceModel
    min_distance: float
    names: set[str]
    standing: frozenset[str]


class MovingClearance:
    """Minimum distance of the arm from itself and from obstacles at their present poses.

    During a plan obstacles are taken to be at rest. Links are their convex hulls, and obstacles
    hulls, or convex pieces that contain them.

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
        self._groups = [
            _BodyPairs(
                ClearanceModel(model, distance + LEVEL),
                distance,
                {item.name for item in model.obstacles},
                model.standing,
            )
            for model, distance in _without_repeated_links(robot, bodies)
        ]
        for group in self._groups:
            _check_hulls(robot, group)
        self._proofs = [
            proof
            for group in self._groups
            for proof in distance_proofs(group.model, group.min_distance)
        ]
        # Largest displacement of bodies on links from where they were at first [m].
        self._displacement: dict[str, float] = {}
        self.blocked, self.message = False, ""

    def move(self, obstacles: Mapping[str, SE3], q: Array) -> None:
        """Put obstacles somewhere else: name → pose in world axes, or in the frame of its link.

        What pairs have to keep changes by as much as their distances change at q (n,), where the
        arm is. So poses that jitter, as those of cameras do, do not add up.
        """
        if not obstacles:
            return
        proofs = [proof for proof in self._proofs if not proof.reuses]
        before = [proof.distances(q) for proof in proofs]
        known = sorted(set().union(*(group.names for group in self._groups)))
        for name, pose in obstacles.items():
            if name not in known:
                hint = nearest(name, known)
                raise ProblemError(
                    f"obstacle '{name}' is none of the clearance's: {', '.join(known)}{hint}"
                )
            checked_pose = as_pose(pose, f"obstacle '{name}'")
            for group in self._groups:
                if name in group.names:
                    _check_moves(group.model, name)
                    group.model.move(name, checked_pose)
                    self._displacement[name] = group.model.displacement(name, checked_pose)
        for proof, distances in zip(proofs, before, strict=True):
            proof.shift_floor(proof.distances(q) - distances)

    def forget(self) -> None:
        """Forget how near bodies have been: the arm is somewhere else."""
        for proof in self._proofs:
            proof.forget()

    def distances(self, q: Array) -> Array:
        """Return the smallest distance at configurations (K, n), levelled off, (K,) [m]."""
        each = [
            group.model.clearances(q).values.min(axis=1, initial=np.inf) for group in self._groups
        ]
        return np.asarray(np.min(each, axis=0))

    def rows(self, samples: Samples, by_q: Array) -> tuple[Array, Array]:
        """Return the constraints of a step of the plan: rows (R, d) and upper limits (R,).

        Sets `blocked` and `message` for the plan as it is.
        """
        self.blocked, self.message = False, ""
        rows, room = zip(*(self._rows(group, samples, by_q) for group in self._groups), strict=True)
        return np.concatenate(rows), np.concatenate(room)

    def _rows(self, group: _BodyPairs, samples: Samples, by_q: Array) -> tuple[Array, Array]:
        """Return the rows of the pairs with one distance."""
        model, min_distance = group.model, group.min_distance
        nodes, times = samples.nodes, samples.sampling.node_times
        clearances = model.clearances(samples.q[nodes])
        values = clearances.values
        self._check_blocked(group, values, times)
        rows = -(clearances.slopes[:, None] @ by_q[nodes[clearances.rows]])[:, 0]
        # At the present pose the only requirement is not to come nearer. Obstacles that came too
        # near are left at this speed; links need not be.
        leaving = np.array([LEAVING * (pair[1] in group.standing) for pair in model.pairs])
        reached = values[0] + times[:, None] * leaving
        room = values - np.minimum(min_distance + CLEARANCE_MARGIN, reached)
        later = clearances.rows > 0
        return rows[later], room[clearances.rows, clearances.columns][later]

    def _check_blocked(self, group: _BodyPairs, values: Array, times: Array) -> None:
        """Set `blocked` where distances (N + 1, P) [m] at times (N + 1,) soon get too small."""
        soon = values[times <= CLEAR_FOR]
        # The proof refuses what several plans, one after the other, would give away.
        allowed = np.minimum(group.min_distance, soon[0] - NEARER) if soon.size else soon
        if (soon[1:] < allowed).any():
            row, pair = np.argwhere(soon[1:] < allowed)[0]
            first, second = group.model.pairs[pair]
            self.blocked = True
            near = how_near(float(soon[row + 1, pair]), digits=1).replace("are ", "be ")
            self.message = (
                f"'{first}' and '{second}' would {near} in {times[row + 1]:.2f} s, wanted "
                f"{group.min_distance * 1e3:.1f} mm"
            )

    def proof_failure(self, q: Array, travelled: Array, times: Array) -> str:
        """Return why a motion is not proved to keep the distances; "" where it is.

        Between two configurations the distance d of a pair changes by Σ_j l_j V_j at most, with
        V_j the path length of joint j and l_j the pair's lever, so that d ≥ ½ (d(a) + d(b) -
        Σ_j l_j V_j) in between (`certificate.separation`). Intervals on which that does not decide
        are halved. `DistanceProof` says which distance a pair has to keep.

        Parameters
        ----------
        q : (K, n)
            At cycles [rad or m].
        travelled : (K, n)
            Upper bounds of the path lengths of joints since the first one.
        times : (K,)
            Since the first one [s].
        """
        for proof in self._proofs:
            displacement = np.array(
                [max(self._displacement.get(name, 0.0) for name in pair) for pair in proof.pairs]
            )
            levers = proof.levers + np.where(proof.levers > 0.0, displacement[:, None], 0.0)
            undecided = proof.first_undecided(levers, q, travelled)
            if undecided is not None:
                first, second = proof.pairs[undecided.pair]
                return (
                    f"'{first}' and '{second}' are not proved to keep "
                    f"{proof.min_distance * 1e3:.1f} mm until {times[undecided.cycle]:.3f} s: they "
                    f"{how_near(undecided.distance, digits=1)} there"
                )
        return ""


def _without_repeated_links(
    robot: RobotModel, bodies: Sequence[tuple[CollisionModel, float]]
) -> list[tuple[CollisionModel, float]]:
    """Return new models, each with its distance [m], in which a pair of links is only once.

    It is in the one with the largest distance. Models are new because those of the certificate
    have fixed obstacles.
    """
    models = list[tuple[CollisionModel, float]]()
    known: dict[tuple[str, str], None] = {}
    for model, distance in sorted(bodies, key=lambda each: -each[1]):
        new = CollisionModel(robot, model.obstacles, [*model.disabled, *known], model.only)
        if new.pairs or not models:
            models.append((new, distance))
        obstacles = {item.name for item in model.obstacles}
        known.update((pair, None) for pair in new.pairs if obstacles.isdisjoint(pair))
    return models


def _check_hulls(robot: RobotModel, group: _BodyPairs) -> None:
    """Raise ProblemError for an obstacle whose convex hull always contains a link."""
    for link, obstacle in group.model.left_out:
        if obstacle in group.standing:
            raise ProblemError(
                f"{robot.name}: while the arm moves obstacles are their convex hulls, and "
                f"that of '{obstacle}' always contains '{link}': close its mesh, which is "
                f"then taken apart, or give its parts as obstacles of their own"
            )


def _check_moves(model: ClearanceModel, name: str) -> None:
    """Raise ProblemError for a body on a link of which some distance is that of meshes."""
    for pair in model.left_out:
        if name in pair:
            raise ProblemError(
                f"obstacle '{name}' cannot be moved: its hull always overlaps that of "
                f"'{pair[pair[0] == name]}', and their meshes are measured where they were "
                f"first; give it convex parts as obstacles of their own"
            )
