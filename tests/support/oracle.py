"""An independent judge of motions, in NumPy alone: kinematics, cubics, path errors and distances.

It shares with the package what defines a motion and nothing that judges it: the URDF's text, read
by yourdfpy; the samples t, q, q̇; `Path.samples`; and which pairs of bodies are to keep apart. It
looks at 1,000 times in each interval between samples and waypoints, so that what it finds is there;
what lies between its times it does not see.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import Separation
from support.own_kinematics import Arm, along
from support.solids import solid_of_obstacle

# How many times per interval, and how many are worked on together.
PER_INTERVAL, TOGETHER = 1000, 40_000
# Of more intervals than this all are looked at less often first, and the worst of them closely.
CLOSE, GLANCE = 60, 40
# Bodies that are farther apart than wanted by this share are not looked at.
CLEAR = 0.05
# Products of a dozen rotations and lengths of a few metres differ by this in their order [m, rad];
# q̇ and q̈ by this share.
ROUNDING, SHARE = 1e-11, 1e-9
# Conditions on the end may be missed by this [rad or m, per s].
ARRIVED = 1e-6


@dataclass(frozen=True)
class Verdict:
    """What a motion takes of what it is allowed, 1 being all of it; see `Judge`.

    Attributes
    ----------
    shares : dict
        Name → share: errors relative to the tolerance, speeds and accelerations to their limits,
        1 + what joints are beyond their limits [rad or m], and for bodies 1 + (wanted - distance)
        relative to what is wanted, or in units of 1 mm where that is less.
    """

    shares: dict[str, float] = field(default_factory=dict)

    def __or__(self, other: "Verdict") -> "Verdict":
        # Of two, NaN is the larger.
        pairs = {
            key: (self.shares.get(key, 0.0), other.shares.get(key, 0.0))
            for key in self.shares | other.shares
        }
        return Verdict({key: float(np.maximum(*pair)) for key, pair in pairs.items()})

    @property
    def refutes(self) -> tuple[str, ...]:
        """What is certainly not kept."""
        return tuple(f"{k}: {v:.9g}" for k, v in self.shares.items() if not v <= 1.0 + _SLACK)

    def valid(self, spare: float = 0.01) -> bool:
        """Whether everything is kept with something to spare."""
        return all(value <= 1.0 - spare for value in self.shares.values())


_SLACK = 1e-8


def _parts(intervals: Array, count: int) -> Iterator[Array]:
    together = max(1, TOGETHER // count)
    for begin in range(0, len(intervals), together):
        yield intervals[begin : begin + together]


@dataclass(frozen=True)
class Judge:
    """What a motion has to keep.

    Attributes
    ----------
    robot, path, task, tolerance, relaxations
        As in `selfmotion.certify`.
    limits : dict
        Order of the derivative → (lower, upper); those of the URDF where there are none.
    bodies : sequence of (obstacles, pairs, distance)
        What keeps apart, by names, and how far [m].
    ends : sequence of (order, target)
        What q(T) or q̇(T) is; None for that of the start.
    per_interval : int
    """

    robot: sm.RobotModel
    path: sm.paths.Path
    task: str = "pose"
    tolerance: sm.Tolerance = field(default_factory=sm.Tolerance)
    relaxations: Sequence[sm.Relaxation] = ()
    limits: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    bodies: Sequence[tuple[Sequence[sm.obstacles.Obstacle], Sequence[tuple[str, str]], float]] = ()
    ends: Sequence[tuple[int, Array | None]] = ()
    per_interval: int = PER_INTERVAL

    @classmethod
    def of(cls, plan: sm.Plan, per_interval: int = PER_INTERVAL) -> "Judge":
        """Return the judge of a plan: everything that its problem asks for."""
        problem = plan.problem
        judge = cls(
            problem.robot,
            problem.path,
            problem.task.value,
            plan.tolerance,
            tuple(problem.relaxations),
            per_interval=per_interval,
        )
        limits: dict[int, tuple[Array, Array]] = {}
        bodies, ends = [], []

        def limit(order: int, lower: Array, upper: Array) -> None:
            known = limits.get(order, (-np.inf, np.inf))
            limits[order] = np.maximum(lower, known[0]), np.minimum(upper, known[1])

        for item in problem.constraints:
            match item:
                case sm.constraints.JointPositionLimits():
                    limit(0, *item.limits(problem.robot))
                case sm.constraints.JointVelocityLimits():
                    limit(1, -item.of(problem.robot), item.of(problem.robot))
                case sm.constraints.JointAccelerationLimits():
                    limit(2, -item.of(problem.robot), item.of(problem.robot))
                case sm.constraints.JointJerkLimits():
                    limit(3, -item.of(problem.robot), item.of(problem.robot))
                case sm.constraints.EndConfiguration():
                    ends.append((0, np.asarray(item.q)))
                case sm.constraints.EndVelocity():
                    ends.append((1, item.target(problem.robot)))
                case sm.constraints.ClosedPath():
                    ends += [(0, None), (1, None)][: 1 + item.velocity]
        for wanted in plan.requirements:
            if isinstance(wanted, Separation):
                bodies.append((wanted.obstacles, wanted.model.pairs, wanted.distance))
        return replace(judge, limits=limits, bodies=bodies, ends=ends)

    @cached_property
    def arm(self) -> Arm:
        """The arm's kinematics."""
        return Arm(self.robot)

    def judge(self, motion: sm.Trajectory) -> Verdict:
        """Return what a motion takes."""
        names = list(motion.joint_names)
        order = [names.index(name) for name in self.robot.joint_names]
        tables = [motion.q, motion.qd, motion.qdd]
        q, qd, qdd = (None if table is None else table[:, order] for table in tables)
        motion = sm.Trajectory(motion.t, q, qd, self.robot.joint_names, qdd)
        late = abs(motion.duration - self.path.duration) / self.path.duration
        verdict = Verdict({"duration": 0.0 if late <= SHARE else 1.0 + late}) | self._ends(motion)
        intervals = self._intervals(motion)
        if len(intervals) > CLOSE:
            worst = []
            for part in _parts(intervals, GLANCE):
                seen, errors = self._look(motion, part, GLANCE)
                verdict |= seen
                worst.append(errors)
            intervals = intervals[np.sort(np.argsort(np.concatenate(worst))[-CLOSE:])]
        for part in _parts(intervals, self.per_interval):
            verdict |= self._look(motion, part, self.per_interval)[0]
        return verdict

    def _look(self, motion: sm.Trajectory, intervals: Array, count: int) -> tuple[Verdict, Array]:
        """Return what intervals (I, 2) take, and the path's errors on each, (I,)."""
        shares = np.arange(count + 1) / count
        t = (intervals[:, :1] + np.diff(intervals, axis=1) * shares).clip(max=intervals[:, 1:])
        t = t.ravel()
        q = along(motion, t, 0)
        known: dict[str, Any] = {}
        errors = self._errors(t, q, known)
        largest = errors.max(axis=0)
        verdict = Verdict({"position": float(largest[0]), "rotation": float(largest[1])})
        verdict |= self._within(motion, t)
        for obstacles, pairs, distance in self.bodies:
            verdict |= self._apart(q, known, obstacles, pairs, distance)
        return verdict, errors.max(axis=1).reshape(len(intervals), -1).max(axis=1)

    def _intervals(self, motion: sm.Trajectory) -> Array:
        """Return the intervals between samples, marks and ends of windows, (I, 2)."""
        windows = [x for item in self.relaxations for x in item.window(self.path.duration)]
        marks = np.concatenate([motion.t, self.path.marks, windows])
        edges = np.unique(np.clip(marks, 0.0, min(motion.t[-1], self.path.duration)))
        return np.stack([edges[:-1], edges[1:]], axis=1)

    def _errors(self, t: Array, q: Array, known: dict[str, Any]) -> Array:
        """Return the path's errors in position and rotation, as shares, (K, 2)."""
        turn, at = self.arm.place(self.arm.tool, q, known)
        target = self.path.samples(t)
        miss = at - target.translation
        if any(item.axes == "tool" for item in self.relaxations):
            miss = np.einsum("kji,kj->ki", target.rotation, miss)
        prescribed = [0, 1] if "planar" in self.task else [0, 1, 2]
        miss[:, [k for k in range(3) if k not in prescribed]] = 0.0
        turned = self._turned(target.rotation, turn)
        angular = [item for item in self.relaxations if item.angular]
        linear = [item for item in self.relaxations if not item.angular]
        off = self._beyond(t, miss, linear)
        if angular:
            around = self._rotation_vector(target.rotation, turn)
            turned = self._beyond(t, around, angular)
        allowed = [self.tolerance.position, self.tolerance.rotation]
        return (np.stack([off, turned], axis=1) - ROUNDING) / allowed

    def _turned(self, target: Array, actual: Array) -> Array:
        """Return the angles between orientations, or between their z axes, (K,), by chords."""
        if self.task in ("position", "planar"):
            return np.zeros(len(target))
        if self.task == "pointing":
            chord = np.linalg.norm(actual[:, :, 2] - target[:, :, 2], axis=1) / 2.0
        else:
            chord = np.linalg.norm(actual - target, axis=(1, 2)) / np.sqrt(8.0)
        return np.asarray(2.0 * np.arcsin(np.minimum(chord, 1.0)))

    def _rotation_vector(self, target: Array, actual: Array) -> Array:
        """Return the turns from target to actual in the target's axes, (K, 3)."""
        relative = np.einsum("kji,kjl->kil", target, actual)
        if self.task in ("position", "planar"):
            return np.zeros((len(target), 3))
        if self.task != "pointing":
            return np.asarray(Rotation.from_matrix(relative).as_rotvec())
        axis = np.cross([0.0, 0.0, 1.0], relative[:, :, 2])
        length = np.linalg.norm(axis, axis=1, keepdims=True)
        angle = self._turned(target, actual)[:, None]
        return np.asarray(axis * angle / np.where(length > 0.0, length, 1.0))

    def _beyond(self, t: Array, miss: Array, items: Sequence[sm.Relaxation]) -> Array:
        """Return how large misses (K, 3) are beyond what is relaxed, (K,)."""
        rest = miss.copy()
        for item in items:
            first, last = item.window(self.path.duration)
            rows = [k % 3 for k in item.indices]
            size = np.linalg.norm(miss[:, rows], axis=1)
            over = np.maximum(size - item.band, 0.0) / np.where(size > 0.0, size, 1.0)
            rest[:, rows] *= np.where((t >= first) & (t <= last), over, 1.0)[:, None]
        return np.asarray(np.linalg.norm(rest, axis=1))

    def _within(self, motion: sm.Trajectory, t: Array) -> Verdict:
        robot, shares = self.robot, {}
        own = {0: (robot.lower, robot.upper), 1: (-robot.velocity_limit, robot.velocity_limit)}
        for order, (lower, upper) in (own | self.limits).items():
            x = along(motion, t, order)
            low, high = x.min(axis=0), x.max(axis=0)
            if order == 0:
                shares["limits"] = 1.0 + float(max((lower - low).max(), (high - upper).max()))
            else:
                shares[f"order {order}"] = float(max((low / lower).max(), (high / upper).max()))
        return Verdict({key: value - SHARE for key, value in shares.items()})

    def _ends(self, motion: sm.Trajectory) -> Verdict:
        worst = 0.0
        for order, target in self.ends:
            x = (motion.q, motion.qd)[order]
            worst = max(worst, float(np.abs(x[-1] - (x[0] if target is None else target)).max()))
        return Verdict({"end": worst / ARRIVED} if self.ends else {})

    def _apart(
        self,
        q: Array,
        known: dict[str, Any],
        obstacles: Sequence[sm.obstacles.Obstacle],
        pairs: Sequence[tuple[str, str]],
        distance: float,
    ) -> Verdict:
        """Return how near named bodies come, looking closely only where their middles are near."""
        bodies = self.arm.solids + [(item.name, solid_of_obstacle(item)) for item in obstacles]
        carrier = {item.name: item.frame for item in obstacles}
        wanted = {frozenset(pair) for pair in pairs}
        # Farther than this they are clear, however far that is.
        nearest = distance + CLEAR * max(distance, 1e-3)
        for i, (first, one) in enumerate(bodies):
            for second, other in bodies[i + 1 :]:
                if frozenset((first, second)) in wanted and first != second:
                    links = [carrier.get(name, name) for name in (first, second)]
                    places = [
                        (np.eye(3)[None], np.zeros((1, 3)))
                        if link is None
                        else self.arm.place(link, q, known)
                        for link in links
                    ]
                    nearest = min(nearest, one.distance(other, *places, nearest))
        return Verdict({"apart": 1.0 + float((distance - nearest) / max(distance, 1e-3))})
