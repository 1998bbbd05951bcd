"""The benchmark of redundancy maps accepts a map as it is, and refuses one shifted by a pixel."""

from dataclasses import replace

import numpy as np
import pytest
from redundancy_map import Compared, by_brute_force, differences
from suite import load, plan

from selfmotion.basics import silent
from support.places import DATA

pytestmark = pytest.mark.site

# Random starts at each pixel: enough for a few columns.
STARTS = 48


def test_a_map_is_accepted_and_a_shifted_one_refused() -> None:
    problem = load(DATA / "panda__1cube")
    found, _ = plan(problem, 0, silent)
    shown = found.redundancy_map(shape=(2, 31))
    brute = by_brute_force(found, shown, problem, STARTS)
    assert not differences(shown.state, brute).any()
    wrong = differences(np.roll(shown.state, 1, axis=1), brute)
    assert wrong.any()
    verdict = Compared("panda", shown.label, 1, 0.0, wrong.size, 0, 0)
    assert verdict.is_right
    assert not replace(verdict, wrong=int(wrong.sum())).is_right
    assert not replace(verdict, wrong_on_line=1).is_right
