"""The loop around a replanner: reads states, writes segments, knows no transport."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy.typing as npt

from selfmotion.basics import ProblemError
from selfmotion.path import Path
from selfmotion.realtime.replanner import Replanner
from selfmotion.realtime.segment import Segment
from selfmotion.task import SE3


@dataclass(frozen=True, eq=False)
class State:
    """What is known when a step is made.

    Attributes
    ----------
    t : float
        When it was measured [s].
    q, qd : (n,)
        Measured positions and velocities [rad or m, and per s].
    path : Path, optional
        The tool's motion, as it is known by now.
    obstacles : mapping
        Where obstacles are by now: name → pose.
    target, twist, seen : optional
        In place of a path; see `Replanner.step`.
    """

    t: float
    q: npt.ArrayLike
    qd: npt.ArrayLike
    path: Path | None = None
    obstacles: Mapping[str, SE3] = field(default_factory=dict)
    target: SE3 | npt.ArrayLike | None = None
    twist: npt.ArrayLike | None = None
    seen: float | None = None


def follow(
    replanner: Replanner,
    read: Callable[[], State | None],
    write: Callable[[Segment], None],
    *,
    lead: float = 0.0,
) -> int:
    """Plan a segment from each state that is read, and write it, until there is none.

    Parameters
    ----------
    replanner : Replanner
        With ``latency`` no less than `lead`.
    read : callable
        Waits for the next state, about a period later, and returns it; None ends the loop.
    write : callable
        Hands a segment to what commands the arm: its samples come one per cycle, from its first
        time on, until another segment takes over. What it holds ends at rest.
    lead : float
        How long after its state a segment begins to be commanded [s]: what planning and the way
        there and back take, in whole cycles.

    Returns
    -------
    int
        How many segments were written.

    Raises
    ------
    ProblemError
        `read` returns something else.
    """
    count = 0
    while (state := read()) is not None:
        if not isinstance(state, State):
            raise ProblemError(f"read() returned {type(state).__name__}, expected State or None")
        segment = replanner.step(
            state.t + lead,
            state.q,
            state.qd,
            state.path,
            state.obstacles,
            target=state.target,
            twist=state.twist,
            seen=state.seen,
        )
        write(segment)
        count += 1
    return count
