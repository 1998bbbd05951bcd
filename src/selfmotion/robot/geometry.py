"""The visual or collision geometry of a robot whose joints are locked in part."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

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


def readable_visuals(urdf: Urdf, locked: Mapping[str, float]) -> tuple[Any, tuple[str, ...]]:
    """Return visual geometry as far as it can be read, and the rest; see `RobotModel.visuals`."""
    try:
        return reduced_geometry(urdf, locked, pin.GeometryType.VISUAL), ()
    except RobotError:
        bad = bad_meshes(urdf, "visual")
        if not bad:
            raise
    text = without_meshes(urdf.text, "visual", {item.file for item in bad})
    found = reduced_geometry(replace(urdf, text=text), locked, pin.GeometryType.VISUAL)
    return found, tuple(map(str, bad))
