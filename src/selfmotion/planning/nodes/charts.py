"""Charts of the self-motion manifolds of all nodes, and eq. 4 there."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.model import kernels
from selfmotion.model.follow import Follows, chain_tables, joint_columns, null_basis
from selfmotion.model.robot import null_space
from selfmotion.planning.nodes.kernels import accelerate, retract


@dataclass(frozen=True, eq=False)
class Place:
    """Nodes in the charts around a reference, and their motion by eq. 4.

    Attributes
    ----------
    q, qd, qdd : (N + 1, n)
    tangents : (N + 1, n, r)
        T = ∂q/∂z.
    table : (N + 1, columns)
        Intermediate values of eq. 4, for its derivatives.
    """

    q: Array
    qd: Array
    qdd: Array
    tangents: Array
    table: Array

    @cached_property
    def nodes(self) -> Array:
        """(q, q̇, q̈), (N + 1, 3, n)."""
        return np.stack([self.q, self.qd, self.qdd], axis=1)


class Centred(NamedTuple):
    """Nodes at the reference of their charts.

    Attributes
    ----------
    charts : Charts
    nu, alpha : (N + 1, r)
    place : Place
    """

    charts: "Charts"
    nu: Array
    alpha: Array
    place: Place


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts of the self-motion manifolds of all nodes, around a motion on the path.

    The coordinates of a node are z (r,), where it is on its manifold, ν (r,), its null motion in
    eq. 4, q̇ = J⁺ẋ + (I - J⁺J) N0 ν, and α (r,), its null acceleration, q̈ = J⁺(ẍ - J̇q̇) +
    (I - J⁺J) N0 α. Where joints are held at 0, they move no tip, and the last coordinates are
    theirs.

    Attributes
    ----------
    manifolds : Manifolds
    q : (N + 1, n)
        The reference: z = 0 where that is on the path, else next to it.
    bases : (N + 1, n, r)
        N0, orthonormal bases of the null spaces there.
    """

    manifolds: "Manifolds"
    q: Array
    bases: Array

    def at(self, z: Array, nu: Array, alpha: Array) -> Place | None:
        """Return the nodes at z, ν and α, (N + 1, r) each; None where Newton's iteration fails."""
        return self._retracted(z, self.spread(nu), self.spread(alpha), centred=False)

    def centred(
        self, z: Array, epsilon: Array, a: Array, *, carried: bool = False
    ) -> Centred | None:
        """Return charts around the nodes at z (N + 1, r); ε and a (N + 1, n) are projected.

        Of the bases, only the first need be given where they are `carried` from node to node. None
        where a node cannot be put onto its manifold.
        """
        place = self._retracted(z, epsilon, a, centred=True, carried=carried)
        if place is None:
            return None
        around = Charts(self.manifolds, place.q, place.tangents)
        own, turned = self.manifolds.rates(place.table)[1], np.swapaxes(place.tangents, 1, 2)
        nu, alpha = ((turned @ each[:, :, None])[:, :, 0] for each in (own, a))
        return Centred(around, nu, alpha, place)

    def places(self, z: Array) -> Array | None:
        """Return q at z (N + 1, r), (N + 1, n); None where Newton's iteration fails."""
        none = np.zeros_like(self.q)
        q, table, tangents = (
            np.empty_like(self.q),
            self.manifolds.table(),
            np.empty_like(self.bases),
        )
        return q if self._retract(q, table, tangents, z, none, centred=False) else None

    def spread(self, coordinates: Array) -> Array:
        """Return ε = N0 ν or a = N0 α, (N + 1, n)."""
        return np.asarray((self.bases @ coordinates[:, :, None])[:, :, 0])

    def _retracted(
        self,
        z: Array,
        epsilon: Array,
        a: Array,
        *,
        centred: bool,
        carried: bool = False,
    ) -> Place | None:
        own, bases = self.manifolds, self.bases
        q, table, tangents = np.empty_like(self.q), own.table(), np.empty_like(bases)
        if not self._retract(q, table, tangents, z, epsilon, centred=centred, carried=carried):
            return None
        qd, _ = own.rates(table)
        place = Place(q, np.array(qd), np.empty_like(q), tangents, table)
        own.accelerate(place, a)
        return place

    def _retract(
        self,
        q: Array,
        table: Array,
        tangents: Array,
        z: Array,
        epsilon: Array,
        *,
        centred: bool,
        carried: bool = False,
    ) -> bool:
        """Set q, a table and tangents at z; return whether all nodes are on their manifolds."""
        own = self.manifolds
        own.rates(table)[1][:] = epsilon
        along = len(q) // own.copies if carried else 0
        z, given = np.ascontiguousarray(z), (own.targets, own.chains, own.layout)
        failed = retract(
            q, z, self.bases, self.q, *given, table, tangents, own.held, centred, along
        )
        return failed < 0 or not own.is_whole


