"""The cost of a motion given by its nodes, with its gradient and its curvature.

Each interval's cost depends on its two nodes alone, so that the matrix of second derivatives is
block-tridiagonal. With x = (q, q̇, q̈) of a node as functions of its coordinates w = (z, ν, α),
Γ = ∂x/∂w and λ = ∂F/∂x,

    ∂F/∂w = Γᵀλ,   ∂²F/∂w∂w' = Γᵀ (∂²F/∂x∂x') Γ' + [w is w'] ∂(Γᵀλ)/∂w at fixed λ.

Where costs are quadratic forms of q and its derivatives, the first term is exact. Of others, second
derivatives are differences of gradients: by q along the self-motion, which is where nodes can go,
and by the rates. The last term, the manifold's own curvature, is made of differences along the
manifold, and of what is linear or quadratic in ν and α.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation, SampledMotion
from selfmotion.planning.nodes.charts import Bases, Charts, Place, orthonormal
from selfmotion.planning.nodes.smoothness import Smoothing
from selfmotion.planning.nodes.spline import AT_GAUSS, GAUSS, WEIGHTS, Quintic
from selfmotion.problem.costs import Partials, PlacedLater, Samples

# Step of central differences along a manifold [rad or m]: first derivatives are right to 1e-8,
# second ones to 1e-6.
_REACH = 1e-4
# Step of one-sided differences of costs' gradients [rad, m and their rates]: this matrix need not
# be exact.
_NEAR = 1e-6
# Derivatives of a sample, by order.
_NAMES = ("q", "qd", "qdd", "qddd")
# Intervals in one chunk of a matrix product, which bounds memory: factors are larger than the
# product.
_CHUNK = 2048
# Samples, or nodes, that are evaluated in one pass, of several directions.
_TOGETHER = 4096


class NodeCost:
    """F = ∫ Σ G dt along the quintic segments between the nodes.

    Costs are functions of the arm's joints, which are the first of all coordinates: their
    derivatives by the others, 0, are filled in here.

    Parameters
    ----------
    formulation : Formulation
    spline : Quintic
    smoothing : Smoothing, optional
        Minimised besides, and no part of the costs.
    """

    def __init__(
        self,
        formulation: Formulation,
        spline: Quintic,
        smoothing: Smoothing | None = None,
    ) -> None:
        self._spline, self._costs = spline, formulation.costs
        self._springs = formulation.springs
        self._bent = tuple(cost for cost in self._costs if not cost.is_quadratic)
        self._dof, self._follows = formulation.robot.dof, formulation.problem.follows
        self._smoothing: tuple[Array, Array] | None = None
        if smoothing is not None:
            each = [self._stiffness(order, b) for order, b in smoothing.shares.items()]
            self._smoothing = np.sum(each, axis=0), smoothing.weight

    @cached_property
    def _forms(self) -> list[tuple[Array, Array]]:
        """K and W of all that is quadratic in the arm's joints, see `_stiffness`."""
        found = [] if self._smoothing is None else [self._smoothing]
        for cost in (cost for cost in self._costs if cost.is_quadratic):
            for order, weight in cost.curvature(self._dof).items():
                found.append((self._stiffness(order), weight))
        return found

    def _stiffness(self, order: int, shares: Array | None = None) -> Array:
        """Return K of ½ Σ K_ab y_aᵀWy_b for the ends y of each interval, (N, 6, 6)."""
        table, scale = AT_GAUSS[order], self._spline.rates(2 * order) * self._spline.steps
        scale[self._spline.gaps] = 0.0
        if shares is None:
            return np.asarray(scale[:, None, None] * (table.T @ (WEIGHTS[:, None] * table)))
        weighted = (WEIGHTS * shares)[:, :, None] * table
        return np.asarray(scale[:, None, None] * (table.T @ weighted))

    def integrand(self, motion: SampledMotion) -> Array:
        """Return Σ G at the samples, (S,)."""
        found = np.sum([cost.value(motion.arm) for cost in self._costs], axis=0)
        if self._springs is not None:
            found = found + 0.5 * motion.tolerances.q**2 @ self._springs
        return np.asarray(found)

    def terms(self, samples: Samples) -> dict[str, float]:
        """Return the contribution of each cost to F, for the motion of the arm."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def roughness(self, ends: Array) -> float:
        """Return the contribution of the smoothing, for y (N, 6, n)."""
        if self._smoothing is None:
            return 0.0
        stiffness, weight = self._smoothing
        own = ends[:, :, : self._dof]
        return 0.5 * float(np.sum((stiffness @ own) * (own @ weight)))

    def partials(self, samples: Samples) -> tuple[Partials, ...]:
        """Return the derivatives of the integrand of each cost, for the motion of the arm."""
        return tuple(cost.gradient(samples) for cost in self._costs)

    def slopes(self, samples: Samples, ends: Array, partials: Sequence[Partials]) -> Array:
        """Return the derivatives of each interval's cost by y, (N, 6, n)."""
        together, spline = _summed(partials), self._spline
        weights = samples.weights.reshape(spline.count, -1, 1)
        found = np.zeros_like(ends)
        own = found[:, :, : self._dof]
        for order, name in enumerate(_NAMES):
            part = getattr(together, name)
            if part is not None:
                each = weights * spline.rates(order)[:, None, None]
                own += AT_GAUSS[order].T @ (each * part.reshape(*weights.shape[:2], -1))
        if self._smoothing is not None:
            stiffness, weight = self._smoothing
            own += stiffness @ (ends[:, :, : self._dof] @ weight)
        if self._springs is not None:
            found[:, :, self._dof :] += self._stiffness(0) @ (
                ends[:, :, self._dof :] * self._springs
            )
        return found

    def _of_bent(self, partials: Sequence[Partials]) -> Partials:
        """Return the summed derivatives of all costs that are not quadratic forms."""
        both = zip(self._costs, partials, strict=True)
        return _summed([own for cost, own in both if not cost.is_quadratic])

    def curvature(self, samples: Samples, partials: Sequence[Partials], both: Array) -> Array:
        """Return Γᵀ (∂²F) Γ on each interval, by w of its left, then its right node, (N, d, d).

        `both` (N, n, 6, d) are the changes of y.
        """
        count, _, _, size = both.shape
        found = np.zeros((count, size, size))
        for first in range(0, count, _CHUNK):
            part = slice(first, first + _CHUNK)
            found[part] = _form(self._forms, part, both[part, : self._dof])
            if self._springs is not None:
                springs = [(self._stiffness(0), np.diag(self._springs))]
                found[part] += _form(springs, part, both[part, self._dof :])
        if self._bent:
            found += self._bending(samples, self._of_bent(partials), both)
        return found

    def _bending(self, samples: Samples, here: Partials, both: Array) -> Array:
        """Return the contribution of costs that are not quadratic forms, with derivatives `here`.

        By differences along the self-motion, and by one joint's rate after the other.
        """
        spline, (count, dof, _, size) = self._spline, both.shape
        r, each, n = size // 6, len(GAUSS), self._dof
        by = [
            np.moveaxis(table @ both[:, :n], 1, 2).reshape(-1, n, size)
            * np.repeat(spline.rates(order), each)[:, None, None]
            for order, table in enumerate(AT_GAUSS)
        ]
        places = np.moveaxis(AT_GAUSS[0] @ both, 1, 2).reshape(-1, dof, size)
        # Self-motion directions at the samples: interpolated between the nodes.
        left, right = both[:, None, :, 0, :r], both[:, None, :, 3, 3 * r : 4 * r].copy()
        right[spline.gaps] = left[spline.gaps]
        share = GAUSS[:, None, None]
        along = (left + share * (right - left)).reshape(-1, dof, r)
        along[np.repeat(np.isin(np.arange(count), spline.gaps), each)] = np.eye(dof)[:, :r]
        along = orthonormal(along)
        moved, weights = np.swapaxes(along, 1, 2) @ places, samples.weights[:, None, None]
        own = along[:, :n]
        directions = [("q", own[:, :, x]) for x in range(r)]
        changed = self._changes(samples, here, directions)
        found = np.zeros((count, size, size))
        if "q" in changed:
            turned = np.swapaxes(own, 1, 2) @ changed["q"]
            found += _squared(count, moved, weights * turned @ moved)
        for order, name in enumerate(_NAMES[1:], 1):
            if name in changed:
                found += 2.0 * _squared(count, by[order], weights * changed[name] @ moved)
        rates = [o for o, name in enumerate(_NAMES) if o and getattr(here, name) is not None]
        for order in rates:
            axes = [(_NAMES[order], axis) for axis in np.eye(n)]
            faster = self._changes(samples, here, axes)
            for other in rates:
                if _NAMES[other] in faster:
                    turned_by = weights * faster[_NAMES[other]] @ by[order]
                    found += _squared(count, by[other], turned_by)
        return np.asarray(0.5 * (found + np.swapaxes(found, 1, 2)))

    def _changes(
        self, samples: Samples, here: Partials, directions: Sequence[tuple[str, Array]]
    ) -> dict[str, Array]:
        """Return changes of non-quadratic costs' derivatives `here` in directions, (S, n, D) each.

        A direction is of q or one of its rates, (S, n) or (n,). Several are evaluated in one pass
        where there are few samples.
        """
        together = max(1, _TOGETHER // len(samples.t))
        found: dict[str, list[Array]] = {}
        for first in range(0, len(directions), together):
            for name, part in self._changed(
                samples, here, directions[first : first + together]
            ).items():
                found.setdefault(name, []).append(part)
        return {name: np.concatenate(parts, axis=2) for name, parts in found.items()}

    def _changed(
        self, samples: Samples, here: Partials, directions: Sequence[tuple[str, Array]]
    ) -> dict[str, Array]:
        """Return the result of `_changes`, all directions in one pass."""
        count, copies = len(samples.t), len(directions)
        flat = {name: np.tile(getattr(samples, name), (copies, 1)) for name in _NAMES}
        for k, (name, direction) in enumerate(directions):
            flat[name][k * count : (k + 1) * count] += _NEAR * direction
        t, weights = (np.tile(values, copies) for values in (samples.t, samples.weights))
        sampling = Sampling(t, weights, np.arange(len(t)))
        shifted = PlacedLater(self._follows, sampling, **flat)
        there = _summed([cost.gradient(shifted) for cost in self._bent])
        parts = {}
        for name in _NAMES:
            before, after = getattr(here, name), getattr(there, name)
            if before is not None and after is not None:
                change = (after.reshape(copies, count, -1) - before) / _NEAR
                parts[name] = np.moveaxis(change, 0, 2)
        return parts


def _squared(count: int, left: Array, right: Array) -> Array:
    """Return Σ leftᵀ right over the samples of each interval, (N, d, d), of (S, k, d) each."""
    size = left.shape[2]
    flat = left.reshape(count, -1, size)
    return np.asarray(np.swapaxes(flat, 1, 2) @ right.reshape(count, -1, size))


def _form(forms: Sequence[tuple[Array, Array]], part: slice, both: Array) -> Array:
    """Return Γᵀ ∂²F Γ of quadratic forms on some intervals, (N, d, d), for changes of y."""
    count, n, _, size = both.shape
    flat = both.reshape(count, 6 * n, size)
    turned = _bent_by(forms, part, both).reshape(count, 6 * n, size)
    return np.asarray(np.swapaxes(flat, 1, 2) @ turned)


def _bent_by(forms: Sequence[tuple[Array, Array]], part: slice, both: Array) -> Array:
    """Return ∂²F of quadratic forms on some intervals times changes of y, (N, n, 6, d)."""
    found, shape = np.zeros_like(both), (both.shape[0], both.shape[1], -1)
    for stiffness, weight in forms:
        turned, diagonal = stiffness[part, None] @ both, np.diagonal(weight)
        if np.array_equal(weight, np.diag(diagonal)):
            found += diagonal[:, None, None] * turned
        else:
            found += (weight @ turned.reshape(shape)).reshape(both.shape)
    return found


def _summed(each: Sequence[Partials]) -> Partials:
    """Return the sum of derivatives."""
    parts = {}
    for name in (*_NAMES, "error"):
        own = [part for part in (getattr(one, name) for one in each) if part is not None]
        if own:
            parts[name] = own[0] if len(own) == 1 else np.sum(own, axis=0)
    return Partials(**parts)


@dataclass(frozen=True, eq=False)
class LocalModel:
    """Derivatives of the nodes by their coordinates, to second order.

    Attributes
    ----------
    changes : (N + 1, 3, n, 3r)
        Γ = ∂(q, q̇, q̈)/∂(z, ν, α).
    curvature : (N + 1, 3r, 3r)
        ∂(Γᵀλ)/∂w at fixed λ, symmetric.
    """

    changes: Array
    curvature: Array

    @classmethod
    def of(
        cls, charts: Charts, nu: Array, alpha: Array, place: Place, force: Array
    ) -> "LocalModel | None":
        """Return the model at the reference of charts; None where a neighbour cannot be evaluated.

        `place` is that of the nodes there, `force` (N + 1, 3, n) is λ.
        """
        count, n, r = charts.bases.shape
        here = charts.bases_at(place)
        changes, curvature = np.zeros((count, 3, n, 3 * r)), np.zeros((count, 3 * r, 3 * r))
        changes[:, 0, :, :r] = charts.bases
        changes[:, 1, :, r : 2 * r] = changes[:, 2, :, 2 * r :] = here.by_rate
        changes[:, 2, :, r : 2 * r] = here.by_both
        middle, axes = _along(force, place.nodes), np.eye(r)
        sides = _displaced(charts, np.concatenate([axes, -axes]), nu, alpha)
        if sides is None:
            return None
        nodes, bases = sides
        differences = (nodes[:r] - nodes[r:]) / (2.0 * _REACH)
        changes[:, 1:, :, :r] = np.moveaxis(differences[:, :, 1:], 0, -1)
        values = _along(force, nodes)
        bends = (values[:r] - 2.0 * middle + values[r:]) / _REACH**2
        curvature[:, np.arange(r), np.arange(r)] = bends.T
        for first, each in zip((r, 2 * r), _pulled(force, bases), strict=True):
            mixed = np.moveaxis((each[:r] - each[r:]) / (2.0 * _REACH), 0, 1)
            curvature[:, :r, first : first + r] = mixed
            curvature[:, first : first + r, :r] = np.swapaxes(mixed, 1, 2)
        if r > 1:
            x, y = np.tril_indices(r, -1)
            both = axes[x] + axes[y]
            sides = _displaced(charts, np.concatenate([both, -both]), nu, alpha)
            if sides is None:
                return None
            values = _along(force, sides[0])
            second = (values[: len(x)] - 2.0 * middle + values[len(x) :]) / _REACH**2
            own = 0.5 * (second - bends[x] - bends[y])
            curvature[:, x, y] = curvature[:, y, x] = own.T
        cls._by_rates(charts, place, here, force, curvature)
        return cls(changes, curvature)

    def scaled(self, scale: Array) -> "LocalModel":
        """Return the model in coordinates that are divided by `scale` (3r,)."""
        return LocalModel(self.changes * scale, self.curvature * scale * scale[:, None])

    def pulled(self, force: Array) -> Array:
        """Return Γᵀλ of the nodes, (N + 1, 3r), for λ (N + 1, 3, n)."""
        count, _, n, size = self.changes.shape
        flat = self.changes.reshape(count, 3 * n, size)
        return np.asarray((force.reshape(count, 1, 3 * n) @ flat)[:, 0])

    @staticmethod
    def _by_rates(
        charts: Charts, place: Place, here: Bases, force: Array, curvature: Array
    ) -> None:
        """Add the second derivatives by two of ν: q̈ is quadratic in q̇."""
        r, by = here.by_rate.shape[2], here.by_rate
        pairs = [(x, y) for x in range(r) for y in range(x)]
        directions = [by, *(by[:, :, x : x + 1] + by[:, :, y : y + 1] for x, y in pairs)]
        half = charts.manifolds.bends(place, force[:, 2], np.concatenate(directions, axis=2))
        for x in range(r):
            curvature[:, r + x, r + x] += 2.0 * half[:, x]
        for number, (x, y) in enumerate(pairs, r):
            mixed = half[:, number] - half[:, x] - half[:, y]
            curvature[:, r + x, r + y] += mixed
            curvature[:, r + y, r + x] += mixed


def _displaced(
    charts: Charts, directions: Array, nu: Array, alpha: Array
) -> tuple[Array, Bases] | None:
    """Return all nodes displaced along directions (K, r): (q, q̇, q̈) (K, N + 1, 3, n), and bases.

    None where one cannot be evaluated. Several directions are evaluated in one pass where there are
    few nodes.
    """
    count = len(nu)
    together = max(1, _TOGETHER // count)
    found = []
    for first in range(0, len(directions), together):
        own = directions[first : first + together]
        z = np.repeat(_REACH * own, count, axis=0)
        rates = (np.tile(each, (len(own), 1)) for each in (nu, alpha))
        there = charts.repeated(len(own)).around(z, *rates)
        if there is None:
            return None
        found.append((there[0].nodes, *there[1]))
    nodes, by_rate, by_both = (
        np.concatenate(parts).reshape(len(directions), count, *parts[0].shape[1:])
        for parts in zip(*found, strict=True)
    )
    return nodes, Bases(by_rate, by_both)


def _along(force: Array, nodes: Array) -> Array:
    """Return λᵀ(q, q̇, q̈) of nodes (…, N + 1, 3, n), (…, N + 1)."""
    return np.asarray(np.sum(force * nodes, axis=(-2, -1)))


def _pulled(force: Array, bases: Bases) -> tuple[Array, Array]:
    """Return λᵀ∂(q̇, q̈)/∂ν and λᵀ∂q̈/∂α, (…, N + 1, r) each."""
    of_qd, of_qdd = force[:, 1, None, :], force[:, 2, None, :]
    by_nu = of_qd @ bases.by_rate + of_qdd @ bases.by_both
    return by_nu[..., 0, :], (of_qdd @ bases.by_rate)[..., 0, :]
