"""Plans, certificates and robots as tables for the terminal; legible in a log as well."""

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from selfmotion.certificate import Certificate, Extreme
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.result import Comparison, Gap, Plan, Report
from selfmotion.shell.cli.option_names import in_shell
from selfmotion.shell.cli.summaries import metres_text
from selfmotion.shell.facts import Fact, certificate_facts, plan_facts, with_unit, without_repeats
from selfmotion.work.job import Program

if TYPE_CHECKING:
    from selfmotion.paper.study import Claim
    from selfmotion.work.batch import Batch, Row


# Number of longest moves that are reported.
_LONGEST = 5
# Columns of a log, which has no width of its own: those of the widest table.
_LOG_WIDTH = 120


def console() -> Console:
    """Return the console of the results: as wide as the terminal, or as a log may be."""
    measured = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(highlight=False, width=None if measured else _LOG_WIDTH)


def show(plan: Plan, console: Console) -> None:
    """Print what the minimum-norm motion and the plan cost, the work done, and the certificate."""
    report = plan.report
    table = _table(f"{plan.robot.name}, task {plan.task.value}")
    table.add_column("cost")
    table.add_column("minimum-norm motion", justify="right")
    table.add_column("plan", justify="right")
    table.add_column("change", justify="right")
    for name in report.terms:
        table.add_row(name, *_compare(report.initial_terms.get(name, math.nan), report.terms[name]))
    if len(report.terms) > 1:
        table.add_section()
        table.add_row("total", *_compare(report.initial_cost, report.cost))
    console.print(table)
    console.print(
        f"{report.evaluations} evaluations of the cost, {report.gradient_evaluations} of its "
        f"gradient;\n{report.jacobian_evaluations} Jacobians, {report.steps} steps, "
        f"{report.seconds:.2f} s\noutcome: {report.message}",
        markup=False,
    )
    if len(report.attempts) > _USUAL_ATTEMPTS:
        console.print(_tried(report))
    # Of a motion that breaks constraints the estimate is of no use: what it saves is not to be had.
    if report.remaining is not None and report.cost and plan.certificate.verified:
        share = 100.0 * report.remaining / abs(report.cost)
        told = f"about {share:.2g} %" if share >= 0.01 else "less than 0.01 %"
        console.print(f"further saving possible: {told} (estimate)")
    if report.active:
        console.print(_active_constraints(report))
    if report.gap is not None:
        console.print(_distance(report.gap))
    _show_facts(plan_facts(plan), plan.certificate, console)
    if plan.metres:
        console.print(metres_text(plan), markup=False, soft_wrap=not console.is_terminal)


# A look at single poses, starts, and the proof: what more was tried is reported.
_USUAL_ATTEMPTS = 3


def _tried(report: Report) -> Table:
    """Return a line for each attempt at the plan."""
    table = _table("strategies tried")
    table.add_column("strategy")
    table.add_column("result", overflow="fold")
    table.add_column("cost", justify="right", no_wrap=True)
    table.add_column("s", justify="right", no_wrap=True)
    before = None
    for item in report.attempts:
        cost = "" if item.cost is None else f"{item.cost:.6g}"
        stood = (item.outcome, item.cost)
        first, *more = item.outcome.split("; ")
        outcome = f"{first}; and {len(more)} more" if more else first
        outcome = "no change" if stood == before else outcome
        table.add_row(escape(item.name), escape(outcome), cost, f"{item.seconds:.2f}")
        before = stood
    return table


def show_certificate(
    certificate: Certificate,
    approaches: Mapping[str, Extreme],
    robot: RobotModel,
    console: Console,
) -> None:
    """Print what forward kinematics found, how near each body comes, and the verdict."""
    _show_facts(certificate_facts(certificate, approaches, robot), certificate, console)


# Facts that are beside the table, or above it.
_ELSEWHERE = ("plan", "search")


