"""Limits of joints are kept between samples, or named where they cannot be."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import FinishedMotion, JointLimits
from selfmotion.model.robot import Dynamics
from selfmotion.shell import testing
from support.arms import PANDA_HOME, robot_named, short_line
from support.circles import upright_circle
from support.files_of_people import arm, finger
from support.places import ROOT

Circle = Callable[..., sm.Problem]
# The same iterate by Newton's method with rows that do not count and without them [rad/s].
ROUNDING = 1e-9


def certify_again(plan: sm.Plan, requirements: list[sm.certificate.Requirement]) -> sm.Certificate:
    """Return a plan's certificate with other requirements."""
    return sm.certify(plan.robot, plan.path, plan.task, plan.trajectory, requirements=requirements)


def test_velocity_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    limit = 0.55 * robot.velocity_limit
    without = sm.plan(panda_circle())
    assert (np.abs(without.trajectory.qd) / limit).max() > 1.0
    constraints = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(limit))
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert (np.abs(plan.trajectory(t, 1)) / limit).max() <= 1.0
    assert plan.certificate.velocity_ratio.value > 0.9


def test_position_limits_are_kept_between_samples(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    upper = np.array(free.robot.upper)
    upper[1] = free.trajectory.q[:, 1].max() - 0.05
    constraints = (
        sm.constraints.JointPositionLimits(upper=upper),
        sm.constraints.JointVelocityLimits(),
    )
    plan = sm.plan(panda_circle(constraints=constraints))
    assert plan.certificate.verified
    t = np.linspace(0, plan.trajectory.duration, 5001)
    assert plan.trajectory(t)[:, 1].max() <= upper[1]


def test_unreachable_limits_are_named(panda_circle: Circle) -> None:
    robot = panda_circle().robot
    constraints = [sm.constraints.JointVelocityLimits(0.1 * robot.velocity_limit)]
    plan = sm.plan(panda_circle(constraints=constraints))
    assert not plan.certificate.verified
    assert "velocity limits: speed of joint 'panda_joint" in plan.report.message
    assert "times its limit" in plan.certificate.verdict
    with pytest.raises(sm.errors.PlanError):
        plan.require()


def test_a_limit_on_one_side_is_kept(panda_circle: Circle) -> None:
    free = sm.plan(panda_circle())
    joint = int(np.argmax(np.ptp(free.trajectory.q, axis=0)))
    lower, upper = np.full(7, -np.inf), np.full(7, np.inf)
    upper[joint] = free.trajectory.q[:, joint].max() - 0.02
    kept = sm.plan(
        panda_circle("position", constraints=[sm.constraints.JointPositionLimits(lower, upper)])
    )
    assert kept.certificate.verified, kept.certificate.verdict
    assert kept.trajectory.q[:, joint].max() < upper[joint]


def test_accelerations_are_judged_at_their_extremes(panda_circle: Circle) -> None:
    """Where a cubic begins or ends, also at t = 0 and T."""
    plan = sm.plan(panda_circle())
    times = np.linspace(0.0, 4.0, 100_001)
    extreme = np.abs(plan.trajectory(times, order=2)).max()
    found = np.abs(plan.trajectory.extremes(2)[1]).max()
    assert extreme <= found * (1.0 + 1e-9)
    assert found <= extreme * 1.01
    check = certify_again(
        plan, [JointLimits(2, np.full(7, -0.999 * found), np.full(7, 0.999 * found))]
    )
    assert "accelerates at 1.001 times its limit" in check.verdict


def test_limits_that_do_not_bind_cost_no_evaluation(panda_circle: Circle) -> None:
    """The same method then, point by point."""
    without, within = sm.plan(panda_circle(constraints=())), sm.plan(panda_circle())
    assert without.report.evaluations == within.report.evaluations
    for first, second in zip(without.report.history, within.report.history, strict=True):
        np.testing.assert_allclose(second.x, first.x, rtol=0, atol=ROUNDING)


def test_limits_that_nobody_knows_are_told_of() -> None:
    """A constraint that has nothing to ask of an arm is not passed over in silence."""
    robot = robot_named("ur10")
    start = robot.dexterous_configuration("pointing")
    asked = sm.constraints.JointAccelerationLimits()
    problem = sm.Problem(robot, short_line(robot, start), "pointing", start, constraints=[asked])
    told = [text for text in problem.remarks if "none are known" in text]
    assert told == [
        "joint acceleration limits: none are known of ur10, so none are kept; "
        'give --acceleration, or in the file [[constraints]] kind = "JointAccelerationLimits", '
        "limit = …, in Python JointAccelerationLimits(…)"
    ]
    for quiet in ({"constraints": [sm.constraints.JointAccelerationLimits(5.0)]}, {}):
        usual = sm.Problem(robot, problem.path, "pointing", start, **quiet)
        assert not any("none are known" in text for text in usual.remarks)


# Joint torques: kept, judged and refused.


def test_the_constraint_keeps_the_laws(panda: sm.RobotModel) -> None:
    testing.check_constraint(
        sm.constraints.JointTorqueLimits(limit=20.0), upright_circle(panda, task="position")
    )


def test_torques_are_kept_and_judged_at_all_times(panda: sm.RobotModel, tmp_path) -> None:
    free = sm.plan(upright_circle(panda, task="position"))
    dynamics, t = Dynamics(panda, 3.0), np.linspace(0.0, 4.0, 20_001)
    motion = free.trajectory
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2)))
    asked = sm.constraints.JointTorqueLimits(panda.effort_limit, payload=3.0)
    found = asked.requirement(panda).judge(_finished(free))
    exact = float((needed / panda.effort_limit).max())
    assert exact <= found.amount <= exact * (1.0 + 1e-4)
    # Less than the free motion takes of the joint that is loaded most.
    joint = int(np.argmax(needed.max(axis=0)))
    limit = np.array(panda.effort_limit)
    limit[joint] = 0.985 * needed[:, joint].max()
    asked = sm.constraints.JointTorqueLimits(limit, payload=3.0)
    constraints = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        asked,
    ]
    plan = sm.plan(upright_circle(panda, task="position", constraints=constraints))
    assert plan.certificate.verified, plan.certificate.verdict
    assert "torques without damping and friction" in plan.certificate.covers
    motion = plan.trajectory
    kept = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2)))
    assert (kept / limit).max() <= 1.0
    assert plan.report.cost > free.report.cost
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified


