"""Arms as they were measured: joints elsewhere than the URDF draws them.

Measured values replace the placements of joints in the URDF's text, so that kinematics, bodies,
saved plans and replays include them; the nominal ones are kept next to them.
"""

import dataclasses
import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, RobotError, as_path, nearest, shown
from selfmotion.model.robot.building import with_urdf
from selfmotion.model.robot.calibration_files import (
    JOINTS,
    CalibrationFile,
    UrdfAxis,
    maker_placements,
    read_calibration,
)
from selfmotion.model.robot.model import RobotModel
from selfmotion.model.robot.urdf import CALIBRATION, NOMINAL, Urdf

# Link of the tool flange in calibration files.
_TOOL = "tool0"
# Error of a rotation by its angles that counts as rounding.
_ROUNDING = 1e-12


def calibrated_urdf(urdf: Urdf, file: str | Path, prefix: str = "") -> Urdf:
    """Return a URDF with the joints where a calibration file puts them.

    Names of joints in the file have the prefix in the URDF.

    Raises
    ------
    RobotError
        The file cannot be read, or does not fit the arm; or it is calibrated already.
    """
    path = as_path(file)
    if urdf.is_calibrated and not prefix:
        raise RobotError(
            f"{path}: {urdf.source} is calibrated already, by {urdf.calibration}; begin with the "
            f"arm as it is drawn"
        )
    measured, root = read_calibration(path), ElementTree.fromstring(urdf.text)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    placed = _of_file(measured, urdf, joints, prefix)
    for name, offset in measured.offsets.items():
        joint = _named(joints, prefix + name, path)
        placed[prefix + name] = placed.get(prefix + name, _placement(joint)) * _moved(joint, offset)
    for name, pose in placed.items():
        _write(joints[name], pose, f"{urdf.source}: joint '{name}'")
    if not prefix:
        root.set(CALIBRATION, str(path.resolve()))
    text = ElementTree.tostring(root, encoding="unicode")
    return dataclasses.replace(urdf, text=text, notes=(*urdf.notes, f"{path}: {measured.units}"))


def calibrated_robot(
    robot: RobotModel, calibration: str | Path | Mapping[str, str | Path]
) -> RobotModel:
    """Return an arm with the joints where a calibration puts them; see `load_robot`."""
    return with_urdf(robot, _each(robot.urdf, calibration))


def nominal_robot(robot: RobotModel) -> RobotModel:
    """Return an arm as its URDF draws it: itself where it is not calibrated."""
    if not robot.urdf.is_calibrated:
        return robot
    return with_urdf(robot, robot.urdf.nominal())


def _each(urdf: Urdf, calibration: str | Path | Mapping[str, str | Path]) -> Urdf:
    if isinstance(calibration, str | Path):
        return calibrated_urdf(urdf, calibration)
    if not isinstance(calibration, Mapping) or not calibration:
        raise RobotError(
            f"calibration is {shown(calibration)}, expected a file, or one for each of some parts"
        )
    for part, file in calibration.items():
        urdf = calibrated_urdf(urdf, file, f"{part}/")
    return urdf


def _of_file(
    measured: CalibrationFile,
    urdf: Urdf,
    joints: Mapping[str, ElementTree.Element],
    prefix: str,
) -> dict[str, pin.SE3]:
    """Return the placements that a file says by name, or by the maker's frames."""
    if not measured.frames and measured.deltas is None:
        for name in measured.placements:
            _named(joints, prefix + name, measured.file)
        return {prefix + name: pose for name, pose in measured.placements.items()}
    names = [_ending(joints, prefix, name, measured.file) for name in JOINTS]
    for before, after in itertools.pairwise(names):
        if urdf.joints[after].parent != urdf.joints[before].child:
            raise RobotError(
                f"{measured.file}: is a calibration of Universal Robots, but '{after}' does not "
                f"follow '{before}' in {urdf.source}"
            )
    axes = [UrdfAxis(_placement(joints[name]), _axis(joints[name])) for name in names]
    tool = _flange(urdf, joints, urdf.joints[names[-1]].child)
    found = maker_placements(axes, tool, measured)
    return dict(zip(names, found, strict=True))


def _ending(joints: Mapping[str, ElementTree.Element], prefix: str, name: str, file: Path) -> str:
    """Return the joint of that name, with any prefix."""
    found = [known for known in joints if known.startswith(prefix) and known.endswith(name)]
    if len(found) != 1:
        raise RobotError(
            f"{file}: is a calibration of Universal Robots, but the arm has {len(found)} joints "
            f"'{name}', expected one"
        )
    return found[0]


def _flange(urdf: Urdf, joints: Mapping[str, ElementTree.Element], link: str) -> pin.SE3:
    """Return the flange's frame in that of the last link: the link itself where it has none."""
    place, fixed = {link: pin.SE3.Identity()}, list(urdf.joints.values())
    for _ in fixed:
        for joint in fixed:
            if joint.kind == "fixed" and joint.parent in place:
                place[joint.child] = place[joint.parent] * _placement(joints[joint.name])
    return next((pose for name, pose in place.items() if name.endswith(_TOOL)), place[link])


def _named(joints: Mapping[str, ElementTree.Element], name: str, file: Path) -> ElementTree.Element:
    if name not in joints:
        raise RobotError(
            f"{file}: names joint '{name}', which the arm does not have{nearest(name, joints)}"
        )
    return joints[name]


def _placement(joint: ElementTree.Element) -> pin.SE3:
    origin = joint.find("origin")
    given = {} if origin is None else origin.attrib
    xyz, rpy = (_numbers(given.get(key, "0 0 0")) for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _axis(joint: ElementTree.Element) -> Array:
    element = joint.find("axis")
    given = _numbers("1 0 0" if element is None else element.get("xyz", "1 0 0"))
    return np.asarray(given / np.linalg.norm(given))


def _moved(joint: ElementTree.Element, offset: float) -> pin.SE3:
    """Return the motion of a joint when its coordinate grows by an offset."""
    if joint.get("type") == "prismatic":
        return pin.SE3(np.eye(3), offset * _axis(joint))
    if joint.get("type") not in ("revolute", "continuous"):
        raise RobotError(f"joint '{joint.get('name')}' is {joint.get('type')} and has no zero")
    return pin.SE3(pin.exp3(offset * _axis(joint)), np.zeros(3))


def _write(joint: ElementTree.Element, pose: pin.SE3, what: str) -> None:
    """Write a placement, and keep the drawn one beside it."""
    origin = joint.find("origin")
    if origin is None:
        origin = ElementTree.SubElement(joint, "origin")
    if any(f"{NOMINAL}{key}" in origin.attrib for key in ("xyz", "rpy")):
        raise RobotError(f"{what} is calibrated already; begin with the arm as it is drawn")
    rpy = pin.rpy.matrixToRpy(pose.rotation)
    if not np.abs(pin.rpy.rpyToMatrix(rpy) - pose.rotation).max() <= _ROUNDING:
        raise RobotError(f"{what}: its measured placement is no rigid motion")
    for key, values in (("xyz", pose.translation), ("rpy", rpy)):
        origin.set(f"{NOMINAL}{key}", origin.get(key, ""))
        origin.set(key, " ".join(repr(float(value)) for value in values))


def _numbers(text: str) -> Array:
    return np.array([float(value) for value in text.split()])
