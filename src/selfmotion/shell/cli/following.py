"""The command `selfmotion follow`: the loop with an arm, as datagrams."""

import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from select import select
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion import realtime
from selfmotion.basics import Array
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import reachable

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
# Number of times off the path that are reported one by one.
_TOLD = 5


@dataclass(frozen=True)
class Loop:
    """The table ``[loop]`` of a problem file.

    Attributes
    ----------
    horizon : float
        How far ahead is planned [s].
    period : float
        Time between states [s].
    cycle : float
        Time between set-points [s].
    latency : float
        From measuring a state until the arm follows its segment [s].
    silence : float
        Without a state for so long, it ends [s]; for the first one it waits without end.
    seconds : float
        From the first state on, it ends after so long [s]; by default it does not.
    """

    horizon: float = 2.0
    period: float = 0.01
    cycle: float = 1e-3
    latency: float = 0.0
    silence: float = 5.0
    seconds: float = np.inf

    @property
    def of_replanner(self) -> dict[str, float]:
        """What a `Replanner` takes of it."""
        return {name: getattr(self, name) for name in ("horizon", "period", "cycle", "latency")}


# Smallest numbers of a loop [s].
_MIN_TIMES = {"horizon": 0.1, "period": 1e-3, "cycle": 1e-4, "silence": 0.1, "seconds": 0.1}


def loop_of(document: Mapping[str, Any], file: Path) -> Loop:
    """Return the loop of a document; FileFormatError for a number that is too small."""
    values = document.get("loop", {})
    known = {field.name for field in fields(Loop)}
    # Others are reported where the document is checked.
    given = {name: value for name, value in values.items() if name in known}
    for name, value in given.items():
        least = _MIN_TIMES.get(name, 0.0)
        if isinstance(value, int | float) and not value >= least:
            raise sm.errors.FileFormatError(
                f"{file}: loop.{name}: is {value}, expected at least {least:g} s"
            )
    return Loop(**given)


@dataclass(eq=False)
class Link:
    """States in, segments out, as datagrams of little-endian doubles.

    A state is [t, q, q̇]; the path begins with the first one. A segment is a row [t, q, q̇, q̈] for
    each cycle, in the clock of the states. An empty datagram ends it. Segments go to where the
    first state came from; what comes from elsewhere, is of another length, or older than the last
    state, is left out, and lengths that are wrong are reported at once. Of several states that wait
    the newest counts.

    Parameters
    ----------
    port : socket
        Bound.
    path : Path
    limits : (4, n)
        Lower, upper, speed, acceleration of the joints.
    tell : callable
        Receives messages while it runs.
    loop : Loop
    """

    port: socket.socket
    path: sm.paths.Path
    limits: Array
    tell: Callable[[str], object]
    loop: Loop
    flags: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    took: list[float] = field(default_factory=list)
    error: Array = field(default_factory=lambda: np.zeros(2))
    left_out: int = 0
    lengths: Counter[int] = field(default_factory=Counter)
    used: Array = field(default_factory=lambda: np.zeros(3))
    off: list[list[float]] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
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
                if self._peer is not None and time.monotonic() - waited > self.loop.silence:
                    self.ended = f"no state for {self.loop.silence:g} s"
                    return None
                continue
            if not data:
                self.ended = "the controller ended it"
                return None
            numbers = np.frombuffer(data, dtype=_FLOAT).astype(np.float64)
            if self._last == -np.inf:
                self._first = float(numbers[0])
            t = float(numbers[0]) - self._first
            if t > self.loop.seconds:
                self.ended = f"{self.loop.seconds:g} s are over"
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
                f"holds ({_LARGEST_DATAGRAM}): give a longer loop.cycle"
            )
        self.port.sendto(data, self._peer)
        self.took.append(time.perf_counter() - self._since)
        self.flags[segment.flag.value] += 1
        self.reasons.update(segment.reasons)
        self.error = np.maximum(self.error, segment.tool_error)
        self.delays.append(segment.delay)
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
            "largest delay": max(self.delays, default=0.0),
            "delay at the end": self.delays[-1] if self.delays else 0.0,
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
        latest, last = found["largest delay"], found["delay at the end"]
        if latest > 0.0:
            table.add_row("late on the path", f"at most {latest:.3g} s, {last:.3g} s at the end")
        said = "kept" if found["limits kept"] else "NOT kept"
        shares = ", ".join(f"{name} {share:.0%}" for name, share in found["limits used"].items())
        table.add_row("limits of the joints", f"{said} by all commands; used: {shares}")
    console.print(table)
