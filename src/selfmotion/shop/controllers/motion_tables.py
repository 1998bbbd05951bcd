"""Joint motions as tables of numbers: columns (CSV), arrays (NPZ) or lists by name (JSON).

Writers have the parameters of all formats of motions, of which tables need neither arm nor rate.
"""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    nearest,
    read_arrays,
    write_bytes,
    write_csv,
    write_text,
)
from selfmotion.model.motion import Trajectory, column_names
from selfmotion.model.robot import RobotModel
from selfmotion.shop.controllers.samples import MotionSamples


def write_table(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write a table of t, q, q̇ and q̈ with a row for each sample."""
    table = np.column_stack([motion.t, motion.q, motion.qd, motion.qdd])
    write_csv(file, column_names(motion.joint_names), table)


def write_npz(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write arrays t, q, qd, qdd and joint_names."""
    stream = io.BytesIO()
    arrays: dict[str, Any] = {"t": motion.t, "q": motion.q, "qd": motion.qd, "qdd": motion.qdd}
    np.savez_compressed(stream, joint_names=np.array(motion.joint_names), **arrays)
    write_bytes(file, stream.getvalue())


def write_json(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write lists t, q, qd, qdd and joint_names."""
    table: dict[str, Any] = {"joint_names": list(motion.joint_names)}
    table |= {name: getattr(motion, name).tolist() for name in ("t", "q", "qd", "qdd")}
    write_text(file, json.dumps(table) + "\n")


def read_npz(file: Path) -> Trajectory:
    """Return the motion of a file of arrays; FileFormatError where one is missing."""
    return motion_of_arrays(file, read_arrays(file))


def motion_of_arrays(file: Path, tables: Mapping[str, Any]) -> Trajectory:
    """Return the motion of arrays or lists; FileFormatError where one is missing or wrong."""
    missing = [name for name in ("t", "q", "qd", "joint_names") if name not in tables]
    if missing:
        raise FileFormatError(f"{file}: '{missing[0]}' is missing, expected t, q, qd, joint_names")
    keys = ("t", "q", "qd", "qdd", "joint_names")
    unknown = [name for name in tables if name not in keys]
    if unknown:
        raise FileFormatError(
            f"{file}: '{unknown[0]}' is not read{nearest(unknown[0], keys)}; expected "
            f"{', '.join(keys)}"
        )
    try:
        names = tuple(map(str, tables["joint_names"]))
        return Trajectory(tables["t"], tables["q"], tables["qd"], names, tables.get("qdd"))
    except (FileFormatError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: {error}") from error
