"""Joint motions as tables of columns, arrays or keyframes, with the joints that follow others."""

import io
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    ProblemError,
    nearest,
    read_arrays,
    write_bytes,
    write_csv,
    write_text,
)
from selfmotion.model.motion import Trajectory, column_names
from selfmotion.model.robot import RobotModel, Urdf
from selfmotion.shop.controllers.program_texts import as_word
from selfmotion.shop.controllers.samples import MotionSamples

# Joints that mimic others, in files of motions: they follow, and are no coordinates of an arm.

# Largest deviation of a joint from the one that it mimics, by rounding and encoders [rad or m].
_OFF = 1e-4


def mimic_joints(robot: RobotModel) -> dict[str, str]:
    """Return the joints that move because they mimic one of an arm's joints, and which one."""
    names = list(robot.model.names)[1:]
    moved_by = (robot.joint_names[k] for k in robot.coupling.coordinates.tolist())
    pairs = zip(names, moved_by, strict=True)
    return {name: other for name, other in pairs if name not in robot.joint_names}


def without_mimic_joints(motion: Trajectory, robot: RobotModel) -> Trajectory:
    """Return a motion without the joints that mimic others, where a file has them as well.

    Raises
    ------
    FileFormatError
        One of them is not where what it mimics puts it.
    """
    following = mimic_joints(robot)
    own = motion.joint_names
    beside = [name for name in own if name in following]
    if not beside or any(name not in own for name in robot.joint_names):
        return motion
    wanted = robot.all_joints(motion.q[:, [own.index(name) for name in robot.joint_names]])
    for name in beside:
        away = np.abs(motion.q[:, own.index(name)] - wanted[name])
        worst = int(away.argmax())
        if not away[worst] <= _OFF:
            raise FileFormatError(
                f"trajectory: joint '{name}' is {away[worst]:.4g} off where joint "
                f"'{following[name]}', which it mimics, puts it at t = {motion.t[worst]:.4g} s; "
                f"leave it out, or mend <mimic> in the URDF"
            )
    columns = [k for k, name in enumerate(own) if name not in following]
    faster = None if motion.qdd is None else motion.qdd[:, columns]
    names = tuple(own[k] for k in columns)
    return Trajectory(motion.t, motion.q[:, columns], motion.qd[:, columns], names, faster)


# Joint motions as tables: columns, arrays or lists by name.


def write_columns(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write a table with a row for each sample."""
    table = np.column_stack([motion.t, motion.q, motion.qd, motion.qdd])
    write_csv(file, column_names(motion.joint_names), table)


def write_arrays(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write arrays by name."""
    stream = io.BytesIO()
    arrays: dict[str, Any] = {"t": motion.t, "q": motion.q, "qd": motion.qd, "qdd": motion.qdd}
    np.savez_compressed(stream, joint_names=np.array(motion.joint_names), **arrays)
    write_bytes(file, stream.getvalue())


def write_lists(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    """Write lists by name."""
    table: dict[str, Any] = {"joint_names": list(motion.joint_names)}
    table |= {name: getattr(motion, name).tolist() for name in ("t", "q", "qd", "qdd")}
    write_text(file, json.dumps(table) + "\n")


def read_npz(file: Path) -> Trajectory:
    """Return the motion of a file of arrays; FileFormatError where one is missing."""
    return of_tables(file, read_arrays(file))


def of_tables(file: Path, tables: Mapping[str, Any]) -> Trajectory:
    """Return the motion of arrays or lists; FileFormatError where one is missing or wrong."""
    missing = [name for name in ("t", "q", "qd", "joint_names") if name not in tables]
    if missing:
        raise FileFormatError(f"{file}: '{missing[0]}' is missing, expected t, q, qd, joint_names")
    known = ("t", "q", "qd", "qdd", "joint_names")
    unknown = [name for name in tables if name not in known]
    if unknown:
        raise FileFormatError(
            f"{file}: '{unknown[0]}' is not read{nearest(unknown[0], known)}; expected "
            f"{', '.join(known)}"
        )
    try:
        names = tuple(map(str, tables["joint_names"]))
        return Trajectory(tables["t"], tables["q"], tables["qd"], names, tables.get("qdd"))
    except (FileFormatError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: {error}") from error


# Keyframes of MuJoCo: https://mujoco.readthedocs.io/en/stable/XMLreference.html#keyframe.

_MOVABLE = ("revolute", "continuous", "prismatic")


def keyframes(robot: RobotModel, t: Array, q: Array, qd: Array) -> str:
    """Return an MJCF file with one ``<key>`` per sample, for ``<include file="…"/>``.

    ``qpos`` and ``qvel`` have all movable joints of the URDF in the order of MuJoCo's compiler
    (depth first), those off the chain where the plan holds them: they fit a model that was made of
    the same URDF.

    Parameters
    ----------
    robot : RobotModel
    t : (K,)
        [s]
    q, qd : (K, n)

    Raises
    ------
    ProblemError
        The URDF has a joint with more than one coordinate.
    """
    joints = list(_depth_first(robot.urdf))
    # Joints that mimic others are joints of their own here.
    places, speeds = robot.all_joints(q), robot.all_joints_rates(qd)
    root = ElementTree.Element("mujoco")
    frame = ElementTree.SubElement(root, "keyframe")
    for k, time in enumerate(t.tolist()):
        position = [places[j][k] if j in places else robot.locked[j] for j in joints]
        speed = [speeds[j][k] if j in speeds else 0.0 for j in joints]
        ElementTree.SubElement(
            frame, "key", name=f"t{k}", time=repr(time), qpos=_text(position), qvel=_text(speed)
        )
    ElementTree.indent(root)
    # A comment of XML has no two hyphens.
    words = " ".join(as_word(joint).replace("--", "-%2D") for joint in joints)
    heading = f"<!-- joints: {words} -->\n"
    return heading + ElementTree.tostring(root, encoding="unicode") + "\n"


def _depth_first(urdf: Urdf) -> Iterator[str]:
    """Yield the movable joints below the root, each branch to its end."""
    children = {joint.child for joint in urdf.joints.values()}
    pending = [link for link in urdf.links if link not in children]
    while pending:
        link = pending.pop()
        for joint in urdf.joints.values():
            if joint.child == link and joint.kind in _MOVABLE:
                yield joint.name
            elif joint.child == link and joint.kind != "fixed":
                raise ProblemError(
                    f"{urdf.source}: joint '{joint.name}' is {joint.kind}, for which keyframes of "
                    f"this arm have no coordinates; hold it fixed in the URDF"
                )
        below = [joint.child for joint in urdf.joints.values() if joint.parent == link]
        pending += reversed(below)


def _text(values: list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
