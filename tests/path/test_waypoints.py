"""Waypoints are met; tables of them are read, or refused by line."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.path.splines import Turning
from support.paths import pose, random_waypoints


@pytest.mark.parametrize("corners", ["blend", "stop"])
def test_waypoints_are_met(corners: str) -> None:
    rng = np.random.default_rng(5)
    poses = [pose(1) * pin.exp6(0.4 * rng.normal(size=6)) for _ in range(9)]
    path = random_waypoints(corners)
    for t, expected in zip(np.linspace(0, 2, 9), poses, strict=True):
        assert path.pose(t).isApprox(expected, 1e-10)


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]]


def test_corners_stop_rests_at_kinks_and_keeps_the_legs() -> None:
    path = sm.paths.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="stop")
    np.testing.assert_array_equal(path.corner_times, [0.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(path.samples(path.corner_times).twist, 0.0, atol=1e-12)
    assert np.linalg.norm(path.twist(2.0)) > 0.5
    early = path.samples(np.linspace(0, 1, 20)).translation
    np.testing.assert_allclose(early[:, 1:], 0.0, atol=1e-12)


def test_corners_blend_swings_through_smoothly() -> None:
    path = sm.paths.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="blend")
    assert path.corner_times.size == 0
    assert np.linalg.norm(path.twist(1.0)) > 0.5
    h = 1e-7
    before, after = path.samples(1.0 - h).twist, path.samples(1.0 + h).twist
    np.testing.assert_allclose(before, after, atol=1e-5)


def write_csv(folder: Path, text: str) -> Path:
    file = folder / "path.csv"
    file.write_text(text)
    return file


def test_csv_is_read(tmp_path: Path) -> None:
    file = write_csv(tmp_path, "t,x,y,z,qw,qx,qy,qz\n5,0,0,0,2,0,0,0\n6,1,0,0,0,0,0,1\n")
    path = sm.paths.Waypoints.from_csv(file)
    assert path.duration == 1.0
    np.testing.assert_allclose(path.pose(1.0).rotation, np.diag([-1, -1, 1]), atol=1e-12)
    plain = sm.paths.Waypoints.from_csv(write_csv(tmp_path, "t,x,y,z\n0,0,0,0\n1,1,2,3\n"))
    np.testing.assert_allclose(plain.pose(1.0).translation, [1, 2, 3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("t,x,y\n0,0,0\n", "the header is t,x,y"),
        ("t,x,y,z\n0,0,0,0\n1,0,zero,0\n", "line 3: y: is 'zero', expected a number"),
        ("t,x,y,z\n0,0,0,0\n1,0,0\n", "line 3 has 3 values"),
        ("t,x,y,z\n0,0,0,0\n", "at least two poses"),
        ("t,x,y,z\n0,0,0,0\n0,1,0,0\n", r"t\[1\] = 0.0 does not come after"),
        ("t,x,y,z\n0,0,0,0\n1,nan,0,0\n", r"positions\[1, 0\] is nan"),
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,0,0,0,0,0\n1,0,0,0,1,0,0,0\n", r"quaternions\[0\] is zero"),
    ],
)
def test_bad_csv_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(sm.errors.FileFormatError, match=message):
        sm.paths.Waypoints.from_csv(write_csv(tmp_path, text))


def test_samples_of_a_corner_path_are_continuous() -> None:
    """No piece is skipped or taken twice at its ends."""
    path = sm.paths.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="stop")
    positions: Array = path.samples(np.linspace(0, 4, 4001)).translation
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() < 3e-3


# Turning: scipy's rotation spline, with rates that are those of the orientations.

# Sums of some products of numbers below 10.
ROUNDING = 1e-12


@pytest.mark.parametrize("largest", [0.0, 1e-9, 0.1, 3.0])
def test_it_is_the_spline_of_scipy(largest: float) -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.3, 1.0, 8))
    first = Rotation.from_quat([[0.1, -0.2, 0.3, 0.9]])
    steps = Rotation.from_rotvec(largest * rng.uniform(-0.5, 0.5, (8, 3)))
    turns = [first[0]]
    for step in steps[1:]:
        turns.append(turns[-1] * step)
    turned = Rotation.concatenate(turns)
    spline = RotationSpline(t, turned)
    times = np.concatenate([t, rng.uniform(t[0], t[-1], 50)])
    rotation, rates = Turning(t, turned.as_quat(scalar_first=True)).at(times)
    np.testing.assert_allclose(rotation, spline(times).as_matrix(), atol=ROUNDING)
    # scipy's rates are in the axes that turn.
    expected = spline(times).apply(spline(times, 1))
    np.testing.assert_allclose(rates, expected, atol=ROUNDING)
    # Rates in the wrong axes are seen.
    if largest > 0.01:
        assert np.abs(rates - spline(times, 1)).max() > 1e-3
