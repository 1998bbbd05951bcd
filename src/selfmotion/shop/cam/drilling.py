"""Drilling cycles of G-code and APT: down at the feed, in one go or by pecks, and out."""

from typing import NamedTuple

from selfmotion.basics import Array
from selfmotion.shop.cam.cuts import SAME_POSE, Machine

# Distance from the depth drilled so far to which the tool returns in a rapid, and which it retracts
# to break chips [m].
_CHIP_CLEARANCE = 5e-4
_MAX_PECKS = 10_000


class Pecks(NamedTuple):
    """Peck cycle of a deep hole.

    Attributes
    ----------
    first, others : float
        Depth of the first peck, and of the others [m].
    retracts_fully : bool
        Whether the tool leaves the hole after each peck, not only breaks the chip.
    """

    first: float
    others: float
    retracts_fully: bool


def drill(
    machine: Machine,
    above: Array,
    bottom: Array,
    axis: Array,
    *,
    pecks: Pecks | None = None,
    dwell: str = "",
    feeds_out: bool = False,
) -> None:
    """Drill a hole: from a place above it to its bottom and back.

    The tool leaves the hole in rapids, and returns in them as far as it has drilled.

    Parameters
    ----------
    machine : Machine
        The machine whose line is read; the cut is at its feed.
    above, bottom : (3,)
        Where the cut begins, and the bottom of the hole [m].
    axis : (3,)
        Unit vector from the bottom to above the hole.
    pecks : Pecks, optional
    dwell : str
        Event at the bottom; "" for none.
    feeds_out : bool
        Whether the tool leaves the hole at the feed, not in a rapid.

    Raises
    ------
    FileFormatError
        The hole has no depth, or needs too many pecks.
    """
    depth = float((above - bottom) @ axis)
    if not depth > 0.0:
        raise machine.fault(
            f"the hole ends {-1e3 * depth:.4g} mm above where it begins, expected a depth"
        )
    machine.rapid(above, axis)
    done = 0.0
    for reached in _depths(machine, depth, pecks):
        if done > 0.0:
            if pecks is not None and pecks.retracts_fully:
                machine.rapid(above, axis)
            machine.rapid(above - max(0.0, done - _CHIP_CLEARANCE) * axis, axis)
        machine.cut(above - reached * axis, axis)
        done = reached
    if dwell:
        machine.happens(dwell)
    if feeds_out:
        machine.cut(above, axis)
    else:
        machine.rapid(above, axis)
    machine.ends_hole()


def _depths(machine: Machine, depth: float, pecks: Pecks | None) -> list[float]:
    """Return the depth after each peck [m]."""
    if pecks is None:
        return [depth]
    if not min(pecks.first, pecks.others) > 0.0 or depth / pecks.others > _MAX_PECKS:
        raise machine.fault(
            f"drills by {1e3 * pecks.others:.4g} mm at once, expected a step above 0 (Q, STEP)"
        )
    depths, reached = list[float](), pecks.first
    while reached < depth - SAME_POSE:
        depths.append(reached)
        reached += pecks.others
    return [*depths, depth]
