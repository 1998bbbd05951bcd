"""Drilling cycles: holes, down at the feed and straight out."""

from typing import NamedTuple

from selfmotion.basics import Array
from selfmotion.shop.cam.cuts import SAME_POSE, Machine

# Distance of the tool from the bottom of a hole that is there already, or comes back to break
# chips [m].
_OFF = 5e-4
_MAX_PECKS = 10_000


class Pecks(NamedTuple):
    """Peck cycle of a deep hole: depth of a peck [m], and full or partial retraction between."""

    first: float
    others: float
    is_out: bool


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

    Out, and down again where the hole is there already, it goes in rapids.

    Parameters
    ----------
    machine : Machine
        Whose line is read; its feed is that of the cut.
    above, bottom : (3,)
        Where the feed begins, and the bottom [m].
    axis : (3,)
        From the bottom to above it.
    pecks : Pecks, optional
    dwell : str
        What happens at the bottom, if anything.
    feeds_out : bool
        Whether it comes out at the feed, not faster.

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
            if pecks is not None and pecks.is_out:
                machine.rapid(above, axis)
            machine.rapid(above - max(0.0, done - _OFF) * axis, axis)
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
    """Return how deep it is after each peck."""
    if pecks is None:
        return [depth]
    if not min(pecks.first, pecks.others) > 0.0 or depth / pecks.others > _MAX_PECKS:
        raise machine.fault(
            f"drills by {1e3 * pecks.others:.4g} mm at once, expected a step above 0 (Q, STEP)"
        )
    depths, here = list[float](), pecks.first
    while here < depth - SAME_POSE:
        depths.append(here)
        here += pecks.others
    return [*depths, depth]
