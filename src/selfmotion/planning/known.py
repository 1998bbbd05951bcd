"""What is known before planning, and what was proved in the end."""

from dataclasses import dataclass

from selfmotion.planning.finish import Finished
from selfmotion.planning.largest_part import LargestPart
from selfmotion.result import Plan
from selfmotion.search import SequenceGuide


@dataclass(frozen=True, eq=False)
class Known:
    """What is known before planning.

    Attributes
    ----------
    plan : Plan or None
        Of this problem or of one like it: tried first; where its motion will do, nothing else is.
    guide : SequenceGuide or None
        Likewise a motion that a search over the whole path has found.
    """

    plan: Plan | None = None
    guide: SequenceGuide | None = None


@dataclass(frozen=True, eq=False)
class Proved:
    """What the plan is made of: a motion along all of the path or a part of it, and its check.

    Attributes
    ----------
    part : LargestPart
    finished : Finished
    rival_cost : float or None
        That of the best motion from the sequences of the search, where it keeps the constraints.
    """

    part: LargestPart
    finished: Finished
    rival_cost: float | None = None
