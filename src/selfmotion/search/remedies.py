"""What would help where the arm cannot be at a pose: another place, a tilt, a wider limit."""

from dataclasses import replace
from typing import cast

import numpy as np

from selfmotion.basics import Array
from selfmotion.follow import AugmentedFollows
from selfmotion.search.settings import (
    FARTHEST,
    MOVE_TRIES,
    OVERSHOOT,
    REMEDY_SEEDS,
    SHRINKS,
    SHRUNK,
)
from selfmotion.search.single_poses import SinglePoses
from selfmotion.task import POSITION_ROWS, ROW_NAMES, Relaxation

_ROTATION_ROWS = ROW_NAMES[len(POSITION_ROWS) :]


def remedies(poses: SinglePoses, t: float, times: Array) -> list[str]:
    """Return in words what would let the arm be at the pose at t [s], each by itself.

    The path moved as a whole, so that at the other times [s], too, there are configurations; the
    tool turned away from its path at t; and one joint that goes farther, also at t.
    """
    found = []
    shift = nearest_place(poses, times)
    if shift is not None:
        # Rounded away from where the path is: what is told has to suffice.
        far = np.copysign(np.ceil(1e4 * np.abs(shift) - 1e-3) / 10.0, shift) + 0.0
        told = ", ".join(f"{axis} {x:+.4g}" for axis, x in zip("xyz", far, strict=True) if x)
        found.append(f"the path moved by {np.linalg.norm(far):.3g} mm ({told})")
    turn = least_deviation(poses, t, _ROTATION_ROWS)
    if turn is not None:
        found.append(f"the tool turned by {np.degrees(np.linalg.norm(turn)):.1f}° there")
    joint = least_excess(poses, t)
    if joint is not None:
        name, excess = joint
        unit = poses.problem.asked.robot.unit_of(name)
        found.append(f"joint '{name}' going {excess:.3g} {unit} beyond its limit")
    return found


def nearest_place(poses: SinglePoses, times: Array) -> Array | None:
    """Return a short way (3,) [m] by which the path has to be moved, None where none is found.

    So that at all the times [s] something is found: by as much as the first that is not needs, and
    then on. Bodies stay where they are.
    """
    shift = np.zeros(3)
    for _ in range(MOVE_TRIES):
        moved = poses.shifted(shift)
        blocked = moved.first_blocked(times)
        if blocked is None:
            return shift
        more = least_deviation(moved, blocked, POSITION_ROWS)
        if more is None:
            return None
        shift = shift + (1.0 + OVERSHOOT) * more
        if np.linalg.norm(shift) > FARTHEST:
            return None
    return None


def least_deviation(poses: SinglePoses, t: float, rows: tuple[str, ...]) -> Array | None:
    """Return the least deviation of some rows (3,) at t [s] with which something free is found.

    As far as tries tell: the least of many, and then less and less. None where nothing is found, or
    the task does not prescribe these rows.
    """
    asked = poses.problem.asked
    prescribed = [ROW_NAMES[k] for k in asked.task.rows]
    rows = tuple(row for row in rows if row in prescribed)
    if not rows:
        return None
    more = Relaxation(rows, FARTHEST if rows[0] in POSITION_ROWS else np.pi)
    others = (
        replace(item, rows=tuple(row for row in item.rows if row not in rows))
        for item in asked.relaxations
        if not set(item.rows) <= set(rows)
    )
    wider, n = poses.of(replace(asked, relaxations=(*others, more))), asked.robot.dof
    follows = cast(AugmentedFollows, wider.problem.follows)
    q = poses.some(t, REMEDY_SEEDS)[:, :n]
    q = np.hstack([q, np.zeros((len(q), follows.robot.dof - n))])
    best: Array | None = None
    for _ in range(SHRINKS):
        q, arrived = wider.project(q, t, far=True)
        q = q[arrived]
        q = q[wider.bounds.keep(q)]
        if not len(q):
            break
        away = follows.deviation(more, q)
        sizes = np.linalg.norm(away, axis=1)
        order = np.argsort(sizes)
        q, size = q[order], float(sizes[order[0]])
        if best is None or size < np.linalg.norm(best):
            best = np.zeros(6)
            best[more.indices] = away[order[0]]
        limits = follows.limits_within(more, SHRUNK * size)
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

    None where no single joint is in the way.
    """
    lower, upper = poses.bounds.lower, poses.bounds.upper
    seeds = poses.some(t, REMEDY_SEEDS)
    found: list[tuple[float, str]] = []
    for k, name in enumerate(poses.problem.asked.robot.joint_names):
        if not (np.isfinite(lower[k]) or np.isfinite(upper[k])):
            continue
        wide = poses.with_limits(
            np.where(np.arange(len(lower)) == k, -np.inf, lower),
            np.where(np.arange(len(upper)) == k, np.inf, upper),
        )
        q, arrived = wide.project(seeds, t, far=True)
        q = q[arrived]
        q = q[wide.bounds.keep(q)]
        excess = np.maximum(q[:, k] - upper[k], lower[k] - q[:, k])
        if len(q):
            found.append((float(excess.min()), name))
    if not found:
        return None
    excess, name = min(found)
    return name, excess
