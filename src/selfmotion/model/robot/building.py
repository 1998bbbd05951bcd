"""From a validated URDF to the tree of joints that move its tools."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, RobotError, as_number, nearest, read_only
from selfmotion.model.robot.full_model import full_model, locked_configuration, name_links
from selfmotion.model.robot.mimic import Mimic, coupling_of, mimic_of, tighter_limits
from selfmotion.model.robot.model import LIMITS, RobotModel
from selfmotion.model.robot.mounting import moved_base
from selfmotion.model.robot.named import names_of
from selfmotion.model.robot.urdf import BASE_JOINT, Urdf, UrdfJoint, parse_urdf

# Excess of a held joint over its limits that counts as rounding of a file [rad or m].
_BESIDE = 1e-9


def build_robot(
    urdf: Urdf,
    tools: Sequence[str],
    lock: Mapping[str, float],
    reference: str | None = None,
    chain: Sequence[UrdfJoint] | None = None,
) -> RobotModel:
    """Build the tree of a `chain` of joints of a validated URDF; see `load_robot`.

    By default of all that move `tools` relative to the reference.
    """
    for frame in (*tools, *([] if reference is None else [reference])):
        urdf.check_tool(frame)
    full = full_model(urdf)
    _check_lock(urdf, full, lock)
    chain = moving_joints(urdf, tools, reference) if chain is None else chain
    mimics = {name: mimic_of(urdf, name) for name in urdf.joints}
    free = _free_joints(urdf, chain, tools[0], lock, reference, mimics)
    locked = _locked_joints(urdf, full, free, lock, mimics)
    configuration, locked_ids = locked_configuration(full, locked)
    model = pin.buildReducedModel(full, locked_ids, configuration)
    name_links(urdf, model)
    every = tuple(model.names[1:])
    moved = [name for name in mimics if name not in locked and mimics[name].joint in free]
    if model.nq != len(every) or not set(free) <= set(every) or not set(every) <= set(moved):
        raise RobotError(
            f"{urdf.source}: the chain to '{tools[0]}' has joints {free}, but Pinocchio built "
            f"{list(every)}"
        )
    coupling = coupling_of(every, mimics)
    names = tuple(every[k] for k in coupling.masters)
    continuous = np.array([name in urdf.continuous() for name in every])
    lower, upper = tighter_limits(
        coupling,
        np.where(continuous, -np.inf, model.lowerPositionLimit),
        np.where(continuous, np.inf, model.upperPositionLimit),
        every,
        urdf.source,
    )
    limit = np.array(model.velocityLimit, dtype=np.float64)
    velocity = np.full(len(names), np.inf)
    slowest = np.where(limit > 0.0, limit, np.inf) / np.abs(coupling.scales)
    np.minimum.at(velocity, coupling.coordinates, slowest)
    effort = np.array(model.upperEffortLimit, dtype=np.float64)[coupling.masters]
    return RobotModel(
        # Its URDF may call an arm anything, as UF_ROBOT.
        name=next(iter(names_of(urdf.source)), model.name),
        tools=tuple(tools),
        reference=reference,
        joint_names=names,
        lower=read_only(lower),
        upper=read_only(upper),
        velocity_limit=read_only(velocity),
        locked=locked,
        model=model,
        urdf=urdf,
        effort_limit=read_only(np.where(effort > 0.0, effort, np.inf)),
        acceleration_limit=read_only(np.full(len(names), np.inf)),
        jerk_limit=read_only(np.full(len(names), np.inf)),
        coupling=coupling,
    )


def _free_joints(
    urdf: Urdf,
    chain: Sequence[UrdfJoint],
    tool: str,
    lock: Mapping[str, float],
    reference: str | None,
    mimics: Mapping[str, Mimic],
) -> list[str]:
    """Return the joints of a chain that are not held; RobotError where it is none of an arm.

    Joints that mimic another one are moved by it, wherever it is.
    """
    for joint in chain:
        if joint.kind == "planar":
            parts = ", ".join(f"{joint.name}_{part}" for part in ("x", "y", "yaw"))
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' is planar: it is read as {parts}, of which "
                f'the first two need limits [m]: add <limit lower="-5" upper="5" velocity="0.5"/> '
                f"to it"
            )
        if joint.kind == "floating":
            raise RobotError(
                f"{urdf.source}: joint '{joint.name}' is floating; an arm's joints are revolute, "
                f"continuous or prismatic: make it fixed if the base stands, planar if it drives, "
                f"or six joints in a row"
            )
    by_them = [mimics[joint.name] for joint in chain if joint.name not in lock]
    moving = dict.fromkeys(item.joint for item in by_them if item.scale != 0.0)
    free = [name for name in moving if name not in lock]
    for name in lock:
        by = mimics[name].joint
        if by != name and by in free and mimics[name].scale:
            raise RobotError(
                f"{urdf.source}: lock holds joint '{name}', which mimics '{by}', and that moves; "
                f"hold '{by}'"
            )
    where = "the root" if reference is None else f"'{reference}'"
    if not chain:
        moved = [link for link in urdf.links if any(j.kind != "fixed" for j in urdf.chain(link))]
        which = f"one that does, of: {', '.join(moved)}" if moved else "another arm"
        relative = "" if reference is None else f" relative to '{reference}'"
        raise RobotError(
            f"{urdf.source}: no joint moves the tool '{tool}'{relative}; choose {which}"
        )
    if not free:
        raise RobotError(
            f"{urdf.source}: no joint is left free between {where} and '{tool}': lock holds "
            f"all of {', '.join(joint.name for joint in chain)}"
        )
    return free


def moving_joints(urdf: Urdf, tools: Sequence[str], reference: str | None) -> list[UrdfJoint]:
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
    limits: Mapping[str, Sequence[float]] | None = None,
) -> RobotModel:
    """Build an arm from the values of a saved plan; files of older versions have no `limits`."""
    urdf = parse_urdf(text, source=source, package_dirs=tuple(package_dirs))
    # The text has the continuous joints as revolute ones already.
    urdf = urdf.with_continuous(continuous)
    tools = [tool] if isinstance(tool, str) else tool
    pairs = tuple((first, second) for first, second in touching)
    # All that is not held: a problem may follow other frames than those the arm was loaded for.
    free = [
        joint
        for joint in urdf.joints.values()
        if joint.kind in ("revolute", "continuous", "prismatic") and joint.name not in locked
    ]
    built = build_robot(urdf, tools, locked, reference, free)
    own = {} if limits is None else {name: limits[name] for name in LIMITS}
    own |= {"acceleration_limit": acceleration_limit, "jerk_limit": jerk_limit}
    given: dict[str, Any] = {name: read_only(values) for name, values in own.items()}
    for name, values in given.items():
        if values.shape != (built.dof,):
            raise RobotError(f"{source}: {name} has shape {values.shape}, expected ({built.dof},)")
    return dataclasses.replace(built, touching=pairs, **given)


def with_urdf(robot: RobotModel, urdf: Urdf) -> RobotModel:
    """Return an arm with another URDF of the same links and joints."""
    free = [
        joint
        for joint in urdf.joints.values()
        if joint.kind in ("revolute", "continuous", "prismatic") and joint.name not in robot.locked
    ]
    built = build_robot(urdf, robot.tools, robot.locked, robot.reference, free)
    kept = {name: getattr(robot, name) for name in (*LIMITS, "acceleration_limit", "jerk_limit")}
    return dataclasses.replace(built, touching=robot.touching, **kept)


def with_moved_base(robot: RobotModel, by: pin.SE3) -> RobotModel:
    """Return an arm that stands elsewhere, moved by a rigid motion in world axes."""
    return with_urdf(robot, moved_base(robot.urdf, by))


def root_place(robot: RobotModel) -> Array:
    """Return the position of an arm's nominal root link in the world, (3,) [m]."""
    urdf = robot.urdf
    link = urdf.joints[BASE_JOINT].child if BASE_JOINT in urdf.joints else urdf.root
    return np.array(robot.carrier_of(link)[1].translation)


