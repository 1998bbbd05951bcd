"""Redundancy maps: each pixel is what it says, by other code, which refuses what is broken."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.errors import FileFormatError, ProblemError
from selfmotion.model.robot import SwivelAngle
from selfmotion.problem.constraints import NO_OVERLAP
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.result import Reason, RedundancyMap
from support.arms import PANDA_HOME, robot_named, short_line, start_of
from support.redundancy_laws import faults
from support.redundancy_oracle import Bodies, Coordinate, Oracle, differs

# Pixels of the maps here: enough to have every border of regions, and few enough to solve them all
# by linear programmes and distances.
FEW = (13, 31)
ARMS = [
    ("planar_3r", "planar"),
    ("panda", "pose"),
    ("panda", "pointing"),
    ("xarm7", "pose"),
    ("baxter", "pose"),
    ("tiago", "pose"),
    ("ur5", "pointing"),
    ("kinova", "pointing"),
]
COORDINATES = {
    ("planar_3r", "planar"): "joint",
    ("panda", "pose"): "elbow",
    ("panda", "pointing"): "tool",
    ("xarm7", "pose"): "elbow",
    ("baxter", "pose"): "elbow",
    ("tiago", "pose"): "joint",
    ("ur5", "pointing"): "tool",
    ("kinova", "pointing"): "tool",
}
POST = sm.obstacles.Box("post", [0.1, 0.38, 0.5], [0.06, 0.06, 1.0])


@cache
def plan_of(name: str, task: str) -> sm.Plan:
    robot = robot_named(name)
    start = start_of(robot, task)
    return sm.plan(sm.Problem(robot, short_line(robot, start), task, start))


@cache
def circle(*, post: bool = False, clearance: float = 0.0) -> sm.Plan:
    """Panda's circle, beside a post or alone."""
    robot = robot_named("panda")
    path = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 4.0)
    apart = sm.constraints.Clearance([POST], clearance) if post else NO_OVERLAP
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    problem = sm.Problem(robot, path, "pose", PANDA_HOME, constraints=limits, clearance=apart)
    return sm.plan(problem)


def bodies_of(plan: sm.Plan) -> Bodies:
    model, _ = envelope_of_problem(plan.problem).bodies[0]
    return Bodies(plan.robot, model.obstacles, model.pairs)


@pytest.mark.parametrize(("name", "task"), ARMS)
def test_every_pixel_is_what_it_says(name, task):
    plan = plan_of(name, task)
    shown = plan.redundancy_map(shape=FEW)
    assert shown.q.shape == (*FEW, plan.robot.dof)
    assert Coordinate.of(shown).kind == COORDINATES[name, task]
    assert faults(plan, shown) == []
    assert shown.allowed.any()


@pytest.mark.parametrize("clearance", [0.0, 0.02])
def test_bodies_that_stop_the_arm_are_near(clearance):
    plan = circle(post=True, clearance=clearance)
    shown = plan.redundancy_map(shape=FEW)
    assert {Reason.OBSTACLE, Reason.LIMIT, Reason.ALLOWED} <= set(shown.state.ravel())
    assert any("post" in cause for cause in shown.causes)
    assert faults(plan, shown, bodies_of(plan)) == []


def test_a_pace_that_is_too_fast_for_any_self_motion_is_a_reason():
    plan = circle()
    slow = sm.constraints.JointVelocityLimits(0.35 * plan.robot.velocity_limit)
    problem = plan.problem.changed(constraints=[sm.constraints.JointPositionLimits(), slow])
    # The motion itself is not planned again: only what its pixels are judged by is another.
    other = replace(plan, problem=problem)
    shown = other.redundancy_map(shape=(25, 31))
    assert (shown.state == Reason.SPEED).any()
    assert any("too fast" in cause for cause in shown.causes)
    assert faults(other, shown) == []


def test_near_singular_poses_are_a_reason():
    plan = plan_of("planar_3r", "planar")
    line = plan.path
    # To the edge of the reach, where all links are in one line.
    end = line.pose(0.0)
    end.translation = end.translation / np.linalg.norm(end.translation) * 0.9995 * plan.robot.reach
    out = sm.paths.Line(line.pose(0.0), end, 2.0)
    limits = [sm.constraints.JointPositionLimits()]
    far = sm.plan(plan.problem.changed(path=out, start=None, constraints=limits))
    shown = far.redundancy_map(shape=(40, 61))
    assert (shown.state == Reason.SINGULAR).any()
    assert "singular" in " ".join(shown.causes)


