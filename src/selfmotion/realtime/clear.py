"""Clearance from obstacles that move."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from selfmotion.basics import Array, Flags, Ints, ProblemError, nearest
from selfmotion.model.collision import ClearanceModel, CollisionModel, how_near
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, as_pose
from selfmotion.problem.costs import Samples
from selfmotion.realtime.settings import (
    CLEAR_FOR,
    CLEARANCE_MARGIN,
    FAR_MESHES,
    FIRST_CHECKS,
    FIRST_OF_MESHES,
    LEAVING,
    LEVEL,
    MAX_CHECKS,
    NEARER,
)


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
        exact, distances = _each_once(robot, bodies)
        self._models = [
            (ClearanceModel(own, far + LEVEL), far)
            for own, far in zip(exact, distances, strict=True)
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
        self._proofs = [proof for model, far in self._models for proof in _proofs_of(model, far)]
        # By how much bodies on links are displaced from where they were at first [m].
        self._displaced: dict[str, float] = {}
        self.blocked, self.message = False, ""

    def move(self, obstacles: Mapping[str, SE3], q: Array) -> None:
        """Put obstacles somewhere else: name → pose in world axes, or in the frame of its link.

        What pairs have to keep changes by what that changes of their distances at q (n,), where
        the arm is. Poses that jitter, as those of cameras do, give nothing away so.
        """
        if not obstacles:
            return
        moving = [proof for proof in self._proofs if not proof.remembers]
        before = [proof.distances(q) for proof in moving]
        known = sorted(set().union(*self._names))
        for name, pose in obstacles.items():
            if name not in known:
                hint = nearest(name, known)
                raise ProblemError(
                    f"obstacle '{name}' is none of the clearance's: {', '.join(known)}{hint}"
                )
            there = as_pose(pose, f"obstacle '{name}'")
            for (model, _), names in zip(self._models, self._names, strict=True):
                if name in names:
                    self._check_moves(model, name)
                    model.move(name, there)
                    self._displaced[name] = model.displacement(name, there)
        for proof, was in zip(moving, before, strict=True):
            proof.bodies_moved(proof.distances(q) - was)

    def forget(self) -> None:
        """Forget how near bodies have been: the arm is somewhere else."""
        for proof in self._proofs:
            proof.forget()

    def _check_moves(self, model: ClearanceModel, name: str) -> None:
        """Raise ProblemError for a body on a link of which some distance is that of meshes."""
        for pair in model.left_out:
            if name in pair:
                raise ProblemError(
                    f"obstacle '{name}' cannot be moved: its hull always overlaps that of "
                    f"'{pair[pair[0] == name]}', and their meshes are measured where they were "
                    f"first; give it convex parts as obstacles of their own"
                )

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
        # What is given away by one plan after another, the proof refuses.
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

    def unproved(self, q: Array, travelled: Array, times: Array) -> str:
        """Return why a motion is not proved to keep the distances; "" where it is.

        Of each pair the distance, or where it has been nearer all the time the largest one that it
        has had, but for `NEARER`: what one segment may give away is not given away by the next one
        again. Between two configurations the distance d of a pair changes by Σ_j l_j V_j at most,
        with V_j the path length of joint j and l_j the pair's lever arm, so that d ≥ ½ (d(a) + d(b)
        - Σ_j l_j V_j) in between (`certificate.separation`). Intervals on which that does not
        decide are halved.

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
            more = np.array(
                [max(self._displaced.get(name, 0.0) for name in pair) for pair in proof.pairs]
            )
            arms = proof.levers + np.where(proof.levers > 0.0, more[:, None], 0.0)
            undecided = proof.undecided(arms, q, travelled)
            if undecided is not None:
                row, pair, near = undecided
                first, second = proof.pairs[pair]
                return (
                    f"'{first}' and '{second}' are not proved to keep {proof.far * 1e3:.1f} mm "
                    f"until {times[row]:.3f} s: they {how_near(near, digits=1)} there"
                )
        return ""


def _each_once(
    robot: RobotModel, bodies: Sequence[tuple[CollisionModel, float]]
) -> tuple[list[CollisionModel], list[float]]:
    """Return own models, as those of the certificate have fixed obstacles, and distances.

    Of several clearances each pair of links is in the one with the largest distance.
    """
    models, distances = list[CollisionModel](), list[float]()
    known: dict[tuple[str, str], None] = {}
    for given, far in sorted(bodies, key=lambda each: -each[1]):
        own = CollisionModel(robot, given.obstacles, [*given.disabled, *known], given.only)
        if own.pairs or not models:
            models.append(own)
            distances.append(far)
        obstacles = {item.name for item in given.obstacles}
        known.update((pair, None) for pair in own.pairs if obstacles.isdisjoint(pair))
    return models, distances


