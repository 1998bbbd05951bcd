"""Every tool motion: the twist is the derivative of the pose; bad input is named."""

import json
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import restore
from support.paths import pose, random_waypoints, there_and_back

# Central differences with a step of 1e-6 of functions of order 1 to 30.
DIFFERENCE = 2e-8
# Of products of matrices, which add in another order when there are many.
ROUNDING = 1e-13


def tumbling(t: float) -> list[float]:
    return [np.sin(t), t, 1.0, np.cos(3 * t), np.sin(t), t * t]


PATHS = {
    "line": lambda: sm.paths.Line(pose(1), pose(2), 2.0),
    "line at constant speed": lambda: sm.paths.Line(pose(1), pose(2), 2.0, "constant"),
    "circle": lambda: sm.paths.Circle(pose(1), [0, 0, 0], [0, 1, 1], 2.0),
    "turning arc": lambda: sm.paths.Circle(
        pose(1), [0, 0, 0], [0, 1, 1], 2.0, -0.4, turn_tool=True
    ),
    "spiral": lambda: sm.paths.Spiral(pose(1), [0, 0, 0], [0, 1, 1], 2.0, 1.5, 0.1),
    "helix": lambda: sm.paths.Spiral(
        pose(1), pose(1).translation, [0, 1, 1], 2.0, -1.5, 0.2, rise=0.3, turn_tool=True
    ),
    "twist": lambda: sm.paths.TwistPath(pose(1), tumbling, 2.0),
    "waypoints": random_waypoints,
    "waypoints with stops": lambda: random_waypoints("stop"),
    "ramped line": lambda: sm.paths.section_at_rest(
        sm.paths.Line(pose(1), pose(2), 2.0, "constant"), ramp=0.4
    ),
    "ramped waypoints": lambda: sm.paths.section_at_rest(random_waypoints(), ramp=0.9),
    "end of waypoints": lambda: sm.paths.Section(random_waypoints(), 0.7, 1.9, crowding=True),
    "there and back": there_and_back,
    "waypoints, woven": lambda: sm.paths.Weave(random_waypoints(), 0.01, 0.5, dwell=0.1),
    "waypoints backwards": lambda: sm.paths.Reversed(random_waypoints()),
}


@pytest.fixture(params=PATHS)
def path(request: pytest.FixtureRequest) -> sm.paths.Path:
    return PATHS[request.param]()


def test_twist_is_the_derivative_of_the_pose(path: sm.paths.Path) -> None:
    h, t = 1e-6, np.linspace(0, path.duration, 42)[1:-1]
    before, here, after = path.samples(t - h), path.samples(t), path.samples(t + h)
    linear = (after.translation - before.translation) / (2 * h)
    relative = after.rotation @ before.rotation.transpose(0, 2, 1)
    angular = np.array([pin.log3(turn) for turn in relative]) / (2 * h)
    np.testing.assert_allclose(here.twist, np.hstack([linear, angular]), rtol=0, atol=DIFFERENCE)


def test_rotations_are_rotations(path: sm.paths.Path) -> None:
    rotation = path.samples(np.linspace(0, path.duration, 30)).rotation
    identity = np.broadcast_to(np.eye(3), rotation.shape)
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), identity, atol=1e-12)


def test_description_restores_the_path_exactly(path: sm.paths.Path) -> None:
    restored = restore(sm.paths.Path, json.loads(json.dumps(path.to_dict())))
    t = np.linspace(0, path.duration, 17)
    for name in ("translation", "rotation", "twist"):
        np.testing.assert_array_equal(
            getattr(path.samples(t), name), getattr(restored.samples(t), name)
        )


WRAPPED = {
    "alone": lambda path: path,
    "led at a feed": lambda path: sm.paths.Feed(path, 0.05),
    "retimed": lambda path: sm.paths.Retimed(
        path, [0.0, 2.0 * path.duration], [0.0, path.duration], [0.5, 0.5]
    ),
    "placed": lambda path: sm.paths.Placed(path, pose(3)),
    "backwards": sm.paths.Reversed,
    "joined": lambda path: (
        sm.paths.section_at_rest(path, ramp=0.4) + sm.paths.Dwell(path.pose(path.duration), 0.5)
    ),
}


