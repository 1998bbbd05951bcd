"""Self-motion curves, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.planning.search import SelfMotion
from selfmotion.planning.search.curves import CurveSet, curves_along
from support.followed import standing


@pytest.fixture(scope="module")
def arm() -> sm.RobotModel:
    return sm.load_robot("planar_3r")


LINKS = np.array([2.0, 2.0, 1.0])


def positions(q: Array) -> Array:
    """Closed form of the arm's tool, (…, 2)."""
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles) @ LINKS, np.sin(angles) @ LINKS], axis=-1)


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def closed_form(x: Array, yaw: Array, elbow: float) -> Array:
    """Configurations with the tool at x (2,) and the last link at angle yaw, (…, 3)."""
    wrist = x - LINKS[2] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    square = np.sum(wrist**2, axis=-1)
    q2 = elbow * np.arccos((square - LINKS[0] ** 2 - LINKS[1] ** 2) / (2 * LINKS[0] * LINKS[1]))
    q1 = np.arctan2(wrist[..., 1], wrist[..., 0]) - np.arctan2(
        LINKS[1] * np.sin(q2), LINKS[0] + LINKS[1] * np.cos(q2)
    )
    return np.stack([q1, q2, yaw - q1 - q2], axis=-1)


def test_curves_of_a_planar_arm_are_those_of_the_closed_form(arm: sm.RobotModel) -> None:
    # At 2 m the wrist is reached for each angle of the last link: two closed curves, elbow up and
    # down, on which that angle makes a turn.
    x = np.array([1.2, 1.6])
    motion = SelfMotion(standing(arm, sm.Task.PLANAR), 0.05)
    target = Follows.of(arm, sm.paths.Line(level(*x), level(1.3, 1.6), 1.0), "planar").targets(
        np.array([0.0])
    )[0]
    seeds = np.random.default_rng(1).uniform(-3.0, 3.0, (30, 3))
    curves = motion.curves(target, seeds).curves

    def speed(yaw: float) -> float:
        step = 1e-6
        ahead, behind = closed_form(x, np.array([yaw + step, yaw - step]), 1.0)
        difference = ahead - behind
        difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
        return float(np.linalg.norm(difference)) / (2 * step)

    length = quad(speed, 0.0, 2 * np.pi, limit=200)[0]
    assert [curve.closed for curve in curves] == [True, True]
    for curve in curves:
        assert np.abs(positions(curve.q) - x).max() < 1e-10
        assert np.diff(curve.arc).max() < 1.2 * 0.05
        assert curve.length == pytest.approx(length, rel=1e-3)
        turns = (curve.q[-1] - curve.q[0]) / (2 * np.pi)
        assert np.abs(turns - np.round(turns)).max() < 1e-12
        elbow = np.sign(curve.q[0, 1])
        expected = closed_form(x, curve.q.sum(axis=1), elbow)
        difference = curve.q - expected
        difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
        assert np.abs(difference).max() < 1e-8


def test_one_curve_where_elbow_up_and_down_meet(arm: sm.RobotModel) -> None:
    # Beyond 3 m the stretched elbow joins the two families to one curve.
    motion = SelfMotion(standing(arm, sm.Task.PLANAR), 0.05)
    target = Follows.of(
        arm, sm.paths.Line(level(3.5, 0.0), level(3.4, 0.0), 1.0), "planar"
    ).targets(np.array([0.0]))[0]
    curves = motion.curves(target, np.random.default_rng(1).uniform(-3.0, 3.0, (30, 3))).curves
    assert [curve.closed for curve in curves] == [True]
    assert curves[0].q[:, 1].min() < -0.1 < 0.1 < curves[0].q[:, 1].max()
    # No joint makes a full turn.
    assert np.abs(curves[0].q[-1] - curves[0].q[0]).max() < 1e-12


def test_points_of_curves_are_found_where_they_were_asked_for(arm: sm.RobotModel) -> None:
    """Of all curves at once, by turns added; and what is beside them is on none."""
    motion = SelfMotion(standing(arm, sm.Task.PLANAR), 0.05)
    target = Follows.of(
        arm, sm.paths.Line(level(1.2, 1.6), level(1.3, 1.6), 1.0), "planar"
    ).targets(np.array([0.0]))[0]
    rng = np.random.default_rng(1)
    found = motion.curves(target, rng.uniform(-3.0, 3.0, (30, 3)))
    number = rng.integers(len(found.curves), size=50)
    lengths = np.array([curve.length for curve in found.curves])
    arc = rng.uniform(0.01, 0.99, 50) * lengths[number]
    q = found.at(number, arc)
    turned = q + 2.0 * np.pi * rng.integers(-1, 2, q.shape)
    where, along = found.locate(turned)
    np.testing.assert_array_equal(where, number)
    np.testing.assert_allclose(along, arc, atol=1e-9)
    assert np.all(found.locate(q + np.array([0.0, 0.3, 0.0]))[0] == -1)
    assert np.all(found.locate(q + 1e-3)[0] == number)


def test_progress_goes_from_the_first_waypoint_to_the_last(arm: sm.RobotModel) -> None:
    path = sm.paths.Line(level(1.2, 1.6), level(1.3, 1.6), 1.0)
    follows = Follows.of(arm, path, "planar")
    told: list[tuple[int, int]] = []
    seeds = np.random.default_rng(1).uniform(-3.0, 3.0, (4, 3))
    targets = follows.targets(np.linspace(0.0, 1.0, 4))
    found = curves_along(
        SelfMotion(follows, 0.1), targets, seeds, 2, lambda _, k, count: told.append((k, count))
    )
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert len(found) == 4


def test_seeds_are_tried_at_every_so_manyth_waypoint_and_at_the_last() -> None:
    tried: list[int] = []

    def complete(curves: CurveSet, x: Array, seeds: Array, *, far: bool = False) -> None:
        if far:
            tried.append(int(x[0]))

    motion = SimpleNamespace(revolute=np.ones(3, dtype=bool), spacing=0.1, complete=complete)
    found = curves_along(motion, np.arange(11.0)[:, None], np.zeros((2, 3)), 4)
    assert len(found) == 11
    assert tried == [0, 4, 8, 10]