def _show_facts(facts: Sequence[Fact], certificate: Certificate, console: Console) -> None:
    """Print facts of a motion as a table, and the verdict."""
    table = _table(f"checked at all times, with {certificate.samples} poses")
    table.add_column("worst")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("at", justify="right", no_wrap=True)
    table.add_column("where", overflow="fold")
    for fact in without_repeats(facts):
        if fact.group not in _ELSEWHERE:
            label = f"{fact.label} ({fact.limit})" if fact.limit else fact.label
            where = ", ".join(part for part in (fact.where, fact.remark) if part)
            table.add_row(*map(escape, (label, fact.number, fact.time, where)))
    console.print(table)
    for remark in certificate.remarks:
        console.print(remark, style="dim", markup=False, soft_wrap=not console.is_terminal)
    style = "green" if certificate.verified else "bold red"
    # One line of a log; words are kept whole on a terminal.
    verdict = in_shell(certificate.verdict)
    console.print(verdict, style=style, markup=False, soft_wrap=not console.is_terminal)


def show_side_by_side(columns: Mapping[str, Sequence[Fact]], console: Console) -> None:
    """Print a column of facts for each of several programs."""
    table = _table("programs side by side")
    for name in ("", *columns):
        table.add_column(escape(name), overflow="fold")
    known = [{item.label: item for item in facts} for facts in columns.values()]
    for label in dict.fromkeys(label for each in known for label in each):
        cells = (each[label].number if label in each else "" for each in known)
        table.add_row(escape(label), *map(escape, cells))
    console.print(table)


def show_comparison(found: Comparison, console: Console) -> None:
    """Print a column per plan: its costs, and the worst that its check found."""
    table = _table("plans side by side")
    table.add_column("")
    for name in found.names:
        table.add_column(escape(name), justify="right", overflow="fold")
    for number, row in enumerate(found.cells(), start=1):
        table.add_row(*row, end_section=number == len(found.costs))
    console.print(table)
    if found.remark:
        console.print(found.remark, markup=False, soft_wrap=not console.is_terminal)
    for line in found.refusals():
        console.print(line, style="bold red", markup=False, soft_wrap=not console.is_terminal)


def show_batch(batch: "Batch", console: Console) -> None:
    """Print the best of many plans, and how many there are."""
    from selfmotion.work.batch import labels

    ranked = sorted(batch.rows, key=lambda row: row.rank)
    keys = list(dict.fromkeys(key for row in ranked for key in row.settings))
    table = _table("the best of them")
    for name in ("name", *labels(keys)):
        table.add_column(escape(name), overflow="fold")
    for name in ("cost", "duration", "margin", "clearance", "verified"):
        table.add_column(name, no_wrap=True)
    for row in ranked[:_SHOWN]:
        values = [escape(json.dumps(row.settings.get(key, ""))) for key in keys]
        outcome = ["-", "-", "-", "-"]
        if not row.error:
            near = "-" if row.clearance is None else with_unit(row.clearance, "m")
            margin = "-" if row.margin is None else with_unit(row.margin, row.margin_unit)
            outcome = [row.outcome, f"{row.duration:.4g} s", margin, near]
        table.add_row(escape(row.name), *values, *outcome, row.reason or "yes")
    console.print(table)
    verified = sum(row.verified for row in batch.rows)
    failed = [row for row in ranked if not row.verified]
    console.print(
        f"{len(ranked)} problems: {verified} verified, {sum(bool(row.error) for row in failed)} "
        f"without a plan; {batch.resumed} finished before"
    )
    # Of many that are refused alike, one says what there is to say.
    for reason, rows in _by_reason(failed).items():
        more = f" ({len(rows)} of them)" if len(rows) > 1 else ""
        told = f"{reason}{more}: {rows[0].name}: {rows[0].error or rows[0].verdict}"
        console.print(told, style="red", markup=False, soft_wrap=True)
    for file in (batch.folder / "index.html", *batch.best_files):
        console.print(f"wrote {file}", markup=False, soft_wrap=True)


def _by_reason(rows: Sequence["Row"]) -> dict[str, list["Row"]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.reason, []).append(row)
    return found


# Rows of a batch on the terminal; the files have all of them.
_SHOWN = 10


