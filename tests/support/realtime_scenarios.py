"""Random scenarios for the loop: pushes, late steps, jumps of the target and faults, by seed.

Nothing here looks at a clock: a late step is one that is not made.
"""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.realtime import Flag, Plant, Replanner, SimulatedArm

# The tool is back on its path when it is this near [m]; and has this long to come back [s].
BACK, TIME_TO_COME_BACK = 1e-3, 1.0
# From farther than this [m] the limit of the approach's speed decides.
NEAR = 0.1
# What rounding of a spline's samples may show beyond a limit, relative to it.
ROUNDING = 1e-9
# What becomes of a scenario [s]; its events begin early enough to be over a second before the end.
_DURATION, _FIRST, _LAST = 4.0, 1.1, 2.2
# After a chase it takes so much longer [s].
_CHASE = 2.0


# How far the configurations of targets are from each other [rad].
_SPREAD = 0.08


class Broken(sm.paths.Path):
    """A path that raises, or is not a number."""

    def __init__(self, nan: bool) -> None:
        self.duration, self._nan = 100.0, nan

    def evaluate(self, t):
        if not self._nan:
            raise RuntimeError("no camera")
        many = np.full((len(t), 3), np.nan)
        return sm.paths.PathSamples(t, many, np.full((len(t), 3, 3), np.nan), np.zeros((len(t), 6)))


@dataclass
class Outcome:
    """What a scenario showed; `faults` is empty where all laws hold."""

    seed: int
    faults: list[str] = field(default_factory=list)
    slowest: float = 0.0
    flags: dict[Flag, int] = field(default_factory=dict)


def target_near(robot, q, rng, spread=_SPREAD):
    """A slow motion of the tool through a pose that a configuration near `q` has."""
    middle = 0.5 * (robot.lower + robot.upper)
    near = q + rng.uniform(-spread, spread, robot.dof) + 0.1 * spread * np.sign(middle - q)
    pose = robot.pose(np.clip(near, robot.lower + 0.1, robot.upper - 0.1))
    turn = pin.exp3(rng.uniform(-0.2, 0.2, 3))
    end = pin.SE3(turn @ pose.rotation, pose.translation + rng.uniform(-0.05, 0.05, 3))
    return sm.paths.Line(pose, end, 20.0)


