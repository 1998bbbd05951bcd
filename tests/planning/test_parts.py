"""Paths in the fewest parts: how many, where, why, and moves in between that keep everything."""

import dataclasses
import itertools

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
import selfmotion.shell.testing
from selfmotion.basics import Array, NoSequenceError, ProblemError
from selfmotion.model.path import section_at_rest
from selfmotion.problem.problem import envelope_of_problem, times_along
from support.arms import robot_named

# The planar arm keeps about this shape, and its first joint turns by so much at most.
SHAPE, LEAST, MOST = (0.8, 0.5), (0.5, 0.1), (1.1, 0.9)


TURN = 6.4


SPEED, ACCELERATION, JERK = 3.0, 10.0, 1e3


# Of what one sample hands over to the next: positions, velocities and accelerations at rest.
RESTING = 1e-6


def wound(angle: float, *more: sm.constraints.Constraint, start: Array | None = None) -> sm.Problem:
    """Return the problem of the planar arm on a circle about its base, of any angle [rad].

    With the arm in one shape, its first joint draws all that it turns by: so TURN of the path can
    be followed at once, and the next TURN again from a whole turn further back.
    """
    robot = robot_named("planar_3r")
    lower, upper = np.array([-0.5 * TURN, *LEAST]), np.array([0.5 * TURN, *MOST])
    first = robot.pose(np.array([-0.5 * TURN, *SHAPE])).translation
    angles = np.linspace(0.0, angle, int(10 * angle) + 2)
    turned = np.stack([pin.exp3(np.array([0.0, 0.0, a])) @ first for a in angles])
    constraints = [
        sm.constraints.JointPositionLimits(lower, upper),
        sm.constraints.JointVelocityLimits(SPEED),
        sm.constraints.JointAccelerationLimits(ACCELERATION),
        sm.constraints.JointJerkLimits(JERK),
        *more,
    ]
    path = sm.paths.Waypoints(2.0 * angles, turned)
    return sm.Problem(robot, path, "planar", start, constraints=constraints)


def fewest(angle: float) -> int:
    """Return how many parts a wound path needs at least.

    The tool's direction is q1 + ψ(q2, q3): one part follows no more of it than q1 and ψ turn by.
    """
    robot = robot_named("planar_3r")
    radius = float(np.linalg.norm(robot.pose(np.array([0.0, *SHAPE])).translation))
    shapes = itertools.product(*(np.linspace(*ends, 200) for ends in zip(LEAST, MOST, strict=True)))
    tips = [robot.pose(np.array([0.0, *shape])).translation for shape in shapes]
    near = [np.arctan2(p[1], p[0]) for p in tips if abs(np.linalg.norm(p) - radius) < 0.02]
    return int(np.ceil(angle / (TURN + float(np.ptp(near)))))


def faults(parts: sm.Parts) -> list[str]:
    """Return what is wrong with parts and moves as one motion, from its samples and poses alone."""
    whole, problem, found = parts.trajectory, parts.problem, []
    t = np.linspace(0.0, whole.duration, 5000)
    for order, limit in ((1, SPEED), (2, ACCELERATION)):
        if np.abs(whole(t, order)).max() > limit * (1.0 + 1e-9):
            found.append(f"limit of order {order}")
    lower, upper = (
        (limits := envelope_of_problem(problem)).lower,
        limits.upper,
    )
    if np.any(whole(t) < lower - 1e-9) or np.any(whole(t) > upper + 1e-9):
        found.append("position limits")
    stops = [0.0, *parts.cuts, problem.path.duration]
    for plan, ends in zip(parts.plans, itertools.pairwise(stops), strict=True):
        q = plan.trajectory.q
        for configuration, time in zip((q[0], q[-1]), ends, strict=True):
            miss = problem.task.miss(problem.path.pose(time), problem.robot.pose(configuration))
            if max(miss) > 1e-6:
                found.append(f"a part is not at its end of the path at t = {time:.3f} s")
    for move, (before, after) in zip(parts.moves, itertools.pairwise(parts.plans), strict=True):
        ends = move.trajectory.q[[0, -1]] - [before.trajectory.q[-1], after.trajectory.q[0]]
        if np.abs(ends).max() > 0.0:
            found.append("a move does not lead from part to part")
        for motion in (before.trajectory, after.trajectory, move.trajectory):
            at = [motion.t[-1], motion.t[0]] if motion is not move.trajectory else motion.t[[0, -1]]
            cut = at[:1] if motion is before.trajectory else at[1:]
            if np.abs(motion(np.array(cut), 1)).max() > RESTING:
                found.append("it does not rest at a cut")
    return found


