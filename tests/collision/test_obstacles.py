"""Obstacles: values that cannot be broken, and the way into files and back."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import coal
import numpy as np
import pinocchio as pin
import pytest

from selfmotion.basics import CollisionError
from selfmotion.model.collision import (
    Box,
    Capsule,
    CollisionModel,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
    obstacle_from_dict,
    obstacles as module,
)
from selfmotion.model.robot import load_robot
from selfmotion.shell.replay import scene
from selfmotion.shell.replay.meshes import Payload

POSE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 1.1), np.array([0.1, 0.2, 0.3]))


ALL = [
    Box("shelf", POSE, [0.1, 0.2, 0.3]),
    Sphere("ball", POSE, 0.1),
    Cylinder("post", POSE, 0.1, 0.5),
    Capsule("rail", POSE, 0.1, 0.5),
    Mesh("part", POSE, Path("part.stl"), 0.001),
    Box("camera", POSE, [0.1, 0.2, 0.3], frame="wrist"),
]


@pytest.mark.parametrize("obstacle", ALL, ids=lambda obstacle: obstacle.shape)
def test_dict_round_trip_through_json_is_exact(obstacle: Obstacle) -> None:
    values = obstacle.to_dict()
    again = obstacle_from_dict(json.loads(json.dumps(values)))
    assert type(again) is type(obstacle)
    assert again.to_dict() == values


def test_position_alone_is_a_pose_along_the_world_axes() -> None:
    box = Box("box", [1.0, 2.0, 3.0], [1, 1, 1])
    assert box.pose == pin.SE3(np.eye(3), np.array([1.0, 2.0, 3.0]))
    same = obstacle_from_dict(
        {"shape": "box", "name": "box", "position": [1, 2, 3], "size": [1, 1, 1]}
    )
    assert same.to_dict() == box.to_dict()


def test_a_length_is_at_most_a_thousand_kilometres() -> None:
    """More is a wrong unit, and beyond what distances resolve."""
    assert Sphere("large", POSE, 1e6).radius == 1e6
    with pytest.raises(CollisionError, match="radius"):
        Sphere("larger", POSE, 1.001e6)


def test_values_are_copies_that_cannot_be_written() -> None:
    pose, size = pin.SE3(POSE), np.ones(3)
    box = Box("box", pose, size)
    pose.translation[0] = size[0] = 9.0
    assert box.pose == POSE
    assert box.size[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        box.size[0] = 2.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Box("", POSE, [1, 1, 1]), "box: has name ''"),
        (lambda: Box("b", POSE, [1, 0, 1]), "box 'b': size is"),
        (lambda: Box("b", POSE, [1, 1]), "box 'b': size is"),
        (lambda: Box("b", POSE, [1, np.inf, 1]), r"box 'b': size\[1\] is inf"),
        (lambda: Box("b", [1, 2], [1, 1, 1]), "box 'b': pose is"),
        (lambda: Box("b", [1, 2, np.nan], [1, 1, 1]), r"box 'b': pose\[2\] is nan"),
        (lambda: Box("b", pin.SE3(2 * np.eye(3), np.zeros(3)), [1, 1, 1]), "not orthonormal"),
        (lambda: Box("b", pin.SE3(-np.eye(3), np.zeros(3)), [1, 1, 1]), "a mirror .determinant -1"),
        (lambda: Sphere("s", POSE, -1.0), "sphere 's': radius is -1.0"),
        (lambda: Cylinder("c", POSE, 1.0, np.nan), "cylinder 'c': length is nan"),
        (lambda: Capsule("c", POSE, "wide", 1.0), "capsule 'c': radius is 'wide'"),
        (lambda: Mesh("m", POSE, "a.stl", 0.0), "mesh 'm': scale is 0.0"),
    ],
)
def test_refuses_values_that_describe_nothing(make, message: str) -> None:
    with pytest.raises(CollisionError, match=message):
        make()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape": "torus"}, "shape is 'torus', expected one of box, sphere"),
        ({"size": None}, "size is None"),
        ({"radius": 1.0}, "has 'radius', expected frame, size"),
        ({"position": [1, 2]}, r"position has shape \(2,\)"),
        ({"rotation": "up"}, r"rotation \(\)"),
    ],
)
def test_refuses_broken_dicts(change: dict, message: str) -> None:
    with pytest.raises(CollisionError, match=message):
        obstacle_from_dict(ALL[0].to_dict() | change)


@pytest.mark.parametrize("key", ["shape", "name", "position", "size"])
def test_refuses_dicts_with_a_key_missing(key: str) -> None:
    values = ALL[0].to_dict()
    del values[key]
    with pytest.raises(CollisionError):
        obstacle_from_dict(values)


def test_an_own_shape_is_one_class(monkeypatch: pytest.MonkeyPatch) -> None:
    """It goes into files and back, is measured, and needs no other place to know it."""
    monkeypatch.setattr(module, "_shapes", dict(module._shapes))

    @dataclass(frozen=True, eq=False)
    class Cone(Obstacle):
        shape: ClassVar[str] = "cone"
        radius: float
        length: float

        def geometry(self) -> Any:
            return coal.Cone(self.radius, self.length)

    cone = Cone("hat", [0.0, 0.0, 3.0], 0.2, 0.5)
    again = obstacle_from_dict(json.loads(json.dumps(cone.to_dict())))
    assert isinstance(again, Cone)
    assert again.to_dict() == cone.to_dict()
    panda = load_robot("panda")
    upright = np.zeros(7)
    over = CollisionModel(panda, [cone])
    ball = CollisionModel(panda, [Sphere("hat", [0.0, 0.0, 3.0], 1e-6)])
    names = [pair for pair in over.pairs if pair[1] == "hat"]
    first, second = (model.distances(upright[None])[0] for model in (over, ball))
    hat = np.array([over.pairs.index(name) for name in names])
    dot = np.array([ball.pairs.index(name) for name in names])
    # The cone's base is 0.25 m below its middle.
    assert first[hat].min() == pytest.approx(second[dot].min() - 0.25, abs=0.05)
    drawn = scene.obstacle_commands("/plan", panda, [cone], Payload())
    assert [command["path"] for command in drawn] == ["/plan/obstacles/hat/0"]


def test_a_shape_has_one_class() -> None:
    for name in ("box", ""):
        with pytest.raises(CollisionError, match="expected a name that no other obstacle has"):
            type("Crate", (Obstacle,), {"shape": name})


def test_an_obstacle_without_geometry_is_no_class(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_shapes", dict(module._shapes))
    with pytest.raises(TypeError, match="geometry"):
        type("Ghost", (Obstacle,), {"shape": "ghost"})("ghost", POSE)


def test_refuses_a_shape_without_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_shapes", dict(module._shapes))
    body = {"shape": "half space", "geometry": lambda self: coal.Halfspace(0.0, 0.0, 1.0, 0.0)}
    half = type("Half", (Obstacle,), body)("ground", POSE)
    with pytest.raises(CollisionError, match=r"half space 'ground': it reaches"):
        CollisionModel(load_robot("panda"), [half])
