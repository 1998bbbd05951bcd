"""Tool motions: the twist is the derivative of the pose, waypoints are met, bad input is named."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import restore
from selfmotion.basics.arrays import Array

# Central differences with a step of 1e-6 of functions of order 1 to 30.
DIFFERENCE = 2e-8


def pose(seed: int) -> pin.SE3:
    return pin.exp6(np.random.default_rng(seed).normal(size=6))


def random_waypoints(corners: str = "blend") -> sm.Waypoints:
    rng = np.random.default_rng(5)
    poses = [pose(1) * pin.exp6(0.4 * rng.normal(size=6)) for _ in range(9)]
    return sm.Waypoints.from_poses(np.linspace(0, 2, 9), poses, corners=corners)


def tumbling(t: float) -> list[float]:
    return [np.sin(t), t, 1.0, np.cos(3 * t), np.sin(t), t * t]


def there_and_back() -> sm.Path:
    """A line, a pause at its end, and the way back."""
    way, back = sm.Line(pose(1), pose(2), 2.0), sm.Line(pose(2), pose(1), 3.0)
    return way + sm.Dwell(pose(2), 0.7) + back


PATHS = {
    "line": lambda: sm.Line(pose(1), pose(2), 2.0),
    "line at constant speed": lambda: sm.Line(pose(1), pose(2), 2.0, "constant"),
    "circle": lambda: sm.Circle(pose(1), [0, 0, 0], [0, 1, 1], 2.0),
    "turning arc": lambda: sm.Circle(pose(1), [0, 0, 0], [0, 1, 1], 2.0, -0.4, turn_tool=True),
    "twist": lambda: sm.TwistPath(pose(1), tumbling, 2.0),
    "waypoints": random_waypoints,
    "waypoints with stops": lambda: random_waypoints("stop"),
    "ramped line": lambda: sm.Ramped(sm.Line(pose(1), pose(2), 2.0, "constant"), 0.4),
    "ramped waypoints": lambda: sm.Ramped(random_waypoints(), 0.9),
    "there and back": there_and_back,
}


@pytest.fixture(params=PATHS)
def path(request: pytest.FixtureRequest) -> sm.Path:
    return PATHS[request.param]()


def test_twist_is_the_derivative_of_the_pose(path: sm.Path) -> None:
    h, t = 1e-6, np.linspace(0, path.duration, 42)[1:-1]
    before, here, after = path.samples(t - h), path.samples(t), path.samples(t + h)
    linear = (after.translation - before.translation) / (2 * h)
    relative = after.rotation @ before.rotation.transpose(0, 2, 1)
    angular = np.array([pin.log3(turn) for turn in relative]) / (2 * h)
    np.testing.assert_allclose(here.twist, np.hstack([linear, angular]), rtol=0, atol=DIFFERENCE)


def test_rotations_are_rotations(path: sm.Path) -> None:
    rotation = path.samples(np.linspace(0, path.duration, 30)).rotation
    identity = np.broadcast_to(np.eye(3), rotation.shape)
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), identity, atol=1e-12)


def test_description_restores_the_path_exactly(path: sm.Path) -> None:
    restored = restore(sm.Path, json.loads(json.dumps(path.to_dict())))
    t = np.linspace(0, path.duration, 17)
    for name in ("translation", "rotation", "twist"):
        np.testing.assert_array_equal(
            getattr(path.samples(t), name), getattr(restored.samples(t), name)
        )


def test_single_and_many_times_agree(path: sm.Path) -> None:
    t = 0.3 * path.duration
    np.testing.assert_array_equal(path.pose(t).translation, path.samples([t]).translation[0])
    np.testing.assert_array_equal(path.twist(t), path.samples([t]).twist[0])


def test_times_outside_are_refused(path: sm.Path) -> None:
    with pytest.raises(sm.PathError, match="outside the path"):
        path.pose(path.duration + 0.1)
    with pytest.raises(sm.PathError, match="outside the path"):
        path.pose(np.nan)


def test_line_starts_and_ends_where_it_should() -> None:
    line = sm.Line(pose(1), pose(2), 2.0)
    assert line.pose(0.0).isApprox(pose(1), 1e-12)
    assert line.pose(2.0).isApprox(pose(2), 1e-12)
    np.testing.assert_allclose(line.twist(0.0), 0.0, atol=1e-12)


def test_circle_keeps_its_radius_and_closes() -> None:
    circle = sm.Circle.around(pose(1), 0.15, 3.0, normal=(1, 2, 0))
    positions = circle.samples(np.linspace(0, 3, 50)).translation
    np.testing.assert_allclose(np.linalg.norm(positions - circle.center, axis=1), 0.15, rtol=1e-12)
    np.testing.assert_allclose((positions - circle.center) @ circle.normal, 0.0, atol=1e-12)
    assert circle.radius == pytest.approx(0.15)
    assert circle.pose(3.0).isApprox(circle.pose(0.0), 1e-12)


def test_twist_path_integrates_the_papers_velocity() -> None:
    problem = sm.sample_problem()
    t = np.linspace(0, 1, 50)
    expected = np.stack([3 * np.cos(np.pi * t), 2 * np.cos(np.pi * t), 0 * t], axis=1)
    np.testing.assert_allclose(problem.path.samples(t).translation, expected, atol=1e-12)


def test_twist_path_turns_like_the_exponential() -> None:
    omega = np.array([0.3, -0.5, 0.9])
    path = sm.TwistPath(pose(1), lambda t: [0, 0, 0, *omega], 2.0)
    np.testing.assert_allclose(
        path.pose(1.3).rotation, pin.exp3(1.3 * omega) @ pose(1).rotation, atol=1e-11
    )


def test_twist_path_refuses_a_jump() -> None:
    with pytest.raises(sm.PathError, match=r"not smooth near t = 0\.[67]"):
        sm.TwistPath(pose(1), lambda t: [float(t > 0.7), 0, 0], 1.0)
    with pytest.raises(sm.PathError, match="expected"):
        sm.TwistPath(pose(1), lambda t: [1.0, 2.0], 1.0)


@pytest.mark.parametrize("corners", ["blend", "stop"])
def test_waypoints_are_met(corners: str) -> None:
    rng = np.random.default_rng(5)
    poses = [pose(1) * pin.exp6(0.4 * rng.normal(size=6)) for _ in range(9)]
    path = random_waypoints(corners)
    for t, expected in zip(np.linspace(0, 2, 9), poses, strict=True):
        assert path.pose(t).isApprox(expected, 1e-10)


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]]


def test_corners_stop_rests_at_kinks_and_keeps_the_legs() -> None:
    path = sm.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="stop")
    np.testing.assert_array_equal(path.corner_times, [0.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(path.samples(path.corner_times).twist, 0.0, atol=1e-12)
    assert np.linalg.norm(path.twist(2.0)) > 0.5
    early = path.samples(np.linspace(0, 1, 20)).translation
    np.testing.assert_allclose(early[:, 1:], 0.0, atol=1e-12)


def test_corners_blend_swings_through_smoothly() -> None:
    path = sm.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="blend")
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
    path = sm.Waypoints.from_csv(file)
    assert path.duration == 1.0
    np.testing.assert_allclose(path.pose(1.0).rotation, np.diag([-1, -1, 1]), atol=1e-12)
    plain = sm.Waypoints.from_csv(write_csv(tmp_path, "t,x,y,z\n0,0,0,0\n1,1,2,3\n"))
    np.testing.assert_allclose(plain.pose(1.0).translation, [1, 2, 3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("t,x,y\n0,0,0\n", "the header is t,x,y"),
        ("t,x,y,z\n0,0,0,0\n1,0,zero,0\n", "line 3: could not convert"),
        ("t,x,y,z\n0,0,0,0\n1,0,0\n", "line 3 has 3 values"),
        ("t,x,y,z\n0,0,0,0\n", "at least two poses"),
        ("t,x,y,z\n0,0,0,0\n0,1,0,0\n", r"t\[1\] = 0.0 does not come after"),
        ("t,x,y,z\n0,0,0,0\n1,nan,0,0\n", r"positions\[1, 0\] is nan"),
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,0,0,0,0,0\n1,0,0,0,1,0,0,0\n", r"quaternions\[0\] is zero"),
    ],
)
def test_bad_csv_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(sm.FileFormatError, match=message):
        sm.Waypoints.from_csv(write_csv(tmp_path, text))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sm.Line(pose(1), pose(2), 0.0), "duration is 0.0"),
        (lambda: sm.Line(pose(1), np.eye(3), 1.0), "shape"),
        (lambda: sm.Line(pose(1), 2 * np.eye(4), 1.0), "not orthonormal"),
        (lambda: sm.Line(pose(1), pose(2), 1.0, "fast"), "unknown time law 'fast'"),
        (lambda: sm.Circle(pose(1), [0, 0], [0, 0, 1], 1.0), "center"),
        (lambda: sm.Circle(pose(1), [0, 0, 0], [0, 0, 0], 1.0), "normal is zero"),
        (lambda: sm.Circle(pose(1), pose(1).translation, [0, 0, 1], 1.0), "radius is zero"),
        (lambda: sm.Circle.around(pose(1), -0.1, 1.0), "radius is -0.1"),
        (lambda: sm.Waypoints([0, 1], [[0, 0, 0]]), "positions has shape"),
        (lambda: sm.Waypoints([0, 1], [[0, 0, 0]] * 2, corners="cut"), "corners is 'cut'"),
        (lambda: restore(sm.Path, {"kind": "spiral"}), "path kind is 'spiral'"),
        (lambda: restore(sm.Path, {"kind": "line", "begin": 1}), "path of kind 'line'"),
    ],
)
def test_bad_paths_are_refused(call, message: str) -> None:
    with pytest.raises((sm.PathError, sm.FileFormatError), match=message):
        call()


def test_samples_of_a_corner_path_are_continuous() -> None:
    """No piece is skipped or taken twice at its ends."""
    path = sm.Waypoints([0, 1, 2, 3, 4], SQUARE, corners="stop")
    positions: Array = path.samples(np.linspace(0, 4, 4001)).translation
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() < 3e-3


def test_a_ramp_begins_and_ends_at_rest_and_keeps_the_pace_in_between() -> None:
    line = sm.Line(pose(1), pose(2), 2.0, "constant")
    ramped = sm.Ramped(line, 0.4)
    assert ramped.duration == pytest.approx(2.4)
    assert np.abs(ramped.samples([0.0, ramped.duration]).twist).max() == 0.0
    t = np.linspace(0.4, 2.0, 9)
    here, there = ramped.samples(t), line.samples(t - 0.2)
    np.testing.assert_allclose(here.translation, there.translation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(here.twist, there.twist, rtol=0, atol=1e-14)


def test_pieces_follow_each_other() -> None:
    path = there_and_back()
    assert path.duration == pytest.approx(5.7)
    assert np.abs(path.samples(np.linspace(2.0, 2.7, 8)).twist).max() <= 1e-12
    np.testing.assert_allclose(path.pose(2.5).homogeneous, pose(2).homogeneous, atol=1e-12)
    np.testing.assert_allclose(path.pose(5.7).homogeneous, pose(1).homogeneous, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sm.Joined([]), "no pieces"),
        (
            lambda: sm.Line(pose(1), pose(2), 2.0) + sm.Dwell(pose(3), 1.0),
            "piece 2 begins .* m and",
        ),
        (
            lambda: sm.Line(pose(1), pose(2), 2.0, "constant") + sm.Dwell(pose(2), 1.0),
            "faster or slower than piece 1 ends",
        ),
        (lambda: sm.Ramped(sm.Line(pose(1), pose(2), 2.0), 3.0), "ramp is 3.0 s, expected"),
        (lambda: sm.Dwell(pose(1), 0.0), "duration"),
    ],
)
def test_paths_that_cannot_be_joined_or_ramped(make, message: str) -> None:
    with pytest.raises(sm.PathError, match=message):
        make()