BROKEN = {
    "configurations": lambda m: {"q": m.q + 1e-6},
    "coordinates": lambda m: {"coordinate": m.coordinate + 1e-4},
    "limits": lambda m: {"state": np.where(m.state == Reason.LIMIT, Reason.ALLOWED, m.state)},
    "bodies": lambda m: {"state": np.where(m.state == Reason.OBSTACLE, Reason.ALLOWED, m.state)},
    "clear": lambda m: {"state": np.where(m.allowed, Reason.ITSELF, m.state)},
    "speeds": lambda m: {"state": np.where(m.allowed, Reason.SPEED, m.state)},
    "singular": lambda m: {"state": np.where(m.allowed, Reason.SINGULAR, m.state)},
    "nothing": lambda m: {"state": np.where(m.allowed, Reason.NO_CONFIGURATION, m.state)},
    "line": lambda m: {"plan_line": m.plan_line + 1.5},
}


@pytest.mark.parametrize("broken", BROKEN)
def test_the_laws_refuse_broken_maps(broken):
    plan = circle(post=True)
    shown = plan.redundancy_map(shape=FEW)
    other = replace(shown, **BROKEN[broken](shown))
    assert faults(plan, other, bodies_of(plan)) != []


def planar_branch(plan: sm.Plan, shown: RedundancyMap, i: int) -> np.ndarray:
    """Return q1, q2 of the planar arm for each value of q3, by the law of cosines, (M, 3).

    With q3 given the last two links are one link; of the two solutions the one on the plan's side.
    """
    robot, q3 = plan.robot, shown.coordinate
    place = robot.model.jointPlacements
    l1, l2 = (np.linalg.norm(place[k].translation) for k in (2, 3))
    l3 = np.linalg.norm(robot.pose(np.zeros(3)).translation - np.array([l1 + l2, 0.0, 0.0]))
    x, y = plan.path.pose(float(shown.times[i])).translation[:2]
    length = np.sqrt(l2**2 + l3**2 + 2.0 * l2 * l3 * np.cos(q3))
    turn = np.arctan2(l3 * np.sin(q3), l2 + l3 * np.cos(q3))
    cosine = (x**2 + y**2 - l1**2 - length**2) / (2.0 * l1 * length)
    own = plan.trajectory(shown.times[i : i + 1])[0]
    side = np.sign(np.sin(own[1] + np.arctan2(l3 * np.sin(own[2]), l2 + l3 * np.cos(own[2]))))
    with np.errstate(invalid="ignore"):
        bend = side * np.arccos(cosine)
    q1 = np.arctan2(y, x) - np.arctan2(length * np.sin(bend), l1 + length * np.cos(bend))
    return np.stack([q1, bend - turn, q3], axis=1)


def test_the_planar_arm_is_as_the_law_of_cosines_has_it():
    plan = plan_of("planar_3r", "planar")
    shown = plan.redundancy_map("joint3", shape=(25, 121))
    for i in range(25):
        expected = planar_branch(plan, shown, i)
        there = ~np.isnan(expected).any(axis=1)
        # The plan's branch ends where that with the other bend begins: a run around the plan.
        begin = int(np.argmin(np.abs(shown.coordinate - shown.plan_line[i])))
        first = begin - int(np.argmin(there[begin::-1])) if not there[:begin].all() else -1
        last = begin + int(np.argmin(there[begin:])) if not there[begin:].all() else len(there)
        inside = np.zeros(len(there), dtype=bool)
        inside[first + 1 : last] = True
        known = ~np.isnan(shown.q[i]).any(axis=1)
        np.testing.assert_array_equal(known, inside)
        off = shown.q[i, known] - expected[known]
        assert np.abs((off + np.pi) % (2.0 * np.pi) - np.pi).max() < 1e-6


@pytest.mark.site
def test_a_panda_is_as_brute_force_has_it():
    plan = circle(post=True)
    shown = plan.redundancy_map(shape=(21, 61))
    model, required = envelope_of_problem(plan.problem).bodies[0]
    own = plan.trajectory(shown.times)
    oracle = Oracle(plan.problem, shown, own, model.obstacles, model.pairs, required)
    columns = [4, 13]
    found, _ = oracle.states(columns)
    assert not differs(shown.state[columns], found).any()
    # The brute force sees what is shifted by a pixel.
    broken = differs(np.roll(shown.state, 1, axis=1)[columns], found)
    assert broken.mean() > 0.005


