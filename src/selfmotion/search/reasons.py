"""Why no chain of configurations passes a waypoint."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.collision import Closest, CollisionModel
from selfmotion.search.chains import unturned
from selfmotion.search.curves import CurveSet, SelfMotion
from selfmotion.search.nodes import Admissible


def why_blocked(
    motion: SelfMotion,
    target: Array,
    curves: CurveSet,
    alive: Array,
    nodes: Array,
    bounds: Admissible,
    largest_step: Array,
) -> str:
    """Return why no chain reaches a waypoint.

    Parameters
    ----------
    motion : SelfMotion
    target : (12,)
        The tool at the waypoint.
    curves : CurveSet
        All configurations there.
    alive : (A, n)
        Nodes of the waypoint before that chains reach; empty at the first waypoint.
    nodes : (N, n)
        Nodes at the waypoint.
    bounds : Admissible
    largest_step : (n,)
    """
    if not curves.curves:
        return f"no configuration puts '{motion.robot.tool}' on the path there"
    if len(nodes) == 0:
        samples = np.vstack([curve.q for curve in curves.curves])
        return f"of all configurations there, {_refusals(samples, bounds, motion)}"
    continued, arrived = motion.project_all(alive, target)
    ending = continued[arrived]
    ending = ending[~bounds.free(ending)]
    step = _step(alive, nodes, bounds, largest_step, motion)
    if not len(ending):
        return step
    # What ends is the cause; that the others are out of reach only follows.
    return (
        f"of the configurations that continue what was reached before, "
        f"{_refusals(ending, bounds, motion)}; to the others there is {step}"
    )


def _refusals(samples: Array, bounds: Admissible, motion: SelfMotion) -> str:
    """Say what excludes configurations: the joint or the pair nearest to allowing one."""
    excess = bounds.excess(samples)
    outside = excess.max(axis=1) > 0.0
    parts = []
    if np.any(outside):
        least = excess[outside][np.argmin(excess[outside].sum(axis=1))]
        joint = motion.robot.joint_names[int(np.argmax(least))]
        parts.append(
            f"{int(outside.sum())} of {len(samples)} are outside the joint limits, the nearest "
            f"by {least.max():.3g} in joint '{joint}'"
        )
    inside = samples[~outside]
    if len(inside) and bounds.bodies:
        configurations = bounds.representative(inside)
        distance, best = min(
            ((asked, _roomiest(model, configurations)) for model, asked in bounds.bodies),
            key=lambda found: found[1].value - found[0],
        )
        parts.append(
            f"{len(inside)} of {len(samples)} are in collision or nearer than "
            f"{1e3 * distance:.3g} mm, at best '{best.first}' and '{best.second}' with "
            f"{1e3 * best.value:.3g} mm"
        )
    return "; ".join(parts)


def _roomiest(model: CollisionModel, configurations: Array) -> Closest:
    """Return the closest pair of the configuration (of K, n) where that pair is farthest apart."""
    return max((model.distance(q) for q in configurations), key=lambda closest: closest.value)


def _step(
    alive: Array, nodes: Array, bounds: Admissible, largest_step: Array, motion: SelfMotion
) -> str:
    """Name the joint whose step limit keeps the nearest node away."""
    steps = np.abs(unturned(nodes[None] - alive[:, None], bounds.turning))
    ratios = (steps / largest_step).max(axis=-1)
    a, b = np.unravel_index(int(np.argmin(ratios)), ratios.shape)
    k = int(np.argmax(steps[a, b] / largest_step))
    return (
        f"the step limit: joint '{motion.robot.joint_names[k]}' would have to move by "
        f"{steps[a, b, k]:.3g} in one step, allowed are {largest_step[k]:.3g}"
    )