def test_a_path_that_needs_two_changes_is_found_with_two() -> None:
    angle = 2.9 * TURN
    assert fewest(angle) == 3
    parts = sm.plan_in_parts(wound(angle)).require()
    assert len(parts.plans) == 3
    assert all(plan.certificate.verified for plan in parts.plans)
    assert len(parts.moves) == len(parts.cuts) == 2
    assert not faults(parts)
    for cut, ending in zip(parts.cuts, parts.endings, strict=True):
        assert 0.0 < cut < parts.problem.path.duration
        assert "joint1" in ending
    # Each begins where the motion of all of them says so.
    for plan, begins in zip(parts.plans, parts.begins, strict=True):
        np.testing.assert_allclose(parts.trajectory(begins), plan.trajectory.q[0], atol=1e-12)
    broken = sm.Parts(parts.problem, parts.plans[:2], parts.moves[:1], parts.cuts[:1])
    assert "a part is not at its end of the path at t = " in "".join(faults(broken))
    swapped = sm.Parts(parts.problem, parts.plans, parts.moves[::-1], parts.cuts)
    assert "a move does not lead from part to part" in faults(swapped)
    # The verdict says so as well, each by its name.
    loose = dataclasses.replace(parts, tolerance=sm.Tolerance(1e-12, 1e-12), endings=parts.endings)
    for wrong, said in (
        (broken, "part 2: it is not the path from"),
        (swapped, "would jump by"),
        (dataclasses.replace(parts, moves=parts.moves[:1]), "3 parts have 1 moves in between"),
        (dataclasses.replace(parts, moves=()), "3 parts have 0 moves in between"),
        (dataclasses.replace(parts, plans=parts.plans[::-1]), "it is not the path from 0 to"),
        (dataclasses.replace(parts, cuts=(parts.cuts[0], parts.cuts[1] + 1e-3)), "the path from"),
        (
            dataclasses.replace(
                parts, problem=wound(2.9 * TURN, sm.constraints.ToolLimits(speed=9.0))
            ),
            "Tool",
        ),
        (loose, "it is judged within 1e-06 m"),
    ):
        assert not wrong.verified
        assert said in wrong.verdict
    assert "rad off the path" in parts.verdict


def test_a_path_that_needs_no_change_is_one_plan() -> None:
    whole = sm.plan_in_parts(wound(0.5 * TURN)).require()
    assert len(whole.plans) == fewest(0.5 * TURN) == 1
    assert (whole.moves, whole.cuts, whole.endings) == ((), (), ())
    assert whole.begins == (0.0,)
    # One part is the plan itself.
    assert whole.plans[0].problem.path is whole.problem.path


def test_what_is_asked_of_the_ends_is_asked_of_the_first_and_the_last_part() -> None:
    start = np.array([-0.4 * TURN, *SHAPE])
    end = np.array([-0.5 * TURN + 1.9 * TURN - 2.0 * np.pi, *SHAPE])
    problem = wound(1.9 * TURN, sm.constraints.EndConfiguration(end))
    reached = problem.robot.inverse_kinematics(problem.path.pose(0.0), "planar", start)
    pinned = sm.Problem(
        problem.robot, problem.path, "planar", reached, constraints=problem.constraints
    )
    parts = sm.plan_in_parts(pinned).require()
    assert len(parts.plans) == fewest(1.9 * TURN) == 2
    assert not faults(parts)
    np.testing.assert_allclose(parts.plans[0].trajectory.q[0], reached, atol=1e-12)
    np.testing.assert_allclose(parts.plans[-1].trajectory.q[-1], end, atol=1e-6)


