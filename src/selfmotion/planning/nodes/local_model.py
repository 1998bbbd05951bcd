"""Derivatives of the nodes by their coordinates w = (z, ν, α), to second order, compiled.

First derivatives by ν and α are exact; those by z, and all second ones, are central differences
along the manifold. The neighbours of a node are placed on its manifold to second order,

    q(z) = q_ref + T z - ½ J⁺ Q(T z, T z),   with J̇q̇ = Q(q̇, q̇),

so that each takes one pass over the joints. What is left is odd in z to third order: it cancels in
second differences, and is within the error of first ones.
"""

from dataclasses import dataclass
from functools import cache
from math import nan
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, called, inlined, kernel, meanwhile
from selfmotion.basics.layout import Layout, layout_of
from selfmotion.model.follow import joint_columns
from selfmotion.model.kernels import (
    Every,
    Stage,
    cholesky,
    clear_held,
    columns,
    evaluate_motion,
    gram,
    rows_of,
    select,
    solve_cholesky,
    stage_of,
    task_rows,
    tip_of,
    view,
)
from selfmotion.model.robot import place_tips
from selfmotion.planning.nodes.charts import Charts, Place
from selfmotion.planning.nodes.kernels import (
    accelerate,
    acceleration_slopes,
    project,
    required_acceleration,
    turned,
)

# Step of central differences along a manifold [rad or m]: first derivatives are right to 1e-8,
# second ones to 1e-6.
_REACH = 1e-4


