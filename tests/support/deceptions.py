"""Motions made to deceive who reads the certificate's source, with what they truly take.

Each kind asks for one thing: a path, a turn, a band, a torque, a distance … The motion vanishes at
the points that the certificate looks at (nodes and places of an interval, at any depth of halving),
or has features far narrower than its intervals. What it takes of that thing is found by
kinematics and dynamics of the tests' own, densely; the limit is then put beside that, so that the
motion keeps it or does not. What is asked goes to the certificate in one of four ways, which all
have to know it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.problem.constraints import NO_OVERLAP, separate_clearances
from support.gantries import SLIDES, WIDE, gantry
from support.own_dynamics import Moving, MovingArm
from support.own_kinematics import along
from support.random_cells import LEFT, RIGHT, random_cell

# The truth is looked at so often between two samples, and more closely where it is largest.
DENSE, CLOSER, ROUNDS = 400, 201, 2
# A limit is beside the truth by one of these shares at least.
BESIDE = 0.01
# What is allowed of all that is not at stake.
ANYTHING = 100.0
NODES = (3, 4, 5, 9, 12)
_ROUNDING = 1e-12
_NO_INERTIA = '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'


@dataclass(frozen=True)
class Deception:
    """A motion, what is said of it, and what it truly takes of what is allowed.

    Attributes
    ----------
    certificate : Certificate
    share : float
        Above 1 it must not be verified; inf for what is claimed and was not asked or not limited.
    told : str
        Kind, and how it was asked.
    """

    certificate: sm.Certificate
    share: float
    told: str

    @property
    def is_false(self) -> bool:
        """Whether it is verified and not true."""
        return self.certificate.verified and self.share > 1.0

    @property
    def is_strict(self) -> bool:
        """Whether it is true and not verified."""
        return not self.certificate.verified and self.share < 1.0


Motion = tuple[Array, Array, Array]
# What of a motion (K, n) each at times (K,) is at stake, (K,): its largest value is the truth.
Measure = Callable[[Array, Motion], Array]


class Asked(NamedTuple):
    """What is asked of a cell, for a limit.

    Attributes
    ----------
    measure : callable
        ``measure(t, motion)`` → sizes (K,).
    constraints : callable, optional
        ``constraints(limit)``.
    tolerance : callable, optional
        ``tolerance(limit)``; by default all is allowed.
    problem : dict
        Whatever else the problem is given.
    most : float
        Limits are below this.
    """

    measure: Measure
    constraints: Callable[[float], Sequence[sm.constraints.Constraint]] = lambda limit: ()
    tolerance: Callable[[float], sm.Tolerance] = lambda limit: sm.Tolerance(ANYTHING, ANYTHING)
    problem: Mapping[str, Any] = MappingProxyType({})
    most: float = np.inf


@dataclass(frozen=True, eq=False)
class Cell:
    """An arm and a second one, and how they are seen."""

    robot: sm.RobotModel
    arm: MovingArm
    motion: sm.Trajectory
    moved: int
    rng: np.random.Generator

    def tip(self, motion: Motion, tool: str, reference: str | None) -> Moving:
        """Return how a tip moves in its reference."""
        seen = self.arm.moving(tool, motion)
        return seen if reference is None else seen.seen_from(self.arm.moving(reference, motion))

    @property
    def start(self) -> Motion:
        """The first sample, at rest."""
        return self.motion.q[:1], 0.0 * self.motion.q[:1], 0.0 * self.motion.q[:1]

    @property
    def links(self) -> tuple[str, ...]:
        """The links that move."""
        return tuple(name for name in self.robot.urdf.links if name != "world")


def _looked_at(rng: np.random.Generator) -> Array:
    """Return five places in (0, 1), or some twice, where the certificate looks."""
    halvings = 2 ** int(rng.integers(0, 9))
    count = int(rng.choice(NODES))
    places = [
        0.5 + 0.5 * np.polynomial.chebyshev.chebpts1(count),
        np.linspace(0.0, 1.0, 33),
        np.arange(5) / 5.0,
        np.linspace(0.0, 1.0, 17),
        rng.uniform(size=5),
    ][rng.integers(5)]
    chosen = rng.choice(places, 5, replace=len(places) < 5)
    return np.asarray((rng.integers(halvings) + chosen) / halvings)


def _vanishing(rng: np.random.Generator, q: Array, moved: Array) -> tuple[Array, ...]:
    """Return samples of a motion that is q at places that are looked at."""
    h = 10.0 ** rng.uniform(-3.0, 1.5)
    count = int(rng.integers(1, 4))
    rows = [np.tile(q, (2 * count, 1)), *np.zeros((2, 2 * count, len(q)))]
    for k in range(count):
        for joint in moved:
            wave = np.poly(_looked_at(rng))
            size = (
                10.0 ** rng.uniform(-6.0, 0.0)
                / np.abs(np.polyval(wave, np.linspace(0, 1, 99))).max()
            )
            for order in range(3):
                by = np.polyder(size * wave, order)
                for end in (0, 1):
                    rows[order][2 * k + end, joint] += np.polyval(by, end) / h**order
    t = np.arange(2 * count) * h
    return t, rows[0], rows[1], rows[2]


def _spiked(rng: np.random.Generator, q: Array, moved: Array) -> tuple[Array, ...]:
    """Return samples of a smooth motion with a spike that is far narrower than its intervals."""
    count, lasts = int(rng.integers(2, 9)), 10.0 ** rng.uniform(-1.0, 2.0)
    smooth = 10.0 ** rng.uniform(-6.0, -1.0)
    t = np.linspace(0.0, lasts, count)
    rows = [q + smooth * rng.normal(size=(count, len(q))) * np.isin(np.arange(len(q)), moved)]
    rows += [smooth * rng.normal(size=(count, len(q))) / lasts for _ in range(2)]
    width = lasts * 10.0 ** rng.uniform(-11.0, -1.5)
    at = rng.uniform(0.05, 0.9) * lasts
    base = sm.Trajectory(t, *rows[:2], tuple(f"{k}" for k in range(len(q))), rows[2])
    spike = at + width * np.arange(3)
    spike = spike[np.abs(t[:, None] - spike).min(axis=0) > 0.5 * width]
    own = [base(spike, order) for order in range(3)]
    size = 10.0 ** rng.uniform(-5.0, 0.0)
    own[int(rng.integers(2))][len(spike) // 2, moved[0]] += size
    if rng.random() < 0.5:
        own[1][len(spike) // 2, moved[0]] += size / width
    order = np.argsort(np.concatenate([t, spike]))
    found = [np.concatenate([a, b])[order] for a, b in zip(rows, own, strict=True)]
    return np.concatenate([t, spike])[order], *found


def cell(
    rng: np.random.Generator, folder: Path, reference: str | None, bodies: float = 0.0
) -> Cell:
    """Return a random cell and a motion that is made to deceive; with spheres of a size."""
    file = random_cell(rng, folder)
    file.write_text(file.read_text().replace('velocity="3"', 'velocity="1e15"'))
    if bodies:
        text, end = file.read_text(), "</inertial>"
        for tip in (LEFT, RIGHT):
            # Mass of 0 at the tip, for a body there: across one joint from the link before.
            own = f'<link name="{tip}"><inertial><mass value="0"/>{_NO_INERTIA}</inertial></link>'
            text = text.replace(f'<link name="{tip}"/>', own)
        parts = text.split(end)
        for k in range(1, len(parts)):
            place = " ".join(f"{x:.6f}" for x in rng.normal(scale=0.1, size=3))
            ball = f'<sphere radius="{bodies * rng.uniform(0.3, 1.0):.6f}"/>'
            parts[k] = (
                f'<collision><origin xyz="{place}"/><geometry>{ball}</geometry></collision>'
                + parts[k]
            )
        file.write_text(end.join(parts))
    robot = sm.load_robot(file, tool=(LEFT, RIGHT), reference=reference)
    q = rng.uniform(0.5 * robot.lower, 0.5 * robot.upper)
    moved = rng.permutation(robot.dof)[: int(rng.integers(1, 4))]
    samples = (_vanishing, _spiked)[int(rng.integers(2))](rng, q, moved)
    motion = sm.Trajectory(*samples[:3], robot.joint_names, samples[3])
    return Cell(robot, MovingArm(robot), motion, int(moved[0]), rng)


def truth(motion: sm.Trajectory, measure: Measure) -> float:
    """Return the largest size over all times, looked at closely where it is largest."""
    intervals = np.stack([motion.t[:-1], motion.t[1:]], axis=1)
    shares, worst = np.linspace(0.0, 1.0, DENSE), 0.0
    for _ in range(1 + ROUNDS):
        t = (intervals[:, :1] + np.diff(intervals, axis=1) * shares).clip(max=intervals[:, 1:])
        # Times beside a sample belong to both polynomials; the later one is as good.
        sizes = measure(t.ravel(), _at(motion, t.ravel())).reshape(t.shape)
        worst = max(worst, float(sizes.max()))
        row = int(np.argmax(sizes.max(axis=1)))
        place = int(np.argmax(sizes[row]))
        intervals = t[row, [max(place - 1, 0), min(place + 1, len(shares) - 1)]][None]
        shares = np.linspace(0.0, 1.0, CLOSER)
    return worst


def _at(motion: sm.Trajectory, t: Array) -> Motion:
    return along(motion, t, 0), along(motion, t, 1), along(motion, t, 2)


def _path(cell: Cell) -> Asked:
    """The tool, and perhaps a second tip, stay where they are within a tolerance."""
    rng, both = cell.rng, cell.rng.random() < 0.5
    task = str(rng.choice(["position", "pointing", "pose"]))
    tips = [(cell.robot.tool, cell.robot.reference)]
    if both:
        tips.append((RIGHT, LEFT if rng.random() < 0.5 else None))
    held = [cell.tip(cell.start, *tip) for tip in tips]
    turns = task != "position" and rng.random() < 0.5

    def measure(t: Array, motion: Motion) -> Array:
        sizes = []
        for tip, at in zip(tips, held, strict=True):
            seen = cell.tip(motion, *tip)
            if not turns:
                sizes.append(np.linalg.norm(seen.at - at.at, axis=1))
            elif task == "pointing":
                chord = np.linalg.norm(seen.turn[:, :, 2] - at.turn[:, :, 2], axis=1)
                sizes.append(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
            else:
                chord = np.linalg.norm(seen.turn - at.turn, axis=(1, 2)) / np.sqrt(8.0)
                sizes.append(2.0 * np.arcsin(np.minimum(chord, 1.0)))
        return np.max(sizes, axis=0)

    also = [
        sm.Follow(pin.SE3(at.turn[0], at.at[0]), task, tool=tool, reference=reference)
        for (tool, reference), at in zip(tips[1:], held[1:], strict=True)
    ]
    return Asked(
        measure,
        tolerance=lambda limit: sm.Tolerance(*((ANYTHING, limit) if turns else (limit, ANYTHING))),
        problem={"task": task, "also": also},
    )


def _window(cell: Cell) -> Asked:
    """A row of the position may leave the path by a band, in a window."""
    rng, last = cell.rng, float(cell.motion.t[-1])
    held = cell.tip(cell.start, cell.robot.tool, cell.robot.reference)
    row, (first, end) = int(rng.integers(3)), np.sort(rng.uniform(0.0, last, 2))
    in_tool = bool(rng.random() < 0.5)
    typical = truth(cell.motion, lambda t, x: _away(cell, held, x, in_tool)[:, row])
    band = max(float(typical * rng.uniform(0.2, 2.0)), 1e-12)

    def measure(t: Array, motion: Motion) -> Array:
        away = _away(cell, held, motion, in_tool)
        inside = (t >= first) & (t <= end)
        away[:, row] = np.where(inside, np.maximum(np.abs(away[:, row]) - band, 0.0), away[:, row])
        return np.linalg.norm(away, axis=1)

    item = sm.Relaxation("xyz"[row], band, (float(first), float(end)), ("world", "tool")[in_tool])
    return Asked(
        measure,
        tolerance=lambda limit: sm.Tolerance(limit, ANYTHING),
        problem={"task": "pose", "relaxations": [item]},
    )


def _away(cell: Cell, held: Moving, motion: Motion, in_tool: bool) -> Array:
    away = cell.tip(motion, cell.robot.tool, cell.robot.reference).at - held.at
    return np.asarray(away @ held.turn[0] if in_tool else away)


def _joint(cell: Cell) -> Asked:
    """A joint stays within a band."""
    k = int(cell.rng.integers(cell.robot.dof))
    center = float(cell.start[0][0, k])
    which = sm.robot.JointCoordinate(cell.robot.joint_names[k])
    return Asked(
        lambda t, motion: np.abs(motion[0][:, k] - center),
        lambda limit: [sm.constraints.Band(which, center, limit)],
    )


def _place(cell: Cell) -> Asked:
    """A link stays within a band along a direction."""
    link, toward = str(cell.rng.choice(cell.links)), cell.rng.normal(size=3)
    along_ = toward / np.linalg.norm(toward)

    def height(motion: Motion) -> Array:
        return np.asarray(cell.arm.moving(link, motion).at @ along_)

    center = float(height(cell.start)[0])
    return Asked(
        lambda t, motion: np.abs(height(motion) - center),
        lambda limit: [sm.constraints.Band(sm.robot.FrameCoordinate(link, toward), center, limit)],
    )


def _swivel(cell: Cell) -> Asked:
    """The angle of a link about the line between two others stays within a band."""
    names = cell.rng.choice(cell.links, 3, replace=False).tolist()
    up = cell.rng.normal(size=3)

    def angle(motion: Motion) -> Array:
        s, e, w = (cell.arm.moving(name, motion).at for name in names)
        line = (w - s) / np.linalg.norm(w - s, axis=1, keepdims=True)
        flat = [x - line * np.sum(x * line, axis=1, keepdims=True) for x in (e - s, 0.0 * s + up)]
        sine = np.sum(line * np.cross(flat[1], flat[0]), axis=1)
        return np.asarray(np.arctan2(sine, np.sum(flat[0] * flat[1], axis=1)))

    center = float(angle(cell.start)[0])
    which = sm.robot.SwivelAngle(up, *names)
    return Asked(
        lambda t, motion: np.abs((angle(motion) - center + np.pi) % (2.0 * np.pi) - np.pi),
        lambda limit: [sm.constraints.Band(which, center, limit)],
        most=3.14,
    )


def _tilt(cell: Cell) -> Asked:
    """An axis of a link stays within an angle of a direction."""
    link, axis = str(cell.rng.choice(cell.links)), cell.rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    toward = cell.arm.moving(link, cell.start).turn[0] @ axis

    def measure(t: Array, motion: Motion) -> Array:
        chord = np.linalg.norm(cell.arm.moving(link, motion).turn @ axis - toward, axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))

    return Asked(measure, lambda limit: [sm.constraints.Tilt(link, axis, limit, toward)], most=3.14)


def _torque(cell: Cell) -> Asked:
    """A joint's torque stays below a limit, with a load."""
    payload, center = float(cell.rng.choice([0.0, 3.0])), 0.1 * cell.rng.normal(size=3)
    needed = np.abs(cell.arm.torques(_at(cell.motion, cell.motion.t), payload, center)).max(axis=0)
    joint = int(cell.rng.integers(cell.robot.dof))
    scale = np.full(cell.robot.dof, 1e6) if cell.rng.random() < 0.5 else needed + 1e-3
    scale[joint] = 1.0
    return Asked(
        lambda t, motion: np.abs(cell.arm.torques(motion, payload, center) / scale).max(axis=1),
        lambda limit: [sm.constraints.JointTorqueLimits(limit * scale, payload, center)],
    )