def test_a_closed_path_in_parts_is_closed_by_a_last_move() -> None:
    problem = wound(4.0 * np.pi, sm.constraints.ClosedPath())
    parts = sm.plan_in_parts(problem).require()
    assert len(parts.moves) == len(parts.plans) == fewest(4.0 * np.pi)
    whole = parts.trajectory
    np.testing.assert_allclose(whole.q[-1], whole.q[0], atol=1e-12)
    assert max(np.abs(whole.qd[[0, -1]]).max(), 0.0) < RESTING


def test_what_no_part_follows_is_refused_with_time_and_reason() -> None:
    problem = wound(1.9 * TURN)
    robot = problem.robot
    far = np.linspace(4.0, 6.0, 9)
    out = sm.paths.Waypoints(np.linspace(0.0, 4.0, 9), np.stack([far, 0 * far, 0 * far], axis=1))
    with pytest.raises(NoSequenceError, match="in however many parts, passes t = ") as error:
        sm.plan_in_parts(sm.Problem(robot, out, "planar"))
    assert 1.5 < error.value.time < 2.5
    # A single pose in the middle that limits forbid.
    gap = wound(
        2.0, sm.constraints.JointPositionLimits([-0.5 * TURN, -7, -7], [-0.5 * TURN + 0.7, 7, 7])
    )
    with pytest.raises(NoSequenceError, match="joint limits"):
        sm.plan_in_parts(gap)


def test_a_given_start_that_may_not_be_is_named() -> None:
    problem = wound(1.9 * TURN)
    elsewhere = problem.robot.inverse_kinematics(
        problem.path.pose(0.0), "planar", np.array([2.9, -1.0, -1.0])
    )
    beyond = dataclasses.replace(problem, start=elsewhere)
    with pytest.raises(NoSequenceError, match=r"t = 0 s: the given start has joint 'joint\d' at "):
        sm.plan_in_parts(beyond)


def test_what_is_relaxed_for_a_while_is_so_in_each_part() -> None:
    problem = wound(1.9 * TURN)
    relaxed = [sm.Relaxation("x", 1e-2, during=(11.0, 15.0)), sm.Relaxation("y", 1e-2)]
    problem = dataclasses.replace(problem, relaxations=relaxed)
    windows = []
    for ends, ramped in (((0.0, 12.0), (False, True)), ((12.0, 20.0), (True, False))):
        path = section_at_rest(problem.path, *ends, 0.5, ramped)
        during, always = (item.moved(times_along(path, ends)) for item in relaxed)
        assert always == relaxed[1]
        windows.append(during.during)
        if ends[0] == 0.0:
            assert windows[0] == (11.0, path.duration)
    # Half a ramp later than without one.
    assert windows[1] == (0.0, pytest.approx(3.0 + 0.25))
    late = section_at_rest(problem.path, 16.0, 20.0, 0.5, (True, False))
    assert relaxed[0].moved(times_along(late, (16.0, 20.0))) is None


def test_what_parts_cannot_be_is_refused() -> None:
    problem = wound(2.0)
    robot, path = problem.robot, problem.path
    damped = sm.Problem(robot, path, "planar", damping=sm.Damping())
    with pytest.raises(ProblemError, match="leave the damping out"):
        sm.plan_in_parts(damped)
    ur5 = robot_named("ur5")
    pose = ur5.pose(ur5.dexterous_configuration("pose"))
    line = sm.paths.Line(pose, pose * pin.SE3(np.eye(3), np.full(3, 0.02)), 2.0)
    relaxed = sm.Problem(ur5, line, "pose", relaxations=[sm.Relaxation("rz", 0.2)])
    with pytest.raises(ProblemError, match="leaves no self-motion to search"):
        sm.plan_in_parts(relaxed)
    for options, words in (
        ({"retreat": -1.0}, "retreat"),
        ({"axis": (0, 0, 0)}, "axis is zero"),
        ({"ramp": 0.0}, "ramp"),
        ({"rng": "x"}, "rng"),
    ):
        with pytest.raises(ProblemError, match=words):
            sm.plan_in_parts(problem, **options)
    with pytest.raises(ProblemError, match="expected a Problem"):
        sm.plan_in_parts(path)  # type: ignore[arg-type]