def show_robots(robots: Mapping[str, RobotModel], console: Console) -> None:
    """Print a row per arm: joints, tool frame, and the freedom each task leaves."""
    table = _table()
    table.caption = "n: joints; tasks with the self-motion that each leaves"
    table.add_column("robot", no_wrap=True)
    table.add_column("n", justify="right", no_wrap=True)
    table.add_column("tool frame", no_wrap=True)
    table.add_column("tasks")
    for name, robot in robots.items():
        table.add_row(name, str(robot.dof), robot.tool, ", ".join(_freedom(robot)))
    console.print(table)


def show_claims(claims: Sequence["Claim"], console: Console) -> None:
    """Print a row per claim of the paper: verdict, and the number that decides."""
    table = _table("the paper's claims")
    table.add_column("claim", overflow="fold")
    table.add_column("verdict", no_wrap=True)
    table.add_column("decided by", overflow="fold")
    for claim in claims:
        table.add_row(claim.statement, claim.verdict.value, claim.number)
    console.print(table)


def show_program(program: Program, console: Console) -> None:
    """Print what is made when, the steps that take longest, and the verdict."""
    table = _table(f"{program.robot.name}, {program.extent}")
    table.add_column("seam")
    table.add_column("way")
    for column in ("begins", "takes", "move to it"):
        table.add_column(f"{column} [s]", justify="right")
    before = 0.0
    for begin, step in zip(program.begins, program.steps, strict=True):
        takes = 0.0 if step.is_missing else step.motion.duration
        if not step.is_seam:
            before += takes
            continue
        way = "backwards" if step.turned else "forwards"
        table.add_row(escape(step.name), way, f"{begin:.2f}", f"{takes:.2f}", f"{before:.2f}")
        before = 0.0
    console.print(table)
    moves = [step for step in program.steps if not step.is_seam and not step.is_missing]
    longest = sorted(moves, key=lambda step: step.motion.duration, reverse=True)[:_LONGEST]
    if longest:
        told = ", ".join(f"{step.name} {step.motion.duration:.2f} s" for step in longest)
        console.print(f"longest moves: {told}", markup=False, soft_wrap=True)
    for line in program.kept_told:
        console.print(line, markup=False, soft_wrap=True)
    for note in program.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(
        f"{program.duration:.2f} s in all, {program.transfer_time:.2f} s of it moves and waits; no "
        f"order of these motions takes less than {program.bound:.2f} s for moves",
        markup=False,
        soft_wrap=True,
    )
    console.print(program.verdict, markup=False, soft_wrap=True)


def _table(title: str | None = None) -> Table:
    """Return an empty table without ornament, so that narrow terminals have room for words."""
    return Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), title=title, title_justify="left")


def _freedom(robot: RobotModel) -> list[str]:
    """Return the tasks that leave self-motion, with how much."""
    left = {task: robot.redundancy(task) for task in Task if robot.can_follow(task)}
    return [f"{task.value} {freedom}" for task, freedom in left.items() if freedom > 0]


def _distance(gap: Gap) -> str:
    """Say how far a plan is from the global optimum."""
    cost = "none of its motions keeps the constraints"
    if gap.cost_excess is not None:
        cost = f"cost {100.0 * gap.cost_excess:+.2f} % from its best motion"
    return (
        f"global search over self-motions sampled {gap.spacing:g} rad apart, "
        f"{gap.sequences} refined:\n{cost}; joint path {gap.length:.4g}, "
        f"{100.0 * gap.length_excess:+.2f} % from its shortest sequence"
    )


def _active_constraints(report: Report) -> Table:
    """Return what each active constraint costs, by its multipliers."""
    table = _table("active constraints")
    table.add_column("if you allow")
    table.add_column("the cost falls at first by about", justify="right")
    table.add_column("active at")
    for item in report.active:
        share = f"{100.0 * item.saving / abs(report.cost):.3g} %" if report.cost else ""
        spans = ", ".join(f"{a:.2f} s" if a == b else f"{a:.2f}-{b:.2f} s" for a, b in item.spans)
        table.add_row(escape(item.easing), share, spans)
    return table


def _compare(before: float, after: float) -> tuple[str, str, str]:
    change = f"{100.0 * (after - before) / abs(before):+.1f} %" if before else ""
    return f"{before:.6g}", f"{after:.6g}", change
