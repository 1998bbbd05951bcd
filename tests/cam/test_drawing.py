"""DXF drawings in: strokes are what ezdxf wrote, within the deviation that is stated."""

import sys
from collections.abc import Callable
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shop.cam.drawing import _GAP_TOLERANCE, _joined_ends, read_drawing
from support.shell import complaint as refused

# What chords may be off curves [m], as the docs say; rounding of a drawing in mm.
CHORD, ROUNDING = 1e-5, 1e-12


def drawn(file: Path, draw: Callable[[Any], None], units: int = 4) -> Path:
    document = ezdxf.new("R2010", units=units)
    draw(document.modelspace())
    document.saveas(file)
    return file


def rows_of(tmp_path: Path, draw: Callable[[Any], None], **options: Any) -> dict[str, Any]:
    return dict(read_drawing(drawn(tmp_path / "part.dxf", draw, **options)))


def test_lines_and_polylines_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    flat, spatial = rng.uniform(-300.0, 300.0, (7, 2)), rng.uniform(-300.0, 300.0, (5, 3))

    def draw(space: Any) -> None:
        space.add_lwpolyline(flat, close=True, dxfattribs={"layer": "flat"})
        space.add_polyline3d(spatial, dxfattribs={"layer": "spatial"})
        space.add_polyline2d(flat, dxfattribs={"layer": "old", "elevation": (0, 0, 7)})
        space.add_line((1, 2, 3), (4, 5, 6), dxfattribs={"layer": "one"})

    found = rows_of(tmp_path, draw)
    assert list(found) == ["flat", "spatial", "old", "one"]
    closed = np.column_stack([flat, np.zeros(7)])[[*range(7), 0]]
    expected = [closed, spatial, np.column_stack([flat, np.full(7, 7.0)]), [[1, 2, 3], [4, 5, 6]]]
    for rows, points in zip(found.values(), expected, strict=True):
        np.testing.assert_allclose(rows.positions, 1e-3 * np.array(points), atol=ROUNDING)
        assert rows.straight
        np.testing.assert_allclose(rows.values[:, :, 2], np.tile([0, 0, -1], (len(points), 1)))


@pytest.mark.parametrize(("number", "metres"), [(1, 0.0254), (4, 1e-3), (5, 1e-2), (6, 1.0)])
def test_units_are_those_of_the_drawing(tmp_path: Path, number: int, metres: float) -> None:
    found = rows_of(tmp_path, lambda s: s.add_line((0, 0), (3, 4)), units=number)
    assert np.linalg.norm(found["0"].positions[1]) == pytest.approx(5.0 * metres)


@pytest.mark.parametrize("number", [0, 17])
def test_a_drawing_without_a_unit_is_refused_until_it_is_said(tmp_path: Path, number: int) -> None:
    said = rf"part\.dxf: says no unit .*\$INSUNITS is {number}.*unit = 'mm'.* mm, cm, dm"
    with pytest.raises(sm.errors.FileFormatError, match=said):
        rows_of(tmp_path, lambda s: s.add_line((0, 0), (3, 4)), units=number)
    for unit, length in (("mm", 0.005), ("in", 5 * 0.0254)):
        path = sm.files.read_path(tmp_path / "part.dxf", unit=unit, feed=0.1, jump=2.0)
        first, last = path.evaluate(np.array([0.0, path.duration])).translation
        assert np.linalg.norm(last - first) == pytest.approx(length)
    line = refused("plan", "panda", "--path", tmp_path / "part.dxf", "--feed", "0.1")
    assert "--set path.unit=mm" in line


def test_a_unit_that_is_said_counts_more_than_that_of_the_file(tmp_path: Path) -> None:
    file = drawn(tmp_path / "part.dxf", lambda s: s.add_line((0, 0), (3, 4)), units=6)
    found = read_drawing(file, unit="mm")
    assert np.linalg.norm(found["0"].positions[1]) == pytest.approx(5e-3)
    with pytest.raises(sm.errors.FileFormatError, match=r"jumps by 5 m .*if \$INSUNITS is wrong"):
        sm.files.read_path(file, feed=0.1)
    with pytest.raises(sm.errors.FileFormatError, match=r"unit is 'inch', expected one of: 'mm'"):
        sm.files.read_path(file, unit="inch")
    with pytest.raises(sm.errors.FileFormatError, match=r"slot\.nc: unit has no effect"):
        sm.files.read_path("slot.nc", unit="mm")


