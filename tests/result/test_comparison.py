"""Plans side by side: numbers of the plans themselves, and a table of them."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shell.cli import tables

# The published method integrates its costs on its own grid.
INTEGRATED = 1e-4


@pytest.fixture(scope="module")
def plans() -> dict[str, sm.Plan]:
    problem = sm.sample_problem()
    other = replace(problem, costs=[sm.costs.PathLength(), sm.costs.JointVelocity()])
    return {"speed": sm.plan(problem), "length": sm.plan(other)}


def test_its_numbers_are_the_plans(plans: dict[str, sm.Plan]) -> None:
    found = sm.compare(plans)
    assert found.names == ("speed", "length")
    for k, plan in enumerate(plans.values()):
        told = {name: values[k] for name, values in found.costs.items()}
        assert {name: value for name, value in told.items() if value is not None} == dict(
            plan.report.terms
        )
        assert found.figures["duration, s"][k] == plan.trajectory.duration
        assert found.figures["position error, m"][k] == plan.certificate.position_error.value
        way = np.abs(np.diff(plan.trajectory.q, axis=0)).sum()
        assert found.figures["joint path, rad or m"][k] == pytest.approx(way)
    assert found.verdicts == tuple(plan.certificate.verdict for plan in plans.values())


def test_a_total_is_told_of_the_same_costs_only(plans: dict[str, sm.Plan]) -> None:
    speed = plans["speed"]
    assert "total cost" not in sm.compare(plans).costs
    assert str(sm.compare(plans)).splitlines()[-1].startswith("no total cost: ")
    assert "no total" not in str(sm.compare([speed, speed]))
    assert sm.compare([speed, speed]).costs["total cost"] == (speed.report.cost,) * 2
    # Of one name, and something else.
    heavier = sm.costs.JointVelocity(2.0)
    others = [heavier, *speed.problem.costs[1:]]
    other = replace(speed, problem=replace(speed.problem, costs=others))
    found = sm.compare([speed, other])
    assert "total cost" not in found.costs
    assert "joint velocity (each plan's own)" in found.costs

    def speed_of(q: Array, qd: Array, t: Array) -> Array:
        return np.square(qd).sum(axis=1)

    for one, same in ((lambda q, qd, t: t, False), (speed_of, True)):
        made = [
            replace(speed, problem=replace(speed.problem, costs=[sm.costs.FunctionCost(g)]))
            for g in (speed_of, speed_of if same else one)
        ]
        assert ("total cost" in sm.compare(made).costs) is same


def test_common_costs_are_evaluated_on_all(plans: dict[str, sm.Plan]) -> None:
    costs = [sm.costs.PathLength(), sm.costs.JointVelocity()]
    found = sm.compare(plans, costs=costs)
    assert list(found.costs) == ["path length", "joint velocity", "total cost"]
    length = plans["length"].report
    assert found.costs["total cost"][1] == pytest.approx(length.cost, rel=INTEGRATED)
    for k, plan in enumerate(plans.values()):
        each = [plan.evaluate(cost) for cost in costs]
        assert [found.costs[cost.name][k] for cost in costs] == each
        assert found.costs["total cost"][k] == sum(each)
    # What was optimised for it is the better one.
    assert found.costs["total cost"][1] < found.costs["total cost"][0]
    for wrong in ([], [costs[0], costs[0]], [3]):
        with pytest.raises(sm.errors.ProblemError, match="cost"):
            sm.compare(plans, costs=wrong)


def test_its_text_has_a_line_for_each_number(plans: dict[str, sm.Plan]) -> None:
    found = sm.compare(plans, costs=[sm.costs.JointVelocity()])
    lines = str(found).splitlines()
    assert lines[0].split() == ["speed", "length"]
    assert len(set(map(len, lines))) == 1, "columns are aligned"
    cost = next(line for line in lines if line.startswith("total cost"))
    assert cost.split()[2:] == [f"{value:.5g}" for value in found.costs["total cost"]]


def test_the_shell_shows_the_same_cells(plans: dict[str, sm.Plan]) -> None:
    page = io.StringIO()
    tables.show_comparison(sm.compare(plans), Console(file=page, width=120))
    shown = [line.split() for line in page.getvalue().splitlines()]
    for row in sm.compare(plans).cells():
        assert " ".join(row).split() in shown


def test_plans_without_names_are_numbered(plans: dict[str, sm.Plan]) -> None:
    assert sm.compare(list(plans.values())).names == ("plan 1", "plan 2")


def test_what_is_not_verified_says_why(plans: dict[str, sm.Plan]) -> None:
    plan = plans["speed"]
    motion = replace(plan.trajectory, q=plan.trajectory.q + 0.1)
    wrong = replace(plan, trajectory=motion)
    wrong = replace(wrong, certificate=wrong.check())
    found = sm.compare([plan, wrong])
    assert found.verified == (True, False)
    assert str(found).splitlines()[-1] == f"plan 2: {wrong.certificate.verdict}"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([], "expected plans, or a dict"),
        ("a.npz", "expected plans, or a dict"),
        (3, "plans is 3"),
        (["a.npz"], r"'plan 1' is 'a.npz', expected a plan"),
    ],
)
def test_what_are_no_plans_is_refused(given, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        sm.compare(given)
