"""How one evaluation grows with the number of joints, steps and coefficients."""

from __future__ import annotations

from typing import Any

import pytest
from engine import Measured, objective_on
from problems import chain

from selfmotion.model import kernels


@pytest.mark.benchmark(group="growth in joints")
@pytest.mark.parametrize("joints", [3, 6, 12, 24, 48])
def test_joints(benchmark: Any, joints: int) -> None:
    benchmark.extra_info["joints"] = joints
    benchmark(Measured(objective_on(chain(joints), 50), gradient=True))


@pytest.mark.benchmark(group="growth in steps")
@pytest.mark.parametrize("steps", [25, 50, 100, 200, 400, 800])
def test_steps(benchmark: Any, steps: int) -> None:
    objective = objective_on(chain(7), steps)
    benchmark.extra_info["steps"] = steps
    benchmark.extra_info["bytes"] = 8 * kernels.columns(7, 6, 1) * len(objective.grid.stage_times)
    benchmark(Measured(objective, gradient=True))


@pytest.mark.benchmark(group="growth in degree")
@pytest.mark.parametrize("degree", [1, 3, 7, 15])
def test_degree(benchmark: Any, degree: int) -> None:
    benchmark.extra_info["degree"] = degree
    benchmark(Measured(objective_on(chain(7, degree), 50), gradient=True))
