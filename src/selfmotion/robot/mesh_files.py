"""Mesh files of a URDF that are missing or cannot be read."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np

from selfmotion.basics import digest_of_file, is_file
from selfmotion.robot.packages import Packages
from selfmotion.robot.urdf import Urdf


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
    places = (_place(urdf, file) for file in _mesh_names(urdf.text, tag))
    return {str(place): digest_of_file(place) for place in places if place is not None}


# Each plan asks for them, and reading the text takes as long as a seventh of a plan.
@lru_cache(maxsize=16)
def _mesh_names(text: str, tag: str) -> tuple[str, ...]:
    """Return the addresses of the meshes of all such elements."""
    found = ElementTree.fromstring(text).iterfind(f"link/{tag}/geometry/mesh")
    return tuple(dict.fromkeys(mesh.get("filename", "") for mesh in found))


def _place(urdf: Urdf, file: str) -> Path | None:
    """Return where a mesh is on this machine, if it is there."""
    scheme, _, rest = file.rpartition("://")
    folders = urdf.package_dirs if scheme in ("package", "model") else ("",)
    return next((Path(folder, rest) for folder in folders if is_file(Path(folder, rest))), None)


# Of an address on another machine.
_ELSEWHERE = " here; name the folder that has its package: --packages DIR (packages=)"


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
        near, name = Packages(Path(urdf.source), urdf.packages), rest.partition("/")[0]
        folder = near.folder(name)
        if folder is not None:
            return f"no such mesh file in package '{name}', {folder}"
        return f"no such mesh file, {near.searched(name)}"
    try:
        coal.MeshLoader().load(str(found), np.ones(3))
    except (RuntimeError, ValueError) as error:
        # What comes before is where in the source of coal it was found, after it a guess.
        said = str(error).rpartition("message:")[2].partition("Hint:")[0]
        return f"the mesh file cannot be read ({' '.join(said.split()[5:])})"
    return ""
