"""State of one plan while it is made."""

import time
from collections import abc
from dataclasses import dataclass, field, replace

import numpy as np

from selfmotion.basics import Array, BreakdownError, SelfmotionError
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.judging import Judged
from selfmotion.planning.planner.screening import Ranking
from selfmotion.planning.planner.setup import Setup
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.planner.solve import solve
from selfmotion.planning.result import Attempt
from selfmotion.planning.rollout import Guide
from selfmotion.planning.search import Obstruction, Reach, Sequence, reachable


@dataclass(eq=False)
class Planner:
    """State of one plan while it is made; the steps of `steps.py` change it.

    Attributes
    ----------
    setup : Setup
    effort : Effort
        Options of all optimisations.
    attempts : list of Attempt
        Proposals so far, in order.
    began : float
        When, by the clock `time.perf_counter` [s].
    blocked : Obstruction or None
        A pose that no configuration was found for.
    incumbent : Solution or None
        The best so far.
    runner_up : Solution or None
        The best one before it.
    broken : list of Solution
        Those that violate something.
    sequences : list of Sequence
        Results of the global search; empty without one, or if it failed.
    rival : Solution or None
        The best motion from these. It is not chosen where the start is given or the search local,
        and only compared with.
    stops, advice : str
        The obstruction of a motion that is not verified, and remedies, in words; empty if unknown.
    failure : SelfmotionError or None
        The last cause of having no motion, if there is none.
    notes : list of str
        Causes of failed searches, and remedies.
    waiting : sequence of Guess
        Complete motions that are not optimised yet.
    ranking : Ranking or None
        Rough motions of starts.
    judged : Judged or None
        The judged content of the plan.
    """

    setup: Setup
    effort: Effort
    attempts: list[Attempt] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)
    blocked: Obstruction | None = None
    incumbent: Solution | None = None
    runner_up: Solution | None = None
    broken: list[Solution] = field(default_factory=list)
    sequences: list[Sequence] = field(default_factory=list)
    rival: Solution | None = None
    failure: SelfmotionError | None = None
    stops: str = ""
    advice: str = ""
    notes: list[str] = field(default_factory=list)
    waiting: abc.Sequence[Guess] = ()
    ranking: Ranking | None = None
    judged: Judged | None = None

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.setup.search.rng)
        self._reaches: dict[float, Reach] = {}

    @property
    def formulation(self) -> Formulation:
        """The problem, with its tolerances as virtual joints."""
        return self.setup.formulation

    @property
    def is_over(self) -> bool:
        """Whether the user wants no more."""
        return self.incumbent is not None and self.incumbent.cut_short

    @property
    def is_sought(self) -> bool:
        """Whether a motion is still sought."""
        return self.judged is None and not self.is_over

    @property
    def is_unmet(self) -> bool:
        """Whether no motion so far satisfies all constraints that are kept."""
        best = self.incumbent
        return best is None or (self.effort.keeps_conditions and not best.will_do)

    def guess(
        self,
        start: Array,
        *,
        free: bool,
        guide: Guide | None = None,
        grid: Grid | None = None,
        motion: Trajectory | None = None,
    ) -> Guess | None:
        """Return the guess from a start, see `Guess.of`; None where it breaks down at once.

        That is noted. `motion` is one that is known, to begin near.
        """
        given = self.formulation, self.effort, start
        try:
            found = Guess.of(*given, free=free, guide=guide, grid=grid)
        except BreakdownError as error:
            self.failure = error
            return None
        return found if motion is None else found.near(motion)

    def take(self, given: Guess | Solution, *, chosen: bool = True) -> Solution:
        """Optimise from a guess, or a solution; keep it if it is the best and may be chosen."""
        best, cost_to_beat = self.incumbent, np.inf
        # Comparisons are optimised to the end.
        if chosen and best is not None and best.will_do:
            cost_to_beat = best.outcome.cost
        try:
            found = solve(given, cost_to_beat)
        except KeyboardInterrupt:
            begun = Solution.of(given) if isinstance(given, Guess) else given
            found = begun.ended_by(Status.INTERRUPTED)
        if found.is_hopeless:
            return found
        if chosen:
            self.consider(found)
            self.broken += [found] if found.violations else []
        if found.violations and found.guess.effort.apart:
            # Later solutions have self-collision as a constraint at once.
            self.effort = found.guess.effort
        if found.cut_short:
            self.end(found.status)
        return found

    def end(self, status: Status) -> None:
        """Take the best motion so far as it is, if there is one."""
        before, judged = self.incumbent, self.judged
        if before is None:
            return
        self.incumbent = before.ended_by(status)
        if judged is not None and judged.part.solution is before:
            self.judged = replace(judged, part=replace(judged.part, solution=self.incumbent))

    def consider(self, solution: Solution) -> None:
        """Keep a solution if it is the best one."""
        if self.incumbent is None or solution.score() < self.incumbent.score():
            self.incumbent, self.runner_up = solution, self.incumbent

    def reach(self, suspect: float = 0.0) -> Reach:
        """Return the extent to which single poses are reachable, with more poses about a time [s].

        That is left out where something is known to be beyond.
        """
        for known in self._reaches.values():
            if known.reason:
                return known
        if suspect not in self._reaches:
            own = self.setup
            own.progress("checking reach", 1, 1)
            rng = np.random.default_rng(own.search.rng)
            found = reachable(self.formulation, own.search.starts, rng, suspect)
            self._reaches[suspect] = found
        return self._reaches[suspect]

    def is_out_of_reach(self) -> bool:
        """Whether no start led anywhere because the path leaves the workspace."""
        if self.incumbent is not None:
            return bool(self.incumbent.violations) and bool(self.reach().reason)
        failure = self.failure
        return isinstance(failure, BreakdownError) and bool(self.reach(failure.time).reason)

    def interrupted(self) -> None:
        """Make the best that is known the outcome; raise KeyboardInterrupt where nothing is."""
        if self.incumbent is None and not self.waiting:
            ranked = [] if self.ranking is None else self.ranking.ranked[:1]
            begun = (
                self.guess(motion.place.q[0], free=self.setup.is_free, motion=motion.trajectory)
                for motion in ranked
            )
            self.waiting = [guess for guess in begun if guess is not None]
        for guess in self.waiting if self.incumbent is None else ():
            self.consider(Solution.of(guess).ended_by(Status.INTERRUPTED))
        if self.incumbent is None:
            raise KeyboardInterrupt
        self.end(Status.INTERRUPTED)
