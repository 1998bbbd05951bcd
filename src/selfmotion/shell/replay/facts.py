"""Facts as a page shows them: rows of its table, and one sentence."""

from collections.abc import Mapping, Sequence

from selfmotion.planning.result import Plan
from selfmotion.shell.facts import Fact, without_repeats
from selfmotion.shell.replay.meshes import Json

# A number and a remark, shown smaller after it.
Cell = tuple[str, str]

# Costs that differ by less than this share are shown alike.
_ALIKE = 5e-4


def cells(facts: Sequence[Fact]) -> dict[str, Cell]:
    """Return facts as rows of a page's table: label → number and remark."""
    return {item.label: (item.number, item.place) for item in without_repeats(facts)}


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
