"""Arms from URDF files, or by name."""

import dataclasses
import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import RobotError, as_number, nearest, read_only, shown
from selfmotion.robot.chain import Chain
from selfmotion.robot.expansion import expand
from selfmotion.robot.full_model import full_model, name_links
from selfmotion.robot.held import locked_configuration
from selfmotion.robot.model import RobotModel
from selfmotion.robot.mounting import with_base, with_tool_offset
from selfmotion.robot.urdf import Urdf, package_folders, parse_urdf, read_urdf
from selfmotion.task import as_pose


@dataclass(frozen=True)
class NamedArm:
    """An arm that `load_robot` knows by name.

    Attributes
    ----------
    urdf : str
        File below the folder of example-robot-data, or of this package for our own arms.
    tool : str
        The usual tool frame.
    home : tuple of float or None
        The configuration that its maker calls ready [rad], where there is one.
    touching : tuple of (str, str)
        Pairs of links whose meshes overlap in more than half of all configurations, as they are
        made; no joint between them can keep them apart.
    """

    urdf: str
    tool: str
    home: tuple[float, ...] | None = None
    touching: tuple[tuple[str, str], ...] = ()


NAMED_ARMS: Mapping[str, NamedArm] = {
    "planar_3r": NamedArm("planar_3r.urdf", "tool"),
    "panda": NamedArm(
        "panda_description/urdf/panda.urdf",
        "panda_hand_tcp",
        home=(0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4),
    ),
    "xarm7": NamedArm("xarm_description/urdf/xarm7.urdf", "link_eef"),
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
    "ur5": NamedArm("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "ur10": NamedArm("ur_description/urdf/ur10_robot.urdf", "tool0"),
    "kinova": NamedArm("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    "z1": NamedArm("z1_description/urdf/z1.urdf", "gripperStator"),
}


# A joint that is held may be this far beyond its limits [rad or m]: rounding of a file.
_BESIDE = 1e-9
# Beside this module in an installed package, at the top of the repository in a checkout.
_OWN_ARMS = (Path(__file__).parent / "arms", Path(__file__).parents[3] / "robots")


def load_robot(
    robot: str | Path,
    tool: str | None = None,
    lock: Mapping[str, float] | None = None,
    *,
    base: pin.SE3 | npt.ArrayLike | None = None,
    tool_offset: pin.SE3 | npt.ArrayLike | None = None,
    arguments: Mapping[str, str] | None = None,
) -> RobotModel:
    """Load an arm.

    Parameters
    ----------
    robot : str or Path
        A name from `NAMED_ARMS` (``"panda"``, ``"planar_3r"``, …) or the path of a ``.urdf`` or
        ``.xacro`` file.
    tool : str, optional
        Tool frame (a link). Default: the named arm's usual one; for a file, its only leaf link.
    lock : dict, optional
        Joints to hold, with their coordinate [rad or m]. Joints off the chain to the tool are
        held anyway, at 0 or the nearest limit unless given here.
    base : SE3 or (4, 4), optional
        Pose of the URDF's root link in the world.
    tool_offset : SE3 or (4, 4), optional
        Pose of the frame that follows the path in that of `tool`: a pen in a gripper.
    arguments : dict, optional
        Of a xacro file.

    Returns
    -------
    RobotModel

    Raises
    ------
    RobotError
        The name, file, frame or joint does not exist or cannot be used.

    Examples
    --------
    >>> load_robot("panda").dof
    7
    """
    if not isinstance(robot, str | Path):
        raise RobotError(f"robot is {shown(robot)}, expected a name or the path of a file")
    for name, given in (("lock", lock), ("arguments", arguments)):
        if not isinstance(given, Mapping | None):
            raise RobotError(f"{name} is {shown(given)}, expected a dict")
    touching: tuple[tuple[str, str], ...] = ()
    published: Mapping[str, Any] = {}
    if isinstance(robot, str) and robot in NAMED_ARMS:
        arm = NAMED_ARMS[robot]
        urdf, frame, touching = _read_named(arm), tool or arm.tool, arm.touching
        published = _published(robot)
    else:
        urdf = _read_file(Path(robot), arguments or {}, str(robot))
        frame = tool or _only_leaf(urdf)
    if base is not None:
        urdf = with_base(urdf, as_pose(base, f"{urdf.source}: base", RobotError))
    if tool_offset is not None:
        offset = as_pose(tool_offset, f"{urdf.source}: tool_offset", RobotError)
        urdf, frame = with_tool_offset(urdf, frame, offset)
    built = build_robot(urdf, frame, lock or {})
    acceleration, jerk = (
        read_only([published.get(kind, {}).get(joint, np.inf) for joint in built.joint_names])
        for kind in ("acceleration", "jerk")
    )
    return dataclasses.replace(
        built, touching=touching, acceleration_limit=acceleration, jerk_limit=jerk
    )


def build_robot(urdf: Urdf, tool: str, lock: Mapping[str, float]) -> RobotModel:
    """Build the chain from the root of a validated URDF to `tool`; see `load_robot`."""
    urdf.check_tool(tool)
    full = full_model(urdf)
    _check_lock(urdf, full, lock)
    chain = [joint for joint in urdf.chain(tool) if joint.kind != "fixed"]
    for joint in chain:
        if joint.kind in ("floating", "planar"):
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' is {joint.kind}; an arm's joints are "
                f"revolute, continuous or prismatic"
            )
        if joint.mimics is not None and joint.name not in lock:
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' on the way to '{tool}' mimics "
                f"'{joint.mimics}'; choose a tool before it, or hold it with lock="
            )
    free = [joint.name for joint in chain if joint.name not in lock]
    if not chain:
        moved = [link for link in urdf.links if any(j.kind != "fixed" for j in urdf.chain(link))]
        which = f"one that does, of: {', '.join(moved)}" if moved else "another arm"
        raise RobotError(f"{urdf.source}: no joint moves the tool '{tool}'; choose {which}")
    if not free:
        raise RobotError(
            f"{urdf.source}: no joint is left free between the root and '{tool}': lock holds all "
            f"of {', '.join(joint.name for joint in chain)}"
        )
    locked = _locked_joints(urdf, full, free, lock)
    reference, locked_ids = locked_configuration(full, locked)
    model = pin.buildReducedModel(full, locked_ids, reference)
    name_links(urdf, model)
    names = tuple(model.names[1:])
    if model.nq != len(free) or set(names) != set(free):
        raise RobotError(
            f"{urdf.source}: the chain to '{tool}' has joints {free}, but Pinocchio built "
            f"{list(names)}"
        )
    continuous = np.array([name in urdf.continuous() for name in names])
    velocity = np.array(model.velocityLimit, dtype=np.float64)
    effort = np.array(model.upperEffortLimit, dtype=np.float64)
    return RobotModel(
        name=model.name,
        tool=tool,
        joint_names=names,
        lower=read_only(np.where(continuous, -np.inf, model.lowerPositionLimit)),
        upper=read_only(np.where(continuous, np.inf, model.upperPositionLimit)),
        velocity_limit=read_only(np.where(velocity > 0, velocity, np.inf)),
        locked=locked,
        chain=Chain(model, model.getFrameId(tool, pin.FrameType.BODY)),
        urdf=urdf,
        effort_limit=read_only(np.where(effort > 0.0, effort, np.inf)),
        acceleration_limit=read_only(np.full(len(names), np.inf)),
        jerk_limit=read_only(np.full(len(names), np.inf)),
    )


