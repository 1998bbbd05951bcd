"""Poses in configurations of robots: lists and names, of tables and matrices, are one path."""

import json
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm

PLACES = [[0.4, -0.05, 0.3], [0.42, 0.0, 0.3], [0.4, 0.05, 0.3]]
DOWN = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
NAMES = ("first", "second", "third")


def named(place: list[float]) -> dict[str, float]:
    return dict(zip("xyz", place, strict=True))


ROS = [{"name": "a", "position": named(place), "orientation": DOWN} for place in PLACES]
FLAT = [named(place) | {f"q{axis}": value for axis, value in DOWN.items()} for place in PLACES]
ANGLES = [{"pos": place, "rpy": [np.pi, 0.0, 0.0], "note": "weld"} for place in PLACES]
DEGREES = [named(place) | {"rx_deg": 180.0, "ry_deg": 0.0, "rz_deg": 0.0} for place in PLACES]
BOTH = [
    {"joint_states": {"j1": 0.1}, "position": named(place), "quaternion": DOWN,
     "euler": {"roll": 3.14, "pitch": 0.0, "yaw": 0.0}}
    for place in PLACES
]  # fmt: skip
MATRICES = [
    [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, y], [0.0, 0.0, -1.0, z], [0.0, 0.0, 0.0, 1.0]]
    for x, y, z in PLACES
]
FORMS = {
    "waypoints": {"waypoints": ROS},
    "stamped": {"waypoints": [{"pose": item} for item in ROS]},
    "names": {"frames": dict(zip(NAMES, ROS, strict=True))},
    "a node's": {"arm": {"ros__parameters": dict(zip(NAMES, FLAT, strict=True))}},
    "columns": {"poses": FLAT},
    "a list": DEGREES,
    "angles": {"points": ANGLES},
    "both": dict(zip(NAMES, BOTH, strict=True)),
    "matrices": dict(zip(NAMES, MATRICES, strict=True)),
}


@pytest.mark.parametrize("form", FORMS)
def test_lists_and_names_of_poses_are_one_path(form: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.yaml"
    file.write_text(json.dumps(FORMS[form]))
    path = sm.files.read_path(file, feed=0.05)
    for t, place in ((0.0, PLACES[0]), (path.duration, PLACES[-1])):
        np.testing.assert_allclose(path.pose(t).translation, place, atol=1e-12)
        np.testing.assert_allclose(path.pose(t).rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-9)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"poses": {"a": [0.0, 1.0], "b": [0.0, 1.0]}}, "has no list of poses, .* or by names"),
        ({"waypoints": [named(PLACES[0]), FLAT[1]]}, "'q.' is in some poses only"),
        (
            {"a": {"position": PLACES[0], "quat": [1, 0, 0, 0]}},
            "'a': quat is a list of 4, whose order is not known",
        ),
        ({"a": {"position": {"x": "left", "y": 0, "z": 0}}}, "'a': position.x is 'left', expected"),
        ({"a": {"position": {"x": 0, "y": 0}}}, "column 'z' is missing"),
        ({"waypoints": FLAT[:1]}, "has 1 poses, expected at least two"),
    ],
)
def test_lists_that_are_none_say_what_is_read(document: object, said: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.yaml"
    file.write_text(json.dumps(document))
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file, feed=0.05)
