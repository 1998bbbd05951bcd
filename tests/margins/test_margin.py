"""Margins: everything within them is survived, by a judge that knows Pinocchio and coal alone."""

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.collision import Separation
from selfmotion.work.margins import Displacement, least
from support.arms import PANDA_HOME, robot_named
from support.displaced import MISSED, Judge, random_displacement, worst_scale
from support.shell import complaint, invoke

# What is proved of a shift is the true one but for the share of the search, and what the judge's
# times and distances miss.
PROVED = 0.95
# Of a turn, where bodies are long.
TURNED = 0.6
LIMITS = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    """A hand with a torch, above a plate and beside a post."""
    robot = robot_named("panda")
    tip = robot.pose(PANDA_HOME).translation
    path = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.08, 2.0, normal=(1.0, 0.0, 0.0))
    bodies = [
        sm.obstacles.Box("plate", [tip[0], 0.0, tip[2] - 0.13], [0.3, 0.5, 0.02]),
        sm.obstacles.Cylinder("post", [tip[0], 0.25, tip[2]], 0.04, 0.3),
        sm.obstacles.Capsule("torch", [0.08, 0.0, 0.05], 0.01, 0.1, frame="panda_hand"),
    ]
    clear = sm.constraints.Clearance(bodies, 5e-3)
    problem = sm.Problem(robot, path, start=PANDA_HOME, constraints=LIMITS, clearance=clear)
    return sm.plan(problem).require()


@pytest.fixture(scope="module")
def margins(plan: sm.Plan) -> sm.margins.Margins:
    return sm.margin(plan)


def times(plan: sm.Plan, margins: sm.margins.Margins) -> np.ndarray:
    named = [found.time for item in margins.subjects for _, found in item.rows]
    every = [*np.linspace(0.0, plan.trajectory.duration, 30), *named]
    return np.unique([time for time in every if np.isfinite(time)])


def failures(plan: sm.Plan, margins: sm.margins.Margins, count: int) -> Iterator[tuple[str, str]]:
    """Yield what does not survive displacements on the very edge of its margin."""
    judge, rng, t = Judge(plan), np.random.default_rng(3), times(plan, margins)
    for subject in margins.subjects:
        for kind, found in subject.rows:
            for _ in range(count):
                moved = random_displacement(rng, found.position, found.rotation)
                if judge.least(judge.moved_by(subject, *moved), t) < -MISSED:
                    yield subject.name, kind


def test_all_within_a_margin_is_survived(plan: sm.Plan, margins: sm.margins.Margins) -> None:
    assert list(failures(plan, margins, 6)) == []


def test_margins_are_most_of_the_true_ones(plan: sm.Plan, margins: sm.margins.Margins) -> None:
    judge, t = Judge(plan), times(plan, margins)
    for subject in margins.subjects:
        assert 1.0 / worst_scale(judge, subject, "translation", t, 3.0) > PROVED, subject.name
    for subject in (margins.part, margins.base):
        assert 1.0 / worst_scale(judge, subject, "rotation", t, 3.0) > TURNED, subject.name


