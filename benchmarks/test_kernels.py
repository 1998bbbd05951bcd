"""One evaluation: what the engine adds to Pinocchio's own calls (Panda, 6 rows, 50 steps)."""

from __future__ import annotations

from typing import Any

import pytest
from engine import Measured, objective_on, pinocchio_loop
from problems import circle


@pytest.fixture(scope="module")
def objective() -> Any:
    return objective_on(circle("panda", "pose"), 50)


@pytest.mark.benchmark(group="kernels")
def test_pinocchio_loop(benchmark: Any, objective: Any) -> None:
    benchmark(pinocchio_loop(objective))


@pytest.mark.benchmark(group="kernels")
def test_rollout(benchmark: Any, objective: Any) -> None:
    benchmark(Measured(objective, gradient=False))


@pytest.mark.benchmark(group="kernels")
def test_rollout_and_gradient(benchmark: Any, objective: Any) -> None:
    benchmark(Measured(objective, gradient=True))