def test_a_branch_that_is_not_the_plans_is_told_from_it():
    """The minimum-norm motion of another start is no part of the map."""
    plan = circle()
    shown = plan.redundancy_map(shape=FEW)
    step = np.diff(shown.q, axis=1)
    far = np.linalg.norm(step, axis=2)
    # From pixel to pixel of 12° joints go on: they do not jump to the arm's other configurations,
    # which are turns of more than two joints by some π away.
    assert np.nanmax(far) < np.pi


def test_a_slice_moves_joints_no_more_than_it_has_to():
    plan = plan_of("panda", "pointing")
    shown = plan.redundancy_map("panda_joint7", shape=FEW)
    assert shown.redundancy == 2
    for i, j in [(2, 10), (6, 15), (9, 20)]:
        step = shown.q[i, j + 1] - shown.q[i, j]
        middle = 0.5 * (shown.q[i, j + 1] + shown.q[i, j])
        rows = np.vstack([plan.problem.follows.jacobian(middle), np.eye(7)[6]])
        aside = step - np.linalg.pinv(rows) @ (rows @ step)
        # What moves neither the tool nor the joint; second order in a step of 11°.
        assert np.linalg.norm(aside) < 0.02 * np.linalg.norm(step)
        assert np.linalg.norm(step) > 0.1


def test_costs_are_those_of_no_self_motion():
    plan = circle()
    shown = plan.redundancy_map(shape=FEW)
    for i, j in [(3, 10), (6, 20), (9, 15)]:
        follows = plan.problem.follows
        rows = follows.jacobian(shown.q[i, j])
        rates = np.linalg.pinv(rows) @ follows.twists(shown.times[i : i + 1])[0]
        assert shown.cost[i, j] == pytest.approx(0.5 * rates @ rates, rel=1e-6)
    assert np.isnan(shown.cost[shown.state == Reason.NO_CONFIGURATION]).all()


def test_lines_are_those_of_the_motions():
    plan = circle()
    shown = plan.redundancy_map()
    # The arm's home has its elbow upwards.
    assert shown.plan_line[0] == pytest.approx(0.0, abs=1e-6)
    assert shown.minimum_norm_line[0] == pytest.approx(0.0, abs=1e-6)
    values, _ = SwivelAngle()(plan.robot, plan.trajectory(shown.times))
    np.testing.assert_allclose(np.unwrap(values), shown.plan_line, atol=1e-9)
    assert np.abs(np.diff(shown.plan_line)).max() < 1.0


def test_a_rail_is_the_coordinate(tmp_path):
    file = tmp_path / "rail.urdf"
    file.write_text(
        """<robot name="rail"><link name="rail"/><link name="carriage"/>
        <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/>
        <axis xyz="0 1 0"/><limit lower="-0.8" upper="0.8" velocity="0.5" effort="2000"/></joint>
        </robot>"""
    )
    cell = sm.load_robot(
        {"rail": file, "arm": "ur5"}, on={"arm": "rail/carriage"}, tool="arm/tool0"
    )
    begin = np.concatenate([[0.1], robot_named("ur5").dexterous_configuration("pose")])
    plan = sm.plan(sm.Problem(cell, short_line(cell, begin), "pose", begin))
    shown = plan.redundancy_map(shape=FEW)
    assert (shown.label, shown.unit) == ("joint 'rail/slide'", "m")
    assert shown.coordinate[0] < -0.8 < 0.8 < shown.coordinate[-1]
    assert faults(plan, shown) == []


def test_a_tolerance_is_a_coordinate():
    robot = robot_named("ur5")
    start = start_of(robot, "pose")
    band = sm.Relaxation(("rz",), 0.3)
    problem = sm.Problem(robot, short_line(robot, start), "pose", start, relaxations=[band])
    plan = sm.plan(problem)
    shown = plan.redundancy_map(shape=FEW)
    assert shown.label == "deviation rz"
    assert (shown.redundancy, shown.q.shape[2]) == (1, 6)
    assert set(shown.plan_state) == {Reason.ALLOWED}
    # Beyond the band is beyond a limit.
    outside = np.abs(shown.coordinate) > 0.3
    assert (shown.state[:, outside] != Reason.ALLOWED).all()
    for i, j in np.argwhere(shown.allowed):
        pose, tool = plan.path.pose(float(shown.times[i])), robot.pose(shown.q[i, j])
        assert np.linalg.norm(pose.translation - tool.translation) < 1e-9


