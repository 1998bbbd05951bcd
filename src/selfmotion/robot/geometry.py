"""The visual or collision geometry of a robot whose joints are locked in part.

An arm without visuals is drawn by its bodies, and one without bodies by its joints and axes.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from selfmotion.basics import RobotError
from selfmotion.robot.full_model import full_model, link_geometry
from selfmotion.robot.held import locked_configuration
from selfmotion.robot.mesh_files import bad_meshes, without_meshes
from selfmotion.robot.urdf import Urdf


def reduced_geometry(urdf: Urdf, locked: Mapping[str, float], kind: pin.GeometryType) -> Any:
    """Return the ``pinocchio.GeometryModel`` of all links; see `RobotModel.geometry`."""
    full = full_model(urdf)
    geometry = link_geometry(urdf, full, kind)
    reference, locked_ids = locked_configuration(full, locked)
    _, reduced = pin.buildReducedModel(full, [geometry], locked_ids, reference)
    return reduced[0]


# What stands in for visuals is drawn in this; bones are as thick as a share of the arm's reach.
_GREY = np.array([0.6, 0.62, 0.66, 1.0])
_THICK = 0.015


def readable_visuals(
    urdf: Urdf, locked: Mapping[str, float], tag: str = "visual"
) -> tuple[Any, tuple[str, ...]]:
    """Return visual geometry as far as it can be read, and the rest; see `RobotModel.visuals`."""
    kind = pin.GeometryType.VISUAL if tag == "visual" else pin.GeometryType.COLLISION
    try:
        return reduced_geometry(urdf, locked, kind), ()
    except RobotError:
        bad = bad_meshes(urdf, tag)
        if not bad:
            raise
    text = without_meshes(urdf.text, tag, {item.file for item in bad})
    return reduced_geometry(replace(urdf, text=text), locked, kind), tuple(map(str, bad))


def stand_in(urdf: Urdf, locked: Mapping[str, float], model: Any, tip: int) -> tuple[Any, str]:
    """Return what draws an arm without visuals, and what that is, in words."""
    bodies, _ = readable_visuals(urdf, locked, "collision")
    for item in bodies.geometryObjects:
        item.meshColor = _GREY
    if bodies.ngeoms:
        return bodies, "the arm has no visuals to draw: its collision bodies are drawn instead"
    return _bones(
        model, tip
    ), "the arm has neither visuals nor bodies: its joints are drawn instead"


def _bones(model: Any, tip: int) -> Any:
    """Return cylinders from joint to joint, and along their axes."""
    found, frame = pin.GeometryModel(), model.frames[tip]
    places = [
        (model.parents[k], model.jointPlacements[k].translation) for k in range(1, model.njoints)
    ]
    places.append((frame.parentJoint, frame.placement.translation))
    lengths = [float(np.linalg.norm(place)) for _, place in places]
    radius = _THICK * max(sum(lengths), 1e-2)
    for k, ((joint, place), length) in enumerate(zip(places, lengths, strict=True)):
        if length > radius:
            _add(found, model, f"bone {k}", int(joint), 0.5 * place, place / length, radius, length)
    columns = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k, column in enumerate(columns.reshape(6, -1).T):
        twist = data.oMi[k + 1].actInv(pin.Motion(column))
        axis = twist.angular if np.any(twist.angular) else twist.linear
        _add(found, model, f"axis {k}", k + 1, np.zeros(3), axis, 2.0 * radius, 5.0 * radius)
    return found


def _add(
    found: Any, model: Any, name: str, joint: int, at: Any, along: Any, radius: float, length: float
) -> None:
    """Add a cylinder along a direction in the frame of a joint."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.asarray(along)).matrix()
    shape, place = coal.Cylinder(radius, length), pin.SE3(turn, np.asarray(at))
    frame = model.getFrameId(model.names[joint]) if joint else 0
    item = pin.GeometryObject(name, joint, frame, place, shape)
    item.meshColor = _GREY
    found.addGeometryObject(item)
