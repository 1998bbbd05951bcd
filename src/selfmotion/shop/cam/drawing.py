"""DXF drawings: what is drawn on a layer, joined end to end, as strokes of a tool."""

import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import Array, FileFormatError, Ints, ProblemError
from selfmotion.shop.cam.cuts import Cut
from selfmotion.shop.cam.path_rows import LENGTH_UNITS, PoseRows, no_such_seam

# Entities of DXF drawings as points (N, 3) along them, in units of the drawing.

# A curve has less than so many points.
_POINTS = 200_000
# What is farther away than this, in units of the drawing, is a fault of what wrote it.
_LARGEST = 1e100
# A cubic is off its chord by at most this many times what it is off at thirds of its parameter.
_BETWEEN_THIRDS = 1.31
# Arcs of a larger radius, in deviations of a chord, are a fault of what wrote them.
_FLATTEST = 1e11
# A chord is halved so many times at most.
_HALVINGS = 30
# Pieces of a span between knots, and of an ellipse, to begin with.
_PIECES = 4
# Of polylines: fitted by a curve, by a spline, meshes.
_NOT_AS_DRAWN = 2 | 4 | 16 | 64


def _line_drawn(entity: Any, deviation: float) -> Array:
    return np.array([entity.dxf.start, entity.dxf.end])


def _arc_drawn(entity: Any, deviation: float) -> Array:
    radius = abs(entity.dxf.radius)
    if not 0.0 < radius < _FLATTEST * deviation:
        raise ValueError(f"its radius is {radius:.6g}")
    return np.array(list(entity.flattening(min(deviation, 0.5 * radius))))


def _ellipse_drawn(entity: Any, deviation: float) -> Array:
    ellipse = entity.construction_tool()
    ends = np.linspace(0.0, ellipse.param_span, 2 * _PIECES + 1)
    return _chords(lambda t: ellipse.vertices(ellipse.start_param + t), ends, deviation)


def _spline_drawn(entity: Any, deviation: float) -> Array:
    spline = entity.construction_tool()
    first, last = spline.knots()[spline.order - 1], spline.knots()[spline.count]
    knots = np.unique([first, *(each for each in spline.knots() if first < each < last), last])
    ends = np.interp(np.arange(_PIECES * (len(knots) - 1) + 1) / _PIECES, range(len(knots)), knots)
    return _chords(spline.points, ends, deviation)


def _polyline_drawn(entity: Any, deviation: float) -> Array:
    """Return the corners of a polyline, and points of the arcs between them."""
    if entity.dxf.flags & _NOT_AS_DRAWN and entity.dxftype() == "POLYLINE":
        raise ValueError("is a mesh, or fitted by a curve; explode it")
    if entity.dxftype() == "POLYLINE" and entity.is_3d_polyline:
        corners = [vertex.dxf.location for vertex in entity.vertices]
        return np.array(corners + corners[:1] if entity.is_closed else corners)
    found = np.zeros((0, 3))
    for part in entity.virtual_entities():
        points = DRAWN[part.dxftype()](part, deviation)
        # Arcs go round to the left, also where the polyline goes to the right.
        last = found[-1] if len(found) else np.array(_first_corner(entity))
        away = np.linalg.norm(points[[0, -1]] - last, axis=1)
        found = np.concatenate([found, points[::-1] if away[1] < away[0] else points])
    return found


def _first_corner(entity: Any) -> Any:
    if entity.dxftype() == "POLYLINE":
        return next(iter(entity.points_in_wcs()))
    return next(iter(entity.vertices_in_wcs()))


def _chords(curve: Callable[[Array], Any], ends: Array, deviation: float) -> Array:
    """Return points of a curve whose chords are nowhere off it by more than a deviation.

    Between two parameters it is taken for a cubic, which is what is between two knots of a spline
    of degree three, and soon what is left of any other curve.
    """
    t = ends
    for _ in range(_HALVINGS):
        points = np.array([tuple(each) for each in curve(t)])
        if not np.isfinite(points).all():
            raise ValueError("is not finite")
        if not np.abs(points).max() < _LARGEST:
            raise ValueError(f"is farther away than {_LARGEST:g}")
        chords, steps = np.diff(points, axis=0), np.diff(t)
        far = np.zeros(len(chords), dtype=bool)
        lengths = np.maximum((chords * chords).sum(axis=1), np.finfo(np.float64).tiny)
        for share in (1.0 / 3.0, 2.0 / 3.0):
            here = np.array([tuple(each) for each in curve(t[:-1] + share * steps)]) - points[:-1]
            here = np.clip(here, -_LARGEST, _LARGEST)
            along = np.clip((here * chords).sum(axis=1) / lengths, 0.0, 1.0)
            away = np.linalg.norm(here - along[:, None] * chords, axis=1)
            far |= ~(_BETWEEN_THIRDS * away <= deviation)
        if not far.any():
            return points
        if len(t) + far.sum() > _POINTS:
            break
        t = np.sort(np.concatenate([t, t[:-1][far] + 0.5 * steps[far]]))
    raise ValueError(f"needs more than {_POINTS} chords to be near enough")


