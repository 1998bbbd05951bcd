"""Pose files of other programs, in their own forms: IRBCAM, igus, compas, motion primitives.

Each says what it is by its titles or words; what its numbers mean is in a note.
"""

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import Array, FileFormatError, is_number, lines_of, number_in, shown, text_of
from selfmotion.shop.cam.arcs import arc_points
from selfmotion.shop.cam.cuts import Machine
from selfmotion.shop.cam.pose_rows import PoseRows

# Millimetre [m].
_MM = 1e-3
# Largest size of such a file [bytes].
_BYTES = 50_000_000
# Size of its beginning that has the titles [bytes].
_HEAD = 10_000


def peer_table(file: FilePath) -> Mapping[str, PoseRows] | None:
    """Return the poses of a table in the form of another program, None where it is in none.

    Raises
    ------
    FileFormatError
        It is one of theirs, and a row of it is not read.
    """
    try:
        with file.open("rb") as stream:
            head = stream.read(_HEAD)
            first = next((line for line in lines_of(text_of(file, head)) if line.strip()), "")
            titles = _cells(first.lower())
            read = _reader_of(first, titles)
            content = b"" if read is None else head + stream.read(_BYTES)
        if read is None or len(content) > _BYTES:
            return None
        text = text_of(file, content)
    except (OSError, FileFormatError):
        return None
    return {"": read(file, text, titles)}


def _cells(line: str) -> list[str]:
    """Return the cells of a line of a table, which semicolons or commas are between."""
    return [cell.strip() for cell in line.split(";" if ";" in line else ",")]


def _reader_of(
    first: str, titles: Sequence[str]
) -> Callable[[FilePath, str, Sequence[str]], PoseRows] | None:
    """Return the reader of a table with this first line, None where no other program has it."""
    if set(_IRBCAM) <= set(titles):
        return _of_irbcam
    if _IGUS.fullmatch(first.strip()):
        return _of_igus
    return _of_primitives if tuple(titles[:3]) == _PRIMITIVES else None


def _number(file: FilePath, line: int, text: str) -> float:
    value = number_in(text)
    if value is None or not np.isfinite(value):
        raise FileFormatError(f"{file}: line {line}: {shown(text)} is no number")
    return value


# Arcs by a point between their ends.
# Three points whose triangle is so flat lie on a line.
_FLAT = 1e-6


def _arc(
    file: FilePath, line: int, first: Array, middle: Array, last: Array
) -> tuple[Array, Array]:
    """Return the points (K, 3) of an arc up to its middle, and those from there to its end [m].

    Without the point that each begins at, with the one that it ends at.
    """
    one, other = middle - first, last - first
    normal = np.cross(one, other)
    size = float(normal @ normal)
    if min(one @ one, other @ other) == 0.0 or not np.isfinite(size):
        raise FileFormatError(
            f"{file}: line {line}: an arc needs three points apart from each other"
        )
    if size <= _FLAT**2 * (one @ one) * (other @ other):
        return middle[None], last[None]
    away = (other @ other) * np.cross(normal, one) - (one @ one) * np.cross(normal, other)
    center = first + away / (2.0 * size)
    machine = Machine(file)
    machine.number = line
    return (
        arc_points(machine, first, middle, center, normal),
        arc_points(machine, middle, last, center, normal),
    )


def _turning(first: Array, last: Array, count: int) -> Array:
    """Return rotations (count, 3, 3) evenly from one (3, 3) to another, which is the last."""
    from scipy.spatial.transform import Rotation, Slerp

    turn = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([first, last])))
    return np.asarray(turn(np.arange(1, count + 1) / count).as_matrix())


# IRBCAM: x, y, z [mm], angles about z, y and z of the frame as it is turned [°], velocity [mm/s].
_IRBCAM = ("x", "y", "z", "rz1", "ry", "rz2")


