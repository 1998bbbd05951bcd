"""Named arms: their files, tools, and limits that their makers publish."""

import dataclasses
import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import Array, RobotError
from selfmotion.model.robot.urdf import Urdf, read_urdf


@dataclass(frozen=True)
class NamedArm:
    """A named arm of `load_robot`.

    Attributes
    ----------
    urdf : str
        File below the folder of example-robot-data, or of this package for our own arms.
    tool : str
        The usual tool frame.
    home : tuple of float or None
        Ready configuration of its maker [rad], if any.
    touching : tuple of (str, str)
        Pairs of links whose bodies overlap by design, in more than half of all configurations or as
        their maker says; no joint between them can separate them.
    """

    urdf: str
    tool: str
    home: tuple[float, ...] | None = None
    touching: tuple[tuple[str, str], ...] = ()


# Upright, from `initial_positions.yaml` of Universal Robots' ROS 2 description.
_UPRIGHT = (0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0)

NAMED_ARMS: Mapping[str, NamedArm] = {
    "planar_3r": NamedArm("planar_3r.urdf", "tool"),
    "panda": NamedArm(
        "panda_description/urdf/panda.urdf",
        "panda_hand_tcp",
        home=(0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4),
    ),
    # Without a hand; capsules around the shoulder that its maker's semantic description leaves out
    # of all checks (franka_description 1.0.1: link1, link3, "Never"). The ready configuration is
    # that of libfranka's examples (examples_common.h).
    "fr3": NamedArm(
        "fr3.urdf",
        "fr3_link8",
        home=(0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4),
        touching=(("fr3_link1", "fr3_link3"),),
    ),
    # From UFACTORY's semantic description, which comes with the URDF. Its maker's home, all zeros,
    # is singular: no motion with a prescribed pose starts there.
    "xarm7": NamedArm(
        "xarm_description/urdf/xarm7.urdf", "link_eef", home=(0.0, -0.4, 0.0, 1.2, 0.0, 1.6, 0.0)
    ),
    "baxter": NamedArm(
        "baxter_description/urdf/baxter.urdf",
        "left_gripper",
        touching=(
            ("left_upper_shoulder", "left_upper_elbow"),
            ("left_wrist", "left_upper_forearm_visual"),
        ),
    ),
    "tiago": NamedArm("tiago_description/robots/tiago.urdf", "arm_tool_link"),
    "pr2": NamedArm(
        "pr2_description/urdf/pr2.urdf",
        "r_gripper_tool_frame",
        touching=(("r_shoulder_pan_link", "r_upper_arm_link"),),
    ),
    "ur5": NamedArm("ur_description/urdf/ur5_robot.urdf", "tool0", home=_UPRIGHT),
    "ur10": NamedArm("ur_description/urdf/ur10_robot.urdf", "tool0", home=_UPRIGHT),
    "kinova": NamedArm("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    "z1": NamedArm("z1_description/urdf/z1.urdf", "gripperStator"),
}

# Largest number of joints of tables, rails and hands, whose home is zero.
_OF_A_TABLE = 3

# Named parts of a cell besides arms.
NAMED_PARTS: Mapping[str, NamedArm] = {"positioner": NamedArm("positioner.urdf", "plate")}

# Next to this module in an installed package, at the top of the repository in a checkout.
_OWN_ARMS = (Path(__file__).parent / "arms", Path(__file__).parents[4] / "robots")


def published(name: str) -> Mapping[str, Any]:
    """Return the limits that the maker of a named arm publishes, by kind and joint."""
    import tomllib

    known = tomllib.loads((Path(__file__).parent / "limits.toml").read_text("utf-8"))
    limits: Mapping[str, Any] = known.get(name, {})
    return {kind: limits[kind] for kind in ("acceleration", "jerk") if kind in limits}


def names_of(source: str) -> list[str]:
    """Return the names of arms whose URDF is the file that another one came from."""
    return [name for name, arm in NAMED_ARMS.items() if source.endswith(arm.urdf)]


def home_of(urdf: Urdf, joints: Sequence[str], lower: Array, upper: Array) -> Array:
    """Return the configuration (n,) that makers call ready; see `RobotModel.home`."""
    q = np.clip(np.zeros(len(joints)), lower, upper)
    parts = {part.name: part.source for part in urdf.parts} or {"": urdf.source}
    for part, source in parts.items():
        own = [k for k, name in enumerate(joints) if not part or name.startswith(f"{part}/")]
        known = [source] if part and source in NAMED_ARMS else names_of(source)
        homes = [NAMED_ARMS[name].home for name in known]
        found = next((home for home in homes if home is not None and len(home) == len(own)), None)
        if found is not None:
            q[own] = found
        elif not part or len(own) > _OF_A_TABLE:
            told = f"part '{part}'" if part else "this arm"
            all_known = ", ".join(name for name, arm in NAMED_ARMS.items() if arm.home is not None)
            raise RobotError(
                f"no home configuration is known of {told}, only of {all_known}; give one"
            )
    return q


def read_named(arm: NamedArm) -> Urdf:
    """Return the URDF of an arm that is known by name."""
    for folder in _OWN_ARMS:
        if (folder / arm.urdf).is_file():
            return read_urdf(folder / arm.urdf)
    share = _example_robot_data()
    urdf = read_urdf(share / "robots" / arm.urdf)
    return dataclasses.replace(urdf, package_dirs=(str(share.parent), str(share)))


@cache
def _example_robot_data() -> Path:
    """Return the data folder of example-robot-data, which installs no importable module."""
    for file in importlib.metadata.files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).resolve().parents[3]
    raise RobotError("example-robot-data is installed without its robots; reinstall the package")
