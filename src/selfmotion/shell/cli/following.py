"""Commands `selfmotion follow` and `selfmotion track`: the loop with a real or simulated arm."""

import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from select import select
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion import realtime
from selfmotion.basics import Array
from selfmotion.model.task import SE3
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import reachable

# What `selfmotion follow` does: states of an arm come by UDP, and segments go back.

# Largest size of a UDP datagram [bytes].
_LARGEST_DATAGRAM = 65_507
# Time-out of a receive [s].
_TIMEOUT = 0.2
_FLOAT = np.dtype("<f8")
# A tool farther than this from its path is off it [m, rad].
_OFF = np.array([1e-4, 1e-3])
# Rounding of limits that are used in full.
_FULL = 1.0 + 1e-9
_LIMITS = ("position", "speed", "acceleration")
# So many times of being off the path are told one by one.
_TOLD = 5


@dataclass(eq=False)
class Link:
    """States in, segments out, as datagrams of little-endian doubles.

    A state is [t, q, q̇]; the path begins with the first one. A segment is a row [t, q, q̇, q̈] for
    each cycle, in the clock of the states. An empty datagram ends it. Segments go to where the
    first state came from; what comes from elsewhere, is of another length, or older than the last
    state, is left out, and lengths that are wrong are told at once. Of several states that wait the
    newest counts.

    Parameters
    ----------
    port : socket
        Bound.
    path : Path
    limits : (4, n)
        Lower, upper, speed, acceleration of the joints.
    tell : callable
        What is told while it runs.
    silence : float
        Without a state for so long, it ends [s]; for the first one it waits without end.
    seconds : float
        From the first state on, it ends after so long [s].
    """

    port: socket.socket
    path: sm.paths.Path
    limits: Array
    tell: Callable[[str], object]
    silence: float
    seconds: float
    flags: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    took: list[float] = field(default_factory=list)
    error: Array = field(default_factory=lambda: np.zeros(2))
    left_out: int = 0
    lengths: Counter[int] = field(default_factory=Counter)
    used: Array = field(default_factory=lambda: np.zeros(3))
    off: list[list[float]] = field(default_factory=list)
    ended: str = ""
    _peer: Any = None
    _first: float = 0.0
    _last: float = -np.inf
    _since: float = 0.0

    def read(self) -> realtime.State | None:
        """Wait for the next state; None where it is over."""
        waited = time.monotonic()
        while True:
            data = self._newest()
            if data is None:
                if self._peer is not None and time.monotonic() - waited > self.silence:
                    self.ended = f"no state for {self.silence:g} s"
                    return None
                continue
            if not data:
                self.ended = "the controller ended it"
                return None
            numbers = np.frombuffer(data, dtype=_FLOAT).astype(np.float64)
            if self._last == -np.inf:
                self._first = float(numbers[0])
            t = float(numbers[0]) - self._first
            if t > self.seconds:
                self.ended = f"{self.seconds:g} s are over"
                return None
            self._last, self._since = float(numbers[0]), time.perf_counter()
            return realtime.State(t, numbers[1 : 1 + self.dof], numbers[1 + self.dof :], self.path)

    def write(self, segment: realtime.Segment) -> None:
        """Send a segment, and note what became of it."""
        rows = np.column_stack([segment.t + self._first, segment.q, segment.qd, segment.qdd])
        data = rows.astype(_FLOAT).tobytes()
        if len(data) > _LARGEST_DATAGRAM:
            raise sm.errors.ProblemError(
                f"a segment of {len(rows)} cycles takes {len(data)} bytes, more than a datagram "
                f"holds ({_LARGEST_DATAGRAM}): give a longer --cycle"
            )
        self.port.sendto(data, self._peer)
        self.took.append(time.perf_counter() - self._since)
        self.flags[segment.flag.value] += 1
        self.reasons.update(segment.reasons)
        self.error = np.maximum(self.error, segment.tool_error)
        self._note_off(segment)
        lower, upper, speed, acceleration = self.limits
        middle, half = 0.5 * (upper + lower), 0.5 * (upper - lower)
        away = np.divide(
            segment.q - middle, half, out=np.zeros_like(segment.q), where=np.isfinite(half)
        )
        shares = (away, segment.qd / speed, segment.qdd / acceleration)
        self.used = np.maximum(self.used, [np.abs(each).max() for each in shares])

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.limits.shape[1])

    def _note_off(self, segment: realtime.Segment) -> None:
        """Note from when to when the tool is off its path, as measured [s]."""
        is_off, now = bool((segment.tool_error > _OFF).any()), float(segment.t[0])
        open_ = bool(self.off) and np.isnan(self.off[-1][1])
        if is_off and not open_:
            self.off.append([now, np.nan])
        elif open_ and not is_off:
            self.off[-1][1] = now

    def _newest(self) -> bytes | None:
        """Return the newest state or the end; None where nothing came for a while."""
        found: bytes | None = None
        wait = _TIMEOUT
        while found != b"" and select([self.port], [], [], wait)[0]:
            later = self._sound(*self.port.recvfrom(65_536))
            found, wait = found if later is None else later, 0.0
        return found

    def _sound(self, data: bytes, sender: Any) -> bytes | None:
        """Return a datagram of the controller's that is one; None for all others."""
        wanted = (1 + 2 * self.dof) * _FLOAT.itemsize
        foreign = self._peer is not None and sender != self._peer
        fits = len(data) == wanted or (not data and self._peer is not None)
        if not fits and not foreign:
            if len(data) not in self.lengths:
                self.tell(f"left out: a datagram of {len(data)} bytes; {self.expected}")
            self.lengths[len(data)] += 1
        if foreign or not fits or (data and not self._is_later(data)):
            self.left_out += 1
            return None
        self._peer = sender
        return data

    @property
    def expected(self) -> str:
        """Expected length of a state datagram, in words."""
        count = 1 + 2 * self.dof
        return (
            f"a state has {count * _FLOAT.itemsize}: {count} doubles (time, {self.dof} positions, "
            f"{self.dof} velocities)"
        )

    def _is_later(self, data: bytes) -> bool:
        t = float(np.frombuffer(data, dtype=_FLOAT, count=1)[0])
        return bool(np.isfinite(t) and t > self._last)

    @property
    def summary(self) -> dict[str, Any]:
        """Summary of the run, as JSON-safe values."""
        return {
            "ended": self.ended,
            "segments": dict(self.flags),
            "reasons": dict(self.reasons),
            "states left out": self.left_out,
            "lengths left out": {str(size): count for size, count in self.lengths.items()},
            "off the path": [[a, None if np.isnan(b) else b] for a, b in self.off],
            "limits used": dict(zip(_LIMITS, self.used.tolist(), strict=True)),
            "limits kept": bool((self.used <= _FULL).all()),
            "largest position error": float(self.error[0]),
            "largest rotation error": float(self.error[1]),
            "longest step": max(self.took, default=0.0),
            "median step": float(np.median(self.took)) if self.took else 0.0,
        }

    @property
    def is_followed(self) -> bool:
        """Whether there was a segment, and each was planned."""
        return set(self.flags) == {realtime.Flag.PLANNED.value}