def _tool(cell: Cell) -> Asked:
    """The tool's speed, turn rate or acceleration, as its reference sees it."""
    which = ("speed", "turn_rate", "acceleration", "turn_acceleration")[cell.rng.integers(4)]

    def measure(t: Array, motion: Motion) -> Array:
        tip = cell.tip(motion, cell.robot.tool, cell.robot.reference)
        rows = {"speed": tip.speed, "turn_rate": tip.spin, "acceleration": tip.speeding}
        return np.linalg.norm(rows.get(which, tip.spinning), axis=1)

    return Asked(measure, lambda limit: [sm.constraints.ToolLimits(**{which: limit})])


def _limits(cell: Cell) -> Asked:
    """A joint's position, speed, acceleration or jerk."""
    # Of joints that stand still, accelerations in a spike are rounding.
    k, order = cell.moved, int(cell.rng.integers(4))
    if order == 3:
        return Asked(lambda t, motion: np.abs(_jerk(cell.motion, t))[:, k], _only(cell, k, order))
    center = cell.start[0][0, k] if order == 0 else 0.0
    return Asked(lambda t, motion: np.abs(motion[order][:, k] - center), _only(cell, k, order))


def _jerk(motion: sm.Trajectory, t: Array) -> Array:
    return along(motion, t, 3)


