"""Problems that have a known motion: is one found? `make bench NAME=known`.

A random smooth joint motion draws the tool's path, exactly: its pose and twist are those of
kinematics that share no code with the planner. Everything that is asked is set just beyond what
that motion uses, so that the problem has a solution. The start is free, but where ends are given.
Of each kind of constraint 30 problems are planned: of arms alone, on rails, with positioners that
tilt and turn (also once round), and of two arms. Every plan that is verified is judged again by the
kinematics, dynamics and distances of the tests.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.problem.constraints import NO_OVERLAP, separate_clearances
from support.oracle import Judge
from support.own_dynamics import Moving, MovingArm
from support.own_kinematics import along

# What is asked is so much more than the known motion uses, as a share of that, and in a joint's
# place, of an angle and of a length at least [rad, m].
SPARE, SPARE_PLACE = 0.03, 0.02
# The known motion takes this share of the limits of speed, and is so far from limits [rad or m],
# from itself [m], and from singular poses (smallest singular value of the rows).
PACE, EDGE, CLEAR, REGULAR = 0.5, 0.02, 4e-3, 0.03
# Boxes are at least and at most this far from it [m]; so many of them.
BESIDE, NEAR, BOXES = 6e-3, 0.06, 5
# Looks at the known motion; and of the judge, at each interval between nodes.
LOOKS, CLOSE_LOOKS = 400, 60
# What joints may be off limits by rounding, as a share.
ROUNDING = 1e-8
COLUMNS = ("kind", "number", "cell", "verified", "cost", "known", "seconds", "verdict")


@dataclass(frozen=True)
class Joints:
    """A smooth joint motion from rest to rest: sums of sines of a minimum-jerk share of time.

    Attributes
    ----------
    first : (n,)
        q(0).
    sizes : (K, n)
        Of each sine.
    duration : float
    is_closed : bool
        Whether it ends as it began.
    turned : (n,)
        How far each joint goes in all besides.
    """

    first: Array
    sizes: Array
    duration: float
    is_closed: bool
    turned: Array

    def __call__(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return q and its first three derivatives at times (S,), (S, n) each."""
        x = np.asarray(t)[:, None] / self.duration
        s = x**3 * (10.0 + x * (6.0 * x - 15.0))
        s1 = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        s2 = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        s3 = 60.0 * (1.0 - 6.0 * x + 6.0 * x**2) / self.duration**3
        f = [np.zeros((len(x), len(self.first))) for _ in range(4)]
        for k, size in enumerate(self.sizes, 1):
            w = (2.0 if self.is_closed else 1.0) * np.pi * k
            f[0] += size * np.sin(w * s)
            f[1] += size * w * np.cos(w * s)
            f[2] -= size * w**2 * np.sin(w * s)
            f[3] -= size * w**3 * np.cos(w * s)
        f[0] += self.turned * s
        f[1] += self.turned
        return (
            self.first + f[0],
            f[1] * s1,
            f[2] * s1**2 + f[1] * s2,
            f[3] * s1**3 + 3.0 * f[2] * s1 * s2 + f[1] * s3,
        )


class Drawn(sm.paths.Path, kind="drawn"):
    """The tool's motion that a joint motion draws, seen from a link or the world."""

    def __init__(self, arm: MovingArm, motion: Joints, tool: str, reference: str | None) -> None:
        self._arm, self._motion, self._links = arm, motion, (tool, reference)
        self.duration = motion.duration

    def _moving(self, t: Array) -> Moving:
        q, qd, qdd, _ = self._motion(t)
        tool, reference = self._links
        seen = self._arm.moving(tool, (q, qd, qdd))
        if reference is None:
            return seen
        return seen.seen_from(self._arm.moving(reference, (q, qd, qdd)))

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        """See `Path.evaluate`."""
        seen = self._moving(t)
        return sm.paths.PathSamples(t, seen.at, seen.turn, np.hstack([seen.speed, seen.spin]))


# Cells.

RAIL = """
<robot name="rail"><link name="rail"/><link name="carriage"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/>
    <axis xyz="0 1 0"/><limit lower="-0.8" upper="0.8" velocity="0.5" effort="2000"/></joint>
</robot>"""
HANDS = "left/panda_hand_tcp", "right/panda_hand_tcp"
TORCH = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))


def at(*place: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(place))