def _of_irbcam(file: FilePath, text: str, titles: Sequence[str]) -> PoseRows:
    from scipy.spatial.transform import Rotation

    rows, labels, feeds = list[list[float]](), list[str](), list[float]()
    lines, middles = list[int](), list[int]()
    for number, line in enumerate(lines_of(text), 1):
        cells = _cells(line)
        if not line.strip() or [cell.lower() for cell in cells] == list(titles):
            continue
        if len(cells) != len(titles):
            raise FileFormatError(
                f"{file}: line {number} has {len(cells)} values, expected {len(titles)}"
            )
        row = dict(zip(titles, cells, strict=True))
        values = {key: _number(file, number, row[key]) for key in _IRBCAM}
        kind = _number(file, number, row.get("motion_type", "0"))
        if kind not in (0.0, 1.0) or (
            kind == 1.0 and (not rows or middles[-1:] == [len(rows) - 1])
        ):
            raise FileFormatError(
                f"{file}: line {number}: motion_type {row['motion_type']} is not read here, "
                f"expected 0 (a line), or 1 for the point between both ends of an arc of IRBCAM"
            )
        if kind == 1.0:
            middles.append(len(rows))
        lines.append(number)
        rows.append([values[key] for key in _IRBCAM])
        feeds.append(_MM * _number(file, number, row.get("velocity", "0")))
        labels.append(f"line {number}")
    if middles[-1:] == [len(rows) - 1]:
        raise FileFormatError(
            f"{file}: {labels[-1]}: motion_type 1 is the middle of an arc of IRBCAM, whose end is "
            f"missing"
        )
    table = np.array(rows).reshape(-1, 6)
    turns = Rotation.from_euler("ZYZ", table[:, 3:], degrees=True).as_matrix()
    others = [title for title in titles if title not in (*_IRBCAM, "motion_type", "velocity")]
    passed = f"; passed over: {', '.join(others)}" if others else ""
    note = (
        f"IRBCAM: x,y,z in mm, rz1,ry,rz2 about z, y and z in turn, velocity in mm/s on the way to "
        f"its row, -1 a rapid, motion_type 1 between both ends of an arc{passed}"
    )
    positions = _MM * table[:, :3]
    if middles:
        chosen, positions, turns = _with_arcs(file, lines, middles, positions, turns)
        labels, feeds = [labels[k] for k in chosen], [feeds[k] for k in chosen]
    # A velocity is that of the step to its row; -1 is a rapid.
    to_next = np.array([*feeds[1:], *feeds[-1:]])
    return _straight(labels, positions, "rotation", turns, to_next, note)


def _with_arcs(
    file: FilePath, lines: Sequence[int], middles: Sequence[int], positions: Array, turns: Array
) -> tuple[list[int], Array, Array]:
    """Return poses with arcs as chords, and which row each is of."""
    chosen, points_of_steps, rotations = [0], [positions[:1]], [turns[:1]]
    for k in range(1, len(positions)):
        steps = [positions[k : k + 1]]
        if k in middles:
            steps = list(_arc(file, lines[k], *positions[k - 1 : k + 2]))
        elif k - 1 in middles:
            continue
        for row, points in enumerate(steps, k):
            chosen += [row] * len(points)
            points_of_steps.append(points)
            rotations.append(_turning(turns[row - 1], turns[row], len(points)))
    return chosen, np.concatenate(points_of_steps), np.concatenate(rotations)


def _straight(
    labels: Sequence[str],
    positions: Array,
    orientation: str,
    values: Array,
    feeds: Array | None,
    note: str,
) -> PoseRows:
    """Return rows that the tool goes straight through, in rapids where a feed is below 0."""
    rapid = None if feeds is None or not (feeds < 0.0).any() else feeds < 0.0
    are_feeds = feeds is not None and bool((feeds[:-1] != 0.0).all())
    return PoseRows(
        labels,
        positions,
        orientation,
        values,
        None,
        np.abs(feeds) if are_feeds and feeds is not None else None,
        straight=True,
        one_way=True,
        notes=(note,),
        rapid=rapid,
    )


# igus (Commonplace Robotics): X, Y, Z [mm] and A, B, C, of which only places are read.
_IGUS = re.compile(
    r"X\s*[-+.,\dE]+\s*;\s*Y\s*[-+.,\dE]+\s*;\s*Z\s*[-+.,\dE]+\s*(?:;.*)?", re.IGNORECASE
)
_WORD = re.compile(r"\s*([XYZ])\s*([-+.,\dE]{1,40})\s*", re.IGNORECASE)


