"""Motions that are hard to judge: between their samples they pass what the samples keep, or nearly.

Each is made from a number, as what `selfmotion.certify` takes and as what `oracle.Judge` knows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from support.oracle import Judge
from support.own_kinematics import Arm, along
from support.solids import Solid, solid_of_obstacle

# Half of what a critical quantity may lie beside its limit, as a share.
NEAR = 0.03


@dataclass(frozen=True, eq=False)
class Followed(sm.paths.Path):
    """The tool's own motion, so that nothing but limits and distances is at stake."""

    arm: Arm
    motion: sm.Trajectory
    duration: float

    @property
    def knots(self) -> Array:
        return self.motion.t

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        turn, at = self.arm.place(self.arm.tool, along(self.motion, t, 0))
        return sm.paths.PathSamples(t, at, turn, np.zeros((len(t), 6)))


@dataclass(frozen=True, eq=False)
class Scene:
    """A motion and what it has to keep."""

    judge: Judge
    motion: sm.Trajectory
    requirements: Sequence[sm.certificate.Requirement] = field(default_factory=tuple)

    def certify(self) -> sm.Certificate:
        """Return what the package finds."""
        judge = self.judge
        return sm.certify(
            judge.robot,
            judge.path,
            judge.task,
            self.motion,
            judge.tolerance,
            self.requirements,
            relaxations=judge.relaxations,
        )