@dataclass(frozen=True, eq=False)
class LocalModel:
    """Derivatives of the nodes by their scaled coordinates, to second order.

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
        cls, charts: Charts, nu: Array, alpha: Array, place: Place, force: Array, scale: Array
    ) -> "LocalModel | None":
        """Return the model at the reference of charts; None where a neighbour cannot be evaluated.

        `place` is that of the nodes there, `force` (N + 1, 3, n) is λ, `scale` (3r,) the units of
        the coordinates. Of a batch, nodes without a model have NaN.
        """
        own, table = charts.manifolds, place.table
        (count, n, r), layout, follows = charts.bases.shape, own.layout, own.follows
        directions = _directions(r)
        q = np.empty((2 * len(directions), count, n))
        bases, here = np.ascontiguousarray(charts.bases), joint_columns(follows, place.q)
        neighbours(table, layout, here, bases, directions, _REACH, q)
        there = joint_columns(follows, q.reshape(-1, n)) if here is not None else None
        changes, curvature = np.zeros((count, 3, n, 3 * r)), np.zeros((count, 3 * r, 3 * r))
        failed = differences(
            q,
            table,
            layout,
            here,
            there,
            own.chains,
            own.held,
            own.path_accelerations,
            bases,
            np.ascontiguousarray(nu),
            np.ascontiguousarray(alpha),
            np.ascontiguousarray(force),
            scale,
            _REACH,
            np.zeros(_space_size(table.shape[1], own.chains, n, n - r, r)),
            changes,
            curvature,
        )
        return cls(changes, curvature) if failed < 0 or not own.is_whole else None


@cache
def _directions(r: int) -> Array:
    """Return the directions of differences, (D, r): the axes, then the sums of two of them."""
    axes = np.eye(r)
    x, y = np.tril_indices(r, -1)
    return np.concatenate([axes, axes[x] + axes[y]])


class _Work(NamedTuple):
    """Work space of one node, and of its neighbours.

    Attributes
    ----------
    row : (columns,)
        A row of the table.
    turns, places : (c + 1, 3, 3), (c + 1, 3)
    rotations, positions, jacobians : (F, 3, 3), (F, 3), (F, 6, n)
    right : (m,)
    slopes : (m, n)
        ∂b/∂q̇.
    six : (6,)
    direction, rates, qdd : (n,)
    by_rate, by_both : (r, n)
        Of each coordinate, ∂q̇/∂ν = ∂q̈/∂α and ∂q̈/∂ν.
    """

    row: Array
    turns: Array
    places: Array
    rotations: Array
    positions: Array
    jacobians: Array
    right: Array
    slopes: Array
    six: Array
    direction: Array
    rates: Array
    qdd: Array
    by_rate: Array
    by_both: Array


@inlined
def _work(space: Array, width: int, joints: int, tips: int, n: int, m: int, r: int) -> _Work:
    """Return the parts of an array as work space: views, which are not reference-counted."""
    tip, rest = width + 12 * joints, width + 12 * (joints + tips) + 6 * n * tips
    last = rest + m + m * n + 6
    return _Work(
        row=view(space, 0, (width,)),
        turns=view(space, width, (joints, 3, 3)),
        places=view(space, width + 9 * joints, (joints, 3)),
        rotations=view(space, tip, (tips, 3, 3)),
        positions=view(space, tip + 9 * tips, (tips, 3)),
        jacobians=view(space, tip + 12 * tips, (tips, 6, n)),
        right=view(space, rest, (m,)),
        slopes=view(space, rest + m, (m, n)),
        six=view(space, rest + m + m * n, (6,)),
        direction=view(space, last, (n,)),
        rates=view(space, last + n, (n,)),
        qdd=view(space, last + 2 * n, (n,)),
        by_rate=view(space, last + 3 * n, (r, n)),
        by_both=view(space, last + (3 + r) * n, (r, n)),
    )


def _space_size(width: int, chains: Array, n: int, m: int, r: int) -> int:
    """Return the length of that array."""
    tips, joints = chains.shape[:2]
    return int(width + 12 * (joints + tips) + 6 * n * tips + m + m * n + 6 + (3 + 2 * r) * n)


@kernel
def neighbours(
    table: Array,
    layout: Layout,
    every: Every | None,
    bases: Array,
    directions: Array,
    reach: float,
    q: Array,
) -> None:
    """Set q (2 D, K, n) of all nodes displaced along directions (D, r) and against them.

    By ± `reach` times each, on the manifold to second order.
    """
    (count, n, r), m = bases.shape, rows_of(layout)
    along, bend, six, right = np.empty(n), np.empty(n), np.empty(6), np.empty(m)
    for k in range(count):
        at = stage_of(table[k], n, m)
        for d in range(len(directions)):
            for j in range(n):
                along[j], bend[j] = 0.0, 0.0
                for x in range(r):
                    along[j] += directions[d, x] * bases[k, j, x]
            for f in range(layout.shape[0]):
                tip = tip_of(table[k], f, n, m)
                turned(layout, f, tip.jacobian, every, k, along, six)
                for i in range(6):
                    six[i] = -six[i]
                select(layout, f, tip.rotation, six, right)
            project(at.task_jacobian, at.factor, right, bend, bend)
            for j in range(n):
                even = at.q[j] + 0.5 * reach * reach * bend[j]
                q[2 * d, k, j] = even + reach * along[j]
                q[2 * d + 1, k, j] = even - reach * along[j]


@kernel
def differences(
    q: Array,
    table: Array,
    layout: Layout,
    every_here: Every | None,
    every_there: Every | None,
    chains: Array,
    held: Flags,
    accelerations: Array,
    bases: Array,
    nu: Array,
    alpha: Array,
    force: Array,
    scale: Array,
    reach: float,
    space: Array,
    changes: Array,
    curvature: Array,
) -> int:
    """Set Γ (K, 3, n, 3r) and the curvature (K, 3r, 3r) of all nodes, by `neighbours` q.

    Returns the first node of which one cannot be evaluated, or -1; all such nodes have NaN.
    """
    (count, n, r), m, failed = bases.shape, rows_of(layout), -1
    work = _work(space, table.shape[1], chains.shape[1], layout.shape[0], n, m, r)
    epsilon, a, values = np.empty(n), np.empty(n), np.empty(q.shape[0])
    for k in range(count):
        gamma, curved = view(changes[k], 0, (3, n, 3 * r)), view(curvature[k], 0, (3 * r, 3 * r))
        basis, pull = view(bases[k], 0, (n, r)), view(force[k], 0, (3, n))
        faster = view(accelerations[k], 0, (6 * layout.shape[0],))
        for j in range(n):
            epsilon[j], a[j] = 0.0, 0.0
            for x in range(r):
                epsilon[j] += bases[k, j, x] * nu[k, x]
                a[j] += bases[k, j, x] * alpha[k, x]
        _evaluate(table[k], layout, every_here, k, faster, a, basis, r, work)
        _set_exact(gamma, basis, work)
        middle = _value(stage_of(table[k], n, m), pull, work)
        # Its paths are those of the neighbours, too.
        for i in range(table.shape[1]):
            work.row[i] = table[k, i]
        sound = True
        for d in range(q.shape[0]):
            axis, s = d // 2, d * count + k
            sound = _place(view(q[d, k], 0, (n,)), layout, chains, held[k], epsilon, work)
            if not sound:
                break
            first = r if axis < r else 0
            _evaluate(work.row, layout, every_there, s, faster, a, basis, first, work)
            at = stage_of(work.row, n, m)
            values[d] = _value(at, pull, work)
            if axis < r:
                share = (1.0 if d % 2 == 0 else -1.0) / (2.0 * reach)
                _add_neighbour(gamma, curved, pull, axis, share, at.qd, work)
        if not sound:
            failed = k if failed < 0 else failed
            _set_all(gamma, curved, nan)
            continue
        _set_second(curved, values, middle, reach, r)
        _add_by_rates(curved, table[k], layout, every_here, k, gamma, pull, work)
        _scale(gamma, curved, scale)
    return failed


@called
def _place(
    q: Array, layout: Layout, chains: Array, held: Flags, epsilon: Array, work: _Work
) -> bool:
    """Evaluate eq. 4 at q with ε in the work space's row, which has the paths; False if not."""
    n, m = len(q), rows_of(layout)
    at = stage_of(work.row, n, m)
    place_tips(q, chains, work.turns, work.places, work.rotations, work.positions, work.jacobians)
    clear_held(held, work.jacobians)
    for f in range(layout.shape[0]):
        task_rows(layout, f, work.rotations[f], work.jacobians[f], at.task_jacobian)
    gram(at.task_jacobian, at.factor)
    if not cholesky(at.factor):
        return False
    for j in range(n):
        at.epsilon[j] = epsilon[j]
    return evaluate_motion(q, work.row, layout, work.rotations, work.positions, work.jacobians)


