"""What an earlier program of a job, or of one like it, knows: motions of its seams, and ways."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.job.program import Program
from selfmotion.job.seam import Seam, waiting
from selfmotion.motion import Trajectory
from selfmotion.planning import check_joints
from selfmotion.result import Move, Plan
from selfmotion.robot import RobotModel

# A move whose ends are farther away than this in all [rad or m] tells nothing.
_NEAR = 1.5
# An old way is told by its corners: so many looks at it, from which straight legs differ by less
# than this [rad or m].
_LOOKS, _STRAIGHT = 65, 0.02


@dataclass(frozen=True, eq=False)
class Earlier:
    """What an earlier program knows.

    Parameters
    ----------
    program : Program
    """

    program: Program

    @cached_property
    def _of_seams(self) -> dict[str, tuple[Plan, bool]]:
        steps = self.program.steps
        return {
            step.name: (step.made, step.turned) for step in steps if isinstance(step.made, Plan)
        }

    def plan_of(self, seam: Seam) -> tuple[Plan, bool] | None:
        """Return the plan of a seam by its name, and whether it is turned; None for none."""
        plan, turned = self._of_seams.get(seam.name, (None, False))
        return None if plan is None or (turned and not seam.either_way) else (plan, turned)

    def order_of(self, seams: Sequence[Seam]) -> list[Seam] | None:
        """Return seams in its order, where it made these and no others and they may come so."""
        named, made = {seam.name: seam for seam in seams}, self.program.order
        if sorted(made) != sorted(named):
            return None
        listed = [named[name] for name in made]
        return listed if waiting(listed).keeps(range(len(listed))) else None

    def move_like(self, ends: Array) -> Move | None:
        """Return the move whose ends are nearest to others (2, n), or None for none near."""
        found = [move for move in self.program.moves if _leads_somewhere(move)]
        far = [_apart(move.motion.q[[0, -1]], ends) for move in found]
        k = int(np.argmin(far)) if far else -1
        return found[k] if k >= 0 and far[k] < _NEAR else None


def check_earlier(earlier: object, robot: RobotModel) -> None:
    """Raise ProblemError where an earlier program is none, or one of another arm."""
    if not isinstance(earlier, Program):
        raise ProblemError(
            f"warm_start is {shown(earlier)}, expected a Program; load_program reads one"
        )
    check_joints(earlier.robot, robot)


def way_along(motion: Trajectory, ends: Array) -> Array:
    """Return the corners (m, n) of a motion whose ends are put elsewhere, (2, n).

    What one end is moved by fades out towards the other one.
    """
    q = motion(np.linspace(motion.t[0], motion.t[-1], _LOOKS))
    gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    share = (gone / gone[-1])[:, None] if gone[-1] > 0.0 else np.linspace(0.0, 1.0, _LOOKS)[:, None]
    way = q + (1.0 - share) * (ends[0] - q[0]) + share * (ends[1] - q[-1])
    return np.asarray(way[_corners(way, 0, _LOOKS - 1)])


def _corners(way: Array, first: int, last: int) -> list[int]:
    """Return which points of a way straight legs have to pass (Ramer, Douglas and Peucker)."""
    share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    legs = way[first] + share * (way[last] - way[first])
    off = np.abs(way[first : last + 1] - legs).max(axis=1)
    k = first + int(np.argmax(off))
    if off.max() <= _STRAIGHT:
        return [first, last]
    return [*_corners(way, first, k)[:-1], *_corners(way, k, last)]


def _leads_somewhere(move: Move) -> bool:
    """Whether it is a move that was found, not a wait."""
    motion = move.trajectory
    return motion is not None and float(np.abs(motion.q[-1] - motion.q[0]).max()) > 0.0


def _apart(ends: Array, others: Array) -> float:
    """Return how far two pairs of ends (2, n) are from each other in all [rad or m]."""
    return float(np.abs(ends - others).max(axis=1).sum())