def test_whole_turns_between_samples_hide_nothing(panda: sm.RobotModel) -> None:
    # At a quarter, the half and three quarters of the way the arm stands upright each time.
    upright = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.1, 0.0])
    turned = upright + 8.0 * np.pi * np.eye(7)[1]
    speed = (turned - upright) / 100.0
    at_ends = np.array([upright, turned]), np.array([speed, speed])
    still = np.zeros((2, 7))
    motion = sm.Trajectory(np.array([0.0, 100.0]), *at_ends, panda.joint_names, still)
    dynamics, t = Dynamics(panda), np.linspace(0.0, 100.0, 4001)
    needed = np.abs(dynamics.torques(motion(t), motion(t, 1), motion(t, 2))).max(axis=0)
    assert needed[1] > 30.0
    limit = np.full(7, 2.0 * needed.max())
    assert (
        sm.constraints.JointTorqueLimits(limit)
        .requirement(panda)
        .judge(FinishedMotion(panda, motion))
        .satisfied
    )
    limit[1] = 0.5 * needed[1]
    found = (
        sm.constraints.JointTorqueLimits(limit)
        .requirement(panda)
        .judge(FinishedMotion(panda, motion))
    )
    assert (found.satisfied, found.subject) == (False, panda.joint_names[1])
    assert found.amount == pytest.approx(2.0, rel=1e-3)
    # Too long a way to be looked at is not kept either.
    endless = sm.Trajectory(
        motion.t, np.array([upright, upright + 1e6]), np.full((2, 7), 1e4), panda.joint_names, still
    )
    found = (
        sm.constraints.JointTorqueLimits(limit)
        .requirement(panda)
        .judge(FinishedMotion(panda, endless))
    )
    assert not found.satisfied


