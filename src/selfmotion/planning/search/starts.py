"""Start configurations worth trying."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.model.follow import (
    Coordinates,
    Follows,
    has_windows,
    is_plain,
    single_tip,
    tip_names,
)
from selfmotion.planning.search.chains import UNLIKE
from selfmotion.planning.search.curves import SPACING, SelfMotion
from selfmotion.planning.search.manifold import Manifold, carry
from selfmotion.planning.search.search_bounds import SearchBounds

# Seeds where all self-motions of the first pose can be traced.
TRACING_SEEDS = 60
# Seeds for each requested configuration where they cannot.
_TRIES = 2
# Rounds of these where most solutions violate other conditions …
_START_ROUNDS = 12
# … until there is this share of the starts.
_ENOUGH_STARTS = 0.5
# Error of the damped method [m, rad] from which Newton's converges.
_NEARLY = 1e-6


Admits = Callable[[Array], npt.NDArray[np.bool_]]


def start_candidates(
    follows: Follows,
    count: int,
    rng: np.random.Generator,
    admits: Admits | None = None,
    time: float = 0.0,
) -> list[Array]:
    """Return distinct configurations that put the tool on the path at a time, its start by default.

    For one degree of redundancy they are spread evenly over all self-motion curves of that pose, as
    far as these are within the limits, each joint by the whole turns that bring it nearest to the
    middle of its range. For more, Newton's method from a low-discrepancy sequence over the
    joint limits; solutions near an earlier one are dropped.

    Parameters
    ----------
    follows : Follows
    count : int
        Largest number of configurations.
    rng : Generator
        Shifts the sequence.
    admits : callable, optional
        Mask of configurations (K, n) that satisfy further conditions, (K,). Others are returned if
        none does.
    time : float
        When [s].

    Returns
    -------
    list of (n,)
        Never empty.

    Raises
    ------
    InverseKinematicsError
        No seed led to the pose.
    """
    found: list[Array] = []
    if follows.redundancy == 1 and not has_windows(follows):
        found = _along_curves(follows, count, rng, admits or _all, time)
    if not found:
        found = _scattered(follows, count, rng, admits or _all, time)
    if not found:
        found = _approached(follows, count, rng, admits or _all, time)
    if not found and admits is not None:
        return start_candidates(follows, count, rng, None, time)
    if not found and not is_plain(follows):
        raise InverseKinematicsError(
            f"{follows.robot.name}: no configuration within the limits was found that puts "
            f"{tip_names(follows)} on the start of the path; move that into the workspace, or give "
            f"one (start=)",
            position_miss=np.inf,
            rotation_miss=np.inf,
        )
    if not found:
        # Many more attempts, and an error that names the distance.
        found = [
            follows.robot.inverse_kinematics(
                single_tip(follows).path.pose(time), single_tip(follows).task, rng=rng
            )
        ]
    return found


def _all(q: Array) -> npt.NDArray[np.bool_]:
    return np.ones(len(q), dtype=bool)


def _along_curves(
    follows: Follows, count: int, rng: np.random.Generator, admits: Admits, time: float
) -> list[Array]:
    """Return up to `count` configurations within the limits, evenly over all curves."""
    own, motion = follows.coordinates, SelfMotion(follows, SPACING)
    bounds = SearchBounds(own.lower, own.upper, motion.revolute, ())
    curves = motion.curves(
        follows.targets(np.array([time]))[0], spread(own, TRACING_SEEDS, rng)
    ).curves
    # The last sample of a closed curve equals its first one.
    samples = [curve.q[: len(curve.q) - curve.closed] for curve in curves]
    inside = [q[bounds.is_admissible_modulo_turns(q) & admits(q)] for q in samples]
    total = sum(map(len, inside))
    stride = max(1, -(-total // count))
    every = np.concatenate([np.empty((0, own.dof)), *inside])[::stride]
    return [bounds.centred(q[None])[0] for q in bounds.representative(every)]


def _scattered(
    follows: Follows, count: int, rng: np.random.Generator, admits: Admits, time: float
) -> list[Array]:
    """Return up to `count` configurations that Newton's method finds, none near another."""
    own = follows.coordinates
    manifold = Manifold(follows, own.lower, own.upper)
    target, found = follows.targets(np.array([time]))[0], list[Array]()
    held = follows.held(np.array([time]))[0]
    for _ in range(_START_ROUNDS):
        seeds = spread(own, _TRIES * count, rng)
        q, arrived = manifold.project(seeds, target, far=True, held=held)
        # Near ones lead to the same plan once the start may move.
        for one in q[arrived][admits(q[arrived])]:
            if len(found) < count and all(np.linalg.norm(one - other) > UNLIKE for other in found):
                found.append(one)
        # Without further conditions, one round finds all.
        if admits is _all or len(found) >= _ENOUGH_STARTS * count:
            break
    return found


def _approached(
    follows: Follows, count: int, rng: np.random.Generator, admits: Admits, time: float
) -> list[Array]:
    """Return up to `count` configurations that a slower method finds, none near another.

    It lets go of limits again: where these are narrow, Newton's method stops at some of them.
    """
    own, t = follows.coordinates, np.array([time])
    manifold = Manifold(follows, own.lower, own.upper)
    target, held, found = follows.targets(t)[0], follows.held(t)[0], list[Array]()
    seeds = spread(own, _TRIES * count, rng)
    near, errors = manifold.approach(seeds, target, held)
    near = near[(errors <= _NEARLY).all(axis=1)]
    if not len(near):
        return found
    q, arrived = manifold.project(near, target, held=held)
    for one in q[arrived][admits(q[arrived])]:
        if len(found) < count and all(np.linalg.norm(one - other) > UNLIKE for other in found):
            found.append(one)
    return found


def carried(
    follows: Follows, starts: Array, t: Array, at: int = 0
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return the motions through configurations (K, n) that follow the path without self-motion.

    (K, N, n): from each of the times t (N,) [s] to the next by Newton's method, limits not
    regarded, and likewise back from the one of number `at`, where the configurations are; and of
    which that is possible, (K,).
    """
    free = np.full(follows.dof, np.inf)
    manifold = Manifold(follows, -free, free)
    targets, helds = follows.targets(t), follows.held(t)
    return carry(starts, len(t), at, lambda q, _, k: manifold.project(q, targets[k], held=helds[k]))


def spread(coordinates: Coordinates, count: int, rng: np.random.Generator) -> Array:
    """Return configurations that fill the limits evenly, (count, n).

    The additive recurrence with the generalised golden ratio: fractions of k g^-1 … k g^-n, where
    g > 1 solves g^(n+1) = g + 1 (M. Roberts, "The unreasonable effectiveness of quasirandom
    sequences", 2018).
    """
    lower, upper = coordinates.finite_limits()
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (coordinates.dof + 1.0))
    steps = ratio ** -np.arange(1.0, coordinates.dof + 1.0)
    shift = rng.uniform(size=coordinates.dof)
    shares = (shift + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return np.asarray(lower + (upper - lower) * shares)
