"""Planning problems of every kind, generated: small descriptions, and how to build what they mean.

Choices are drawn by hypothesis; lengths and angles follow from a seed, so that the description of a
problem is a line of text from which it is made again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh
from hypothesis import strategies as st

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import NullMotion
from selfmotion.problem.constraints import NO_OVERLAP, separate_clearances

JOINTS = ("revolute", "revolute", "revolute", "prismatic", "continuous")
AXES = ("0 0 1", "0 1 0", "1 0 0", "0 0 -1", "0.6 0 0.8", "0 0 2")
BODIES = ("", "sphere", "box", "cylinder")
PATHS = ("line", "constant", "circle", "twist", "spline", "noisy", "pause", "corners", "stop")
OBSTACLES = ("box", "sphere", "cylinder", "capsule", "mesh", "plate", "torch", "bracket")
CONSTRAINTS = ("speed", "acceleration", "rest", "end", "closed", "position", "clearance", "self")
TASKS = tuple(task.value for task in sm.Task)
COSTS = ("velocity", "acceleration", "jerk", "manipulability", "posture", "limits", "length", "own")
NULL_MOTIONS = ("polynomial", "monomial", "spline", "still")
ODD = ("nan", "zero", "huge", "tiny", "shape", "instant", "endless", "degrees", "far")


@dataclass(frozen=True)
class Generated:
    """A problem in words: `build` makes it."""

    joints: tuple[tuple[str, str, str], ...]
    gripper: bool
    locked: int
    path: str
    task: str
    free: bool
    constraints: tuple[str, ...]
    obstacles: tuple[str, ...]
    costs: tuple[str, ...]
    null_motion: str
    relaxed: str
    damped: bool
    odd: str
    seed: int


def problems(most_joints: int = 9) -> st.SearchStrategy[Generated]:
    """Return a strategy for descriptions of problems."""
    joint = st.tuples(st.sampled_from(JOINTS), st.sampled_from(AXES), st.sampled_from(BODIES))

    def some(kinds: tuple[str, ...], most: int) -> st.SearchStrategy[tuple[str, ...]]:
        return st.lists(st.sampled_from(kinds), max_size=most, unique=True).map(tuple)

    def rarely(kinds: tuple[str, ...], share: int) -> st.SearchStrategy[str]:
        return st.sampled_from(("",) * (share * len(kinds)) + kinds)

    return st.builds(
        Generated,
        joints=st.integers(2, most_joints).flatmap(
            lambda count: st.lists(joint, min_size=count, max_size=count).map(tuple)
        ),
        gripper=st.booleans(),
        locked=st.integers(-6, 3),
        path=st.sampled_from(PATHS),
        task=st.sampled_from(("",) * 10 + TASKS),
        free=st.booleans(),
        constraints=some(CONSTRAINTS, 3),
        obstacles=some(OBSTACLES, 3),
        costs=some(COSTS, 2),
        null_motion=st.sampled_from(NULL_MOTIONS),
        relaxed=rarely(("band", "window", "cone", "tool"), 2),
        damped=st.sampled_from((False,) * 7 + (True,)),
        odd=rarely(ODD, 6),
        seed=st.integers(0, 2**31 - 1),
    )


def arm_text(words: Generated, rng: np.random.Generator) -> str:
    """Return the URDF of an arm, its tool 'tcp'."""
    parts, above = ['<link name="l0"/>'], "l0"
    for k, (kind, axis, shape) in enumerate(words.joints, start=1):
        length = rng.uniform(0.08, 0.35)
        offset = [0.0, 0.0, length] if rng.uniform() < 0.7 else [length, 0.0, 0.02]
        turn = rng.choice([0.0, 0.0, 0.5 * np.pi, -0.5 * np.pi, 0.3], 3)
        reach = (0.05, 0.3) if kind == "prismatic" else (0.8, 3.0)
        low, high = -rng.uniform(*reach), rng.uniform(*reach)
        limit = f'<limit lower="{low}" upper="{high}" velocity="{rng.uniform(0.8, 4)}" effort="9"/>'
        parts.append(f'<link name="l{k}">{_body(shape, rng)}</link>')
        parts.append(_joint(f"j{k}", kind, above, f"l{k}", offset, turn, axis, limit))
        above = f"l{k}"
    if words.gripper:
        for name, side, mimic in (("left", 1, ""), ("right", -1, '<mimic joint="left"/>')):
            limit = f'<limit lower="0" upper="0.05" velocity="1" effort="1"/>{mimic}'
            parts.append(
                f'<link name="finger_{name}"><collision><geometry><box size="0.01 0.01 0.04"/>'
                f"</geometry></collision></link>"
            )
            place = [0.0, 0.02 * side, 0.05]
            across = f"0 {side} 0"
            finger = f"finger_{name}"
            parts.append(_joint(name, "prismatic", above, finger, place, [0, 0, 0], across, limit))
    tip = [0.0, 0.0, rng.uniform(0.0, 0.15)]
    parts += ['<link name="tcp"/>', _joint("tip", "fixed", above, "tcp", tip, [0, 0, 0], "", "")]
    return f'<robot name="made">{"".join(parts)}</robot>'


def _joint(
    name: str, kind: str, parent: str, child: str, xyz: Any, rpy: Any, axis: str, rest: str
) -> str:
    direction = f'<axis xyz="{axis}"/>' if axis else ""
    place = f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{place}{direction}{rest}</joint>"
    )


def _body(shape: str, rng: np.random.Generator) -> str:
    size = rng.uniform(0.01, 0.05, 3)
    text = {
        "": "",
        "sphere": f'<sphere radius="{size[0]}"/>',
        "box": f'<box size="{size[0]} {size[1]} {3 * size[2]}"/>',
        "cylinder": f'<cylinder radius="{size[0]}" length="{3 * size[1]}"/>',
    }[shape]
    place = f'<origin xyz="0 0 {rng.uniform(0, 0.1)}"/>'
    return text and f"<collision>{place}<geometry>{text}</geometry></collision>"


def build(words: Generated, folder: Path) -> sm.Problem:
    """Return the problem, or raise what the package raises on its way."""
    rng = np.random.default_rng(words.seed)
    file = folder / "made.urdf"
    file.write_text(arm_text(words, rng))
    lock = {f"j{words.locked}": 0.1} if words.locked > 0 else {}
    if words.gripper and words.locked == 3:
        lock["left"] = 0.03
    robot = sm.load_robot(file, "tcp", lock)
    lower, upper = robot.finite_limits()
    q = lower + (upper - lower) * rng.uniform(0.25, 0.75, robot.dof)
    step = rng.uniform(0.05, 0.25) * np.minimum(upper - lower, 1.0)
    moves = np.cumsum(rng.uniform(-step, step, (6, robot.dof)), axis=0)
    others = np.clip(q + moves, lower, upper)
    duration = {"instant": 1e-3, "endless": 1e5}.get(words.odd, float(rng.uniform(1.0, 8.0)))
    possible = [task for task in TASKS if robot.can_follow(task) and robot.redundancy(task)]
    task = words.task or (possible[rng.integers(len(possible))] if possible else "position")
    kind = "circle" if "closed" in words.constraints and rng.random() < 0.9 else words.path
    path = _path(kind, [robot.pose(x) for x in (q, *others)], duration, rng)
    start: Any = None if words.free else q
    if words.odd in ("nan", "shape", "far"):
        start = {"nan": q * np.nan, "shape": q[:-1], "far": q + 3.0}[words.odd]
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    wanted = [
        _constraint(name, words, robot, path, task, folder, rng) for name in words.constraints
    ]
    replaced = {type(item) for item in wanted}
    constraints = [*(item for item in limits if type(item) not in replaced), *wanted]
    others, apart = separate_clearances(constraints, NO_OVERLAP)
    return sm.Problem(
        robot,
        path,
        task,
        start,
        _null_motion(words.null_motion),
        [_cost(name, q, lower, upper) for name in words.costs or ("velocity",)],
        others,
        _relaxations(words.relaxed, task, duration),
        sm.Damping() if words.damped else None,
        apart,
    )


def _path(
    kind: str, poses: list[pin.SE3], duration: float, rng: np.random.Generator
) -> sm.paths.Path:
    first, second = poses[:2]
    if kind in ("line", "constant"):
        law = {"line": "minimum_jerk", "constant": "constant"}[kind]
        return sm.paths.Line(first, second, duration, law)
    if kind == "circle":
        radius, normal = rng.uniform(0.01, 0.08), rng.normal(size=3)
        return sm.paths.Circle.around(
            first, radius, duration, normal=normal, turn_tool=rng.random() < 0.2
        )
    if kind == "twist":
        v = rng.uniform(-0.1, 0.1, 6) / duration
        return sm.paths.TwistPath(first, lambda t: v * np.sin(np.pi * t / duration), duration)
    if kind == "spline":
        return sm.paths.Waypoints.from_poses(np.linspace(0.0, duration, len(poses)), poses)
    if kind == "noisy":
        count = int(rng.integers(10, 80))
        line, t = sm.paths.Line(first, second, duration), np.linspace(0.0, duration, count)
        points = line.samples(t)
        noise = 10.0 ** rng.uniform(-6, -4)
        turns = [np.roll(pin.Quaternion(turn).coeffs(), 1) for turn in points.rotation]
        points = points.translation + noise * rng.normal(size=(count, 3))
        return sm.paths.Waypoints(t, points, turns)
    if kind == "pause":
        return sm.paths.Waypoints.from_poses(
            np.array([0.0, 0.4, 0.6, 1.0]) * duration, [first, second, second, poses[2]]
        )
    corners = "stop" if kind == "stop" else "blend"
    return sm.paths.Waypoints.from_poses(np.linspace(0, duration, 4), poses[:4], corners=corners)


def _constraint(
    name: str,
    words: Generated,
    robot: sm.RobotModel,
    path: sm.paths.Path,
    task: str,
    folder: Path,
    rng: np.random.Generator,
) -> sm.constraints.Constraint:
    if words.odd == "zero" and name in ("speed", "acceleration"):
        return sm.constraints.JointAccelerationLimits(0.0)
    lower, upper = robot.finite_limits()
    makers: dict[str, Callable[[], sm.constraints.Constraint]] = {
        "speed": lambda: sm.constraints.JointVelocityLimits(rng.uniform(0.3, 3.0, robot.dof)),
        "acceleration": lambda: sm.constraints.JointAccelerationLimits(rng.uniform(1.0, 20.0)),
        "rest": lambda: (
            sm.constraints.EndVelocity(0.0)
            if words.path in ("line", "twist")
            else sm.constraints.JointVelocityLimits()
        ),
        "end": lambda: sm.constraints.EndConfiguration(
            robot.inverse_kinematics(path.pose(path.duration), task, attempts=10)
        ),
        "closed": lambda: sm.constraints.ClosedPath(),
        "position": lambda: sm.constraints.JointPositionLimits(
            lower + rng.uniform(0.0, 0.1), np.degrees(upper) if words.odd == "degrees" else upper
        ),
        "clearance": lambda: sm.constraints.Clearance(
            [_obstacle(kind, robot, folder, rng) for kind in words.obstacles],
            float(rng.choice([0.0, 1e-3, 5e-3, 2e-2])),
        ),
        "self": lambda: sm.constraints.Clearance((), 1e-3),
    }
    return makers[name]()


def _obstacle(
    kind: str, robot: sm.RobotModel, folder: Path, rng: np.random.Generator
) -> sm.obstacles.Obstacle:
    away = rng.normal(size=3)
    away *= robot.reach * rng.uniform(0.2, 1.0) / np.linalg.norm(away)
    pose = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), away)
    size = rng.uniform(0.02, 0.2, 3)
    match kind:
        case "torch":
            place = pin.SE3(pose.rotation, rng.uniform(-0.1, 0.1, 3))
            return sm.obstacles.Cylinder(kind, place, 0.1 * size[0], size[1], frame="tcp")
        case "bracket":
            place = pin.SE3(pose.rotation, rng.uniform(-0.15, 0.15, 3))
            return sm.obstacles.Box(
                kind, place, 0.3 * size, frame=str(rng.choice(robot.urdf.links))
            )
        case "box":
            return sm.obstacles.Box(kind, pose, size)
        case "plate":
            return sm.obstacles.Box(kind, pose, [1.0, 1.0, rng.uniform(1e-3, 5e-3)])
        case "sphere":
            return sm.obstacles.Sphere(kind, pose, size[0])
        case "cylinder":
            return sm.obstacles.Cylinder(kind, pose, size[0], size[1])
        case "capsule":
            return sm.obstacles.Capsule(kind, pose, 0.5 * size[0], size[1])
    file = folder / "made.stl"
    trimesh.creation.box([0.1, 0.1, 0.2]).export(file)
    return sm.obstacles.Mesh(kind, pose, file)


def _null_motion(kind: str) -> NullMotion:
    return {
        "polynomial": lambda: sm.PolynomialNullMotion(3),
        "monomial": lambda: sm.PolynomialNullMotion(2, "joint", "monomial"),
        "spline": lambda: sm.motion.BSplineNullMotion(6),
        "still": lambda: sm.PolynomialNullMotion(0),
    }[kind]()


def _cost(name: str, q: Array, lower: Array, upper: Array) -> sm.costs.Cost:
    return {
        "velocity": sm.costs.JointVelocity,
        "acceleration": sm.costs.JointAcceleration,
        "jerk": sm.costs.JointJerk,
        "manipulability": sm.costs.InverseManipulability,
        "posture": lambda: sm.costs.Posture(0.5, posture=q),
        "limits": lambda: sm.costs.JointLimitDistance(lower, upper),
        "length": lambda: sm.costs.PathLength(joint_weights=np.ones(len(q))),
        "own": lambda: sm.costs.FunctionCost(lambda qd, q, t: np.sum(qd**2, axis=1), name="own"),
    }[name]()


def _relaxations(kind: str, task: str, duration: float) -> list[sm.Relaxation]:
    planar, turns = "planar" in task, task in ("pose", "pointing", "planar_pose")
    row = "x" if planar else "z"
    return {
        "": [],
        "band": [sm.Relaxation(row, 2e-3)],
        "window": [sm.Relaxation(("x", "y"), 5e-3, during=(0.2 * duration, 0.7 * duration))],
        "cone": [sm.Relaxation("rz" if planar else ("rx", "ry"), 0.1)] if turns else [],
        "tool": [sm.Relaxation(row, 1e-3, axes="tool")],
    }[kind]
