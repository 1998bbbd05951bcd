"""Keyframes of MuJoCo: https://mujoco.readthedocs.io/en/stable/XMLreference.html#keyframe."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from selfmotion.basics import Array, ProblemError
from selfmotion.model.robot import RobotModel, Urdf
from selfmotion.shop.controllers.program_texts import as_word

# Joint types of the URDF with one coordinate.
_MOVABLE = ("revolute", "continuous", "prismatic")


def keyframes(robot: RobotModel, t: Array, q: Array, qd: Array) -> str:
    """Return an MJCF file with one ``<key>`` per sample, for ``<include file="…"/>``.

    ``qpos`` and ``qvel`` have all movable joints of the URDF in the order of MuJoCo's compiler
    (depth first). Joints off the chain have their locked positions. The file fits a model compiled
    from the same URDF.

    Parameters
    ----------
    robot : RobotModel
    t : (K,)
        Sample times [s].
    q, qd : (K, n)
        Positions and velocities [rad or m, and per second].

    Raises
    ------
    ProblemError
        The URDF has a joint with more than one coordinate.
    """
    joints = list(_depth_first(robot.urdf))
    # Joints that mimic others are joints of their own here.
    positions, velocities = robot.all_joints(q), robot.all_joints_rates(qd)
    root = ElementTree.Element("mujoco")
    frame = ElementTree.SubElement(root, "keyframe")
    for k, time in enumerate(t.tolist()):
        qpos = [positions[j][k] if j in positions else robot.locked[j] for j in joints]
        qvel = [velocities[j][k] if j in velocities else 0.0 for j in joints]
        ElementTree.SubElement(
            frame, "key", name=f"t{k}", time=repr(time), qpos=_text(qpos), qvel=_text(qvel)
        )
    ElementTree.indent(root)
    # A comment of XML has no two hyphens.
    words = " ".join(as_word(joint).replace("--", "-%2D") for joint in joints)
    heading = f"<!-- joints: {words} -->\n"
    return heading + ElementTree.tostring(root, encoding="unicode") + "\n"


def _depth_first(urdf: Urdf) -> Iterator[str]:
    """Yield the movable joints below the root, each branch to its end."""
    by_child = {joint.child: joint for joint in urdf.joints.values()}
    pending = [link for link in urdf.links if link not in by_child]
    while pending:
        link = pending.pop()
        joint = by_child.get(link)
        if joint is not None and joint.kind in _MOVABLE:
            yield joint.name
        elif joint is not None and joint.kind != "fixed":
            raise ProblemError(
                f"{urdf.source}: joint '{joint.name}' is {joint.kind}, for which keyframes of "
                f"this arm have no coordinates; hold it fixed in the URDF"
            )
        below = [item.child for item in urdf.joints.values() if item.parent == link]
        pending += reversed(below)


def _text(values: list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
