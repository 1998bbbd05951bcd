"""A plan's redundancy map for a page: colours, reasons, and the configuration at each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Progress, silent
from selfmotion.model.robot import RobotModel
from selfmotion.planning.redundancy import (
    COST_COLORS,
    LEGEND,
    Reason,
    RedundancyMap,
    excess_cost,
    shown_scale,
)
from selfmotion.planning.result import Plan
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.shell.replay.meshes import Json, Payload

# Quantisation of joints: 16 bits of each joint's range, some 0.1 mrad.
_JOINT_STEPS = 2**16 - 1
# Quantisation of costs: 8 bits of their range, finer than shades that can be seen.
_COST_STEPS = 2**8 - 1
# Numbers of pixels along the path and upwards.
Pixels = tuple[int, int]
# Pixels of jobs, of further slices, and where bodies are not convex, whose distances take twenty
# times as long as those of hulls.
FEWER_PIXELS: Pixels = (61, 61)
# Largest number of slices of a page.
SLICES = 3
# Jobs with more seams have no maps.
MAX_SEAMS = 24
# Code of "no cause".
_NO_CAUSE = 2**16 - 1


def tree(robot: RobotModel, payload: Payload) -> Json:
    """Return the kinematic tree, by which a page places links for a configuration."""
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


@dataclass(frozen=True, eq=False)
class SeamMaps:
    """The maps of a plan: one, or slices where there are several degrees of redundancy.

    Attributes
    ----------
    begin : float
        Start of the plan on the time axis of the page [s].
    name : str
        Of the seam; "" for a plan alone.
    maps : tuple of RedundancyMap
        In the order of `Plan.redundancy_coordinates`.
    """

    begin: float
    name: str
    maps: tuple[RedundancyMap, ...]


def slices(
    plan: Plan, most: Pixels, progress: Progress = silent, count: int = SLICES
) -> tuple[RedundancyMap, ...]:
    """Return the first `count` slices of a plan, of `most` pixels along either axis.

    Those after the first one, and all where a body is not convex, have at most `FEWER_PIXELS`.
    """
    are_convex = all(model.is_all_convex for model, _ in envelope_of_problem(plan.problem).bodies)
    fewer = (min(most[0], FEWER_PIXELS[0]), min(most[1], FEWER_PIXELS[1]))
    names = plan.redundancy_coordinates()[:count]
    return tuple(
        plan.redundancy_map(name, shape=most if k == 0 and are_convex else fewer, progress=progress)
        for k, name in enumerate(names)
    )


def packed_maps(seams: Sequence[SeamMaps], payload: Payload) -> list[Json]:
    """Return the JSON of maps; their arrays go into `payload`."""
    return [
        {
            "begin": one.begin,
            "name": one.name,
            "slices": [packed_map(shown, payload) for shown in one.maps],
        }
        for one in seams
    ]


def packed_map(shown: RedundancyMap, payload: Payload) -> Json:
    """Return the JSON of a map; its arrays go into `payload`.

    Joints are coded as differences from pixel to pixel along the coordinate, modulo 2¹⁶; pixels
    without a configuration have differences of 0.
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
