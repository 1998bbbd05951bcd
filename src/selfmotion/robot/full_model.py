"""Pinocchio's model of a whole URDF, before joints are locked: complete, or refused.

urdfdom, which reads for Pinocchio, writes its complaints to the terminal and often goes on without
the part that it could not read; here they are caught, and each is an error. Where a link has the
name of a joint, Pinocchio cannot tell which is meant: such links have other names inside of it.
"""

import contextlib
import os
import sys
import tempfile
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import coal
import pinocchio as pin

from selfmotion.basics import RobotError
from selfmotion.robot.mesh_files import bad_meshes
from selfmotion.robot.urdf import Urdf

# The terminal's file descriptor belongs to the process: one thread at a time may take it.
_terminal = threading.Lock()
# Meshes that are only drawn are read once, as long as their files are those that were read.
_drawn = coal.CachedMeshLoader()

# How to go on without bodies; of what is not drawn it is told that it is not.
_BARE = "; or go on without looking at self-collision: --no-self-collision (clearance = false)"


def full_model(urdf: Urdf) -> Any:
    """Return the ``pinocchio.Model`` of all joints of a validated URDF.

    Its frames have `inner_names`; `name_links` gives the URDF's names back.

    Raises
    ------
    RobotError
        Pinocchio or urdfdom refuse a part of it; the message is theirs.
    """
    text = _inner_text(urdf)
    with _complaints() as said:
        try:
            model = pin.buildModelFromXML(text)
        except ValueError as error:
            said.insert(0, str(error))
    if said:
        # What comes last only says that the whole is none.
        raise RobotError(f"{urdf.source}: is not read by Pinocchio: {'; '.join(said[-3:])}")
    return model


def link_geometry(urdf: Urdf, model: Any, kind: pin.GeometryType) -> Any:
    """Return the ``pinocchio.GeometryModel`` of all links, for what `full_model` returned.

    Raises
    ------
    RobotError
        A mesh file is missing or cannot be read.
    """
    drawn = kind == pin.GeometryType.VISUAL
    tag, loader = ("visual", _drawn) if drawn else ("collision", coal.MeshLoader())
    with _complaints() as said:
        try:
            geometry = pin.buildGeomFromUrdfString(
                model,
                _inner_text(urdf),
                kind,
                package_dirs=list(urdf.package_dirs),
                mesh_loader=loader,
            )
        except (ValueError, RuntimeError) as error:
            bad = bad_meshes(urdf, tag)
            raise RobotError(
                f"{urdf.source}: {bad[0] if bad else error}{_BARE * (not drawn)}"
            ) from error
    if said:
        raise RobotError(f"{urdf.source}: is not read by Pinocchio: {'; '.join(said[-3:])}")
    return geometry


def inner_names(urdf: Urdf) -> dict[str, str]:
    """Return what the links are called inside of Pinocchio that cannot have their own names."""
    taken = {*urdf.joints, *urdf.links, "universe"}
    found = {}
    for link in urdf.links:
        if link in urdf.joints or link == "universe":
            name = f"{link}_link"
            while name in taken:
                name += "_"
            taken.add(name)
            found[link] = name
    return found


def name_links(urdf: Urdf, model: Any) -> None:
    """Give the links of a finished model the names that they have in the URDF."""
    own = {inner: link for link, inner in inner_names(urdf).items()}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = own.get(frame.name, frame.name)


def _inner_text(urdf: Urdf) -> str:
    names = inner_names(urdf)
    if not names:
        return urdf.readable_text
    root = ElementTree.fromstring(urdf.readable_text)
    for link in root.findall("link"):
        link.set("name", names.get(link.get("name", ""), link.get("name", "")))
    for joint in root.findall("joint"):
        for end in (*joint.findall("parent"), *joint.findall("child")):
            end.set("link", names.get(end.get("link", ""), end.get("link", "")))
    return ElementTree.tostring(root, encoding="unicode")


@contextlib.contextmanager
def _complaints() -> Iterator[list[str]]:
    """Yield a list that holds, afterwards, what C++ wrote to the terminal as errors.

    What else was written there meanwhile is passed on.
    """
    said: list[str] = []
    with _terminal, tempfile.TemporaryFile() as caught:
        sys.stderr.flush()
        terminal = os.dup(2)
        os.dup2(caught.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
            caught.seek(0)
            lines = caught.read().decode(errors="replace").splitlines()
            found = [line for line in lines if line.startswith("Error:")]
            said += [" ".join(line.removeprefix("Error:").split()) for line in found]
            places = ("at line ", "Error:")
            rest = [line for line in lines if not line.strip().startswith(places)]
            os.write(2, "".join(f"{line}\n" for line in rest).encode())
