"""A cup that must not spill: tilts are kept, judged, and refused by name."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.testing import check_constraint
from support.arms import PANDA_HOME, central_difference, robot_named

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