@cache
def cell(name: str) -> tuple[sm.RobotModel, str]:
    """Return a cell, and the task of its tool."""
    if name in ("panda", "xarm7"):
        return sm.load_robot(name), "pose"
    if name == "ur10":
        return sm.load_robot("ur10"), "pointing"
    if name == "rail":
        file = Path("out") / "rail.urdf"
        file.parent.mkdir(exist_ok=True)
        file.write_text(RAIL)
        parts = {"rail": file, "arm": "panda"}
        on = {"arm": "rail/carriage"}
        return sm.load_robot(parts, on=on, tool="arm/panda_hand_tcp"), "pose"
    if name == "two arms":
        base = {"left": at(0.0, 0.45, 0.0), "right": at(0.0, -0.45, 0.0)}
        return sm.load_robot({"left": "panda", "right": "panda"}, base=base, tool=HANDS), "pose"
    arm = name.split(" on ")[0]
    tool = "arm/panda_hand_tcp" if arm == "panda" else "arm/tool0"
    place = at(0.55, 0.0, 0.0) if arm == "panda" else at(0.9, 0.0, 0.1)
    held = {} if arm == "panda" else {"tool_offset": TORCH}
    parts = {"arm": arm, "table": "positioner"}
    options = {"base": {"table": place}, "tool": tool, "reference": "table/plate"}
    return sm.load_robot(parts, **options, **held), "pointing"


ALONE = ("panda", "xarm7", "ur10")
TABLES = ("ur10 on table", "panda on table")
SEVEN = ("panda", "xarm7")
ALL = (*ALONE, "rail", *TABLES, "two arms")


# Known motions, and what is asked of them.


@dataclass(frozen=True)
class Known:
    """A cell with a motion of it, and what that is like at many times.

    Attributes
    ----------
    name : str
        Of the cell.
    motion : Joints
    rng : Generator
    """

    name: str
    motion: Joints
    rng: np.random.Generator

    @property
    def robot(self) -> sm.RobotModel:
        """The cell's joints."""
        return cell(self.name)[0]

    @cached_property
    def arm(self) -> MovingArm:
        """Its kinematics, written out."""
        return MovingArm(self.robot)

    @cached_property
    def t(self) -> Array:
        """Times of looks, (S,) [s]."""
        return np.linspace(0.0, self.motion.duration, LOOKS)

    @cached_property
    def states(self) -> tuple[Array, Array, Array, Array]:
        """What q and its derivatives are, (S, n) each."""
        return self.motion(self.t)

    @property
    def cost(self) -> float:
        """What it costs where joint speeds do."""
        qd = self.states[1]
        weights = np.asarray(sm.costs.JointVelocity.usual(self.robot).weight)
        return float(np.trapezoid(0.5 * (qd**2 * weights).sum(axis=1), self.t))

    def most(self, order: int) -> Array:
        """Return the limits just beyond |q̇|, |q̈| or the jerk, (n,)."""
        size = np.abs(self.states[order]).max(axis=0)
        # A joint that hardly moves is not to be held.
        return np.maximum((1.0 + SPARE) * size, 0.1 * size.max())

    def range(self) -> tuple[Array, Array]:
        """Return position limits just beyond what it takes, within the arm's own, (n,) each."""
        q = self.states[0]
        spare = np.maximum(SPARE * np.ptp(q, axis=0), SPARE_PLACE)
        lower, upper = self.robot.lower, self.robot.upper
        return np.maximum(lower, q.min(axis=0) - spare), np.minimum(upper, q.max(axis=0) + spare)

    @property
    def paths(self) -> list[tuple[Drawn, str, str | None]]:
        """What each tool draws, with its link and reference."""
        robot = self.robot
        if self.name == "two arms":
            left, right = HANDS
            return [
                (Drawn(self.arm, self.motion, left, None), left, None),
                (Drawn(self.arm, self.motion, right, left), right, left),
            ]
        tool, reference = robot.tool, robot.reference
        return [(Drawn(self.arm, self.motion, tool, reference), tool, reference)]