def _only(cell: Cell, k: int, order: int) -> Callable[[float], list[sm.constraints.Constraint]]:
    """Return the limits of one joint, all others being free."""
    free, q = np.full(cell.robot.dof, np.inf), cell.start[0][0]

    def made(limit: float) -> list[sm.constraints.Constraint]:
        one = free.copy()
        one[k] = limit
        if order == 0:
            return [sm.constraints.JointPositionLimits(q - one, q + one, replace=True)]
        kinds = (
            sm.constraints.JointVelocityLimits,
            sm.constraints.JointAccelerationLimits,
            sm.constraints.JointJerkLimits,
        )
        return [kinds[order - 1](one, replace=True)]

    return made


def _apart(cell: Cell) -> Asked:
    """Bodies keep a distance: of the arm from itself, from the world, from what a link carries."""
    rng, dense = cell.rng, np.linspace(*cell.motion.t[[0, -1]], 50)
    balls = {name: solid for name, solid in cell.arm.solids}
    obstacles = []
    for k in range(int(rng.integers(0, 3))):
        link = str(rng.choice(list(balls)))
        motion = _at(cell.motion, dense[rng.integers(50)][None])
        at = cell.arm.moving(link, motion).carried(
            np.einsum("kij,j->ki", cell.arm.moving(link, motion).turn, balls[link].at)
        )
        away = rng.normal(size=3)
        away *= (balls[link].radius + 0.02 + rng.uniform(0.0, 0.1)) / np.linalg.norm(away)
        obstacles.append(sm.obstacles.Sphere(f"ball{k}", at.at[0] + away, 0.02))
    model = sm.constraints.Clearance(obstacles).model(cell.robot)
    # Only what the verdict's remarks leave out, as made, is left out.
    said = {frozenset((x.first, x.second)) for x in model.overlapping if not x.is_checked}

    def places(motion: Motion) -> dict[str, tuple[Array, float]]:
        found = {}
        for name, solid in balls.items():
            frame = cell.arm.moving(name, motion)
            found[name] = frame.at + frame.turn @ solid.at, solid.radius
        for item in obstacles:
            found[item.name] = np.tile(item.pose.translation, (len(motion[0]), 1)), item.radius
        return found

    anywhere = rng.uniform(0.9 * cell.robot.lower, 0.9 * cell.robot.upper, (20, cell.robot.dof))
    still = places((anywhere, 0.0 * anywhere, 0.0 * anywhere))
    names, pairs = list(still), []
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            apart = np.linalg.norm(still[first][0] - still[second][0], axis=1)
            joined = frozenset((first, second)) in said or _is_joint(cell, first, second)
            if np.ptp(apart) > 1e-9 and not joined:
                pairs.append((first, second))
    if not pairs:
        return Asked(lambda t, motion: np.zeros(len(t)))

    def measure(t: Array, motion: Motion) -> Array:
        at = places(motion)
        found = [
            np.linalg.norm(at[a][0] - at[b][0], axis=1) - at[a][1] - at[b][1] for a, b in pairs
        ]
        # Shares of limits grow as bodies come near.
        return np.asarray(1.0 / np.maximum(np.min(found, axis=0), 1e-9))

    return Asked(measure, lambda limit: [sm.constraints.Clearance(obstacles, 1.0 / limit)])


