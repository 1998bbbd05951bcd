"""What is known of a plan is one list: the terminal, pages, sheets and JSON show the same facts."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.model.robot import Dynamics
from selfmotion.shell.cli import tables
from selfmotion.shell.facts import Fact, plan_facts, with_unit, without_repeats
from selfmotion.shell.replay.replayed import PlanReplay
from selfmotion.shell.sheet.tables import plan_sections
from support.arms import robot_named
from support.shell import invoke

# Samples of a power are not those of the plan: between them it changes by its slope.
SAMPLED = 1e-2


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    robot = robot_named("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(robot.pose(start), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(robot, circle, "position", start), max_evaluations=3)


def test_every_fact_of_a_motion_is_on_terminal_page_sheet_and_in_json(
    plan: sm.Plan, tmp_path: Path
) -> None:
    """The largest power of a joint among them, which is one line of the list."""
    facts = plan_facts(plan)
    shown = io.StringIO()
    tables.show(plan, Console(file=shown, width=200))
    of_page = PlanReplay(plan).facts
    rows = [row for section in plan_sections(plan, None) for row in section.rows]
    plan.save(tmp_path / "a.npz")
    _, text = invoke("compare", tmp_path / "a.npz", "--json")
    (told,) = json.loads(text).values()
    in_json = {item["label"]: item for item in told["certificate"]["facts"]}
    motion = [item for item in without_repeats(facts) if item.group in ("path", "motion", "near")]
    assert "largest power of a joint" in {item.label for item in motion}
    for item in motion:
        assert item.label in shown.getvalue()
        assert item.number in shown.getvalue()
        assert of_page[item.label] == (item.number, item.place)
        assert any(row[0] == item.label and row[1] == item.number for row in rows), item
        if isinstance(item.value, float):
            assert in_json[item.label]["value"] == pytest.approx(item.value)
            assert in_json[item.label]["unit"] == item.unit


def test_the_power_of_a_joint_is_torque_times_speed(plan: sm.Plan) -> None:
    motion = plan.trajectory
    t = np.linspace(motion.t[0], motion.t[-1], 5000)
    q, qd, qdd = (motion(t, order) for order in range(3))
    power = np.abs(Dynamics(plan.robot).torques(q, qd, qdd) * qd).max(axis=0)
    (fact,) = (item for item in plan_facts(plan) if item.label == "largest power of a joint")
    assert fact.unit == "W"
    assert fact.value == pytest.approx(power.max(), rel=SAMPLED)
    assert fact.where == plan.robot.joint_names[int(power.argmax())]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (8.3e-8, "m", "0.083 µm"),
        (0.0123, "m", "12.3 mm"),
        (1.5, "m", "1.5 m"),
        (9.9e-7, "rad", "0.99 µrad"),
        (0.05, "rad", "50 mrad"),
        (np.pi / 2, "rad", "90°"),
        (0.875, "of its limit", "87.5% of its limit"),
        (3.0, "s", "3 s"),
        (0.0147, "m/s", "0.0147 m/s"),
        (12.0, "", "12"),
    ],
)
def test_numbers_are_told_in_units_that_people_read(value: float, unit: str, text: str) -> None:
    assert with_unit(value, unit) == text


def test_a_fact_in_json_is_in_si() -> None:
    found = sm.certificate.Extreme(1.2e-5, 0.5, "tool")
    (fact,) = Fact.worst("position error", found, "m", "path")
    assert (fact.number, fact.time, fact.place) == ("12 µm", "0.500 s", "tool, at 0.500 s")
    data = fact.to_dict()
    assert (data["value"], data["unit"], data["when"], data["where"]) == (1.2e-5, "m", 0.5, "tool")
    assert Fact.worst("clearance", None, "m", "near") == []
