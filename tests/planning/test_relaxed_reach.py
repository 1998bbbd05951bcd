"""Relaxed rows extend reach: what some deviation within its band lets the arm follow is planned."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import robot_named

# How far the path leaves the arm's reach of 5 m [m].
BEYOND = 0.01
# What certificates count as on the path [m].
ON_PATH = 1e-6


def outward() -> sm.Problem:
    planar = robot_named("planar_3r")
    start = planar.pose([0.0, 0.5, 0.5])
    end = start.copy()
    end.translation = start.translation / np.linalg.norm(start.translation) * (5.0 + BEYOND)
    return sm.Problem(planar, sm.paths.Line(start, end, 5.0), "planar")


def distances(plan: sm.Plan) -> tuple[Array, Array]:
    """Return times (N,) [s], and how far the tool is from the path there (N,) [m]."""
    t = np.linspace(0.0, plan.path.duration, 101)
    q = plan.trajectory(t)
    # Links of 2, 2 and 1 m, see `robot_named`.
    angles, lengths = np.cumsum(q, axis=1), np.array([2.0, 2.0, 1.0])
    tool = np.stack([np.cos(angles) @ lengths, np.sin(angles) @ lengths], axis=1)
    return t, np.linalg.norm(tool - plan.path.samples(t).translation[:, :2], axis=1)


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
    _, sizes = distances(plan)
    assert sizes.max() <= band + ON_PATH
    assert sizes[-1] >= BEYOND


def test_a_band_that_is_too_narrow_is_refused_at_once() -> None:
    narrow = [sm.Relaxation(("x", "y"), 0.5 * BEYOND)]
    plan = sm.plan(dataclasses.replace(outward(), relaxations=narrow))
    assert not plan.certificate.verified
    assert "out of reach" in plan.certificate.verdict


@pytest.mark.parametrize("given", [False, True])
def test_a_window_extends_reach_while_it_lasts(given: bool) -> None:
    """Though the motion without self-motion, which makes no use of it, ends where reach does."""
    problem = outward()
    start = np.array([0.0, 0.5, 0.5]) if given else None
    window = sm.Relaxation(("x", "y"), 3.0 * BEYOND, during=(3.0, 5.0))
    relaxed = dataclasses.replace(problem, start=start, relaxations=[window])
    plan = sm.plan(relaxed, max_evaluations=20)
    assert plan.certificate.verified, plan.certificate.verdict
    t, sizes = distances(plan)
    assert sizes[t < 3.0].max() < ON_PATH
    assert BEYOND <= sizes[-1] <= sizes.max() <= 3.0 * BEYOND + ON_PATH


def test_without_self_motion_windows_are_not_used_where_the_path_is_followed_without(
    panda_circle: Callable,
) -> None:
    """What reports compare with is a motion that may be followed: that of the exact path."""
    window = sm.Relaxation("rz", during=(1.0, 2.5))
    plans = [sm.plan(panda_circle(relaxations=r), max_evaluations=1) for r in ([], [window])]
    costs = [plan.report.initial_cost for plan in plans]
    assert costs[1] == pytest.approx(costs[0], rel=1e-9)
