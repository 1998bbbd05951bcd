"""Arms from URDF files, or by name."""

import dataclasses
import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import RobotError, as_number, nearest, read_only, shown
from selfmotion.robot.composing import composed
from selfmotion.robot.expansion import expand
from selfmotion.robot.full_model import full_model, name_links
from selfmotion.robot.held import locked_configuration
from selfmotion.robot.model import RobotModel
from selfmotion.robot.mounting import with_base, with_tool_offset
from selfmotion.robot.urdf import (
    Urdf,
    UrdfJoint,
    UrdfPart,
    package_folders,
    parse_urdf,
    read_urdf,
)
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

# What arms work with, known by name like these.
NAMED_PARTS: Mapping[str, NamedArm] = {"positioner": NamedArm("positioner.urdf", "plate")}

# A joint that is held may be this far beyond its limits [rad or m]: rounding of a file.
_BESIDE = 1e-9
# Beside this module in an installed package, at the top of the repository in a checkout.
_OWN_ARMS = (Path(__file__).parent / "arms", Path(__file__).parents[3] / "robots")


def load_robot(
    robot: str | Path | Mapping[str, str | Path],
    tool: str | Sequence[str] | None = None,
    lock: Mapping[str, float] | None = None,
    *,
    reference: str | None = None,
    base: pin.SE3 | npt.ArrayLike | Mapping[str, pin.SE3 | npt.ArrayLike] | None = None,
    on: Mapping[str, str] | None = None,
    tool_offset: pin.SE3 | npt.ArrayLike | None = None,
    arguments: Mapping[str, str] | None = None,
) -> RobotModel:
    """Load an arm, or a cell of several robots.

    Parameters
    ----------
    robot : str, Path or dict
        A name from `NAMED_ARMS` (``"panda"``, ``"planar_3r"``, …), ``"positioner"``, or the path of
        a ``.urdf`` or ``.xacro`` file; or several of these by name, as one tree: links and joints
        of part ``"arm"`` are called ``arm/NAME`` then.
    tool : str or sequence of str, optional
        Tool frame (a link), or several: the first is the one that paths are for where nothing else
        is said. Default: the named arm's usual one; for a file, its only leaf link; of several
        robots, that of the first.
    lock : dict, optional
        Joints to hold, with their coordinate [rad or m]. Joints that move no tool relative to the
        reference are held anyway, at 0 or the nearest limit unless given here.
    reference : str, optional
        The link in whose frame poses, twists and paths are given: a part that a table turns, or
        that another hand holds. By default the world.
    base : SE3 or (4, 4), optional
        Pose of the URDF's root link in the world; of several robots a dict, by part.
    on : dict, optional
        Of several robots: part → link of another part (``rail/carriage``) that it stands on, `base`
        being its pose there.
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
    if not isinstance(robot, str | Path | Mapping):
        raise RobotError(f"robot is {shown(robot)}, expected a name or the path of a file")
    for name, given in (("lock", lock), ("arguments", arguments), ("on", on)):
        if not isinstance(given, Mapping | None):
            raise RobotError(f"{name} is {shown(given)}, expected a dict")
    source = (
        _parts(robot, base, on, arguments or {})
        if isinstance(robot, Mapping)
        else _single(robot, base, on, arguments or {})
    )
    urdf = source.urdf
    if tool is None:
        tool = source.tool or _only_leaf(urdf)
    frames = _tool_frames(tool, urdf)
    if tool_offset is not None:
        offset = as_pose(tool_offset, f"{urdf.source}: tool_offset", RobotError)
        urdf, frames[0] = with_tool_offset(urdf, frames[0], offset)
    built = build_robot(urdf, frames, lock or {}, reference)
    acceleration, jerk = (
        read_only([source.limits.get(kind, {}).get(joint, np.inf) for joint in built.joint_names])
        for kind in ("acceleration", "jerk")
    )
    return dataclasses.replace(
        built, touching=source.touching, acceleration_limit=acceleration, jerk_limit=jerk
    )


def _tool_frames(tool: Any, urdf: Urdf) -> list[str]:
    frames = [tool] if isinstance(tool, str) else tool
    if not isinstance(frames, list | tuple) or not frames:
        raise RobotError(
            f"{urdf.source}: tool is {shown(tool)}, expected the name of a link, or several"
        )
    return list(frames)


@dataclass(frozen=True)
class _Source:
    """What is known of a robot before its joints are chosen.

    Attributes
    ----------
    urdf : Urdf
    tool : str or None
        Its usual tool frame; None where it has none.
    touching : tuple of (str, str)
        See `NamedArm.touching`.
    limits : dict
        What its maker publishes, by kind and joint.
    """

    urdf: Urdf
    tool: str | None
    touching: tuple[tuple[str, str], ...] = ()
    limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def _read(robot: str | Path, arguments: Mapping[str, str]) -> _Source:
    known = {**NAMED_ARMS, **NAMED_PARTS}
    if isinstance(robot, str) and robot in known:
        arm = known[robot]
        return _Source(_read_named(arm), arm.tool, arm.touching, _published(robot))
    urdf = _read_file(Path(robot), arguments, str(robot))
    return _Source(urdf, None)


def _single(
    robot: str | Path, base: Any, on: Mapping[str, str] | None, arguments: Mapping[str, str]
) -> _Source:
    if isinstance(base, Mapping) or on is not None:
        what = "on" if on is not None else "base"
        raise RobotError(f"{what} is a dict of parts, but there is one robot, '{robot}'")
    source = _read(robot, arguments)
    urdf = source.urdf
    if base is not None:
        urdf = with_base(urdf, as_pose(base, f"{urdf.source}: base", RobotError))
    return dataclasses.replace(source, urdf=urdf)


def _parts(
    robots: Mapping[str, str | Path],
    base: Any,
    on: Mapping[str, str] | None,
    arguments: Mapping[str, str],
) -> _Source:
    """Return several robots as one."""
    for name in robots:
        if not (isinstance(name, str) and name.isidentifier()):
            raise RobotError(
                f"robot: a part is called {shown(name)}, expected a name of letters, digits and _"
            )
    if not robots:
        raise RobotError("robot: there is no part, expected names with robots")
    if not isinstance(base, Mapping | None):
        raise RobotError(f"base is {shown(base)}, expected a dict, since there are several robots")
    sources = {name: _read(robot, arguments) for name, robot in robots.items()}
    poses = {
        name: as_pose(at, f"base of '{name}'", RobotError) for name, at in (base or {}).items()
    }
    urdf = composed({name: source.urdf for name, source in sources.items()}, poses, on or {})
    on = on or {}
    parts = tuple(
        UrdfPart(name, str(robot), poses.get(name), on.get(name)) for name, robot in robots.items()
    )
    urdf = dataclasses.replace(urdf, parts=parts)
    first, source = next(iter(sources.items()))
    own = source.tool
    limits: dict[str, dict[str, float]] = {}
    for name, part in sources.items():
        for kind, values in part.limits.items():
            for joint, value in values.items():
                limits.setdefault(kind, {})[f"{name}/{joint}"] = value
    touching = tuple(
        (f"{name}/{a}", f"{name}/{b}") for name, part in sources.items() for a, b in part.touching
    )
    return _Source(urdf, None if own is None else f"{first}/{own}", touching, limits)


def build_robot(
    urdf: Urdf, tools: Sequence[str], lock: Mapping[str, float], reference: str | None = None
) -> RobotModel:
    """Build the tree of all joints that move `tools` of a validated URDF; see `load_robot`."""
    for frame in (*tools, *([] if reference is None else [reference])):
        urdf.check_tool(frame)
    full = full_model(urdf)
    _check_lock(urdf, full, lock)
    chain = _moving(urdf, tools, reference)
    for joint in chain:
        if joint.kind in ("floating", "planar"):
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' is {joint.kind}; an arm's joints are "
                f"revolute, continuous or prismatic"
            )
        if joint.mimics is not None and joint.name not in lock:
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' on the way to '{tools[0]}' mimics "
                f"'{joint.mimics}'; choose a tool before it, or hold it with lock="
            )
    free = [joint.name for joint in chain if joint.name not in lock]
    where = "the root" if reference is None else f"'{reference}'"
    if not chain:
        moved = [link for link in urdf.links if any(j.kind != "fixed" for j in urdf.chain(link))]
        which = f"one that does, of: {', '.join(moved)}" if moved else "another arm"
        relative = "" if reference is None else f" relative to '{reference}'"
        raise RobotError(
            f"{urdf.source}: no joint moves the tool '{tools[0]}'{relative}; choose {which}"
        )
    if not free:
        raise RobotError(
            f"{urdf.source}: no joint is left free between {where} and '{tools[0]}': lock holds "
            f"all of {', '.join(joint.name for joint in chain)}"
        )
    locked = _locked_joints(urdf, full, free, lock)
    configuration, locked_ids = locked_configuration(full, locked)
    model = pin.buildReducedModel(full, locked_ids, configuration)
    name_links(urdf, model)
    names = tuple(model.names[1:])
    if model.nq != len(free) or set(names) != set(free):
        raise RobotError(
            f"{urdf.source}: the chain to '{tools[0]}' has joints {free}, but Pinocchio built "
            f"{list(names)}"
        )
    continuous = np.array([name in urdf.continuous() for name in names])
    velocity = np.array(model.velocityLimit, dtype=np.float64)
    effort = np.array(model.upperEffortLimit, dtype=np.float64)
    return RobotModel(
        name=model.name,
        tools=tuple(tools),
        reference=reference,
        joint_names=names,
        lower=read_only(np.where(continuous, -np.inf, model.lowerPositionLimit)),
        upper=read_only(np.where(continuous, np.inf, model.upperPositionLimit)),
        velocity_limit=read_only(np.where(velocity > 0, velocity, np.inf)),
        locked=locked,
        model=model,
        urdf=urdf,
        effort_limit=read_only(np.where(effort > 0.0, effort, np.inf)),
        acceleration_limit=read_only(np.full(len(names), np.inf)),
        jerk_limit=read_only(np.full(len(names), np.inf)),
    )


def _moving(urdf: Urdf, tools: Sequence[str], reference: str | None) -> list[UrdfJoint]:
    """Return the joints that move one of the tools relative to the reference."""
    on_the_way = [] if reference is None else urdf.chain(reference)
    chains = [urdf.chain(tool) for tool in tools]
    found: dict[str, UrdfJoint] = {}
    for chain in chains:
        both = {joint.name for joint in chain} & {joint.name for joint in on_the_way}
        for joint in (*chain, *on_the_way):
            if joint.kind != "fixed" and joint.name not in both:
                found[joint.name] = joint
    return list(found.values())


def rebuild_robot(
    text: str,
    package_dirs: Sequence[str],
    source: str,
    continuous: Sequence[str],
    tool: str | Sequence[str],
    locked: Mapping[str, float],
    touching: Sequence[Sequence[str]],
    acceleration_limit: Sequence[float],
    jerk_limit: Sequence[float],
    reference: str | None = None,
) -> RobotModel:
    """Build an arm from what a saved plan carries of it."""
    urdf = parse_urdf(text, source=source, package_dirs=tuple(package_dirs))
    # The text has the continuous joints as revolute ones already.
    urdf = urdf.with_continuous(continuous)
    tools = [tool] if isinstance(tool, str) else tool
    pairs = tuple((first, second) for first, second in touching)
    return dataclasses.replace(
        build_robot(urdf, tools, locked, reference),
        touching=pairs,
        acceleration_limit=read_only(acceleration_limit),
        jerk_limit=read_only(jerk_limit),
    )


def _published(name: str) -> Mapping[str, Any]:
    """Return what the maker of a named arm publishes: limits by kind and joint."""
    import tomllib

    known = tomllib.loads((Path(__file__).parent / "limits.toml").read_text("utf-8"))
    limits: Mapping[str, Any] = known.get(name, {})
    return {kind: limits[kind] for kind in ("acceleration", "jerk") if kind in limits}


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
