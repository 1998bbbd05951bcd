"""Clearances that an optimiser follows: of convex hulls, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags
from selfmotion.model.collision.bodies import place_of
from selfmotion.model.collision.distances import Ints
from selfmotion.model.collision.exact import CollisionModel
from selfmotion.model.collision.overlaps import SAMPLES, hull_overlaps
from selfmotion.model.task import SE3

# Share of sampled configurations in which hulls of a pair may overlap although its links do not.
_FALSE_ALARMS = 0.1


@dataclass(frozen=True, eq=False)
class Clearances:
    """Distances over the samples of a motion, and their derivatives by the configuration.

    Attributes
    ----------
    values : (K, P)
        Signed distance of each pair at each sample [m], levelled off where it is large.
    rows, columns : (M,)
        Where in `values` a pair is near enough to have a derivative other than zero; by rows.
    slopes : (M, n)
        The derivatives there.
    """

    values: Array
    rows: Ints = field(repr=False)
    columns: Ints = field(repr=False)
    slopes: Array = field(repr=False)

    def along(self, tangents: Array) -> Array:
        """Return the changes of the distances along motions of the samples, (K, P, d).

        Parameters
        ----------
        tangents : (K, n, d)
            Derivatives of the configurations by d parameters.
        """
        changes = np.zeros((*self.values.shape, tangents.shape[2]))
        terms = self.slopes[:, None] @ tangents[self.rows]
        changes[self.rows, self.columns] = terms[:, 0]
        return changes

    def slopes_at(self, samples: Ints, pairs: Ints) -> Array:
        """Return ∂d/∂q of some pairs at some samples (k,), (k, n)."""
        width = self.values.shape[1]
        listed = self.rows * width + self.columns
        wanted = samples * width + pairs
        at = np.minimum(np.searchsorted(listed, wanted), max(len(listed) - 1, 0))
        near = listed[at] == wanted if len(listed) else np.zeros(len(wanted), dtype=bool)
        slopes = np.zeros((len(wanted), self.slopes.shape[1]))
        slopes[near] = self.slopes[at[near]]
        return slopes

    def jacobian(self) -> Array:
        """Return ∂d/∂q, (K, P, n); most of it is zero, see `slopes`."""
        jacobian = np.zeros((*self.values.shape, self.slopes.shape[1]))
        jacobian[self.rows, self.columns] = self.slopes
        return jacobian


class ClearanceModel:
    """Signed distances of the bodies' convex hulls, with derivatives.

    A non-convex mesh obstacle is decomposed: each of the convex pieces that contain it
    (`Solid.pieces`) is a body here. The distance of two hulls (GJK, and minus the depth by EPA
    where they overlap) is a lower bound of that of the bodies. It is differentiable but where the
    closest points jump. From `near` on it saturates: with s = d - near and w = `width`, it is near
    + s - s²/(2w), and near + w/2 from s = w on. Pairs farther apart than that cost no more than a
    test of their bounding boxes.

    Parameters
    ----------
    exact : CollisionModel
        Whose robot, obstacles and pairs of links are taken.
    near : float
        Up to here the values are the distances of the hulls [m].
    width : float
        Over this distance beyond, they level off [m].
    decompose_links : bool, optional
        Whether non-convex links are decomposed before obstacles, too: that takes longer.

    Attributes
    ----------
    pairs : tuple of (str, str)
        Names for the P columns of `Clearances.values`; a body of several pieces appears repeatedly.

    Notes
    -----
    Hulls may overlap where their links do not. Judged over 500 sampled configurations, two
    links are not paired when this happens at all though they never meet, or in more than a tenth
    of the samples; a link and an obstacle, when it happens in each. These pairs are left
    to the exact model, so a motion that is clear here still needs its verdict.

    Not for use by several threads at once.
    """

    def __init__(
        self,
        exact: CollisionModel,
        near: float = 0.02,
        width: float = 0.02,
        *,
        decompose_links: bool = False,
    ) -> None:
        self.robot, self._exact, self._near, self._width = exact.robot, exact, near, width
        self._hulls, self._of = exact.decomposed(links=decompose_links)
        self._selected = self._useful()
        self.pairs = tuple(exact.pairs[i] for i in self._of[self._selected])
        first, second = exact.hulls.pairs[self._of[self._selected]].T
        moved = exact.moved.astype(np.float64)
        # Which joints move the first body, less those that move the second.
        self._sides = moved[first] - moved[second]
        self._last: tuple[Array, Array] | None = None

    def clearances(self, q_samples: npt.ArrayLike) -> Clearances:
        """Return the distances at samples (K, n).

        Raises
        ------
        RobotError
            The shape is not (K, n), or a number is not finite.
        """
        q = self._exact.samples(q_samples)
        hulls, reach = self._hulls, self._near + self._width
        bounds = hulls.lower_bounds(q, reach)[:, self._selected]
        values = np.maximum(bounds, self._least_by_last(q))
        rows, columns = np.nonzero(values < reach)
        given = rows, self._selected[columns], bounds[rows, columns]
        contacts = hulls.contacts(q, *given, within=reach)
        values[rows, columns] = contacts.values
        self._last = q.copy(), values.copy()
        slopes = contacts.slopes * self._sides[columns]
        beyond = np.clip(values - self._near, 0.0, self._width)
        slopes *= 1.0 - beyond[rows, columns, None] / self._width
        values = np.minimum(values, self._near) + beyond * (1.0 - 0.5 * beyond / self._width)
        values.setflags(write=False)
        return Clearances(values, rows, columns, slopes)

    def closer(self, q_samples: npt.ArrayLike, margin: float) -> Flags:
        """Return at which samples (K, n) a pair's hulls are closer than the margin [m], (K,).

        As `clearances` has them, up to `near`, much sooner.

        Raises
        ------
        RobotError
            The shape is not (K, n), or a number is not finite.
        """
        q = self._exact.samples(q_samples)
        bounds = np.full((len(q), len(self._of)), np.inf)
        selected = self._selected
        bounds[:, selected] = self._hulls.lower_bounds(q, margin)[:, selected]
        every, travelled = np.ones(len(self._of), dtype=bool).tolist(), None
        if not self._hulls.has_moved:
            steps = np.abs(np.diff(q, axis=0, prepend=q[:1]))
            travelled = np.cumsum(steps, axis=0) @ self._levers(q)[self._of].T
        return self._hulls.closer(q, bounds, margin, every, travelled)[0]

    def _levers(self, q: Array) -> Array:
        """Return the levers of the exact model's pairs where joints go as far as at q (K, n)."""
        return self._exact.pair_levers_up_to(np.abs(q).max(axis=0, initial=0.0))

    def _least_by_last(self, q: Array) -> Array | float:
        """Return lower bounds of the distances at q (K, n), (K, P), by those asked for last.

        These were at samples nearby where a motion is optimised.
        """
        if self._hulls.has_moved or self._last is None or self._last[0].shape != q.shape:
            return -np.inf
        before, values = self._last
        levers = self._levers(np.concatenate([before, q]))[self._of[self._selected]]
        return np.asarray(values - np.abs(q - before) @ levers.T)

    def move(self, obstacle: str, pose: SE3) -> None:
        """Put an obstacle somewhere else in its frame, for this model and its `exact` one's hulls.

        The meshes of `exact` stay where they are: it is not for measuring any more.
        """
        item = next(item for item in self._exact.obstacles if item.name == obstacle)
        self._hulls.move(obstacle, place_of(item, pose, self.robot)[1])

    @property
    def pair_levers(self) -> Array:
        """The pairs' lever arms, (P, n): see `CollisionModel.pair_levers`."""
        return self._exact.pair_levers[self._of[self._selected]]

    def displacement(self, obstacle: str, pose: SE3) -> float:
        """Return by how much a point of a body on a link moves on it at most for a pose [m].

        0 of obstacles in the world, which no joint moves.
        """
        item = next(item for item in self._exact.obstacles if item.name == obstacle)
        if item.frame is None:
            return 0.0
        before, after = item.pose, pose
        body = next(body for body in self._exact.every_body if body.name == obstacle)
        size = np.maximum(np.abs(body.solid.low), np.abs(body.solid.high))
        shift = float(np.linalg.norm(after.translation - before.translation))
        turned = float(np.linalg.norm(after.rotation - before.rotation, ord=2))
        return shift + turned * float(np.linalg.norm(size))

    def is_exact(self, column: int) -> bool:
        """Whether the bodies of a pair are their own convex hulls."""
        return self._exact.is_convex(int(self._of[self._selected[column]]))

    @property
    def left_out(self) -> tuple[tuple[str, str], ...]:
        """Pairs of bodies without any piece here: the exact model alone checks them."""
        return tuple(self._exact.pairs[k] for k in self._unselected)

    def of_left_out(self) -> CollisionModel:
        """Return the exact model of the pairs that are left out."""
        return self._exact.of_pairs([tuple(self._exact.index[k]) for k in self._unselected])

    @property
    def _unselected(self) -> list[int]:
        selected = set(self._of[self._selected].tolist())
        return [k for k in range(len(self._exact.pairs)) if k not in selected]

    def _useful(self) -> Ints:
        """Return the indices of pairs whose hulls overlap hardly more often than the bodies."""
        exact = self._exact
        met, alone = exact.overlap_counts()
        allowed = np.where(met > 0, _FALSE_ALARMS * SAMPLES, 0.0)
        allowed = np.where(exact.to_world, SAMPLES - 1.0, allowed)
        selected = (alone <= allowed)[self._of]
        # Pieces of a body overlap less often than its hull.
        parted = np.bincount(self._of, minlength=len(exact.pairs)) > 1
        open_ = np.flatnonzero(~selected & parted[self._of])
        often = hull_overlaps(self.robot, self._hulls, open_)
        selected[open_] = often <= (met * ~exact.to_world + allowed)[self._of[open_]]
        return np.flatnonzero(selected)
