"""Lengths and angles are written with a unit that fits their size, and read back the same."""

import math

import numpy as np
import pytest

from selfmotion.basics import in_angle, in_length

SCALES = {"µm": 1e-6, "mm": 1e-3, "m": 1.0, "µrad": 1e-6, "mrad": 1e-3, "rad": 1.0}


@pytest.mark.parametrize("digits", [2, 3, 4])
@pytest.mark.parametrize("write", [in_length, in_angle])
def test_what_is_written_is_the_value_to_its_digits(write: object, digits: int) -> None:
    rng = np.random.default_rng(0)
    for value in [0.0, *(10.0 ** rng.uniform(-12, 2, 300)), *(-(10.0 ** rng.uniform(-9, 2, 50)))]:
        number, unit = write(float(value), digits).split()  # type: ignore[operator]
        assert float(number) * SCALES[unit] == pytest.approx(
            value, rel=0.5 * 10.0 ** (1 - digits), abs=1e-12
        )


@pytest.mark.parametrize(
    ("metres", "text"),
    [(3.31e-8, "0.033 µm"), (9.97e-5, "100 µm"), (2e-3, "2 mm"), (0.0, "0 µm"), (1.5, "1.5 m")],
)
def test_units_are_those_that_people_read(metres: float, text: str) -> None:
    assert in_length(metres) == text


def test_what_is_no_number_has_a_unit() -> None:
    assert in_length(math.nan) == "nan m"
    assert in_angle(math.inf) == "inf rad"
