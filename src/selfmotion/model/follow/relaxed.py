"""Task frames with tolerances: virtual joints lead from the tool to its path."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import cast

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow.extended_chain import ExtendedChain
from selfmotion.model.follow.follow import BoundTaskFrame
from selfmotion.model.follow.follows import Follows
from selfmotion.model.follow.virtual_joints import VirtualJoints
from selfmotion.model.path import Path
from selfmotion.model.robot import mean_lever
from selfmotion.model.task import Relaxation

# Share of a band that a motion put back into it uses.
_INSIDE = 0.999


def with_tolerances(follows: Follows, relaxations: Sequence[Relaxation]) -> Follows:
    """Return the task frames of an arm with rows of its first path relaxed."""
    arm, (first, *others) = follows.robot, follows.items
    virtual = VirtualJoints(first.task, relaxations, follows.duration, mean_lever(arm))
    n = arm.dof
    dof = n + len(virtual.each)

    items = [
        BoundTaskFrame(ExtendedChain(item.chain, table, dof), item.path, task)
        for item, table, task in (
            (first, virtual.table(first.chain, n), virtual.task),
            *((item, item.chain.table, item.task) for item in others),
        )
    ]
    return Follows(arm, tuple(items), virtual)


def is_plain(follows: Follows) -> bool:
    """Whether it is the arm's own tool alone, of which the arm has inverse kinematics."""
    return len(follows.items) == 1 and not follows.virtual.each


def tip_names(follows: Follows) -> str:
    """Return the tips that are followed, for messages."""
    names = (item.chain.tip_name for item in follows.items)
    return " and ".join(f"'{name}'" for name in names if name)


def within_limits(follows: Follows, lower: Array, upper: Array) -> Follows:
    """Return the same for coordinates with other limits, (n,) each [rad or m]."""
    if not follows.virtual.each:
        return replace(follows, robot=replace(follows.robot, lower=lower, upper=upper))
    found = copy(follows)
    found.__dict__["coordinates"] = follows.coordinates.within(lower, upper)
    return found


def completed(follows: Follows, t: Array, q: Array) -> Array:
    """Return all coordinates (K, n) for the arm's own at times t (K,) [s] of the path."""
    return completed_along(follows, follows.items[0].path, t, q)


def completed_along(follows: Follows, path: Path, t: Array, q: Array) -> Array:
    """Return q (K, n) with the virtual joints that lead to a path at its times t (K,)."""
    if not follows.virtual.each:
        return q
    _, turns, places = follows.robot.chain.along(q)
    wanted = path.samples(np.minimum(t, path.duration))
    found = follows.virtual.coordinates((turns, places), (wanted.rotation, wanted.translation))
    held = follows.virtual.held(t * (follows.duration / path.duration))
    found[held] = 0.0
    return np.hstack([q, found])


def deviation_of(follows: Follows, item: Relaxation, q: Array) -> Array:
    """Return the deviations of a relaxation's rows at q (K, n), (K, k) [m, rad]."""
    return follows.virtual.rows_of(item, q[:, follows.robot.dof :])[0]


def limits_within(follows: Follows, item: Relaxation, band: float = np.inf) -> Array:
    """Return limits of |q| (n,) beyond which a relaxation's rows are off their path too far.

    By more than a band, or by more than the relaxations let each of them be at any time.
    """
    found, virtual = np.full(follows.dof, np.inf), follows.virtual
    first = follows.robot.dof
    for k, joint in enumerate(virtual.each):
        if joint.row in item.indices:
            found[first + k] = min(band, virtual.widest([joint.row])) / joint.scale
    return found


def band_limits(follows: Follows, q: Array) -> Array:
    """Return limits of |q| like q (K, n), within which joints that share a band keep it.

    Infinite where they do. Of bands in several windows the widest one counts.
    """
    found, first, virtual = np.full_like(q, np.inf), follows.robot.dof, follows.virtual
    for item in virtual.relaxations:
        band = virtual.widest(item.indices)
        if len(item.rows) == 1 or not np.isfinite(band):
            continue
        size = np.linalg.norm(deviation_of(follows, item, q), axis=1)
        beyond = size > band
        share = _INSIDE * band / np.where(beyond, size, 1.0)
        for k, joint in enumerate(virtual.each, first):
            if joint.row in item.indices:
                found[beyond, k] = share[beyond] * np.abs(q[beyond, k])
    return found


def has_windows(follows: Follows) -> bool:
    """Whether coordinates are held at 0 at any time."""
    return bool(follows.virtual.each and follows.virtual.windowed.any())


def windows_shut(follows: Follows) -> Follows:
    """Return the same with those coordinates held at 0 at all times, for integrated motions."""
    none = np.zeros(follows.robot.dof, dtype=np.bool_)
    held = np.append(none, follows.virtual.windowed)
    items = (
        replace(item, chain=cast(ExtendedChain, item.chain).with_held(held))
        for item in follows.items
    )
    return replace(follows, items=tuple(items))


def window_edges(follows: Follows) -> tuple[float, ...]:
    """Return the times at which coordinates start or end to be held [s]."""
    relaxations = follows.virtual.relaxations
    ends = {x for item in relaxations for x in item.window(follows.duration)}
    return tuple(sorted(ends - {0.0, follows.duration}))
