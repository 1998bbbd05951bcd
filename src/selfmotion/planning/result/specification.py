"""What a plan has to satisfy besides its certificate: arm, path, task, constraints, tolerance."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from selfmotion.certificate import USUAL, Tolerance
from selfmotion.model.follow import Follow
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.planning.result.equality import (
    arm_differences,
    canonical_text,
    same_follows,
    same_path,
    same_relaxations,
)
from selfmotion.planning.result.plan import Plan
from selfmotion.problem.constraints import Clearance, Constraint, as_clearances, clearances_among
from selfmotion.problem.problem import Problem, arm_rest_orders


@dataclass(frozen=True, eq=False)
class MotionSpecification:
    """Specification of a motion along a path.

    A certificate says that a motion keeps the problem it was judged by. This says whether that
    problem is the one that is required.

    Attributes
    ----------
    robot : RobotModel
        With the tool that follows, in the frame of its reference.
    path : Path
    task : Task
    relaxations : sequence of Relaxation
    constraints : sequence of Constraint
        Required constraints, besides `clearance`.
    clearance : Clearance or sequence of Clearance, optional
        Smallest distance of bodies.
    tolerance : Tolerance
        Largest error from the path.
    also : sequence of Follow
        Further task frames.
    rest : bool
        Whether the arm has to rest where its paths do, unless `constraints` say how fast it is.
    """

    robot: RobotModel
    path: Path
    task: Task
    relaxations: Sequence[Relaxation] = ()
    constraints: Sequence[Constraint] = ()
    clearance: Clearance | Sequence[Clearance] | None = None
    tolerance: Tolerance = USUAL
    also: Sequence[Follow] = ()
    rest: bool = True

    def failures(self, plan: Plan) -> Iterator[str]:
        """Yield, in words, the conditions that a plan was not judged by."""
        problem = plan.problem
        yield from arm_differences(problem.robot, self.robot)
        if problem.task is not self.task:
            yield f"its task is '{problem.task.value}', not '{self.task.value}'"
        if not same_path(problem.path, self.path):
            yield "it is along another path"
        if not same_follows(problem.also, self.also):
            yield "what else follows a path is another"
        if not same_relaxations(problem.relaxations, self.relaxations):
            yield "other rows are relaxed"
        clearances = as_clearances(self.clearance)
        yield from missing_constraints(problem.all_constraints, self.constraints, clearances)
        yield from self._rest_failures(problem)
        tolerance, required = plan.tolerance, self.tolerance
        if not (
            tolerance.position <= required.position and tolerance.rotation <= required.rotation
        ):
            yield (
                f"it is judged within {tolerance.position:.2g} m and {tolerance.rotation:.2g} rad, "
                f"expected {required.position:.2g} m and {required.rotation:.2g} rad"
            )

    def _rest_failures(self, problem: Problem) -> Iterator[str]:
        """Yield that a plan's problem does not require rest at an end where it is required."""
        required = arm_rest_orders(problem.follows, self.constraints) if self.rest else (0, 0)
        # A damped motion is not judged by its rest.
        judged = problem.rest_orders if problem.damping is None else (0, 0)
        for end, order, judged_order in zip(("start", "end"), required, judged, strict=True):
            if judged_order < order:
                what = " without acceleration" if judged_order else ""
                yield f"it is not judged by rest{what} at its {end}, which was asked for"


def missing_constraints(
    judged: Sequence[Constraint],
    required: Sequence[Constraint],
    clearances: Sequence[Clearance] = (),
) -> Iterator[str]:
    """Yield required constraints and clearances by which a motion is not judged."""
    known = {canonical_text(item) for item in judged}
    for item in required:
        if canonical_text(item) not in known:
            yield f"it is not judged by {type(item).__name__}, which was asked for"
    judged_clearances = clearances_among(judged)
    for clearance in clearances:
        if not any(item.keeps_as_far(clearance) for item in judged_clearances):
            yield "it is not judged by the clearance that was asked for"