def test_the_judge_refuses_margins_that_forget_turns(
    plan: sm.Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forgetful(self: Separation, positions: np.ndarray, angles: np.ndarray) -> np.ndarray:
        return self.distance - positions - 0.1 * self.lever * angles

    monkeypatch.setattr(Separation, "least", forgetful)
    assert {kind for _, kind in failures(plan, sm.margin(plan), 6)} & {"rotation", "both"}


def test_an_interval_that_is_not_decided_proves_nothing(
    plan: sm.Plan, margins: sm.margins.Margins, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(least, "_DEPTH", 1)
    assert sm.margin(plan).part.translation.position == 0.0
    assert margins.part.translation.position > 0.0


def test_part_and_base_are_shifted_alike(plan: sm.Plan, margins: sm.margins.Margins) -> None:
    part, base = margins.part.translation, margins.base.translation
    assert part.position == base.position
    assert part.stops == base.stops
    np.testing.assert_allclose(part.direction, -np.asarray(base.direction), atol=1e-12)


def test_less_of_a_part_meets_no_sooner(plan: sm.Plan, margins: sm.margins.Margins) -> None:
    some = sm.margin(plan, part=["post"])
    assert some.part.translation.position >= margins.part.translation.position
    assert "post" in some.part.translation.stops
    left = sm.margin(plan, part=["post"], clearance=0.01)
    lost = some.part.translation.position - left.part.translation.position
    # A fiftieth of what is proved is given up, of both.
    assert lost == pytest.approx(0.01, abs=0.02 * some.part.translation.position)
    assert "10 mm from" in left.part.translation.stops


def line_plan() -> sm.Plan:
    """A straight line of 0.2 m of the planar arm."""
    robot = robot_named("planar_3r")
    start = np.array([0.4, 0.7, 0.6])
    pose = robot.pose(start)
    end = pin.SE3(pose.rotation, pose.translation + np.array([-0.2, 0.0, 0.0]))
    problem = sm.Problem(robot, sm.paths.Line(pose, end, 2.0), "planar", start, constraints=LIMITS)
    return sm.plan(problem).require()


def test_a_tolerance_is_used_up_by_its_lever() -> None:
    """A straight line of 0.2 m: its ends are 0.1 m from its middle, and nothing can be met."""
    plan = line_plan()
    found = sm.margin(plan, sm.Tolerance(1e-3, 0.5))
    missed = plan.certificate.position_error.value
    room = 1e-3 - missed
    assert found.part.translation.position == pytest.approx(room, rel=1e-12)
    # The way between the looks is added: a thousandth of the lever.
    assert found.part.rotation.rotation == pytest.approx(room / 0.1, rel=0.02)
    assert found.part.rotation.rotation <= room / 0.1
    half = found.part.both
    assert half.position + 0.1 * half.rotation <= room
    assert "1 mm off its path" in half.stops
    away = sm.margin(plan, sm.Tolerance(1e-3, 0.5), center=[0.0, 0.0, 0.0])
    ends = (plan.path.pose(t) for t in (0.0, plan.path.duration))
    far = max(np.linalg.norm(place.translation) for place in ends)
    assert away.part.rotation.rotation == pytest.approx(room / far, rel=0.02)


def test_what_misses_its_path_as_it_is_has_no_margin() -> None:
    plan = line_plan()
    found = sm.margin(plan, sm.Tolerance(0.1 * plan.certificate.position_error.value, 0.5))
    for subject in (found.part, found.base):
        for _, each in subject.rows:
            assert each.position == each.rotation == 0.0
            assert "off its path" in each.stops
    assert "margin 0: " in found.sentence


def test_what_is_mounted_on_the_base_goes_with_it() -> None:
    """A post on the base, a finger from the elbow: where the base stands does not matter."""
    robot = robot_named("panda")
    pose = robot.pose(PANDA_HOME)
    elbow = robot.joint_poses(PANDA_HOME[None])[0, 3, :3]
    post = sm.obstacles.Sphere(
        "post", elbow - np.array([0.25, 0.0, 0.0]), 0.05, frame="panda_link0"
    )
    path = sm.paths.Circle.around(pose, 0.03, 2.0, normal=(1.0, 0.0, 0.0))
    clear = sm.constraints.Clearance([post], 1e-3)
    problem = sm.Problem(robot, path, start=PANDA_HOME, constraints=LIMITS, clearance=clear)
    found = sm.margin(sm.plan(problem).require())
    assert "post" not in found.base.bodies
    assert "no contact" in found.base.translation.reason
    # It is found where it is what is displaced.
    assert "post" in found.part.translation.stops


TORCH = """<robot name="torch"><link name="tip"><collision><origin xyz="0 0 0.08"/><geometry>
<cylinder radius="0.01" length="0.1"/></geometry></collision></link></robot>"""


def test_a_tool_that_stands_in_the_world_is_what_is_displaced() -> None:
    """The hand leads the part past a torch; a post beside it is no tool."""
    home = PANDA_HOME
    pose = robot_named("panda").pose(home)
    place = pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.06]))
    cell = sm.load_robot(
        {"arm": "panda", "torch": TORCH},
        tool="torch/tip",
        reference="arm/panda_hand_tcp",
        base={"torch": place},
    )
    path = sm.paths.Circle.around(cell.pose(home), 0.02, 2.0, normal=(0.0, 0.0, 1.0))
    post = sm.obstacles.Cylinder("post", place.translation + np.array([0.2, 0.2, 0.1]), 0.03, 0.2)
    clear = sm.constraints.Clearance([post], 1e-3)
    plan = sm.plan(
        sm.Problem(cell, path, start=home, constraints=LIMITS, clearance=clear)
    ).require()
    found = sm.margin(plan)
    assert found.tool.bodies == ("torch/tip",)
    assert "'torch/tip' meets 'arm/panda_" in found.tool.translation.stops
    t = np.append(np.linspace(0.0, 2.0, 20), found.tool.translation.time)
    judge, worst = Judge(plan), found.tool.translation
    still, direction = np.zeros(3), np.asarray(worst.direction)
    for share, is_clear in ((1.0, True), (1.0 / PROVED, False)):
        moved = judge.moved_by(found.tool, share * worst.position * direction, still)
        assert (judge.least(moved, t) >= -MISSED) is is_clear