DRAWN: Mapping[str, Callable[[Any, float], Array]] = {
    "LINE": _line_drawn,
    "ARC": _arc_drawn,
    "CIRCLE": _arc_drawn,
    "ELLIPSE": _ellipse_drawn,
    "SPLINE": _spline_drawn,
    "LWPOLYLINE": _polyline_drawn,
    "POLYLINE": _polyline_drawn,
}


# DXF drawings: what is drawn on a layer, joined end to end, as strokes of a tool.
#
# What the codes of a drawing mean: https://ezdxf.mozman.at/docs/.

# What is written or marked in a drawing, and no stroke.
_SAID = frozenset(
    ("TEXT", "MTEXT", "DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "TOLERANCE", "ATTDEF")
) | frozenset(("ATTRIB", "ACAD_TABLE", "HATCH", "POINT", "VIEWPORT", "IMAGE", "WIPEOUT", "XLINE"))
# What ezdxf remarks, such as handles that two entities share, is not told beside our own errors.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())
# A drawing has less than so many bytes; nothing is farther away than this [m].
_BYTES, _FAR = 50_000_000, 1e3
# Blocks have so many entities together, and are in so many others.
_PARTS, _DEEPEST = 100_000, 20
_NO_DRAWING = "{}: is no DXF drawing: {}; save it as DXF in CAD again (2000 or later)"
_DWG = re.compile(rb"AC10[0-9]{2}")
# What $INSUNITS means.
_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
# What chords may be off a curve, and ends off each other that meet [m].
_DEVIATION = _MEET = 1e-5
# What spoilt drawings lead to is as various as the entities that they are in.
_SPOILT = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    StopIteration,
    TypeError,
    ValueError,
)


class _Piece(NamedTuple):
    """An entity as it is drawn: where it stands in the file, and points along it (N, 3) [m]."""

    place: str
    points: Array


def read_drawing(
    file: FilePath, seam: str | None = None, unit: str | None = None
) -> Mapping[str, PoseRows]:
    """Read the strokes of a drawing by the names of their layers; see `read_path`.

    Where one seam is asked for, other layers are not looked at: they may hold texts and dimensions.
    The unit is the drawing's where none is said.

    Raises
    ------
    FileFormatError
        The file cannot be read, says no unit, has no layer of that seam, or an entity that is not
        read; its handle is named.
    ProblemError
        The package that reads drawings is not installed.
    """
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ModuleNotFoundError:
        raise ProblemError("drawings need ezdxf: pip install 'selfmotion[dxf]'") from None
    spoilt = (DXFError, *_SPOILT)
    try:
        size = file.stat().st_size
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    if size > _BYTES:
        raise FileFormatError(f"{file}: has {size} bytes, expected {_BYTES} at most")
    try:
        with file.open("rb") as stream:
            is_dwg = _DWG.match(stream.read(8)) is not None
        if is_dwg:
            raise FileFormatError(f"{file}: is a DWG drawing, expected DXF: save it as DXF in CAD")
        drawing = readfile(file)
    except FileFormatError:
        raise
    except spoilt as error:
        raise FileFormatError(_NO_DRAWING.format(file, _line(error))) from error
    unit = unit or _UNITS.get(drawing.units)
    if unit is None:
        raise FileFormatError(
            f"{file}: says no unit that a path has ($INSUNITS is {drawing.units}); say which it is "
            f"drawn in: unit = 'mm', expected one of {', '.join(LENGTH_UNITS)}"
        )
    try:
        drawn = list(_drawn(file, drawing))
    except FileFormatError:
        raise
    except spoilt as error:
        raise FileFormatError(_NO_DRAWING.format(file, _line(error))) from error
    present = list(dict.fromkeys(layer for layer, _, _ in drawn if layer is not None))
    asked = [layer for layer in present if seam is None or _may_have(layer, seam)]
    if seam is not None and present and not asked:
        raise no_such_seam(file, seam, present)
    layers: dict[str, list[_Piece]] = {layer: [] for layer in asked}
    beside: Counter[str] = Counter()
    hidden = sorted({str(entity.dxf.layer) for layer, _, entity in drawn if layer is None})
    for layer, place, entity in drawn:
        if layer not in layers:
            continue
        if entity.dxftype() in _SAID:
            beside[entity.dxftype()] += 1
        else:
            layers[layer].extend(_piece(file, layer, place, entity, LENGTH_UNITS[unit]))
    strokes = {layer: _strokes(pieces) for layer, pieces in layers.items()}
    found = _named(file, strokes, hidden, beside)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(beside.items()))
    layers_off = ", ".join(f"'{name}'" for name in hidden)
    notes = (
        *([f"passed over: {kinds}"] if beside else []),
        *([f"passed over: layers that are off or frozen: {layers_off}"] if hidden else []),
    )
    return {name: replace(rows, notes=notes) for name, rows in found.items()}


