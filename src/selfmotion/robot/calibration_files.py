"""Files that say how one arm differs from its drawing."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, RobotError, is_number, nearest, shown

# What Universal Robots' kinematics file has for each of its six frames, and their names.
FRAMES = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
_COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
# Corrections of Denavit-Hartenberg parameters in their calibration.conf.
DELTAS = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
_DELTA = re.compile(r"^\s*(delta_\w+)\s*=\s*\[([^\]]*)\]", re.MULTILINE)
_PLACEMENT = ("position", "rpy")


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """What a calibration file holds; what it does not is empty.

    Attributes
    ----------
    file : Path
    frames : tuple of pinocchio.SE3
        Of Universal Robots: each of six frames in the one before.
    deltas : (4, 6) or None
        Of Universal Robots: corrections of θ [rad], a [m], d [m], α [rad] of each joint.
    placements : dict
        Joint → where its frame is in that of its parent link.
    offsets : dict
        Joint → its coordinate where it says zero [rad or m].
    """

    file: Path
    frames: tuple[pin.SE3, ...] = ()
    deltas: Array | None = None
    placements: Mapping[str, pin.SE3] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)


def read_calibration(file: Path) -> CalibrationFile:
    """Read a calibration from a ``.yaml``, ``.toml`` or ``.conf`` file.

    Raises
    ------
    RobotError
        The file cannot be read, or holds something else; the key is named.
    """
    try:
        text = file.read_text("utf-8-sig")
    except OSError as error:
        raise RobotError(f"{file}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise RobotError(f"{file}: is not UTF-8 text: {error}") from error
    if file.suffix == ".conf":
        return CalibrationFile(file, deltas=_deltas(file, text))
    table = _table(file, text)
    if set(table) == {"kinematics"}:
        return CalibrationFile(file, frames=_frames(file, table["kinematics"]))
    unknown = [key for key in table if key not in ("joints", "offsets")]
    if unknown or not table:
        raise RobotError(
            f"{file}: has {', '.join(map(shown, unknown)) or 'nothing'}, expected 'kinematics' "
            f"(Universal Robots), or 'joints' (position and rpy of each) and 'offsets' (a number "
            f"for each)"
        )
    joints, offsets = table.get("joints", {}), table.get("offsets", {})
    for key, given in (("joints", joints), ("offsets", offsets)):
        if not isinstance(given, Mapping):
            raise RobotError(f"{file}: '{key}' is {shown(given)}, expected a table of joints")
    placements = {str(name): _placement(file, str(name), given) for name, given in joints.items()}
    for name, given in offsets.items():
        if not is_number(given) or not np.isfinite(given):
            raise RobotError(f"{file}: offsets: {name} is {shown(given)}, expected a number")
    zeros = {str(name): float(given) for name, given in offsets.items()}
    return CalibrationFile(file, placements=placements, offsets=zeros)


def _table(file: Path, text: str) -> Mapping[str, Any]:
    import tomllib

    import yaml

    try:
        found = tomllib.loads(text) if file.suffix == ".toml" else yaml.safe_load(text)
    except (tomllib.TOMLDecodeError, yaml.YAMLError, ValueError, RecursionError) as error:
        told = " ".join(str(error).split())
        raise RobotError(f"{file}: cannot be read: {told}") from error
    if not isinstance(found, Mapping):
        raise RobotError(f"{file}: holds {shown(found)}, expected a table of keys")
    return found


def _deltas(file: Path, text: str) -> Array:
    found = {key: values for key, values in _DELTA.findall(text) if key in DELTAS}
    rows = []
    for key in DELTAS:
        if key not in found:
            raise RobotError(f"{file}: has no '{key}', expected {', '.join(DELTAS)}")
        try:
            row = [float(value) for value in found[key].split(",")]
        except ValueError:
            row = []
        if len(row) != len(FRAMES) or not np.isfinite(row).all():
            raise RobotError(f"{file}: {key} is [{found[key]}], expected six numbers")
        rows.append(row)
    return np.array(rows)


def _frames(file: Path, given: Any) -> tuple[pin.SE3, ...]:
    if not isinstance(given, Mapping):
        raise RobotError(f"{file}: 'kinematics' is {shown(given)}, expected a table of frames")
    found = []
    for frame in FRAMES:
        values = given.get(frame)
        if not isinstance(values, Mapping):
            raise RobotError(f"{file}: kinematics: has no frame '{frame}'")
        numbers = []
        for key in _COORDINATES:
            value: Any = values.get(key)
            if not is_number(value) or not np.isfinite(value):
                raise RobotError(
                    f"{file}: kinematics: {frame}: {key} is {shown(value)}, expected a number"
                )
            numbers.append(float(value))
        found.append(_pose(numbers[:3], numbers[3:]))
    unknown = [str(key) for key in given if key not in (*FRAMES, "hash")]
    if unknown:
        raise RobotError(
            f"{file}: kinematics: has '{unknown[0]}'{nearest(unknown[0], FRAMES)}; frames: "
            f"{', '.join(FRAMES)}"
        )
    return tuple(found)


def _placement(file: Path, joint: str, given: Any) -> pin.SE3:
    if not isinstance(given, Mapping) or set(given) != set(_PLACEMENT):
        raise RobotError(f"{file}: joints: {joint} is {shown(given)}, expected position and rpy")
    numbers = []
    for key in _PLACEMENT:
        values = given[key]
        three = isinstance(values, list) and len(values) == 3 and all(map(is_number, values))
        if not three or not np.isfinite(values).all():
            raise RobotError(
                f"{file}: joints: {joint}: {key} is {shown(values)}, expected three numbers"
            )
        numbers.append([float(value) for value in values])
    return _pose(*numbers)


def _pose(position: Sequence[float], rpy: Sequence[float]) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(position))
