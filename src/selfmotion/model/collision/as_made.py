"""Links that overlap as they are made: telescopes, bellows, what is built one into the other."""

from collections.abc import Sequence

import numpy as np

from selfmotion.model.collision.exact import CollisionModel
from selfmotion.model.collision.pairs import SAMPLES, srdf_line
from selfmotion.model.robot import RobotModel

# In so many configurations overlap is how links are made; in so many it is, where they overlap in
# the pose in which the arm is drawn as well.
_ALWAYS, _OFTEN = 0.95, 0.2


def overlapping_as_made(
    arm: RobotModel, disabled: Sequence[tuple[str, str]] = ()
) -> dict[tuple[str, str], str]:
    """Return the pairs of links that overlap in nearly all configurations, or as they are drawn.

    With how often and how deep, in words. MoveIt's Setup Assistant calls them Always and Default.
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
        if not x.is_checked and _ALWAYS <= x.share < 1.0
    }
    for pair, share in shares.items():
        depth = deep.get(frozenset(pair))
        if share >= _ALWAYS or (depth is not None and share >= _OFTEN):
            drawn_so = "" if depth is None else f", by {1e3 * depth:.1f} mm as they are drawn"
            found[pair] = f"overlap in {100.0 * share:.0f} % of all configurations{drawn_so}"
    return found


def told_as_made(arm: RobotModel, model: CollisionModel) -> str:
    """Return in words which links of a model overlap as they seem to be made; "" for none.

    All in one go, with how often and how deep, and what leaves them out.
    """
    often = {
        (pair.first, pair.second): f"overlap in {100.0 * pair.share:.0f} % of all configurations"
        for pair in model.overlapping
        if pair.is_checked
    }
    if not often:
        return ""
    found = often | overlapping_as_made(arm, model.disabled)
    listed = "; ".join(f"{one} - {other}: these links {why}" for (one, other), why in found.items())
    options = " ".join(f"--disabled {one},{other}" for one, other in found)
    lines = "".join(srdf_line(one, other) for one, other in found)
    return (
        f"{listed}. If that is how they are made, leave them out: {options} (init writes them into "
        f"its file), or by an SRDF (srdf=, --srdf) with {lines}"
    )
