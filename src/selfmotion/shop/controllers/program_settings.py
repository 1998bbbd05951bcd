"""Settings of a controller's program besides the motion."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    SelfmotionError,
    as_number,
    as_numbers,
    as_path,
    in_si,
    nearest,
    read_document,
    shown,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.path import pose_of
from selfmotion.model.task import SE3, as_pose

# Where an output of a signal is, and what it becomes.
Signal = tuple[str | int, bool]
_DEVIATION = Tolerance(1e-4, 1e-3)
# Largest mass at a flange [kg].
_HEAVIEST = 3000.0
# Largest distance of its centre from the flange [m].
_FARTHEST = 5.0
# Largest distance of a work object from the arm's base [m].
_FARTHEST_WORK = 50.0
# Word for the frame of the path.
OF_PATH = "path"
# Mechanical units that a KUKA controller has at most.
_UNITS = 16
# Kinds of targets.
TARGETS = ("joints", "poses", "timed-poses")
AXES = tuple(f"{kind}{number}" for kind in "AE" for number in range(1, 7))


@dataclass(frozen=True)
class ProgramSettings:
    """Settings of a program for a controller besides the motion.

    Parameters
    ----------
    deviation : Tolerance
        How far what the controller makes of the targets may be off the motion: the tool's position
        [m] and rotation [rad], and each joint by that angle or length as well. Targets are as many
        as that takes.
    move_deviation : Tolerance, optional
        Likewise of moves through the air. By default as far as they keep apart what has to be, up
        to 5 mm and 5 mrad, and no less than `deviation`.
    axes : mapping, optional
        Joint → axis: ``"A1"`` to ``"A6"`` of the robot, ``"E1"`` to ``"E6"`` for others. By
        default joints that slide, and those of a cell's smaller parts, are others; of an arm with
        seven the third one is E1, as KUKA's LBR and ABB's IRB 14000 count; the rest in order.
    signals : mapping, optional
        Event → output and value, such as ``{"arc on": ("doArc", True)}``; KUKA's and Universal
        Robots' outputs are numbers. None (in files false) for an event that is a comment only.
    flange : str, optional
        The link that is the controller's flange, from which it counts the tool's place; by default
        ``flange`` or ``tool0`` where the tool rides on the same link, else that link itself.
    mass : float, optional
        Of what the flange carries [kg]. ABB's programs need it; in others by default nothing is
        said of it, and the controller goes on with the load that it has.
    center : (3,)
        Its centre of mass from the flange [m].
    approach : float
        How fast the arm goes to the start: of the fastest that its joints may (KUKA, Universal
        Robots) or of 500 mm/s and 100 °/s (ABB).
    targets : str
        ``"joints"``: joint targets; or ``"poses"``: linear motions to tool poses in a work object
        (``MoveL``, ``SPLINE`` with ``SPL`` and ``SLIN``, ``movel``), which can be shifted and
        touched up. A seam at a feed has its feed as their speed, and arcs are circular motions;
        its ramps are then the controller's. ``"timed-poses"``: the same with the times of the plan,
        which takes more of them. Where poses do not keep the motion, joint targets are written all
        the same, and the head of the file says why.
    work_object : str or SE3, optional
        What poses are counted in: a link that stands still or that an external axis carries, a
        pose [m] in the frame that the controller counts its arm from (link ``base``, else the
        world), or ``"path"``: the frame that the path is given in, as its table or workpiece is
        placed. By default the link that the path rides on (`reference`), else the controller's own
        frame.
    positioner : str or int, optional
        The mechanical unit that carries the work object: its name (ABB), or its number in
        ``MACHINE_DEF`` (KUKA).

    Raises
    ------
    ProblemError
        A value is not what it should be.
    """

    deviation: Tolerance = _DEVIATION
    move_deviation: Tolerance | None = None
    axes: Mapping[str, str] | None = None
    signals: Mapping[str, Signal | None] | None = None
    flange: str | None = None
    mass: float | None = None
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    approach: float = 0.1
    targets: str = "joints"
    work_object: str | SE3 | None = None
    positioner: str | int | None = None

    def __post_init__(self) -> None:
        for key in ("deviation", "move_deviation"):
            value = getattr(self, key)
            if not isinstance(value, Tolerance) and (value is not None or key == "deviation"):
                raise ProblemError(f"{key} is {shown(value)}, expected a Tolerance, in m and rad")
        for name in ("axes", "signals"):
            if getattr(self, name) is None:
                continue
            if not isinstance(getattr(self, name), Mapping):
                raise ProblemError(f"{name} is {shown(getattr(self, name))}, expected a mapping")
        for joint, axis in (self.axes or {}).items():
            if axis not in AXES:
                raise ProblemError(
                    f"axes: '{joint}' is axis {shown(axis)}, expected one of A1 to A6, E1 to E6"
                )
        signal_table = self.signals or {}
        signals = {event: _signal(event, value) for event, value in signal_table.items()}
        object.__setattr__(self, "signals", signals)
        if self.flange is not None and not isinstance(self.flange, str):
            raise ProblemError(f"flange is {shown(self.flange)}, expected the name of a link")
        if self.mass is not None:
            mass = as_number(self.mass, "mass", above=0.0)
            if mass > _HEAVIEST:
                raise ProblemError(
                    f"mass: {mass:g} kg is more than any arm carries, expected at most "
                    f"{_HEAVIEST:g}: masses are in kg, not g"
                )
            object.__setattr__(self, "mass", mass)
        center = as_numbers(self.center, "center", "3 finite numbers [m]", (3,))
        if np.abs(center).max() > _FARTHEST:
            raise ProblemError(
                f"center: {np.abs(center).max():g} m is far from any flange, expected at most "
                f"{_FARTHEST:g}: in m, or center_mm in files"
            )
        object.__setattr__(self, "center", tuple(center.tolist()))
        if self.mass is None and center.any():
            raise ProblemError("center: has no effect without a mass; give mass as well")
        approach = as_number(self.approach, "approach", above=0.0, most=1.0)
        object.__setattr__(self, "approach", approach)
        self._check_targets()

    def _check_targets(self) -> None:
        if self.targets not in TARGETS:
            choices = ", ".join(f"'{name}'" for name in TARGETS)
            raise ProblemError(f"targets are {shown(self.targets)}, expected one of {choices}")
        if not (self.work_object is None or isinstance(self.work_object, str)):
            work = as_pose(self.work_object, "work_object", ProblemError)
            far = float(np.abs(work.translation).max())
            if far > _FARTHEST_WORK:
                raise ProblemError(
                    f"work_object: {far:g} m is far from any arm, expected at most "
                    f"{_FARTHEST_WORK:g}; in millimetres? It is in m (position_mm in files)"
                )
            object.__setattr__(self, "work_object", work)
        unit = self.positioner
        named = isinstance(unit, str) and unit.isascii() and unit.isidentifier()
        numbered = isinstance(unit, int) and not isinstance(unit, bool) and 1 <= unit <= _UNITS
        if not (unit is None or named or numbered):
            raise ProblemError(
                f"positioner is {shown(unit)}, expected the name of a mechanical unit (ABB), or "
                f"its number in MACHINE_DEF, 1 to {_UNITS} (KUKA)"
            )
        for key in ("work_object", "positioner"):
            if getattr(self, key) is not None and not self.by_poses:
                raise ProblemError(f"{key}: has no effect on joint targets; give targets='poses'")

    @property
    def by_poses(self) -> bool:
        """Whether targets are tool poses."""
        return self.targets != "joints"

    @property
    def streamed(self) -> "ProgramSettings":
        """Settings of URScript only, which has all joints in their order at each period."""
        return dataclasses.replace(self, deviation=_DEVIATION, move_deviation=None, axes=None)

    def signal(self, event: str) -> Signal | None:
        """Return the output of an event, None for none; KeyError if the table has no such event."""
        return (self.signals or {})[event]

    def knows(self, event: str) -> bool:
        """Whether it is said what an event switches."""
        return event in (self.signals or {})


def read_program_settings(file: str | FilePath, **changes: Any) -> ProgramSettings:
    """Read the settings of a controller's program: TOML or JSON, keys as in `ProgramSettings`.

    ``deviation`` and ``move_deviation`` are tables with ``position`` (or ``position_mm``) and
    ``rotation`` (or ``rotation_deg``); a signal is a list of an output and true or false; a work
    object is the name of a link, or a table as poses of problem files are (``position`` or
    ``position_mm``, and ``rpy_deg`` or another orientation).

    Parameters
    ----------
    file : path
    **changes
        Settings that count in place of the file's, as in `ProgramSettings`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or says something else; file and key are named.
    """
    path = as_path(file)
    try:
        document = read_document(path)
    except FileFormatError as error:
        text = str(error).removeprefix(f"{path}: ")
        raise FileFormatError(f"{path}: {text}") from error
    return program_settings_of(document, str(path), **changes)


def program_settings_of(document: Mapping[str, Any], where: str, **changes: Any) -> ProgramSettings:
    """Return the settings of a table, as `read_program_settings` of a file's.

    Errors begin with `where` the table is from.
    """
    try:
        values: dict[str, Any] = in_si(document)
    except FileFormatError as error:
        raise FileFormatError(f"{where}: {error}") from error
    keys = [item.name for item in dataclasses.fields(ProgramSettings)]
    for key in values:
        if key not in keys:
            raise FileFormatError(
                f"{where}: unknown key '{key}'{nearest(key, keys)}; expected {', '.join(keys)}"
            )
    try:
        for key in {"deviation", "move_deviation"} & set(values):
            value = values[key]
            if not isinstance(value, dict) or set(value) - {"position", "rotation"}:
                raise ProblemError(f"{key}: expected a table of position and rotation")
            values[key] = Tolerance(**{**dataclasses.asdict(_DEVIATION), **value})
        if not isinstance(values.get("work_object", ""), str):
            values["work_object"] = _work_object(values["work_object"])
        return ProgramSettings(**{**values, **changes})
    except SelfmotionError as error:
        raise FileFormatError(f"{where}: {error}") from error
    except ValueError as error:
        raise FileFormatError(f"{where}: work_object: {error}") from error


def _work_object(table: Any) -> SE3:
    """Return the pose of a table, whose rotation vector is no angles in degrees."""
    turn = table.get("rotation_vector", ()) if isinstance(table, Mapping) else ()
    pose = pose_of(table)
    angle = float(np.linalg.norm(np.asarray(turn, dtype=np.float64)))
    if angle > np.pi * (1.0 + 1e-4):
        raise ProblemError(
            f"work_object: has a rotation vector of {angle:.4g} rad, more than half a turn; in "
            f"degrees, or angles about axes? Expected the axis of one turn, as long as its angle "
            f"in rad: 0, 0, 1.5708 is 90° about z"
        )
    return pose


def _signal(event: object, setting: object) -> Signal | None:
    # Files have no None.
    if setting is None or setting is False:
        return None
    if isinstance(setting, list | tuple) and len(setting) == 2:
        output, value = setting
        named = isinstance(output, str) and output.isascii() and output.isidentifier()
        numbered = isinstance(output, int) and not isinstance(output, bool) and 0 <= output < 8192
        if isinstance(value, bool) and (named or numbered):
            return output, value
    raise ProblemError(
        f"signals: '{event}' is {shown(setting)}, expected an output (its name or number) and "
        f"whether it becomes true"
    )
