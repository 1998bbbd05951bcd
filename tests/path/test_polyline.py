"""Rounded corners are missed by their tolerance."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.shell import testing
from support.paths import polygon

# The tool rests where it is slower than this [m/s, rad/s].
RESTS = 1e-9


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("seed", range(4))
def test_corners_are_missed_by_their_tolerance_and_legs_are_straight(
    seed: int, tolerance: float
) -> None:
    points, turns = polygon(seed)
    path = sm.paths.Polyline(points, turns, tolerance=tolerance, turn_tolerance=10.0 * tolerance)
    corners = path.samples(path.corner_times)
    misses = np.linalg.norm(corners.translation - points[1:-1], axis=1)
    wanted = Rotation.from_quat(turns[1:-1], scalar_first=True)
    turned = (wanted.inv() * Rotation.from_matrix(corners.rotation)).magnitude()
    most = np.maximum(misses / tolerance, turned / (10.0 * tolerance))
    assert np.all(most <= 1.0 + 1e-9)
    # A corner that is rounded less than it may be has legs too short for more.
    legs = np.diff(path.knots)
    for k in np.flatnonzero(most < 0.99):
        around = np.flatnonzero(path.knots < path.corner_times[k])[-1]
        assert legs[around] >= 0.999 * 0.5 * min(path._lasts[k : k + 2])
    # Every point lies on a leg, or within the tolerance of its end.
    there = path.samples(np.linspace(0.0, path.duration, 2001)).translation
    along = np.diff(points, axis=0)
    share = np.einsum("kc,jkc->jk", along, there[:, None] - points[:-1]) / np.sum(along**2, axis=1)
    nearest = points[:-1] + np.clip(share, 0.0, 1.0)[:, :, None] * along
    off = np.linalg.norm(there[:, None] - nearest, axis=2).min(axis=1)
    assert off.max() <= tolerance
    testing.check_path(path)


def test_a_smaller_tolerance_is_a_slower_corner() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.2, 0.0]])
    slowest = []
    for tolerance in (1e-4, 1e-3, 1e-2):
        path = sm.paths.Feed(sm.paths.Polyline(points, tolerance=tolerance), 0.2)
        t = np.linspace(0.3 * path.duration, 0.7 * path.duration, 4001)
        slowest.append(np.linalg.norm(path.samples(t).twist[:, :3], axis=1).min())
    assert slowest[0] < 0.5 * slowest[1] < 0.5 * slowest[2]


def test_orientation_kinks_and_both_ends_come_to_rest() -> None:
    points = np.outer(np.arange(5.0), [0.1, 0.0, 0.0])
    bends = np.cumsum([[0, 0, 0], [0.3, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0.3, 0]], axis=0)
    turns = Rotation.from_rotvec(bends).as_quat(scalar_first=True)
    path = sm.paths.Waypoints(np.arange(5.0), points, turns, corners="stop")
    np.testing.assert_array_equal(path.corner_times, [0.0, 2.0, 4.0])
    for time in path.corner_times:
        assert np.abs(path.twist(time)).max() <= RESTS
    assert np.abs(path.twist(1.0)).max() > 0.05


def test_corners_that_meet_share_a_knot() -> None:
    """Steps of microseconds between them would turn rounding into accelerations."""
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1e-2, 0.0], [3.0, 3e-2, 0.0]])
    places = np.vstack([places, [4.0000113, 6e-2, 0.0], [5.0, 1e-1, 0.0]])
    path = sm.paths.Polyline(places, tolerance=0.5)
    gaps = np.diff(path.knots)
    assert gaps.min() > 0.1
    assert np.all(np.isin(path.knots, path.marks))
    assert np.diff(path.marks).min() < 1e-2 < gaps.min()
    # Where legs between corners are straight, each has its two.
    sharp = sm.paths.Polyline(places, tolerance=1e-6)
    assert len(sharp.knots) == len(sharp.marks) == 2 + 2 * 4
