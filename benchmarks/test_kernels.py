"""What the engine adds to Pinocchio's own calls (Panda, 6 rows, 50 steps), and its compilation."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
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


FIRST_PLAN = """
from problems import circle
import selfmotion as sm
sm.plan(circle("panda", "pose"))
"""


@pytest.mark.benchmark(group="first plan")
@pytest.mark.parametrize("cache", ["empty", "full"])
def test_first_plan(benchmark: Any, cache: str, tmp_path: Path) -> None:
    """A process and its first plan, on a machine where nothing is compiled yet and after that."""
    environment = dict(
        os.environ, NUMBA_CACHE_DIR=str(tmp_path), PYTHONPATH=str(Path(__file__).parent)
    )

    def plan() -> None:
        subprocess.run([sys.executable, "-c", FIRST_PLAN], env=environment, check=True)

    if cache == "full":
        plan()
    benchmark.pedantic(plan, rounds=1)
