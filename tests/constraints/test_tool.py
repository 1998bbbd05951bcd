"""Limits of the tool's speed and acceleration: exact, kept, judged and refused."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import FinishedMotion
from selfmotion.model.motion import Sampling
from selfmotion.model.robot import ToolRates
from selfmotion.problem.costs import Samples
from selfmotion.shell import testing
from selfmotion.shell.testing import check_constraint
from support.arms import PANDA_HOME, central_difference, robot_named
from support.circles import small_circle

# Central differences of poses and of rates.
DIFFERENCE = 1e-6


@pytest.fixture
def free(panda: sm.RobotModel) -> sm.Plan:
    return sm.plan(small_circle(panda, task="position"))


def test_derivatives_equal_central_differences(panda: sm.RobotModel) -> None:
    rates, rng, h = ToolRates(panda.chain), np.random.default_rng(0), 1e-6
    state = [rng.normal(size=(4, 7)) for _ in range(3)]
    by_velocity, by_acceleration = rates.derivatives(*state)
    for order in range(3):
        for joint in range(7):
            step = h * np.eye(7)[joint]
            late, early = (
                rates(*(part + sign * step * (k == order) for k, part in enumerate(state)))
                for sign in (1, -1)
            )
            for exact, more, less in zip((by_velocity, by_acceleration), late, early, strict=True):
                if order < len(exact):
                    difference = (more - less) / (2 * h)
                    np.testing.assert_allclose(
                        exact[order][:, :, joint], difference, atol=DIFFERENCE
                    )


@pytest.mark.parametrize("task", ["pose", "position", "pointing"])
def test_the_constraint_keeps_the_laws(panda: sm.RobotModel, task: str) -> None:
    limits = sm.constraints.ToolLimits(0.3, 0.5, 1.0, 2.0)
    testing.check_constraint(limits, small_circle(panda, task=task))


def test_what_the_task_leaves_free_keeps_its_limit(
    panda: sm.RobotModel, free: sm.Plan, tmp_path
) -> None:
    rates, t = ToolRates(panda.chain), np.linspace(0.0, 3.0, 20_001)

    def turn_rate(plan: sm.Plan) -> float:
        motion = plan.trajectory
        velocity, _ = rates(motion(t), motion(t, 1), motion(t, 2))
        return float(np.linalg.norm(velocity[:, 3:], axis=1).max())

    fastest = turn_rate(free)
    wide = sm.constraints.ToolLimits(turn_rate=2.0 * fastest).requirement(panda)
    found = wide.judge(FinishedMotion(panda, free.trajectory))
    assert 0.5 <= found.amount <= 0.5 * (1.0 + 1e-4)
    asked = sm.constraints.ToolLimits(turn_rate=0.5 * fastest)
    plan = sm.plan(
        small_circle(
            panda, task="position", constraints=[sm.constraints.JointVelocityLimits(), asked]
        )
    )
    assert plan.certificate.verified, plan.certificate.verdict
    assert "tool turn rate" in plan.certificate.covers
    assert turn_rate(plan) <= 0.5 * fastest
    assert plan.report.cost > free.report.cost
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified


def test_a_path_that_is_too_fast_is_refused_with_the_amount(panda: sm.RobotModel) -> None:
    path = small_circle(panda).path
    t = np.linspace(0.0, path.duration, 4001)
    fastest = np.linalg.norm(path.samples(t).twist[:, :3], axis=1).max()
    limits = sm.constraints.ToolLimits(speed=0.5 * fastest)
    plan = sm.plan(small_circle(panda, constraints=[limits]), max_evaluations=20)
    assert not plan.certificate.verified
    assert "give it 2 times the duration" in plan.certificate.verdict


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "none is given"),
        ({"speed": 0.0}, "tool limits: speed is 0.0"),
        ({"turn_rate": np.nan}, "tool limits: turn_rate is nan"),
        ({"acceleration": [1.0]}, "tool limits: acceleration is"),
        ({"speed": 1.0, "margin": 0.0}, "margin is 0.0"),
    ],
)
def test_limits_that_make_no_sense(options: dict, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        sm.constraints.ToolLimits(**options)


# A cup that must not spill: tilts are kept, judged, and refused by name.

LINK = "panda_link6"


@pytest.fixture
def problem(panda: sm.RobotModel) -> sm.Problem:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.12, 5.0, normal=(1, 0, 0))
    return sm.Problem(panda, path, "position", start=PANDA_HOME)


def tilts(robot: sm.RobotModel, motion: sm.Trajectory, towards: np.ndarray) -> np.ndarray:
    """Return the angles of the link's x axis from a direction at 2,000 times."""
    chain = robot.chain_to(LINK)
    q = motion(np.linspace(motion.t[0], motion.t[-1], 2000))
    cosines = [chain.place(x).rotation[:, 0] @ towards for x in q]
    return np.arccos(np.clip(cosines, -1.0, 1.0))