def off_circle(points: np.ndarray, centre: tuple[float, float], radius: float) -> float:
    """Return how far chords (N, 3) are off a circle at most: at corners or middles."""
    looked = np.concatenate([points, 0.5 * (points[1:] + points[:-1])])[:, :2]
    return float(np.abs(np.linalg.norm(looked - centre, axis=1) - radius).max())


@pytest.mark.parametrize("radius", [0.004, 1.0, 60.0, 900.0])
def test_chords_keep_to_circles(tmp_path: Path, radius: float) -> None:
    def draw(space: Any) -> None:
        space.add_circle((30, 40), radius, dxfattribs={"layer": "circle"})
        space.add_arc((30, 40), radius, 300, 80, dxfattribs={"layer": "arc"})
        bulged = [(30 - radius, 40, 1.0), (30 + radius, 40, -0.3), (30 + 3 * radius, 40, 0)]
        space.add_lwpolyline(bulged, format="xyb", dxfattribs={"layer": "bulge"})

    found, metres = rows_of(tmp_path, draw), 1e-3 * radius
    if metres < CHORD:
        assert not found.get("circle"), "all of it is within what counts as a gap"
        return
    for name in ("circle", "arc"):
        assert off_circle(found[name].positions, (0.03, 0.04), metres) < CHORD
    np.testing.assert_allclose(*found["circle"].positions[[0, -1]], atol=ROUNDING)
    # Counter-clockwise below the centre, then clockwise above, through all corners in turn.
    bulge = found["bulge"].positions
    corner = int(np.linalg.norm(bulge - [0.03 + metres, 0.04, 0.0], axis=1).argmin())
    np.testing.assert_allclose(bulge[0], [0.03 - metres, 0.04, 0.0], atol=1e-9)
    assert off_circle(bulge[: corner + 1], (0.03, 0.04), metres) < CHORD
    assert bulge[:corner, 1].max() <= 0.04 + 1e-9 <= bulge[corner:, 1].max()
    # Half of the chords would not do: the check sees what is coarser than it is said to be.
    assert off_circle(found["circle"].positions[::2], (0.03, 0.04), metres) > CHORD or radius < 2


def off_polygon(points: np.ndarray, chords: np.ndarray) -> float:
    """Return how far points (K, 3) are off the nearest chord at most."""
    begins, legs = chords[:-1], np.diff(chords, axis=0)
    squares = (legs * legs).sum(axis=1)
    worst = 0.0
    for point in points:
        shares = np.clip(((point - begins) * legs).sum(axis=1) / squares, 0.0, 1.0)
        away = np.linalg.norm(begins + shares[:, None] * legs - point, axis=1)
        worst = max(worst, float(away.min()))
    return worst


