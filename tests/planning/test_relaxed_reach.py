"""Relaxed rows extend reach: what some deviation within its band lets the arm follow is planned."""

import dataclasses

import numpy as np

import selfmotion as sm
from support.arms import robot_named

# How far the path leaves the arm's reach of 5 m [m].
BEYOND = 0.01


def outward() -> sm.Problem:
    planar = robot_named("planar_3r")
    start = planar.pose([0.0, 0.5, 0.5])
    end = start.copy()
    end.translation = start.translation / np.linalg.norm(start.translation) * (5.0 + BEYOND)
    return sm.Problem(planar, sm.paths.Line(start, end, 5.0), "planar")


def test_a_path_beyond_reach_by_less_than_its_band_is_followed() -> None:
    problem = outward()
    refused = sm.plan(problem)
    assert "out of reach" in refused.certificate.verdict
    assert "the path moved by" in refused.report.message
    band = 3.0 * BEYOND
    relaxed = dataclasses.replace(problem, relaxations=[sm.Relaxation(("x", "y"), band)])
    # Where it is feasible is the law, not how far it is optimised.
    plan = sm.plan(relaxed, max_evaluations=20)
    assert plan.certificate.verified, plan.certificate.verdict
    motion, path = plan.trajectory, problem.path
    t = np.linspace(0.0, path.duration, 101)
    away = np.array(
        [
            problem.robot.pose(q).translation[:2] - path.pose(float(s)).translation[:2]
            for s, q in zip(t, motion(t), strict=True)
        ]
    )
    sizes = np.linalg.norm(away, axis=1)
    assert sizes.max() <= band + 1e-6
    assert sizes[-1] >= BEYOND


def test_a_band_that_is_too_narrow_is_refused_at_once() -> None:
    narrow = [sm.Relaxation(("x", "y"), 0.5 * BEYOND)]
    plan = sm.plan(dataclasses.replace(outward(), relaxations=narrow))
    assert not plan.certificate.verified
    assert "out of reach" in plan.certificate.verdict
