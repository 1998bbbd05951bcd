"""Along which joints slices of a self-motion with several degrees tell most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.robot import null_space
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.redundancy.judging import local_cost
from selfmotion.problem.constraints import ActiveConstraint

# Displacement along a self-motion over which changes are compared [rad or m], configuration norm:
# a pixel or two of most maps.
_ASIDE = 0.05
# Changes below this share of the largest are none.
_NOTHING = 1e-9


def slices_of(
    formulation: Formulation, times: Array, z: Array, active: Sequence[ActiveConstraint]
) -> tuple[list[int], list[int]]:
    """Return the coordinates that limit a motion, and all that its self-motion moves.

    Each in order, the one that tells most first. What limits it is weighed by multipliers: a limit
    of a joint counts for that joint, the distance of two bodies for the joints along whose
    self-motion it changes, in proportion. The others are by how much the cost changes.

    Parameters
    ----------
    formulation : Formulation
    times : (K,)
        [s].
    z : (K, n)
        The motion in all coordinates.
    active : sequence of ActiveConstraint
        What keeps it from a lower cost.
    """
    steps = _steps(formulation, z)
    here = local_cost(formulation, times, z)
    changes = np.zeros(len(steps))
    for k, step in enumerate(steps):
        ahead, back = (local_cost(formulation, times, z + way * step) for way in (1.0, -1.0))
        changes[k] = np.mean(np.abs(ahead - back) + np.abs(ahead + back - 2.0 * here))
    # Costs that nobody can evaluate tell nothing.
    changes = np.where(np.isfinite(changes), changes, 0.0)
    moves = np.linalg.norm(steps, axis=2).max(axis=1) > _NOTHING
    limits = np.where(moves, _limits(formulation, times, z, steps, active), 0.0)
    limited = [int(k) for k in np.argsort(-limits, kind="stable") if limits[k] > 0.0]
    moved = [int(k) for k in np.argsort(-changes, kind="stable") if moves[k]]
    return limited, moved or [0]


def _steps(formulation: Formulation, z: Array) -> Array:
    """Return the steps along each coordinate's self-motion N Nᵀe, (n, K, n), of that length."""
    basis = null_space(formulation.follows.jacobians(z))
    along = np.einsum("knr,kjr->jkn", basis, basis)
    size = np.linalg.norm(along, axis=2, keepdims=True)
    return np.asarray(_ASIDE * along / np.maximum(size, _ASIDE))


def _limits(
    formulation: Formulation,
    times: Array,
    z: Array,
    steps: Array,
    active: Sequence[ActiveConstraint],
) -> Array:
    """Return what active constraints save along each coordinate, (n,)."""
    names, found = formulation.coordinates.names, np.zeros(len(steps))
    for item in active:
        named = [k for k, name in enumerate(names) if f"'{name}'" in item.easing]
        if named:
            found[named] += item.saving / len(named)
            continue
        during = [any(a <= t <= b for a, b in item.spans) for t in times]
        at = np.flatnonzero(during) if any(during) else np.arange(len(times))
        change = _apart(formulation, z[at], steps[:, at], item.easing)
        if change.max() > 0.0:
            found += item.saving * change / change.sum()
    return found


def _apart(formulation: Formulation, z: Array, steps: Array, easing: str) -> Array:
    """Return by how much the distance of the bodies that are named changes by each step, (n,)."""
    n, found = formulation.robot.dof, np.zeros(len(steps))
    for model, _ in formulation.envelope.bodies:
        for column, pair in enumerate(model.pairs):
            if not all(f"'{name}'" in easing for name in pair):
                continue
            wanted = np.full((len(z), len(model.pairs)), -np.inf)
            wanted[:, column] = np.inf
            for k, step in enumerate(steps):
                ahead, back = (
                    model.distances((z + way * step)[:, :n], wanted)[:, column]
                    for way in (1.0, -1.0)
                )
                found[k] += np.abs(ahead - back).mean()
    return found
