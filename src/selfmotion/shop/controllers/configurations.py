"""Configurations of arms that reach a pose, in the numbers of the makers."""

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.shop.controllers.tool_frames import ToolFrames

# ABB's ``confdata`` (Technical reference manual, RAPID Instructions, Functions and Data types,
# 3HAC050917-001): cf1, cf4 and cf6 are quarter turns of axes 1, 4 and 6 from their zeros on,
# rounded down; cfx counts 4 for a wrist behind axis 1, 2 for one behind the lower arm, and 1
# where axis 5 is negative. KUKA's status and turn (KSS 8.3, Operating and Programming
# Instructions for System Integrators): S counts 1 for a wrist behind axis 1 (overhead), 2 for
# axis 3 beyond the angle at which the arm is stretched, 4 where axis 5 is negative; T counts 2^(k
# - 1) where axis k is negative.
#
# S and cfx are of arms whose wrist axes meet in a point, whose axes 2 and 3 are parallel, and
# whose zero is that of the maker: the wrist is in front, the arm bent (ABB) or stretched (KUKA).
# Of others, such as those of Universal Robots, they are not known.

# Distance of axes that meet [m].
_MEET = 1e-4
# Sine of the angle between axes that are parallel.
_PARALLEL = 1e-3
# Distance by which a wrist is in front [m].
_IN_FRONT = 0.05
# Sine above which an arm is bent at zero, as ABB's are; KUKA's are stretched but for an offset.
_BENT = 0.5


class Sides(NamedTuple):
    """Configuration of an arm: wrist in front of axis 1, elbow bent; and the same at zero."""

    front: bool
    bent: bool
    stands_at_zero: bool


def confdata(frames: ToolFrames, q: Array) -> tuple[int, int, int, int | None]:
    """Return ABB's cf1, cf4, cf6 and cfx at q (n,); None for a cfx that is not known."""
    angles = q[frames.arm]
    quarters = [int(np.floor(np.degrees(angles[k]) / 90.0)) for k in (0, 3, 5)]
    sides = _sides(frames, q)
    if sides is None or not sides.stands_at_zero:
        return quarters[0], quarters[1], quarters[2], None
    cfx = 4 * (not sides.front) + 2 * (not sides.bent) + int(angles[4] < 0.0)
    return quarters[0], quarters[1], quarters[2], cfx


def status_and_turn(frames: ToolFrames, q: Array) -> tuple[int | None, int]:
    """Return KUKA's S and T at q (n,); None for an S that is not known."""
    angles = q[frames.arm]
    turn = sum(1 << k for k in range(6) if angles[k] < 0.0)
    sides = _sides(frames, q)
    if sides is None or sides.stands_at_zero:
        return None, turn
    return int(not sides.front) + 2 * int(sides.bent) + 4 * int(angles[4] < 0.0), turn


def _sides(frames: ToolFrames, q: Array) -> Sides | None:
    zero = np.array(q)
    zero[frames.arm] = 0.0
    at_zero, here = _distances(frames, zero), _distances(frames, q)
    if at_zero is None or here is None or abs(at_zero[0]) < _IN_FRONT:
        return None
    # Axis 3 of some arms turns the other way: at ABB's zero the wrist is in front of the lower arm.
    stands = abs(at_zero[1]) > _BENT
    bent = here[1] * at_zero[1] > 0.0 if stands else here[1] > 0.0
    return Sides(bool(here[0] * at_zero[0] >= 0.0), bool(bent), stands)


def _distances(frames: ToolFrames, q: Array) -> tuple[float, float] | None:
    """Return how far the wrist is ahead of axis 1 [m], and the sine by which the arm is bent."""
    jacobian, _, tip = frames.robot.chain_to(frames.robot.tool).at(q)
    axes = jacobian[3:, frames.arm].T
    # v = a × (tip - p), p the point of the axis that is nearest to the tip.
    points = tip + np.cross(axes, jacobian[:3, frames.arm].T)
    wrist = _meeting(axes[3:], points[3:])
    first, second, third = axes[:3]
    is_known = (
        wrist is not None
        and np.linalg.norm(np.cross(second, third)) < _PARALLEL
        and abs(first @ second) < _PARALLEL
    )
    if wrist is None or not is_known:
        return None
    ahead = float((wrist - points[0]) @ np.cross(second, first))
    # In the plane across axes 2 and 3.
    lower, fore = (x - third * (x @ third) for x in (points[2] - points[1], wrist - points[2]))
    size = float(np.linalg.norm(lower) * np.linalg.norm(fore))
    return (ahead, float(np.cross(lower, fore) @ third) / size) if size > 0.0 else None


def _meeting(axes: Array, points: Array) -> Array | None:
    """Return the point in which lines meet, None where they do not."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    if np.linalg.cond(across.sum(axis=0)) > 1e6:
        return None
    point = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points))
    far = np.linalg.norm(np.einsum("kij,kj->ki", across, point - points), axis=1).max()
    return point if far < _MEET else None
