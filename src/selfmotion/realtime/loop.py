"""The loop around a replanner: states in, segments out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from selfmotion.basics import ProblemError
from selfmotion.model.path import Line, Path
from selfmotion.model.task import SE3
from selfmotion.realtime.replanner import Replanner
from selfmotion.realtime.segment import Segment

# Steps until all kernels are compiled: the first ones start a plan, the others shift it.
_WARM_UP_STEPS = 5


@dataclass(frozen=True, eq=False)
class State:
    """Measurements at a step.

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
    chunk, times : optional
        In place of both.
    """

    t: float
    q: npt.ArrayLike
    qd: npt.ArrayLike
    path: Path | None = None
    obstacles: Mapping[str, SE3] = field(default_factory=dict)
    target: SE3 | npt.ArrayLike | None = None
    twist: npt.ArrayLike | None = None
    seen: float | None = None
    chunk: Sequence[SE3] | npt.ArrayLike | None = None
    times: npt.ArrayLike | None = None


def follow(
    replanner: Replanner,
    read: Callable[[], State | None],
    write: Callable[[Segment], None],
    *,
    lead: float = 0.0,
) -> int:
    """Plan a segment for each state that is read, and write it, until there is none.

    Parameters
    ----------
    replanner : Replanner
        With ``latency`` no less than `lead`.
    read : callable
        Waits for the next state, about a period later, and returns it; None ends the loop.
    write : callable
        Sends a segment to the controller: its samples are commanded one per cycle, from its first
        time on, until another segment replaces it. Each ends at rest.
    lead : float
        Time from its state to the start of a segment [s]: for planning and communication, in whole
        cycles.

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
            # A target without a time was seen when the state was.
            seen=state.t if state.seen is None and state.target is not None else state.seen,
            chunk=state.chunk,
            times=state.times,
        )
        write(segment)
        count += 1
    return count


def warm_up(replanner: Replanner) -> None:
    """Compile and load all kernels of a replanner, so that no later step waits for them.

    Kernels are compiled once per machine and loaded once per process, which takes seconds where
    the first step of a moving arm would wait for it.

    Parameters
    ----------
    replanner : Replanner
        The one to be used, before its first step.
    """
    robot = replanner.robot
    q = robot.dexterous_configuration(replanner.task)
    pose = robot.pose(q)
    later = SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.01]))
    far = SE3(pose.rotation, pose.translation + 10.0 * robot.reach)
    zero = np.zeros(robot.dof)
    # On the path, then without a state, then towards an unreachable pose.
    for goal, measured in ((later, q), (later, np.full(robot.dof, np.nan)), (far, q)):
        replanner.reset()
        path = Line(pose, goal, 1.0)
        replanner.step(0.0, q, zero, path)
        for k in range(1, _WARM_UP_STEPS):
            replanner.step(k * replanner.period, measured, zero, path)
    replanner.reset()
