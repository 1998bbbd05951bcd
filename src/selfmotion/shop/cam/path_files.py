"""Paths from files: tables, arrays, lists of poses, programs of machine tools, drawings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    FileFormatError,
    as_flag,
    as_number,
    as_path,
)
from selfmotion.model.path import Path
from selfmotion.shop.cam.cldata import read_cldata
from selfmotion.shop.cam.drawing import read_drawing
from selfmotion.shop.cam.gcode import read_gcode
from selfmotion.shop.cam.path_building import JUMP, Pacing, path_of_rows
from selfmotion.shop.cam.peers import peer_table
from selfmotion.shop.cam.pose_arrays import read_array
from selfmotion.shop.cam.pose_lists import read_poses
from selfmotion.shop.cam.pose_rows import (
    ARRAY,
    CLDATA,
    DRAWING,
    PROGRAMS,
    READING,
    TABLES,
    PoseRows,
    Reading,
    no_such_seam,
)
from selfmotion.shop.cam.pose_tables import read_tables


def _read_table(file: FilePath, reading: Reading) -> Mapping[str, PoseRows]:
    """Return the poses of a table in the form of another program, or by its header."""
    peers = None if reading.columns else peer_table(file)
    return read_tables(file, reading) if peers is None else peers


# Suffix → reader of the poses of each seam.
_READERS: Mapping[str, Callable[[FilePath, Reading], Mapping[str, PoseRows]]] = {
    **dict.fromkeys(TABLES, _read_table),
    ARRAY: lambda file, reading: {"": read_array(file, reading)},
    **dict.fromkeys((".yaml", ".yml", ".json"), lambda file, _: read_poses(file)),
    **dict.fromkeys(PROGRAMS, read_gcode),
    **dict.fromkeys(CLDATA, lambda file, reading: read_cldata(file, reading.unit)),
}
# Suffixes of robot programs, which are not read as paths → the maker.
_ROBOT_PROGRAMS = {
    ".mod": "ABB",
    ".prg": "ABB",
    ".src": "KUKA",
    ".dat": "KUKA",
    ".script": "Universal Robots",
    ".urscript": "Universal Robots",
    ".ls": "Fanuc",
    ".tp": "Fanuc",
    ".jbi": "Yaskawa",
    ".as": "Kawasaki",
    ".pg": "Kawasaki",
    ".pdl": "Comau",
    ".pgx": "Stäubli",
    ".urp": "Universal Robots",
}
# Suffixes of files that are always paths.
PATH_SUFFIXES = (*TABLES, *PROGRAMS, *CLDATA, DRAWING)


def read_path(
    file: str | FilePath,
    *,
    feed: float | None = None,
    duration: float | None = None,
    jump: float = JUMP,
    corners: str = "blend",
    tolerance: float = 1e-3,
    corner_angle: float | None = None,
    turn_rate: float | None = None,
    acceleration: float | None = None,
    turn_acceleration: float | None = None,
    smoothing: float | None = None,
    within: float | None = None,
    seam: str | None = None,
    ramp: float | None = None,
    flip_normals: bool = False,
    standoff: float = 0.0,
    along: str | None = None,
    lead: float = 0.0,
    tilt: float = 0.0,
    lift: float = 0.0,
    columns: Sequence[str] | str | None = None,
    rotary: str | None = None,
    rotary_axes: Sequence[str] | str | None = None,
    rotary_center: npt.ArrayLike | None = None,
    unit: str | None = None,
) -> Path:
    """Read the path of a tool through the poses of a file.

    - ``.csv .txt .tsv``: columns in any order: ``t`` [s], ``x,y,z`` [m], and one of
      ``qw,qx,qy,qz``, ``rx,ry,rz`` (rotation vector [rad]), ``roll,pitch,yaw`` [rad],
      ``nx,ny,nz`` (the tool's z axis) or none; ``feed`` [m/s] from a pose on, instead of ``t``;
      ``x_mm``, ``x_cm``, ``x_in``, ``feed_mm`` and ``roll_deg`` are in those units, as is ``X
      [mm]``; ``pos_x``, ``pose.position.x``, ``px`` and ``tx`` are ``x``, and ``orientation.x`` and
      ``quat_x`` are ``qx``; ``a,b,c`` are KUKA's, and ``x,y,z`` beside them in mm; ``seam`` names
      the seam that a pose is of, ``event`` what happens there (``arc on; gas on``: both)
    - ``.npy``: (N, 4, 4) poses, (N, 3) x,y,z or (N, 4) t,x,y,z; any other table
      with `columns`, which say in which order quaternions are
    - ``.yaml .json``: ROS ``nav_msgs/Path``, ``geometry_msgs/PoseArray``, or poses in a list or by
      names (``waypoints``, ``poses``, parameters of a node): ``position`` and ``orientation``,
      columns of a table by name, or 4 × 4 matrices
    - tables of IRBCAM (arcs as well), igus (places only) and of motion primitives, frames of compas
      and print points of compas_slicer, by their titles; what their numbers mean is in a note
    - ``.nc .ngc .gcode .tap .cnc .eia .mpf .g .gc .gco``: G-code of up to five axes, below
    - ``.apt .aptsource .cls .clsf .cl .ncl``: APT, cutter location data, below
    - ``.dxf``: a drawing, below; with ``pip install 'selfmotion[dxf]'``

    Of programs of machine tools, what goes at a feed is a cut, with the rapids along the tool's
    axis to it and from it, at up to 100 mm/s; all other rapids part cuts, called ``cut 1``,
    ``cut 2``, …. Legs are straight, their corners rounded within `tolerance`, and the tool rests
    where it goes back on itself. Positions are those of the tip. The tool's z axis points into the
    part, against the axis of the machine: down where the file has none. About it the tool turns as
    little as possible.

    - G-code: ``G0 G1 G2 G3 G17 G18 G19 G20 G21 G90 G91 G93 G94``, ``X Y Z`` in mm unless
      ``G20``, ``F`` by the minute, of the tip along the part (``G93``: lines a minute); the tool's
      axis by ``A B C``, Rz(C) Ry(B) Rx(A) z, after ``G43.4 G43.5`` or as `rotary` says, or by ``I J
      K`` in lines. Arcs lie in the plane that is chosen, by offsets of their centre from the start
      or ``R``, of their centre itself after ``G90.1``, ``P`` times round, as chords within 0.01 mm.
      ``G73 G81 G82 G83 G85 G89`` drill holes along Z (``X Y Z R Q P``, ``G98 G99``), until ``G80``.
      Without any ``Z`` it is 0. ``M2 M30`` end it, other ``M`` and ``G4`` are events;
      ``G28 G30 G53`` go up as high as the tool has been, with a note; ``G9 G15
      G40 G43 G49 G50.1 G61 G64 G67 G69``, one of ``G54`` to ``G59``, ``N O S T H D P Q``, ``%`` and
      comments are passed over, with a note where ``S`` changes from cut to cut
    - G-code of printers, where lines have ``E``: what extrudes is a cut, what does not a travel.
      ``M82 M83 G92 E`` set what E means; ``retract`` and ``prime`` are events, as are commands,
      but for those that move a zero (``M206``, ``SET_GCODE_OFFSET``, …), which are refused
    - APT: ``GOTO FROM GODLTA GOHOME RAPID FEDRAT UNITS TLAXIS``, with ``i,j,k`` the tool's axis,
      feeds by the minute (``MMPM``, ``IPM``). Arcs are ``CIRCLE/x,y,z,i,j,k,r`` or ``MOVARC``
      before a ``GOTO``, right-handed about their axis, those of NX, which have 11 numbers,
      left-handed; and ``INDIRV`` with ``TLON,GOFWD``, as CATIA writes them. ``CYCLE/DRILL``,
      ``DEEP`` and ``BRKCHP`` drill a hole at each ``GOTO`` (``FEDTO RAPTO STEP``, …), until
      ``CYCLE/OFF``. ``SPINDL COOLNT AUXFUN ARCON ARCOFF STOP OPSTOP DELAY`` are events; names,
      texts, the cutter's shape and number (``LOADTL``, …) are passed over, and ``CUTCOM``,
      ``INSERT`` and another tool with a note; ``FINI`` or ``END`` ends it. After another ``MSYS``
      places are those of the first one; another ``OFSTNO`` or ``SETUP`` is refused. Lengths are in
      mm where neither ``UNITS`` nor `unit` says otherwise; feeds in another unit are refused then

    A hole is a cut of its own, straight down at the feed and out again, out and where it is drilled
    already in rapids.

    Any other word or statement is refused, by its line.

    Of drawings, what is drawn in model space on one layer is joined end to end, where ends are
    within 0.01 mm of each other and no third one is there. A stroke has the name of its layer,
    with a number where the layer has several, and the direction of what was drawn first of it.
    ``LINE ARC CIRCLE ELLIPSE SPLINE LWPOLYLINE POLYLINE`` and blocks of them are read, curves as
    chords within 0.01 mm, which are followed as legs of a cut; texts, dimensions, hatches and
    points are passed over with a note, and any other entity is refused by its handle, but not on
    layers that are off or frozen, nor beside the layer of `seam`. The unit is `unit`, or
    that of ``$INSUNITS``; none is refused. The tool's z axis points down, against that of the
    drawing. A feed has to be given.

    Parameters
    ----------
    file : path
    feed : float, optional
        Speed of the tool [m/s], from rest to rest, where the file has no times; see `Feed`.
    duration : float, optional
        Or the time of the whole motion [s], from rest to rest, at about constant speed in between.
    jump : float
        Distance from one pose to the next [m] that is refused.
    corners : {"blend", "stop", "round"}
        What to do in kinks: swing through the pose or rest in it as `Waypoints` do, or, with a
        feed, pass it within `tolerance` between straight legs as a `Polyline` does.
    tolerance : float
        [m].
    corner_angle : float, optional
        As in `Waypoints`.
    turn_rate, acceleration, turn_acceleration, smoothing, within : float, optional
        Bounds of a feed, as in `Feed`.
    seam : str, optional
        Which of several seams, cuts or strokes of the file.
    ramp : float, optional
        In so long [s] it is run up from rest, and down again; see `section_at_rest`. Of a duration
        it is a part: by default a quarter, at most 0.5 s.
    flip_normals : bool
        Whether ``nx,ny,nz`` point out of the part, as surface normals of CAD do.
    standoff : float
        How far the tool's tip is held back from the poses, along its z axis [m].
    along : {"x", "-x", "y", "-y"}, optional
        Which axis of the tool is along the path, as of a knife or a nozzle; its z axis is that of
        the file, or points down. Legs are straight; in corners the tool turns on the spot (corners
        "stop") or within `tolerance` ("round"), and in bends smaller than `corner_angle` on its
        way.
    lead : float
        By how much its z axis leans towards where it goes then [rad]; below 0 it lags.
    tilt : float
        By how much it leans to the left of where it goes, seen from the holder [rad]; below 0 to
        the right.
    lift : float
        How far the tool leaves corners along its own z axis, before `lead` and `tilt`, to turn
        there and come back [m], with corners "stop". It is lifted at no feed that is judged.
    columns : sequence of str, optional
        Names of the columns of a table or of an array, in place of a header or where there is none;
        "-" leaves one out.
    rotary : {"head", "table"}, optional
        What ``A B C`` of G-code turn, where it does not say ``G43.4``: the head, positions being
        those of the tip in the part, or a table with the part on it, positions being the machine's.
    rotary_axes : str or sequence of str
        A table's axes, from the machine to the part: ``"BC"`` for a C axis on a B axis, ``"AC"``,
        or one. Positive words move the tool right-handed about the axis relative to the part (ISO
        841); ``["B", "-C"]`` where a positive C turns the table right-handed. With ``rotary =
        "head"`` the axes of a table under tool centre point control.
    rotary_center : (3,)
        A point on all of a table's axes, in the program's coordinates [m].
    unit : {"mm", "cm", "dm", "m", "in", "ft"}, optional
        Of a drawing or APT that says none, or another one than it is written in.

    Raises
    ------
    FileFormatError
        The file cannot be read, or a row cannot be used: not finite, a zero quaternion, times that
        do not increase, a jump, other units. The line, pose or entity is named.
    ProblemError
        A drawing, and the package that reads them is not installed.
    """
    path = as_path(file)
    pacing = _pacing(
        path,
        {
            "feed": feed,
            "duration": duration,
            "jump": jump,
            "corners": corners,
            "tolerance": tolerance,
            "corner_angle": corner_angle,
            "turn_rate": turn_rate,
            "acceleration": acceleration,
            "turn_acceleration": turn_acceleration,
            "smoothing": smoothing,
            "within": within,
            "ramp": ramp,
            "standoff": standoff,
            "along": along,
            "lead": lead,
            "tilt": tilt,
            "lift": lift,
        },
    )
    table = {"rotary": rotary, "rotary_axes": rotary_axes, "rotary_center": rotary_center}
    reading = Reading.of(path, {"columns": columns, "unit": unit, **table})
    rows = _facing(path, one_seam(path, seam, reading), flip_normals)
    return path_of_rows(path, rows, pacing)


def read_seams(file: FilePath, options: Mapping[str, Any]) -> dict[str, tuple[Path, PoseRows]]:
    """Read all seams or cuts of a file: name → path, and the poses that it is made of.

    Options are those of `read_path`.

    Raises
    ------
    FileFormatError
        As by `read_path`, or the file names no seams.
    """
    own = {key: options[key] for key in READING if key in options}
    options = {key: value for key, value in options.items() if key not in own}
    seams = _read(file, None, Reading.of(file, own))
    if "" in seams:
        raise FileFormatError(
            f"{file}: has no column 'seam', expected one that names the seam of each row"
        )
    flips, pacing = options.pop("flip_normals", False), _pacing(file, options)
    return {
        name: (path_of_rows(file, _facing(file, rows, flips), pacing), rows)
        for name, rows in seams.items()
    }


def _facing(file: FilePath, rows: PoseRows, flips: bool) -> PoseRows:
    """Return rows whose normals point into the part, the other way where they are to be flipped."""
    if not as_flag(flips, f"{file}: flip_normals", FileFormatError):
        return rows
    if rows.orientation != "normal":
        raise FileFormatError(
            f"{file}: flip_normals has no effect: it has no columns nx,ny,nz; drop it"
        )
    return replace(rows, values=-rows.values)


def _pacing(path: FilePath, options: Mapping[str, Any]) -> Pacing:
    pacing = Pacing(**options)
    as_number(pacing.jump, f"{path}: jump", above=0.0, error=FileFormatError)
    as_number(pacing.standoff, f"{path}: standoff", error=FileFormatError)
    for name, angle in (("lead", pacing.lead), ("tilt", pacing.tilt)):
        lean = as_number(angle, f"{path}: {name}", error=FileFormatError)
        if not abs(lean) < 0.5 * np.pi:
            raise FileFormatError(
                f"{path}: {name} is {lean:g} rad, expected less than a quarter turn"
            )
    as_number(pacing.lift, f"{path}: lift", least=0.0, error=FileFormatError)
    for name, value in (("feed", pacing.feed), ("duration", pacing.duration)):
        if value is not None:
            as_number(value, f"{path}: {name}", above=0.0, error=FileFormatError)
    return pacing


def _read(path: FilePath, seam: str | None, reading: Reading) -> Mapping[str, PoseRows]:
    """Return the poses of a file by the names of its seams; of a drawing those of one layer."""
    suffix = path.suffix.lower()
    if suffix == DRAWING:
        return read_drawing(path, seam, reading.unit)
    reader = _READERS.get(suffix)
    if reader is None:
        known = ", ".join((*_READERS, DRAWING))
        if suffix in _ROBOT_PROGRAMS:
            raise FileFormatError(
                f"{path}: is a program of a robot ({_ROBOT_PROGRAMS[suffix]}): as a path it is not "
                f"read. One that selfmotion wrote is judged by `selfmotion check`; of another one "
                f"write its targets as a table (x_mm,y_mm,z_mm and qw,qx,qy,qz or "
                f"roll_deg,pitch_deg,yaw_deg; feed_mm), or as G-code"
            )
        raise FileFormatError(f"{path}: has suffix '{path.suffix}', expected one of {known}")
    return reader(path, reading)


def events_of(file: FilePath, options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the events of a path from a file, without duplicates; none if it cannot be read."""
    try:
        rows = one_seam(file, options.get("seam"), Reading.of(file, options))
        return tuple(dict.fromkeys(event for _, event in rows.events))
    except FileFormatError:
        return ()


def has_normals(file: FilePath, options: Mapping[str, Any]) -> bool:
    """Return whether the tool's axis is given by normals; False if the file cannot be read."""
    try:
        rows = one_seam(file, options.get("seam"), Reading.of(file, options))
    except FileFormatError:
        return False
    return rows.orientation == "normal"


def one_seam(path: FilePath, seam: str | None, reading: Reading) -> PoseRows:
    """Return the poses of one seam of a file, which may be left out where the file has one."""
    seams = _read(path, seam, reading)
    if seam is None and len(seams) == 1:
        return next(iter(seams.values()))
    if seam is not None and seam in seams:
        return seams[seam]
    names = [name for name in seams if name]
    if seam is None:
        raise FileFormatError(
            f"{path}: has {len(seams)} seams or cuts, {names[0]} to {names[-1]}: choose one by "
            f"seam = '{names[0]}', or plan all of them as a job, with [seams] and this file"
        )
    if not names:
        raise FileFormatError(f"{path}: names no seams, so that seam has no effect; drop it")
    raise no_such_seam(path, seam, names)
