"""Symmetric matrices of the coordinates of all nodes, compiled: each node meets its neighbours.

All that adds to them is a function of the ends y of intervals, see `Quintic`, and y is a function
of the coordinates w of its two nodes, y = ∂y/∂w w. So a second derivative by y, or the square of a
row by y, goes into four blocks, of which three are kept.
"""

from typing import NamedTuple, Self

import numpy as np

from selfmotion.basics import Array, Ints, inlined, kernel
from selfmotion.planning.optimise import Banded


class EndChanges(NamedTuple):
    """∂y/∂w of the ends y of all intervals, by their nodes.

    Attributes
    ----------
    nodes : (N + 1, 3, n, d)
        ∂(q, q̇, q̈)/∂w of each node.
    powers : (N, 6)
        How (q, q̇, q̈) of both ends scale to become y; 0 in gaps.
    """

    nodes: Array
    powers: Array

    def along(self, step: Array) -> Array:
        """Return the change of y, (N, 6, n), along a step of the nodes (N + 1, d)."""
        found = np.empty((len(self.powers), 6, self.nodes.shape[2]))
        _change_ends(self.nodes, self.powers, step, found)
        return found

    def pulled(self, by_ends: Array) -> Array:
        """Return derivatives by w of all nodes, (N + 1, d), for those by y, (N, 6, n)."""
        count, _, _, size = self.nodes.shape
        found = np.zeros((count, size))
        _pull_ends(self.nodes, self.powers, by_ends, found)
        return found


class Points(NamedTuple):
    """Linear forms of one derivative of the curve at points of all intervals.

    Attributes
    ----------
    table : (P, 6)
        U_o of the points, see `Quintic`.
    scale : (N,)
        h^-o.
    forms : (N P, n, p)
        Each times the derivative is p numbers.
    """

    table: Array
    scale: Array
    forms: Array


class NodeMatrix(NamedTuple):
    """A symmetric block-tridiagonal matrix.

    Attributes
    ----------
    nodes : (N + 1, d, d)
        Blocks of each node, symmetric.
    pairs : (N, d, d)
        Blocks of each node, by the coordinates of the next one.
    """

    nodes: Array
    pairs: Array

    @classmethod
    def zeros(cls, count: int, size: int) -> Self:
        """Return the matrix 0 for `count` nodes with `size` coordinates each."""
        return cls(np.zeros((count, size, size)), np.zeros((count - 1, size, size)))

    def copy(self) -> Self:
        """Return a matrix that can be added to."""
        return type(self)(self.nodes.copy(), self.pairs.copy())

    def banded(self) -> Banded:
        """Return the matrix as LAPACK has it."""
        count, size, _ = self.nodes.shape
        found = Banded(count, size, 1)
        found.add(0, 0, self.nodes)
        found.add(1, 0, self.pairs)
        return found

    def add_joint_forms(self, by: EndChanges, forms: Array) -> None:
        """Add Σ_j y_jᵀ forms_j y_j for forms (N, n, 6, 6) by y of each joint."""
        _add_joint_forms(*self, *by, forms)

    def add_form(self, by: EndChanges, stiffness: Array, weight: Array) -> None:
        """Add Σ_ij weight_ij y_iᵀ K y_j for K (N, 6, 6) and a weight (n, n) of the first joints."""
        _add_form(*self, *by, stiffness, weight)

    def add_rows(self, by: EndChanges, intervals: Ints, rows: Array, weights: Array) -> None:
        """Add Σ weights rows rowsᵀ for rows (R, 6, n) by y of `intervals` (R,)."""
        _add_rows(*self, *by, intervals, rows, weights)

    def add_products(self, by: EndChanges, left: Points, right: Points, weights: Array) -> None:
        """Add the symmetric part of Σ weights leftᵀ right, for weights (N P,)."""
        _add_products(*self, *by, *left, *right, weights)


@kernel
def _change_ends(nodes: Array, powers: Array, step: Array, found: Array) -> None:
    _, _, n, size = nodes.shape
    for k in range(len(powers)):
        for a in range(2):
            for o in range(3):
                for j in range(n):
                    total = 0.0
                    for x in range(size):
                        total += nodes[k + a, o, j, x] * step[k + a, x]
                    found[k, 3 * a + o, j] = powers[k, 3 * a + o] * total


@kernel
def _pull_ends(nodes: Array, powers: Array, by_ends: Array, found: Array) -> None:
    _, _, n, size = nodes.shape
    for k in range(len(powers)):
        # Derivatives in gaps may be NaN.
        if powers[k, 0] == 0.0:
            continue
        for a in range(2):
            for o in range(3):
                for j in range(n):
                    by = powers[k, 3 * a + o] * by_ends[k, 3 * a + o, j]
                    if by != 0.0:
                        for x in range(size):
                            found[k + a, x] += by * nodes[k + a, o, j, x]


