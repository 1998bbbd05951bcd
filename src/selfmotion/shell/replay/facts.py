"""Facts of a plan as a page shows them: rows of its table, and one sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from selfmotion.certificate import Extreme
from selfmotion.planning.result import Plan, Report
from selfmotion.shell.replay.meshes import Json

# A number and a remark, shown smaller after it.
Cell = tuple[str, str]

# Costs that differ by less than this share are shown alike.
_ALIKE = 5e-4


def facts(plan: Plan) -> dict[str, Cell]:
    """Return what a reader wants to know of a plan: label → number and remark."""
    report, certificate = plan.report, plan.certificate
    if not certificate.findings:
        # An arm that stands, for a page without a motion.
        return {"verdict": (certificate.verdict, "")}
    rows: dict[str, Cell] = {"verdict": (certificate.verdict, "")}
    rows["cost"] = _compared(report.cost, report.initial_cost)
    if report.remaining is not None and certificate.verified:
        rows["further saving possible, estimate"] = (f"{report.remaining:.2g}", _share(report))
    for name, value in report.terms.items():
        rows[f"cost term: {name}"] = _compared(value, report.initial_terms.get(name))
    rows["position error, worst"] = _extreme(certificate.position_error, "m")
    rows["rotation error, worst"] = _extreme(certificate.rotation_error, "rad")
    follows = plan.problem.follows
    for bound, (position, rotation) in zip(follows.items[1:], certificate.others, strict=True):
        tip = bound.chain.tip_name
        rows[f"position error of {tip}, worst"] = _extreme(position, "m")
        rows[f"rotation error of {tip}, worst"] = _extreme(rotation, "rad")
    for worst in certificate.deviations:
        unit = "rad" if "r" in worst.name else "m"
        rows[f"off the path, as relaxed {worst.name}"] = (
            f"{worst.value:.3g} {unit}",
            f"at {worst.time:.3g} s",
        )
    nearest, robot = certificate.limit_margin, plan.robot
    unit = robot.unit_of(*({nearest.name} & set(robot.joint_names)))
    rows["margin to a joint limit, least"] = _extreme(nearest, unit)
    fastest = certificate.velocity_ratio
    rows["speed, most"] = _extreme(replace(fastest, value=100.0 * fastest.value), "% of its limit")
    used, *which = str(plan.limits_used).split(": ", 1)
    rows["limits used fully"] = (used, "".join(which))
    turns, *which = str(plan.reversals).split(" ", 1)
    rows["joint reversals"] = (turns, "".join(which).strip("()"))
    for name, near in plan.approaches.items():
        rows[f"closest to {name}"] = _extreme(replace(near, value=1e3 * near.value), "mm")
    rows["smallest singular value"] = _extreme(certificate.smallest_singular_value, "")
    rows["joint distance, end to start"] = (f"{certificate.closure:.3g} {robot.unit_of()}", "")
    rows["checked at"] = (f"{certificate.samples} times", "by forward kinematics")
    rows["duration"] = (f"{plan.trajectory.duration:.4g} s", "")
    tasks = " and ".join(item.task.value for item in follows.items)
    rows["task"] = (tasks, f"{follows.dimension} rows, {plan.robot.dof} joints")
    rows["outcome"] = (str(report.status.value), report.message)
    rows["iterations"] = (str(report.iterations), f"in {report.seconds:.3g} s")
    rows["evaluations"] = (
        f"{report.evaluations} of F, {report.gradient_evaluations} of ∇F",
        f"{report.jacobian_evaluations} Jacobians, {report.steps} steps",
    )
    return rows


def table(columns: Sequence[Mapping[str, Cell]]) -> list[Json]:
    """Return the rows for several plans side by side; a plan without a row gets an empty cell."""
    labels = list(dict.fromkeys(label for column in columns for label in column))
    return [
        {"label": label, "cells": [column.get(label, ("", "")) for column in columns]}
        for label in labels
    ]


def describe(plan: Plan) -> str:
    """Return one sentence that tells a stranger what the page shows."""
    report = plan.report
    if not plan.certificate.findings:
        # There is no motion to describe.
        return plan.certificate.verdict
    saved = ""
    if report.initial_cost:
        change = report.cost / report.initial_cost - 1.0
        saved = ", that of the minimum-norm motion"
        if abs(change) >= _ALIKE:
            side = "below" if change <= 0 else "above"
            saved = f", {abs(100 * change):.1f} % {side} that of the minimum-norm motion"
        if change > 5e-4 and plan.problem.all_constraints:
            saved += ", which ignores the constraints"
    items = plan.problem.follows.items
    what = "a tool motion" if len(items) == 1 else f"{len(items)} tool motions"
    tasks = " and ".join(f"'{item.task.value}'" for item in items)
    return (
        f"{plan.robot.name}: {plan.robot.dof} joints follow {what} of "
        f"{plan.trajectory.duration:.3g} s (task {tasks}) at cost {report.cost:.4g}"
        f"{saved}. {plan.certificate.verdict}"
    )


def _share(report: Report) -> str:
    left = report.remaining
    if not left or not report.cost:
        return ""
    return f"{100 * left / abs(report.cost):.2g} % with any null motion"


def _compared(value: float, start: float | None) -> Cell:
    return f"{value:.6g}", "" if start is None else f"minimum-norm: {start:.6g}"


def _extreme(extreme: Extreme, unit: str) -> Cell:
    number = f"{extreme.value:.3g} {unit}".strip()
    where = f"{extreme.name}, " if extreme.name else ""
    return number, f"{where}at {extreme.time:.3g} s"
