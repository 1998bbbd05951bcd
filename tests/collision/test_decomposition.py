"""Convex pieces of meshes: together they contain the solid, and its hollows stay free."""

from pathlib import Path

import manifold3d
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial import ConvexHull

from selfmotion.model.collision import Box, ClearanceModel, CollisionModel, Mesh, Solid
from selfmotion.model.collision.decomposition import MAX_PIECES, convex_pieces
from selfmotion.model.robot import load_robot
from support.arms import PANDA_HOME

# What rounding may leave of a point outside of all pieces, as a share of the size.
ROUNDING = 1e-6
# Two distances of coal may differ by this [m], and central differences of them by that.
GJK, DIFFERENCE = 2e-6, 1e-3


def bar(corner, size) -> trimesh.Trimesh:
    middle = np.asarray(corner, dtype=float) + 0.5 * np.asarray(size, dtype=float)
    return trimesh.creation.box(size).apply_translation(middle)


def joined(parts) -> trimesh.Trimesh:
    whole = parts[0]
    for part in parts[1:]:
        whole = trimesh.boolean.union([whole, part], engine="manifold")
    return whole


def window(thickness: float = 0.1) -> list[trimesh.Trimesh]:
    """Four bars round a window of 0.8 m."""
    return [
        bar((0, 0, 0), (1, 0.1, thickness)),
        bar((0, 0.9, 0), (1, 0.1, thickness)),
        bar((0, 0.1, 0), (0.1, 0.8, thickness)),
        bar((0.9, 0.1, 0), (0.1, 0.8, thickness)),
    ]


def room() -> trimesh.Trimesh:
    inner = bar((0.1, 0.1, 0.1), (2.8, 2.8, 2.8))
    inner.invert()
    return trimesh.util.concatenate([bar((0, 0, 0), (3, 3, 3)), inner])


def turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.3, 0.8), np.array([0.5, -0.4, 0.6]))
    return mesh.apply_transform(pose.homogeneous)