def _of_igus(file: FilePath, text: str, _: Sequence[str]) -> PoseRows:
    rows, labels = list[list[float]](), list[str]()
    for number, line in enumerate(lines_of(text), 1):
        if not line.strip():
            continue
        if not _IGUS.fullmatch(line.strip()):
            raise FileFormatError(
                f"{file}: line {number}: '{line[:40]}' is not read, expected X …; Y …; Z …; A …; "
                f"B …; C … as igus' programs write them"
            )
        words = filter(None, map(_WORD.fullmatch, line.split(";")))
        # Some computers write decimal commas.
        said = {found[1].upper(): found[2].replace(",", ".") for found in words}
        rows.append([_number(file, number, said.get(key, "")) for key in "XYZ"])
        labels.append(f"line {number}")
    note = (
        "igus: X, Y, Z in mm; A, B, C are passed over, as the form does not say about which axes "
        "they turn in which order: for orientations write a table with columns qw,qx,qy,qz or "
        "roll_deg,pitch_deg,yaw_deg"
    )
    return _straight(labels, _MM * np.array(rows), "", np.zeros((len(rows), 0)), None, note)


# Motion primitives of research code: breakpoints,primitives,points,q_bp, with arrays as texts.
_PRIMITIVES = ("breakpoints", "primitives", "points")
# Primitives → how many points each has.
_POINTS = {"movej": 1, "movel": 1, "movec": 2}
_ARRAY = re.compile(r"array\(\s*\[([^\]]*)\]\s*\)")


