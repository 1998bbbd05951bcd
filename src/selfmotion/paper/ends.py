"""Conditions on the ends of the motion, eliminated: what is left to minimise is unconstrained.

With H = LLᵀ the inverse of the Gauss-Newton matrix at a reference x̂, and the right singular vectors
of ∂c/∂x L split into U, those that the conditions c change along, and V, the others,

    x = x̂ + L (V y + U w),   c(x) = 0,

where Newton's method finds w for a given y. The unknowns y are orthonormal in the metric, and any
optimiser takes them: by the implicit function theorem, with C = ∂c/∂x at x,

    dx/dy = L (V - U (C L U)⁻¹ C L V).

Conditions may follow from others (rest at both ends, and a closed path). On a grid they do so but
for its error: only independent combinations of them are then met to rounding.
"""

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise import inverse_metric
from selfmotion.paper.objective import Objective

# Conditions are met to this [rad, rad/s, rad/s²]; what rounding on a fine grid leaves is taken for
# met, too.
_CLOSED, _MET = 1e-11, 1e-9
# Steps of Newton's method, how often one may be halved, and how often it goes on along others.
_STEPS, _HALVINGS, _ROUNDS = 20, 10, 3
# Combinations of conditions that change this much less than others follow from these.
_DEPENDENT = 1e-4


def closed(objective: Objective, x: Array) -> Array:
    """Return a point near `x` that meets the ends, or the nearest to that.

    In the Gauss-Newton metric it is about the nearest one, so that it hardly costs more.

    Parameters
    ----------
    objective : Objective
    x : (size,)
        Its cost is finite.
    """
    for _ in range(_ROUNDS):
        function = Eliminated(objective, x)
        y = np.zeros(function.size)
        x = function.point(y)
        if function.is_met(y):
            break
    return x


class Eliminated:
    """The cost by the unknowns y that conditions on the ends leave; a `Function`.

    It is infinite where Newton's method does not arrive.

    Parameters
    ----------
    objective : Objective
    reference : (size,)
        x̂; its cost is finite.
    """

    def __init__(self, objective: Objective, reference: Array) -> None:
        self._objective, self._reference = objective, reference
        values, vectors = np.linalg.eigh(inverse_metric(objective.metric(reference)))
        root, inward = vectors * np.sqrt(values), (vectors / np.sqrt(values)).T
        rows = objective.miss_tangents(reference) @ root
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        sizes[sizes == 0.0] = 1.0
        left, singular, right = np.linalg.svd(rows / sizes)
        rank = int(np.sum(singular > _DEPENDENT * singular.max(initial=0.0)))
        self._across, self._along = root @ right[:rank].T, root @ right[rank:].T
        self._inward = right[rank:] @ inward
        # From conditions to what independent combinations say of them.
        self._counted = sizes * (left[:, :rank] @ left[:, :rank].T) / sizes.T
        # The last y, its x, and how much that misses the ends.
        self._at: Array | None = None
        self._x, self._miss = reference, np.inf

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._along.shape[1])

    @property
    def evaluations(self) -> int:
        """See `Function.evaluations`: those of Newton's method are among them."""
        return self._objective.evaluations

    def point(self, y: Array) -> Array:
        """Return x at y, (size of x,), or the nearest to it that Newton's method came to."""
        if self._at is None or not np.array_equal(self._at, y):
            self._at = None
            self._x, self._miss = self._newton(self._reference + self._along @ y)
            self._at = y.copy()
        return self._x

    def is_met(self, y: Array) -> bool:
        """Return whether Newton's method arrived."""
        self.point(y)
        return self._miss < _MET

    def value(self, y: Array) -> float:
        """See `Function.value`."""
        return self._objective.value(self.point(y)) if self.is_met(y) else np.inf

    def gradient(self, y: Array) -> Array:
        """See `Function.gradient`: exact; NaN where the value is infinite."""
        if not self.is_met(y):
            return np.full(len(y), np.nan)
        return np.asarray(self._objective.gradient(self.point(y)) @ self.tangent(y))

    def slope(self, y: Array, direction: Array) -> float:
        """See `Function.slope`."""
        return float(self.gradient(y) @ direction)

    def metric(self, y: Array) -> Array:
        """See `Function.metric`."""
        tangent = self.tangent(y)
        return np.asarray(tangent.T @ self._objective.metric(self.point(y)) @ tangent)

    def tangent(self, y: Array) -> Array:
        """Return dx/dy, (size of x, size)."""
        rows = self._rows(self.point(y))
        responses = _least_squares(rows @ self._across, rows @ self._along)
        return np.asarray(self._along - self._across @ responses)

    def inward(self, inverse_hessian: Array) -> Array:
        """Return an inverse Hessian by x as one by y, near the reference."""
        return np.asarray(self._inward @ inverse_hessian @ self._inward.T)

    def outward(self, y: Array, inverse_hessian: Array) -> Array:
        """Return an inverse Hessian by y as one by x, of the directions that meet the ends."""
        tangent = self.tangent(y)
        return np.asarray(tangent @ inverse_hessian @ tangent.T)

    def _newton(self, x: Array) -> tuple[Array, float]:
        """Return where Newton's method gets to along U, and by how much that misses the ends."""
        missed = self._missed(x)
        for _ in range(_STEPS):
            # Infinite where there is no motion.
            if _size(missed) < _CLOSED or not np.all(np.isfinite(missed)):
                break
            # A motion that hardly holds together has derivatives beyond all numbers.
            with np.errstate(over="ignore", invalid="ignore"):
                table = self._rows(x) @ self._across
            if not np.all(np.isfinite(table)):
                break
            step = -self._across @ _least_squares(table, missed)
            for halving in range(_HALVINGS):
                nearer = x + 0.5**halving * step
                left = self._missed(nearer)
                if _size(left) < _size(missed):
                    break
            else:
                break
            x, missed = nearer, left
        return x, _size(missed)

    def _missed(self, x: Array) -> Array:
        count = len(self._counted)
        if not np.isfinite(self._objective.value(x)):
            return np.full(count, np.inf)
        return np.asarray(self._counted @ self._objective.misses(x))

    def _rows(self, x: Array) -> Array:
        return np.asarray(self._counted @ self._objective.miss_tangents(x))


def _least_squares(table: Array, right: Array) -> Array:
    return np.asarray(np.linalg.lstsq(table, right)[0])


def _size(missed: Array) -> float:
    return float(np.max(np.abs(missed), initial=0.0))
