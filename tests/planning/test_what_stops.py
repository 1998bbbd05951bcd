"""A 'no' begins with what stops the motion, and when; not with what the best of bad ones breaks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from support.arms import robot_named

# A search that ends soon: what is said afterwards counts here.
QUICK = sm.Search(mode="local", starts=4, finalists=1)
# Distances that a search and a certificate find differ by this at most [m].
ROUNDED = 1e-4
# Configurations that are drawn at the pose that nothing passes.
DRAWN = 60


def past_a_plate(size: tuple[float, float, float], up: float, *, free: bool = False) -> sm.Problem:
    """A UR10 draws a line behind a plate that its forearm would have to be in."""
    ur10 = robot_named("ur10")
    home = ur10.dexterous_configuration("pointing")
    begin, way = ur10.pose(home), np.array([-0.3, -0.9, 0.0])
    end = SE3(begin.rotation, begin.translation + way)
    center = 0.55 * (begin.translation + 0.48 * way) + np.array([0.0, 0.0, up])
    plate = sm.obstacles.Box("plate", center, np.array(size))
    limits = sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()
    return sm.Problem(
        ur10,
        sm.paths.Line(begin, end, 4.0),
        "pointing",
        None if free else home,
        constraints=limits,
        clearance=sm.constraints.Clearance([plate], 0.01),
    )


def test_a_verdict_begins_with_what_stops_the_motion(tmp_path: Path) -> None:
    problem = past_a_plate((0.3, 0.02, 2.0), 0.2)
    plan = sm.plan(problem)
    said = "not verified: no motion along the path passes t = "
    verdict = plan.certificate.verdict
    assert verdict.startswith(said)
    assert "'forearm_link' and 'plate' overlap by" in verdict
    assert plan.report.attempts[-1].name == "what stops it"
    # Of configurations that are drawn at that time none keeps away from the plate.
    when = float(verdict.removeprefix(said).split(" s: ")[0])
    robot, rng, clearance = problem.robot, np.random.default_rng(5), problem.clearances[0]
    model, looked_at = clearance.model(robot), 0
    for _ in range(DRAWN):
        seed = rng.uniform(-3.0, 3.0, robot.dof)
        try:
            q = robot.inverse_kinematics(problem.path.pose(when), "pointing", seed=seed)
        except sm.errors.InverseKinematicsError:
            continue
        looked_at += 1
        assert model.distance(q).value < clearance.distance + ROUNDED
    assert looked_at > DRAWN // 4
    # Who reads the plan again is told as much; another motion is another matter.
    plan.save(tmp_path / "plan.npz")
    read = sm.load_plan(tmp_path / "plan.npz")
    assert read.certificate.verdict == verdict
    t = np.linspace(0.0, read.trajectory.duration, 9)
    coarse = sm.Trajectory(t, read.trajectory(t), read.trajectory(t, 1), problem.robot.joint_names)
    assert not replace(read, trajectory=coarse).check().verdict.startswith(said)


def test_where_each_pose_is_in_reach_another_start_is_proposed() -> None:
    """With this plate a motion is there from elsewhere, as a search shows."""
    given = sm.plan(past_a_plate((0.1, 0.02, 0.5), 0.0))
    assert not given.certificate.verified
    assert "another start may do (start=None)" in given.certificate.verdict
    assert "no motion along the path passes" not in given.certificate.verdict
    free = past_a_plate((0.1, 0.02, 0.5), 0.0, free=True)
    assert sm.plan(free, search=QUICK).certificate.verified


@pytest.mark.parametrize("search", [None, QUICK, sm.Search(starts=32, finalists=5)])
def test_a_motion_whose_hulls_alone_meet_a_body_is_found(search: sm.Search | None) -> None:
    """However many starts there are: turns of the tool about its free axis make no other motion.

    Of four postures one passes the plate, by its meshes and not by their hulls, and costs most.
    """
    given = {} if search is None else {"search": search}
    plan = sm.plan(past_a_plate((0.1, 0.02, 0.5), 0.0, free=True), **given)
    assert plan.certificate.verified