def test_paths_in_the_frame_of_the_tool_go_with_it() -> None:
    """A second hand holds on to what the first one leads: where the first is off, it misses."""
    first, second = "first/panda_hand_tcp", "second/panda_hand_tcp"
    cell = sm.load_robot(
        {"first": "panda", "second": "panda"},
        tool=(first, second),
        base={"second": pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi), np.array([0.9, 0.0, 0.0]))},
    )
    down = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.4, 0.15, 0.3]))
    circle = sm.paths.Circle.around(down, 0.05, 3.0, normal=(0.0, 1.0, 0.0))
    grasp = pin.SE3(np.eye(3), np.array([0.0, 0.35, 0.0]))
    follows = [sm.Follow(circle, tool=first), sm.Follow(grasp, tool=second, reference=first)]
    plan = sm.plan(sm.Problem(cell, follows)).require()
    allowed = sm.Tolerance(0.01, 0.5)
    turn = sm.margin(plan, allowed).tool.rotation.rotation
    _, place = cell.carrier_of(first)
    rng, worst = np.random.default_rng(0), 0.0
    for axis in rng.normal(size=(200, 3)):
        by = pin.SE3(pin.exp3(turn * axis / np.linalg.norm(axis)), np.zeros(3))
        moved = (by * place).inverse() * place * grasp
        worst = max(worst, float(np.linalg.norm(moved.translation - grasp.translation)))
    assert 0.9 * allowed.position < worst <= allowed.position


def test_what_cannot_be_asked_is_refused(plan: sm.Plan) -> None:
    for given, said in (
        ({"part": ["plat"]}, "there is no body 'plat'; nearest: 'plate'"),
        ({"part": "plate"}, "expected names"),
        ({"part": ["plate", "torch"]}, "different joints"),
        ({"part": ["torch"]}, "give center="),
        ({"tolerance": 1e-3}, "expected a Tolerance"),
        ({"clearance": -1.0}, "clearance"),
        ({"center": [0.0]}, "center"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.margin(plan, **given)
    moved = dataclasses.replace(plan.trajectory, t=plan.trajectory.t * 2.0)
    other = dataclasses.replace(plan, trajectory=moved)
    with pytest.raises(sm.errors.PlanError, match="of another motion"):
        sm.margin(other)


@pytest.mark.site
def test_of_a_program_margins_are_those_of_its_seams(plan: sm.Plan, tmp_path: Path) -> None:
    (tmp_path / "a.program").touch()
    with pytest.raises(sm.errors.FileFormatError, match="holds several plans, expected one"):
        sm.load_plan(tmp_path / "a.program")
    problem = plan.problem
    seam = sm.Seam("one", problem.path, problem.task)
    (clear,) = problem.clearances
    start = plan.trajectory.q[0]
    program = sm.plan_job(
        problem.robot, [seam], start=start, branches=1, constraints=LIMITS, clearance=clear
    )
    file = tmp_path / "a.program"
    program.save(file)
    (step,) = [step for step in program.steps if step.is_seam]
    code, told = invoke("margin", file)
    assert code == 0
    assert f"seam 'one': {sm.margin(step.made)}" in told
    assert "not judged: the moves between the seams" in told
    code, told = invoke("margin", file, "--json")
    assert json.loads(told)["seams"]["one"]["sentence"] == sm.margin(step.made).sentence
    assert "--corrected is of a single plan" in complaint("margin", file, "--corrected")


def test_margins_are_rounded_down() -> None:
    for size, text in (
        (0.00999999, "9.99 mm"),
        (0.0123456, "12.3 mm"),
        (0.9876, "987 mm"),
        (0.0, "0"),
    ):
        assert Displacement(size, 0.0, "something").size == text
    assert Displacement(0.0, np.radians(1.23999), "something").size == "1.23°"
    assert Displacement(1.0, 0.0, "").size.startswith("at least")


def test_margins_from_the_shell(plan: sm.Plan, margins: sm.margins.Margins, tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    plan.save(file)
    code, told = invoke("margin", file)
    assert code == 0
    assert told.strip() == str(margins)
    code, told = invoke("margin", file, "--tolerance", "1e-3", "--turn", "0.1", "--json")
    assert code == 0
    assert "off its path" in told
    assert "together" in complaint("margin", file, "--tolerance", "1e-3")