def _check_lock(urdf: Urdf, model: Any, lock: Mapping[str, float]) -> None:
    for name, value in lock.items():
        if not isinstance(name, str) or not model.existJointName(name):
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
                f"{urdf.source}: lock holds joint '{name}' at {value:.6g} "
                f"{'m' if urdf.joints[name].kind == 'prismatic' else 'rad'}, beyond its limits "
                f"{lower:.6g} to {upper:.6g}"
            )


def _locked_joints(
    urdf: Urdf,
    model: Any,
    free: list[str],
    lock: Mapping[str, float],
    mimics: Mapping[str, Mimic],
) -> dict[str, float]:
    """Return the positions of held joints off the chain, but for those that mimic one on it."""
    locked: dict[str, float] = {}

    def hold(name: str) -> float:
        if name in locked:
            return locked[name]
        joint, source = model.joints[model.getJointId(name)], urdf.joints[name]
        lower = model.lowerPositionLimit[joint.idx_q]
        upper = model.upperPositionLimit[joint.idx_q]
        value = lock.get(name, np.clip(0.0, lower, upper))
        if mimics[name].scale == 0.0:
            value = mimics[name].offset
        elif source.mimics is not None:
            followed = source.multiplier * hold(source.mimics) + source.offset
            if name in lock and abs(followed - lock[name]) > _BESIDE:
                raise RobotError(
                    f"{urdf.source}: lock holds joint '{name}' at {lock[name]:.6g}, but it mimics "
                    f"'{source.mimics}' and is at {followed:.6g}; hold that one"
                )
            value = followed
        locked[name] = float(value)
        return locked[name]

    for index in range(1, model.njoints):
        name = model.names[index]
        moves = mimics[name].joint in free and mimics[name].scale != 0.0
        if not moves and model.joints[index].nq == 1:
            hold(name)
    return locked