@kernel
def _add_joint_forms(
    blocks: Array, pairs: Array, nodes: Array, powers: Array, forms: Array
) -> None:
    (count, n), size = forms.shape[:2], nodes.shape[3]
    turned = np.empty((3, size))
    for k in range(count):
        if powers[k, 0] == 0.0:
            continue
        for j in range(n):
            for a in range(2):
                for b in range(a, 2):
                    any_entry = False
                    for o in range(3):
                        for x in range(size):
                            turned[o, x] = 0.0
                        for p in range(3):
                            share = forms[k, j, 3 * a + o, 3 * b + p]
                            if share == 0.0:
                                continue
                            any_entry = True
                            share *= powers[k, 3 * a + o] * powers[k, 3 * b + p]
                            for x in range(size):
                                turned[o, x] += share * nodes[k + b, p, j, x]
                    if any_entry:
                        target = pairs[k] if a != b else blocks[k + a]
                        _add_turned(target, nodes[k + a], j, turned)


@inlined
def _add_turned(block: Array, node: Array, j: int, turned: Array) -> None:
    """Add Σ_o node_ojᵀ turned_o to a block."""
    size = block.shape[0]
    for o in range(3):
        for x in range(size):
            share = node[o, j, x]
            if share != 0.0:
                for y in range(size):
                    block[x, y] += share * turned[o, y]


@kernel
def _add_form(
    blocks: Array, pairs: Array, nodes: Array, powers: Array, stiffness: Array, weight: Array
) -> None:
    count, n, size = len(stiffness), len(weight), nodes.shape[3]
    weighted, turned = np.empty((3, size)), np.empty((3, size))
    for k in range(count):
        if powers[k, 0] == 0.0:
            continue
        for a in range(2):
            for b in range(a, 2):
                target = pairs[k] if a != b else blocks[k + a]
                for i in range(n):
                    weighted[:] = 0.0
                    for j in range(n):
                        for p in range(3):
                            share = weight[i, j] * powers[k, 3 * b + p]
                            for x in range(size):
                                weighted[p, x] += share * nodes[k + b, p, j, x]
                    for o in range(3):
                        turned[o] = 0.0
                        for p in range(3):
                            share = stiffness[k, 3 * a + o, 3 * b + p] * powers[k, 3 * a + o]
                            for x in range(size):
                                turned[o, x] += share * weighted[p, x]
                    _add_turned(target, nodes[k + a], i, turned)


@kernel
def _add_rows(
    blocks: Array,
    pairs: Array,
    nodes: Array,
    powers: Array,
    intervals: Ints,
    rows: Array,
    weights: Array,
) -> None:
    n, size = rows.shape[2], nodes.shape[3]
    own = np.empty((2, size))
    for i in range(len(intervals)):
        k, weight = intervals[i], weights[i]
        if weight == 0.0:
            continue
        own[:] = 0.0
        for a in range(2):
            for o in range(3):
                for j in range(n):
                    share = rows[i, 3 * a + o, j] * powers[k, 3 * a + o]
                    if share != 0.0:
                        for x in range(size):
                            own[a, x] += share * nodes[k + a, o, j, x]
        for x in range(size):
            first, last = weight * own[0, x], weight * own[1, x]
            for y in range(size):
                blocks[k, x, y] += first * own[0, y]
                pairs[k, x, y] += first * own[1, y]
                blocks[k + 1, x, y] += last * own[1, y]


@kernel
def _add_products(
    blocks: Array,
    pairs: Array,
    nodes: Array,
    powers: Array,
    left_table: Array,
    left_scale: Array,
    left_forms: Array,
    right_table: Array,
    right_scale: Array,
    right_forms: Array,
    weights: Array,
) -> None:
    count, points, size = len(powers), len(left_table), nodes.shape[3]
    forms = left_forms.shape[2]
    left, right = np.empty((forms, 2, size)), np.empty((forms, 2, size))
    for k in range(count):
        if powers[k, 0] == 0.0:
            continue
        for s in range(points):
            sample = points * k + s
            half = 0.5 * weights[sample]
            _write_forms(nodes, powers, k, left_table[s], left_scale[k], left_forms[sample], left)
            _write_forms(
                nodes, powers, k, right_table[s], right_scale[k], right_forms[sample], right
            )
            for f in range(forms):
                for x in range(size):
                    l0, l1 = half * left[f, 0, x], half * left[f, 1, x]
                    r0, r1 = half * right[f, 0, x], half * right[f, 1, x]
                    for y in range(size):
                        blocks[k, x, y] += l0 * right[f, 0, y] + r0 * left[f, 0, y]
                        pairs[k, x, y] += l0 * right[f, 1, y] + r0 * left[f, 1, y]
                        blocks[k + 1, x, y] += l1 * right[f, 1, y] + r1 * left[f, 1, y]


@inlined
def _write_forms(
    nodes: Array, powers: Array, k: int, table: Array, scale: float, forms: Array, out: Array
) -> None:
    """Set `out` (p, 2, d) to forms (n, p) of a derivative at a point, by the interval's nodes."""
    n, count = forms.shape
    size = nodes.shape[3]
    for f in range(count):
        for a in range(2):
            for x in range(size):
                out[f, a, x] = 0.0
            for o in range(3):
                share = scale * table[3 * a + o] * powers[k, 3 * a + o]
                if share == 0.0:
                    continue
                for j in range(n):
                    weight = share * forms[j, f]
                    if weight != 0.0:
                        for x in range(size):
                            out[f, a, x] += weight * nodes[k + a, o, j, x]