def rebuild_robot(
    text: str,
    package_dirs: Sequence[str],
    source: str,
    continuous: Sequence[str],
    tool: str,
    locked: Mapping[str, float],
    touching: Sequence[Sequence[str]],
    acceleration_limit: Sequence[float],
    jerk_limit: Sequence[float],
) -> RobotModel:
    """Build an arm from what a saved plan carries of it."""
    urdf = parse_urdf(text, source=source, package_dirs=tuple(package_dirs))
    # The text has the continuous joints as revolute ones already.
    for name in continuous:
        urdf.joints[name] = dataclasses.replace(urdf.joints[name], kind="continuous")
    pairs = tuple((first, second) for first, second in touching)
    return dataclasses.replace(
        build_robot(urdf, tool, locked),
        touching=pairs,
        acceleration_limit=read_only(acceleration_limit),
        jerk_limit=read_only(jerk_limit),
    )


def _published(name: str) -> Mapping[str, Any]:
    """Return what the maker of a named arm publishes: limits by kind and joint."""
    import tomllib

    known = tomllib.loads((Path(__file__).parent / "limits.toml").read_text("utf-8"))
    limits: Mapping[str, Any] = known.get(name, {})
    return limits


def _read_file(path: Path, arguments: Mapping[str, str], given: str) -> Urdf:
    if "://" in given:
        raise RobotError(f"{given}: is an address, expected a file: download it first")
    if path.suffix == ".xacro":
        return parse_urdf(
            expand(path, arguments),
            source=str(path),
            package_dirs=package_folders(path),
            mesh_folder=path.resolve().parent,
        )
    if arguments:
        raise RobotError(f"{given}: arguments are given, which only a .xacro file has")
    if path.suffix != ".urdf":
        raise RobotError(
            f"unknown robot '{given}', expected a .urdf or .xacro file or one of: "
            f"{', '.join(NAMED_ARMS)}{nearest(str(path), NAMED_ARMS)}"
        )
    return read_urdf(path)