def _of_primitives(file: FilePath, text: str, _: Sequence[str]) -> PoseRows:
    reader = csv.DictReader(io.StringIO(text))
    try:
        reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or ()]
        listed = [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise FileFormatError(f"{file}: line {reader.line_num}: is no table: {error}") from error
    rows, labels = list[Array](), list[str]()
    for where, row in listed:
        kind, points = str(row.get("primitives")), _ARRAY.findall(str(row.get("points")))
        expected = next((n for name, n in _POINTS.items() if kind.lower().startswith(name)), 0)
        if not expected or len(points) != expected or (expected == 2 and not rows):
            raise FileFormatError(
                f"{file}: line {where}: motion primitive {shown(kind)} with {len(points)} points "
                f"is not read, expected movel or movej with one, or movec with two (between both "
                f"ends of an arc, and its end) after a first point"
            )
        poses = [[_number(file, where, cell) for cell in each.split(",")] for each in points]
        if any(len(values) != 3 for values in poses):
            raise FileFormatError(f"{file}: line {where}: expected x, y, z in points")
        ends = _MM * np.array(poses)
        added = ends if expected == 1 else np.concatenate(_arc(file, where, rows[-1], *ends))
        rows += list(added)
        labels += [f"line {where}"] * len(added)
    note = (
        "motion primitives: points in mm, joined by straight lines (movej too), and by arcs for "
        "movec; q_bp is passed over"
    )
    positions = np.array(rows).reshape(-1, 3)
    return _straight(labels, positions, "", np.zeros((len(rows), 0)), None, note)


# compas: frames by a point, an x axis and a y axis; print points of compas_slicer around them.
_FRAME = ("point", "xaxis", "yaxis")
# Names of a list of frames.
_LISTS = ("frames", "data")
# Keys of a list of frames that move nothing.
_NAMES = ("dtype", "guid", "name")
_SQUARE = 1e-3


def compas_poses(file: FilePath, document: Any) -> Mapping[str, PoseRows] | None:
    """Return frames of compas, or print points of compas_slicer as seams; None where it has none.

    Raises
    ------
    FileFormatError
        A frame is not one; it is named.
    """
    table = document if isinstance(document, Mapping) else {"": document}
    key = next((name for name in ("", *_LISTS) if _are_frames(table.get(name))), None)
    if key is not None:
        frames = [_inner(item) for item in table[key]]
        labels = [f"{key}[{k}]" for k in range(len(frames))]
        positions, turns = _frames(file, labels, frames)
        note = "compas: points in metres, as compas_fab has them"
        others = [f"'{name}'" for name in table if name not in (key, *_NAMES)]
        note += f"; passed over: {', '.join(others)}" if others else ""
        return {"": _straight(labels, positions, "rotation", turns, None, note)}
    if isinstance(document, Mapping) and document and all(map(_is_layer, document.values())):
        return _print_points(file, document)
    return None


def _are_frames(listed: Any) -> bool:
    return isinstance(listed, list) and bool(listed) and all(map(_is_frame, listed))


def _inner(item: Any) -> Any:
    data = item.get("data") if isinstance(item, Mapping) else None
    return data if isinstance(data, Mapping) else item


def _is_frame(item: Any) -> bool:
    return isinstance(_inner(item), Mapping) and set(_FRAME) <= set(_inner(item))


def _is_layer(item: Any) -> bool:
    return (
        isinstance(item, Mapping)
        and bool(item)
        and all(
            isinstance(path, Mapping)
            and path
            and all(
                isinstance(one, Mapping) and _is_frame(one.get("frame")) for one in path.values()
            )
            for path in item.values()
        )
    )


def _frames(
    file: FilePath, labels: Sequence[str], frames: Sequence[Mapping[str, Any]]
) -> tuple[Array, Array]:
    positions, turns = [], []
    for label, frame in zip(labels, frames, strict=True):
        for key in _FRAME:
            value = frame[key]
            if not (isinstance(value, list) and len(value) == 3 and all(map(is_number, value))):
                raise FileFormatError(f"{file}: {label}: {key} is no list of three numbers")
        x, y = (np.array(frame[key], dtype=np.float64) for key in _FRAME[1:])
        lengths = float(np.linalg.norm(x)), float(np.linalg.norm(y))
        if min(lengths) < _SQUARE or abs(x @ y) > _SQUARE * lengths[0] * lengths[1]:
            raise FileFormatError(f"{file}: {label}: xaxis and yaxis are no two axes of a frame")
        x = x / lengths[0]
        y = y - (y @ x) * x
        y = y / np.linalg.norm(y)
        positions.append(frame["point"])
        turns.append(np.stack([x, y, np.cross(x, y)], axis=1))
    return np.array(positions, dtype=np.float64), np.array(turns)


def _print_points(file: FilePath, document: Mapping[str, Any]) -> Mapping[str, PoseRows]:
    seams: dict[str, PoseRows] = {}
    note = "compas_slicer: points in mm, velocity in mm/s; wait_time and heights are passed over"
    for layer, paths in document.items():
        for path, points in paths.items():
            items, name = list(points.values()), f"{layer} {path}"
            labels = [f"{layer}.{path}.{key}" for key in points]
            frames = [_inner(item["frame"]) for item in items]
            positions, turns = _frames(file, labels, frames)
            feeds = np.array([
                _MM * float(item["velocity"]) if is_number(item.get("velocity")) else 0.0
                for item in items
            ])  # fmt: skip
            # What does not extrude is a travel, which parts what is printed.
            prints = [item.get("extruder_toggle", True) is not False for item in items]
            for number, (first, last) in enumerate(_runs(prints), 1):
                part = slice(first, last + 1)
                whole = first == 0 and last == len(items) - 1
                seams[name if whole else f"{name} {number}"] = _straight(
                    labels[part], _MM * positions[part], "rotation", turns[part], feeds[part], note
                )
    if not seams:
        raise FileFormatError(f"{file}: nothing of it extrudes (extruder_toggle)")
    return {"": next(iter(seams.values()))} if len(seams) == 1 else seams


def _runs(prints: Sequence[bool]) -> list[tuple[int, int]]:
    """Return the first and last points of what is printed: each point extrudes to the next one."""
    runs, first = list[tuple[int, int]](), -1
    for k, extrudes in enumerate(prints):
        if extrudes and first < 0:
            first = k
        if first >= 0 and (not extrudes or k == len(prints) - 1):
            if k > first:
                runs.append((first, k))
            first = -1
    return runs
