"""Pinocchio's model of a whole URDF, and its geometry, before and after joints are locked."""

import contextlib
import os
import sys
import tempfile
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, RobotError, digest_of_file, is_file
from selfmotion.model.robot.collada import unit_of
from selfmotion.model.robot.urdf import Urdf
from selfmotion.model.robot.urdf_elements import ARMATURE
from selfmotion.model.robot.urdf_text import Packages


def locked_configuration(model: Any, locked: Mapping[str, float]) -> tuple[Array, list[int]]:
    """Return a full configuration with the locked joints set, and the indices of those joints."""
    reference: Array = pin.neutral(model)
    ids = []
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        if name in locked:
            reference[joint.idx_q] = locked[name]
            ids.append(index)
        elif joint.nq != 1:
            ids.append(index)
    return reference, ids


class BadMesh(NamedTuple):
    """A mesh that is not there.

    Attributes
    ----------
    link : str
        The link that it is of.
    file : str
        Its address in the URDF.
    reason : str
        Why, in words.
    """

    link: str
    file: str
    reason: str

    def __str__(self) -> str:
        """Return link, file and reason in words."""
        return f"link '{self.link}': {self.reason}: {self.file}"


def bad_meshes(urdf: Urdf, tag: str) -> tuple[BadMesh, ...]:
    """Return the meshes of all ``<visual>`` or ``<collision>`` elements (`tag`) that are bad."""
    known: dict[str, str] = {}
    found = []
    for link in ElementTree.fromstring(urdf.text).findall("link"):
        for mesh in link.iterfind(f"{tag}/geometry/mesh"):
            file = mesh.get("filename", "")
            if file not in known:
                known[file] = _fault(urdf, file)
            if known[file]:
                found.append(BadMesh(link.get("name", ""), file, known[file]))
    return tuple(found)


def mesh_digests(urdf: Urdf, tag: str) -> dict[str, str]:
    """Return the SHA-256 of the mesh files of all ``<visual>`` or ``<collision>`` elements."""
    return {str(place): digest_of_file(place) for place in _mesh_places(urdf, tag)}


