"""A motion at sample times, as costs and constraints see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Ints
from selfmotion.model import kernels
from selfmotion.model.follow import Follows, joint_columns
from selfmotion.model.motion import Sampling
from selfmotion.model.task import Task

_ARRAYS = ("q", "qd", "task_jacobian")


@dataclass(frozen=True, eq=False)
class TipSamples:
    """Poses of a tip that follows a path, at S times, in its chain's base frame.

    Attributes
    ----------
    jacobian : (S, 6, n)
        The tip's Jacobian [v, ω].
    rotation, translation : (S, 3, 3), (S, 3)
        The tip's pose.
    error : (S, 6)
        Pose error e, from the tip to the path [m, rad]; see `Task.twist_error`. Of damped motions
        alone: where tolerances let the tool leave the path, it is 0.
    """

    jacobian: Array
    rotation: Array
    translation: Array
    error: Array

    def __post_init__(self) -> None:
        _make_read_only(self, tuple(self.__dataclass_fields__))

    def at(self, rows: Ints) -> TipSamples:
        """Return the samples at some of the times."""
        return TipSamples(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Samples:
    """A joint motion at S times, with the kinematics there of all that follows a path.

    The arrays are read-only. `jacobian`, `rotation`, `translation` and `task` are those
    of the first tip that follows a path, which mostly is the only one; `tips` has them all.

    Attributes
    ----------
    sampling : Sampling
        When the samples are taken.
    q, qd : (S, n)
        Joint coordinates and velocities.
    follows : Follows
        Task frames of the arm.
    tips : tuple of TipSamples
    task_jacobian : (S, m, n)
        The prescribed rows of all tips.
    """

    sampling: Sampling
    q: Array
    qd: Array
    follows: Follows
    tips: tuple[TipSamples, ...]
    task_jacobian: Array

    def __post_init__(self) -> None:
        _make_read_only(self, _ARRAYS)

    @classmethod
    def along(cls, follows: Follows, sampling: Sampling, q: Array, qd: Array) -> Samples:
        """Return the samples of a motion on its path, q and q̇ (S, n) each."""
        tips, rows = [], []
        for item in follows.items:
            jacobian, rotation, translation = item.chain.along(q)
            rows.append(item.task.select_along(jacobian, rotation))
            tips.append(TipSamples(jacobian, rotation, translation, np.zeros((len(q), 6))))
        stacked = rows[0] if len(rows) == 1 else np.concatenate(rows, axis=1)
        return cls(sampling, q, qd, follows, tuple(tips), stacked)

    @property
    def jacobian(self) -> Array:
        """The tool's Jacobian [v, ω], world axes, (S, 6, n)."""
        return self.tips[0].jacobian

    @property
    def rotation(self) -> Array:
        """The tool's orientation, (S, 3, 3)."""
        return self.tips[0].rotation

    @property
    def translation(self) -> Array:
        """The tool's position [m], (S, 3)."""
        return self.tips[0].translation

    @property
    def task(self) -> Task:
        """The rows that the path prescribes."""
        return self.follows.items[0].task

    @property
    def error(self) -> Array:
        """Pose errors e of all tips [m, rad], one after the other, (S, 6 F); see `TipSamples`."""
        errors = [tip.error for tip in self.tips]
        return errors[0] if len(errors) == 1 else np.concatenate(errors, axis=1)

    @property
    def t(self) -> Array:
        """Times [s], (S,)."""
        return self.sampling.t

    @property
    def weights(self) -> Array:
        """Quadrature weights [s]: ∫ G dt ≈ weights · G, (S,)."""
        return self.sampling.weights

    @property
    def nodes(self) -> npt.NDArray[np.intp]:
        """Indices of the samples that are nodes, (N + 1,)."""
        return self.sampling.nodes

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n): differences of q̇ over the nodes."""
        return np.asarray(self.sampling.differentiation(1) @ self.qd[self.nodes])

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return np.asarray(self.sampling.differentiation(2) @ self.qd[self.nodes])

    @cached_property
    def gram(self) -> Array:
        """JJᵀ of the task Jacobian, (S, m, m)."""
        gram: Array = self.task_jacobian @ self.task_jacobian.transpose(0, 2, 1)
        return gram

    @cached_property
    def gram_determinant(self) -> Array:
        """Det JJᵀ = w², the square of Yoshikawa's manipulability, (S,)."""
        return kernels.gram_determinants(self.task_jacobian.copy())

    @cached_property
    def log_determinant_gradient(self) -> Array:
        """∂ log det(JJᵀ) / ∂q = 2 ⟨(JJᵀ)⁻¹J, ∂J/∂q⟩, (S, n)."""
        return self.contract(kernels.log_determinant_slopes(self.task_jacobian.copy()))

    def contract(self, weights: Array) -> Array:
        """Return ⟨M, ∂J/∂q_k⟩ for `weights` M (S, m, n) on the task Jacobian, (S, n)."""
        weights, layout = np.ascontiguousarray(weights), self.follows.layout
        every = joint_columns(self.follows, self.q)
        parts = [
            kernels.contract_task(tip.jacobian, tip.rotation, weights, layout, f, every)
            for f, tip in enumerate(self.tips)
        ]
        return parts[0] if len(parts) == 1 else np.sum(parts, axis=0)


class LazySamples(Samples):
    """A motion whose forward kinematics is computed when a cost or a constraint needs it.

    Parameters
    ----------
    follows : Follows
    sampling : Sampling
    arrays
        By name: q and q̇ (S, n), and their derivatives; those left out are computed.
    """

    def __init__(self, follows: Follows, sampling: Sampling, **arrays: Array) -> None:
        for name, value in {"sampling": sampling, "follows": follows, **arrays}.items():
            object.__setattr__(self, name, value)

    @cached_property
    def _computed(self) -> Samples:
        return Samples.along(self.follows, self.sampling, self.q, self.qd)

    @cached_property
    @override
    def tips(self) -> tuple[TipSamples, ...]:
        return self._computed.tips

    @cached_property
    @override
    def task_jacobian(self) -> Array:
        return self._computed.task_jacobian


def _make_read_only(owner: Samples | TipSamples, names: Sequence[str]) -> None:
    """Replace arrays by read-only views: costs may not write to them, who made them still may."""
    for name in names:
        view = getattr(owner, name).view()
        view.setflags(write=False)
        object.__setattr__(owner, name, view)