def known(name: str, rng: np.random.Generator, closed: bool, turns: bool) -> Known:
    """Return a cell with a random motion that keeps clear of limits, itself and singular poses."""
    robot, task = cell(name)
    lower, upper = robot.finite_limits()
    slides = ~robot.is_revolute
    model = sm.obstacles.CollisionModel(robot)
    turn = np.array([joint == "table/turn" for joint in robot.joint_names])
    while True:
        first = lower + (upper - lower) * rng.uniform(0.2, 0.8, robot.dof)
        if rng.uniform() < 0.7:
            # As a rule somewhere near to where people have it.
            first = np.asarray(robot.home) + rng.normal(0.0, 0.4, robot.dof)
        size = rng.uniform(0.1, 0.5) * np.where(slides, 0.5, 1.0)
        if turns:
            # The table does it, and the arm keeps what the tool is for.
            size = size * np.where(turn, 0.5, 0.25)
        sizes = rng.normal(size=(3, robot.dof)) * size / np.arange(1.0, 4.0)[:, None]
        turned = np.where(turn & turns, rng.choice([-1.0, 1.0]) * 2.0 * np.pi, 0.0)
        shape = Joints(first, sizes, 1.0, closed, turned)
        t = np.linspace(0.0, 1.0, LOOKS)
        q, qd, _, _ = shape(t)
        if (q < lower + EDGE).any() or (q[:, ~turn] > (upper - EDGE)[~turn]).any():
            if not np.isinf(robot.upper[turn]).all() or (q[:, ~turn] < (lower + EDGE)[~turn]).any():
                continue
            if (q[:, ~turn] > (upper - EDGE)[~turn]).any():
                continue
        seconds = float((np.abs(qd).max(axis=0) / robot.velocity_limit).max()) / PACE
        motion = Joints(first, sizes, max(seconds, 1.0), closed, turned)
        found = Known(name, motion, rng)
        if model.worst(q[::4]).value < CLEAR or not _regular(found, task):
            continue
        if model.worst(q).value >= CLEAR:
            return found


def _regular(found: Known, task: str) -> bool:
    """Whether the tools stay away from singular poses, and move."""
    q = found.states[0][::10]
    problem = sm.Problem(found.robot, **_followed(found, task), clearance=None, constraints=())
    rows = problem.follows.jacobians(q)
    least = np.linalg.svd(rows, compute_uv=False)[:, -1].min()
    travelled = np.linalg.norm(problem.follows.twists(found.t), axis=1).mean() * found.t[-1]
    return bool(least > REGULAR and travelled > 0.1)


def _followed(found: Known, task: str) -> dict[str, Any]:
    paths = found.paths
    if len(paths) == 1:
        return {"path": paths[0][0], "task": task}
    return {"path": [sm.Follow(path, tool=tool, reference=of) for path, tool, of in paths]}


@dataclass(frozen=True)
class Asked:
    """What is asked of a problem besides its path.

    Attributes
    ----------
    constraints : list of Constraint
    options : dict
        Of `Problem`: a start, a clearance, tolerances.
    judge : callable
        ``judge(arm, q, qd, qdd)`` → shares of what is allowed, by kinematics of the tests.
    """

    constraints: list[sm.constraints.Constraint] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    judge: Callable[[MovingArm, tuple[Array, Array, Array]], list[Array]] | None = None


def asks_limits(found: Known) -> Asked:
    lower, upper = found.range()
    return Asked([sm.constraints.JointPositionLimits(lower, upper)])


def asks_speeds(found: Known) -> Asked:
    return Asked([sm.constraints.JointVelocityLimits(found.most(1))])


def asks_accelerations(found: Known) -> Asked:
    limits = sm.constraints.JointAccelerationLimits(found.most(2), replace=True)
    return Asked([sm.constraints.JointVelocityLimits(), limits])


def asks_jerks(found: Known) -> Asked:
    limits = sm.constraints.JointJerkLimits(found.most(3), replace=True)
    return Asked([sm.constraints.JointVelocityLimits(), limits])


def asks_torques(found: Known) -> Asked:
    payload = float(found.rng.uniform(0.0, 2.0))
    none = np.zeros(3)

    def torques(arm: MovingArm, motion: tuple[Array, Array, Array]) -> Array:
        return np.asarray(arm.torques(motion, payload, none))

    size = np.abs(torques(found.arm, found.states[:3])).max(axis=0)
    limit = np.maximum((1.0 + SPARE) * size, 0.02 * size.max())
    return Asked(
        [sm.constraints.JointVelocityLimits(), sm.constraints.JointTorqueLimits(limit, payload)],
        judge=lambda arm, motion: [np.abs(torques(arm, motion)) / limit],
    )


