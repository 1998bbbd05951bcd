"""Relaxations that make no sense are refused."""

import numpy as np
import pytest

import selfmotion as sm


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rows": "w"}, "expected some of x, y, z"),
        ({"rows": ()}, "expected some of"),
        ({"rows": ("x", "x")}, "each once"),
        ({"rows": ("x", "rx")}, "mix metres and radians"),
        ({"rows": "x", "band": 0.0}, "band is 0.0"),
        ({"rows": "x", "band": np.nan}, "band is nan"),
        ({"rows": "x", "axes": "base"}, "expected 'world' or 'tool'"),
        ({"rows": "x", "during": (2.0, 1.0)}, "0 ≤ first < last"),
        ({"rows": "x", "during": (1.0,)}, "expected two times"),
        ({"rows": "x", "during": (0.0, np.inf)}, "expected two times"),
        ({"rows": "x", "during": 1.0}, "expected two times"),
        ({"rows": "x", "during": "ab"}, "expected two times"),
        ({"rows": "x", "band": "a"}, "expected a number"),
        ({"rows": 3}, "expected names of rows"),
    ],
)
def test_bad_relaxations_are_refused(options: dict, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        sm.Relaxation(**options)
