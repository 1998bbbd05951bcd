"""Solution: the best motion that was found from one initial guess."""

from dataclasses import dataclass, replace

from selfmotion.basics import Flags
from selfmotion.model.motion import Evaluation
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.outcomes import NodeOutcome, Outcome


@dataclass(frozen=True, eq=False)
class Solution:
    """The best motion so far from one initial guess; made by `solve`.

    Attributes
    ----------
    guess : Guess
    outcome : Outcome
        The motion.
    history : tuple of Iteration
    ended : Status or None
        What ended the optimisation from outside.
    is_hopeless : bool
        Whether it ended because another motion is known that costs less.
    """

    guess: Guess
    outcome: Outcome
    history: tuple[Iteration, ...] = ()
    ended: Status | None = None
    is_hopeless: bool = False

    @classmethod
    def of(cls, guess: Guess) -> "Solution":
        """Return the minimum-norm motion of a guess, before anything is found."""
        return cls(guess, guess.minimum_norm)

    @property
    def on_nodes(self) -> NodeOutcome | None:
        """The motion if it is one on nodes; None before one is found, and of others."""
        return self.outcome if isinstance(self.outcome, NodeOutcome) else None

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended all of them."""
        return self.outcome.status if self.ended is None else self.ended

    @property
    def cut_short(self) -> bool:
        """Whether the user wants no more."""
        return self.status.is_cut_short

    @property
    def is_spent(self) -> bool:
        """Whether nothing more is to be evaluated."""
        return self.cut_short or self.status is Status.MAX_EVALUATIONS

    @property
    def violations(self) -> tuple[str, ...]:
        """What is wrong, for each constraint that the motion violates."""
        return self.outcome.violations

    @property
    def will_do(self) -> bool:
        """Whether the motion keeps all constraints, and keeps the arm off itself."""
        return not self.violations and self.outcome.keeps_off_itself

    def ended_by(self, status: Status) -> "Solution":
        """Return the motion as it is; there is no time for another one."""
        return replace(self, ended=status)

    @property
    def evaluation(self) -> Evaluation:
        """The motion with its costs."""
        return self.outcome.evaluation

    @property
    def minimum_norm_evaluation(self) -> Evaluation:
        """The minimum-norm motion, on the grid of this one where that has one."""
        return self.outcome.minimum_norm_evaluation or self.guess.minimum_norm.evaluation

    def score(self) -> tuple[bool, bool, float]:
        """Return the sort key of motions, the smaller, the better.

        Whether constraints are violated, whether the arm meets itself, which would be refused in
        the end, and the cost. Of two that violate constraints, the one that does so less is nearer
        to a motion.
        """
        if self.violations:
            return True, False, self.outcome.merit()
        return False, not self.outcome.keeps_off_itself, self.outcome.cost

    def refined(self, where: Flags | None = None) -> "Solution":
        """Return it with half the step length, everywhere or for some of the steps (N,)."""
        return replace(self, outcome=self.outcome.refined(where))


def have_one_start(one: Solution, other: Solution) -> bool:
    """Whether two solutions are of one initial guess."""
    return one.guess.minimum_norm.motion is other.guess.minimum_norm.motion


def is_chain(solution: Solution) -> bool:
    """Whether a motion is a chain of the search, which is at its optimum."""
    return solution.on_nodes is not None and solution.on_nodes.is_chain