@called
def _evaluate(
    row: Array,
    layout: Layout,
    every: Every | None,
    s: int,
    accelerations: Array,
    a: Array,
    bases: Array,
    count: int,
    work: _Work,
) -> None:
    """Set q̈ of a row whose motion is known, and its derivatives by `count` coordinates.

    ∂q̇/∂ν = (I - J⁺J) N0 and ∂q̈/∂ν = J⁺ ∂b/∂q̇ ∂q̇/∂ν, with b of q̈ = J⁺(b - J a) + a.
    """
    n, m = len(a), rows_of(layout)
    at = stage_of(row, n, m)
    right, direction, rates = work.right, work.direction, work.rates
    required_acceleration(row, layout, every, s, accelerations, at.qd, work.six, right)
    project(at.task_jacobian, at.factor, right, a, work.qdd)
    if count > 0:
        acceleration_slopes(row, layout, every, s, at.qd, True, work.six, work.slopes)
    for x in range(count):
        for j in range(n):
            direction[j] = bases[j, x]
        for i in range(m):
            right[i] = 0.0
        project(at.task_jacobian, at.factor, right, direction, rates)
        for j in range(n):
            work.by_rate[x, j], direction[j] = rates[j], 0.0
        for i in range(m):
            right[i] = 0.0
            for j in range(n):
                right[i] += work.slopes[i, j] * rates[j]
        project(at.task_jacobian, at.factor, right, direction, rates)
        for j in range(n):
            work.by_both[x, j] = rates[j]


@inlined
def _set_exact(gamma: Array, bases: Array, work: _Work) -> None:
    """Set the columns of Γ that need no differences: ∂q/∂z, and all by ν and α."""
    n, r = bases.shape
    for j in range(n):
        for x in range(r):
            gamma[0, j, x] = bases[j, x]
            gamma[1, j, r + x] = gamma[2, j, 2 * r + x] = work.by_rate[x, j]
            gamma[2, j, r + x] = work.by_both[x, j]


@inlined
def _value(at: Stage, force: Array, work: _Work) -> float:
    """Return λᵀ(q, q̇, q̈)."""
    total = 0.0
    for j in range(force.shape[1]):
        total += force[0, j] * at.q[j] + force[1, j] * at.qd[j] + force[2, j] * work.qdd[j]
    return total