@pytest.mark.parametrize("wrapped", WRAPPED.values(), ids=WRAPPED)
def test_many_times_have_as_many_poses_and_twists(
    wrapped: Callable[[sm.paths.Path], sm.paths.Path],
) -> None:
    path = wrapped(sm.paths.Line(pose(1), pose(2), 2.0, "constant"))
    times = np.array([0.9, 0.2, 0.6]) * path.duration
    poses, samples = path.pose(times), path.samples(times)
    assert len(poses) == len(times)
    for found, single, place in zip(
        poses, map(path.pose, times.tolist()), samples.translation, strict=True
    ):
        np.testing.assert_allclose(found.homogeneous, single.homogeneous, atol=ROUNDING)
        np.testing.assert_array_equal(found.translation, place)
    assert np.ptp([found.translation for found in poses], axis=0).max() > 1e-3
    np.testing.assert_array_equal(path.twist(times), samples.twist)
    singles = [path.twist(t) for t in times.tolist()]
    np.testing.assert_allclose(path.twist(times), singles, atol=ROUNDING)


def test_single_and_many_times_agree(path: sm.paths.Path) -> None:
    times = [0.3 * path.duration, 0.7 * path.duration]
    poses, twists = path.pose(times), path.twist(times)
    for k, t in enumerate(times):
        np.testing.assert_array_equal(path.pose(t).translation, path.samples(t).translation[0])
        np.testing.assert_allclose(path.pose(t).homogeneous, poses[k].homogeneous, atol=ROUNDING)
        np.testing.assert_array_equal(path.twist(t), path.samples([t]).twist[0])
        np.testing.assert_allclose(path.twist(t), twists[k], atol=ROUNDING)


def test_times_outside_are_refused(path: sm.paths.Path) -> None:
    with pytest.raises(sm.errors.PathError, match="outside the path"):
        path.pose(path.duration + 0.1)
    with pytest.raises(sm.errors.PathError, match="outside the path"):
        path.pose(np.nan)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sm.paths.Line(pose(1), pose(2), 0.0), "duration is 0.0"),
        (lambda: sm.paths.Line(pose(1), np.eye(3), 1.0), "shape"),
        (lambda: sm.paths.Line(pose(1), 2 * np.eye(4), 1.0), "not orthonormal"),
        (lambda: sm.paths.Line(pose(1), pose(2), 1.0, "fast"), "unknown time law 'fast'"),
        (lambda: sm.paths.Circle(pose(1), [0, 0], [0, 0, 1], 1.0), "center"),
        (lambda: sm.paths.Circle(pose(1), [0, 0, 0], [0, 0, 0], 1.0), "normal is zero"),
        (lambda: sm.paths.Circle(pose(1), pose(1).translation, [0, 0, 1], 1.0), "radius is zero"),
        (lambda: sm.paths.Circle.around(pose(1), -0.1, 1.0), "radius is -0.1"),
        (lambda: sm.paths.Waypoints([0, 1], [[0, 0, 0]]), "positions has shape"),
        (lambda: sm.paths.Waypoints([0, 1], [[0, 0, 0]] * 2, corners="cut"), "corners is 'cut'"),
        (lambda: restore(sm.paths.Path, {"kind": "corkscrew"}), "path kind is 'corkscrew'"),
        (lambda: restore(sm.paths.Path, {"kind": "line", "begin": 1}), "path of kind 'line'"),
    ],
)
def test_bad_paths_are_refused(call, message: str) -> None:
    with pytest.raises((sm.errors.PathError, sm.errors.FileFormatError), match=message):
        call()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sm.paths.Joined([]), "no pieces"),
        (
            lambda: sm.paths.Line(pose(1), pose(2), 2.0) + sm.paths.Dwell(pose(3), 1.0),
            "piece 2 begins .* m and",
        ),
        (
            lambda: sm.paths.Line(pose(1), pose(2), 2.0, "constant") + sm.paths.Dwell(pose(2), 1.0),
            "faster or slower than piece 1 ends",
        ),
        (
            lambda: sm.paths.section_at_rest(sm.paths.Line(pose(1), pose(2), 2.0), ramp=3.0),
            "ramp is 3.0 s, expected",
        ),
        (lambda: sm.paths.Dwell(pose(1), 0.0), "duration"),
    ],
)
def test_paths_that_cannot_be_joined_or_run_up(make, message: str) -> None:
    with pytest.raises(sm.errors.PathError, match=message):
        make()
