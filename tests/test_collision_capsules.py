"""Capsules around the links: they contain every vertex, and are no larger than they need be."""

import dataclasses
import os
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from selfmotion.collision.capsules import LinkCapsule, link_capsules
from selfmotion.collision.fit import fit
from selfmotion.collision.outlines import Outline, outline
from selfmotion.robot import NAMED_ARMS, RobotModel, load_robot

# Rounding of coordinates below 10 m [m].
ROUNDING = 1e-12


def solids(robot: RobotModel) -> dict[str, np.ndarray]:
    """Points of the collision geometry of each link in its joint's axes, from coal alone."""
    found: dict[str, list[np.ndarray]] = {}
    for piece in robot.geometry(pin.GeometryType.COLLISION).geometryObjects:
        points = surface(piece.geometry) @ piece.placement.rotation.T + piece.placement.translation
        found.setdefault(robot.model.frames[piece.parentFrame].name, []).append(points)
    return {link: np.concatenate(parts) for link, parts in found.items()}


def surface(geometry) -> np.ndarray:
    """Vertices and centres of the triangles; points all over other shapes."""
    if isinstance(geometry, coal.BVHModelBase):
        vertices = geometry.vertices()
        corners = [geometry.tri_indices(i) for i in range(0, geometry.num_tris, 7)]
        faces = [[corner[k] for k in range(3)] for corner in corners]
        return np.concatenate([vertices, vertices[faces].mean(axis=1)])
    if isinstance(geometry, coal.Box):
        return np.array(trimesh.creation.box(2.0 * geometry.halfSide).vertices)
    if isinstance(geometry, coal.Sphere):
        return np.array(trimesh.creation.icosphere(radius=geometry.radius).vertices)
    assert isinstance(geometry, coal.Cylinder)
    return np.array(
        trimesh.creation.cylinder(geometry.radius, 2.0 * geometry.halfLength, 100).vertices
    )


def outside(capsules: list[LinkCapsule], points: np.ndarray) -> float:
    """How far the worst point is outside all capsules [m]."""
    return float(np.min([reach(capsule, points) for capsule in capsules], axis=0).max())


def reach(capsule: LinkCapsule, points: np.ndarray) -> np.ndarray:
    """How far points are outside one capsule, by their place along and aside of its axis."""
    half = np.linalg.norm(capsule.half)
    axis = capsule.half / half if half > 0 else np.zeros(3)
    offset = points - capsule.middle
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    return np.hypot(aside, np.maximum(np.abs(along) - half, 0.0)) - capsule.radius


@pytest.mark.parametrize("name", NAMED_ARMS)
def test_capsules_contain_the_geometry_of_every_link(name: str) -> None:
    robot = load_robot(name)
    capsules = link_capsules(robot)
    for link, points in solids(robot).items():
        own = [capsule for capsule in capsules if capsule.link == link]
        assert outside(own, points) <= ROUNDING
    assert {capsule.link for capsule in capsules} == set(solids(robot))


def test_a_shrunk_capsule_fails_the_containment_test() -> None:
    robot = load_robot("panda")
    capsule = next(c for c in link_capsules(robot) if c.link == "panda_link3")
    points = solids(robot)["panda_link3"]
    shrunk = dataclasses.replace(capsule, radius=capsule.radius - 1e-6)
    assert outside([capsule], points) <= ROUNDING
    assert outside([shrunk], points) > 0.9e-6


def test_panda_links_are_wrapped_tightly() -> None:
    """Less than 2.5 times the volume of the convex hull; a cube's best capsule takes 2.7."""
    robot = load_robot("panda")
    capsules = link_capsules(robot)
    for link, points in solids(robot).items():
        volume = sum(capsule.volume for capsule in capsules if capsule.link == link)
        assert volume < 2.5 * trimesh.convex.convex_hull(points).volume


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (coal.Sphere(0.1), [0.0, 0.1]),
        (coal.Capsule(0.1, 0.5), [0.25, 0.1]),
    ],
    ids=["sphere", "capsule"],
)
def test_round_shapes_are_fitted_as_they_are(shape, expected: list[float]) -> None:
    (capsule,) = fit(outline(shape))
    found = [np.linalg.norm(capsule[3:6]), capsule[6]]
    # Nelder-Mead stops within 1e-4 of the minimum's place.
    assert found == pytest.approx(expected, abs=1e-3)


def test_a_long_plate_takes_several_capsules_that_contain_its_surface() -> None:
    """Between vertices too: the triangles that a cut passes are cut."""
    plate = trimesh.creation.box([1.0, 0.4, 0.05])
    edges = np.array(plate.edges_unique)
    rows = fit(Outline(np.array(plate.vertices), np.zeros(8), edges))
    assert len(rows) > 1
    capsules = [LinkCapsule("plate", 1, row[:3], row[3:6], row[6]) for row in rows]
    points, _ = trimesh.sample.sample_surface(plate, 2000, seed=0)
    assert outside(capsules, np.array(points)) <= ROUNDING


def test_fits_are_kept_and_a_damaged_file_is_replaced(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot = load_robot("ur10")
    first = link_capsules(robot)
    files = sorted(tmp_path.rglob("capsules-*.npy"))
    assert len(files) == len({capsule.link for capsule in first})
    files[0].write_bytes(b"damaged")
    np.save(files[1], np.full((1, 7), np.nan))
    again = link_capsules(robot)
    assert [c.radius for c in again] == [c.radius for c in first]
    assert np.isfinite(np.load(files[1])).all()


def test_fits_need_no_cache_folder(monkeypatch, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("XDG_CACHE_HOME", os.fspath(blocked))
    assert len(link_capsules(load_robot("ur10"))) > 0