def test_chords_keep_to_splines_and_ellipses(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    controls = [rng.uniform(0.0, 400.0, (count, 3)) for count in (4, 6, 9)]
    # It bends both ways alike, so that its middle is on its chord.
    controls.append(np.array([[0, 0, 0], [1000 / 3, 500, 0], [2000 / 3, -500, 0], [1000, 0, 0]]))
    weights = rng.uniform(0.3, 3.0, 6)

    def draw(space: Any) -> None:
        for k, points in enumerate(controls):
            space.add_open_spline(points, dxfattribs={"layer": f"spline{k}"})
        space.add_rational_spline(controls[1], weights, dxfattribs={"layer": "rational"})
        space.add_spline(fit_points=controls[2], dxfattribs={"layer": "fit"})
        space.add_ellipse((10, 20), (200, 50), 0.2, 0.4, 5.0, dxfattribs={"layer": "ellipse"})

    file = drawn(tmp_path / "curves.dxf", draw)
    found = read_drawing(file)
    for entity in ezdxf.readfile(file).modelspace():
        tool = entity.construction_tool()
        if entity.dxftype() == "ELLIPSE":
            true = tool.vertices(np.linspace(tool.start_param, tool.end_param, 1500))
        else:
            true = tool.points(np.linspace(0.0, tool.max_t, 1500))
        true = 1e-3 * np.array([tuple(point) for point in true])
        chords = found[entity.dxf.layer].positions
        assert off_polygon(true, chords) < CHORD, entity.dxf.layer
        np.testing.assert_allclose(chords[[0, -1]], true[[0, -1]], atol=1e-9)
        assert off_polygon(true, chords[[*range(0, len(chords) - 1, 2), -1]]) > CHORD


def test_ends_that_meet_are_joined_whatever_their_order_and_direction(tmp_path: Path) -> None:
    corners = np.array([[0, 0], [50, 0], [50, 30], [20, 60], [-10, 30]], dtype=float)
    rng = np.random.default_rng(2)
    for _ in range(10):
        legs = list(pairwise(corners))
        legs = [leg if rng.random() < 0.5 else leg[::-1] for leg in legs]
        legs = [legs[k] for k in rng.permutation(len(legs))]

        def draw(space: Any, legs: list[Any] = legs) -> None:
            for begin, end in legs:
                # Within what ends may be off each other.
                space.add_line(begin + rng.uniform(-0.004, 0.004, 2), end)

        (rows,) = rows_of(tmp_path, draw).values()
        assert len(rows.positions) == len(corners)
        begin = int(np.linalg.norm(corners - 1e3 * rows.positions[0, :2], axis=1).argmin())
        order = corners if begin == 0 else corners[::-1]
        np.testing.assert_allclose(1e3 * rows.positions[:, :2], order, atol=0.01)
        # The stroke goes as its first leg does.
        places = [1e-3 * np.append(point, 0.0) for point in legs[0]]
        first, last = (
            int(np.linalg.norm(rows.positions - place, axis=1).argmin()) for place in places
        )
        assert last == first + 1


def test_gaps_forks_and_circles_part_strokes(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        space.add_line((0, 0), (10, 0))
        space.add_line((10.02, 0), (20, 0))  # a gap of 0.02 mm
        space.add_circle((50, 50), 5)
        for end in ((110, 0), (90, 10), (90, -10)):  # three ends in one place
            space.add_line((100, 0), end)
        space.add_lwpolyline([(200, 0), (210, 0), (210, 10)], dxfattribs={"layer": "other"})
        space.add_line((200, 0), (210, 10), dxfattribs={"layer": "other"})  # closes it

    found = rows_of(tmp_path, draw)
    assert list(found) == [*(f"0 {k}" for k in range(1, 7)), "other"]
    other = found["other"].positions
    np.testing.assert_allclose(other[0], other[-1], atol=ROUNDING)
    assert len(other) == 4


def test_what_is_not_read_is_named_and_hidden_layers_are_not_read(tmp_path: Path) -> None:
    document = ezdxf.new(units=4)
    space = document.modelspace()
    space.add_line((0, 0), (100, 0), dxfattribs={"layer": "Weld"})
    fill = space.add_solid([(0, 0), (1, 0), (0, 1)], dxfattribs={"layer": "notes"})
    space.add_text("weld here", dxfattribs={"layer": "notes"})
    space.add_point((3, 3), dxfattribs={"layer": "Weld"})
    document.layers.add("Weld")
    notes = document.layers.add("notes")
    file = tmp_path / "part.dxf"
    document.saveas(file)
    with pytest.raises(
        sm.errors.FileFormatError, match=f"'notes': SOLID {fill.dxf.handle} is not read"
    ):
        sm.files.read_path(file, feed=0.1)
    for hide in (notes.off, notes.freeze):
        hide()
        document.saveas(file)
        assert sm.files.read_path(file, feed=0.1, seam="Weld").duration > 1.0
        notes.on()
    # Texts and marks move nothing.
    space.delete_entity(fill)
    notes.thaw()
    document.saveas(file)
    path = sm.files.read_path(file, feed=0.1)
    assert path.duration > 1.0
    assert "passed over: 1 POINT, 1 TEXT" in path.notes
    document.layers.get("Weld").off()
    document.saveas(file)
    with pytest.raises(sm.errors.FileFormatError, match="nothing drawn in model space"):
        sm.files.read_path(file, feed=0.1)


def test_beside_the_layer_of_a_seam_anything_may_be_drawn(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        for y in (0, 10):
            space.add_line((0, y), (60, y), dxfattribs={"layer": "weld"})
        space.add_line((0, 50), (60, 50), dxfattribs={"layer": "glue"})
        space.add_solid([(0, 0), (1, 0), (0, 1)], dxfattribs={"layer": "notes"})

    file = drawn(tmp_path / "part.dxf", draw)
    assert list(read_drawing(file, "glue")) == ["glue"]
    assert list(read_drawing(file, "weld 2")) == ["weld 1", "weld 2"]
    for seam, told in {
        "weld": "has no seam 'weld'; nearest: 'weld 2', 'weld 1'",
        "welt": "has no seam 'welt'; nearest: 'weld'",
        "7": "has no seam '7'; it has 'weld', 'glue', 'notes'",
        "notes": "layer 'notes': SOLID .* is not read",
    }.items():
        with pytest.raises(sm.errors.FileFormatError, match=told):
            sm.files.read_path(file, feed=0.05, seam=seam)
    with pytest.raises(sm.errors.FileFormatError, match=r"layer 'notes': SOLID .* is not read"):
        read_drawing(file)


def test_a_drawing_is_a_path_and_its_strokes_a_job(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        space.add_lwpolyline([(0, 0), (60, 0), (60, 40)], dxfattribs={"layer": "weld"})
        space.add_line((0, 80), (60, 80), dxfattribs={"layer": "glue"})

    file = drawn(tmp_path / "part.dxf", draw)
    with pytest.raises(
        sm.errors.FileFormatError, match="has 2 seams or cuts, weld to glue: choose one"
    ):
        sm.files.read_path(file, feed=0.05)
    with pytest.raises(sm.errors.FileFormatError, match="says no feed"):
        sm.files.read_path(file, seam="glue")
    path = sm.files.read_path(file, feed=0.05, seam="weld", tolerance=1e-3)
    ends = path.samples([0.0, path.duration])
    np.testing.assert_allclose(ends.translation, [[0, 0, 0], [0.06, 0.04, 0]], atol=1e-9)
    np.testing.assert_allclose(ends.rotation[:, :, 2], [[0, 0, -1]] * 2, atol=1e-12)
    # Its corner is rounded within the tolerance, as one of a machine's cut.
    through = path.samples(np.linspace(0.0, path.duration, 2001)).translation
    assert 1e-5 < np.linalg.norm(through - [0.06, 0, 0], axis=1).min() < 1.01e-3
    job = tmp_path / "job.toml"
    job.write_text(
        'task = "pointing"\n[robot]\nname = "panda"\n[seams]\nfile = "part.dxf"\nfeed_mm = 50\n'
        "frame = {position = [0.4, 0, 0.3]}\n"
    )
    seams = sm.files.read_seam_job(job).seams
    assert [(seam.name, seam.either_way) for seam in seams] == [("weld", True), ("glue", True)]


def complaint(file: Path) -> str | None:
    """Return why a drawing is refused, None where it is read."""
    try:
        read_drawing(file)
    except sm.errors.FileFormatError as error:
        return str(error)
    return None


def test_spoilt_drawings_are_refused_in_one_line(tmp_path: Path, capfd: Any) -> None:
    def draw(space: Any) -> None:
        space.add_lwpolyline([(0, 0, 0.4), (60, 0, 0), (60, 40, 0)], format="xyb")
        space.add_open_spline([(0, 80), (60, 80), (70, 90), (80, 80)])
        space.add_arc((0, 200), 30, 10, 200)

    good = drawn(tmp_path / "part.dxf", draw)
    lines, file = good.read_bytes().split(b"\n"), tmp_path / "spoilt.dxf"
    entities, rng, refused = lines.index(b"ENTITIES"), np.random.default_rng(7), 0
    for _ in range(60):
        spoilt = list(lines)
        where = int(rng.integers(entities, len(spoilt)))
        spoilt[where] = rng.choice([b"nan", b"-1", b"1e300", b"", b"\xff\x00", b"ARC", b"0"])
        file.write_bytes(b"\n".join(spoilt[: len(spoilt) - int(rng.integers(0, 2)) * where // 2]))
        said = complaint(file)
        refused += said is not None
        assert said is None or (said.startswith(f"{file}: ") and "\n" not in said), said
    assert refused > 10
    assert capfd.readouterr() == ("", "")
    for content in (b"", b"not a drawing", b"0\nSECTION\n"):
        file.write_bytes(content)
        with pytest.raises(sm.errors.FileFormatError, match=r"spoilt\.dxf: "):
            read_drawing(file)
    with pytest.raises(sm.errors.FileFormatError, match="cannot be read: No such file"):
        read_drawing(tmp_path / "none.dxf")


def test_the_package_that_is_missing_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "ezdxf.filemanagement", None)
    with pytest.raises(sm.errors.ProblemError, match=r"pip install 'selfmotion\[dxf\]'"):
        read_drawing(tmp_path / "part.dxf")


def test_curves_that_are_absurdly_far_away_are_refused_without_a_warning(tmp_path: Path) -> None:
    document = ezdxf.new(units=4)
    document.modelspace().add_spline().control_points = [(0, 0), (1e200, 0), (0, 1e200), (1, 1)]
    file = tmp_path / "far.dxf"
    document.saveas(file)
    with pytest.raises(sm.errors.FileFormatError, match=r"SPLINE .* cannot be drawn"):
        read_drawing(file)


def test_blocks_are_what_they_are_made_of(tmp_path: Path) -> None:
    """Put twice, scaled and turned, within another block; layer 0 is that of the block."""
    document = ezdxf.new("R2010", units=4)
    inner, outer = document.blocks.new("inner"), document.blocks.new("outer")
    inner.add_line((0, 0), (10, 0))
    inner.add_line((10, 0), (10, 5), {"layer": "cut"})
    outer.add_blockref("inner", (1, 1), {"rotation": 90})
    place = {"layer": "weld", "xscale": 2, "yscale": 2, "column_count": 2, "column_spacing": 40}
    document.modelspace().add_blockref("outer", (5, 5), place)
    document.saveas(tmp_path / "part.dxf")
    found = read_drawing(tmp_path / "part.dxf")
    wanted = {
        "weld 1": [[7, 7, 0], [7, 27, 0]],
        "weld 2": [[47, 7, 0], [47, 27, 0]],
        "cut 1": [[7, 27, 0], [-3, 27, 0]],
        "cut 2": [[47, 27, 0], [37, 27, 0]],
    }
    assert list(found) == list(wanted)
    for name, points in wanted.items():
        np.testing.assert_allclose(1e3 * found[name].positions, points, atol=1e-9)
    assert list(read_drawing(tmp_path / "part.dxf", "cut 1")) == ["cut 1", "cut 2"]


@pytest.mark.parametrize(("code", "axis"), [(41, "x"), (42, "y")])
def test_a_block_without_width_is_refused(code: int, axis: str, tmp_path: Path) -> None:
    document = ezdxf.new("R2010", units=4)
    document.blocks.new("clip").add_line((0, 0), (10, 5))
    document.modelspace().add_blockref("clip", (10, 0), {"zscale": 1.5})
    file = tmp_path / "part.dxf"
    document.saveas(file)
    # CAD programs write such files; ezdxf would not.
    file.write_text(file.read_text().replace(" 43\n1.5\n", f"{code:3d}\n0.0\n 43\n1.0\n"))
    with pytest.raises(sm.errors.FileFormatError, match=f"'clip' has scale 0 along {axis}"):
        read_drawing(file)


def test_blocks_of_blocks_without_end_are_refused(tmp_path: Path) -> None:
    document = ezdxf.new("R2010", units=4)
    document.blocks.new("b0").add_line((0, 0), (1, 0))
    for k in range(1, 23):
        document.blocks.new(f"b{k}").add_blockref(f"b{k - 1}", (0, 0))
    document.modelspace().add_blockref("b22", (0, 0))
    document.saveas(tmp_path / "part.dxf")
    with pytest.raises(sm.errors.FileFormatError, match=r"INSERT .* of block 'b22': has more than"):
        read_drawing(tmp_path / "part.dxf")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"AC1027\0\0\0", "is a DWG drawing, expected DXF: save it as DXF in CAD"),
        (b"hello\n", "is no DXF drawing: .* is not a DXF file; save it as DXF in CAD again"),
    ],
)
def test_what_is_no_drawing_says_what_to_do(content: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "part.dxf").write_bytes(content)
    with pytest.raises(sm.errors.FileFormatError, match=said):
        read_drawing(tmp_path / "part.dxf")


def test_a_drawing_of_hidden_layers_or_layouts_names_them(tmp_path: Path) -> None:
    def hide(space: Any) -> None:
        space.doc.layers.add("weld").off()
        space.add_line((0, 0), (9, 0), {"layer": "weld"})

    with pytest.raises(
        sm.errors.FileFormatError, match="layer 'weld' is off or frozen: switch it on"
    ):
        rows_of(tmp_path, hide)
    with pytest.raises(sm.errors.FileFormatError, match=r"in layouts \(paper space\) is not read"):
        rows_of(tmp_path, lambda s: s.doc.layout("Layout1").add_line((0, 0), (9, 0)))
    with pytest.raises(sm.errors.FileFormatError, match="its TEXT entities are no strokes"):
        rows_of(tmp_path, lambda s: s.add_text("weld here"))


def test_legs_of_a_drawing_are_followed_at_the_feed(tmp_path: Path) -> None:
    """Straight, but for a corner within the tolerance, or at rest in it."""
    corners = [(0, 0), (60, 0), (60, 40)]
    file = drawn(tmp_path / "part.dxf", lambda s: s.add_lwpolyline(corners))
    for rests in (False, True):
        path = sm.files.read_path(
            file, feed=0.03, tolerance=5e-4, corners="stop" if rests else "blend"
        )
        samples = path.samples(np.linspace(0.0, path.duration, 2001))
        points = samples.translation
        np.testing.assert_allclose(points[[0, -1], :2], [[0, 0], [0.06, 0.04]], atol=1e-9)
        legs = np.minimum(np.abs(points[:, 1]), np.abs(points[:, 0] - 0.06))
        assert legs.max() <= 1e-9 if rests else 1e-4 < legs.max() <= 5e-4
        away = np.linalg.norm(points[:, :2] - [0.06, 0.0], axis=1)
        assert away.min() <= (1e-4 if rests else 5.1e-4)
        speeds = np.linalg.norm(samples.twist[:, :3], axis=1)
        assert speeds.max() == pytest.approx(0.03, rel=1e-3)
        assert (speeds[away < 1e-6] < 1e-2).all()
        np.testing.assert_allclose(samples.rotation[:, 2, 2], -1.0)


@pytest.mark.parametrize("flag", [2, 4, 16, 64])
def test_polylines_that_are_fitted_or_meshes_are_refused(tmp_path: Path, flag: int) -> None:
    """Their corners are not on what is seen."""

    def draw(space: Any) -> None:
        line = space.add_polyline2d([(0, 0), (10, 5), (20, 0)])
        line.dxf.flags = line.dxf.flags | flag

    with pytest.raises(sm.errors.FileFormatError, match="a mesh, or fitted by a curve; explode it"):
        rows_of(tmp_path, draw)


@pytest.mark.parametrize("flag", [0, 1, 128])
def test_polylines_that_are_closed_or_dashed_are_as_they_are_drawn(
    tmp_path: Path, flag: int
) -> None:
    corners = [(0.0, 0.0), (10.0, 5.0), (20.0, 0.0)]

    def draw(space: Any) -> None:
        line = space.add_polyline2d(corners)
        line.dxf.flags = line.dxf.flags | flag

    (found,) = rows_of(tmp_path, draw).values()
    expected = np.array(corners + corners[:1] * (flag == 1))
    np.testing.assert_allclose(1e3 * found.positions[:, :2], expected, atol=1e-9)


def test_three_ends_in_a_chain_are_not_joined_whichever_is_in_the_middle() -> None:
    """Which two of them belong together nobody knows; two that meet do."""
    chain = 0.8 * _GAP_TOLERANCE * np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    apart = np.array([[1.0, 0, 0], [1.0, 0.5 * _GAP_TOLERANCE, 0]])
    for order in permutations(range(3)):
        found = _joined_ends(np.concatenate([chain[list(order)], apart]))
        assert found.tolist() == [-1, -1, -1, 4, 3]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("turn", [90.0, 300.0, 358.5])
def test_arcs_of_polylines_go_round_to_the_side_of_their_bulge(
    tmp_path: Path, side: float, turn: float
) -> None:
    """Also where one comes back nearly to where it began."""
    bulge = side * np.tan(np.radians(0.25 * turn))
    chord = 10.0 * 2.0 * np.sin(np.radians(0.5 * turn))
    points = [(0.0, 0.0, bulge), (chord, 0.0, 0.0), (chord + 5.0, 0.0, 0.0)]
    found = rows_of(tmp_path, lambda s: s.add_lwpolyline(points, format="xyb"))
    (rows,) = found.values()
    places = 1e3 * np.array(rows.positions)
    np.testing.assert_allclose(places[[0, -2, -1], 0], [0.0, chord, chord + 5.0], atol=ROUNDING)
    # The area between the arc and its chord, by its sign.
    x, y = places[:-1, 0], places[:-1, 1]
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    angle = np.radians(turn)
    assert area == pytest.approx(side * 50.0 * (angle - np.sin(angle)), rel=0.01)
