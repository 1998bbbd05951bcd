"""Matrices of the coordinates of all nodes are the sums of products that they are made of."""

from collections.abc import Callable

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix, Points
from selfmotion.planning.nodes.spline import AT_GAUSS, Quintic

# Relative to the largest entry: rounding of sums.
ROUNDING = 1e-12
DOF, SIZE, COPIES = 4, 5, 2
T = np.array([0.0, 0.3, 1.0, 1.4])


class Case:
    """Random changes of the nodes of two motions, with the gap between them."""

    def __init__(self) -> None:
        self.rng = np.random.default_rng(11)
        self.spline = Quintic(T, COPIES)
        nodes = self.rng.normal(size=(COPIES * len(T), 3, DOF, SIZE))
        self.by: EndChanges = self.spline.changes(nodes)
        self.matrix = NodeMatrix.zeros(len(nodes), SIZE)

    @property
    def count(self) -> int:
        """Number of intervals."""
        return self.spline.count

    def ends(self, k: int) -> Array:
        """Return ∂y/∂w of an interval by the coordinates of all nodes, (6, n, W)."""
        found = np.zeros((6, DOF, len(self.by.nodes) * SIZE))
        for side in range(2):
            columns = slice((k + side) * SIZE, (k + side + 1) * SIZE)
            found[3 * side : 3 * side + 3, :, columns] = self.by.nodes[k + side]
        return found * self.by.powers[k][:, None, None]


def joint_forms(case: Case) -> Array:
    forms = case.rng.normal(size=(case.count, DOF, 6, 6))
    forms = forms + np.swapaxes(forms, 2, 3)
    case.matrix.add_joint_forms(case.by, forms)
    each = (np.einsum("ajx,jab,bjy->xy", case.ends(k), forms[k], case.ends(k)) for k in inner(case))
    return np.asarray(sum(each))


def coupled_form(case: Case) -> Array:
    stiffness = case.rng.normal(size=(case.count, 6, 6))
    stiffness = stiffness + np.swapaxes(stiffness, 1, 2)
    # Of the first joints: those after them are virtual ones.
    weight = case.rng.normal(size=(DOF - 1, DOF - 1))
    weight = weight + weight.T
    case.matrix.add_form(case.by, stiffness, weight)
    own = [case.ends(k)[:, : DOF - 1] for k in range(case.count)]
    each = (
        np.einsum("aix,ij,ab,bjy->xy", own[k], weight, stiffness[k], own[k]) for k in inner(case)
    )
    return np.asarray(sum(each))


def rows(case: Case) -> Array:
    intervals = np.array([0, 2, 2, 5])
    by_ends = case.rng.normal(size=(len(intervals), 6, DOF))
    weights = case.rng.uniform(size=len(intervals))
    case.matrix.add_rows(case.by, intervals, by_ends, weights)
    each = [
        np.einsum("aj,ajx->x", row, case.ends(k)) for k, row in zip(intervals, by_ends, strict=True)
    ]
    return np.asarray(
        sum(weight * np.outer(row, row) for weight, row in zip(weights, each, strict=True))
    )


def products(case: Case) -> Array:
    samples = len(AT_GAUSS[0])
    shape = case.count * samples, DOF, 2
    sides = []
    for order in (0, 1):
        table = np.ascontiguousarray(AT_GAUSS[order])
        sides.append(Points(table, case.spline.rates[order], case.rng.normal(size=shape)))
    weights = case.rng.normal(size=shape[0])
    case.matrix.add_products(case.by, *sides, weights)
    found = np.zeros((len(case.by.nodes) * SIZE,) * 2)
    for k in inner(case):
        for s in range(samples):
            left, right = (
                side.scale[k]
                * np.einsum(
                    "a,ajx,jf->fx", side.table[s], case.ends(k), side.forms[k * samples + s]
                )
                for side in sides
            )
            product = weights[k * samples + s] * left.T @ right
            found += 0.5 * (product + product.T)
    return found


def inner(case: Case) -> list[int]:
    """Return the intervals that are no gap."""
    return np.delete(np.arange(case.count), case.spline.gaps).tolist()


@pytest.mark.parametrize("adds", [joint_forms, coupled_form, rows, products])
def test_what_is_added_is_the_sum_of_products(adds: Callable[[Case], Array]) -> None:
    case = Case()
    expected = adds(case)
    found = case.matrix.banded().dense()
    np.testing.assert_allclose(found, expected, atol=ROUNDING * np.abs(expected).max())
    # A wrong power of an interval's length would show.
    again = Case()
    again.by.nodes[:, 1] *= 1.0 + 1e-6
    adds(again)
    other = again.matrix.banded().dense()
    assert np.abs(other - expected).max() > 1e3 * ROUNDING * np.abs(expected).max()


def test_a_copy_is_added_to_alone() -> None:
    case = Case()
    joint_forms(case)
    before, other = case.matrix.banded().dense(), case.matrix.copy()
    other.nodes[:] += 1.0
    np.testing.assert_array_equal(case.matrix.banded().dense(), before)