def test_a_payload_that_is_too_heavy_is_refused(panda: sm.RobotModel) -> None:
    heavy = sm.constraints.JointTorqueLimits(payload=30.0)
    plan = sm.plan(upright_circle(panda, constraints=[heavy]), max_evaluations=30)
    assert not plan.certificate.verified
    assert re.search(
        r"torque of joint 'panda_joint\d' is \S+ Nm at t = \S+ s, \S+ times its limit of (12|87)",
        plan.certificate.verdict,
    )


def _finished(plan: sm.Plan) -> FinishedMotion:
    return FinishedMotion(plan.robot, plan.trajectory)


def test_joints_that_mimic_keep_the_limits_of_whatever_turns_them(tmp_path: Path) -> None:
    """One motor turns all of them, Cᵀτ, or each has its own, τ: no URDF says which."""
    file = tmp_path / "finger.urdf"
    file.write_text(finger('lower="-2" upper="2" velocity="2" effort="4"'))
    robot = sm.load_robot(file, tool="tip")
    quantity, asked = sm.constraints.JointTorqueLimits().quantity(robot), robot.dof + 2
    assert [column.subject for column in quantity.columns[-2:]] == ["j3", "j4"]
    np.testing.assert_array_equal(quantity.bounds, [5.0] * robot.dof + [5.0, 4.0])
    rng = np.random.default_rng(1)
    motion = rng.uniform(-1.0, 1.0, (3, 6, robot.dof))
    found = quantity.values(*motion)
    # The fourth joint goes the other way than the third, which moves both.
    np.testing.assert_allclose(found[:, 2], found[:, -2] - found[:, -1], atol=1e-12)
    for k, slopes in enumerate(quantity.derivatives(*motion)):
        assert slopes.shape == (6, asked, robot.dof)
        way, step = rng.normal(size=motion[k].shape), 1e-6 * (np.arange(3) == k)[:, None, None]
        ends = [quantity.values(*(motion + sign * step * way)) for sign in (1.0, -1.0)]
        by_steps = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(slopes @ way[..., None], by_steps[..., None], atol=1e-6)


@pytest.mark.parametrize(
    ("effort", "said"),
    [("9", None), ("2.5", "torque of joint 'j4' alone is"), ("0", None)],
)
def test_a_joint_that_mimics_is_judged_by_its_own_effort(
    effort: str, said: str | None, tmp_path: Path
) -> None:
    file = tmp_path / "finger.urdf"
    text = finger(f'lower="-2" upper="2" velocity="2" effort="{effort}"')
    file.write_text(text.replace('velocity="2" effort="5"', 'velocity="2" effort="30"'))
    robot = sm.load_robot(file, tool="tip")
    # Stretched out: what hangs on the fourth joint is at its largest lever.
    q = np.zeros((2, robot.dof))
    motion = sm.Trajectory(np.array([0.0, 1.0]), q, q, robot.joint_names, q)
    # Links 4 and 5 weigh 0.9 and 1 kg, at 0.2 and 0.1 + 0.25 m.
    weight = 9.81 * (0.9 * 0.2 + 1.0 * 0.35)
    found = (
        sm.constraints.JointTorqueLimits().requirement(robot).judge(FinishedMotion(robot, motion))
    )
    assert found.satisfied is (said is None)
    if said is not None:
        assert (found.subject, said in found.text) == ("j4", True)
        assert found.amount == pytest.approx(weight / 2.5, rel=1e-6)
    # Limits of one's own are of what is asked of the joint that is mimicked.
    own = (
        sm.constraints.JointTorqueLimits(30.0)
        .requirement(robot)
        .judge(FinishedMotion(robot, motion))
    )
    assert own.satisfied


