"""The same poses in all forms that lists of them have are the same path."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm

# Numbers are written with all their digits.
ROUNDING = 1e-12
SHIFTS = np.array([[0.4, 0.0, 0.3], [0.45, 0.1, 0.3], [0.5, 0.1, 0.35]])
TURNS = [
    pin.rpy.rpyToMatrix(*angles) for angles in ((0.1, 0.2, 0.3), (0.2, 0.0, 0.4), (0.0, -0.1, 0.2))
]
POSES = [pin.SE3(turn, shift) for turn, shift in zip(TURNS, SHIFTS, strict=True)]


def numbers(pose: pin.SE3) -> dict[str, float]:
    return dict(zip("xyz", pose.translation.tolist(), strict=True))


def quaternion(pose: pin.SE3, before: str = "") -> dict[str, float]:
    values = pin.Quaternion(pose.rotation).coeffs().tolist()
    return {f"{before}{name}": value for name, value in zip("xyzw", values, strict=True)}


def angles(pose: pin.SE3) -> list[float]:
    return [float(angle) for angle in pin.rpy.matrixToRpy(pose.rotation)]


def flat(pose: pin.SE3) -> dict[str, float]:
    return {**numbers(pose), **quaternion(pose, "q")}


def frame(pose: pin.SE3) -> dict[str, list[float]]:
    """Return a frame of COMPAS, whose axes need not be of length 1."""
    x, y = pose.rotation[:, 0], pose.rotation[:, 1]
    return {
        "point": pose.translation.tolist(),
        "xaxis": (2.5 * x).tolist(),
        "yaxis": (0.5 * y).tolist(),
    }


FORMS: dict[str, Callable[[], Any]] = {
    "matrices": lambda: [pose.homogeneous.tolist() for pose in POSES],
    "matrices under a name": lambda: {"poses": [pose.homogeneous.tolist() for pose in POSES]},
    "numbers by name": lambda: {"waypoints": [flat(pose) for pose in POSES]},
    "by their own names": lambda: {f"P{k}": flat(pose) for k, pose in enumerate(POSES)},
    "below a table alone": lambda: {"seam": {"points": [flat(pose) for pose in POSES]}},
    "lists of three": lambda: {
        "targets": [{"position": pose.translation.tolist(), "rpy": angles(pose)} for pose in POSES]
    },
    "tables": lambda: {
        "targets": [{"position": numbers(pose), "orientation": quaternion(pose)} for pose in POSES]
    },
    "tables with joints beside": lambda: {
        "frames": [
            {"pos": numbers(pose), "quat": quaternion(pose), "joints": {"a": 1.0, "b": 2.0}}
            for pose in POSES
        ]
    },
    "frames": lambda: [frame(pose) for pose in POSES],
}


@pytest.mark.parametrize("form", FORMS)
def test_poses_are_the_same_in_all_their_forms(tmp_path: Path, form: str) -> None:
    file = tmp_path / "poses.json"
    file.write_text(json.dumps(FORMS[form]()))
    path = sm.files.read_path(file, feed=0.05)
    first, last = path.pose(0.0), path.pose(path.duration)
    for found, pose in ((first, POSES[0]), (last, POSES[-1])):
        np.testing.assert_allclose(found.translation, pose.translation, atol=ROUNDING)
        np.testing.assert_allclose(found.rotation, pose.rotation, atol=1e-9)


@pytest.mark.parametrize(
    ("item", "said"),
    [
        ({"xyz": [0.1, 0.2]}, "xyz is a list of 2, whose order is not known"),
        ({"x": 0, "y": 0, "z": 0, "quat": [0, 0, 0, 1]}, "quat is a list of 4, whose order"),
    ],
)
def test_lists_whose_order_is_not_known_are_refused(
    tmp_path: Path, item: dict[str, Any], said: str
) -> None:
    file = tmp_path / "poses.json"
    file.write_text(json.dumps({"points": [item, item]}))
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file, feed=0.05)
