"""Files that say how one arm differs from its drawing."""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from selfmotion.basics import (
    Array,
    FileFormatError,
    RobotError,
    is_number,
    nearest,
    number_in,
    read_document,
    shown,
)

# Frames of Universal Robots' kinematics file.
FRAMES = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
# Their coordinates there.
_COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
# Corrections of Denavit-Hartenberg parameters in their calibration.conf.
DELTAS = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
_DELTA = re.compile(r"^\s*(delta_\w+)\s*=\s*\[([^\]]*)\]", re.MULTILINE)
# Keys of a joint's placement.
_PLACEMENT = ("position", "rpy")


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """Content of a calibration file; missing values are empty.

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

    @property
    def units(self) -> str:
        """The units that its numbers are taken to be in, in words: no such file says them."""
        if self.frames or self.deltas is not None:
            return "lengths are taken for metres and angles for radians, as Universal Robots has it"
        return (
            "position is taken for metres, rpy for radians about fixed axes, offsets for radians "
            "(metres of joints that slide)"
        )


def read_calibration(file: Path) -> CalibrationFile:
    """Read a calibration from a ``.yaml``, ``.toml`` or ``.conf`` file.

    Raises
    ------
    RobotError
        The file cannot be read, or holds something else; the key is named.
    """
    if file.suffix == ".conf":
        try:
            text = file.read_text("utf-8-sig")
        except OSError as error:
            raise RobotError(f"{file}: cannot be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise RobotError(f"{file}: is not UTF-8 text: {error}") from error
        return CalibrationFile(file, deltas=_deltas(file, text))
    table = _table(file)
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


def _table(file: Path) -> Mapping[str, Any]:
    try:
        return read_document(file)
    except FileFormatError as error:
        raise RobotError(str(error)) from error


def _deltas(file: Path, text: str) -> Array:
    found = {key: values for key, values in _DELTA.findall(text) if key in DELTAS}
    rows = []
    for key in DELTAS:
        if key not in found:
            raise RobotError(f"{file}: has no '{key}', expected {', '.join(DELTAS)}")
        read = [number_in(value) for value in found[key].split(",")]
        row = [value for value in read if value is not None and np.isfinite(value)]
        if not len(row) == len(read) == len(FRAMES):
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


# Calibrations of Universal Robots: from the maker's frames to those of any URDF of the arm.
#
# The maker describes the arm by frames whose z axes are the joint axes; a file gives each in the
# one before (`ur_description`, ``default_kinematics.yaml``), or corrections of the Denavit-
# Hartenberg parameters (``calibration.conf`` of the controller; "DH parameters for calculations
# of kinematics and dynamics", universal-robots.com). A URDF may have its links elsewhere along
# the same axes. What is between both at the nominal lengths stays, so that links, bodies and
# tools keep their frames.

JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
# Difference of axes of a URDF from the maker's that counts as rounding [m, rad].
_ALIKE = 1e-6
# A quarter turn [rad].
_QUARTER = 0.5 * np.pi
# α of the maker's Denavit-Hartenberg parameters.
_ALPHA = (_QUARTER, 0.0, 0.0, _QUARTER, -_QUARTER, 0.0)


class UrdfAxis(NamedTuple):
    """A joint of the URDF: its frame in that of its parent link, and its axis in its own."""

    placement: pin.SE3
    axis: Array


class _Lengths(NamedTuple):
    """Nominal Denavit-Hartenberg lengths [m]."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float


def maker_placements(
    joints: Sequence[UrdfAxis], tool: pin.SE3, calibration: CalibrationFile
) -> list[pin.SE3]:
    """Return the placements of a URDF's six joints by a calibration, each in its parent link.

    Parameters
    ----------
    joints : sequence of UrdfAxis
        As they are drawn, each in the link that the one before moves.
    tool : pinocchio.SE3
        The flange's frame ``tool0`` in the link of the last joint.
    calibration : CalibrationFile

    Raises
    ------
    RobotError
        The axes are not those of such an arm.
    """
    base = _base(joints)
    drawn = _chain([base.inverse() * joints[0].placement, *(item.placement for item in joints[1:])])
    lengths = _lengths(drawn, drawn[-1] * tool)
    nominal = _nominal(lengths)
    beside = [ours.inverse() * urdf for ours, urdf in zip(nominal, drawn, strict=True)]
    for number, (placed, joint) in enumerate(zip(beside, joints, strict=True)):
        off = max(
            float(np.abs(placed.translation[:2]).max()),
            float(np.abs(placed.rotation @ joint.axis - [0.0, 0.0, 1.0]).max()),
        )
        # Written so that NaN is refused.
        if not off <= _ALIKE:
            raise RobotError(
                f"{calibration.file}: is a calibration of Universal Robots, but the axis of "
                f"'{JOINTS[number]}' is {off:.2g} m or rad off that of such an arm"
            )
    if calibration.deltas is None:
        measured = _chain(calibration.frames)
    else:
        measured = _corrected(lengths, calibration.deltas, nominal, calibration.file)
    ends = [base, *(frame.inverse() for frame in beside[:-1])]
    steps = [measured[0], *(a.inverse() * b for a, b in itertools.pairwise(measured))]
    return [before * step * after for before, step, after in zip(ends, steps, beside, strict=True)]