@contextmanager
def listening(address: str) -> Iterator[socket.socket]:
    """Yield a socket that is bound to host:port; ProblemError where that cannot be."""
    host, colon, port = address.rpartition(":")
    if not (colon and host and port.isdecimal() and int(port) < 65_536):
        raise sm.errors.ProblemError(
            f"--listen is '{address}', expected host:port like 127.0.0.1:5005"
        )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        try:
            opened.bind((host, int(port)))
        except OSError as error:
            raise sm.errors.ProblemError(
                f"--listen {address}: {error.strerror or error}"
            ) from error
        yield opened


def replanner_of(problem: sm.Problem, **options: Any) -> sm.Replanner:
    """Return the replanner of a problem; ProblemError for what is not followed while moving."""
    if problem.also:
        raise sm.errors.ProblemError(
            "while the arm moves one frame follows a path: leave 'also' out"
        )
    if problem.relaxations:
        raise sm.errors.ProblemError(
            "while the arm moves no row is relaxed: leave 'relaxations' out"
        )
    if problem.damping is not None:
        raise sm.errors.ProblemError("while the arm moves nothing is damped: leave 'damping' out")
    # With the default clearance, of the arm from itself.
    asked = problem.all_constraints
    return sm.Replanner(problem.robot, problem.task, problem.costs, asked, **options)


def out_of_reach(problem: sm.Problem) -> str:
    """Return in words from when on poses of the path are out of reach; "" where none is.

    PlanError where it begins there.
    """
    formulation = Formulation.of(problem)
    return reachable(formulation, sm.Search().starts, np.random.default_rng(0)).reason


