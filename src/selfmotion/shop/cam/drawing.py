"""DXF drawings: the entities of a layer, joined end to end, as contours of a tool."""

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
from selfmotion.shop.cam.drawn_curves import ENTITY_TYPES, entity_points
from selfmotion.shop.cam.pose_rows import LENGTH_UNITS, PoseRows, no_such_seam

# Names of entities and attributes: https://ezdxf.mozman.at/docs/.
# Annotations, which are no contours.
_ANNOTATIONS = frozenset(
    ("TEXT", "MTEXT", "DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "TOLERANCE", "ATTDEF")
) | frozenset(("ATTRIB", "ACAD_TABLE", "HATCH", "POINT", "VIEWPORT", "IMAGE", "WIPEOUT", "XLINE"))
# Warnings of ezdxf, such as on shared handles, are not printed beside our errors.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())
# Largest size of a file [bytes].
_MAX_FILE_SIZE = 50_000_000
# Largest coordinate [m].
_MAX_COORDINATE = 1e3
# Largest number of entities in all blocks.
_MAX_ENTITIES = 100_000
# Largest nesting depth of blocks.
_MAX_NESTING = 20
# Message for a file that ezdxf cannot read.
_UNREADABLE = "{}: is no DXF drawing: {}; save it as DXF in CAD again (2000 or later)"
# First bytes of a DWG file.
_DWG = re.compile(rb"AC10[0-9]{2}")
# Values of $INSUNITS → units.
_INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
# Tolerance of chords of a curve [m].
_CHORD_TOLERANCE = 1e-5
# Largest gap between ends that are joined [m].
_GAP_TOLERANCE = 1e-5
# Exceptions of ezdxf for corrupt entities.
_CORRUPT = (
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


class _Chords(NamedTuple):
    """An entity as a chain of chords: its label in messages, and its points (N, 3) [m]."""

    label: str
    points: Array


def read_drawing(
    file: FilePath, seam: str | None = None, unit: str | None = None
) -> Mapping[str, PoseRows]:
    """Read the contours of a drawing by the names of their layers; see `read_path`.

    Given a seam, only its layer is read: others may hold any entities. The default unit is that of
    the drawing.

    Raises
    ------
    FileFormatError
        The file cannot be read, has no unit or no such layer, or an entity of another kind; its
        handle is named.
    ProblemError
        The package that reads drawings is not installed.
    """
    drawing, corrupt = _drawing_of(file)
    unit = unit or _INSUNITS.get(drawing.units)
    if unit is None:
        raise FileFormatError(
            f"{file}: says no unit that a path has ($INSUNITS is {drawing.units}); say which it is "
            f"drawn in: unit = 'mm', expected one of {', '.join(LENGTH_UNITS)}"
        )
    try:
        flat = list[str]()
        entities = list(_entities(file, drawing, flat))
    except FileFormatError:
        raise
    except corrupt as error:
        raise FileFormatError(_UNREADABLE.format(file, _one_line(error))) from error
    layers_present = list(dict.fromkeys(layer for layer, _, _ in entities if layer is not None))
    chosen = [layer for layer in layers_present if seam is None or _is_seam_of_layer(layer, seam)]
    if seam is not None and layers_present and not chosen:
        raise no_such_seam(file, seam, layers_present)
    layers: dict[str, list[_Chords]] = {layer: [] for layer in chosen}
    ignored: Counter[str] = Counter()
    hidden_layers = sorted(
        {str(entity.dxf.layer) for layer, _, entity in entities if layer is None}
    )
    for layer, label, entity in entities:
        if layer not in layers:
            continue
        if entity.dxftype() in _ANNOTATIONS:
            ignored[entity.dxftype()] += 1
        else:
            layers[layer].extend(_chords_of(file, layer, label, entity, LENGTH_UNITS[unit]))
    contours = {layer: _contours(entities) for layer, entities in layers.items()}
    found = _named_contours(file, contours, hidden_layers, ignored)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(ignored.items()))
    layers_off = ", ".join(f"'{name}'" for name in hidden_layers)
    notes = (
        "the tool's z axis points down, against that of the drawing",
        *([f"{flat[0]} has scale 0 along z, which is taken for 1"] if flat else []),
        *([f"passed over: {kinds}"] if ignored else []),
        *([f"passed over: layers that are off or frozen: {layers_off}"] if hidden_layers else []),
    )
    return {name: replace(rows, notes=notes) for name, rows in found.items()}


def _drawing_of(file: FilePath) -> tuple[Any, tuple[type[Exception], ...]]:
    """Return a drawing as ezdxf reads it, and the errors of what is corrupt in it."""
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ModuleNotFoundError:
        raise ProblemError("drawings need ezdxf: pip install 'selfmotion[dxf]'") from None
    corrupt = (DXFError, *_CORRUPT)
    try:
        size = file.stat().st_size
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    if size > _MAX_FILE_SIZE:
        raise FileFormatError(f"{file}: has {size} bytes, expected {_MAX_FILE_SIZE} at most")
    try:
        with file.open("rb") as stream:
            is_dwg = _DWG.match(stream.read(8)) is not None
        if is_dwg:
            raise FileFormatError(f"{file}: is a DWG drawing, expected DXF: save it as DXF in CAD")
        return readfile(file), corrupt
    except FileFormatError:
        raise
    except corrupt as error:
        raise FileFormatError(_UNREADABLE.format(file, _one_line(error))) from error


def _entities(
    file: FilePath, drawing: Any, flat: list[str]
) -> Iterator[tuple[str | None, str, Any]]:
    """Yield the entities of model space: layer, None where it is hidden, label, and entity.

    A block reference is replaced by the entities of its block; those on layer 0 are on the layer of
    the reference. Labels of references of scale 0 along z are appended to `flat`.
    """
    from ezdxf.lldxf.const import DXFError

    pending = [
        (_visible_layer(drawing, item), _label(item), item, 0) for item in drawing.modelspace()
    ][::-1]
    count = 0
    while pending:
        layer, label, entity, depth = pending.pop()
        if entity.dxftype() != "INSERT" or layer is None:
            yield layer, label if depth == 0 else f"{entity.dxftype()} in {label}", entity
            continue
        if entity.block() is None:
            raise FileFormatError(
                f"{file}: layer '{layer}': {label} puts a block that the drawing does not have; "
                f"delete it in CAD, or switch its layer off"
            )
        for axis in "xy":
            if entity.dxf.get(f"{axis}scale", 1.0) == 0.0:
                raise FileFormatError(
                    f"{file}: layer '{layer}': {label} has scale 0 along {axis}, which leaves no "
                    f"contour of it: expected another scale; place the block again in CAD"
                )
        if entity.dxf.zscale == 0.0:
            # As programs for 2-D drawings write it.
            entity.dxf.zscale = 1.0
            flat.append(label)
        try:
            children = [
                (
                    layer if part.dxf.layer == "0" else _visible_layer(drawing, part),
                    label,
                    part,
                    depth + 1,
                )
                for one in (entity.multi_insert() if entity.mcount > 1 else [entity])
                for part in one.virtual_entities()
            ]
        except (DXFError, *_CORRUPT) as error:
            raise FileFormatError(
                f"{file}: layer '{layer}': {label} cannot be drawn ({_one_line(error)}): explode "
                f"it in CAD, or switch its layer off"
            ) from error
        count += len(children)
        if count > _MAX_ENTITIES or depth > _MAX_NESTING:
            raise FileFormatError(
                f"{file}: {label}: has more than {_MAX_ENTITIES} entities, or blocks in more than "
                f"{_MAX_NESTING} others; explode what is to be drawn, and delete the rest"
            )
        pending += reversed(children)


def _label(entity: Any) -> str:
    name = f" of block '{entity.dxf.name}'" if entity.dxftype() == "INSERT" else ""
    return f"{entity.dxftype()} {entity.dxf.handle}{name}"


def _is_seam_of_layer(layer: str, seam: str) -> bool:
    """Whether a seam may be of a layer: it has the layer's name, or that with a number."""
    name, _, number = seam.rpartition(" ")
    return seam == layer or (name == layer and number.isdigit())


def _one_line(error: BaseException) -> str:
    """Return the message of an exception of ezdxf in one line."""
    text = " ".join(str(error).split())[:200].rstrip(".")
    return type(error).__name__ if text in ("", "None") else text


def _visible_layer(drawing: Any, entity: Any) -> str | None:
    """Return the layer of an entity, None where the layer is off or frozen."""
    name = str(entity.dxf.layer)
    if name not in drawing.layers:
        return name
    layer = drawing.layers.get(name)
    return None if layer.is_off() or layer.is_frozen() else str(layer.dxf.name)


def _chords_of(
    file: FilePath, layer: str, label: str, entity: Any, unit: float
) -> Iterator[_Chords]:
    """Yield an entity as a chain of chords, unless it is shorter than the gap tolerance."""
    from ezdxf.lldxf.const import DXFError

    if entity.dxftype() not in ENTITY_TYPES:
        raise FileFormatError(
            f"{file}: layer '{layer}': {label} is not read, expected {', '.join(ENTITY_TYPES)} or "
            f"blocks of them; explode it in CAD, delete it, switch its layer off, or choose the "
            f"seam of another layer"
        )
    try:
        drawn = np.array(entity_points(entity, _CHORD_TOLERANCE / unit), dtype=np.float64)
        points = unit * drawn.reshape(-1, 3)
    except (DXFError, *_CORRUPT) as error:
        raise FileFormatError(
            f"{file}: layer '{layer}': {label} cannot be drawn: {_one_line(error)}; "
            f"mend or delete it in CAD, or switch its layer off"
        ) from error
    if not np.abs(points).max(initial=0.0) < _MAX_COORDINATE:
        raise FileFormatError(
            f"{file}: layer '{layer}': {label} is more than {_MAX_COORDINATE:g} m away; is it "
            f"drawn in another unit than $INSUNITS says? (unit = 'mm')"
        )
    if len(points) and np.ptp(points, axis=0).max() > _GAP_TOLERANCE:
        yield _Chords(label, points)


def _contours(entities: Sequence[_Chords]) -> list[PoseRows]:
    """Return entities joined end to end, each contour in the direction of its first entity.

    A contour ends where more than two ends meet: the continuation is ambiguous.
    """
    # Ends are numbered: 2 k is the first point of entity k, and 2 k + 1 its last one.
    joined_ends = _joined_ends(np.array([item.points[end] for item in entities for end in (0, -1)]))
    found, used = list[PoseRows](), set[int]()
    for first in range(len(entities)):
        if first in used:
            continue
        # Backwards to the end at which the contour begins.
        end = 2 * first
        while (neighbour := int(joined_ends[end])) >= 0:
            if neighbour // 2 == first:
                # A closed contour begins with its first entity.
                end = 2 * first
                break
            end = neighbour ^ 1
        cut = Cut()
        while end >= 0 and end // 2 not in used:
            item = entities[end // 2]
            used.add(end // 2)
            _append_points(cut, item, item.points[::-1] if end % 2 else item.points)
            end = int(joined_ends[end ^ 1])
        found.append(cut.rows())
    return found


def _joined_ends(ends: Array) -> Ints:
    """Return for each end the index of the only one that meets it; -1 for none or several."""
    from scipy.spatial import KDTree

    joined_ends = np.full(len(ends), -1)
    if len(ends):
        # The end itself, its neighbour, and a possible third one.
        found = KDTree(ends).query(ends, k=3, distance_upper_bound=_GAP_TOLERANCE)
        distances, indices = (np.asarray(each) for each in found)
        has_one = np.isfinite(distances[:, 1]) & ~np.isfinite(distances[:, 2])
        own = np.arange(len(ends))
        other = np.where(indices[:, 0] == own, indices[:, 1], indices[:, 0])
        joined_ends[has_one] = other[has_one]
        # Neighbourhoods have to be mutual: a chain of three near ends is ambiguous.
        joined_ends[(joined_ends >= 0) & (joined_ends[joined_ends] != own)] = -1
    return joined_ends


def _append_points(cut: Cut, item: _Chords, points: Array) -> None:
    up = np.array([0.0, 0.0, 1.0])
    for k, point in enumerate(points):
        meets = (
            k == 0 and cut.positions and np.abs(point - cut.positions[-1]).max() <= _GAP_TOLERANCE
        )
        if not meets:
            cut.add(item.label, point, up, 0.0)


def _named_contours(
    file: FilePath,
    layers: Mapping[str, Sequence[PoseRows]],
    hidden_layers: Sequence[str],
    ignored: Mapping[str, int],
) -> dict[str, PoseRows]:
    """Return contours by the name of their layer, with a number where it has several."""
    found: dict[str, PoseRows] = {}
    for layer, contours in layers.items():
        for number, rows in enumerate(contours, 1):
            name = layer if len(contours) == 1 else f"{layer} {number}"
            if name in found:
                raise FileFormatError(
                    f"{file}: has two strokes '{name}', one of a layer of that name; rename a layer"
                )
            found[name] = rows
    if not found:
        others = [
            *(f"layer '{name}' is off or frozen: switch it on" for name in hidden_layers[:1]),
            *(f"its {kind} entities are no strokes" for kind in sorted(ignored)[:1]),
        ]
        raise FileFormatError(
            f"{file}: has nothing drawn in model space, on layers that are neither off nor frozen"
            f"; {'; '.join(others) or 'what is drawn in layouts (paper space) is not read'}"
        )
    return found