def _drawn(file: FilePath, drawing: Any) -> Iterator[tuple[str | None, str, Any]]:
    """Yield what is drawn in model space: its layer, None if that is hidden, its place, and it.

    Blocks are what they are made of, where they are put; of that what is on layer 0 is on theirs.
    """
    from ezdxf.lldxf.const import DXFError

    several = [
        (_visible_layer(drawing, item), _place(item), item, 0) for item in drawing.modelspace()
    ][::-1]
    count = 0
    while several:
        layer, place, entity, depth = several.pop()
        if entity.dxftype() != "INSERT" or layer is None:
            yield layer, place if depth == 0 else f"{entity.dxftype()} in {place}", entity
            continue
        if entity.block() is None:
            raise FileFormatError(
                f"{file}: layer '{layer}': {place} puts a block that the drawing does not have; "
                f"delete it in CAD, or switch its layer off"
            )
        if entity.dxf.zscale == 0.0:
            # Programs for flat drawings write it.
            entity.dxf.zscale = 1.0
        try:
            inner = [
                (
                    layer if part.dxf.layer == "0" else _visible_layer(drawing, part),
                    place,
                    part,
                    depth + 1,
                )
                for one in (entity.multi_insert() if entity.mcount > 1 else [entity])
                for part in one.virtual_entities()
            ]
        except (DXFError, *_SPOILT) as error:
            raise FileFormatError(
                f"{file}: layer '{layer}': {place} cannot be drawn ({_line(error)}): explode it in "
                f"CAD, or switch its layer off"
            ) from error
        count += len(inner)
        if count > _PARTS or depth > _DEEPEST:
            raise FileFormatError(
                f"{file}: {place}: has more than {_PARTS} entities, or blocks in more than "
                f"{_DEEPEST} others; explode what is to be drawn, and delete the rest"
            )
        several += reversed(inner)


def _place(entity: Any) -> str:
    name = f" of block '{entity.dxf.name}'" if entity.dxftype() == "INSERT" else ""
    return f"{entity.dxftype()} {entity.dxf.handle}{name}"


def _may_have(layer: str, seam: str) -> bool:
    """Whether a layer may have a stroke of this name: its own, or that with a number."""
    name, _, number = seam.rpartition(" ")
    return seam == layer or (name == layer and number.isdigit())


def _line(error: BaseException) -> str:
    """Return what an error of ezdxf says, in one line."""
    text = " ".join(str(error).split())[:200].rstrip(".")
    return type(error).__name__ if text in ("", "None") else text


def _visible_layer(drawing: Any, entity: Any) -> str | None:
    """Return the name of the layer of an entity, None where it is off or frozen."""
    name = str(entity.dxf.layer)
    if name not in drawing.layers:
        return name
    layer = drawing.layers.get(name)
    return None if layer.is_off() or layer.is_frozen() else str(layer.dxf.name)