class Manifolds:
    """The self-motion manifolds of a path at given times.

    Parameters
    ----------
    follows : Follows
    t : (N + 1,)
        Times [s].
    copies : int, optional
        Number of motions that are put one after the other, at times `t` each. A node that cannot be
        put onto its manifold then has q̇ = NaN, and the others are valid. By default there is one
        motion, all of whose nodes have to be.

    Attributes
    ----------
    path_accelerations : (N + 1, 6 F)
        ẍ of the paths.
    held : (N + 1, n)
        Which joints are held at 0.
    holds : bool
        Whether any is.
    """

    def __init__(self, follows: Follows, t: Array, copies: int | None = None) -> None:
        self.is_whole, copies = copies is None, copies or 1
        self.follows, self.t, self.copies = follows, np.tile(t, copies), copies
        self.chains, self.layout = chain_tables(follows), follows.layout
        self._sizes = follows.dof, follows.dimension, len(follows.items)
        self._paths, accelerations = [], []
        for item in follows.items:
            own = item.target(t)
            parts = own.translation, own.rotation.reshape(-1, 9), own.twist
            self._paths.append(np.tile(np.hstack(parts), (copies, 1)))
            accelerations.append(item.twist_rates(t))
        self.held = np.tile(follows.held(t), (copies, 1))
        self.holds = bool(self.held.any())
        self.targets = np.ascontiguousarray(np.hstack([path[:, :12] for path in self._paths]))
        self.path_accelerations = np.ascontiguousarray(
            np.tile(np.hstack(accelerations), (copies, 1))
        )

    def table(self) -> Array:
        """Return a table that holds the paths alone."""
        return self._table.copy()

    @cached_property
    def _table(self) -> Array:
        n, m, count = self._sizes
        table = np.zeros((len(self.t), kernels.columns(n, m, count)))
        for f, path in enumerate(self._paths):
            kernels.path_of(table, f, n, m)[:] = path
        return table

    def rates(self, table: Array) -> tuple[Array, Array]:
        """Return q̇ and ε of a table, (N + 1, n) each, as views of it."""
        return kernels.rates_of(table, self.follows.dof)

    def accelerate(self, place: Place, a: Array) -> None:
        """Set q̈ of a place for a null acceleration a (N + 1, n)."""
        every = joint_columns(self.follows, place.q)
        given = self.path_accelerations, np.ascontiguousarray(a)
        accelerate(place.table, self.layout, every, *given, place.qdd)

    def with_held_last(self, q: Array, bases: Array) -> Array:
        """Return bases (N + 1, n, r) at q (N + 1, n) whose last vectors are those of held joints.

        These move no tip, so that they are in the null spaces. Bases with these last already are
        returned as they are.
        """
        found = bases.copy()
        for k in np.flatnonzero(self.held.any(axis=1)):
            self._put_held_last(int(k), q[k], found)
        return found

    def _put_held_last(self, k: int, q: Array, bases: Array) -> None:
        joints = np.flatnonzero(self.held[k])
        unit = np.eye(bases.shape[1])[:, joints]
        if not len(joints) or np.array_equal(bases[k, :, -len(joints) :], unit):
            return
        moving = np.delete(np.arange(len(unit)), joints)
        free = null_space(self.follows.jacobian(q)[:, moving])
        own = np.zeros((len(unit), free.shape[1]))
        # The rotation nearest to the old basis (orthogonal Procrustes).
        left, _, right = np.linalg.svd(free.T @ bases[k, moving, : free.shape[1]])
        own[moving] = free @ (left @ right)
        bases[k] = np.hstack([own, unit])

    def _bases(self, q: Array) -> Array:
        """Return bases of the null spaces at q (N + 1, n), each rotated towards the one before."""
        rows = np.where(self.held[:, None], 0.0, self.follows.jacobians(q))
        spaces = np.ascontiguousarray(null_space(rows))
        for k in range(len(q)):
            first = k % (len(q) // self.copies) == 0
            if not first:
                left, _, right = np.linalg.svd(spaces[k].T @ spaces[k - 1])
                spaces[k] = spaces[k] @ (left @ right)
            self._put_held_last(k, q[k], spaces)
        return spaces

    def near(self, q: Array, epsilon: Array, a: Array) -> Centred | None:
        """Return charts around the nodes nearest to q, with ε and a projected into the null spaces.

        (N + 1, n) each. Bases rotate as little as possible from one node to the next. None where a
        node cannot be put onto its manifold.
        """
        n, m, _ = self._sizes
        none = np.zeros((len(q), n - m))
        if self.holds:
            q, epsilon, a = (np.where(self.held, 0.0, x) for x in (q, epsilon, a))
            return Charts(self, q, self._bases(q)).centred(none, epsilon, a)
        bases = np.zeros((len(q), n, n - m))
        for first in range(0, len(q), len(q) // self.copies):
            bases[first] = null_basis(self.follows, q[first])
        return Charts(self, q, bases).centred(none, epsilon, a, carried=True)


def orthonormal(tangents: Array) -> Array:
    """Return orthonormal bases of the columns of matrices (K, n, r): Gram-Schmidt."""
    found = np.array(tangents)
    for x in range(found.shape[2]):
        for y in range(x):
            share = np.einsum("kn,kn->k", found[:, :, y], found[:, :, x])
            found[:, :, x] -= share[:, None] * found[:, :, y]
        found[:, :, x] /= np.linalg.norm(found[:, :, x], axis=1)[:, None]
    return found
