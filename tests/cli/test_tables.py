"""Tables fit narrow terminals and logs."""

import dataclasses
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.shell.cli import tables
from support.shell import complaint, invoke

# Runs several commands in one process, each as the shell does, with a mark after each.
SEVERAL = """
import json, sys
from selfmotion.shell.cli import app
for words in json.loads(sys.argv[1]):
    assert not app(words, standalone_mode=False), words
    print("\\f")
"""


@pytest.mark.parametrize("columns", [60, None])
def test_tables_fit_narrow_terminals_and_logs(tmp_path: Path, columns: int | None) -> None:
    """No name is cut and no unit lost; a verdict is one line of a log, to be searched for."""
    file = tmp_path / "plan.npz"
    sm.plan(sm.sample_problem()).save(file)
    environment = {key: value for key, value in os.environ.items() if key != "COLUMNS"}
    environment |= {} if columns is None else {"COLUMNS": str(columns)}
    verdict = sm.load_plan(file).certificate.verdict
    commands = [["check", str(file), "--verbose"], ["compare", str(file), str(file)], ["robots"]]
    printed = subprocess.run(
        [sys.executable, "-c", SEVERAL, json.dumps(commands)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert printed.returncode == 0, printed.stderr
    checked, compared, robots, _ = printed.stdout.split("\f\n")
    for text in (checked, compared, robots):
        assert "…" not in text
        table = [line for line in text.splitlines() if line != verdict]
        assert max(map(len, table)) <= (columns or 120)
    assert verdict in checked.splitlines()
    assert "joint path, rad or m" in compared


@pytest.mark.parametrize(
    ("amount", "allowed", "kept", "told"),
    [
        (0.015, 0.0147, True, "at least 0.0147 m/s"),
        (0.014, 0.0147, False, "at least 0.0147 m/s"),
        (0.0, 1e-6, True, "1e-06 m/s allowed"),
        (0.1, 1e-6, False, "1e-06 m/s allowed"),
    ],
)
def test_a_limit_is_told_with_its_side(
    amount: float, allowed: float, kept: bool, told: str
) -> None:
    """A feed that is kept, above what it has to be at least, does not read as a violation."""
    found = sm.certificate.Finding("feed", "path", 1.0, amount, allowed, kept, "", unit="m/s")
    plan = sm.plan(sm.sample_problem())
    certificate, page = plan.certificate, io.StringIO()
    only = dataclasses.replace(certificate, findings=(*certificate.findings, found))
    tables.show_certificate(only, {}, plan.robot, Console(file=page, width=120))
    # Its joints turn, all of them.
    assert "rad or m" not in page.getvalue()
    (line,) = (line for line in page.getvalue().splitlines() if f"feed ({told})" in line)
    assert f" {amount:.4g} m/s " in line


@pytest.mark.parametrize(
    ("unit", "amount", "allowed", "told"),
    [
        ("rad/s²", 0.0075, 1e-3, "acceleration at rest (0.001 rad/s² allowed)"),
        ("rad/s", 2e-5, 1e-6, "speed at rest (1e-06 rad/s allowed)"),
    ],
)
def test_what_moves_at_rest_is_told_with_its_unit(
    unit: str, amount: float, allowed: float, told: str
) -> None:
    plan, page = sm.plan(sm.sample_problem()), io.StringIO()
    found = sm.certificate.Finding("rest", "joint1", 0.0, amount, allowed, False, "", unit=unit)
    findings = (*plan.certificate.findings, found)
    only = dataclasses.replace(plan.certificate, findings=findings)
    tables.show_certificate(only, {}, plan.robot, Console(file=page, width=120))
    (line,) = (line for line in page.getvalue().splitlines() if told in line)
    assert f" {amount:.4g} {unit} " in line


def test_the_unit_of_what_is_found_is_the_joints() -> None:
    """From the requirement itself: q̇ and q̈ at an end, of a hinge."""
    arm = sm.load_robot("planar_3r")
    q, none = np.zeros((2, 3)), np.zeros((2, 3))
    for qd, qdd, unit in ((none + 0.1, none, "rad/s"), (none, none + 0.1, "rad/s²")):
        motion = sm.Trajectory(np.array([0.0, 1.0]), q, qd, arm.joint_names, qdd)
        line = sm.paths.Line(arm.pose(q[0]), arm.pose(q[0]), 1.0)
        found = sm.Problem(arm, line, "planar").certify(motion).findings
        (rest,) = (item for item in found if item.requirement == "rest")
        assert rest.unit == unit


def test_plans_are_compared_by_costs_that_the_shell_names(tmp_path: Path) -> None:
    """By the same ones as in Python; those of a plan's own say nothing of another's."""
    plan = sm.plan(sm.sample_problem())
    slower = sm.retime(plan, 1.5)
    files = [tmp_path / "plan.npz", tmp_path / "slower.npz"]
    for one, file in zip((plan, slower), files, strict=True):
        one.save(file)
    costs_of = 'costs=[{kind="JointVelocity"}, {kind="JointAcceleration", weight=0.1}]'
    asked = ("--set", costs_of)
    code, text = invoke("compare", *files, *asked, "--json")
    assert code == 0
    told = json.loads(text)
    costs = [sm.costs.JointVelocity(), sm.costs.JointAcceleration(0.1)]
    for one, file in zip((plan, slower), files, strict=True):
        measured = told[str(file)]["measured"]
        each = [one.evaluate(cost) for cost in costs]
        assert [*measured.values()] == pytest.approx([*each, sum(each)], rel=1e-9)
    code, text = invoke("compare", *files, *asked)
    assert code == 0
    assert "joint acceleration" in text
    assert "total cost" in text
    assert "measured" not in invoke("compare", *files, "--json")[1]
    said = complaint("compare", *files, "--set", 'costs=[{kind="Nothing"}]')
    assert "costs[0]: kind is 'Nothing'" in said