def _base(joints: Sequence[UrdfAxis]) -> pin.SE3:
    """Return the maker's base frame in the link that carries the arm: the arm points along -x."""
    elbow = joints[0].placement * joints[1].placement * joints[2].placement
    half = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi), np.zeros(3))
    return half if elbow.translation[0] > 0.0 else pin.SE3.Identity()


def _chain(steps: Sequence[pin.SE3]) -> list[pin.SE3]:
    """Return frames that are given each in the one before, in the first one's base."""
    found = [steps[0]]
    for step in steps[1:]:
        found.append(found[-1] * step)
    return found


def _turned(angle: float) -> pin.SE3:
    """Return a rotation about x."""
    return pin.SE3(pin.rpy.rpyToMatrix(angle, 0.0, 0.0), np.zeros(3))


def _moved(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def _lengths(drawn: Sequence[pin.SE3], tool: pin.SE3) -> _Lengths:
    """Return the lengths of a URDF, whose frames are somewhere on their axes."""
    d1 = float(drawn[1].translation[2])
    upper = (_moved(0.0, 0.0, d1) * _turned(_QUARTER)).inverse()
    elbow, first, second, last = ((upper * frame).translation for frame in drawn[2:])
    tip = (upper * tool).translation
    a2, a3 = float(elbow[0]), float(first[0] - elbow[0])
    return _Lengths(d1, a2, a3, float(second[2]), float(-last[1]), float(tip[2] - second[2]))


def _nominal(lengths: _Lengths) -> list[pin.SE3]:
    """Return the maker's frames at these lengths, all joints at zero, in the base."""
    return _chain(
        [
            _moved(0.0, 0.0, lengths.d1),
            _turned(_QUARTER),
            _moved(lengths.a2, 0.0, 0.0),
            _moved(lengths.a3, 0.0, lengths.d4),
            _moved(0.0, -lengths.d5, 0.0) * _turned(_QUARTER),
            _moved(0.0, lengths.d6, 0.0) * _turned(-_QUARTER),
        ]
    )


def _corrected(
    lengths: _Lengths, deltas: Array, nominal: Sequence[pin.SE3], file: Path
) -> list[pin.SE3]:
    """Return the maker's frames with corrected parameters.

    T = Rz(θ + Δθ) Tz(d + Δd) Tx(a + Δa) Rx(α + Δα) for each joint. Axes that are all but parallel
    have corrections along them that are metres long and cancel out: the frames are put where they
    are nearest to the nominal ones, along and about their axes, which changes no motion.
    """
    theta, a, d, alpha = deltas
    if abs(a[5]) > 0.0 or abs(alpha[5]) > 0.0:
        raise RobotError(
            f"{file}: delta_a and delta_alpha of the last joint are {a[5]:g} and "
            f"{alpha[5]:g}, expected 0: its axis would not be the flange's"
        )
    a = a + np.array([0.0, lengths.a2, lengths.a3, 0.0, 0.0, 0.0])
    d = d + np.array([lengths.d1, 0.0, 0.0, lengths.d4, lengths.d5, lengths.d6])
    place, found = pin.SE3.Identity(), []
    for k in range(6):
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, theta[k]), np.zeros(3))
        found.append(_nearest_on_axis(place * turn, nominal[k]))
        place = place * turn * _moved(a[k], 0.0, d[k]) * _turned(_ALPHA[k] + alpha[k])
    # The last one is the flange's axis.
    return [*found[:5], place]


def _nearest_on_axis(frame: pin.SE3, wanted: pin.SE3) -> pin.SE3:
    """Return a frame moved along and turned about its z axis to be nearest to another one."""
    difference = frame.inverse() * wanted
    turn = np.arctan2(difference.rotation[1, 0], difference.rotation[0, 0])
    along = _moved(0.0, 0.0, float(difference.translation[2]))
    return frame * along * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, turn), np.zeros(3))
