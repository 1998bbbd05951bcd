"""Clearance at all times: what happens between two looks is bounded, decided, or said."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from conftest import PANDA_HOME, robot_named, short_line, start_of
from selfmotion.certificate import KeepsApart
from selfmotion.certificate.apart import closest_at_all_times

# Sums of a few hundred thousand steps against an exact integral, relative to its size.
SUMMED = 1e-7


@pytest.fixture(scope="module")
def circle() -> sm.Plan:
    panda = robot_named("panda")
    path = sm.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(panda, path, start=PANDA_HOME))


def test_the_way_is_what_joints_make(circle: sm.Plan) -> None:
    motion = circle.trajectory
    rng = np.random.default_rng(0)
    # Any cubics do, also such that turn round twice in an interval.
    wild = dataclasses.replace(motion, qd=5.0 * rng.normal(size=motion.qd.shape))
    for trajectory, tolerance in ((motion, SUMMED), (wild, 1e-4)):
        way, dense = trajectory.travelled, np.linspace(0.0, 4.0, 400_001)
        summed = np.cumsum(np.abs(np.diff(trajectory(dense), axis=0)), axis=0)
        for k in (1000, 123_456, 400_000):
            found = way(dense[[k]])[0]
            np.testing.assert_allclose(found, summed[k - 1], rtol=tolerance, atol=1e-7)


def test_the_distance_decides_to_the_last_digits(circle: sm.Plan) -> None:
    model = sm.CollisionModel(circle.robot)
    least = model.worst(circle.trajectory(np.linspace(0.0, 4.0, 4001))).value
    kept = closest_at_all_times(model, circle.trajectory, least - 1e-5)
    assert kept.open_until is None
    assert least - 1e-5 <= kept.closest.value <= 1.02 * least
    broken = closest_at_all_times(model, circle.trajectory, least + 1e-6)
    assert broken.closest.value < least + 1e-6


def test_grazing_is_said_to_be_undecided_or_decided(circle: sm.Plan) -> None:
    """Down to the accuracy of distances something has to be said, and never that it is kept."""
    model = sm.CollisionModel(circle.robot)
    least = model.worst(circle.trajectory(np.linspace(0.0, 4.0, 40_001))).value
    finding = KeepsApart(model, least).judge(sm.FinishedMotion(circle.robot, circle.trajectory))
    assert abs(finding.amount - least) < 1e-6
    assert finding.kept or "not decided" in finding.text or finding.amount < least


def test_a_plate_between_samples_is_found(circle: sm.Plan) -> None:
    """A coarse motion whose samples are clear of a plate that the fingers pass in between."""
    panda, t = circle.robot, np.array([0.0, 4.0])
    first = PANDA_HOME.copy()
    last = first + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    coarse = sm.Trajectory(t, np.array([first, last]), np.zeros((2, 7)), panda.joint_names)
    inside = panda.pose(coarse(2.0))
    plate = sm.Box("plate", inside.translation, [0.02, 2e-3, 0.02])
    model = sm.CollisionModel(panda, [plate])
    assert model.worst(coarse.q).value > 0.0
    finding = KeepsApart(model, 0.0).judge(sm.FinishedMotion(panda, coarse))
    assert not finding.kept
    assert "plate" in finding.subject


@pytest.mark.parametrize("name", ["panda", "xarm7", "baxter"])
def test_the_default_keeps_an_arm_apart_from_itself(name: str) -> None:
    robot = robot_named(name)
    start = start_of(robot, "pose")
    plan = sm.plan(sm.Problem(robot, short_line(robot, start), start=start))
    assert "self-collision" in plan.certificate.covers
    assert plan.certificate.clearance is not None
    without = sm.plan(dataclasses.replace(plan.problem, collision=None))
    assert "self-collision" in without.certificate.not_checked
    assert "self-collision" in without.certificate.verdict.split("not checked: ")[1]
    # Where nothing comes near, it changes nothing.
    np.testing.assert_array_equal(without.trajectory.q, plan.trajectory.q)


def test_a_motion_into_itself_is_not_verified_and_planned_anew() -> None:
    """xarm7 on a short line that the motion of least speed follows with its links in each other."""
    robot = robot_named("xarm7")
    rng = np.random.default_rng(2)
    start = rng.uniform(*robot.finite_limits())
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + rng.uniform(-0.1, 0.1, 3)
    careless = sm.plan(sm.Problem(robot, sm.Line(pose, end, 3.0), start=start, collision=None))
    model = sm.CollisionModel(robot)
    overlap = KeepsApart(model, 0.0).judge(sm.FinishedMotion(robot, careless.trajectory))
    assert not overlap.kept
    plan = sm.plan(dataclasses.replace(careless.problem, collision=sm.Clearance(distance=0.0)))
    assert plan.certificate.verified, plan.certificate.verdict
    assert model.worst(plan.trajectory.q).value >= 0.0


def test_an_arm_without_bodies_says_so(planar: sm.RobotModel) -> None:
    certificate = sm.plan(sm.sample_problem()).certificate
    assert certificate.not_checked == ("accelerations", "self-collision")


def test_pairs_left_out_are_listed() -> None:
    robot = robot_named("baxter")
    remarks = " ".join(KeepsApart(sm.CollisionModel(robot), 0.0).remarks)
    for first, second in robot.touching:
        assert first in remarks
        assert second in remarks


def srdf_without(pairs: Iterable[tuple[str, str]]) -> str:
    rows = [f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>' for a, b in pairs]
    return f"<robot name='panda'>{''.join(rows)}</robot>"


def test_pairs_that_the_srdf_leaves_out_are_listed(tmp_path: Path) -> None:
    robot = robot_named("panda")
    every = tuple(dict.fromkeys(sm.CollisionModel(robot).pairs))
    (tmp_path / "one.srdf").write_text(srdf_without(every[:1]))
    one = sm.Clearance(srdf=tmp_path / "one.srdf").requirement(robot)
    assert one.covers == ("self-collision",)
    assert f"left out as asked: {' - '.join(every[0])}" in one.remarks


def test_a_plan_keeps_the_pairs_that_its_srdf_left_out(tmp_path: Path) -> None:
    """Whatever becomes of the SRDF: a plan that is read again is judged by the same pairs."""
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    pair = sm.CollisionModel(robot).pairs[0]
    (tmp_path / "one.srdf").write_text(srdf_without([pair]))
    kept = sm.Clearance(srdf=tmp_path / "one.srdf")
    plan = sm.plan(sm.Problem(robot, short_line(robot, start), start=start, collision=kept))
    plan.save(tmp_path / "plan.npz")
    (tmp_path / "one.srdf").write_text(srdf_without(sm.CollisionModel(robot).pairs))
    again = sm.load_plan(tmp_path / "plan.npz")
    assert again.problem.collision is not None
    assert again.problem.collision.disabled == (pair,)
    assert again.certificate.remarks == plan.certificate.remarks


def test_disabled_links_come_in_pairs() -> None:
    with pytest.raises(sm.ProblemError, match=r"disabled has \('a', 'b', 'c'\), expected pairs"):
        sm.Clearance(disabled=[("a", "b", "c")])


def test_where_the_srdf_leaves_out_all_pairs_self_collision_is_not_covered(tmp_path: Path) -> None:
    robot = robot_named("panda")
    (tmp_path / "all.srdf").write_text(srdf_without(sm.CollisionModel(robot).pairs))
    start = start_of(robot, "pose")
    line = short_line(robot, start)
    own = sm.Clearance(srdf=tmp_path / "all.srdf")
    plan = sm.plan(sm.Problem(robot, line, start=start, collision=own))
    assert "self-collision" in plan.certificate.not_checked
    assert sm.Clearance(
        [sm.Sphere("ball", [2.0, 0.0, 0.0], 0.1)], srdf=tmp_path / "all.srdf"
    ).requirement(robot).covers == ("obstacles",)


def test_links_that_overlap_from_the_start_are_named_with_the_remedy() -> None:
    robot = dataclasses.replace(robot_named("pr2"), touching=())
    start = start_of(robot, "pose")
    model = sm.CollisionModel(robot)
    line = sm.Line(robot.pose(start), robot.pose(start + 1e-3), 1.0)
    motion = sm.Trajectory(
        np.array([0.0, 1.0]),
        np.array([start, start + 1e-3]),
        np.zeros((2, robot.dof)),
        robot.joint_names,
    )
    check = sm.certify(robot, line, "pose", motion, requirements=[KeepsApart(model, 0.0)])
    assert (
        '<disable_collisions link1="r_shoulder_pan_link" link2="r_upper_arm_link"' in check.verdict
    )
