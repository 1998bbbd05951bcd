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

Share = Callable[[Array, Array, Array], float]
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_TOOL = "panda_hand_tcp"
_FORCES = np.array([40.0, 60.0, 30.0, 30.0, 5.0, 5.0, 5.0])
_SPEED, _ACCELERATION = 0.4, 3.0


def torque(model: pin.Model, data: pin.Data) -> Share:
    return lambda q, qd, qdd: float((np.abs(pin.rnea(model, data, q, qd, qdd)) / _FORCES).max())


def tilt(model: pin.Model, data: pin.Data) -> Share:
    def share(q: Array, qd: Array, qdd: Array) -> float:
        pin.framesForwardKinematics(model, data, q)
        down = data.oMf[model.getFrameId(_TOOL)].rotation[:, 2] @ np.array([0.0, 0.0, -1.0])
        return float(np.arccos(np.clip(down, -1.0, 1.0))) / 0.3

    return share


def elbow(model: pin.Model, data: pin.Data) -> Share:
    def share(q: Array, qd: Array, qdd: Array) -> float:
        pin.forwardKinematics(model, data, q)
        shoulder, middle, wrist = (data.oMi[k].translation for k in (2, 4, 6))
        axis = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        arm, up = middle - shoulder, np.array([0.0, 0.0, 1.0])
        arm, up = arm - axis * (axis @ arm), up - axis * (axis @ up)
        return abs(float(np.arctan2(axis @ np.cross(up, arm), up @ arm))) / 0.4

    return share


def tool(model: pin.Model, data: pin.Data) -> Share:
    def share(q: Array, qd: Array, qdd: Array) -> float:
        pin.forwardKinematics(model, data, q, qd, qdd)
        at = model.getFrameId(_TOOL)
        pin.updateFramePlacement(model, data, at)
        speed = pin.getFrameVelocity(model, data, at, _AXES).linear
        faster = pin.getFrameClassicalAcceleration(model, data, at, _AXES).linear
        return max(np.linalg.norm(speed) / _SPEED, np.linalg.norm(faster) / _ACCELERATION)

    return share


KINDS: dict[str, tuple[Callable[[], sm.constraints.Constraint], Callable[..., Share]]] = {
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
    share, worst = KINDS[kind][1](model, model.createData()), -1.0
    for segment in found:
        assert np.all(segment.qd[-1] == 0.0)
        if not is_rest(segment):
            each = [share(*state) for state in zip(*motion_between_cycles(segment), strict=True)]
            most = 1.0 if each[0] <= 1.0 else each[0] + GROWS
            worst = max(worst, max(each) - most)
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