def _is_joint(cell: Cell, first: str, second: str) -> bool:
    """Whether one movable joint joins two links: those are not checked, the README says."""
    return any(
        {joint.parent, joint.child} == {first, second} for joint in cell.robot.urdf.joints.values()
    )


KINDS: dict[str, Callable[[Cell], Asked]] = {
    "path": _path,
    "window": _window,
    "joint": _joint,
    "place": _place,
    "swivel": _swivel,
    "tilt": _tilt,
    "torque": _torque,
    "tool": _tool,
    "limits": _limits,
    "apart": _apart,
}


def deceive(kind: str, number: int, folder: Path) -> Deception:
    """Return a deception of a kind, by its number."""
    if kind == "feed":
        return _feed(number, folder)
    if kind == "absent":
        return _absent(number, folder)
    rng = np.random.default_rng([number, list(KINDS).index(kind)])
    reference = RIGHT if rng.random() < 0.4 else None
    made = cell(rng, folder, reference, bodies=0.08 if kind == "apart" else 0.0)
    asked = KINDS[kind](made)
    found = truth(made.motion, asked.measure)
    beside = BESIDE + 10.0 ** rng.uniform(-2.0, 0.5)
    limit, share = found / (1.0 + beside), 1.0 + beside
    if rng.random() < 0.4:
        limit, share = found * (1.0 + beside), 1.0 / (1.0 + beside)
    # Accelerations of what hardly moves are rounding, in a spike.
    noise = _ROUNDING / np.diff(made.motion.t).min() ** 2 if kind in ("tool", "torque") else 1e-9
    if not (noise < found < 1e8 and limit < asked.most):
        # Nothing is at stake, or bodies overlap: another one.
        return deceive(kind, number + 10**6, folder)
    certificate, way = _judged(made, asked, limit, folder)
    return Deception(certificate, share, f"{kind} {number}: {way}")