def mesh_stamps(urdf: Urdf, tag: str) -> tuple[tuple[str, int, int, int, int], ...]:
    """Return paths, numbers, sizes and times of change [ns] of the same files.

    The time of the last change of a file's entry cannot be set back, as that of its content can.
    """
    stats = [(str(place), place.stat()) for place in _mesh_places(urdf, tag)]
    return tuple(
        (name, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
        for name, found in stats
    )


def _mesh_places(urdf: Urdf, tag: str) -> list[Path]:
    places = (_place(urdf, file) for file in _mesh_names(urdf.text, tag))
    return [place for place in places if place is not None]


# Cached: reading the text takes as long as a seventh of a plan.
@lru_cache(maxsize=16)
def _mesh_names(text: str, tag: str) -> tuple[str, ...]:
    """Return the addresses of the meshes of all such elements."""
    found = ElementTree.fromstring(text).iterfind(f"link/{tag}/geometry/mesh")
    return tuple(dict.fromkeys(mesh.get("filename", "") for mesh in found))


def _place(urdf: Urdf, file: str) -> Path | None:
    """Return the path of a mesh on this machine, if it exists."""
    scheme, _, rest = file.rpartition("://")
    folders = urdf.package_dirs if scheme in ("package", "model") else ("",)
    return next((Path(folder, rest) for folder in folders if is_file(Path(folder, rest))), None)


# Clause about an address on another machine.
_ELSEWHERE = " here; name the folder that has its package: --set robot.packages=DIR (packages=)"


def without_meshes(text: str, tag: str, files: Collection[str]) -> str:
    """Return a URDF's text without the elements (`tag`) whose meshes are in these `files`."""
    root = ElementTree.fromstring(text)
    for link in root.findall("link"):
        for element in link.findall(tag):
            if any(mesh.get("filename") in files for mesh in element.iterfind("geometry/mesh")):
                link.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _fault(urdf: Urdf, file: str) -> str:
    """Return why a mesh cannot be read, "" where it can."""
    if file.rpartition("://")[0] in ("http", "https", "ftp"):
        return "the mesh is not on this machine, download it"
    found = _place(urdf, file)
    if found is None:
        scheme, _, rest = file.rpartition("://")
        if scheme not in ("package", "model"):
            return f"no such mesh file{_ELSEWHERE * bool(scheme)}"
        near = Packages(Path(urdf.source), urdf.packages)
        name, _, inside = rest.partition("/")
        folder = near.folder(name)
        if folder is not None:
            return f"no such mesh file in package '{name}', {folder}"
        return f"no such mesh file, {near.called_otherwise(name, inside) or near.searched(name)}"
    try:
        coal.MeshLoader().load(str(found), np.ones(3))
    except (RuntimeError, ValueError) as error:
        # The text before is a place in the source of coal, the text after it a guess.
        said = str(error).rpartition("message:")[2].partition("Hint:")[0]
        return f"the mesh file cannot be read ({' '.join(said.split()[5:])})"
    return ""


# Pinocchio's model of a whole URDF, before joints are locked: complete, or refused.
#
# urdfdom, Pinocchio's parser, writes errors to the terminal and often goes on without the element;
# here they are caught, and each is an error. Where a link has the name of a joint, Pinocchio cannot
# distinguish them: such links have other names inside of it. The terminal's file descriptor belongs
# to the process: one thread at a time may redirect it.
_terminal = threading.Lock()
# Meshes that are only drawn are read once, as long as their files are those that were read.
_drawn = coal.CachedMeshLoader()

# Remedy for missing bodies.
_BARE = "; or go on without looking at self-collision: --set clearance=false"


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
        # The last one only says that the whole is none.
        raise RobotError(f"{urdf.source}: is not read by Pinocchio: {'; '.join(said[-3:])}")
    _add_rotors(model, text)
    return model


def _add_rotors(model: Any, text: str) -> None:
    """Set the rotor inertias of a model from its text: no parser of URDFs reads them."""
    if ARMATURE not in text:
        return
    for joint in ElementTree.fromstring(text).findall("joint"):
        turning, name = joint.find("dynamics"), joint.get("name", "")
        # Fixed joints are not in the model.
        if turning is not None and turning.get(ARMATURE) and model.existJointName(name):
            index = model.joints[model.getJointId(name)].idx_v
            armature = np.array(model.armature)
            armature[index] = float(turning.get(ARMATURE, "0"))
            model.armature = armature


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
                _in_metres(urdf, _inner_text(urdf)),
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
    """Return the names inside of Pinocchio of links that cannot have their own."""
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


def _in_metres(urdf: Urdf, text: str) -> str:
    """Return the text with meshes scaled by the units that their files say."""
    if ".dae" not in text.lower():
        return text
    root, is_changed = ElementTree.fromstring(text), False
    for mesh in root.iter("mesh"):
        place = _place(urdf, mesh.get("filename", ""))
        unit = 1.0 if place is None else unit_of(place)
        if unit != 1.0:
            scale = [float(value) for value in mesh.get("scale", "1 1 1").split()]
            mesh.set("scale", " ".join(repr(unit * value) for value in scale))
            is_changed = True
    return ElementTree.tostring(root, encoding="unicode") if is_changed else text


@contextlib.contextmanager
def _complaints() -> Iterator[list[str]]:
    """Yield a list that has, afterwards, the errors that C++ wrote to the terminal.

    Other output is passed on.
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


# The visual or collision geometry of a robot whose joints are locked in part.
#


def reduced_geometry(urdf: Urdf, locked: Mapping[str, float], kind: pin.GeometryType) -> Any:
    """Return the ``pinocchio.GeometryModel`` of all links; see `RobotModel.geometry`."""
    full = full_model(urdf)
    geometry = link_geometry(urdf, full, kind)
    reference, locked_ids = locked_configuration(full, locked)
    _, reduced = pin.buildReducedModel(full, [geometry], locked_ids, reference)
    return reduced[0]


# Colour of bodies and bones in place of visuals, RGBA.
_GREY = np.array([0.6, 0.62, 0.66, 1.0])
# Thickness of bones, as a share of the arm's reach.
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
    """Return the geometry in place of missing visuals, and its description in words."""
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
