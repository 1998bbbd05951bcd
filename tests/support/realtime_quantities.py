"""Tool motions that ask too much: what segments keep of quantities to their rest, at 4 kHz.

Quantities are computed here by Pinocchio's own functions, or from the places of joints.
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.realtime import Replanner, Segment
from support.arms import PANDA_HOME, robot_named
from support.realtime_bodies import changed_rests, limits_exceeded, motion_between_cycles

# Rounding of shares of limits; and of commands that are computed twice [rad].
ROUNDED, SAME = 1e-9, 1e-12
# What is exceeded at first may grow by this share once, see `QUANTITY_BEYOND`.
GROWS = 1e-4

# Shares of a limit that a motion (K, n) uses: from q, q̇ and q̈ to (K,).
Shares = Callable[[Array, Array, Array], Array]
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_TOOL = "panda_hand_tcp"
_FORCES = np.array([40.0, 60.0, 30.0, 30.0, 5.0, 5.0, 5.0])
_SPEED, _ACCELERATION = 0.4, 3.0


def torque(model: pin.Model, data: pin.Data) -> Shares:
    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        torques = [pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)]
        return (np.abs(torques) / _FORCES).max(axis=1)

    return shares


def tilt(model: pin.Model, data: pin.Data) -> Shares:
    tool = model.getFrameId(_TOOL)

    def height_of_axis(q: Array) -> float:
        pin.framesForwardKinematics(model, data, q)
        return float(data.oMf[tool].rotation[2, 2])

    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        down = -np.array([height_of_axis(each) for each in q])
        return np.arccos(np.clip(down, -1.0, 1.0)) / 0.3

    return shares


def elbow(model: pin.Model, data: pin.Data) -> Shares:
    def places(q: Array) -> list[Array]:
        pin.forwardKinematics(model, data, q)
        return [data.oMi[k].translation.copy() for k in (2, 4, 6)]

    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        shoulder, middle, wrist = np.array([places(each) for each in q]).transpose(1, 0, 2)
        axis = wrist - shoulder
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        arm, up = middle - shoulder, np.array([[0.0, 0.0, 1.0]])
        arm, up = (x - axis * (axis * x).sum(axis=1)[:, None] for x in (arm, up))
        sine, cosine = (axis * np.cross(up, arm)).sum(axis=1), (up * arm).sum(axis=1)
        return np.abs(np.arctan2(sine, cosine)) / 0.4

    return shares


def tool(model: pin.Model, data: pin.Data) -> Shares:
    at = model.getFrameId(_TOOL)

    def rates(*state: Array) -> tuple[Array, Array]:
        pin.forwardKinematics(model, data, *state)
        pin.updateFramePlacement(model, data, at)
        speed = pin.getFrameVelocity(model, data, at, _AXES).linear
        return speed, pin.getFrameClassicalAcceleration(model, data, at, _AXES).linear

    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        both = np.array([rates(*state) for state in zip(q, qd, qdd, strict=True)])
        return (np.linalg.norm(both, axis=2) / [_SPEED, _ACCELERATION]).max(axis=1)

    return shares


KINDS: dict[str, tuple[Callable[[], sm.constraints.Constraint], Callable[..., Shares]]] = {
    "torque": (lambda: sm.constraints.JointTorqueLimits(_FORCES), torque),
    "tilt": (lambda: sm.constraints.Tilt(_TOOL, within=0.3), tilt),
    "elbow": (lambda: sm.constraints.Band.of_elbow("up", 0.4), elbow),
    "tool": (lambda: sm.constraints.ToolLimits(_SPEED, acceleration=_ACCELERATION), tool),
}


def looped(*kinds: str) -> Replanner:
    asked = [KINDS[kind][0]() for kind in kinds]
    return Replanner(robot_named("panda"), "position", constraints=asked)


def run(replanner: Replanner, seed: int, steps: int = 150) -> list[Segment]:
    """Return segments along fast lines, one after the other, each from where the last one was."""
    robot, rng = replanner.robot, np.random.default_rng(seed)
    home = robot.pose(PANDA_HOME)
    replanner.reset()
    t, q, qd, found = 0.0, PANDA_HOME, np.zeros(7), []
    for k in range(steps):
        if k % 50 == 0:
            # Every other one is elsewhere than the tool.
            start = robot.pose(q if k % 100 == 0 else PANDA_HOME)
            goal = pin.SE3(home.rotation, home.translation + rng.uniform(-0.3, 0.3, 3))
            moving = sm.paths.Line(start, goal, float(rng.uniform(0.3, 1.0)))
            path = Later(moving, t)
        segment = replanner.step(t, q, qd, path)
        found.append(segment)
        t += replanner.period
        now = segment.index(t)
        q, qd = segment.q[now], segment.qd[now]
    return found


class Later(sm.paths.Path):
    """A path that begins later."""

    def __init__(self, path: sm.paths.Path, begins: float) -> None:
        self._path, self._begins = path, begins
        self.duration = begins + path.duration

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        inner = np.maximum(t - self._begins, 0.0)
        found = self._path.samples(inner)
        twist = np.where((t >= self._begins)[:, None], found.twist, 0.0)
        return sm.paths.PathSamples(t, found.translation, found.rotation, twist)


def is_rest(segment: Segment) -> bool:
    """Return whether a segment is the rest of the one before, for lack of a proof."""
    return any("not proved" in reason for reason in segment.reasons)


def exceeded(kind: str, found: list[Segment]) -> float:
    """Return by which share of the limit segments exceed it, but for the rests of others."""
    model = robot_named("panda").model
    shares, worst = KINDS[kind][1](model, model.createData()), -1.0
    for segment in found:
        assert np.all(segment.qd[-1] == 0.0)
        if not is_rest(segment):
            used = shares(*motion_between_cycles(segment))
            most = 1.0 if used[0] <= 1.0 else used[0] + GROWS
            worst = max(worst, float(used.max() - most))
    return worst


def faults(seed: int, kinds: tuple[str, ...], replanner: Replanner) -> list[str]:
    """Return what a run showed that is against the laws; none where all hold."""
    found = run(replanner, seed)
    beyond = {kind: exceeded(kind, found) for kind in kinds}
    said = [f"{share:.2g} beyond the {kind}" for kind, share in beyond.items() if share > ROUNDED]
    with_places = [(segment, np.zeros(3)) for segment in found]
    if (off := changed_rests(with_places)) > SAME:
        said.append(f"the rest of a segment is {off:.2g} rad off it")
    if (over := limits_exceeded(replanner, with_places)) > ROUNDED:
        said.append(f"{over:.2g} beyond a limit")
    return said
