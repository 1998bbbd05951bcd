"""Configurations that bodies meet, moved along their self-motion until these are far enough apart.

Where the free part of a self-motion is small, as beside a plate that the tool nearly touches,
samples miss it. From one that is nearly free, Levenberg-Marquardt's method on what is missing of
the distances leads into it: with G their derivatives along the null space, and r what is
missing of each, the step is N (GᵀG + λI)⁻¹ Gᵀr.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.collision import ClearanceModel
from selfmotion.model.follow import Follows
from selfmotion.model.robot import null_space
from selfmotion.planning.search.search_bounds import SearchBounds

# Configurations that are moved: those that meet least …
_MAX_PUSHED = 24
# … of so many that are judged.
_JUDGED = 200
# Steps of each.
_STEPS = 12
# Distances are brought beyond what is required by this [m]: those of meshes have their own errors.
_MARGIN = 5e-4
# Distances have derivatives up to so far beyond that [m].
_NEAR = 0.02
# λ, as a share of the largest entry of GᵀG.
_DAMPING = 1e-3
# Longest step in any coordinate [rad, m, or in units of virtual joints].
_LONGEST = 0.2

Project = Callable[[Array], tuple[Array, Flags]]
"""q (K, n) → what Newton's method reaches of the path within limits, and where it does."""


class Pushing:
    """Moves configurations away from bodies, along the self-motions of poses.

    Parameters
    ----------
    follows : Follows
    bounds : SearchBounds
        Limits, and bodies with their required distances.
    """

    def __init__(self, follows: Follows, bounds: SearchBounds) -> None:
        self._follows, self._bounds = follows, bounds

    @cached_property
    def _models(self) -> list[tuple[ClearanceModel, float]]:
        bodies = self._bounds.bodies
        return [(ClearanceModel(exact, far + _NEAR), far) for exact, far in bodies]

    def free(self, q: Array, project: Project, held: Flags) -> Array:
        """Return free configurations that are reached from q (K, n) on the path, (K', n).

        As soon as there are some; none if all of them end elsewhere. Coordinates that are `held`
        (n,) stay at 0.
        """
        if not self._bounds.bodies or not len(q):
            return q[:0]
        q = self._nearly_free(q)
        for _ in range(_STEPS):
            moved, arrived = project(q + self._steps(q, held))
            free = moved[arrived][self._bounds.is_admissible(moved[arrived])]
            if len(free):
                return np.asarray(free)
            q = np.where(arrived[:, None], moved, q)
        return q[:0]

    def _nearly_free(self, q: Array) -> Array:
        """Return those that meet least, of some that are spread over all, (K', n)."""
        some = q[:: -(-len(q) // _JUDGED)]
        rooms = [
            (model.clearances(some[:, : model.robot.dof]).values - far).min(axis=1, initial=np.inf)
            for model, far in self._models
        ]
        return np.asarray(some[np.argsort(-np.min(rooms, axis=0), kind="stable")[:_MAX_PUSHED]])

    def _lacks(self, q: Array) -> list[tuple[Array, Array]]:
        """Return of each model what is missing of distances (K, P) [m], and their slopes."""
        found = []
        for model, far in self._models:
            dof = model.robot.dof
            distances = model.clearances(q[:, :dof])
            slopes = np.zeros((*distances.values.shape, q.shape[1]))
            slopes[:, :, :dof] = distances.jacobian()
            found.append((np.maximum(far + _MARGIN - distances.values, 0.0), slopes))
        return found

    def _steps(self, q: Array, held: Flags) -> Array:
        """Return a step of each configuration (K, n)."""
        moved = np.flatnonzero(~held)
        bases = np.zeros((*q.shape, len(moved) - self._follows.dimension))
        bases[:, moved] = null_space(self._follows.jacobians(q)[:, :, moved])
        each = self._lacks(q)
        lacks, slopes = (np.concatenate(parts, axis=1) for parts in zip(*each, strict=True))
        steps = np.zeros_like(q)
        for k, (basis, lack, slope) in enumerate(zip(bases, lacks, slopes, strict=True)):
            short = lack > 0.0
            along = slope[short] @ basis
            normal = along.T @ along
            damping = _DAMPING * normal.max(initial=0.0)
            if damping > 0.0:
                normal += damping * np.eye(len(normal))
                steps[k] = basis @ np.linalg.solve(normal, along.T @ lack[short])
        longest = np.abs(steps).max(axis=1, keepdims=True)
        return np.asarray(steps * np.minimum(1.0, _LONGEST / np.maximum(longest, _LONGEST)))