def _piece(file: FilePath, layer: str, place: str, entity: Any, unit: float) -> Iterator[_Piece]:
    """Yield an entity as points, unless it is shorter than what counts as a gap."""
    from ezdxf.lldxf.const import DXFError

    draw = DRAWN.get(entity.dxftype())
    if draw is None:
        raise FileFormatError(
            f"{file}: layer '{layer}': {place} is not read, expected {', '.join(DRAWN)} or blocks "
            f"of them; explode it in CAD, delete it, switch its layer off, or choose the seam of "
            f"another layer"
        )
    try:
        points = unit * np.array(draw(entity, _DEVIATION / unit), dtype=np.float64).reshape(-1, 3)
    except (DXFError, *_SPOILT) as error:
        raise FileFormatError(
            f"{file}: layer '{layer}': {place} cannot be drawn: {_line(error)}; "
            f"mend or delete it in CAD, or switch its layer off"
        ) from error
    if not np.abs(points).max(initial=0.0) < _FAR:
        raise FileFormatError(
            f"{file}: layer '{layer}': {place} is more than {_FAR:g} m away; is it drawn in "
            f"another unit than $INSUNITS says? (unit = 'mm')"
        )
    if len(points) and np.ptp(points, axis=0).max() > _MEET:
        yield _Piece(place, points)


def _strokes(pieces: Sequence[_Piece]) -> list[PoseRows]:
    """Return pieces joined end to end, each stroke in the direction of its first piece.

    Where more than two ends meet it is not said which goes on: strokes end there.
    """
    # End 2 k is where piece k begins, and 2 k + 1 where it ends.
    mates = _mates(np.array([piece.points[end] for piece in pieces for end in (0, -1)]))
    found, taken = list[PoseRows](), set[int]()
    for first in range(len(pieces)):
        if first in taken:
            continue
        here = 2 * first
        while (mate := int(mates[here])) >= 0:
            if mate // 2 == first:
                # It closes: its first piece is where it begins.
                here = 2 * first
                break
            here = mate ^ 1
        cut = Cut()
        while here >= 0 and here // 2 not in taken:
            piece = pieces[here // 2]
            taken.add(here // 2)
            _add(cut, piece, piece.points[::-1] if here % 2 else piece.points)
            here = int(mates[here ^ 1])
        found.append(cut.rows())
    return found


def _mates(ends: Array) -> Ints:
    """Return the number of the only other end that is where each is, -1 for none or several."""
    from scipy.spatial import KDTree

    mates = np.full(len(ends), -1)
    if len(ends):
        # Itself, one other, and whether there is a third.
        found = KDTree(ends).query(ends, k=3, distance_upper_bound=_MEET)
        away, near = (np.asarray(each) for each in found)
        alone = np.isfinite(away[:, 1]) & ~np.isfinite(away[:, 2])
        own = np.arange(len(ends))
        other = np.where(near[:, 0] == own, near[:, 1], near[:, 0])
        mates[alone] = other[alone]
        # One that is near another, which is near a third, has no only mate either.
        mates[(mates >= 0) & (mates[mates] != own)] = -1
    return mates


def _add(cut: Cut, piece: _Piece, points: Array) -> None:
    up = np.array([0.0, 0.0, 1.0])
    for k, point in enumerate(points):
        meets = k == 0 and cut.positions and np.abs(point - cut.positions[-1]).max() <= _MEET
        if not meets:
            cut.add(piece.place, point, up, 0.0)


def _named(
    file: FilePath,
    layers: Mapping[str, Sequence[PoseRows]],
    hidden: Sequence[str],
    beside: Mapping[str, int],
) -> dict[str, PoseRows]:
    """Return strokes by the name of their layer, with a number where it has several."""
    found: dict[str, PoseRows] = {}
    for layer, strokes in layers.items():
        for number, rows in enumerate(strokes, 1):
            name = layer if len(strokes) == 1 else f"{layer} {number}"
            if name in found:
                raise FileFormatError(
                    f"{file}: has two strokes '{name}', one of a layer of that name; rename a layer"
                )
            found[name] = rows
    if not found:
        others = [
            *(f"layer '{name}' is off or frozen: switch it on" for name in hidden[:1]),
            *(f"its {kind} entities are no strokes" for kind in sorted(beside)[:1]),
        ]
        raise FileFormatError(
            f"{file}: has nothing drawn in model space, on layers that are neither off nor frozen"
            f"; {'; '.join(others) or 'what is drawn in layouts (paper space) is not read'}"
        )
    return found
