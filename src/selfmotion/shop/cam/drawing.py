"""DXF drawings: what is drawn on a layer, joined end to end, as strokes of a tool."""

import logging
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import Array, FileFormatError, Ints, ProblemError
from selfmotion.shop.cam.cuts import Cut
from selfmotion.shop.cam.drawn_curves import DRAWN
from selfmotion.shop.cam.path_rows import LENGTH_UNITS, PoseRows, no_such_seam

# Codes of a drawing: https://ezdxf.mozman.at/docs/.

# Entities that are texts or marks, and no strokes.
_SAID = frozenset(
    ("TEXT", "MTEXT", "DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "TOLERANCE", "ATTDEF")
) | frozenset(("ATTRIB", "ACAD_TABLE", "HATCH", "POINT", "VIEWPORT", "IMAGE", "WIPEOUT", "XLINE"))
# Remarks of ezdxf, such as on handles that two entities share, do not stand beside our errors.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())
# Largest size of a drawing [bytes].
_BYTES = 50_000_000
# Largest distance from zero [m].
_FAR = 1e3
# Largest number of entities in all blocks.
_PARTS = 100_000
# Largest depth of blocks in blocks.
_DEEPEST = 20
_NO_DRAWING = "{}: is no DXF drawing: {}; save it as DXF in CAD again (2000 or later)"
_DWG = re.compile(rb"AC10[0-9]{2}")
# Units of $INSUNITS.
_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
# Largest deviation of chords from their curve [m].
_DEVIATION = 1e-5
# Largest distance of ends that meet [m].
_MEET = 1e-5
# Errors of spoilt drawings, which are as various as the entities that they are in.
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


class _Drawn(NamedTuple):
    """An entity as it is drawn: its place in the file, and points along it (N, 3) [m]."""

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
        flat = list[str]()
        drawn = list(_drawn(file, drawing, flat))
    except FileFormatError:
        raise
    except spoilt as error:
        raise FileFormatError(_NO_DRAWING.format(file, _line(error))) from error
    present = list(dict.fromkeys(layer for layer, _, _ in drawn if layer is not None))
    chosen = [layer for layer in present if seam is None or _may_have(layer, seam)]
    if seam is not None and present and not chosen:
        raise no_such_seam(file, seam, present)
    layers: dict[str, list[_Drawn]] = {layer: [] for layer in chosen}
    beside: Counter[str] = Counter()
    hidden = sorted({str(entity.dxf.layer) for layer, _, entity in drawn if layer is None})
    for layer, place, entity in drawn:
        if layer not in layers:
            continue
        if entity.dxftype() in _SAID:
            beside[entity.dxftype()] += 1
        else:
            layers[layer].extend(_points_of(file, layer, place, entity, LENGTH_UNITS[unit]))
    strokes = {layer: _strokes(entities) for layer, entities in layers.items()}
    found = _named(file, strokes, hidden, beside)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(beside.items()))
    layers_off = ", ".join(f"'{name}'" for name in hidden)
    notes = (
        "the tool's z axis points down, against that of the drawing",
        *([f"{flat[0]} has scale 0 along z, which is taken for 1"] if flat else []),
        *([f"passed over: {kinds}"] if beside else []),
        *([f"passed over: layers that are off or frozen: {layers_off}"] if hidden else []),
    )
    return {name: replace(rows, notes=notes) for name, rows in found.items()}


def _drawn(file: FilePath, drawing: Any, flat: list[str]) -> Iterator[tuple[str | None, str, Any]]:
    """Yield what is drawn in model space: its layer, None if that is hidden, its place, and it.

    Blocks are what they are made of, where they are put; of that what is on layer 0 is on theirs.
    Places of blocks of scale 0 along z are added to `flat`.
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
            flat.append(place)
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
    """Return the text of an error of ezdxf, in one line."""
    text = " ".join(str(error).split())[:200].rstrip(".")
    return type(error).__name__ if text in ("", "None") else text


def _visible_layer(drawing: Any, entity: Any) -> str | None:
    """Return the name of the layer of an entity, None where it is off or frozen."""
    name = str(entity.dxf.layer)
    if name not in drawing.layers:
        return name
    layer = drawing.layers.get(name)
    return None if layer.is_off() or layer.is_frozen() else str(layer.dxf.name)


def _points_of(
    file: FilePath, layer: str, place: str, entity: Any, unit: float
) -> Iterator[_Drawn]:
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
        yield _Drawn(place, points)


def _strokes(entities: Sequence[_Drawn]) -> list[PoseRows]:
    """Return entities joined end to end, each stroke in the direction of its first one.

    Where more than two ends meet, strokes end: which entity goes on is not known.
    """
    # End 2 k is where entity k begins, and 2 k + 1 where it ends.
    mates = _mates(np.array([item.points[end] for item in entities for end in (0, -1)]))
    found, taken = list[PoseRows](), set[int]()
    for first in range(len(entities)):
        if first in taken:
            continue
        here = 2 * first
        while (mate := int(mates[here])) >= 0:
            if mate // 2 == first:
                # It closes: it begins with its first entity.
                here = 2 * first
                break
            here = mate ^ 1
        cut = Cut()
        while here >= 0 and here // 2 not in taken:
            item = entities[here // 2]
            taken.add(here // 2)
            _add(cut, item, item.points[::-1] if here % 2 else item.points)
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


def _add(cut: Cut, item: _Drawn, points: Array) -> None:
    up = np.array([0.0, 0.0, 1.0])
    for k, point in enumerate(points):
        meets = k == 0 and cut.positions and np.abs(point - cut.positions[-1]).max() <= _MEET
        if not meets:
            cut.add(item.place, point, up, 0.0)


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