class Unlimited(sm.constraints.Constraint):
    """A quantity whose only number has no limit: it has no rows."""

    def quantity(self, robot: sm.RobotModel) -> sm.certificate.Quantity:
        return sm.certificate.Quantity(
            "unlimited",
            (sm.certificate.Column("q", "the first joint", "rad"),),
            lambda q, *_: q[:, :1],
            lambda q, *_: (np.tile(np.eye(robot.dof)[None, :1], (len(q), 1, 1)),),
            limit=np.inf,
        )


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> sm.RobotModel:
    """An arm of which no effort and no speed is known."""
    text = (ROOT / "robots" / "planar_3r.urdf").read_text()
    text = re.sub(r'(effort|velocity)="[^"]*"', r'\1="0"', text)
    file = tmp_path_factory.mktemp("bare") / "bare.urdf"
    file.write_text(text)
    return sm.load_robot(file)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize(
    "asked",
    [
        sm.constraints.JointTorqueLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
        Unlimited(),
    ],
    ids=lambda item: type(item).__name__,
)
def test_what_has_no_rows_on_an_arm_asks_for_nothing(
    bare: sm.RobotModel, asked: sm.constraints.Constraint, free: bool
) -> None:
    """Whether the start is given or not; the verdict covers nothing of it, and a remark says so."""
    start = np.array([1.57, -1.57, -0.5])
    path = short_line(bare, start)
    options = {} if free else {"start": start}
    problem = sm.Problem(bare, path, "planar", constraints=[asked], clearance=None, **options)
    plan = sm.plan(problem).require()
    name = asked.requirement(bare).name
    assert name not in plan.certificate.covers
    assert plan.report.active == ()
    without = sm.plan(problem.changed(constraints=()))
    assert plan.report.cost == pytest.approx(without.report.cost, rel=1e-9)
    assert "limited" in " ".join(plan.certificate.remarks)
    assert sm.plan_in_parts(problem).verified


def test_torques_that_bind_all_over_are_kept_between_nodes() -> None:
    """Accelerations cost nothing: they swing between two looks at an interval, if they may."""
    panda = robot_named("panda")
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 1.2, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(panda, path, "position", PANDA_HOME, clearance=None)
    free = sm.plan(problem.changed(constraints=()))
    torques = sm.constraints.JointTorqueLimits(1e3).quantity(panda).values
    t = np.linspace(0.0, free.trajectory.duration, 400)
    used = np.abs(torques(*(free.trajectory(t, order) for order in range(3))))
    # A third of the motion uses more than this of the first joint.
    limit = 1.2 * used.max(axis=0)
    limit[0] = np.quantile(used[:, 0], 0.7)
    asked = sm.constraints.JointTorqueLimits(limit)
    plan = sm.plan(problem.changed(constraints=[asked])).require()
    share = np.abs(torques(*(plan.trajectory(t, order) for order in range(3)))) / limit
    assert 0.98 < share[:, 0].max() <= 1.0


def test_a_joint_that_does_not_move_is_to_be_held(tmp_path: Path) -> None:
    text = re.sub(r'lower="-2.8" upper="2.8"', 'lower="0.3" upper="0.3"', arm(), count=1)
    (tmp_path / "arm.urdf").write_text(text)
    robot = sm.load_robot(tmp_path / "arm.urdf")
    with pytest.raises(sm.errors.ProblemError, match=r"lower = upper = 0.3.*lock = .'j1': 0.3"):
        sm.constraints.JointPositionLimits().limits(robot)
    assert sm.load_robot(tmp_path / "arm.urdf", lock={"j1": 0.3}).dof == 6