@called
def _add_neighbour(
    gamma: Array, curved: Array, force: Array, axis: int, share: float, qd: Array, work: _Work
) -> None:
    """Add a neighbour's part of the first derivatives by a coordinate of z, and of mixed ones."""
    r, n = work.by_rate.shape
    for j in range(n):
        gamma[1, j, axis] += share * qd[j]
        gamma[2, j, axis] += share * work.qdd[j]
    for x in range(r):
        by_nu, by_alpha = 0.0, 0.0
        for j in range(n):
            by_nu += force[1, j] * work.by_rate[x, j] + force[2, j] * work.by_both[x, j]
            by_alpha += force[2, j] * work.by_rate[x, j]
        curved[axis, r + x] += share * by_nu
        curved[axis, 2 * r + x] += share * by_alpha
        curved[r + x, axis] = curved[axis, r + x]
        curved[2 * r + x, axis] = curved[axis, 2 * r + x]


@inlined
def _scale(gamma: Array, curved: Array, scale: Array) -> None:
    """Change the units of the coordinates."""
    for c in range(len(scale)):
        for d in range(len(scale)):
            curved[c, d] *= scale[c] * scale[d]
        for o in range(3):
            for j in range(gamma.shape[1]):
                gamma[o, j, c] *= scale[c]


@inlined
def _set_all(gamma: Array, curved: Array, value: float) -> None:
    gamma[:] = value
    curved[:] = value


@inlined
def _set_second(curved: Array, values: Array, middle: float, reach: float, r: int) -> None:
    """Set the second derivatives by z: differences along the axes, then along sums of two."""
    for x in range(r):
        curved[x, x] = (values[2 * x] - 2.0 * middle + values[2 * x + 1]) / reach**2
    d = 2 * r
    for x in range(r):
        for y in range(x):
            both = (values[d] - 2.0 * middle + values[d + 1]) / reach**2
            curved[x, y] = curved[y, x] = 0.5 * (both - curved[x, x] - curved[y, y])
            d += 2


@called
def _add_by_rates(
    curved: Array,
    row: Array,
    layout: Layout,
    every: Every | None,
    s: int,
    gamma: Array,
    force: Array,
    work: _Work,
) -> None:
    """Add the second derivatives by two of ν: of λᵀq̈ these are λᵀJ⁺ ∂²b/∂q̇² ∂q̇/∂ν ∂q̇/∂ν."""
    (r, n), m = work.by_rate.shape, rows_of(layout)
    at, pulled, direction = stage_of(row, n, m), work.right, work.direction
    for i in range(m):
        pulled[i] = 0.0
        for j in range(n):
            pulled[i] += at.task_jacobian[i, j] * force[2, j]
    solve_cholesky(at.factor, pulled)
    for x in range(r):
        for j in range(n):
            direction[j] = gamma[1, j, r + x]
        acceleration_slopes(row, layout, every, s, direction, False, work.six, work.slopes)
        for y in range(x + 1):
            total = 0.0
            for i in range(m):
                for j in range(n):
                    total += pulled[i] * work.slopes[i, j] * gamma[1, j, r + y]
            curved[r + x, r + y] += total
            if x != y:
                curved[r + y, r + x] += total


@meanwhile
def _call_what_follows() -> None:
    """Compile the kernels that are called after the largest one, `retract`: called for no nodes."""
    layout = layout_of([(np.arange(1), False, np.arange(2))], 2)
    table, rates = np.zeros((0, columns(2, 1, 1))), np.zeros((0, 2))
    bases, held, given = np.zeros((0, 2, 1)), np.zeros((0, 2), dtype=np.bool_), np.zeros((0, 6))
    one, three = np.zeros((0, 1)), np.zeros((0, 3, 2))
    accelerate(table, layout, None, given, rates, rates)
    neighbours(table, layout, None, bases, np.eye(1), _REACH, np.zeros((2, 0, 2)))
    differences(
        np.zeros((2, 0, 2)),
        table,
        layout,
        None,
        None,
        np.zeros((1, 3, 6, 3)),
        held,
        given,
        bases,
        one,
        one,
        three,
        np.ones(3),
        _REACH,
        np.zeros(1),
        np.zeros((0, 3, 2, 3)),
        np.zeros((0, 3, 3)),
    )