def _judged(made: Cell, asked: Asked, limit: float, folder: Path) -> tuple[sm.Certificate, str]:
    """Return what the certificate says, asked in one of four ways."""
    rng, robot = made.rng, made.robot
    held = made.tip(made.start, robot.tool, robot.reference)
    dwell = sm.paths.Dwell(pin.SE3(held.turn[0], held.at[0]), float(made.motion.t[-1]))
    free = np.full(robot.dof, np.inf)
    constraints = list(asked.constraints(limit))
    if not any(isinstance(item, sm.constraints.JointPositionLimits) for item in constraints):
        constraints.append(sm.constraints.JointPositionLimits(-free, free, replace=True))
    given = {"task": "position", "also": (), "relaxations": ()} | asked.problem
    tolerance = asked.tolerance(limit)
    try:
        others, apart = separate_clearances(constraints, NO_OVERLAP)
        problem = sm.Problem(robot, dwell, constraints=others, clearance=apart, rest=False, **given)
    except (sm.errors.RedundancyError, sm.errors.ProblemError) as error:
        # A cell that cannot move in all the rows is judged, but not planned.
        if not isinstance(error, sm.errors.RedundancyError) and "freely" not in str(error):
            raise
        problem = None
    way = 0 if problem is None else int(rng.integers(4))
    if problem is None or way == 0:
        wanted = [item.requirement(robot) for item in constraints]
        task, motion = given.pop("task"), made.motion
        return sm.certify(robot, dwell, task, motion, tolerance, wanted, **given), "certify"
    if way == 1:
        return problem.certify(made.motion, tolerance), "problem"
    if way == 2:
        sm.files.write_problem(problem, folder / "problem.toml")
        return sm.read_problem(folder / "problem.toml").certify(made.motion, tolerance), "file"
    plan = replace(
        _any_plan(),
        problem=problem,
        trajectory=made.motion,
        initial_trajectory=made.motion,
        certificate=problem.certify(made.motion, tolerance),
    )
    plan.save(folder / "plan.npz")
    return sm.load_plan(folder / "plan.npz").certificate, "plan"