def test_a_tilt_is_kept_at_all_times_and_has_a_price(
    panda: sm.RobotModel, problem: sm.Problem
) -> None:
    towards = panda.chain_to(LINK).place(PANDA_HOME).rotation[:, 0]
    free = sm.plan(problem)
    most = tilts(panda, free.trajectory, towards).max()
    tilt = sm.constraints.Tilt(LINK, "x", within=0.7 * most, towards=towards)
    asked = dataclasses.replace(problem, constraints=(*problem.constraints, tilt))
    check_constraint(tilt, asked)
    plan = sm.plan(asked).require()
    assert tilts(panda, plan.trajectory, towards).max() <= 0.7 * most
    assert f"tilt of '{LINK}'" in plan.certificate.covers
    assert any(item.constraint == f"tilt of '{LINK}'" for item in plan.report.active)
    refused = sm.certify(
        panda, problem.path, "position", free.trajectory, requirements=[tilt.requirement(panda)]
    )
    assert f"the tilt of '{LINK}' from [1, 0, 0] is {most:.3f}"[:-1] in refused.verdict
    assert f"expected at most {0.7 * most:.4g} rad" in refused.verdict


def test_derivatives_equal_differences() -> None:
    robot, rng = robot_named("tiago"), np.random.default_rng(0)
    quantity = sm.constraints.Tilt("arm_5_link", (1.0, 2.0, 0.5), 0.3, (0.0, 1.0, 1.0)).quantity(
        robot
    )
    q = rng.normal(size=robot.dof)
    (exact,) = quantity.derivatives(q[None], q[None], q[None])
    for c in range(3):
        slope = central_difference(
            lambda x, c=c: float(quantity.values(x[None], x[None], x[None])[0, 0, c]), q
        )
        np.testing.assert_allclose(exact[0, 0, c], slope, atol=1e-8)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frame": "panda_link66"}, "no link 'panda_link66'"),
        ({"frame": LINK, "axis": "w"}, "axis is 'w'"),
        ({"frame": LINK, "towards": (0, 0, 0)}, "towards is zero"),
        ({"frame": LINK, "within": 4.0}, "within is 4"),
        ({"frame": 3}, "expected the name of a link"),
        ({"frame": "panda_link0"}, "no joint changes the tilt of 'panda_link0'"),
        ({"frame": "panda_link1", "axis": "z"}, "no joint changes the tilt of 'panda_link1'"),
    ],
)
def test_what_is_no_tilt_is_refused(
    panda: sm.RobotModel, given: dict[str, object], message: str
) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        sm.constraints.Tilt(**given).quantity(panda)  # type: ignore[arg-type]


def test_what_is_eased_is_what_h_falls_by(panda: sm.RobotModel, free: sm.Plan) -> None:
    """2 % of a limit: of a vector, whose h is a square, twice as much."""
    own = free.problem.follows
    t = np.linspace(0.0, 3.0, 301)
    motion = [free.trajectory(t, order) for order in range(3)]
    samples = Samples.along(own, Sampling.trapezoidal(t), *motion[:2])
    speed = np.linalg.norm(ToolRates(panda.chain)(*motion)[0][:, :3], axis=1).max()
    bound, eased = (
        sm.constraints.ToolLimits(share * speed).conditions(panda).points[0]
        for share in (1.0, 1.02)
    )
    fallen = bound.residual(samples).max() - eased.residual(samples).max()
    assert bound.easing(0)[0] == pytest.approx(fallen, rel=0.05)
    assert "2 % more" in bound.easing(0)[1]