def asks_tilt(found: Known) -> Asked:
    tool = found.paths[0][1]
    axes = found.arm.place(tool, found.states[0])[0][:, :, 2]
    mean = axes.mean(axis=0) / np.linalg.norm(axes.mean(axis=0))
    within = (1.0 + SPARE) * float(_angles(axes, mean).max()) + 0.01
    tilt = sm.constraints.Tilt(tool, "z", min(within, 3.1), tuple(mean))

    def judge(arm: MovingArm, motion: tuple[Array, Array, Array]) -> list[Array]:
        return [_angles(arm.place(tool, motion[0])[0][:, :, 2], mean) / min(within, 3.1)]

    return Asked([*_usual(), tilt], judge=judge)


def _angles(axes: Array, mean: Array) -> Array:
    return 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(axes - mean, axis=1), 1.0))


def _usual() -> list[sm.constraints.Constraint]:
    return [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]


def asks_elbow(found: Known) -> Asked:
    angle = sm.robot.SwivelAngle()
    values = np.unwrap(angle(found.robot, found.states[0])[0])
    center, half = 0.5 * (values.max() + values.min()), 0.5 * np.ptp(values)
    half = (1.0 + SPARE) * half + SPARE_PLACE
    if half >= np.pi:
        # A band is less than half a turn to each side; this motion uses more.
        return Asked(_usual())
    center = (center + np.pi) % (2.0 * np.pi) - np.pi
    return Asked([*_usual(), sm.constraints.Band(angle, float(center), float(half))])


