"""Handles: what is dragged goes where it is dragged to, however the document writes its pose."""

import copy
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from selfmotion.model.task import SE3
from selfmotion.shell.documents import plan_request_of
from selfmotion.shell.view.document import Edited
from selfmotion.shell.view.handles import dragged, handles_of
from selfmotion.shell.view.poses import read_pose, write_pose
from selfmotion.shell.view.sliders import sliders_of

# Poses are written to a hundredth of a millimetre, turns to a microradian or 1e-4 degrees.
NEAR = 1.2e-5
BY = SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([0.02, -0.03, 0.01]))
START = {"position": [0.5, 0.0, 0.5], "rpy_deg": [180, 0, 0]}
POINTS = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.02]]
TURNS = [[0.0, 1.0, 0.0, 0.0]] * 3
BOX = {"shape": "box", "name": "post", "position": [0.3, -0.6, 0.6], "size": [0.1, 0.1, 1.2]}


def document(**path: Any) -> dict[str, Any]:
    return {"robot": {"name": "panda"}, "task": "pointing", "path": path}


WAYPOINTS = {"kind": "waypoints", "t": [0.0, 2.0, 4.0], "quaternions_wxyz": TURNS}
FRAME = {"position": [0.45, 0.1, 0.4], "rpy": [0.0, 0.0, 0.2]}
CASES = {
    "a circle": document(kind="circle", radius=0.1, duration=4.0, start=START),
    "a circle about a center": document(
        kind="circle", center=[0.5, 0.1, 0.5], duration=4.0, start=START
    ),
    "a line": document(
        kind="line", end={**START, "position": [0.5, 0.2, 0.5]}, duration=4.0, start=START
    ),
    "waypoints": document(**WAYPOINTS, positions=POINTS, frame=FRAME),
    "waypoints in mm": document(
        **WAYPOINTS,
        positions_mm=(1e3 * np.array(POINTS)).tolist(),
        frame={"position_mm": [450, 100, 400], "rpy_deg": [0, 0, 11]},
    ),
    "a matrix": document(
        **WAYPOINTS, positions=POINTS, frame=read_pose(FRAME).homogeneous.tolist()
    ),
    "a workpiece": {
        **document(**WAYPOINTS, positions=POINTS),
        "workpiece": {"frame": FRAME, "obstacles": [{**BOX, "position": [0.0, -0.5, 0.0]}]},
    },
    "an obstacle": {
        **document(kind="circle", radius=0.1, duration=4.0, start=START),
        "clearance": {"obstacles": [BOX]},
    },
    "an obstacle of the second clearance": {
        **document(kind="circle", radius=0.1, duration=4.0, start=START),
        "clearance": [{"distance": 0.002}, {"obstacles": [BOX]}],
    },
    "an obstacle on a link": {
        **document(kind="circle", radius=0.1, duration=4.0, start=START),
        "robot": {"name": "panda", "base": FRAME},
        "constraints": [
            {
                "kind": "Clearance",
                "obstacles": [{**BOX, "size": [0.02, 0.02, 0.02], "frame": "panda_link0"}],
            }
        ],
    },
}


def path_poses(problem: Any) -> list[SE3]:
    samples = problem.path.samples(np.linspace(0.0, problem.path.duration, 5))
    base = SE3(problem.follows.items[0].chain.base_placement)
    return [
        base * SE3(turn, place)
        for turn, place in zip(samples.rotation, samples.translation, strict=True)
    ]


def document_of(given: dict[str, Any]) -> Edited:
    """Return a document that is in no file."""
    edited = Edited.__new__(Edited)
    edited.document, edited._before, edited._past = copy.deepcopy(given), None, []
    return edited


def changed(given: dict[str, Any], name: str, shown: SE3) -> tuple[dict[str, Any], Any]:
    """Return a document after a drag, and its problem."""
    handle = handles_of(given, plan_request_of(given).problem)[name]
    edited = document_of(given)
    edited.change(dragged(given, handle, shown), final=True)
    return edited.document, plan_request_of(edited.document).problem


def all_drags() -> list[tuple[str, str]]:
    return [
        (case, name)
        for case, given in CASES.items()
        for name in handles_of(given, plan_request_of(given).problem)
    ]


@pytest.mark.parametrize(("case", "name"), all_drags())
def test_a_handle_is_where_it_was_dragged_to(case: str, name: str) -> None:
    given = CASES[case]
    problem = plan_request_of(given).problem
    handle = handles_of(given, problem)[name]
    before = handle.prefix * handle.pose
    by = BY if handle.turns else SE3(np.eye(3), BY.translation)
    by = by if handle.moves else SE3(BY.rotation, np.zeros(3))
    wanted = SE3(before.rotation @ by.rotation, before.translation + by.translation)
    document, after = changed(given, name, wanted)
    now = handles_of(document, after)[name]
    # A tool that is turned stays where it was: its place is that of the flange.
    found = now.prefix * now.pose
    np.testing.assert_allclose(found.homogeneous, wanted.homogeneous, atol=NEAR)
    if handle.kind in ("part", "path"):
        one, other = path_poses(problem)[0], path_poses(after)[0]
        moves = wanted * before.inverse() if handle.kind == "part" else None
        expected = wanted if moves is None else moves * one
        np.testing.assert_allclose(other.homogeneous, expected.homogeneous, atol=NEAR)
    if handle.kind == "waypoint":
        times = np.array(given["path"]["t"])
        places = after.path.samples(times).translation
        k = int(name.split()[1]) - 1
        np.testing.assert_allclose(places[k], wanted.translation, atol=NEAR)