def show_link(link: Link, console: Console) -> None:
    """Print what came of it."""
    found = link.summary
    table = Table(show_header=False, box=None)
    table.add_row("ended", link.ended)
    counts = ", ".join(f"{count} {name}" for name, count in link.flags.items())
    table.add_row("segments", counts or "none")
    for reason, count in link.reasons.items():
        table.add_row("", f"{count} times: {reason}")
    if link.left_out:
        table.add_row("datagrams left out", str(link.left_out))
    for size, number in link.lengths.items():
        table.add_row("", f"{number} of {size} bytes; {link.expected}")
    if link.took:
        median, longest = 1e3 * found["median step"], 1e3 * found["longest step"]
        table.add_row("a step takes", f"{median:.2f} ms in the median, {longest:.2f} ms at most")
        metres, angle = found["largest position error"], found["largest rotation error"]
        table.add_row("off the path, as measured", f"at most {metres:.2g} m and {angle:.2g} rad")
        for number, (first, last) in enumerate(link.off, 1):
            if number > _TOLD:
                table.add_row("", f"and {len(link.off) - _TOLD} more times")
                break
            back = "to the end" if np.isnan(last) else f"to {last:.3g} s, then back on it"
            table.add_row("", f"farther than 0.1 mm or 1 mrad from t = {first:.3g} s {back}")
        said = "kept" if found["limits kept"] else "NOT kept"
        shares = ", ".join(f"{name} {share:.0%}" for name, share in found["limits used"].items())
        table.add_row("limits of the joints", f"{said} by all commands; used: {shares}")
    console.print(table)


# What `selfmotion track` shows: a conveyor, a push, a ball that appears.

# Amplitude of the conveyor's motion [m].
_CONVEYOR_AMPLITUDE = 0.12
# Period of the conveyor's motion [s].
_CONVEYOR_PERIOD = 12.0
# Radius of the circle on the conveyor [m].
_CIRCLE_RADIUS = 0.06
# Period of the circle [s].
_CIRCLE_PERIOD = 6.0
# Begin and end of the disturbance of the joints [s].
PUSHED = (3.0, 4.5)
# Amplitude of the disturbance [rad].
_PUSH_AMPLITUDE = 0.03
# Rise time of the disturbance [s].
_PUSH_RISE = 0.2
# Time at which the ball appears [s].
APPEARS = 6.0
# Radius of the ball [m].
_BALL_RADIUS = 0.06
# Clearance from the ball [m].
_BALL_CLEARANCE = 0.005
# Pose of the ball before it appears, out of the way.
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
            _CIRCLE_RADIUS,
            seconds + 10.0,
            normal=(0.0, 0.0, 1.0),
            turns=(seconds + 10.0) / _CIRCLE_PERIOD,
        )
        self._push = _PUSH_AMPLITUDE * np.where(np.arange(robot.dof) % 2, 1.0, -1.0)
        self._ball = SE3(np.eye(3), np.asarray(ball))

    def path(self, t: float) -> sm.paths.Path:
        """Return the circle where the conveyor is, going on as fast as it is now."""
        # The conveyor's drive is measured: place and velocity of a sine.
        phase = 2.0 * np.pi * t / _CONVEYOR_PERIOD
        place = np.array([0.0, _CONVEYOR_AMPLITUDE * np.sin(phase), 0.0])
        velocity = np.array(
            [0.0, _CONVEYOR_AMPLITUDE * 2.0 * np.pi / _CONVEYOR_PERIOD * np.cos(phase), 0.0]
        )
        return realtime.Conveyed(self._circle, velocity, place - t * velocity)

    def obstacles(self, t: float) -> Mapping[str, SE3]:
        """Return where the ball is."""
        return {"ball": self._ball if t >= APPEARS else _AWAY}

    def pushed(self, t: float) -> Array:
        """Return the push."""
        since = np.clip((t - np.array(PUSHED)) / _PUSH_RISE, 0.0, 1.0)
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
        (sm.obstacles.Sphere("ball", ball, _BALL_RADIUS),), distance=_BALL_CLEARANCE
    )
    replanner = realtime.Replanner(robot, task, constraints=(*limits, clearance), horizon=horizon)
    realtime.warm_up(replanner)
    arm = realtime.SimulatedArm(start, replanner.cycle, rng=seed)
    record = realtime.track(replanner, arm, Conveyor(robot, start, ball, seconds), seconds)
    shown = sm.constraints.Clearance(
        (sm.obstacles.Sphere("ball", ball, _BALL_RADIUS),), distance=0.0
    )
    return replanner, record, record.as_plan(replanner, constraints=(limits[0], shown))


def show_steps(
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
    model = result.problem.clearances[0].model(result.robot)
    motion = result.trajectory
    here = motion.t >= min(APPEARS, motion.t[-1])
    return float(min(model.distance(q).value for q in motion.q[here][::10]))


def write(record: realtime.Record, result: sm.Plan, folder: Path) -> list[Path]:
    """Write replay, plan and histogram; return the files. Without matplotlib no histogram."""
    from selfmotion.shell.replay import write_replay

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