def asks_band(found: Known) -> Asked:
    """A link in the middle of the arm stays as high as it is."""
    names = list(found.robot.joint_names)
    link = found.robot.urdf.joints[names[len(names) // 2]].child
    heights = found.arm.place(link, found.states[0])[1][:, 2]
    if np.ptp(heights) < 1e-6:
        joint = names[len(names) // 2]
        values = found.states[0][:, names.index(joint)]
        coordinate: Any = sm.robot.JointCoordinate(joint)
    else:
        values, coordinate = heights, sm.robot.FrameCoordinate(link)
    center = 0.5 * float(values.max() + values.min())
    half = (1.0 + SPARE) * 0.5 * float(np.ptp(values)) + 0.2 * SPARE_PLACE

    def judge(arm: MovingArm, motion: tuple[Array, Array, Array]) -> list[Array]:
        if isinstance(coordinate, sm.robot.JointCoordinate):
            own = motion[0][:, names.index(coordinate.joint)]
        else:
            own = np.broadcast_to(arm.place(link, motion[0])[1][:, 2], len(motion[0]))
        return [np.abs(own - center) / half]

    return Asked([*_usual(), sm.constraints.Band(coordinate, center, half)], judge=judge)


def asks_tool(found: Known) -> Asked:
    samples = found.paths[0][0].samples(found.t)
    speed, turning = (
        (1.0 + SPARE) * float(np.linalg.norm(part, axis=1).max()) + 1e-3
        for part in (samples.twist[:, :3], samples.twist[:, 3:])
    )
    limits = sm.constraints.ToolLimits(speed=speed, turn_rate=turning)
    return Asked([*_usual(), limits])


def asks_closed(found: Known) -> Asked:
    return Asked([*_usual(), sm.constraints.ClosedPath()])


def asks_ends(found: Known) -> Asked:
    q = found.states[0]
    return Asked([*_usual(), sm.constraints.EndConfiguration(q[-1])], {"start": q[0]})


def asks_clearance(found: Known) -> Asked:
    """Boxes stand beside the swept arm."""
    robot, q, boxes = found.robot, found.states[0], list[sm.obstacles.Box]()
    reach = robot.reach if np.isfinite(robot.reach) else 1.0
    for _ in range(400):
        if len(boxes) == BOXES:
            break
        place = np.append(found.rng.uniform(-reach, reach, 2), found.rng.uniform(0.0, reach))
        box = sm.obstacles.Box(f"box {len(boxes)}", place, found.rng.uniform(0.05, 0.25, 3))
        model = sm.obstacles.CollisionModel(robot, [box])
        if model.worst(q[::20]).value < NEAR and model.worst(q).value > BESIDE:
            boxes.append(box)
    clear = sm.constraints.Clearance(boxes, distance=0.5 * BESIDE)
    return Asked([*_usual(), clear])


def asks_itself(found: Known) -> Asked:
    """The arm keeps as far from itself as it does."""
    near = sm.obstacles.CollisionModel(found.robot).worst(found.states[0]).value
    distance = float(np.clip((1.0 - SPARE) * near, 0.0, 0.03))
    return Asked([*_usual(), sm.constraints.Clearance(distance=distance)])


def asks_tolerance(found: Known) -> Asked:
    lower, upper = found.range()
    row = str(found.rng.choice(["x", "y", "z", "rx"]))
    band = 2e-3 if row in "xyz" else 0.02
    limits = sm.constraints.JointPositionLimits(lower, upper)
    return Asked([limits], {"relaxations": [sm.Relaxation(row, band=band)]})


def asks_window(found: Known) -> Asked:
    lower, upper = found.range()
    duration = found.motion.duration
    during = (0.3 * duration, 0.7 * duration)
    relaxed = sm.Relaxation("z", band=5e-3, during=during)
    return Asked([sm.constraints.JointPositionLimits(lower, upper)], {"relaxations": [relaxed]})


def asks_most(found: Known) -> Asked:
    """Limits, speeds, accelerations and a tilt at once."""
    tilt = asks_tilt(found)
    several = (asks_limits, asks_speeds, asks_accelerations)
    listed = [asks(found).constraints[-1] for asks in several]
    return Asked([*listed, tilt.constraints[-1]], judge=tilt.judge)


# By name: what is asked, of which cells, whether the motion is closed, and whether a table turns
# once round.
KINDS: dict[str, tuple[Callable[[Known], Asked], Sequence[str], bool, bool]] = {
    "limits": (asks_limits, ALL, False, False),
    "speeds": (asks_speeds, ALL, False, False),
    "accelerations": (asks_accelerations, ALL, False, False),
    "jerks": (asks_jerks, ALL, False, False),
    "torques": (asks_torques, SEVEN, False, False),
    "tilt": (asks_tilt, ALL, False, False),
    "elbow": (asks_elbow, SEVEN, False, False),
    "band": (asks_band, ALL, False, False),
    "tool": (asks_tool, (*ALONE, "rail", *TABLES), False, False),
    "closed": (asks_closed, ALL, True, False),
    "ends": (asks_ends, ALL, False, False),
    "clearance": (asks_clearance, ALL, False, False),
    "itself": (asks_itself, ALL, False, False),
    "tolerance": (asks_tolerance, (*ALONE, "rail", *TABLES), False, False),
    "window": (asks_window, ("panda", "xarm7", "rail"), False, False),
    "whole turn": (asks_limits, TABLES, False, True),
    "turn upright": (asks_tilt, TABLES, False, True),
    "all": (asks_most, ALL, False, False),
}


def problem_of(kind: str, number: int) -> tuple[sm.Problem, Known, Asked]:
    """Return a problem of a kind, what is known of it, and what is asked."""
    asks, cells, closed, turns = KINDS[kind]
    rng = np.random.default_rng([list(KINDS).index(kind), number])
    found = known(cells[number % len(cells)], rng, closed, turns)
    asked, task = asks(found), cell(found.name)[1]
    followed = _followed(found, task)
    others, apart = separate_clearances(asked.constraints, NO_OVERLAP)
    given = {"constraints": others, "clearance": apart, **asked.options}
    problem = sm.Problem(found.robot, **followed, **given)
    return problem, found, asked


def refuted(plan: sm.Plan, found: Known, asked: Asked) -> list[str]:
    """Return what kinematics, dynamics and distances of the tests say against a plan."""
    motion, said = plan.trajectory, list[str]()
    shares = np.arange(CLOSE_LOOKS + 1) / CLOSE_LOOKS
    t = np.unique((motion.t[:-1, None] + np.diff(motion.t)[:, None] * shares).ravel())
    q, qd, qdd = (along(motion, t, order) for order in range(3))
    arm = found.arm
    relaxed = bool(asked.options.get("relaxations"))
    for path, tool, reference in found.paths:
        seen = arm.moving(tool, (q, qd, qdd))
        if reference is not None:
            seen = seen.seen_from(arm.moving(reference, (q, qd, qdd)))
        target = path.samples(np.clip(t, 0.0, path.duration))
        if relaxed:
            continue
        miss = float(np.linalg.norm(seen.at - target.translation, axis=1).max())
        columns = slice(2, 3) if plan.problem.task.value == "pointing" else slice(0, 3)
        turned = float(np.abs(seen.turn[:, :, columns] - target.rotation[:, :, columns]).max())
        if not (miss <= plan.tolerance.position and turned <= plan.tolerance.rotation):
            said.append(f"{tool} is {miss:.3g} m, {turned:.3g} off")
    for item in asked.constraints:
        orders = {"JointPositionLimits": 0, "JointVelocityLimits": 1}
        orders |= {"JointAccelerationLimits": 2, "JointJerkLimits": 3}
        order = orders.get(type(item).__name__)
        if order == 0:
            lower, upper = item.limits(found.robot)  # type: ignore[attr-defined]
            if (q < lower - ROUNDING).any() or (q > upper + ROUNDING).any():
                said.append("a joint is beyond its limits")
        elif order is not None:
            rates = along(motion, t, order)
            share = np.abs(rates) / item.of(found.robot)  # type: ignore[attr-defined]
            if not share.max() <= 1.0 + ROUNDING:
                said.append(f"order {order}: {share.max():.6g} of the limit")
    if asked.judge is not None:
        most = max(float(part.max()) for part in asked.judge(arm, (q, qd, qdd)))
        if not most <= 1.0 + ROUNDING:
            said.append(f"what is asked: {most:.6g} of the limit")
    if len(found.paths) == 1 and found.robot.reference is None:
        judge = replace(Judge.of(plan, per_interval=50), bodies=())
        said += judge.judge(motion).refutes
    for item in asked.constraints:
        if isinstance(item, sm.constraints.Clearance):
            # Distances are the package's own: `make bench NAME=distances` judges these.
            model = sm.obstacles.CollisionModel(found.robot, item.obstacles)
            near = model.worst(q[::7]).value
            if not near >= item.distance - ROUNDING:
                said.append(f"bodies are {near:.6g} m apart")
    return said


def main(
    count: Annotated[int, typer.Option(help="How many of each kind.")] = 30,
    kinds: Annotated[list[str] | None, typer.Option("--kind", help="Only these.")] = None,
    first: Annotated[int, typer.Option(help="Number of the first of each.")] = 0,
    out: Annotated[Path | None, typer.Option(help="A table of all (.csv).")] = None,
) -> None:
    """Plan the problems of each kind, and judge the plans."""
    console, rows = Console(), list[list[Any]]()
    false = lost_kinds = 0
    for kind in kinds or KINDS:
        verified, seconds, ratios, lost = 0, list[float](), list[float](), list[str]()
        for number in range(first, first + count):
            problem, found, asked = problem_of(kind, number)
            verdict, cost, is_verified, wrong = "", np.inf, False, list[str]()
            began = time.process_time()
            try:
                plan = sm.plan(problem)
            except sm.SelfmotionError as error:
                verdict = str(error)
                seconds.append(time.process_time() - began)
            else:
                seconds.append(time.process_time() - began)
                cost, verdict = plan.report.cost, plan.certificate.summary
                is_verified = plan.certificate.verified
                wrong = refuted(plan, found, asked) if is_verified else []
            verified += is_verified
            if wrong:
                false += 1
                console.print(f"FALSE {kind} {number}: {wrong}", highlight=False, soft_wrap=True)
            if not is_verified:
                lost.append(f"  {kind} {number} ({found.name}): {verdict}")
            else:
                ratios.append(cost / found.cost)
            rows.append(
                [kind, number, found.name, int(is_verified), cost, found.cost, seconds[-1], verdict]
            )
        lost_kinds += verified < 0.99 * count
        console.print(
            f"{kind:14s} {verified:3d} of {count} verified, {np.median(seconds):5.2f} s in the "
            f"median, {max(seconds):6.2f} s at most; costs {np.median(ratios or [np.nan]):.3f} of "
            f"the known motion in the median, {max(ratios or [np.nan]):.3f} at most",
            highlight=False,
            soft_wrap=True,
        )
        for text in lost:
            console.print(text, highlight=False, markup=False, soft_wrap=True)
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        with out.open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *rows])
    console.print(f"{len(rows)} problems, {sum(row[3] for row in rows)} verified, {false} false")
    sys.exit(1 if false or lost_kinds else 0)


if __name__ == "__main__":
    typer.run(main)
