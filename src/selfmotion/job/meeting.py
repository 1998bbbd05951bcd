"""What plans meet of what stands there."""

from selfmotion.basics import Array
from selfmotion.certificate import FinishedMotion
from selfmotion.collision import Obstacle
from selfmotion.job.seam import Seam
from selfmotion.job.work import Asked
from selfmotion.result import Plan

# What stands there, by name.
Standing = dict[str, Obstacle]


class Meeting:
    """Looks at what plans meet, at each plan and body once.

    Parameters
    ----------
    asked : Asked
    """

    def __init__(self, asked: Asked) -> None:
        self._asked = asked
        # What plans are known to keep clear of.
        self._clear: dict[Plan, set[str]] = {}

    def is_near(self, q: Array, *bodies: Obstacle) -> bool:
        """Whether the arm at q (n,) is nearer to one of some bodies than it may be."""
        apart = self._asked.apart(bodies)
        return apart is not None and bool(
            apart.model(self._asked.robot).distance(q).value < apart.distance
        )

    def met(self, plan: Plan, past: Standing) -> tuple[set[str], str]:
        """Return what of all that stands there a plan meets, and how it meets the first."""
        asked = self._asked
        clear = self._clear.setdefault(plan, set())
        met, why = set[str](), ""
        while new := {n: item for n, item in past.items() if n not in clear and n not in met}:
            apart = asked.apart(tuple(new.values()))
            motion = FinishedMotion(asked.robot, plan.trajectory)
            found = None if apart is None else apart.requirement(asked.robot).judge(motion)
            if found is None or found.satisfied:
                clear |= set(new)
                break
            why = why or found.text
            # What is not named may be any of them.
            met |= {name for name in found.subject.split(" - ") if name in new} or set(new)
        return met, why


def without(standing: Standing, *seams: Seam | None) -> Standing:
    """Return what stands there but for what seams may meet."""
    may = {name for seam in seams if seam is not None for name in seam.may_meet}
    return {name: item for name, item in standing.items() if name not in may}
