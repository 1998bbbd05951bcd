"""A plan in several parts, with changes of configuration in between."""

from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path as FilePath

from selfmotion.basics import FileFormatError, PlanError, SelfmotionError, as_path
from selfmotion.certificate import USUAL, Tolerance, first_of
from selfmotion.motion import Trajectory, joined_motions
from selfmotion.problem import Problem, problem_from_dict, problem_to_dict
from selfmotion.result.bundle import read_bundle, write_bundle
from selfmotion.result.move import Move
from selfmotion.result.parts_asked import PartsAsked
from selfmotion.result.plan import Plan, reached_text
from selfmotion.robot import RobotModel

# Raised with every change that older versions cannot read.
_FORMAT = 1


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
    altered : str
        Why the file that they were read from is not the one that was written; "" where it is.
    tolerance : Tolerance
        What each of the plans may miss the path by.
    """

    problem: Problem
    plans: tuple[Plan, ...]
    moves: tuple[Move, ...] = ()
    cuts: tuple[float, ...] = ()
    endings: tuple[str, ...] = ()
    altered: str = ""
    tolerance: Tolerance = USUAL

    def __repr__(self) -> str:
        """Return a few lines: the parts, where they are cut and why, and the verdict."""
        lines = [f"Parts({self.problem!r}, {len(self.plans)} with {len(self.moves)} moves)"]
        lines += [
            f"  cut at t = {cut:.6g} s: {ending}"
            for cut, ending in zip(self.cuts, self.endings, strict=False)
        ]
        return "\n".join([*lines, f"  {self.verdict}"])

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.problem.robot

    @property
    def verified(self) -> bool:
        """Whether the parts are what was asked for, and everything is kept at all times."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, and how near to the path; or what is wrong with which of them."""
        if self.verified:
            return (
                f"verified at all times: {len(self.plans)} part{'s' * (len(self.plans) != 1)}, and "
                f"all moves in between; {reached_text(self.plans, self.tolerance)}"
            )
        return f"not verified: {'; '.join(self.failures)}"

    @property
    def summary(self) -> str:
        """The verdict in short: of what is wrong the first."""
        return self.verdict if self.verified else first_of(self.failures)

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """What speaks against them; empty for verified ones."""
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
        altered = [self.altered] if self.altered else []
        return (*altered, *parts, *moves, *PartsAsked(self).failures())

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

    def save(self, file: str | FilePath) -> None:
        """Write all parts and moves to one file that `load_parts` reads; atomically.

        Raises
        ------
        PlanError
            A move was not found.
        """
        description = {
            "problem": problem_to_dict(self.problem),
            "tolerance": asdict(self.tolerance),
            "cuts": list(self.cuts),
            "endings": list(self.endings),
            **({"altered": self.altered} if self.altered else {}),
        }
        for number, move in enumerate(self.moves, 1):
            if move.trajectory is None:
                raise PlanError(f"move {number} was not found: {move.trouble}")
        write_bundle(as_path(file), "parts", _FORMAT, description, [*self.plans, *self.moves])


def load_parts(file: str | FilePath) -> Parts:
    """Read parts that `Parts.save` wrote, and judge all of them anew.

    A file that was changed is never verified.

    Raises
    ------
    FileFormatError
        The file is missing, holds no parts, lacks something, or was written by another version.
    """
    path = as_path(file)
    description, made, changed = read_bundle(path, "parts", _FORMAT)
    try:
        problem = problem_from_dict(description["problem"])
        cuts = tuple(map(float, description["cuts"]))
        endings = tuple(map(str, description["endings"]))
        # Files of before say none: then it is the usual one.
        tolerance = Tolerance(**description.get("tolerance", {}))
        altered = str(description.get("altered", ""))
    except (KeyError, TypeError, ValueError, SelfmotionError) as error:
        raise FileFormatError(f"{path}: are damaged parts: {error!r}") from error
    plans = tuple(item for item in made if isinstance(item, Plan))
    moves = tuple(item for item in made if isinstance(item, Move))
    if changed:
        altered = f"{path.name} was changed after the parts were written"
    return Parts(problem, plans, moves, cuts, endings, altered, tolerance)
