"""Chains along parts of a path: which configurations they begin and end at."""

from types import SimpleNamespace

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.segments import ChainSegments

LIMIT = 2.0


def keep(q: Array) -> None:
    """Keep a given start of two joints, the second of which meets a body above 1."""
    body = SimpleNamespace(
        robot=SimpleNamespace(dof=2), colliding=lambda q, distance: q[:, 1] + distance > 1.0
    )
    limits = np.full(2, -LIMIT), np.full(2, LIMIT)
    bounds = SearchBounds(*limits, np.ones(2, dtype=bool), ((body, 0.1),))
    layers = SimpleNamespace(
        samples=[q[None]], bounds=bounds, refused=lambda i, reason, more: ValueError(reason)
    )
    formulation = SimpleNamespace(robot=SimpleNamespace(joint_names=("first", "second")))
    ChainSegments(formulation, layers, SimpleNamespace())._keep_given(0, "given start")


def test_a_given_start_is_kept_unless_it_is_outside_limits_or_meets_something() -> None:
    keep(np.array([LIMIT, 0.8]))
    with pytest.raises(ValueError, match=r"given start has joint 'second' at -2\.1, outside its"):
        keep(np.array([0.0, -2.1]))
    with pytest.raises(ValueError, match="given start is in collision, or nearer than asked for"):
        keep(np.array([0.0, 0.95]))
