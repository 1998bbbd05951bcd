"""Nonlinear programmes with known answers: W. Hock and K. Schittkowski, Test Examples for Nonlinear
Programming Codes, Lecture Notes in Economics and Mathematical Systems 187, Springer 1981.

Numbers, starts and optimal values are theirs. Conditions are written as h ≤ 0, with bounds of
variables among them.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.optimise import DenseRows, Residuals, SequentialQuadratic, Status

# Optimal values are given to so many digits; conditions are kept to this.
VALUE, KEPT = 2e-5, 1e-8


# Nothing is left of the step that a derivative is taken with.
TINY = 1e-30


Vector = Any


class Programme(NamedTuple):
    """A programme, its start, its optimal value, and the evaluations that it may take.

    The last is what it took when this was written, and a tenth more: steps that are shorter or
    longer than they should be arrive as well, but later.
    """

    value: Callable[[Vector], Any]
    below: Callable[[Vector], list[Any]]
    zero: Callable[[Vector], list[Any]]
    start: tuple[float, ...]
    least: float
    evaluations: int


def none(x: Vector) -> list[Any]:
    return []


class Analytic:
    """A programme as the optimiser asks for it; derivatives by complex steps, exact to rounding."""

    def __init__(self, programme: Programme) -> None:
        self._programme = programme
        self.evaluations = 0
        self._seen: bytes = b""

    def value(self, x: Array) -> float:
        if x.tobytes() != self._seen:
            self.evaluations, self._seen = self.evaluations + 1, x.tobytes()
        return float(self._programme.value(x))

    def gradient(self, x: Array) -> Array:
        return np.array([self._programme.value(z).imag / TINY for z in self._shifted(x)])

    def slope(self, x: Array, direction: Array) -> float:
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        return np.eye(len(x))

    def conditions(self, x: Array) -> Residuals:
        h, equal = self._h(x), len(self._programme.zero(x))
        kinds = np.arange(len(h)) >= len(h) - equal
        return Residuals(h.real.astype(np.float64), np.full(len(h), KEPT), kinds)

    def condition_rows(self, x: Array) -> DenseRows:
        columns = [self._h(z).imag / TINY for z in self._shifted(x)]
        return DenseRows(np.stack(columns, axis=1).astype(np.float64))

    def _h(self, x: Vector) -> Any:
        return np.array([*self._programme.below(x), *self._programme.zero(x)], dtype=complex)

    def _shifted(self, x: Array) -> list[Any]:
        return [x + 1j * TINY * unit for unit in np.eye(len(x))]


def positive(x: Vector) -> list[Any]:
    return [-each for each in x]


PROGRAMMES = {
    6: Programme(
        lambda x: (1 - x[0]) ** 2,
        none,
        lambda x: [10 * (x[1] - x[0] ** 2)],
        (-1.2, 1.0),
        0.0,
        58,
    ),
    7: Programme(
        lambda x: np.log(1 + x[0] ** 2) - x[1],
        none,
        lambda x: [(1 + x[0] ** 2) ** 2 + x[1] ** 2 - 4],
        (2.0, 2.0),
        -np.sqrt(3.0),
        15,
    ),
    10: Programme(
        lambda x: x[0] - x[1],
        lambda x: [3 * x[0] ** 2 - 2 * x[0] * x[1] + x[1] ** 2 - 1],
        none,
        (-10.0, 10.0),
        -1.0,
        14,
    ),
    11: Programme(
        lambda x: (x[0] - 5) ** 2 + x[1] ** 2 - 25,
        lambda x: [x[0] ** 2 - x[1]],
        none,
        (4.9, 0.1),
        -8.498464223,
        13,
    ),
    12: Programme(
        lambda x: 0.5 * x[0] ** 2 + x[1] ** 2 - x[0] * x[1] - 7 * x[0] - 7 * x[1],
        lambda x: [4 * x[0] ** 2 + x[1] ** 2 - 25],
        none,
        (0.0, 0.0),
        -30.0,
        17,
    ),
    14: Programme(
        lambda x: (x[0] - 2) ** 2 + (x[1] - 1) ** 2,
        lambda x: [0.25 * x[0] ** 2 + x[1] ** 2 - 1],
        lambda x: [x[0] - 2 * x[1] + 1],
        (2.0, 2.0),
        9 - 2.875 * np.sqrt(7.0),
        7,
    ),
    22: Programme(
        lambda x: (x[0] - 2) ** 2 + (x[1] - 1) ** 2,
        lambda x: [x[0] + x[1] - 2, x[0] ** 2 - x[1]],
        none,
        (2.0, 2.0),
        1.0,
        9,
    ),
    26: Programme(
        lambda x: (x[0] - x[1]) ** 2 + (x[1] - x[2]) ** 4,
        none,
        lambda x: [(1 + x[1] ** 2) * x[0] + x[2] ** 4 - 3],
        (-2.6, 2.0, 2.0),
        0.0,
        46,
    ),
    27: Programme(
        lambda x: 0.01 * (x[0] - 1) ** 2 + (x[1] - x[0] ** 2) ** 2,
        none,
        lambda x: [x[0] + x[2] ** 2 + 1],
        (2.0, 2.0, 2.0),
        0.04,
        57,
    ),
    29: Programme(
        lambda x: -x[0] * x[1] * x[2],
        lambda x: [x[0] ** 2 + 2 * x[1] ** 2 + 4 * x[2] ** 2 - 48],
        none,
        (1.0, 1.0, 1.0),
        -16 * np.sqrt(2.0),
        13,
    ),
    35: Programme(
        lambda x: (
            9
            - 8 * x[0]
            - 6 * x[1]
            - 4 * x[2]
            + 2 * x[0] ** 2
            + 2 * x[1] ** 2
            + x[2] ** 2
            + 2 * x[0] * x[1]
            + 2 * x[0] * x[2]
        ),
        lambda x: [x[0] + x[1] + 2 * x[2] - 3, *positive(x)],
        none,
        (0.5, 0.5, 0.5),
        1 / 9,
        13,
    ),
    39: Programme(
        lambda x: -x[0],
        none,
        lambda x: [x[1] - x[0] ** 3 - x[2] ** 2, x[0] ** 2 - x[1] - x[3] ** 2],
        (2.0, 2.0, 2.0, 2.0),
        -1.0,
        15,
    ),
    40: Programme(
        lambda x: -x[0] * x[1] * x[2] * x[3],
        none,
        lambda x: [x[0] ** 3 + x[1] ** 2 - 1, x[0] ** 2 * x[3] - x[2], x[3] ** 2 - x[1]],
        (0.8, 0.8, 0.8, 0.8),
        -0.25,
        8,
    ),
    43: Programme(
        lambda x: (
            x[0] ** 2
            + x[1] ** 2
            + 2 * x[2] ** 2
            + x[3] ** 2
            - 5 * x[0]
            - 5 * x[1]
            - 21 * x[2]
            + 7 * x[3]
        ),
        lambda x: [
            x @ x + x[0] - x[1] + x[2] - x[3] - 8,
            x[0] ** 2 + 2 * x[1] ** 2 + x[2] ** 2 + 2 * x[3] ** 2 - x[0] - x[3] - 10,
            2 * x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + 2 * x[0] - x[1] - x[3] - 5,
        ],
        none,
        (0.0, 0.0, 0.0, 0.0),
        -44.0,
        22,
    ),
    71: Programme(
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        lambda x: [25 - x[0] * x[1] * x[2] * x[3], *(1 - x), *(x - 5)],
        lambda x: [x @ x - 40],
        (1.0, 5.0, 5.0, 1.0),
        17.0140173,
        7,
    ),
    76: Programme(
        lambda x: (
            x[0] ** 2
            + 0.5 * x[1] ** 2
            + x[2] ** 2
            + 0.5 * x[3] ** 2
            - x[0] * x[2]
            + x[2] * x[3]
            - x[0]
            - 3 * x[1]
            + x[2]
            - x[3]
        ),
        lambda x: [
            x[0] + 2 * x[1] + x[2] + x[3] - 5,
            3 * x[0] + x[1] + 2 * x[2] - x[3] - 4,
            1.5 - x[1] - 4 * x[2],
            *positive(x),
        ],
        none,
        (0.5, 0.5, 0.5, 0.5),
        -4.681818181,
        6,
    ),
    77: Programme(
        lambda x: (
            (x[0] - 1) ** 2
            + (x[0] - x[1]) ** 2
            + (x[2] - 1) ** 2
            + (x[3] - 1) ** 4
            + (x[4] - 1) ** 6
        ),
        none,
        lambda x: [
            x[0] ** 2 * x[3] + np.sin(x[3] - x[4]) - 2 * np.sqrt(2.0),
            x[1] + x[2] ** 4 * x[3] ** 2 - 8 - np.sqrt(2.0),
        ],
        (2.0, 2.0, 2.0, 2.0, 2.0),
        0.24150513,
        27,
    ),
    78: Programme(
        lambda x: x[0] * x[1] * x[2] * x[3] * x[4],
        none,
        lambda x: [x @ x - 10, x[1] * x[2] - 5 * x[3] * x[4], x[0] ** 3 + x[1] ** 3 + 1],
        (-2.0, 1.5, 2.0, -1.0, -1.0),
        -2.91970041,
        10,
    ),
    100: Programme(
        lambda x: (
            (x[0] - 10) ** 2
            + 5 * (x[1] - 12) ** 2
            + x[2] ** 4
            + 3 * (x[3] - 11) ** 2
            + 10 * x[4] ** 6
            + 7 * x[5] ** 2
            + x[6] ** 4
            - 4 * x[5] * x[6]
            - 10 * x[5]
            - 8 * x[6]
        ),
        lambda x: [
            2 * x[0] ** 2 + 3 * x[1] ** 4 + x[2] + 4 * x[3] ** 2 + 5 * x[4] - 127,
            7 * x[0] + 3 * x[1] + 10 * x[2] ** 2 + x[3] - x[4] - 282,
            23 * x[0] + x[1] ** 2 + 6 * x[5] ** 2 - 8 * x[6] - 196,
            4 * x[0] ** 2 + x[1] ** 2 - 3 * x[0] * x[1] + 2 * x[2] ** 2 + 5 * x[5] - 11 * x[6],
        ],
        none,
        (1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0),
        680.6300573,
        25,
    ),
}


@pytest.mark.parametrize("number", PROGRAMMES)
def test_answers_are_those_published(number: int) -> None:
    programme = PROGRAMMES[number]
    function = Analytic(programme)
    found = SequentialQuadratic().minimize(function, np.array(programme.start))
    assert found.status is Status.CONVERGED
    assert function.conditions(found.x).worst <= 1.0
    assert found.cost == pytest.approx(programme.least, rel=VALUE, abs=VALUE)
    assert function.evaluations <= programme.evaluations


def test_histories_tell_every_step_and_what_it_took() -> None:
    programme = PROGRAMMES[43]
    function = Analytic(programme)
    history = SequentialQuadratic().minimize(function, np.array(programme.start)).history
    assert [each.step for each in history] == [0.0, *[1.0] * (len(history) - 1)]
    assert history[0].evaluations == 1
    assert np.all(np.diff([each.evaluations for each in history]) >= 1)
    for each in history:
        assert each.cost == programme.value(each.x)
        gradient = function.gradient(each.x)
        assert each.gradient_norm == pytest.approx(np.linalg.norm(gradient), rel=1e-9)
