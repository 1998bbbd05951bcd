"""A plan in several parts, with changes of configuration in between."""

from dataclasses import dataclass
from itertools import accumulate

from selfmotion.basics import PlanError
from selfmotion.motion import Trajectory, joined_motions
from selfmotion.problem.problem import Problem
from selfmotion.result.move import Move
from selfmotion.result.plan import Plan
from selfmotion.robot import RobotModel


@dataclass(frozen=True, eq=False)
class Parts:
    """A motion along a path with as few changes of configuration as were found to be needed.

    Attributes
    ----------
    problem : Problem
        What was asked for, of the whole path.
    plans : tuple of Plan
        One for each part of the path, in order, each with a problem of its own.
    moves : tuple of Move
        From the end of each part to the start of the next, and back to the first one's start where
        the path has to be closed and its motion is not.
    cuts : tuple of float
        Where on the path each part but the last ends, and the next begins [s].
    endings : tuple of str
        Why each part but the last goes no further.
    """

    problem: Problem
    plans: tuple[Plan, ...]
    moves: tuple[Move, ...] = ()
    cuts: tuple[float, ...] = ()
    endings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return a few lines: the parts, where they are cut and why, and the verdict."""
        lines = [f"Parts({self.problem!r}, {len(self.plans)} with {len(self.moves)} moves)"]
        lines += [
            f"  cut at t = {cut:.6g} s: {ending}"
            for cut, ending in zip(self.cuts, self.endings, strict=True)
        ]
        return "\n".join([*lines, f"  {self.verdict}"])

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.problem.robot

    @property
    def verified(self) -> bool:
        """Whether all parts are verified plans, and all moves were found and keep everything."""
        return not self._failures

    @property
    def verdict(self) -> str:
        """One line: verified, or what is wrong with which part or move."""
        if self.verified:
            return "verified: all parts, and all moves in between"
        return f"not verified: {'; '.join(self._failures)}"

    @property
    def _failures(self) -> list[str]:
        parts = [
            f"part {number}: {plan.certificate.verdict}"
            for number, plan in enumerate(self.plans, 1)
            if not plan.certificate.verified
        ]
        moves = [
            f"move {number}: {move.trouble}"
            for number, move in enumerate(self.moves, 1)
            if not move.verified
        ]
        return parts + moves

    @property
    def trajectory(self) -> Trajectory:
        """All parts and moves as one motion from t = 0 on.

        Raises
        ------
        PlanError
            A move was not found.
        """
        return joined_motions(self._motions)

    @property
    def begins(self) -> tuple[float, ...]:
        """When each part begins in `trajectory` [s].

        Raises
        ------
        PlanError
            A move was not found.
        """
        durations = [motion.duration for motion in self._motions]
        # Motions are parts and moves by turns.
        return tuple(accumulate(durations[:-1], initial=0.0))[::2]

    @property
    def _motions(self) -> list[Trajectory]:
        motions = []
        for number, plan in enumerate(self.plans):
            motions.append(plan.trajectory)
            if number < len(self.moves):
                move = self.moves[number]
                if move.trajectory is None:
                    raise PlanError(f"move {number + 1} was not found: {move.trouble}")
                motions.append(move.trajectory)
        return motions

    def require(self) -> "Parts":
        """Return the parts themselves if all of them, and all moves, are verified.

        Raises
        ------
        PlanError
            They are not; the message is the verdict.
        """
        if not self.verified:
            raise PlanError(f"{self.problem.robot.name}: {self.verdict}")
        return self