@cache
def _any_plan() -> sm.Plan:
    """Return a plan that lends others its report."""
    return sm.plan(sm.sample_problem(), max_evaluations=1)


def _feed(number: int, folder: Path) -> Deception:
    """A line at a feed; the tool stays near it, but hurries and lags."""
    rng = np.random.default_rng([number, 77])
    robot = gantry(folder)
    asked, within = float(10.0 ** rng.uniform(-2.0, -0.5)), float(rng.choice([0.02, 0.1]))
    length, toward = float(rng.uniform(0.3, 1.0)), rng.normal(size=3)
    toward /= np.linalg.norm(toward)
    line = sm.paths.Line(np.eye(4), pin.SE3(np.eye(3), length * toward), 1.0)
    path = sm.paths.Feed(line, asked, within=within, acceleration=5.0)
    t = np.union1d(path.marks, np.linspace(0.0, path.duration, int(rng.integers(50, 400))))
    t = t[np.append(True, np.diff(t) > 1e-6 * path.duration)]
    t[-1] = path.duration
    samples = path.samples(t)
    zero = np.zeros((len(t), 1))
    q, qd = np.hstack([samples.translation, zero]), np.hstack([samples.twist[:, :3], zero])
    turned = rng.random() < 0.5
    aside = np.cross(toward, rng.normal(size=3))
    way = toward if turned else aside / np.linalg.norm(aside)
    # From one sample to the next the tool's speed is another one.
    share = float(10.0 ** rng.uniform(-3.0, 0.5))
    wave = share * asked * (-1.0) ** np.arange(len(t))
    middle = (t > 0.3 * path.duration) & (t < 0.7 * path.duration)
    qd[:, :3] += np.outer(np.where(middle, wave, 0.0), way)
    motion = sm.Trajectory(t, q, qd, robot.joint_names)
    dense = np.linspace(0.3 * path.duration, 0.7 * path.duration, 20_001)
    speeds = np.linalg.norm(along(motion, dense, 1)[:, :3], axis=1)
    lag = (1.0 - float(speeds.min()) / asked) / within
    certificate = sm.certify(robot, path, "position", motion, sm.Tolerance(ANYTHING, ANYTHING))
    # What is faster and slower by less than a tenth of what is allowed is within it.
    share = lag if lag > 1.0 + BESIDE else (0.5 if share < 0.1 * within else 1.0)
    return Deception(certificate, share, f"feed {number}")


