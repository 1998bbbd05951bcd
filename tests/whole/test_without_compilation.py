"""Kernels that are not compiled: the same plans, files and verdicts by the written-out Python."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import selfmotion as sm
from support.arms import PANDA_HOME, robot_named, short_line

# Compiled code adds in another order: costs of optima agree to this share.
ROUNDING = 1e-9

SCRIPT = """
import sys
import selfmotion as sm
plan = sm.load_plan(sys.argv[1])
again = sm.plan(plan.problem)
again.save(sys.argv[2])
"""


def test_a_plan_without_compiled_kernels_is_the_same_and_can_be_saved(tmp_path: Path) -> None:
    robot = robot_named("panda")
    plan = sm.plan(sm.Problem(robot, short_line(robot, PANDA_HOME), start=PANDA_HOME))
    first, second = tmp_path / "compiled.npz", tmp_path / "interpreted.npz"
    plan.save(first)
    subprocess.run(
        [sys.executable, "-c", SCRIPT, first, second],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        check=True,
        capture_output=True,
        timeout=300,
    )
    again = sm.load_plan(second)
    assert again.certificate.verified
    np.testing.assert_allclose(again.report.cost, plan.report.cost, rtol=ROUNDING)
    assert again.report.iterations == plan.report.iterations