def arm(
    folder: Path,
    rng: np.random.Generator,
    joints: int,
    shape: str = "",
    limits: tuple[Array, Array, Array] | None = None,
) -> sm.RobotModel:
    """Return an arm with bodies of a shape on its links; limits are (lower, upper, speed)."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1", "0 1 0")
    wide = np.full(joints, 6.0)
    lower, upper, speed = (-wide, wide, 50.0 * wide) if limits is None else limits
    parts = ['<robot name="made"><link name="l0"/>']
    for k in range(joints):
        size = rng.uniform(0.005, 0.02, 3)
        body = {
            "": "",
            "sphere": f'<sphere radius="{size[0]}"/>',
            "box": f'<box size="{size[0]} {size[1]} {5.0 * size[2]}"/>',
        }[shape]
        place = f'<origin xyz="0 0 {rng.uniform(0.05, 0.2)}"/>'
        body = body and f"<collision>{place}<geometry>{body}</geometry></collision>"
        parts.append(
            f'<link name="l{k + 1}">{body}</link><joint name="j{k + 1}" type="revolute">'
            f'<parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="0 0 {rng.uniform(0.15, 0.3)}"/><axis xyz="{axes[k]}"/>'
            f'<limit lower="{float(lower[k])!r}" upper="{float(upper[k])!r}" '
            f'velocity="{float(speed[k])!r}" effort="1"/></joint>'
        )
    parts.append(
        f'<link name="tcp"/><joint name="tip" type="fixed"><parent link="l{joints}"/>'
        f'<child link="tcp"/><origin xyz="0 0 0.2"/></joint></robot>'
    )
    file = folder / "arm.urdf"
    file.write_text("".join(parts))
    return sm.load_robot(file, "tcp")


def coarse(
    rng: np.random.Generator, joints: int, size: float, names: Sequence[str] = ()
) -> sm.Trajectory:
    """Return a motion of a few samples, with velocities that belong to it or do not."""
    count = int(rng.integers(2, 7))
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.0, count - 1))])
    q = np.cumsum(rng.uniform(-size, size, (count, joints)), axis=0)
    qd = np.gradient(q, t, axis=0) * rng.uniform(0.0, 1.5)
    if rng.uniform() < 0.3:
        qd = rng.uniform(-2.0, 2.0, (count, joints)) * size
    return sm.Trajectory(t, q, qd, tuple(names) or tuple(f"j{k + 1}" for k in range(joints)))


def among_plates(number: int, folder: Path) -> Scene:
    """Return an arm of simple bodies that passes thin plates between samples, or beside them."""
    rng = np.random.default_rng(number)
    shape = "box" if number % 4 == 0 else "sphere"
    robot = arm(folder, rng, int(rng.integers(2, 7)), shape)
    motion = coarse(rng, robot.dof, float(rng.uniform(0.2, 1.2)))
    known = Arm(robot)
    plates = [
        _plate(f"plate{k}", known, known.solids, motion, rng)[0]
        for k in range(int(rng.integers(1, 3)))
    ]
    return _among(robot, known, motion, plates, rng)


def carrying(number: int, folder: Path) -> Scene:
    """Return an arm that carries a body past plates, some of which its own links carry."""
    rng = np.random.default_rng(number)
    robot = arm(folder, rng, int(rng.integers(2, 7)), ("", "sphere")[number % 2])
    motion = coarse(rng, robot.dof, float(rng.uniform(0.2, 1.2)))
    known, links = Arm(robot), [f"l{k + 1}" for k in range(robot.dof)]
    # On the last links, so that there are some before it.
    last = int(rng.integers(robot.dof // 2, robot.dof))
    place = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-3.0, 3.0, 3)), rng.uniform(-0.2, 0.2, 3))
    size = rng.uniform(0.005, 0.03, 3)
    carried = {
        0: sm.obstacles.Sphere("carried", place, float(size[0]), frame=links[last]),
        1: sm.obstacles.Capsule(
            "carried", place, float(size[0]), float(5.0 * size[1]), frame=links[last]
        ),
        2: sm.obstacles.Box("carried", place, size * [1.0, 1.0, 5.0], frame=links[last]),
    }[number % 3]
    solids = [(links[last], solid_of_obstacle(carried))]
    plates = []
    for k in range(int(rng.integers(1, 3))):
        plate, t = _plate(f"plate{k}", known, solids, motion, rng)
        if last and rng.uniform() < 0.5:
            below = links[int(rng.integers(last))]
            (turn, at) = (each[0] for each in known.place(below, along(motion, t[:1], 0)))
            on_link = pin.SE3(turn, at).actInv(plate.pose)
            plate = replace(plate, pose=on_link, frame=below)
        plates.append(plate)
    return _among(robot, known, motion, [carried, *plates], rng)


def _among(
    robot: sm.RobotModel,
    known: Arm,
    motion: sm.Trajectory,
    bodies: Sequence[sm.obstacles.Obstacle],
    rng: np.random.Generator,
) -> Scene:
    distance = float(rng.choice([2e-4, 1e-3, 5e-3]))
    wanted = sm.constraints.Clearance(bodies, distance)
    judge = Judge(
        robot,
        Followed(known, motion, motion.duration),
        "position",
        bodies=[(bodies, wanted.model(robot).pairs, distance)],
    )
    return Scene(judge, motion, [wanted.requirement(robot)])


def _plate(
    name: str,
    known: Arm,
    solids: Sequence[tuple[str, Solid]],
    motion: sm.Trajectory,
    rng: np.random.Generator,
) -> tuple[sm.obstacles.Box, Array]:
    """Return a plate across the way of a body, and when: it meets, touches or clears it then."""
    link, solid = solids[rng.integers(len(solids))]
    t = rng.uniform(0.0, motion.t[-1]) + np.array([0.0, 1e-4])
    t -= max(0.0, t[-1] - motion.t[-1])
    _, at = solid.placed(known.place(link, along(motion, t, 0)))
    way = at[1] - at[0]
    normal = way / max(float(np.linalg.norm(way)), 1e-12)
    if np.linalg.norm(way) < 1e-9:  # a body that a joint turns about its own middle
        normal = np.array([0.0, 0.0, 1.0])
    aside = np.cross(normal, rng.normal(size=3))
    aside /= np.linalg.norm(aside)
    half = np.array([*rng.uniform(0.03, 0.15, 2), 0.5 * rng.uniform(1e-3, 5e-3)])
    rotation = np.stack([aside, np.cross(normal, aside), normal], axis=1)
    # Its edge along the body's side, from 1 cm within the body to 3 cm away.
    clear = solid.reach if solid.radius else float(solid.half.max())
    aside = rotation[:, 0] * (half[0] + clear + rng.uniform(-0.01, 0.03))
    return sm.obstacles.Box(name, pin.SE3(rotation, at[0] + aside), 2.0 * half), t


def near_limits(number: int, folder: Path) -> Scene:
    """Return a foreign motion that comes within 3 % of a limit of position, speed or q̈."""
    rng = np.random.default_rng(number)
    joints, critical = int(rng.integers(2, 8)), number % 3
    motion = coarse(rng, joints, float(rng.uniform(0.2, 1.5)))
    fine = np.concatenate(
        [np.linspace(a, b, 1001) for a, b in zip(motion.t[:-1], motion.t[1:], strict=True)]
    )
    x = [along(motion, fine, order) for order in range(3)]
    # Each joint has its own share, so that one alone decides.
    shares = 1.0 + rng.uniform(-NEAR, NEAR) + rng.uniform(0.0, NEAR, joints)
    middle, half = 0.5 * (x[0].max(axis=0) + x[0].min(axis=0)), 0.5 * np.ptp(x[0], axis=0)
    # 1 % of a position limit counts as 0.01 rad here: what the judge takes for spare.
    half = half + (shares - 1.0 if critical == 0 else 1.0)
    speed = np.abs(x[1]).max(axis=0) * (shares if critical == 1 else 2.0) + 1e-9
    robot = arm(folder, rng, joints, limits=(middle - half, middle + half, speed))
    most = np.abs(x[2]).max(axis=0) * (shares if critical == 2 else 2.0) + 1e-9
    wanted = sm.constraints.JointAccelerationLimits(most)
    judge = Judge(
        robot,
        Followed(Arm(robot), motion, motion.duration),
        "position",
        limits={2: (-most, most)},
    )
    return Scene(judge, motion, [wanted.requirement(robot)])


def seam(number: int, robot: sm.RobotModel, start: Array) -> sm.paths.Waypoints:
    """Return a measured seam of 20 to 120 rows: noise of 10 to 100 µm, corners, pauses."""
    rng = np.random.default_rng(number)
    pose, count, duration = robot.pose(start), int(rng.integers(20, 120)), rng.uniform(6.0, 20.0)
    s = np.linspace(0.0, 1.0, count)
    way = rng.uniform(-0.15, 0.15, 3)
    bow = 0.03 * np.outer(np.sin(2.0 * np.pi * s * rng.integers(1, 4)), rng.normal(size=3))
    points = pose.translation + np.outer(s, way) + bow - bow[0]
    if number % 3 == 0:
        points[count // 2 :, 2] += 0.05 * (s[count // 2 :] - s[count // 2])
    points += 10.0 ** rng.uniform(-5, -4) * rng.normal(size=points.shape)
    points[0] = pose.translation
    t = duration * s
    if number % 4 == 0:
        points[count // 3 + 1] = points[count // 3]
    turns = np.tile(np.roll(pin.Quaternion(pose.rotation).coeffs(), 1), (count, 1))
    return sm.paths.Waypoints(t, points, turns, corners=("blend", "stop")[number % 2])


def seams(number: int, robot: sm.RobotModel, start: Array) -> list[Scene]:
    """Return three motions along a seam: as planned, and coarser, their errors near the tolerance.

    Empty where there is no plan.
    """
    rng = np.random.default_rng(number + 10**6)
    path = seam(number, robot, start)
    task = ("position", "pointing", "pose")[number % 3]
    try:
        plan = sm.plan(sm.Problem(robot, path, task, start), max_evaluations=3)
    except sm.SelfmotionError:
        return []
    # Its bodies are meshes, of which the judge knows nothing; beyond the arm's limits of position
    # and speed nothing is asked.
    judge = replace(Judge.of(plan), bodies=(), limits={})
    found = [Scene(judge, plan.trajectory)]
    for spoil in (_thinned, _moved):
        motion = spoil(plan.trajectory, rng)
        wide = replace(judge, tolerance=sm.Tolerance(1.0, 1.0))
        shares = wide.judge(motion).shares
        share = rng.uniform(0.9, 1.15)
        # Tolerances beside what there is: the one decides or the other, or both.
        linear = max(shares["position"] * (share if rng.uniform() < 0.7 else 2.0), 1e-9)
        angular = max(shares["rotation"] * share, 1e-9)
        near = replace(judge, tolerance=sm.Tolerance(float(linear), float(angular)))
        found.append(Scene(near, motion))
    return found


def _thinned(motion: sm.Trajectory, rng: np.random.Generator) -> sm.Trajectory:
    """Return a motion of fewer samples."""
    keep = np.unique(np.append(np.arange(0, len(motion.t), rng.integers(2, 9)), len(motion.t) - 1))
    return sm.Trajectory(motion.t[keep], motion.q[keep], motion.qd[keep], motion.joint_names)


def _moved(motion: sm.Trajectory, rng: np.random.Generator) -> sm.Trajectory:
    """Return a motion a few samples of which are elsewhere."""
    q, qd = motion.q.copy(), motion.qd.copy()
    rows = rng.integers(0, len(q), 3)
    q[rows] += rng.normal(size=q[rows].shape) * 10.0 ** rng.uniform(-7, -4)
    qd[rows] += rng.normal(size=q[rows].shape) * 10.0 ** rng.uniform(-6, -2)
    return sm.Trajectory(motion.t, q, qd, motion.joint_names)
