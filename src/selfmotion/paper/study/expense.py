"""Floating-point operations of the published scheme, and their growth with n."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from selfmotion.model.path import Line
from selfmotion.model.robot import load_robot
from selfmotion.paper.baselines import LagrangianOptimum, plan_by
from selfmotion.paper.study.context import Context, PublishedRun, run_published
from selfmotion.paper.study.published import (
    ODE23_TOLERANCE,
    PublishedFunction,
    flops_per_rate,
    published_null_motion,
)
from selfmotion.paper.study.results import Chapter, Claim, Plot, PlottedCurve, Table, Verdict
from selfmotion.planning.planner import plan
from selfmotion.problem.problem import Problem, sample_problem

# Iterations of the published scheme on each chain: the same for all, so that costs compare.
_ITERATIONS = 4

# Operations in the paper: iterations of a short run, and [flop].
_SHORT = (8, 4e6)
# The same of a long run.
_LONG = (31, 23e6)


def chapter(context: Context) -> Chapter:
    """Return the counts for the sample problem and for planar chains."""
    run = context.published()
    each = flops_per_rate(3, 2, 3)
    table, plot, growth = _growth(context)
    return Chapter(
        "expense",
        "What it costs",
        (
            "Operations are Jacobian evaluations times those of eq. 4 as written: Jacobian of a "
            "planar chain 9n; JJᵀ 2nm²; its inverse 2m³; J* 2nm²; J*ẋ 2nm; I - J*J 2n²m + n²; "
            "times ε 2n²; ε 2n(p + 1); sum n; Runge-Kutta 8n. For n = 3, m = 2, p = 3 that is "
            f"{each} per evaluation.",
            f"Our plan of the sample problem takes {context.plan.report.jacobian_evaluations} "
            f"Jacobian evaluations, certificate tolerance included, against "
            f"{run.jacobian_evaluations} of the published scheme.",
        ),
        tables=(table,),
        plots=(plot,),
        claims=(_flops(run), growth, _boundary_value(context)),
    )


def _flops(run: PublishedRun) -> Claim:
    per_iteration = run.flops / run.iterations
    paper = _SHORT[1] / _SHORT[0], _LONG[1] / _LONG[0]
    ratio = per_iteration / float(np.sqrt(paper[0] * paper[1]))
    return Claim(
        "flops",
        "A run of 8 iterations takes 4 Mflop or more, one of 31 iterations over 23 Mflop.",
        Verdict.CONFIRMED if 1.0 / 3.0 < ratio < 3.0 else Verdict.QUALIFIED,
        f"{run.flops / 1e6:.1f} Mflop for {run.iterations} iterations",
        f"{run.evaluations} evaluations of F, {run.jacobian_evaluations} of the Jacobian: "
        f"{per_iteration / 1e6:.2f} Mflop an iteration, against {paper[0] / 1e6:.2f} and "
        f"{paper[1] / 1e6:.2f} in the paper.",
    )


# Columns of the table of chains.
_COLUMNS = (
    "joints",
    "evaluations of F",
    "Jacobians",
    "Mflop a gradient",
    "F, published",
    "our evaluations",
    "F, ours",
)


def _growth(context: Context) -> tuple[Table, Plot, Claim]:
    rows: list[tuple[str | float | int, ...]] = []
    for joints in context.scale.chains:
        problem = chain(joints)
        run = run_published(problem, max_iterations=_ITERATIONS)
        ours = plan(replace(problem, null_motion=type(problem.null_motion)()))
        gradient = PublishedFunction(problem)
        gradient.gradient(np.zeros(gradient.size))
        flops = gradient.jacobian_evaluations * flops_per_rate(joints, 2, 3)
        rows.append(
            (
                joints,
                run.evaluations,
                run.jacobian_evaluations,
                flops / 1e6,
                run.minimum.cost,
                ours.report.evaluations,
                ours.report.cost,
            )
        )
    n = np.array([float(row[0]) for row in rows])
    mflop = np.array([float(row[3]) for row in rows])
    power = float(np.polyfit(np.log(n), np.log(mflop), 1)[0])
    note = f"Planar chains of unit reach on a line of 0.18 m, {_ITERATIONS} published iterations."
    plot = Plot(
        "growth",
        f"Growth with the joints: n to the {power:.2f}",
        "joints n",
        "Mflop a gradient",
        (PlottedCurve.of("published scheme", n, mflop, marker="o"),),
        "log",
        "log",
    )
    claim = Claim(
        "growth",
        "The algorithm is expected to scale as at least n², more likely n³.",
        _growth_verdict(power),
        f"one gradient's operations grow like n to the {power:.2f} (n = {n[0]:.0f} to {n[-1]:.0f})",
        "n(p + 1) + 1 evaluations a gradient, times operations of eq. 4 in which n² begins to "
        "outweigh the rest: n² for short chains, towards n³ for long ones.",
    )
    return Table("Planar chains", _COLUMNS, tuple(rows), note), plot, claim


def _growth_verdict(power: float) -> Verdict:
    """Judge 'at least n²'; powers between 1.5 and 2 count as nearly so."""
    if power >= 2.0:
        return Verdict.CONFIRMED
    return Verdict.QUALIFIED if power >= 1.5 else Verdict.REFUTED


def _boundary_value(context: Context) -> Claim:
    bvp = plan_by(sample_problem(), LagrangianOptimum(tolerance=ODE23_TOLERANCE)).report
    run = context.published()
    ours = context.plan.report.jacobian_evaluations
    verdict = Verdict.REFUTED
    if bvp.jacobian_evaluations < run.jacobian_evaluations:
        verdict = Verdict.CONFIRMED
    if ours < bvp.jacobian_evaluations < run.jacobian_evaluations:
        verdict = Verdict.QUALIFIED
    return Claim(
        "lagrange_cheaper",
        "Numerically, one would expect the Lagrangian method to be cheaper than this one.",
        verdict,
        f"{bvp.jacobian_evaluations} Jacobians, against {run.jacobian_evaluations} as published "
        f"and {ours} for our plan",
        f"In Jacobian evaluations, all from x = 0: the boundary-value problem by collocation, with "
        f"ode23's tolerance (F = {bvp.cost:.5f}); the published scheme "
        f"({run.minimum.cost:.4f} by its own count); our plan with exact gradients "
        f"({context.plan.report.cost:.4f}). Right about the published scheme, then; what made it "
        f"dear is difference gradients, not iterating.",
    )


def chain(joints: int) -> Problem:
    """Return the problem of a planar chain of equal links, reach 1 m, along a short line."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"chain_{joints}.urdf"
        file.write_text(_chain_urdf(joints), encoding="utf-8")
        robot = load_robot(file)
    start = np.full(joints, 1.2 / joints)
    start[0] = -0.6
    end = robot.pose(start)
    end.translation = end.translation + np.array([-0.15, 0.1, 0.0])
    path = Line(robot.pose(start), end, 1.0)
    return Problem(robot, path, "planar", start, published_null_motion())


def _chain_urdf(joints: int) -> str:
    parts = ['<robot name="chain">', '<link name="link0"/>']
    for k in range(1, joints + 1):
        offset = 0.0 if k == 1 else 1.0 / joints
        parts.append(
            f'<joint name="joint{k}" type="revolute"><parent link="link{k - 1}"/>'
            f'<child link="link{k}"/><origin xyz="{offset} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="-3" upper="3" velocity="10" effort="1"/></joint><link name="link{k}"/>'
        )
    parts.append(
        f'<joint name="end" type="fixed"><parent link="link{joints}"/><child link="tool"/>'
        f'<origin xyz="{1.0 / joints} 0 0"/></joint><link name="tool"/></robot>'
    )
    return "\n".join(parts)