def _absent(number: int, folder: Path) -> Deception:
    """What has no limit is claimed as kept by nobody."""
    rng = np.random.default_rng([number, 78])
    ways = [
        WIDE,
        'lower="-9" upper="9" velocity="0" effort="999"',
        'lower="-9" upper="9" velocity="99" effort="0"',
        'lower="-9" upper="9" velocity="99"',
        'lower="-9" upper="9" effort="99"',
    ]
    kinds = [*SLIDES[:3], str(rng.choice(["revolute", "continuous"]))]
    own = [str(rng.choice(ways)) for _ in kinds]
    robot = gantry(folder, own, kinds)
    t, q = np.array([0.0, 1.0]), np.zeros((2, 4))
    motion = sm.Trajectory(t, q, q, robot.joint_names, q)
    kinds_asked = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
        sm.constraints.JointTorqueLimits(),
    ]
    picked = [item for item in kinds_asked if rng.random() < 0.7]
    if robot.urdf.lacking_efforts:
        # Torques of joints whose file does not say an effort are refused.
        picked = [x for x in picked if not isinstance(x, sm.constraints.JointTorqueLimits)]
    dwell = sm.paths.Dwell(robot.pose(q[0]), 1.0)
    if rng.random() < 0.5:
        found = [item.requirement(robot) for item in picked if item.applies(robot)]
        certificate = sm.certify(robot, dwell, "position", motion, None, found)
    else:
        certificate = sm.Problem(robot, dwell, "position", constraints=picked).certify(motion)
    speeds = all('velocity="99"' in x for x in own)
    torques = all('effort="9' in x for x in own)
    asks_torque = any(isinstance(x, sm.constraints.JointTorqueLimits) for x in picked)
    allowed = {
        "speeds": speeds,
        "torques": torques and asks_torque,
        "accelerations": False,
        "jerks": False,
        "self-collision": False,
        "obstacles": False,
        "feed": False,
    }
    false = [name for name, known in allowed.items() if name in certificate.covers and not known]
    return Deception(certificate, np.inf if false else 0.5, f"absent {number}: {false} {own}")


ALL_KINDS = (*KINDS, "feed", "absent")
