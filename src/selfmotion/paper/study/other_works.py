"""Other works, side by side, on the sample problem and on a Panda circle."""

from dataclasses import replace

import numpy as np

from selfmotion.basics import BreakdownError
from selfmotion.model.motion import PolynomialNullMotion
from selfmotion.model.path import Circle
from selfmotion.model.robot import NAMED_ARMS, load_robot
from selfmotion.paper.baselines import (
    DampedLeastSquares,
    ExtendedJacobian,
    GradientProjection,
    LagrangianOptimum,
    Method,
    PseudoInverse,
    plan_by,
)
from selfmotion.paper.study.context import Context
from selfmotion.paper.study.results import Chapter, Claim, Table, Verdict
from selfmotion.planning.planner import plan
from selfmotion.planning.result import Plan
from selfmotion.problem.costs import InverseManipulability, JointVelocity
from selfmotion.problem.problem import Problem, sample_problem

_COLUMNS = (
    "method",
    "cost",
    "peak joint speed [rad/s]",
    "smallest singular value",
    "path error [m]",
    "end to start [rad]",
    "motions evaluated",
    "Jacobians",
    "time [s]",
    "check",
)

# Relative agreement of two optima: four digits.
_AGREEMENT = 1e-4


def other_works(context: Context) -> Chapter:
    """Return the table for each problem, and the claims about other works."""
    sample = sample_problem()
    tables = [_table("Sample problem (free end)", sample, cyclic=False)]
    if context.scale.closed_paths:
        there_and_back = sample_problem(duration=2.0)
        tables.append(_table("Sample problem, there and back", there_and_back, cyclic=True))
        tables.append(_table("Panda, circle of 0.15 m, pose task", panda_circle(), cyclic=True))
    return Chapter(
        "others",
        "Other works, side by side",
        (
            "Each method is used through plan(problem, method=…) and certified by the same code. "
            "Gradient projection has its gain tuned by a search on the same cost: its motions "
            "evaluated are whole integrations. The extended Jacobian starts off its stationary "
            "pose, is drawn onto it, and breaks down where its square matrix is singular.",
        ),
        tables=tuple(tables),
        claims=(_agreement(context), _local_methods(tables[0])),
    )


def panda_circle() -> Problem:
    """Return a Panda on a vertical circle of 0.15 m in 4 s, all six rows prescribed."""
    robot = load_robot("panda")
    start = np.array(NAMED_ARMS["panda"].home)
    path = Circle.around(robot.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    costs = (JointVelocity(), InverseManipulability(1e-3))
    return Problem(robot, path, "pose", start, costs=costs)


def _table(title: str, problem: Problem, *, cyclic: bool) -> Table:
    ours = plan(problem)
    finer = plan(replace(problem, null_motion=PolynomialNullMotion(15)))
    methods: dict[str, Method] = {
        "pseudo-inverse (x = 0)": PseudoInverse(),
        "gradient projection": GradientProjection(),
        "extended Jacobian": ExtendedJacobian(),
        "damped least squares, λ = 0.1": DampedLeastSquares(),
        "Lagrangian, free end": LagrangianOptimum(ours),
    }
    if cyclic:
        methods["Lagrangian, cyclic"] = LagrangianOptimum(ours, cyclic=True)
    rows = [_row("ours, cubic", ours), _row("ours, degree 15", finer)]
    for label, method in methods.items():
        try:
            rows.append(_row(label, plan_by(problem, method)))
        except BreakdownError as error:
            broken = ("—",) * (len(_COLUMNS) - 2)
            rows.append((label, *broken, f"singular at {error.time:.3f} s"))
    return Table(title, _COLUMNS, tuple(rows))


def _row(label: str, found: Plan) -> tuple[str | float | int, ...]:
    report, check = found.report, found.certificate
    return (
        label,
        report.cost,
        float(np.abs(found.trajectory.qd).max()),
        check.smallest_singular_value.value,
        check.position_error.value,
        check.closure,
        report.evaluations,
        report.jacobian_evaluations,
        round(report.seconds, 3),
        "verified" if check.verified else "off the path",
    )


def _agreement(context: Context) -> Claim:
    ours = plan(sample_problem(null_motion=PolynomialNullMotion(15)))
    theirs = context.lagrangian.report.cost
    distance = ours.report.cost / theirs - 1.0
    return Claim(
        "two_optima",
        "The Lagrangian technique gives a globally optimal solution.",
        Verdict.CONFIRMED if abs(distance) < _AGREEMENT else Verdict.QUALIFIED,
        f"boundary-value problem {theirs:.5f}, our degree 15 {ours.report.cost:.5f}",
        f"The two optima differ by {abs(distance):.0e}, found by methods that share only the arm's "
        f"kinematics. The boundary-value problem finds any stationary motion, though: it is as "
        f"local as ours.",
    )


def _local_methods(table: Table) -> Claim:
    costs = {str(row[0]): row[1] for row in table.rows}
    ours, projection = costs["ours, cubic"], costs["gradient projection"]
    minimum_norm = costs["pseudo-inverse (x = 0)"]
    if not (
        isinstance(ours, float)
        and isinstance(projection, float)
        and isinstance(minimum_norm, float)
    ):
        raise TypeError("a cost in the table is no number")
    share = (minimum_norm - projection) / (minimum_norm - ours)
    return Claim(
        "better_than_local",
        "It can hopefully be shown as an improvement over locally optimal methods.",
        Verdict.CONFIRMED if ours < projection else Verdict.REFUTED,
        f"{ours:.4f}, against {projection:.4f} of gradient projection",
        f"With its gain tuned on this very cost, gradient projection gets {100 * share:.0f} % of "
        f"the way from x = 0 ({minimum_norm:.4f}); without tuning there is no telling.",
    )
