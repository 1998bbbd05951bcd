"""Report of a plan: how it was found, and a bound of its distance from the best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from selfmotion.certificate import Certificate
from selfmotion.model.motion import NullMotion
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.problem.constraints import ActiveConstraint

# Start of digests of costs that are functions, which are valid in one process.
FUNCTION = "function "


@dataclass(frozen=True)
class Gap:
    """Distance of a plan from the global optimum, by the search over self-motions.

    No bound: the search sees samples of the self-motions, and joint path lengths. So there are two
    comparisons, with different strengths. The costs are alike (same cost, same constraints, same
    optimiser), but that of the search is refined from a few of its sequences only. The lengths
    are of all sequences there are, but say little where the cost is another one.

    Attributes
    ----------
    cost : float
        F of the plan.
    best_cost : float or None
        F of the best motion refined from the sequences that the search found; None where none
        keeps the constraints.
    length : float
        Σ w|Δq| of the plan over waypoints and joints [rad], w being `RobotModel.joint_weights`.
    best_length : float
        That of the shortest sequence of configurations within the same limits, clearance and
        steps.
    spacing : float
        Distance of the samples of the self-motions [rad or m], configuration norm.
    sequences : int
        Number of different sequences that were refined.
    """

    cost: float
    best_cost: float | None
    length: float
    best_length: float
    spacing: float
    sequences: int

    @property
    def cost_excess(self) -> float | None:
        """The plan's cost above the best one, as a share; negative where the plan is better."""
        if self.best_cost is None or self.best_cost == 0.0:
            return None
        return (self.cost - self.best_cost) / abs(self.best_cost)

    @property
    def length_excess(self) -> float:
        """The plan's joint path above the shortest one, as a share."""
        return self.length / self.best_length - 1.0


@dataclass(frozen=True)
class Attempt:
    """One proposal for a plan, and the best motion after it.

    Attributes
    ----------
    name : str
        Such as "given start" or "global search"; the site's page "What is tried, in what order,
        and when it ends" has all of them.
    outcome : str
        The best motion after it, in words.
    cost : float or None
        F of that; None where there was no motion.
    seconds : float
        Wall time.
    """

    name: str
    outcome: str
    cost: float | None
    seconds: float


@dataclass(frozen=True, eq=False)
class Report:
    """History and quality of a plan.

    Attributes
    ----------
    cost, initial_cost : float
        F of the plan, and of the minimum-norm motion (q̇ = J⁺ẋ).
    terms, initial_terms : dict
        Contribution of each cost to them.
    evaluations, gradient_evaluations : int
        How often F and ∇F were computed, on all grids.
    jacobian_evaluations : int
        Number of evaluations of the frame Jacobian by Pinocchio.
    steps : int
        Runge-Kutta steps of the finest grid.
    iterations : int
        Of the optimiser.
    history : tuple of Iteration
        One per iteration, each grid's first being its start.
    status : Status
    message : str
        Meaning of the status, and a remedy.
    seconds : float
        Wall time of `plan`.
    gap : Gap or None
        Distance from the global optimum, after a global search.
    ending : str
        Why the motion ends before its path does; "" where it does not.
    active : tuple of ActiveConstraint
        The active constraints, the most expensive first.
    null_motion : NullMotion or None
        The parameterisation that the plan's coefficients are of; None for other works' methods.
    remaining : float or None
        An estimate of the possible decrease of F by any other null motion, within the constraints:
        by finer nodes and another step. Without the cost of smooth starts and stops of an arm at
        rest, some 0.1 % of F, and that of margins within limits. None of the published method,
        which has one kind of null motion.
    attempts : tuple of Attempt
        The strategies that were tried, in order; empty for other works' methods.
    motion : str
        Digest of the motion of costs, active constraints and other values; "" before the plan is
        made. `evaluated` is the report of another motion.
    initial_motion : str
        Digest of the minimum-norm motion that the initial costs are of.
    obstruction, remedy : str
        Of a motion that is not verified: the obstruction, and a remedy; "" if unknown.
    costs : dict
        The digest of each cost by its name; "" of one that is a function.
    """

    cost: float
    initial_cost: float
    terms: Mapping[str, float]
    initial_terms: Mapping[str, float]
    evaluations: int
    gradient_evaluations: int
    jacobian_evaluations: int
    steps: int
    iterations: int
    history: tuple[Iteration, ...]
    status: Status
    message: str
    seconds: float
    gap: Gap | None = None
    ending: str = ""
    active: tuple[ActiveConstraint, ...] = ()
    null_motion: NullMotion | None = None
    remaining: float | None = None
    attempts: tuple[Attempt, ...] = ()
    motion: str = ""
    costs: Mapping[str, str] | None = None
    initial_motion: str = ""
    obstruction: str = ""
    remedy: str = ""

    def evaluated(self, cost: float, terms: Mapping[str, float]) -> "Report":
        """Return the report of another motion or costs: without how it was found."""
        return replace(
            self,
            cost=cost,
            terms=dict(terms),
            message="motion or costs were put in the place of those that were planned",
            gap=None,
            active=(),
            remaining=None,
            obstruction="",
            remedy="",
        )

    def explained(self, certificate: Certificate) -> Certificate:
        """Return a certificate with the obstruction first, if the motion is not verified."""
        if certificate.verified:
            return certificate
        first, last = ((text,) if text else () for text in (self.obstruction, self.remedy))
        failures, notes = (*first, *certificate.failures), (*certificate.notes, *last)
        return replace(certificate, failures=failures, notes=notes)

    def with_found(self, before: "Report", active: Sequence[ActiveConstraint]) -> "Report":
        """Return it with the history of the same motion at another pace or in reverse."""
        return replace(
            self,
            message=before.message,
            gap=before.gap,
            remaining=before.remaining,
            active=tuple(active),
        )

    def __repr__(self) -> str:
        """Return one line: costs, effort and how it ended."""
        return (
            f"Report(cost {self.initial_cost:.6g} → {self.cost:.6g}, {self.iterations} iterations, "
            f"{self.evaluations} evaluations, {self.seconds:.3g} s: {self.status.value})"
        )
