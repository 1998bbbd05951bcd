"""Keyframes of MuJoCo: https://mujoco.readthedocs.io/en/stable/XMLreference.html#keyframe."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from selfmotion.basics import Array, ProblemError
from selfmotion.model.robot import RobotModel, Urdf
from selfmotion.shop.controllers.program_texts import as_word

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