def run(seed: int, task: str, robot: sm.RobotModel, replanner: Replanner) -> Outcome:
    rng = np.random.default_rng(seed)
    outcome = Outcome(seed)
    home = np.array(sm.NAMED_ARMS["panda"].home) + rng.uniform(-0.2, 0.2, robot.dof)
    plant = Plant(rng.uniform(0.0, 0.015), rng.uniform(0.0, 4e-3), rng.uniform(0.0, 1e-4))
    arm = SimulatedArm(home, replanner.cycle, plant, rng)
    replanner.reset()
    path = target_near(robot, home, rng)
    events = sorted((float(rng.uniform(_FIRST, _LAST)), str(rng.choice(EVENTS))) for _ in range(2))
    disturbed_until, wanted, kind, until = 0.0, path, "", 0.0
    planned, recovering = replanner._horizon.improve, False
    off_since: float | None = 0.0
    miss = 0.0
    end = _DURATION + _CHASE * any(name == "out of reach" for _, name in events)
    while arm.t < end - 1e-9:
        t = arm.t
        if events and t >= events[0][0]:
            kind, until = events.pop(0)[1], t + float(rng.uniform(0.05, 0.4))
            if kind == "out of reach":
                until += 0.4
            if kind == "jump":
                path = target_near(robot, home, rng)
            elif kind == "push":
                arm.pushed = rng.uniform(-0.05, 0.05, robot.dof)
            elif kind == "knock":
                arm.pushed = rng.uniform(-0.1, 0.1, robot.dof)
            disturbed_until = t
        if kind == "knock" and t >= until:
            arm.pushed = np.zeros(robot.dof)
            disturbed_until, kind = t, ""
        active = bool(kind) and t < until
        if kind in LASTING and active:
            disturbed_until = t
        wanted = path
        # After a chase to the edge of the workspace the tool is far off, its approach has a limit
        # of speed, and the joints have theirs: time counts from when it is near and can follow.
        recovering = off_since is not None and (recovering or kind == "out of reach")
        failing = active and kind == "no plan"
        replanner._horizon.improve = no_plan(replanner) if failing else planned  # type: ignore[method-assign]
        q, qd = arm.measure()
        if active and kind == "no state":
            q = np.full(robot.dof, np.nan)
        if active and kind == "broken path":
            wanted = Broken(nan=bool(rng.integers(2)))
        if active and kind == "out of reach":
            wanted = sm.paths.Line(robot.pose(home), beyond(robot.pose(home)), 0.5)
        if not (active and kind == "late"):
            segment = replanner.step(t, q, qd, wanted)
            arm.write(segment)
            if recovering and (miss > NEAR or not segment.follows):
                disturbed_until = t
            outcome.flags[segment.flag] = outcome.flags.get(segment.flag, 0) + 1
            if segment.flag is not Flag.PLANNED and not segment.reasons:
                outcome.faults.append(f"{segment.flag.value} for no reason at {t:.2f} s")
        arm.run(replanner.period)
        goal = path.pose(min(arm.t, path.duration))
        miss = sm.Task.of(task).miss(goal, robot.pose(arm.q))[0]
        if miss < BACK:
            if off_since is not None:
                outcome.slowest = max(outcome.slowest, arm.t - max(off_since, disturbed_until))
            off_since = None
        elif off_since is None:
            off_since = arm.t
        late = off_since is not None and arm.t - max(off_since, disturbed_until) > TIME_TO_COME_BACK
        if late:
            outcome.faults.append(f"{miss * 1e3:.2f} mm off at {arm.t:.2f} s")
            outcome.slowest = np.inf
            break
    else:
        if off_since is not None:
            outcome.faults.append(f"ends {miss * 1e3:.2f} mm off")
    replanner._horizon.improve = planned  # type: ignore[method-assign]
    outcome.faults += limits_broken(replanner, arm)
    return outcome


def no_plan(replanner):
    """What stands for a plan that fails."""

    def improve(*_):
        replanner._horizon.forget()
        return False

    return improve


def limits_broken(replanner: Replanner, arm: SimulatedArm) -> list[str]:
    """What the commands did beyond limits, from the commands alone."""
    q, qd, qdd = (np.array(values) for values in zip(*arm.commanded, strict=True))
    lower, upper, speed, hardest = replanner.limits
    h, faults = replanner.cycle, []
    if not all(np.all(np.isfinite(values)) for values in (q, qd, qdd)):
        return ["not finite"]
    if np.any(q < lower - ROUNDING) or np.any(q > upper + ROUNDING):
        faults.append("position beyond its limit")
    if np.any(np.abs(qd) > speed * (1.0 + ROUNDING)):
        faults.append("speed beyond its limit")
    if np.any(np.abs(qdd) > hardest * (1.0 + ROUNDING)):
        faults.append("acceleration beyond its limit")
    jerk = np.abs(np.diff(qdd, axis=0)) / h
    if np.any(jerk > replanner.jerk_limit * (1.0 + ROUNDING)):
        faults.append("jerk beyond its limit")
    # The samples are one motion, with an acceleration that is linear between them: no jump.
    fits = np.abs(np.diff(qd, axis=0) - 0.5 * h * (qdd[1:] + qdd[:-1])).max()
    moved = np.diff(q, axis=0) - h * qd[:-1] - h * h / 6.0 * (2.0 * qdd[:-1] + qdd[1:])
    if fits > 1e-9 or np.abs(moved).max() > 1e-9:
        faults.append(f"a jump: {fits:.2g}, {np.abs(moved).max():.2g}")
    return faults


def beyond(pose: pin.SE3) -> pin.SE3:
    return pin.SE3(pose.rotation, 3.0 * pose.translation)


# What happens; these for as long as they last.
LASTING = ("late", "no state", "broken path", "no plan", "out of reach", "knock")
EVENTS = ("jump", "push", *LASTING)
