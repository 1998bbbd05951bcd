"""Reading a URDF: its elements are checked one by one, yourdfpy parses it, and it must be a tree.

Pinocchio loads a link with two parents without a word, and gives continuous joints two coordinates.
Here such files are refused with a message that names the joint or link, and continuous joints
become single-angle joints without limits; mesh addresses become absolute.
"""

import codecs
import copy
import hashlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmotion.basics import RobotError, is_file, nearest
from selfmotion.model.robot.urdf_elements import (
    check_joint_elements,
    check_link_elements,
    check_shape,
    lacking_inertials,
    mend_cosmetics,
    split_planar,
    without_lacking,
    without_limits,
    zero_speeds,
)
from selfmotion.model.robot.urdf_text import Packages
from selfmotion.model.robot.urdf_unsaid import (
    angles_in_degrees,
    axes_unsaid,
    limits_passed_over,
)
from selfmotion.model.robot.xacro_text import (
    check_expanded,
    make_meshes_absolute,
    make_single_angles,
    parsed_by_yourdfpy,
    root_of,
)

# Fixed joint of a placed base.
BASE_JOINT = "base_placement"
# Fixed joint of a tool offset.
TOOL_JOINT = "tool_offset"
# Prefix of the fixed joints of carried bodies.
BODY_JOINT = "carried_body/"
# Attribute of a calibrated robot with its file.
CALIBRATION = "calibration"
# Prefix of the attributes with nominal placements.
NOMINAL = "nominal_"
# Declared encoding of a file.
_ENCODING = re.compile(rb"\s*<\?xml[^>]*encoding=[\"']([A-Za-z0-9._-]{1,40})[\"']")
# Byte order marks of UTF-16.
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True)
class UrdfJoint:
    """One joint as the URDF declares it.

    Attributes
    ----------
    name, kind, parent, child : str
        Names of joint and links; `kind` is the URDF type.
    mimics : str or None
        The joint it copies, where it has a ``<mimic>`` tag:
        its coordinate is `multiplier` times that joint's, plus `offset`.
    """

    name: str
    kind: str
    parent: str
    child: str
    mimics: str | None
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class UrdfPart:
    """A robot that is part of a cell.

    Attributes
    ----------
    name : str
        Prefix of the names of its links and joints.
    source : str
        The name of an arm, or a file.
    base : pinocchio.SE3 or None
        Where its root stands: in the world, or on `on`.
    on : str or None
        The link of another part that carries it.
    arguments : dict
        Of a xacro file.
    calibration : str or None
        The file that says where its joints are.
    """

    name: str
    source: str
    base: Any = None
    on: str | None = None
    arguments: Mapping[str, str] = field(default_factory=dict)
    calibration: str | None = None