@pytest.mark.parametrize("case", CASES)
def test_a_handle_that_was_not_moved_changes_nothing(case: str) -> None:
    given = CASES[case]
    for name, handle in handles_of(given, plan_request_of(given).problem).items():
        document, _ = changed(given, name, handle.prefix * handle.pose)
        assert document == given, name


def test_a_long_drag_ends_where_a_short_one_does() -> None:
    """Handles are those of the plan that was shown when it began; the document moves on."""
    for case in ("a circle about a center", "a line"):
        given = CASES[case]
        handle = handles_of(given, plan_request_of(given).problem)["path"]
        shown = handle.prefix * handle.pose * BY
        halfway = SE3(shown.rotation, shown.translation + np.array([0.1, 0.0, 0.0]))
        edited = document_of(given)
        for pose in (halfway, shown):
            edited.change(dragged(edited.document, handle, pose), final=False)
        direct = changed(given, "path", shown)[1].path
        times = np.linspace(0.0, direct.duration, 5)
        found = plan_request_of(edited.document).problem.path.samples(times)
        np.testing.assert_allclose(
            found.translation, direct.samples(times).translation, atol=2.0 * NEAR
        )


def test_a_start_that_does_not_fit_any_more_becomes_free() -> None:
    home = {**document(kind="circle", radius=0.1, duration=4.0), "start": "home"}
    problem = plan_request_of(home).problem
    handles = handles_of(home, problem)
    for name, expected in (("path", "free"), ("base", "home"), ("tool", "home")):
        handle = handles[name]
        shown = handle.prefix * handle.pose * BY
        assert changed(home, name, shown)[0]["start"] == expected, name


def test_poses_are_written_as_the_document_does() -> None:
    moved = write_pose(
        {"position_mm": [1, 2, 3], "rpy_deg": [0, 0, 90], "name": "a"}, SE3.Identity()
    )
    assert moved == {"position_mm": [0.0, 0.0, 0.0], "name": "a"}
    kept = {"position": [0.0, 0.0, 0.0], "quaternion": [0.0, 1.0, 0.0, 0.0]}
    pose = read_pose(kept)
    pose.translation = np.array([0.1, 0.2, 0.3])
    assert write_pose(kept, pose) == {**kept, "position": [0.1, 0.2, 0.3]}


def test_sliders_are_what_the_document_says() -> None:
    given = {
        **CASES["an obstacle"],
        "costs": [
            {"kind": "JointVelocity", "weight": 2.0},
            {"kind": "InverseManipulability", "mu": 1},
        ],
        "relaxations": [{"rows": "z", "band_mm": 2.0}],
        "tolerance": {"position": 1e-5},
        "clearance": {"distance_mm": 5, "obstacles": [BOX]},
    }
    found = sliders_of(given, given)
    assert {name: (one.value, one.unit) for name, one in found.items()} == {
        "duration": (4.0, "s"),
        "clearance": (5.0, "mm"),
        "clearance from post": (5.0, "mm"),
        "tolerance of position": (1e-5, "m"),
        "band of z": (2.0, "mm"),
        "weight of JointVelocity": (2.0, ""),
        "weight of InverseManipulability": (1.0, ""),
    }
    for slider in found.values():
        assert slider.low <= slider.value <= slider.high
    assert "clearance" not in sliders_of({**given, "clearance": False}, given)
    several = {**given, "clearance": [{"distance_mm": 5}, {"distance": 0.01, "obstacles": [BOX]}]}
    keys = [slider.keys for slider in sliders_of(several, several).values()]
    assert ("clearance", 0, "distance_mm") in keys
    assert ("clearance", 1, "distance") in keys


def test_costs_of_one_kind_have_a_slider_each() -> None:
    costs = [
        {"kind": "JointVelocity", "weight": 2.0},
        {"kind": "JointVelocity", "weight": 3.0, "name": "calm"},
    ]
    given = {**CASES["an obstacle"], "costs": costs}
    found = sliders_of(given, given)
    assert found["weight of JointVelocity"].keys == ("costs", 0, "weight")
    assert found["weight of calm"].keys == ("costs", 1, "weight")


@pytest.mark.parametrize("name", ["part", "base", "tool"])
def test_a_body_that_is_called_as_another_handle_takes_none_away(name: str) -> None:
    given = copy.deepcopy(CASES["a workpiece"])
    given["workpiece"]["obstacles"][0]["name"] = name
    found = handles_of(given, plan_request_of(given).problem)
    assert found[name].kind == name
    body = found[f"obstacle {name}"]
    assert (body.name, body.kind) == (f"obstacle {name}", "obstacle")
    assert body.nodes == (f"/selfmotion/plan0/obstacles/{name}",)