def test_a_coordinate_is_chosen_by_name():
    plan = circle()
    shown = plan.redundancy_map("panda_joint7", shape=FEW)
    assert shown.label == "joint 'panda_joint7'"
    assert faults(plan, shown) == []
    with pytest.raises(ProblemError, match="no coordinate 'panda_joint9'"):
        plan.redundancy_map("panda_joint9")
    with pytest.raises(ProblemError, match="coordinate is 3, expected a joint"):
        plan.redundancy_map(3)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="does not leave free"):
        plan.redundancy_map("tool")
    with pytest.raises(ProblemError, match="seven revolute joints"):
        plan_of("ur5", "pointing").redundancy_map("elbow")
    with pytest.raises(ProblemError, match="two numbers of pixels"):
        plan.redundancy_map(shape=7)  # type: ignore[arg-type]


def test_arrays_are_read_only_and_come_back_from_files(tmp_path):
    shown = circle(post=True).redundancy_map(shape=FEW)
    read = RedundancyMap.load(shown.save(tmp_path / "map.npz"))
    for name in ("times", "coordinate", "state", "cause", "cost", "q", "plan_line", "plan_state"):
        np.testing.assert_array_equal(getattr(read, name), getattr(shown, name))
        with pytest.raises(ValueError, match="read-only"):
            getattr(shown, name)[0] = 0
    assert (read.causes, read.label, read.unit) == (shown.causes, shown.label, shown.unit)
    assert repr(read) == repr(shown)
    assert "swivel angle over time" in repr(read)
    other = tmp_path / "other.npz"
    np.savez(other, times=np.zeros(3))
    with pytest.raises(FileFormatError):
        RedundancyMap.load(other)


def test_a_picture_is_drawn(tmp_path):
    shown = circle(post=True).redundancy_map(shape=FEW)
    file = shown.save_png(tmp_path / "map.png")
    assert file.read_bytes().startswith(b"\x89PNG")
    axes = shown.figure().axes[0]
    assert axes.get_ylabel() == "swivel angle [°]"
    assert len(axes.lines) == 2


def with_active(plan, *active):
    return replace(plan, report=replace(plan.report, active=tuple(active)))


def active(easing, saving=1.0):
    name = "asked"
    return sm.constraints.ActiveConstraint(name, easing, saving, ((0.0, 10.0),))


def test_slices_are_first_along_what_keeps_the_plan_from_a_lower_cost():
    """By multipliers: a joint that is at its limit, then what moves two bodies apart."""
    plan = plan_of("panda", "pointing")
    assert plan.redundancy_coordinates()[0] == "tool"
    assert plan.redundancy_map(shape=(3, 3)).label == "rotation of the tool about its axis"
    at_limits = with_active(
        plan,
        active("0.01 rad more at the upper limit of joint 'panda_joint4'", 1.0),
        active("2 % more speed for joint 'panda_joint2'", 3.0),
    )
    names = at_limits.redundancy_coordinates()
    assert names[:3] == ("panda_joint2", "panda_joint4", "tool")
    assert set(names) == {"tool", *plan.robot.joint_names}
    assert at_limits.redundancy_map(shape=(3, 3)).label == "joint 'panda_joint2'"
    near = with_active(plan, active("1 mm less between 'panda_link0' and 'panda_hand'"))
    assert near.redundancy_coordinates()[0] in plan.robot.joint_names


def test_one_degree_of_redundancy_has_one_coordinate():
    assert circle().redundancy_coordinates() == ("elbow",)


def test_a_map_may_be_left_between_its_times():
    class Enough(Exception):
        pass

    told = []

    def leave(stage, number, count):
        told.append((stage, number, count))
        raise Enough

    with pytest.raises(Enough):
        circle().redundancy_map(shape=(121, 121), progress=leave)
    ((stage, number, count),) = told
    assert (stage, count) == ("redundancy map", 121)
    assert 0 < number < count
