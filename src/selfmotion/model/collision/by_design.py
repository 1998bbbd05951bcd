"""Links that overlap by design: telescopes, bellows, links built one into the other."""

from collections.abc import Sequence

import numpy as np

from selfmotion.model.collision.exact import CollisionModel
from selfmotion.model.collision.overlaps import SAMPLES, srdf_line
from selfmotion.model.robot import RobotModel

# Share of configurations above which an overlap is by design.
ALWAYS = 0.95
# The same of what may be by design, and is for the user to say.
PERHAPS = 0.5
# The same where the links also overlap in the pose in which the arm is drawn.
_OFTEN = 0.2


def overlapping_by_design(
    arm: RobotModel, disabled: Sequence[tuple[str, str]] = (), *, share: float = ALWAYS
) -> dict[tuple[str, str], str]:
    """Return the pairs of links that overlap in nearly all configurations, or as they are drawn.

    With how often and how deep, in words. MoveIt's Setup Assistant calls them Always and Default.
    Nearly all is a `share` of them.
    """
    if not arm.urdf.has_collisions:
        return {}
    model = CollisionModel(arm, (), disabled)
    drawn = np.clip(np.zeros(arm.dof), arm.lower, arm.upper)
    deep = {frozenset((near.first, near.second)): -near.value for near in model.touching(drawn)}
    shares: dict[tuple[str, str], float] = {}
    for pair, count in zip(model.pairs, model.overlap_counts()[0].tolist(), strict=True):
        shares[pair] = max(count / SAMPLES, shares.get(pair, 0.0))
    # What is left out anyway is listed where it is not so in all configurations.
    found = {
        (x.first, x.second): f"overlap {x.extent}"
        for x in model.overlapping
        if not x.is_checked and ALWAYS <= x.share < 1.0
    }
    for pair, found_in in shares.items():
        depth = deep.get(frozenset(pair))
        if found_in >= share or (depth is not None and found_in >= _OFTEN):
            drawn_so = "" if depth is None else f", by {1e3 * depth:.1f} mm as they are drawn"
            found[pair] = f"overlap in {100.0 * found_in:.0f} % of all configurations{drawn_so}"
    return found


def overlap_warning(arm: RobotModel, model: CollisionModel) -> str:
    """Return in words which links of a model seem to overlap by design; "" for none.

    One sentence for all, with share of configurations, depth and remedy.
    """
    often = {
        (pair.first, pair.second): f"overlap in {100.0 * pair.share:.0f} % of all configurations"
        for pair in model.overlapping
        if pair.is_checked
    }
    if not often:
        return ""
    found = often | overlapping_by_design(arm, model.disabled)
    listed = "; ".join(f"{one} - {other}: these links {why}" for (one, other), why in found.items())
    pairs = ", ".join(f'["{one}", "{other}"]' for one, other in found)
    options = f"--set 'clearance.disabled=[{pairs}]'"
    lines = "".join(srdf_line(one, other) for one, other in found)
    return (
        f"{listed}. If that is how they are made, leave them out: {options} (init writes them into "
        f"its file), or by an SRDF (srdf=, --set clearance.srdf=FILE) with {lines}"
    )
