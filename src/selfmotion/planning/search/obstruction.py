"""Unreachable poses of a path: their causes and remedies, and how far the arm can follow it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.collision import Closest, how_near
from selfmotion.model.follow import deviation_of, limits_within, tip_names
from selfmotion.model.path import edges_of, spread_along
from selfmotion.model.task import POSITION_ROWS, ROW_NAMES, Relaxation
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.search_bounds import AT_LIMIT
from selfmotion.planning.search.single_poses import (
    CLIMBERS,
    MAX_EVALUATED,
    Found,
    SinglePoses,
    first_blocked,
    room_of,
    search_closely,
)
from selfmotion.planning.search.starts import start_candidates

# Poses along the path that are tried.
_POSES = 64
# Bisections of the time at which no branch goes on.
_BISECTIONS = 16
# Poses at which the excess is computed.
_EXCESS_POSES = 6
# Poses about a suspected time, in shares of the segment of the path that it is in.
_ABOUT = (-1e-3, 0.0, 1e-3, 4e-3)
# A singular value below this share of the dexterous configuration's counts as stretched or folded.
_STRETCHED = 0.1
# Poses along a path that are tried before all others.
_COARSE_POSES = 9
# Rounds of the search for a remedy …
_SHRINKS = 6
# … in each of which a deviation has to be below this share of the least one so far.
_SHRUNK = 0.75
# Attempts to move a path …
_MOVE_TRIES = 4
# … by the necessary distance at the obstructed pose, increased by this share each time …
_OVERSHOOT = 0.05
# … up to this distance [m].
_FARTHEST = 0.5


_ROTATION_ROWS = ROW_NAMES[len(POSITION_ROWS) :]


def remedies(poses: SinglePoses, t: float, times: Array) -> list[str]:
    """Return remedies for the pose at t [s] in words, each of which suffices alone.

    The path moved as a whole, so that at the other times [s], too, there are configurations; the
    tool turned away from its path at t; and one joint that goes farther, also at t.
    """
    found = []
    shift = nearest_place(poses, times)
    if shift is not None:
        # Rounded away from the path: the remedy has to suffice.
        far = np.copysign(np.ceil(1e4 * np.abs(shift) - 1e-3) / 10.0, shift) + 0.0
        said = ", ".join(f"{axis} {x:+.4g}" for axis, x in zip("xyz", far, strict=True) if x)
        found.append(f"the path moved by {np.linalg.norm(far):.3g} mm ({said})")
    turn = least_deviation(poses, t, _ROTATION_ROWS)
    if turn is not None:
        found.append(f"the tool turned by {np.degrees(np.linalg.norm(turn)):.1f}° there")
    joint = least_excess(poses, t)
    if joint is not None:
        name, excess = joint
        unit = poses.formulation.problem.robot.unit_of(name)
        found.append(f"joint '{name}' going {excess:.3g} {unit} beyond its limit")
    return found


def nearest_place(poses: SinglePoses, times: Array) -> Array | None:
    """Return a short displacement (3,) [m] of the path as a remedy, None if none is found.

    So that at all the times [s] something is found: by as much as the first that is not needs, and
    then on. Bodies stay where they are.
    """
    shift = np.zeros(3)
    for _ in range(_MOVE_TRIES):
        moved = poses.shifted(shift)
        blocked = first_blocked(moved, times)
        if blocked is None:
            return shift
        more = least_deviation(moved, blocked, POSITION_ROWS)
        if more is None:
            return None
        shift = shift + (1.0 + _OVERSHOOT) * more
        if np.linalg.norm(shift) > _FARTHEST:
            return None
    return None


def least_deviation(poses: SinglePoses, t: float, rows: tuple[str, ...]) -> Array | None:
    """Return the least deviation of some rows (3,) at t [s] with which something free is found.

    By sampling: the least of many, which is then reduced. None if nothing is found, or the task
    does not prescribe these rows.
    """
    problem = poses.formulation.problem
    prescribed = [ROW_NAMES[k] for k in problem.task.rows]
    rows = tuple(row for row in rows if row in prescribed)
    if not rows:
        return None
    more = Relaxation(rows, _FARTHEST if rows[0] in POSITION_ROWS else np.pi)
    others = (
        replace(item, rows=tuple(row for row in item.rows if row not in rows))
        for item in problem.relaxations
        if not set(item.rows) <= set(rows)
    )
    wider, n = poses.of(replace(problem, relaxations=(*others, more))), problem.robot.dof
    follows = wider.formulation.follows
    q = poses.some(t, CLIMBERS)[:, :n]
    q = np.hstack([q, np.zeros((len(q), follows.dof - n))])
    best: Array | None = None
    for _ in range(_SHRINKS):
        q, arrived = wider.project(q, t, far=True)
        q = q[arrived]
        q = q[wider.bounds.is_admissible(q)]
        if not len(q):
            break
        away = deviation_of(follows, more, q)
        sizes = np.linalg.norm(away, axis=1)
        order = np.argsort(sizes)
        q, size = q[order], float(sizes[order[0]])
        if best is None or size < np.linalg.norm(best):
            best = np.zeros(6)
            best[more.indices] = away[order[0]]
        limits = limits_within(follows, more, _SHRUNK * size)
        if not limits.max() > 0.0:
            break
        wider = wider.with_limits(
            np.maximum(wider.bounds.lower, -limits), np.minimum(wider.bounds.upper, limits)
        )
    if best is None:
        return None
    return best[:3] if rows[0] in POSITION_ROWS else best[3:]


def least_excess(poses: SinglePoses, t: float) -> tuple[str, float] | None:
    """Return the joint that would have to leave its limits least for a pose, and how far.

    None if no single joint is the cause.
    """
    lower, upper = poses.bounds.lower, poses.bounds.upper
    seeds = poses.some(t, CLIMBERS)
    found: list[tuple[float, str]] = []
    for k, name in enumerate(poses.formulation.problem.robot.joint_names):
        if not (np.isfinite(lower[k]) or np.isfinite(upper[k])):
            continue
        wide = poses.with_limits(
            np.where(np.arange(len(lower)) == k, -np.inf, lower),
            np.where(np.arange(len(upper)) == k, np.inf, upper),
        )
        q, arrived = wide.project(seeds, t, far=True)
        q = q[arrived]
        q = q[wide.bounds.is_admissible(q)]
        excess = np.maximum(q[:, k] - upper[k], lower[k] - q[:, k])
        if len(q):
            found.append((float(excess.min()), name))
    if not found:
        return None
    excess, name = min(found)
    return name, excess


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
        The search for configurations.
    found : Found
        Its result at the pose.
    times : (K,)
        Times to try first after a change, this one before all [s].
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
    def errors(self) -> tuple[float, float]:
        """Error of the nearest configuration from the pose, (m, rad)."""
        position, rotation = self._nearest[1][0]
        return float(position), float(rotation)

    @property
    def reason(self) -> str:
        """The cause at that pose, and the extent of the search."""
        poses, found = self.poses, self.found
        name = poses.formulation.problem.robot.tool
        if self.is_met:
            return (
                f"each configuration that was found to put '{name}' there, from {found.tries} "
                f"tries, meets something: {_roomiest(poses, found.met)}"
            )
        q, _ = self._nearest
        position, rotation = self.errors
        turned = f" and {rotation:.2g} rad" if poses.formulation.problem.task.angular else ""
        return (
            f"none was found that puts '{name}' there, from {found.tries} tries"
            f"{cause(poses, q[0])}: the nearest misses it by {1e3 * position:.3g} mm{turned}"
        )

    @property
    def _least_clearance(self) -> float:
        """Largest distance of bodies at the pose, if it is below the required one [m]."""
        if not self.is_met:
            return 0.0
        worst, required = _roomiest_pair(self.poses, self.found.met)
        # Rounded down: the remedy has to suffice.
        known = np.floor(1e4 * worst.value) / 1e4
        return float(known) if 0.0 < worst.value < required else 0.0

    @cached_property
    def help(self) -> str:
        """Remedies, each of which suffices alone; "" for none."""
        found = remedies(self.poses, self.time, self.times)
        least = self._least_clearance
        found += [f"a clearance of {1e3 * least:.3g} mm"] if least > 0.0 else []
        return f"; what would help: {', or '.join(found)}" if found else ""


def _roomiest(poses: SinglePoses, met: Array) -> str:
    """Return the collision of the configuration (of K, n) with the smallest overlap."""
    worst, required = _roomiest_pair(poses, met)
    return (
        f"at best '{worst.first}' and '{worst.second}' {how_near(worst.value)} (wanted: "
        f"{1e3 * required:.3g} mm)"
    )


def _roomiest_pair(poses: SinglePoses, met: Array) -> tuple[Closest, float]:
    """Return the nearest bodies at the smallest overlap of all, and the required distance."""
    # The last ones were moved away from obstacles.
    _, worst, required = max(
        (room_of(poses, q) for q in met[-MAX_EVALUATED:]), key=lambda each: each[0]
    )
    return worst, required


def obstruction(
    formulation: Formulation, rng: np.random.Generator, suspect: float | None = None
) -> Obstruction | None:
    """Return a pose of the path without any configuration; None if all have one.

    Poses all along the path: that at a `suspect` time [s] first, then the first, then those
    farthest from the others. A pose is given up after thousands of tries: Newton's method from all
    over the limits, and within the bands of tolerances; where self-motions are curves, all of
    these; and the configurations with the smallest overlaps, moved away.
    """
    poses = SinglePoses(formulation, rng)
    times = spread_along(formulation.path, _COARSE_POSES)
    known: dict[float, Array] = {}
    order = _worst_first(formulation, times)
    if suspect is not None:
        order = [suspect, *(t for t in order if t != suspect)]
    for t in order:
        near = min(known, key=lambda other: abs(other - t), default=None)
        found = poses.solve(
            t, np.empty((0, poses.coordinates.dof)) if near is None else known[near]
        )
        if not len(found.free):
            found = search_closely(poses, t, found)
        if not len(found.free):
            again = np.array([t, *(other for other in order if other != t)])
            return Obstruction(t, len(found.met) > 0, poses, found, again)
        known[t] = found.free
    return None


def _worst_first(formulation: Formulation, times: Array) -> list[float]:
    """Return times [s], after the first of the poses farthest from the middle of all.

    Without a solution at the start, no part can be planned; otherwise causes are mostly at an end.
    """
    places = formulation.path.samples(times).translation
    away = np.linalg.norm(places - places.mean(axis=0), axis=1)
    away[0] = np.inf
    return [float(t) for t in times[np.argsort(-away, kind="stable")]]


def cause(poses: SinglePoses, q: Array) -> str:
    """Return the cause why the arm reaches no further at q (n,); "" for none found."""
    own, follows, causes = poses.coordinates, poses.follows, []
    near = (
        np.minimum(q - own.lower, own.upper - q)[: poses.formulation.problem.robot.dof] < AT_LIMIT
    )
    if np.any(near):
        names = ", ".join(f"'{own.names[k]}'" for k in np.flatnonzero(near))
        causes.append(f"at its limit: joint {names}")
    best = own.dexterous(poses.formulation.problem.task)
    here, there = (
        float(np.linalg.svd(follows.jacobian(x), compute_uv=False)[-1]) for x in (q, best)
    )
    if here < _STRETCHED * there:
        causes.append(f"arm stretched or folded, smallest singular value {here:.2g}")
    return f" ({'; '.join(causes)})" if causes else ""


@dataclass(frozen=True, eq=False)
class Reach:
    """Extent to which single poses along the path are reachable.

    Attributes
    ----------
    time : float
        The last time up to which every pose has a configuration within the limits [s].
    starts : list of (n,)
        Configurations at the start of the path.
    reason : str
        The cause beyond; "" for none.
    """

    time: float
    starts: list[Array]
    reason: str


def reachable(
    formulation: Formulation, starts: int, rng: np.random.Generator, suspect: float = 0.0
) -> Reach:
    """Return the extent to which single poses of the path are reachable, within joint limits.

    Within the tolerances. Inverse kinematics from the solutions of the pose before, and from other
    seeds where these end: a pose that no seed leads to is out of reach. Poses all along the path,
    and more about the time `suspect` [s], where a motion has failed.
    """
    poses = SinglePoses(formulation, rng, clear=False)
    path, given = formulation.path, poses.formulation.given_start
    first = [given] if given is not None else start_candidates(poses.follows, starts, rng)
    knots = edges_of(path.knots)
    section = np.diff(knots)[min(int(np.searchsorted(knots, suspect, "right")), len(knots) - 1) - 1]
    about = np.clip(suspect + section * np.array(_ABOUT), 0.0, path.duration)
    times = np.union1d(spread_along(path, _POSES + 1), about)
    known, last = np.array(first), 0.0
    for t in times[1:]:
        found = poses.solve(t, known)
        if not len(found.free):
            known, last = _edge(poses, (last, t), known)
            # From right before it, a pose that only seemed out of reach is found.
            found = poses.solve(t, known)
        if not len(found.free):
            found = search_closely(poses, t, found)
        if not len(found.free):
            return Reach(last, first, _out_of_reach(poses, last, known[0], times[times > last]))
        known, last = found.free, float(t)
    return Reach(path.duration, first, "")


def _edge(poses: SinglePoses, interval: tuple[float, float], known: Array) -> tuple[Array, float]:
    """Return solutions at the last time of an interval that there are any, and this time."""
    last, beyond = interval
    for _ in range(_BISECTIONS):
        middle = 0.5 * (last + beyond)
        found = poses.solve(middle, known)
        if len(found.free):
            known, last = found.free, middle
        else:
            beyond = middle
    return known, last


def _out_of_reach(poses: SinglePoses, time: float, q: Array, beyond: Array) -> str:
    """Return in words that later poses are out of reach, by which distance, with the arm's state.

    q (n,) is its configuration at `time`, the last one; `beyond` are later times.
    """
    begin = f"from t = {time:.6g} s on the pose is out of reach{cause(poses, q)}"
    if len(poses.formulation.problem.follows.items) > 1:
        names = tip_names(poses.follows)
        return f"{begin}: no configuration was found that puts {names} on their paths"
    rounds = beyond[np.unique(np.linspace(0, len(beyond) - 1, _EXCESS_POSES).round().astype(int))]
    errors = [(*poses.nearest(float(t))[1][0], float(t)) for t in rounds]
    position, rotation, when = max(errors, key=lambda pair: pair[0] + pair[1])
    turned = f" and {rotation:.2g} rad" if poses.formulation.problem.task.angular else ""
    return (
        f"{begin}: the nearest configuration found misses it by up to "
        f"{1e3 * position:.3g} mm{turned}, at t = {when:.4g} s"
    )