class _Proof:
    """Pairs of bodies whose distances are proved.

    Parameters
    ----------
    measure : callable
        Configurations (K, n), and which pairs are asked for (P,) → lower bounds of distances (K, P)
        [m], exact where they are small; of the others any.
    pairs : tuple of (str, str)
    far : float
        The distance to keep [m].
    levers : (P, n)
        See `CollisionModel.pair_levers`.
    first : int
        Intervals to begin with.
    remembers : bool
        Whether no pair moves but by the joints, so that what was measured last may decide.
    """

    def __init__(
        self,
        measure: Callable[[Array, Flags], Array],
        pairs: tuple[tuple[str, str], ...],
        far: float,
        levers: Array,
        first: int,
        remembers: bool,
    ) -> None:
        self.pairs, self.far, self.levers = pairs, far, levers
        self.remembers = remembers
        self._measure, self._first = measure, first
        # Of each pair the last distance that was measured, and where.
        self._known, self._where = np.full(len(pairs), -np.inf), np.zeros_like(levers)
        # The largest distance that each pair has had, at most the one to keep.
        self._floor = np.full(len(pairs), -np.inf)

    def forget(self) -> None:
        """Forget how near pairs have been."""
        self._floor[:] = -np.inf

    def distances(self, q: Array) -> Array:
        """Return the distances of pairs at a configuration (n,), (P,) [m]."""
        return np.asarray(self._measure(q[None], np.ones(len(self.pairs), dtype=np.bool_))[0])

    def bodies_moved(self, change: Array) -> None:
        """Take in by how much bodies have changed distances, (P,) [m], where the arm is."""
        self._floor = np.minimum(self._floor + change, self.far)

    def required(self, now: Array) -> Array:
        """Return the distances (P,) that pairs have to keep which have these now.

        Bounds need some room to prove that a pair beside its distance leaves it. One that is nearer
        than that allows, as when the arm was pushed, comes no nearer; much nearer, it begins anew.
        """
        pushed = now < self._floor - 2.0 * NEARER
        before = np.where(pushed, -np.inf, self._floor)
        self._floor = np.maximum(before, np.minimum(self.far, now))
        kept = np.where(now >= self.far + NEARER, self.far, self._floor - NEARER)
        return np.asarray(np.minimum(kept, now))

    def undecided(self, levers: Array, q: Array, travelled: Array) -> tuple[int, int, float] | None:
        """Return a cycle, the pair and its distance there, where no bound decides; None for all."""
        way = (levers * (np.abs(q[0] - self._where) + travelled[-1])).sum(axis=1)
        # Written so that NaN decides nothing.
        asked = ~(self._known - way >= self.far)
        if not asked.any():
            return None

        def measured(rows: Ints) -> Array:
            return np.where(asked, self._measure(q[rows], asked), np.inf)

        edges = np.linspace(0, len(q) - 1, self._first + 1).round().astype(np.intp)
        edges = np.unique(edges)
        values = measured(edges)
        bounded = asked
        if self.remembers:
            self._known[asked], self._where[asked] = values[0, asked], q[0]
            # Meshes that are nearer all the time would take a hundred measurements: these are only
            # measured at the ends.
            bounded = asked & (values[0] >= self.far)
        need = self.required(values[0])
        counted = np.where(bounded[:, None], levers, 0.0)
        return _bisected(measured, edges, values, need, travelled, counted)


def _bisected(
    measured: Callable[[Ints], Array],
    edges: Ints,
    values: Array,
    need: Array,
    travelled: Array,
    levers: Array,
) -> tuple[int, int, float] | None:
    """Return where bounds between cycles do not decide whether pairs keep what they need (P,)."""
    first, last, near, then = edges[:-1], edges[1:], values[:-1], values[1:]
    count = len(edges)
    while True:
        way = (travelled[last] - travelled[first]) @ levers.T
        # Written so that NaN decides nothing.
        inside = (near >= need) & (then >= need)
        kept = inside & (0.5 * (near + then - way) >= need)
        open_ = np.flatnonzero(~kept.all(axis=1))
        if not open_.size:
            return None
        middle = (first[open_] + last[open_]) // 2
        broken = ~inside.all(axis=1)
        count += len(middle)
        if broken.any() or count > MAX_CHECKS or (middle == first[open_]).any():
            row = int(np.argmax(broken)) if broken.any() else int(open_[0])
            pair = int(np.argmin(np.minimum(near, then)[row] - need))
            return int(last[row]), pair, float(min(near[row, pair], then[row, pair]))
        inner = measured(middle)
        first, last = np.append(first[open_], middle), np.append(middle, last[open_])
        near, then = np.vstack([near[open_], inner]), np.vstack([inner, then[open_]])


def _proofs_of(model: ClearanceModel, far: float) -> Iterator[_Proof]:
    """Yield the pairs of hulls, and those that are left out there, by their meshes."""

    def of_hulls(q: Array, asked: Flags) -> Array:
        return model.clearances(q).values

    yield _Proof(of_hulls, model.pairs, far, model.pair_levers, FIRST_CHECKS, remembers=False)
    if not model.left_out:
        return
    meshes, near = model.of_left_out(), far + FAR_MESHES

    def of_meshes(q: Array, asked: Flags) -> Array:
        wanted = np.broadcast_to(np.where(asked, near, -np.inf), (len(q), len(asked)))
        return meshes.distances(q, wanted, wanted)

    yield _Proof(of_meshes, meshes.pairs, far, meshes.pair_levers, FIRST_OF_MESHES, remembers=True)
