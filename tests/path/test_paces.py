"""Laws of paces: what is left out of one is on it."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.path.pace import Pace
from selfmotion.model.task import SE3
from support.paths import polygon

# Rounding of a sum of some thousand terms, relative to what is summed.
ROUNDING = 1e-12


def ramps(count: int) -> tuple[Pace, Array]:
    """Return a motion of constant accelerations at even times, and when these change."""
    changes = np.array([0.0, 0.7, 2.0, 3.1, 4.0])
    slopes = np.array([1.0, 0.0, -0.4, -0.26 / 0.9])
    t = np.union1d(changes, np.linspace(0.0, 4.0, count))
    rates = np.append(0.0, np.cumsum(slopes * np.diff(changes)))
    rate = np.interp(t, changes, rates)
    sigma = np.append(0.0, np.cumsum(0.5 * np.diff(t) * (rate[:-1] + rate[1:])))
    return Pace(t, sigma, rate), changes


@pytest.mark.parametrize("count", [5, 40, 1000])
def test_samples_on_a_polynomial_are_left_out(count: int) -> None:
    pace, changes = ramps(count)
    found = pace.simplified()
    np.testing.assert_array_equal(found.t, changes)
    t = np.linspace(0.0, 4.0, 777)
    for order in range(2):
        np.testing.assert_allclose(found(t, order), pace(t, order), rtol=0.0, atol=4.0 * ROUNDING)


def test_of_other_functions_every_sample_is_kept() -> None:
    t = np.linspace(0.0, 3.0, 200)
    pace = Pace(t, t + 0.2 * np.sin(2.0 * t), 1.0 + 0.4 * np.cos(2.0 * t))
    np.testing.assert_array_equal(pace.simplified().t, t)


@pytest.mark.parametrize("window", [0.02, 0.2])
def test_a_mean_is_that_of_all_samples(window: float) -> None:
    """Against the trapezoidal rule, which a quintic of few samples has to meet."""
    pace, _ = ramps(300)
    mean = pace.smoothed(window)
    assert len(mean.t) < 30
    padded = lambda t: pace(np.clip(t, 0.0, 4.0))  # noqa: E731
    for at in np.linspace(0.0, 4.0 + window, 41):
        inner = np.linspace(at - window, at, 20001)
        asked = np.trapezoid(padded(inner), inner) / window
        # The rule's own error.
        assert abs(float(mean(np.array([at]))[0]) - asked) < 1e-8


def test_a_straight_line_at_a_feed_has_few_breaks() -> None:
    """As many as its ramps: proofs take each interval between two."""
    start = SE3(np.eye(3), np.zeros(3))
    end = SE3(np.eye(3), np.array([0.3, 0.1, 0.0]))
    path = sm.paths.Feed(sm.paths.Line(start, end, 1.0), 0.1)
    assert len(path.marks) < 30


# What paths at a feed may be off for what is left out, of a metre, and of their speeds.
OFF, OFF_SPEED = 1e-10, 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_a_path_at_a_feed_is_that_of_all_nodes(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    points, turns = polygon(seed)
    corners = sm.paths.Polyline(points, turns, **({"tolerance": 5e-3} if seed % 2 else {}))
    few = sm.paths.Feed(corners, 0.05, acceleration=1.0, smoothing=0.05)
    monkeypatch.setattr(Pace, "simplified", lambda self: self)
    all_nodes = sm.paths.Feed(corners, 0.05, acceleration=1.0, smoothing=0.05)
    assert len(few.marks) < 0.6 * len(all_nodes.marks)
    t = np.linspace(0.0, few.duration, 501)
    found, asked = few.samples(t), all_nodes.samples(t)
    np.testing.assert_allclose(found.translation, asked.translation, rtol=0.0, atol=OFF)
    scale = np.abs(asked.twist).max()
    np.testing.assert_allclose(found.twist, asked.twist, rtol=0.0, atol=OFF_SPEED * scale)
