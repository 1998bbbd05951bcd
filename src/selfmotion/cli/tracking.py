"""What `selfmotion track` shows: a conveyor, a push, a ball that appears."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion import realtime
from selfmotion.basics import Array
from selfmotion.task import SE3

# What the conveyor carries the path by at most [m], and how long it takes there and back [s].
_REACH, _TURN = 0.12, 12.0
# The tool draws this circle on it [m], in so many seconds.
_RADIUS, _ROUND = 0.06, 6.0
# From when to when the arm is pushed off its command [s], how far [rad], and how fast [s].
PUSHED, _FAR, _RISE = (3.0, 4.5), 0.03, 0.2
# When the ball appears [s], how large it is [m], and the distance that is kept from it [m].
APPEARS, _BALL, _DISTANCE = 6.0, 0.06, 0.005
# Where it is before [m].
_AWAY = SE3(np.eye(3), np.array([0.0, 0.0, 50.0]))


class Conveyor:
    """A circle on a conveyor that goes to and fro; a push, and a ball beside the elbow.

    Parameters
    ----------
    robot : RobotModel
    start : (n,)
        Where the arm is at first.
    ball : (3,)
        Where the ball appears [m].
    seconds : float
        How long it all takes.
    """

    def __init__(self, robot: sm.RobotModel, start: Array, ball: Array, seconds: float) -> None:
        self._circle = sm.paths.Circle.around(
            robot.pose(start),
            _RADIUS,
            seconds + 10.0,
            normal=(0.0, 0.0, 1.0),
            turns=(seconds + 10.0) / _ROUND,
        )
        self._push = _FAR * np.where(np.arange(robot.dof) % 2, 1.0, -1.0)
        self._ball = SE3(np.eye(3), np.asarray(ball))

    def path(self, t: float) -> sm.paths.Path:
        """Return the circle where the conveyor is, going on as fast as it is now."""
        # The conveyor's drive is measured: place and velocity of a sine.
        phase = 2.0 * np.pi * t / _TURN
        place = np.array([0.0, _REACH * np.sin(phase), 0.0])
        velocity = np.array([0.0, _REACH * 2.0 * np.pi / _TURN * np.cos(phase), 0.0])
        return realtime.Conveyed(self._circle, velocity, place - t * velocity)

    def obstacles(self, t: float) -> Mapping[str, SE3]:
        """Return where the ball is."""
        return {"ball": self._ball if t >= APPEARS else _AWAY}

    def pushed(self, t: float) -> Array:
        """Return the push."""
        since = np.clip((t - np.array(PUSHED)) / _RISE, 0.0, 1.0)
        share = since * since * (3.0 - 2.0 * since)
        return np.asarray(self._push * (share[0] - share[1]))


def conveyor_run(
    task: str, seconds: float, seed: int, horizon: float
) -> tuple[realtime.Replanner, realtime.Record, sm.Plan]:
    """Let a simulated Panda keep up with the conveyor; return the loop, the record and the plan."""
    robot = sm.load_robot("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    # In the way of the elbow, not of the tool.
    ball = robot.chain_to("panda_link4").place(start).translation + np.array([0.0, 0.19, 0.0])
    limits = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
    )
    clearance = sm.constraints.Clearance(
        (sm.obstacles.Sphere("ball", ball, _BALL),), distance=_DISTANCE
    )
    replanner = realtime.Replanner(robot, task, constraints=(*limits, clearance), horizon=horizon)
    realtime.warm_up(replanner)
    arm = realtime.SimulatedArm(start, replanner.cycle, rng=seed)
    record = realtime.track(replanner, arm, Conveyor(robot, start, ball, seconds), seconds)
    shown = sm.constraints.Clearance((sm.obstacles.Sphere("ball", ball, _BALL),), distance=0.0)
    return replanner, record, record.as_plan(replanner, constraints=(limits[0], shown))


def show(
    replanner: realtime.Replanner, record: realtime.Record, apart: float, console: Console
) -> bool:
    """Print what came of it; return whether all limits were kept.

    `apart` is the least distance of bodies once the ball is there [m].
    """
    table = Table(show_header=False, box=None)
    milliseconds = 1e3 * np.quantile(record.seconds, [0.5, 0.99, 1.0])
    table.add_row("steps", f"{len(record.t)}, every {1e3 * replanner.period:g} ms")
    table.add_row(
        "a step takes",
        "{:.2f} ms; 99 of 100 at most {:.2f} ms, the longest {:.2f} ms".format(*milliseconds),
    )
    table.add_row("segments", ", ".join(f"{count} {name}" for name, count in record.flags.items()))
    for reason, count in record.reasons.items():
        table.add_row("", f"{count} times: {reason}")
    times = (
        ("on the way", 1.0, PUSHED[0]),
        ("while pushed", PUSHED[0], PUSHED[0] + 1.0),
        ("a second after the push began", PUSHED[0] + 1.0, PUSHED[1]),
        ("once the ball is there", APPEARS, np.inf),
    )
    for name, since, until in times:
        here = (record.t >= since) & (record.t < until)
        if here.any():
            table.add_row(
                f"tool error {name}", f"at most {1e3 * record.error[here, 0].max():.3f} mm"
            )
    table.add_row("distance to the ball, and of links", f"at least {1e3 * apart:.1f} mm")
    q, qd, qdd = record.commanded.transpose(1, 0, 2)
    lower, upper, speed, hardest = replanner.limits
    least = float(np.minimum(q - lower, upper - q).min())
    table.add_row("distance to a joint limit", f"at least {least:.3g} rad")
    table.add_row("speed", f"at most {100 * (np.abs(qd) / speed).max():.1f} % of its limit")
    table.add_row("acceleration", f"at most {100 * (np.abs(qdd) / hardest).max():.1f} %")
    console.print(table)
    over = (np.abs(qd) / speed).max() > 1.0 or (np.abs(qdd) / hardest).max() > 1.0
    return bool(least >= 0.0 and apart > 0.0 and not over)


def least_distance(result: sm.Plan) -> float:
    """Return how near bodies come from when the ball is there [m]."""
    clearance = result.problem.constraints[-1]
    model = clearance.model(result.robot)  # type: ignore[attr-defined]
    motion = result.trajectory
    here = motion.t >= min(APPEARS, motion.t[-1])
    return float(min(model.distance(q).value for q in motion.q[here][::10]))


def write(record: realtime.Record, result: sm.Plan, folder: Path) -> list[Path]:
    """Write replay, plan and histogram; return the files. Without matplotlib no histogram."""
    from selfmotion.replay import write_replay

    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / "track.html", folder / "track.npz", folder / "latency.png"]
    worst = 1e3 * record.error[record.t >= 1.0, 0].max(initial=0.0)
    said = (
        f"A simulated {result.robot.name} keeps up with a circle on a conveyor. It is replanned "
        f"{len(record.t)} times; it answers late, is measured with noise, and is pushed off its "
        f"command from {PUSHED[0]:g} to {PUSHED[1]:g} s, by up to {worst:.1f} mm at the tool. The "
        f"ball appears at {APPEARS:g} s. Shown is where the arm was, not what was commanded."
    )
    write_replay(result, files[0], title="A moving target", description=said)
    result.save(files[1])
    return files if _draw_histogram(record, files[2]) else files[:2]


def _draw_histogram(record: realtime.Record, file: Path) -> bool:
    """Draw how long steps took; return whether matplotlib is there to do it."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return False
    milliseconds = 1e3 * record.seconds
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    axes = figure.add_subplot()
    # Of a step that the machine had no time for, the picture shows that it was one.
    most = max(5.0, float(np.quantile(milliseconds, 0.999)))
    axes.hist(np.minimum(milliseconds, most), bins=80, range=(0.0, most), color="#4878a8")
    axes.set_yscale("log")
    axes.set_xlabel("time of a step [ms]")
    axes.set_ylabel("steps")
    # One above the other: the two may be near.
    for share, name, height in ((0.5, "p50", 0.94), (0.99, "p99", 0.86)):
        value = float(np.quantile(milliseconds, share))
        axes.axvline(value, color="#b04030", linewidth=1.0)
        axes.annotate(
            f" {name} {value:.2f} ms",
            (value, height),
            xycoords=("data", "axes fraction"),
            color="#b04030",
        )
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=120)
    return True