def inside_out(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.invert()
    return mesh


# Mesh, how many pieces at most, and the volume of their hulls at most, in volumes of the solid.
SOLIDS = {
    "a frame": (lambda: joined(window()), 4, 1.001),
    "a frame that is turned": (lambda: turned(joined(window())), 4, 1.001),
    "bars that touch": (lambda: trimesh.util.concatenate(window()), 4, 1.001),
    "a frame inside out": (lambda: inside_out(joined(window())), 4, 1.001),
    "a bracket with a rib": (
        lambda: joined(
            [
                bar((0, 0, 0), (0.2, 0.1, 0.01)),
                bar((0, 0, 0), (0.01, 0.1, 0.2)),
                bar((0, 0.045, 0), (0.1, 0.01, 0.1)),
            ]
        ),
        3,
        1.001,
    ),
    "a room": (room, 6, 1.01),
    "a pipe": (lambda: trimesh.creation.annulus(0.08, 0.1, 0.5, sections=24), 24, 1.3),
    "a ring": (
        lambda: trimesh.creation.torus(0.2, 0.04, major_sections=24, minor_sections=12),
        24,
        1.2,
    ),
    "many boxes": (
        lambda: trimesh.util.concatenate(
            [bar((i % 8, i // 8, 0), (0.5, 0.5, 0.5)) for i in range(48)]
        ),
        MAX_PIECES,
        2.5,
    ),
}


def planes_of(piece: np.ndarray) -> np.ndarray:
    return ConvexHull(piece).equations


@pytest.fixture(params=SOLIDS)
def solid(request) -> tuple[trimesh.Trimesh, tuple[np.ndarray, ...], int, float]:
    make, most, volume = SOLIDS[request.param]
    mesh = make()
    return mesh, convex_pieces(np.asarray(mesh.vertices), np.asarray(mesh.faces)), most, volume


def test_pieces_contain_the_solid_and_hardly_more(solid) -> None:
    """Points of its surface and of its inside, by trimesh's own hulls."""
    mesh, pieces, most, volume = solid
    assert 1 < len(pieces) <= most
    surface, _ = trimesh.sample.sample_surface(mesh, 2000, seed=1)
    points = np.concatenate([surface, mesh.vertices])
    outside = np.min(
        [(points @ p[:, :3].T + p[:, 3]).max(axis=1) for p in map(planes_of, pieces)], axis=0
    )
    assert outside.max() <= ROUNDING * mesh.extents.max()
    assert sum(ConvexHull(piece).volume for piece in pieces) <= volume * abs(mesh.volume)
    assert left_of(mesh, pieces) <= ROUNDING * abs(mesh.volume)


def left_of(mesh: trimesh.Trimesh, pieces) -> float:
    """What is left of a solid when the pieces are taken away [m³]."""
    faces = np.asarray(mesh.faces)[:, ::-1] if mesh.volume < 0.0 else np.asarray(mesh.faces)
    soup = np.asarray(mesh.vertices)[faces].reshape(-1, 3)
    closed = manifold3d.Mesh64(soup, np.arange(len(soup), dtype=np.uint64).reshape(-1, 3))
    closed.merge()
    rest = manifold3d.Manifold(closed)
    for piece in pieces:
        rest -= manifold3d.Manifold.hull_points(piece)
    return abs(rest.volume())


def test_the_same_mesh_has_the_same_pieces(solid) -> None:
    mesh, pieces, _, _ = solid
    again = convex_pieces(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert len(again) == len(pieces)
    assert all(np.array_equal(a, b) for a, b in zip(again, pieces, strict=True))


def test_the_order_of_pieces_is_that_of_the_parts_of_the_mesh() -> None:
    """Whichever of them is nearest to convex: a dent of a millimetre or two is none to cut."""

    def dented(corner: float, size: float) -> trimesh.Trimesh:
        notch = bar((corner + 0.05, 0.05, 0.1 - size), (size, size, size + 0.1))
        bars = [bar((corner, 0.0, 0.0), (0.1, 0.1, 0.1)), notch]
        return trimesh.boolean.difference(bars, engine="manifold")

    for sizes in ((1e-3, 2e-3), (2e-3, 1e-3)):
        two = trimesh.util.concatenate(
            [dented(x, size) for x, size in zip((0, 1), sizes, strict=True)]
        )
        pieces = convex_pieces(np.asarray(two.vertices), np.asarray(two.faces))
        assert [round(float(piece[:, 0].min()), 9) for piece in pieces] == [0.0, 1.0]


def read(mesh: trimesh.Trimesh, file: Path) -> Solid:
    mesh.export(file)
    return Solid(Mesh("part", [0.0] * 3, file).geometry(), "part")


def test_pieces_that_leave_something_out_are_not_taken(tmp_path, monkeypatch) -> None:
    whole = read(joined(window()), tmp_path / "whole.stl")
    assert len(whole.pieces) == 4
    cut = "selfmotion.model.collision.decomposition.convex_pieces"
    monkeypatch.setattr(cut, lambda *mesh: convex_pieces(*mesh)[1:])
    another = read(joined(window(0.2)), tmp_path / "another.stl")
    assert another.pieces == (another,)


def test_an_open_mesh_is_not_cut(tmp_path) -> None:
    mesh = joined(window())
    assert convex_pieces(np.asarray(mesh.vertices), np.asarray(mesh.faces)[4:]) == ()
    mesh.update_faces(np.arange(len(mesh.faces)) > 3)
    opened = read(mesh, tmp_path / "open.stl")
    assert opened.pieces == (opened,)


def test_manifold_keeps_its_promises() -> None:
    """A box cut in two has two closed halves of half its volume: what cutting rests on."""
    halves = manifold3d.Manifold.cube((1.0, 1.0, 1.0)).split_by_plane((1.0, 0.0, 0.0), 0.5)
    assert [half.volume() for half in halves] == pytest.approx([0.5, 0.5])


@pytest.fixture(scope="module")
def through_a_window(tmp_path_factory) -> tuple[CollisionModel, ClearanceModel]:
    """A Panda whose forearm is in a window of 0.8 m, and the models of the two."""
    file = tmp_path_factory.mktemp("window") / "window.stl"
    joined(window()).export(file)
    panda = load_robot("panda")
    # Upright, its middle where the hand is.
    upright = pin.rpy.rpyToMatrix(np.pi / 2, 0.0, np.pi / 2)
    middle = panda.pose(PANDA_HOME).translation - upright @ np.array([0.5, 0.5, 0.05])
    exact = CollisionModel(panda, [Mesh("window", pin.SE3(upright, middle), file)])
    return exact, ClearanceModel(exact, near=0.3, width=0.1)


def near_home(count: int) -> np.ndarray:
    return PANDA_HOME + np.random.default_rng(3).uniform(-0.3, 0.3, (count, 7))


def test_distances_are_those_of_the_bars(through_a_window) -> None:
    """As if its four bars were given one by one; never more than those of the meshes."""
    exact, model = through_a_window
    assert not model.left_out
    (shape,) = exact.obstacles
    boxes = [
        Box(
            f"bar {k}",
            pin.SE3(shape.pose.rotation, shape.pose.act(each.bounds.mean(axis=0))),
            each.extents,
        )
        for k, each in enumerate(window())
    ]
    of_bars = ClearanceModel(CollisionModel(exact.robot, boxes), near=0.3, width=0.1)
    q = near_home(20)
    # Levelled off values are below the distances, too.
    found, bars, true = model.clearances(q).values, of_bars.clearances(q).values, exact.distances(q)
    for k, (link, other) in enumerate(exact.pairs):
        nearest = found[:, [pair == (link, other) for pair in model.pairs]].min(axis=1)
        assert np.all(nearest <= true[:, k] + GJK)
        if other == "window":
            columns = [pair[0] == link and pair[1].startswith("bar") for pair in of_bars.pairs]
            assert nearest == pytest.approx(bars[:, columns].min(axis=1), abs=GJK)
    # The hull of the window is hit where the window is not.
    hull = exact.pairs.index(("panda_hand", "window"))
    exact.hulls.place(q[0])
    assert exact.hulls.distance(hull, -0.5) < 0.0 < true[0, hull]


def test_the_gradient_of_pieces_is_the_central_difference(through_a_window) -> None:
    _, model = through_a_window
    q, step = near_home(4), 1e-6
    slopes = model.clearances(q).jacobian()
    for joint, unit in enumerate(np.eye(7)):
        ahead, behind = (model.clearances(q + sign * step * unit).values for sign in (1.0, -1.0))
        off = np.abs((ahead - behind) / (2.0 * step) - slopes[:, :, joint])
        # Where closest points jump, and where bodies overlap (EPA), differences are not to be had.
        assert np.quantile(off, 0.99) < DIFFERENCE


def test_a_piece_moves_with_its_body(tmp_path) -> None:
    joined(window()).export(tmp_path / "window.stl")
    panda = load_robot("panda")
    there, here = (pin.SE3(np.eye(3), np.array([0.3, y, 0.3])) for y in (5.0, -0.5))
    far, near = (
        ClearanceModel(CollisionModel(panda, [Mesh("window", place, tmp_path / "window.stl")]), 0.5)
        for place in (there, here)
    )
    q = near_home(5)
    far.move("window", here)
    assert far.clearances(q).values == pytest.approx(near.clearances(q).values)