@dataclass(frozen=True)
class Urdf:
    """A validated URDF, ready for Pinocchio.

    Attributes
    ----------
    source : str
        Path of the file, or origin of the text; for messages.
    text : str
        XML with continuous joints turned into revolute ones and mesh files made absolute or
        left as ``package://``.
    package_dirs : tuple of str
        Folders that are searched for ``package://`` addresses.
    joints : dict
        Joint name → `UrdfJoint`.
    links : tuple of str
        Names of all links, in file order.
    parts : tuple of UrdfPart
        Its parts; empty for a single robot, or one from a saved plan.
    notes : tuple of str
        Elements that are not drawn, weighed or read, and what is taken where it says nothing.
    packages : tuple of str
        Folders of packages that the user named.
    lacking_efforts : tuple of str
        Joints without an effort limit.
    """

    source: str
    text: str
    package_dirs: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    links: tuple[str, ...]
    parts: tuple[UrdfPart, ...] = ()
    notes: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    lacking_efforts: tuple[str, ...] = ()

    @property
    def readable_text(self) -> str:
        """The text without elements that parsers refuse and no motion needs."""
        if not self.lacking_inertials:
            return self.text
        root = without_lacking(ElementTree.fromstring(self.text))
        return ElementTree.tostring(root, encoding="unicode")

    @cached_property
    def lacking_inertials(self) -> Mapping[str, str]:
        """Missing values of incomplete ``<inertial>`` elements, in words → the link's name."""
        return lacking_inertials(ElementTree.fromstring(self.text))

    @property
    def sha256(self) -> str:
        """Digest of the text; two robots with the same digest have the same kinematics."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def has_collisions(self) -> bool:
        """Whether any link has a collision element."""
        return "<collision" in self.text

    def has_changed(self) -> bool:
        """Whether the file that it was read from is there, and other than it was then."""
        file = Path(self.source)
        if not is_file(file) or file.suffix == ".xacro":  # whose arguments are not known here
            return False
        try:
            return read_urdf(file, self.packages).text != self.bare_text()
        except RobotError:
            return True

    def carrier(self, link: str) -> str:
        """Return the link that a carried body is fixed to; of other links themselves."""
        joint = self.joints.get(f"{BODY_JOINT}{link}")
        return link if joint is None else self.carrier(joint.parent)

    @property
    def is_calibrated(self) -> bool:
        """Whether joints are elsewhere than they were drawn."""
        return f"{NOMINAL}xyz=" in self.text

    @property
    def calibration(self) -> str | None:
        """The file that says where the joints are; None where none does, or of a cell."""
        return ElementTree.fromstring(self.text).get(CALIBRATION)

    def nominal(self) -> "Urdf":
        """Return the same with its nominal joints."""
        root = ElementTree.fromstring(self.text)
        _draw_again(root)
        return replace(self, text=ElementTree.tostring(root, encoding="unicode"))

    def bare_text(self) -> str:
        """Return the text as drawn, without base placement, tool offset and carried bodies."""
        root = ElementTree.fromstring(self.text)
        _draw_again(root)
        for joint in root.findall("joint"):
            name = joint.get("name", "")
            if name in (BASE_JOINT, TOOL_JOINT) or name.startswith(BODY_JOINT):
                end = "parent" if name == BASE_JOINT else "child"
                link = getattr(self.joints[name], end)
                root.remove(joint)
                root.remove(next(item for item in root.findall("link") if item.get("name") == link))
        return ElementTree.tostring(root, encoding="unicode")

    def continuous(self) -> set[str]:
        """Return the names of joints that the file declares continuous."""
        return {joint.name for joint in self.joints.values() if joint.kind == "continuous"}

    def with_continuous(self, names: Iterable[str]) -> "Urdf":
        """Return the same, with joints that were continuous before they became revolute."""
        joints = dict(self.joints)
        for name in names:
            joints[name] = replace(joints[name], kind="continuous")
        return replace(self, joints=joints)

    @property
    def root(self) -> str:
        """The link that no joint carries."""
        children = {joint.child for joint in self.joints.values()}
        return next(link for link in self.links if link not in children)

    def check_tool(self, tool: str) -> None:
        """Raise RobotError unless `tool` is one of the links; the nearest names are offered."""
        if tool not in self.links:
            raise RobotError(
                f"{self.source}: no link '{tool}' to use as tool frame{nearest(tool, self.links)}; "
                f"links: {', '.join(self.links)}"
            )

    def chain(self, link: str) -> list[UrdfJoint]:
        """Return the joints from the root to `link`, root first, fixed ones included."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        chain = []
        while link in by_child:
            chain.append(by_child[link])
            link = by_child[link].parent
        return chain[::-1]


def _draw_again(root: ElementTree.Element) -> None:
    """Put the joints of a calibrated robot back to where they were drawn."""
    root.attrib.pop(CALIBRATION, None)
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        if origin is None or f"{NOMINAL}xyz" not in origin.attrib:
            continue
        for key in ("xyz", "rpy"):
            drawn = origin.attrib.pop(f"{NOMINAL}{key}")
            origin.set(key, drawn)
            if not drawn:
                del origin.attrib[key]
        if not origin.attrib:
            joint.remove(origin)


def read_urdf(path: Path, packages: Iterable[str] = ()) -> Urdf:
    """Read and validate a URDF file.

    Parameters
    ----------
    path : Path
        The file.
    packages : sequence of str
        Additional folders that are searched for packages; see `Packages`.

    Returns
    -------
    Urdf

    Raises
    ------
    RobotError
        The file is missing, is xacro, is not XML, or describes no arm (two parents, a zero axis,
        reversed limits, a negative mass, an unknown joint type, …).
    """
    if not is_file(path):
        raise RobotError(f"{path}: no such URDF file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror or error}") from error
    return urdf_of_file(_text_of(path, content), Packages(path, tuple(packages)))


def _text_of(path: Path, content: bytes) -> str:
    """Return the text of a file of XML, in the letters that it says, or else in UTF-8."""
    said = _ENCODING.match(content)
    encoding = "utf-16" if content.startswith(_UTF16) else said[1].decode() if said else "utf-8"
    try:
        text = content.decode(encoding).removeprefix("\ufeff")
    except (LookupError, UnicodeDecodeError) as error:
        raise RobotError(
            f"{path}: cannot be read as {encoding.upper()} text: {error}; save it as UTF-8, or say "
            f'what it is in (<?xml version="1.0" encoding="…"?>)'
        ) from error
    # Nothing may be before a declaration, but editors leave lines there.
    return text.lstrip() if text.lstrip().startswith("<?xml") else text