def _read_named(arm: NamedArm) -> Urdf:
    for folder in _OWN_ARMS:
        if (folder / arm.urdf).is_file():
            return read_urdf(folder / arm.urdf)
    share = _example_robot_data()
    urdf = read_urdf(share / "robots" / arm.urdf)
    return dataclasses.replace(urdf, package_dirs=(str(share.parent), str(share)))


def _example_robot_data() -> Path:
    """Return the data folder of example-robot-data, which installs no importable module."""
    for file in importlib.metadata.files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).resolve().parents[3]
    raise RobotError("example-robot-data is installed without its robots; reinstall the package")


def _only_leaf(urdf: Urdf) -> str:
    parents = {joint.parent for joint in urdf.joints.values()}
    leaves = [link for link in urdf.links if link not in parents]
    if len(leaves) != 1:
        raise RobotError(
            f"{urdf.source}: has {len(leaves)} end links ({', '.join(leaves)}); "
            f"name the tool frame with tool="
        )
    return leaves[0]


def _check_lock(urdf: Urdf, model: Any, lock: Mapping[str, float]) -> None:
    for name, value in lock.items():
        if not model.existJointName(name):
            raise RobotError(
                f"{urdf.source}: lock names joint '{name}', which is not movable here"
                f"{nearest(name, model.names[1:])}"
            )
        as_number(value, f"{urdf.source}: lock['{name}']", error=RobotError)
        joint = model.joints[model.getJointId(name)]
        if joint.nq != 1:
            raise RobotError(
                f"{urdf.source}: lock holds joint '{name}', which has {joint.nq} coordinates; "
                f"only joints with one can be held"
            )
        lower = model.lowerPositionLimit[joint.idx_q] - _BESIDE
        upper = model.upperPositionLimit[joint.idx_q] + _BESIDE
        if not lower <= value <= upper:
            raise RobotError(
                f"{urdf.source}: lock holds joint '{name}' at {value:.6g} rad or m, beyond its "
                f"limits {lower:.6g} to {upper:.6g}"
            )


def _locked_joints(
    urdf: Urdf, model: Any, free: list[str], lock: Mapping[str, float]
) -> dict[str, float]:
    """Return where the joints off the chain are held; those that mimic one follow it."""
    locked: dict[str, float] = {}

    def hold(name: str) -> float:
        if name in locked:
            return locked[name]
        joint, source = model.joints[model.getJointId(name)], urdf.joints[name]
        lower = model.lowerPositionLimit[joint.idx_q]
        upper = model.upperPositionLimit[joint.idx_q]
        value = lock.get(name, np.clip(0.0, lower, upper))
        if source.mimics in free and name not in lock:
            raise RobotError(
                f"{urdf.source}: joint '{name}' mimics '{source.mimics}', which moves on the way "
                f"to the tool; a joint beside the chain cannot follow it: hold it with lock= if "
                f"its links do not matter"
            )
        if source.mimics is not None and source.mimics not in free:
            followed = source.multiplier * hold(source.mimics) + source.offset
            if name in lock and abs(followed - lock[name]) > _BESIDE:
                raise RobotError(
                    f"{urdf.source}: lock holds joint '{name}' at {lock[name]:.6g}, but it mimics "
                    f"'{source.mimics}' and stands at {followed:.6g}; hold that one"
                )
            value = followed
        locked[name] = float(value)
        return locked[name]

    for index in range(1, model.njoints):
        name = model.names[index]
        if name not in free and model.joints[index].nq == 1:
            hold(name)
    return locked
