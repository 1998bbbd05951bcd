"""What a plan is made from, and what that asks for."""

from dataclasses import dataclass

from selfmotion.basics import Progress
from selfmotion.certificate import Tolerance
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.effort import Search
from selfmotion.planning.result import Plan
from selfmotion.planning.search import Sequence


@dataclass(frozen=True, eq=False)
class Setup:
    """What a plan is made from.

    Attributes
    ----------
    formulation : Formulation
        The problem, with its tolerances as virtual joints.
    search : Search
    tolerance : Tolerance
    progress : Progress
    warm_start : Plan or None
        Of this problem or of one like it: tried first; where its motion will do, nothing else is.
    guide : Sequence or None
        Likewise a motion that a search over the whole path has found.
    """

    formulation: Formulation
    search: Search
    tolerance: Tolerance
    progress: Progress
    warm_start: Plan | None = None
    guide: Sequence | None = None

    @property
    def is_free(self) -> bool:
        """Whether the start is free."""
        return self.formulation.given_start is None

    @property
    def has_motion(self) -> bool:
        """Whether there is an initial motion."""
        return self.warm_start is not None or self.guide is not None

    @property
    def is_searchable(self) -> bool:
        """Whether there is a self-motion to search."""
        return self.formulation.follows.redundancy > 0

    @property
    def chooses_globally(self) -> bool:
        """Whether results of the global search may be chosen, and are not only compared."""
        return self.is_free and self.search.mode != "local"

    @property
    def takes_starts(self) -> bool:
        """Whether starts are drawn."""
        only_global = self.search.mode == "global" and self.is_searchable
        return self.is_free and not only_global