def urdf_of_file(text: str, packages: Packages) -> Urdf:
    """Validate URDF text that a file has or expands to; see `read_urdf`."""
    folders = package_folders(packages.file)
    found = parse_urdf(text, source=str(packages.file), package_dirs=folders, packages=packages)
    return replace(found, packages=packages.given)


def package_folders(path: Path) -> tuple[str, ...]:
    """Return the folders above a file, which are searched for ``package://NAME/…``."""
    return tuple(str(parent) for parent in path.resolve().parents if parent.parts[1:])


def parse_urdf(
    text: str, *, source: str, package_dirs: tuple[str, ...], packages: Packages | None = None
) -> Urdf:
    """Validate URDF text; see `read_urdf`. `packages` are searched for meshes."""
    root = root_of(text, source)
    check_expanded(root, source)
    # What a simulator is told is no part of the robot, though it may be called as if.
    for told in root.findall("gazebo"):
        root.remove(told)
    notes = [*split_planar(root, source), *mend_cosmetics(root, check_shape)]
    notes += [*axes_unsaid(root), *limits_passed_over(root), *angles_in_degrees(root)]
    zero = zero_speeds(root)
    unsaid = without_limits(root)
    for key, what in (("velocity", "speeds are"), ("effort", "torques are")):
        if unsaid[key]:
            names = ", ".join(f"'{name}'" for name in unsaid[key])
            notes.append(f"{names}: <limit> without {key}: taken for none, {what} not limited")
    if zero:
        names = ", ".join(f"'{name}'" for name in zero)
        notes.append(f"{names}: <limit> with velocity 0: taken for none, speeds are not limited")
    check_link_elements(root, source)
    check_joint_elements(root, source)
    bare = without_lacking(copy.deepcopy(root))
    parsed = parsed_by_yourdfpy(ElementTree.tostring(bare, encoding="unicode"), source)
    if [joint.name for joint in parsed.joints] != [j.get("name") for j in root.findall("joint")]:
        raise RobotError(f"{source}: is XML that parsers read differently; write it plainly")
    joints = {joint.name: joint for joint in map(_joint, parsed.joints)}
    _check_tree(parsed, source)
    _check_mimics(joints, source)
    make_single_angles(root)
    if packages is not None:
        make_meshes_absolute(root, packages, package_dirs)
    links = tuple(link.name for link in parsed.links)
    prepared = ElementTree.tostring(root, encoding="unicode")
    return Urdf(
        source,
        prepared,
        package_dirs,
        joints,
        links,
        notes=tuple(notes),
        lacking_efforts=tuple(unsaid["effort"]),
    )


def _joint(joint: Any) -> UrdfJoint:
    mimic = joint.mimic
    if mimic is None:
        return UrdfJoint(joint.name, joint.type, joint.parent, joint.child, None)
    multiplier = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
    offset = 0.0 if mimic.offset is None else float(mimic.offset)
    return UrdfJoint(
        joint.name, joint.type, joint.parent, joint.child, mimic.joint, multiplier, offset
    )


def _check_tree(parsed: Any, source: str) -> None:
    parent_of: dict[str, str] = {}
    for joint in parsed.joints:
        if joint.child in parent_of:
            raise RobotError(
                f"{source}: link '{joint.child}' has two parents, "
                f"'{parent_of[joint.child]}' and '{joint.parent}'"
            )
        parent_of[joint.child] = joint.parent
    roots = [link.name for link in parsed.links if link.name not in parent_of]
    if len(roots) != 1:
        found = ", ".join(roots) if roots else "none (the joints form a loop)"
        raise RobotError(
            f"{source}: expected one root link, found: {found}; join all links by joints, one "
            f"parent each"
        )
    for link in parent_of:
        above, passed = link, {link}
        while above in parent_of:
            above = parent_of[above]
            if above in passed:
                raise RobotError(
                    f"{source}: link '{link}' is not connected to the root '{roots[0]}': its "
                    f"joints form a loop through '{above}'"
                )
            passed.add(above)


def _check_mimics(joints: dict[str, UrdfJoint], source: str) -> None:
    for joint in joints.values():
        passed, name = {joint.name}, joint.mimics
        while name is not None:
            if name not in joints or name in passed:
                what = "which mimics it in turn" if name in passed else "which does not exist"
                hint = "" if name in passed else nearest(name, joints)
                raise RobotError(f"{source}: joint '{joint.name}' mimics '{name}', {what}{hint}")
            passed.add(name)
            name = joints[name].mimics
