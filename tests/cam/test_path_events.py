"""When a path passes the poses that it was made of, whatever is made of it."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.shop.cam.path_events import _LOOKS, _poses_passed, times_of_events

POINTS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.2, 0.0], [0.4, 0.2, 0.1]])


@pytest.mark.parametrize("kind", ["as it is", "at a feed", "placed", "at a feed, placed"])
def test_poses_are_passed_where_they_are(kind: str) -> None:
    path: sm.paths.Path = sm.paths.Waypoints(np.array([1.0, 2.0, 4.0, 5.0]), POINTS)
    moved = pin.SE3(np.eye(3), np.array([0.3, -0.2, 0.1]))
    points = POINTS
    if kind.startswith("at a feed"):
        path = sm.paths.Feed(path, 0.02)
    if kind.endswith("placed"):
        path, points = sm.paths.Placed(path, moved), POINTS + moved.translation
    times = _poses_passed(path)
    assert times is not None
    assert times[0] == 0.0
    assert times[-1] == path.duration
    assert (np.diff(times) > 0.0).all()
    np.testing.assert_allclose(path.samples(times).translation, points, atol=1e-6)


def test_what_is_made_of_no_poses_passes_none() -> None:
    line = sm.paths.Line(pin.SE3.Identity(), pin.SE3(np.eye(3), np.ones(3)), 1.0)
    assert _poses_passed(line) is None


def test_events_are_where_the_path_is_nearest_to_their_pose_at_about_its_length() -> None:
    """Round a circle, whose beginning is its end: each event is at its own pass."""
    begin = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    path = sm.paths.Circle.around(begin, 0.1, 4.0)
    times = np.array([0.0, 0.7, 2.0, 3.1, 4.0])
    rows = SimpleNamespace(
        positions=path.samples(times).translation,
        events=tuple((k, f"event {k}") for k in range(len(times))),
    )
    found = times_of_events(path, rows)
    assert [event for event, _ in found] == [event for _, event in rows.events]
    # As exactly as the path is looked at.
    at = [time for _, time in found]
    np.testing.assert_allclose(at, times, atol=path.duration / _LOOKS)
    assert (at[0], at[-1]) == (0.0, path.duration)
