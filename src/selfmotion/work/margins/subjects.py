"""Bodies of a cell that may be displaced: the part, the tool, the base."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, nearest
from selfmotion.certificate import Separation
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import BoundTaskFrame
from selfmotion.model.path import spread_along
from selfmotion.model.robot import BASE_JOINT, root_place
from selfmotion.planning.result import Plan

# Intervals on which the way of a tip is bounded.
_INTERVALS = 1000


@dataclass(frozen=True, eq=False)
class Miss:
    """How a tip leaves its path where a subject is displaced.

    Attributes
    ----------
    tip : str
        The link.
    position, rotation : float
        By how much it misses its path while nothing is displaced [m], [rad].
    angular : bool
        Whether its orientation is prescribed.
    lever : float
        How far it, or its path, is from the centre of the displacement at most, at any time [m].
    """

    tip: str
    position: float
    rotation: float
    angular: bool
    lever: float


@dataclass(frozen=True, eq=False)
class Subject:
    """A displaced body, and the centre of its rotation.

    Attributes
    ----------
    name : str
    bodies : tuple of str
        Links and obstacles that are displaced, or, of the base, all that is while it stays.
    joint : int
        What carries them, 0 for the world.
    center : (3,)
        In its frame [m].
    about : str
        The centre in words.
    sign : float
        -1 where the bodies stay, and all else is displaced.
    misses : tuple of Miss
    """

    name: str
    bodies: tuple[str, ...]
    joint: int
    center: Array
    about: str
    sign: float
    misses: tuple[Miss, ...]


def models_of(plan: Plan) -> tuple[CollisionModel, ...]:
    """Return the models of all bodies that a plan keeps apart."""
    return tuple(item.model for item in plan.requirements if isinstance(item, Separation))


def part_of(plan: Plan, names: Sequence[str] | None, center: Array | None) -> Subject:
    """Return the part: bodies by name, by default all that may stand with the path.

    Raises
    ------
    ProblemError
        There is no such body, or they are carried by different joints.
    """
    chain = plan.problem.follows.items[0].chain
    joint, where = chain.carrier + 1, chain_base(plan)
    if names is None:
        bodies = _on_joint(plan, joint)
    else:
        bodies, joint = _named(plan, names, "part")
    if center is None:
        center, about = _middle_of_path(plan), "the middle of the path"
        if joint != chain.carrier + 1:
            raise ProblemError(
                f"part: {', '.join(bodies)} are carried by another joint than the path is, whose "
                f"middle is no place there: give center="
            )
    else:
        told = ", ".join(f"{x:.4g}" for x in center)
        if joint == chain.carrier + 1:
            center = chain.base_placement.act(center)
        else:
            where = f"joint '{plan.robot.model.names[joint]}'" if joint else "the world"
        about = f"({told}) in the frame of {where}"
    return Subject("part", bodies, joint, center, about, 1.0, _of_paths(plan, joint, center))


def tool_of(plan: Plan, names: Sequence[str] | None) -> Subject:
    """Return the tool: bodies by name, by default all that the tool's joint carries.

    Of a tool that stands in the world, all that the cell has there and that carries no joint. Paths
    in the frame of the tool go with it, as of a second arm that holds on to the same part.

    Raises
    ------
    ProblemError
        There is no such body, or they are carried by different joints.
    """
    robot = plan.robot
    joint, _ = robot.carrier_of(robot.tool)
    if names is not None:
        bodies, joint = _named(plan, names, "tool")
    else:
        bodies = _on_joint(plan, joint) if joint else _in_the_cell(plan)
    items = plan.problem.follows.items
    misses = []
    for item, (position, rotation) in zip(items, _errors(plan), strict=True):
        carrier, place = robot.carrier_of(item.chain.tip_name)
        if carrier == joint:
            lever = float(np.linalg.norm(place.translation))
            angular = item.task.angular
            misses.append(Miss(item.chain.tip_name, position, rotation, angular, lever))
    if joint:
        misses += _of_paths(plan, joint, np.zeros(3))
    about = f"the origin of joint '{robot.model.names[joint]}'" if joint else "the world's origin"
    return Subject("tool", bodies, joint, np.zeros(3), about, 1.0, tuple(misses))


def base_of(plan: Plan) -> Subject:
    """Return the base of the arm, or of the whole cell, in the world."""
    urdf = plan.robot.urdf
    link = urdf.joints[BASE_JOINT].child if BASE_JOINT in urdf.joints else urdf.root
    # Obstacles that are mounted on the base move with it.
    mounted = {body.name for body in plan.obstacles if body.frame is not None}
    bodies = tuple(name for name in _on_joint(plan, 0) if name not in mounted)
    center = root_place(plan.robot)
    about = f"the origin of '{link}'"
    return Subject("base", bodies, 0, center, about, -1.0, _of_paths(plan, 0, center))


def chain_base(plan: Plan) -> str:
    """Return in words in whose frame the path is."""
    reference = plan.robot.reference
    return f"'{reference}'" if reference else "the world"


def _on_joint(plan: Plan, joint: int) -> tuple[str, ...]:
    """Return all bodies that a joint carries; of those of the world the obstacles."""
    found = (
        body.name
        for model in models_of(plan)
        for body in model.every_body
        if body.joint == joint and (joint or body.is_obstacle)
    )
    return tuple(dict.fromkeys(found))


def _in_the_cell(plan: Plan) -> tuple[str, ...]:
    """Return the links that stand in the world and carry nothing that moves."""
    joints = plan.robot.urdf.joints.values()
    carriers = {item.parent for item in joints if item.kind != "fixed"}
    found = (
        body.name
        for model in models_of(plan)
        for body in model.every_body
        if not body.joint and not body.is_obstacle and body.name not in carriers
    )
    return tuple(dict.fromkeys(found))


def _named(plan: Plan, names: Sequence[str], what: str) -> tuple[tuple[str, ...], int]:
    """Return bodies by their names, and what joint carries them."""
    if isinstance(names, str) or not all(isinstance(name, str) for name in names) or not names:
        raise ProblemError(f"{what} is {names!r}, expected names of obstacles or links")
    joints = {body.name: body.joint for model in models_of(plan) for body in model.every_body}
    for name in names:
        if name not in joints:
            raise ProblemError(
                f"{what}: there is no body '{name}'{nearest(name, joints)}; bodies: "
                f"{', '.join(joints) or 'none'}"
            )
    carriers = {joints[name] for name in names}
    if len(carriers) > 1:
        raise ProblemError(
            f"{what}: {', '.join(names)} are carried by different joints, expected bodies that "
            f"move as one"
        )
    return tuple(names), carriers.pop()


def _errors(plan: Plan) -> list[tuple[float, float]]:
    check = plan.certificate
    found = ((check.position_error, check.rotation_error), *check.others)
    return [(position.value, rotation.value) for position, rotation in found]


def _of_paths(plan: Plan, joint: int, center: Array) -> tuple[Miss, ...]:
    """Return how tips leave those paths that a joint carries, 0 for the world."""
    return tuple(
        Miss(
            item.chain.tip_name,
            position,
            rotation,
            item.task.angular,
            _lever(plan, item, center) + (0.0 if k else _deviation(plan)),
        )
        for k, (item, (position, rotation)) in enumerate(
            zip(plan.problem.follows.items, _errors(plan), strict=True)
        )
        if item.chain.carrier + 1 == joint
    )


def _deviation(plan: Plan) -> float:
    """Return how far a relaxed path is from the tool at most [m]."""
    pairs = zip(plan.problem.relaxations, plan.certificate.deviations, strict=True)
    return sum(found.value for item, found in pairs if not _is_angular(item.rows))


def _is_angular(rows: Iterable[str]) -> bool:
    return any(row.startswith("r") for row in rows)


def relaxes_rotation(plan: Plan) -> bool:
    """Whether the orientation of the tool is relaxed."""
    return any(_is_angular(item.rows) for item in plan.problem.relaxations)


def _middle_of_path(plan: Plan) -> Array:
    """Return the middle of the box around the path, in the frame of what carries it (3,)."""
    path, chain = plan.path, plan.problem.follows.items[0].chain
    places = path.samples(spread_along(path, 201)).translation
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    return np.asarray(chain.base_placement.act(middle))


def _lever(plan: Plan, item: BoundTaskFrame, center: Array) -> float:
    """Return how far a tip is from a centre at most, at any time [m].

    Between two samples it moves by no more than the ways of the joints times the arm's reach.
    """
    motion, robot = plan.trajectory, plan.robot
    t = np.linspace(motion.t[0], motion.t[-1], _INTERVALS + 1)
    _, _, places = item.chain.along(motion(t))
    own = item.chain.base_placement.actInv(center)
    far = np.linalg.norm(places - own, axis=1)
    rates = np.where(robot.tree.is_revolute, robot.reach_of(item.chain), 1.0)
    made = np.diff(motion.travelled(t), axis=0) @ robot.coupling.bounds(rates)
    return float((0.5 * (far[1:] + far[:-1] + made)).max())
