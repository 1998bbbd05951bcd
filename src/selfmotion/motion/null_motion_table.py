"""A null motion at stages of a motion: from coefficients x to ε, and back."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array


@dataclass(frozen=True, eq=False)
class NullMotionTable:
    """A null motion at S stages, bound to one motion: ε = ε_0 + R E φ.

    Attributes
    ----------
    functions : (S, K)
        φ at the stages.
    frame : callable or None
        Returns R at the stages, (S, n, r), once it counts; None for the identity.
    rows : int
        Rows of E: r, or n where there is no frame.
    offset : (S, n) or None
        ε_0, the null motion of x = 0; None for zero.
    """

    functions: Array
    frame: Callable[[], Array] | None
    rows: int
    offset: Array | None = None

    @cached_property
    def _frame(self) -> Array | None:
        return self.frame and self.frame()

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.rows * int(self.functions.shape[1])

    def epsilon(self, x: Array) -> Array:
        """Return ε at the stages for coefficients `x`, (S, n)."""
        if self.offset is not None and not x.any():
            return self.offset
        inner: Array = self.functions @ x.reshape(self.rows, self.functions.shape[1]).T
        outer = inner if self._frame is None else np.einsum("snr,sr->sn", self._frame, inner)
        return outer if self.offset is None else outer + self.offset

    def pullback(self, epsilon_gradient: Array) -> Array:
        """Return ∂F/∂x for ∂F/∂ε (S, n): the transpose of the linear part of `epsilon`."""
        inner = epsilon_gradient
        if self._frame is not None:
            inner = np.einsum("snr,sn->sr", self._frame, inner)
        return np.asarray((inner.T @ self.functions).ravel())

    def matrix(self, before: int = 0, after: int = 0) -> Array:
        """Return ∂ε/∂x at the stages, (S, n, size), between as many columns of zeros."""
        frame = np.eye(self.rows)[None] if self._frame is None else self._frame
        (stages, count), n = self.functions.shape, frame.shape[1]
        full = np.zeros((stages, n, before + self.size + after))
        own = full[:, :, before : before + self.size].reshape(stages, n, self.rows, count)
        np.multiply(frame[:, :, :, None], self.functions[:, None, None, :], out=own)
        return full
