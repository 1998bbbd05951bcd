"""The path that a replanner follows, at a pace that waits where the arm cannot keep up."""

from __future__ import annotations

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import Path
from selfmotion.model.robot import Kinematics
from selfmotion.model.task import SE3, Task
from selfmotion.realtime.chunks import Chunk, blend
from selfmotion.realtime.commands import Commands
from selfmotion.realtime.pace import LastPath, Pace, Sampled, Times
from selfmotion.realtime.reach import Reach
from selfmotion.realtime.reference import Approach
from selfmotion.realtime.settings import (
    CATCH_UP,
    JUMPED,
    RETREATS,
    RIGHT_AHEAD,
    STANDING,
    UNNOTICED,
)


class PacedPath:
    """A path at the times of a step, by a pace.

    Parameters
    ----------
    task : Task
        The prescribed rows.
    kinematics : Kinematics
    commands : Commands
        What is commanded: where the arm is, and the clock.
    pace : Pace
        Of the path's time, which the optimisation over the horizon changes.
    reach : Reach
    approach : Approach
        How chunks are joined to what is followed.
    times : (K,)
        Times of a step from now on [s]: the horizon, and then the cycles that are commanded.
    horizon_count : int
        Number of the times over the horizon.
    patience : float
        How long a path lasts that is not given again [s].

    Attributes
    ----------
    last : LastPath
        The last path without an error.
    is_held : bool
        Whether the tool did not follow its path at the last step.
    """

    def __init__(
        self,
        task: Task,
        kinematics: Kinematics,
        commands: Commands,
        pace: Pace,
        reach: Reach,
        approach: Approach,
        times: Array,
        horizon_count: int,
        patience: float,
    ) -> None:
        self._task, self._kinematics, self._commands = task, kinematics, commands
        self._pace, self._reach, self._approach = pace, reach, approach
        self._times, self._horizon_count = times, horizon_count
        self._weights = pace.weights(times)
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """Forget the last path, and follow the next one on time."""
        self.last = LastPath(self._patience)
        self.is_held = True
        # Whether the path leaves reach right ahead.
        self._leaves_reach = False
        # Number of segments in a row that were not proved.
        self._refusals = 0
        self._pace.reset()

    @property
    def delay(self) -> float:
        """By how much the tool is late on its path when the next segment starts [s]."""
        return self._pace.delay - self._commands.lead * (1.0 - float(self._pace.rates[0]))

    @property
    def is_on_time(self) -> bool:
        """Whether the path is followed by the clock."""
        return self._pace.is_on_time

    @property
    def is_waiting(self) -> bool:
        """Whether the tool waits on its path."""
        return bool(self._pace.rates[0] < STANDING and self._pace.delay > RIGHT_AHEAD)

    def go_on(self, seconds: float) -> None:
        """Let time pass [s]."""
        self._pace.shift(seconds)

    def hold_rates(self) -> None:
        """Let the path go on at the present rates until the next step, whatever is planned."""
        self._pace.command()

    def joined(self, chunk: Chunk, t: float, reasons: list[str]) -> Path:
        """Return a chunk joined to what is followed; alone where that fails, and add the reason.

        Both may be anything: their exceptions must not leave the arm without a command.
        """
        try:
            return blend(self.last.followed, chunk, t, self._approach)
        except Exception as error:
            reasons.append(f"the chunk is not joined: {type(error).__name__}: {error}")
            return chunk

    def target(
        self, path: Path | None, waited: float, age: float, reasons: list[str]
    ) -> Sampled | None:
        """Return the path at the times of a step, at its pace; None where there is none.

        Parameters
        ----------
        path : Path or None
            The path that is given at this step, if any.
        waited : float
            Time since the last step [s].
        age : float
            Age of the observation of a target [s].
        reasons : list of str
            Gets the reason where the last path takes its place.
        """
        pace = self._pace
        if not pace.is_on_time and self.last.jumps(path, self._path_times()):
            pace.reset()
        target = self.last.samples(path, self._path_times(), waited, age, reasons)
        if target is None or not target.along.any():
            pace.reset()
            return target
        if self.is_held and target.along[0].any():
            self._anchor(target, waited)
            target = self.again()
        if self._is_back_in_reach():
            pace.reset()
            target = self.again()
        return target

    def again(self) -> Sampled | None:
        """Return the last path at the times of the step, by its pace now."""
        return self.last.again(self._path_times())

    def retreat(self, target: Sampled, breakdown: float, retreats: int) -> bool:
        """Come to rest on the path before a motion breaks down; return whether that is of use.

        It is where the path has a pace, and is out of reach right after the breakdown: not where
        another motion could follow it.

        Parameters
        ----------
        target : Sampled
        breakdown : float
            When the motion breaks down, from now [s]; inf for never.
        retreats : int
            How often this was done at the present step.
        """
        if breakdown == np.inf or retreats == RETREATS or not target.along.any():
            return False
        horizon = self._times[: self._horizon_count]
        s = np.interp(breakdown, horizon, self._path_times().s[: self._horizon_count])
        self._leaves_reach = not self._reach.contains(self._poses(s + RIGHT_AHEAD))
        if self._leaves_reach:
            self._pace.retreat(breakdown)
        return self._leaves_reach

    def refuse(self, target: Sampled | None) -> None:
        """Follow a path more slowly after a segment that is not proved."""
        if target is not None and target.along.any():
            self._refusals += 1
            self._pace.slow_down(self._refusals)

    def accept(self) -> None:
        """Note that a segment is proved."""
        self._refusals = 0

    def _path_times(self) -> Times:
        """Return the times of a step, and those of the path then."""
        commands = self._commands
        return self._pace.times(
            commands.time + commands.lead + self._times, self._times, self._weights
        )

    def _anchor(self, target: Sampled, waited: float) -> None:
        """Let the path go on where the tool is, which was stopped or held back meanwhile."""
        commands, task, kinematics = self._commands, self._task, self._kinematics
        jacobian = kinematics.at(commands.place)
        tool = SE3(kinematics.rotation, kinematics.translation)
        goal = SE3(target.path.rotation[0], target.path.translation[0])
        twists = target.along[0], -task.twist_error(goal, tool), jacobian @ commands.rate
        # In the prescribed rows: the path's velocity, the tool's lead on it, and the tool's own.
        along, lead, velocity = (task.select(x[:, None], tool.rotation)[:, 0] for x in twists)
        size, distance = float(along @ along), np.abs(lead).max()
        rate_error = np.abs(velocity - self._pace.rates[0] * along).max()
        # Far from its path the tool approaches it, and a path that begins at rest is left to that.
        if size > 0.0 and max(distance, rate_error) > UNNOTICED and distance < JUMPED:
            most = (1.0 + CATCH_UP) * waited
            ahead = min(max(float(along @ lead) / size, -most), most)
            self._pace.anchor(ahead, float(along @ velocity) / size)

    def _is_back_in_reach(self) -> bool:
        """Return whether the tool waits where its path left reach, and the path is back there."""
        if self._pace.rates[0] >= STANDING or self._pace.delay < RIGHT_AHEAD:
            return False
        return self._leaves_reach and self._reach.contains(self._poses(self._commands.time))

    def _poses(self, *s: float) -> list[SE3]:
        """Return poses of the last path at times of its own; none where it fails."""
        target = self.last.again(Times(np.array(s), np.array(s), np.ones(len(s))))
        if target is None:
            return []
        pairs = zip(target.path.rotation, target.path.translation, strict=True)
        return [SE3(rotation, translation) for rotation, translation in pairs]
