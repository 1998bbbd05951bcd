"""How to search where the start is free."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import as_choice, as_whole, random_numbers

_MODES = ("auto", "local", "global")


@dataclass(frozen=True)
class Search:
    """Where motions begin, when the start is free.

    Parameters
    ----------
    starts : int
        So many at most: for redundancy 1 along all self-motions of the first pose, else what
        Newton's method finds from twice as many seeds.
    finalists : int
        How many starts are optimised to the end, at most: those with the best rough optima on few
        nodes. With as many as `starts`, starts are not screened.
    mode : {"auto", "local", "global"}
        Optimise from many starts (local), or from the best sequences over all self-motions: sampled
        evenly where the redundancy is 1 (`best_sequences`), at random where it is more
        (`sampled_sequences`). ``"auto"``: from many starts first, and from
        sequences where none of them leads to a motion that keeps the constraints.
    compare : bool
        Search globally whatever the other search finds, also where the start is given, so that
        `Report.gap` tells how far the plan is from the best motion of all. Needs redundancy 1.
    rng : Generator or int
        Shifts the seeds; the same one gives the same plan.

    Raises
    ------
    ProblemError
        A number is below 1, or the mode unknown.
    """

    starts: int = 48
    finalists: int = 3
    mode: str = "auto"
    compare: bool = False
    rng: np.random.Generator | int = 0

    def __post_init__(self) -> None:
        for name in ("starts", "finalists"):
            as_whole(getattr(self, name), f"search: {name}", 1, 10**6)
        as_choice(self.mode, "search: mode", _MODES)
        random_numbers(self.rng)
