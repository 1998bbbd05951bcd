"""A plan's redundancy map for a page: colours, reasons, and configurations to stand in."""

from __future__ import annotations

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.robot import RobotModel
from selfmotion.planning.redundancy import (
    COST_COLORS,
    LEGEND,
    PIXELS,
    Reason,
    RedundancyMap,
    excess_cost,
    shown_scale,
)
from selfmotion.planning.result import Plan
from selfmotion.shell.replay.meshes import Json, Payload

# Steps of a joint's range, and of the range of costs, in which numbers travel: of a turn 0.1 mrad,
# of costs less than a shade that can be told from the next.
_JOINT_STEPS, _COST_STEPS = 2**16 - 1, 2**8 - 1
# Pixels where bodies are not convex: searching their surfaces takes twenty times as long as hulls.
_FEWER_PIXELS = (61, 61)
# Stands for no cause.
_NO_CAUSE = 2**16 - 1


def tree(robot: RobotModel, payload: Payload) -> Json:
    """Return what a page needs to put the links where a configuration has them."""
    arrays = robot.tree
    return {
        "coordinates": arrays.joints.tolist(),
        "parents": arrays.parents.tolist(),
        "rotations": payload.array(arrays.rotations, "f8"),
        "positions": payload.array(arrays.positions, "f8"),
        "axes": payload.array(arrays.axes, "f8"),
        "revolute": arrays.is_revolute.tolist(),
        "scales": arrays.scales.tolist(),
    }


def map_of(plan: Plan) -> RedundancyMap:
    """Return the map of a plan for a page: of as many pixels as take about a second."""
    are_convex = all(model.is_all_convex for model, _ in plan.problem.envelope.bodies)
    return plan.redundancy_map(shape=PIXELS if are_convex else _FEWER_PIXELS)


def packed_map(shown: RedundancyMap, payload: Payload) -> Json:
    """Return the JSON of a map; its arrays go into `payload`.

    Configurations are differences from pixel to pixel upwards on a grid of each joint's range,
    modulo 2¹⁶; without a configuration they stand still.
    """
    scale, unit = shown_scale(shown.unit)
    excess, high = excess_cost(shown.cost, shown.allowed)
    known = np.where(np.isfinite(excess), excess, 0.0)
    first, step, codes = _configurations(shown.q)
    present = [reason for reason in LEGEND if (shown.state == reason).any()]
    return {
        "label": shown.label,
        "unit": unit,
        "slice": shown.redundancy > 1,
        "t": payload.array(shown.times - shown.times[0]),
        "values": payload.array(scale * shown.coordinate),
        "line": payload.array(scale * shown.plan_line),
        "start": payload.array(scale * shown.minimum_norm_line),
        "state": payload.array(shown.state, "u1"),
        "cause": payload.array(np.where(shown.cause < 0, _NO_CAUSE, shown.cause), "u2"),
        "causes": list(shown.causes),
        "excess": payload.array(np.round(np.clip(known / high, 0.0, 1.0) * _COST_STEPS), "u1"),
        "least": payload.array(_least(shown)),
        "high": high,
        "capped": bool((known > high).any()),
        "costColors": list(COST_COLORS),
        "hasCost": bool(np.isfinite(shown.cost).any()),
        "reasons": [
            {"code": int(reason), "name": LEGEND[reason][0], "color": LEGEND[reason][1]}
            for reason in present
        ],
        "allowed": int(Reason.ALLOWED),
        "nowhere": int(Reason.NO_CONFIGURATION),
        "q": {"first": first, "step": step, "codes": payload.array(codes, "u2")},
    }


def _least(shown: RedundancyMap) -> Array:
    """Return the least cost density of what is allowed at each time, (N,); 0 where nothing is."""
    allowed = np.where(shown.allowed & np.isfinite(shown.cost), shown.cost, np.inf)
    least = allowed.min(axis=1)
    return np.where(np.isfinite(least), least, 0.0)


def _configurations(q: Array) -> tuple[list[float], list[float], Array]:
    """Return each joint's least coordinate and step, and the codes (n, N, M) of (N, M, n)."""
    known = q[~np.isnan(q).any(axis=2)]
    # Of a motion that is off its path there may be none.
    known = known if len(known) else np.zeros((1, q.shape[2]))
    low, high = known.min(axis=0), known.max(axis=0)
    step = np.maximum(high - low, np.finfo(np.float64).tiny) / _JOINT_STEPS
    places = np.round((np.where(np.isnan(q), low, q) - low) / step)
    rows = np.moveaxis(places, 2, 0)
    codes = np.mod(np.diff(rows, axis=2, prepend=0.0), 2.0**16)
    return low.tolist(), step.tolist(), np.asarray(codes)
