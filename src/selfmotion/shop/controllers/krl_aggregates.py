"""Aggregates of the KUKA Robot Language: axes (E6AXIS), tool poses (E6POS) and frames (FRAME)."""

from collections.abc import Mapping

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.pose_numbers import krl_numbers, krl_pose
from selfmotion.shop.controllers.program_reader import ProgramReader
from selfmotion.shop.controllers.program_settings import AXES
from selfmotion.shop.controllers.program_writer import WrittenPose
from selfmotion.shop.controllers.segment_building import Pose, pose_of_values

# Regular expressions of axes, and of a pose or frame.
_AXIS = r"[AE][1-6]\s+[^,{}]+"
AXES_PATTERN = rf"\{{\s*(?:E6AXIS\s*:|AXIS\s*:)?\s*{_AXIS}(?:,\s*{_AXIS})*\}}"
_COORDINATE = r"[A-Z][1-6]?\s+[^,{}]+"
POSE_PATTERN = rf"\{{\s*(?:E6POS\s*:|POS\s*:|FRAME\s*:)?\s*{_COORDINATE}(?:,\s*{_COORDINATE})*\}}"


def read_axes(reader: ProgramReader, text: str) -> list[float]:
    """Return the axes of an ``E6AXIS`` aggregate that the robot has, in order [° or mm]."""
    values = _values(reader, text)
    names = [name for name in AXES if name in values]
    reader.check_axes(names)
    return [values[name] for name in names]


def write_axes(axes: Mapping[str, str]) -> str:
    """Return the aggregate of axes from their texts, name → text."""
    return "{" + ", ".join(f"{name} {text}" for name, text in axes.items()) + "}"


def read_pose(reader: ProgramReader, text: str) -> Pose:
    """Return the tool pose of an ``E6POS`` aggregate, with its external axes."""
    # Status and turn are left out: linear motions keep those of where they begin.
    values = _values(reader, text)
    external = {name: value for name, value in values.items() if name.startswith("E")}
    position, quaternion = krl_pose(_pose_numbers(reader, values))
    return Pose(position, quaternion, reader.external_axes(external), reader.lines.number)


def write_pose(pose: WrittenPose) -> str:
    """Return the ``E6POS`` aggregate of a tool pose."""
    numbers = zip("XYZABC", krl_numbers(pose.position, pose.quaternion), strict=True)
    parts = [f"{name} {value:.5f}" for name, value in numbers]
    parts += [pose.configuration] if pose.configuration else []
    parts += [f"{name} {text}" for name, text in pose.axes.items() if name.startswith("E")]
    return "{" + ", ".join(parts) + "}"


def read_frame(reader: ProgramReader, text: str) -> SE3:
    """Return the transform of a ``FRAME`` aggregate."""
    position, quaternion = krl_pose(_pose_numbers(reader, _values(reader, text)))
    return pose_of_values([*position.tolist(), *quaternion.tolist()])


def write_frame(pose: SE3) -> str:
    """Return the ``FRAME`` aggregate of a transform."""
    quaternion = np.array(Quaternion(pose.rotation).coeffs())
    return write_pose(WrittenPose(np.array(pose.translation), quaternion, {}))


def _values(reader: ProgramReader, text: str) -> dict[str, float]:
    """Return the numbers of an aggregate by their names; FileFormatError where one is twice."""
    values: dict[str, float] = {}
    for item in text.strip("{} ").rpartition(":")[2].split(","):
        name, _, digits = item.strip().partition(" ")
        name = name.upper()
        if name in values:
            raise reader.lines.fault(f"axis {name} is there twice")
        values[name] = reader.lines.coordinate(digits)
    return values


def _pose_numbers(reader: ProgramReader, values: Mapping[str, float]) -> Array:
    """Return X, Y, Z, A, B, C, (6,); FileFormatError where one is missing."""
    missing = [name for name in "XYZABC" if name not in values]
    if missing:
        raise reader.lines.fault(f"has no {', '.join(missing)}")
    return np.array([values[name] for name in "XYZABC"])
