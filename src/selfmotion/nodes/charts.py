"""All nodes of a motion at once: where they are on their self-motion manifolds, and eq. 4 there."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.follow import Follows
from selfmotion.nodes.kernels import look, pull
from selfmotion.robot import null_space

# Rates along a motion are differences over this share of its duration.
_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Place:
    """Nodes in the charts around a reference, and their motion by eq. 4.

    Attributes
    ----------
    q, qd : (N + 1, n)
    tangents : (N + 1, n, r)
        T = ∂q/∂z.
    table : (N + 1, columns)
        What eq. 4 leaves for its derivatives.
    """

    q: Array
    qd: Array
    tangents: Array
    table: Array


class Centred(NamedTuple):
    """Nodes at the reference of their charts.

    Attributes
    ----------
    charts : Charts
    nu : (N + 1, r)
    place : Place
    """

    charts: "Charts"
    nu: Array
    place: Place


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts of the self-motion manifolds of all nodes, around a motion on the path.

    The coordinates of a node are z (r,), where it is on its manifold, and ν (r,), its null motion
    in eq. 4, q̇ = J⁺ẋ + (I - J⁺J) N0 ν. Where joints are held at 0, they move no tip, and the last
    coordinates are theirs.

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

    def at(self, z: Array, nu: Array) -> Place | None:
        """Return the nodes at z and ν, (N + 1, r) each; None where one is not to be had."""
        return self._looked(z, self.null_motions(nu), centred=False)

    def centred(self, z: Array, epsilon: Array, *, carried: bool = False) -> Centred | None:
        """Return charts around the nodes at z (N + 1, r), with what of ε (N + 1, n) acts there.

        Of the bases, only the first need be known where they are to be `carried` from node to node.
        None where a node is not to be had.
        """
        place = self._looked(z, epsilon, centred=True, carried=carried)
        if place is None:
            return None
        around = Charts(self.manifolds, place.q, place.tangents)
        own = self.manifolds.rates(place.table)[1]
        nu = (np.swapaxes(place.tangents, 1, 2) @ own[:, :, None])[:, :, 0]
        return Centred(around, nu, place)

    def moving(self, place: Place, qd: Array) -> Centred:
        """Return the nodes at their `place` at the reference, as fast as q̇ (N + 1, n) in its span.

        J takes N0 to 0, so that another null motion changes q̇ by as much, and nothing else.
        """
        nu = (np.swapaxes(self.bases, 1, 2) @ qd[:, :, None])[:, :, 0]
        table, epsilon = place.table.copy(), self.null_motions(nu)
        rates, before = self.manifolds.rates(table)
        rates += epsilon - before
        before[:] = epsilon
        return Centred(self, nu, Place(place.q, np.array(rates), place.tangents, table))

    def null_motions(self, nu: Array) -> Array:
        """Return ε = N0 ν, (N + 1, n)."""
        return np.asarray((self.bases @ nu[:, :, None])[:, :, 0])

    def _looked(
        self, z: Array, epsilon: Array, *, centred: bool, carried: bool = False
    ) -> Place | None:
        own, bases = self.manifolds, self.bases
        q, table, tangents = np.empty_like(self.q), own.table(), np.empty_like(bases)
        qd, null_motions = own.rates(table)
        null_motions[:] = epsilon
        z = np.ascontiguousarray(z)
        given = own.targets, own.chains, own.layout
        along = len(q) // own.copies if carried else 0
        failed = look(q, z, bases, self.q, *given, table, tangents, own.held, centred, along)
        if failed >= 0 and own.is_whole:
            return None
        return Place(q, np.array(qd), tangents, table)

    def pulled(self, place: Place, by_q: Array, by_qd: Array) -> Array:
        """Return the derivatives by (z, ν), (N + 1, 2r), of what has these by q and q̇."""
        own = self.manifolds
        out = np.empty((len(self.q), 2 * self.bases.shape[2]))
        pull(
            np.ascontiguousarray(by_q),
            np.ascontiguousarray(by_qd),
            place.table,
            own.layout,
            own.work,
            own.no_error,
            self.bases,
            place.tangents,
            own.follows.every_column(place.q),
            out,
        )
        return out


class Manifolds:
    """The self-motion manifolds of a path at given times.

    Parameters
    ----------
    follows : Follows
    t : (N + 1,)
        Times [s].
    copies : int, optional
        Of how many motions these are the nodes, one after the other, at times `t` each. There, one
        that is not to be had leaves the others: q̇ of its nodes that are nowhere is no number. By
        default they are those of one motion, all of which have to be had.
    """

    def __init__(self, follows: Follows, t: Array, copies: int | None = None) -> None:
        self.is_whole, copies = copies is None, copies or 1
        self.follows, self.t, self.copies = follows, np.tile(t, copies), copies
        self.chains, self.layout = follows.chains, follows.layout
        self._sizes = follows.robot.dof, follows.dimension, len(follows.items)
        self.work = np.zeros(kernels.space_size(*self._sizes[:2]))
        self.no_error = np.zeros((len(follows.items), 6))
        # A moment before each node and after: one step back, one on; at the ends of the path both
        # inside.
        step, end = _STEP * t[-1], t[-1]
        steps = step * np.array([-1.0, 1.0])[:, None] * np.ones(len(t))
        steps[:, t <= step] = step * np.array([1.0, 2.0])[:, None]
        steps[:, t >= end - step] = step * np.array([-2.0, -1.0])[:, None]
        times = np.concatenate([t, *(t + steps)])
        self._steps = np.tile(steps, copies)
        self._twists, self._paths = [], []
        for item in follows.items:
            own = item.target(times)
            beside = own.twist[len(t) :].reshape(2, len(t), 6)
            self._twists.append(np.tile(beside, (1, copies, 1)).reshape(-1, 6))
            parts = own.translation, own.rotation.reshape(-1, 9), own.twist
            path = np.hstack([part[: len(t)] for part in parts])
            self._paths.append(np.tile(path, (copies, 1)))
        self.held = np.tile(follows.held(t), (copies, 1))
        self.targets = np.ascontiguousarray(np.hstack([path[:, :12] for path in self._paths]))

    def table(self) -> Array:
        """Return a table with nothing in it but the paths."""
        n, m, count = self._sizes
        table = np.zeros((len(self.t), kernels.columns(n, m, count)))
        for f, path in enumerate(self._paths):
            kernels.path_of(table, f, n, m)[:] = path
        return table

    def rates(self, table: Array) -> tuple[Array, Array]:
        """Return q̇ and ε of a table, (N + 1, n) each, as views of it."""
        return kernels.rates_of(table, self.follows.robot.dof)

    def with_held_last(self, q: Array, bases: Array) -> Array:
        """Return bases (N + 1, n, r) at q (N + 1, n) whose last vectors are those of held joints.

        These move no tip, so that they are in the null spaces. Where they are last already, bases
        stay as they are.
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
        # As near as may be to what they were.
        left, _, right = np.linalg.svd(free.T @ bases[k, moving, : free.shape[1]])
        own[moving] = free @ (left @ right)
        bases[k] = np.hstack([own, unit])

    def _bases(self, q: Array) -> Array:
        """Return bases of the null spaces at q (N + 1, n), each turned to the one before."""
        rows = np.where(self.held[:, None], 0.0, self.follows.jacobians(q))
        spaces = np.ascontiguousarray(null_space(rows))
        for k in range(len(q)):
            first = k % (len(q) // self.copies) == 0
            if not first:
                left, _, right = np.linalg.svd(spaces[k].T @ spaces[k - 1])
                spaces[k] = spaces[k] @ (left @ right)
            self._put_held_last(k, q[k], spaces)
        return spaces

    def near(self, q: Array, epsilon: Array) -> Centred | None:
        """Return charts around the nodes nearest to q, with what of ε acts there, (N + 1, n) each.

        Their bases turn no more than they must from each node to the next. None where a node does
        not come onto its manifold.
        """
        n, m, _ = self._sizes
        none = np.zeros((len(q), n - m))
        if self.held.any():
            q, epsilon = (np.where(self.held, 0.0, x) for x in (q, epsilon))
            return Charts(self, q, self._bases(q)).centred(none, epsilon)
        bases = np.zeros((len(q), n, n - m))
        for first in range(0, len(q), len(q) // self.copies):
            bases[first] = self.follows.null_basis(q[first])
        return Charts(self, q, bases).centred(none, epsilon, carried=True)

    def accelerations(self, place: Place) -> Array:
        """Return the least q̈ by which nodes follow the path, (N + 1, n): J⁺(ẍ - J̇q̇).

        J q̈ is the rate of ẋ - J q̇ along the motion at fixed q̇: a central difference, which at marks
        of the path, where it may jump, is the mean of both sides.
        """
        steps, (count, n) = self._steps, place.q.shape
        moved, rates = place.q + steps[:, :, None] * place.qd, np.tile(place.qd, (2, 1))[:, :, None]
        unmet = []
        for item, twist in zip(self.follows.items, self._twists, strict=True):
            jacobian, rotation, _ = item.chain.along(moved.reshape(-1, n))
            off = twist[:, :, None] - jacobian @ rates
            unmet.append(item.task.select_along(off, rotation)[:, :, 0])
        before, after = np.concatenate(unmet, axis=1).reshape(2, count, -1)
        right = ((after - before) / (steps[1] - steps[0])[:, None])[:, :, None]
        rows = kernels.rows_along(place.table, n, right.shape[1])
        turned = np.swapaxes(rows, 1, 2)
        return np.asarray((turned @ np.linalg.solve(rows @ turned, right))[:, :, 0])


def orthonormal(tangents: Array) -> Array:
    """Return orthonormal bases of the spans of full-rank matrices (K, n, r): Gram-Schmidt."""
    found = np.array(tangents)
    for x in range(found.shape[2]):
        for y in range(x):
            share = np.einsum("kn,kn->k", found[:, :, y], found[:, :, x])
            found[:, :, x] -= share[:, None] * found[:, :, y]
        found[:, :, x] /= np.linalg.norm(found[:, :, x], axis=1)[:, None]
    return found
