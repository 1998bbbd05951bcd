"""What is left to save is an estimate that holds, and the default null motion refines itself."""

import dataclasses

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.engine.remaining import _within, finest
from support.circles import upright_circle

# The quadratic model against what a spline of 64 intervals truly saves.
AGREEMENT = 0.25


CUBIC = sm.PolynomialNullMotion()


FINE = sm.BSplineNullMotion(64)


@pytest.mark.parametrize("case", ["sample", "pose", "speed binds"])
def test_the_estimate_is_near_what_a_fine_spline_saves(panda: sm.RobotModel, case: str) -> None:
    # Of redundancy 4, where 64 intervals would take long: 16 are near enough.
    slow, fewer = sm.JointVelocityLimits(0.527), sm.BSplineNullMotion(16)
    problem = {
        "sample": lambda: sm.sample_problem(),
        "pose": lambda: upright_circle(
            panda, costs=[sm.JointVelocity(), sm.InverseManipulability(0.02)]
        ),
        "speed binds": lambda: upright_circle(panda, task="position", constraints=[slow]),
    }[case]()
    cubic, fine = (
        sm.plan(dataclasses.replace(problem, null_motion=motion))
        for motion in (CUBIC, fewer if case == "speed binds" else FINE)
    )
    assert cubic.report.remaining is not None
    truth = cubic.report.cost - fine.report.cost
    assert truth > 0.0
    assert cubic.report.remaining == pytest.approx(truth, rel=AGREEMENT)
    assert bool(cubic.report.active) == (case == "speed binds")
    # Nothing worth speaking of is left once the spline is there.
    assert fine.report.remaining is not None
    assert fine.report.remaining <= 0.1 * truth


def test_the_default_refines_itself_until_little_is_left() -> None:
    cubic = sm.plan(sm.sample_problem())
    plan = sm.plan(sm.sample_problem(null_motion=sm.RefinedNullMotion()))
    fine = sm.plan(sm.sample_problem(null_motion=FINE))
    assert cubic.report.null_motion == CUBIC
    assert isinstance(plan.report.null_motion, sm.BSplineNullMotion)
    assert plan.report.remaining <= 1e-3 * plan.report.cost
    assert fine.report.cost <= plan.report.cost <= 1.002 * fine.report.cost
    assert plan.report.cost <= 10.4860 < cubic.report.cost
    assert plan.certificate.verified
    size = plan.report.null_motion.functions(np.zeros(1), 1.0).shape[1]
    assert plan.coefficients.shape == (size,)


def test_where_the_cubic_is_enough_it_stays(panda: sm.RobotModel) -> None:
    plan = sm.plan(upright_circle(panda, null_motion=sm.RefinedNullMotion()))
    assert plan.report.null_motion == sm.RefinedNullMotion()
    assert 0.0 < plan.report.remaining <= 1e-3 * plan.report.cost
    wanted = sm.RefinedNullMotion(gain=1e-6, most=16)
    finer = sm.plan(upright_circle(panda, null_motion=wanted))
    assert finer.report.null_motion in (sm.BSplineNullMotion(8), sm.BSplineNullMotion(16))
    assert finer.report.cost < plan.report.cost


def test_a_plan_keeps_what_its_coefficients_are_of(tmp_path) -> None:
    plan = sm.plan(sm.sample_problem(null_motion=sm.RefinedNullMotion()))
    plan.save(tmp_path / "plan.npz")
    again = sm.load_plan(tmp_path / "plan.npz")
    assert again.report.null_motion == plan.report.null_motion
    assert again.report.remaining == plan.report.remaining
    sizes = {len(item.x) for item in again.report.history}
    assert len(sizes) == 2, "the cubic's coefficients, then the spline's"


def test_without_a_motion_that_keeps_its_constraints_nothing_is_estimated(panda) -> None:
    tight = sm.JointVelocityLimits(np.full(7, 0.1))
    plan = sm.plan(upright_circle(panda, constraints=[tight]), max_evaluations=20)
    assert not plan.certificate.verified
    assert plan.report.remaining is None


@pytest.mark.parametrize("intervals", [8, 16, 32, 64])
def test_coarse_splines_are_fine_ones(intervals: int) -> None:
    t = np.random.default_rng(0).uniform(0.0, 1.0, 200)
    coarse = sm.BSplineNullMotion(intervals).functions(t, 1.0)
    np.testing.assert_allclose(FINE.functions(t, 1.0) @ _within(intervals, 64), coarse, atol=1e-12)


@pytest.mark.parametrize(("options", "message"), [({"gain": 0.0}, "gain"), ({"most": 7}, "most")])
def test_refinements_that_make_no_sense(options: dict, message: str) -> None:
    with pytest.raises(sm.ProblemError, match=message):
        sm.RefinedNullMotion(**options)


def test_few_coefficients_where_the_redundancy_is_large() -> None:
    assert [finest(rows).intervals for rows in (0, 1, 3, 4, 9, 40)] == [64, 64, 64, 32, 16, 8]
    assert sm.RefinedNullMotion().finer(64, 1) == sm.BSplineNullMotion(64)
    assert sm.RefinedNullMotion().finer(64, 1, rests=True) == sm.BSplineNullMotion(16)
    most = sm.RefinedNullMotion(most=64)
    assert [most.finer(64, rows).intervals for rows in (1, 2, 4, 20)] == [64, 32, 16, 8]
