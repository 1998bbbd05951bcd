"""A closed loop with a simulated arm, recorded."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import Path
from selfmotion.model.task import SE3
from selfmotion.realtime.loop import State, follow
from selfmotion.realtime.record import Record
from selfmotion.realtime.replanner import Replanner
from selfmotion.realtime.segment import Segment
from selfmotion.realtime.simulated_arm import SimulatedArm


class Scene(Protocol):
    """Events around the arm; all times [s]."""

    def path(self, t: float) -> Path:
        """Return the tool's motion, as it is known at a time."""

    def obstacles(self, t: float) -> Mapping[str, SE3]:
        """Return the poses of obstacles at a time."""

    def pushed(self, t: float) -> Array:
        """Return the external displacement of the arm from its command, (n,) [rad or m]."""


def track(replanner: Replanner, arm: SimulatedArm, scene: Scene, seconds: float) -> Record:
    """Simulate the loop of a replanner and an arm for a duration.

    Time stops during a step: `Record.seconds` has the steps' durations.

    Parameters
    ----------
    replanner : Replanner
    arm : SimulatedArm
    scene : Scene
        Path, obstacles and pushes.
    seconds : float
        Duration in the arm's time [s].
    """
    recorder = _Recorder(replanner, arm, scene, seconds)
    follow(replanner, recorder.read, recorder.write)
    return recorder.record()


class _Recorder:
    """Reads and commands a simulated arm, and records both."""

    def __init__(
        self, replanner: Replanner, arm: SimulatedArm, scene: Scene, seconds: float
    ) -> None:
        self._replanner, self._arm, self._scene = replanner, arm, scene
        self._last_time = seconds - 0.5 * replanner.period
        self._times: list[float] = []
        self._positions: list[Array] = []
        self._targets: list[SE3] = []
        self._errors: list[tuple[float, float]] = []
        self._durations: list[float] = []
        self._flags: Counter[str] = Counter()
        self._reasons: Counter[str] = Counter()
        # When the present step began, by the clock.
        self._step_began = 0.0

    def read(self) -> State | None:
        """Return the measured state of the arm; None at the end."""
        arm, scene, replanner, t = self._arm, self._scene, self._replanner, self._arm.t
        if t > self._last_time:
            return None
        arm.pushed = scene.pushed(t)
        path = scene.path(t)
        target = path.pose(min(t, path.duration))
        self._times.append(t)
        self._positions.append(arm.q.copy())
        self._targets.append(target)
        self._errors.append(replanner.task.miss(target, replanner.robot.pose(arm.q)))
        state = State(t, *arm.measure(), path, scene.obstacles(t))
        self._step_began = time.perf_counter()
        return state

    def write(self, segment: Segment) -> None:
        """Command a segment, and let a period pass."""
        self._durations.append(time.perf_counter() - self._step_began)
        self._flags[segment.flag.value] += 1
        self._reasons.update(reason.split(":")[0] for reason in segment.reasons)
        self._arm.write(segment)
        self._arm.run(self._replanner.period)

    def record(self) -> Record:
        """Return what was recorded."""
        return Record(
            np.array(self._times),
            np.array(self._positions),
            tuple(self._targets),
            np.array(self._errors),
            np.array(self._durations),
            self._flags,
            self._reasons,
            np.array(self._arm.commanded),
        )
