"""A process sheet as one HTML page, which prints on A4."""

import html
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmotion.basics import PlanError, ProblemError, as_path, shown, write_text
from selfmotion.certificate import LIMIT_NAMES, Extreme, Finding
from selfmotion.model.task import Task
from selfmotion.planning.result import Plan
from selfmotion.work.margins import Margins

# What a process sheet says: tables, each number from the plan's certificate, report or margins.


@dataclass(frozen=True)
class Section:
    """A table of a sheet.

    Attributes
    ----------
    title : str
    head : tuple of str
        Names of its columns.
    rows : tuple of tuple of str
    note : str
        What is said below it; "" for nothing.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def sections(plan: Plan, margins: Margins | None) -> tuple[Section, ...]:
    """Return the tables of a plan, with margins where they are known."""
    found = [_what(plan)]
    if margins is not None:
        found.append(_margins(margins))
    found += [_path(plan), _kept(plan), _active(plan), _used(plan), _reversals(plan)]
    found += [_approaches(plan), _feeds(plan), _assumed(plan)]
    return tuple(section for section in found if section.rows)


def _what(plan: Plan) -> Section:
    problem, robot, report = plan.problem, plan.robot, plan.report
    arm = robot.name
    if robot.urdf.is_calibrated:
        arm += ", joints where they were measured"
    rows = [
        ("arm", arm),
        ("tool", f"{robot.tool}{f', path in {robot.reference}' if robot.reference else ''}"),
        ("task", " and ".join(Task.of(item.task).value for item in problem.follows.items)),
        ("duration", f"{plan.trajectory.duration:.4g} s"),
        ("cost", f"{report.cost:.6g} (minimum-norm motion: {report.initial_cost:.6g})"),
        ("motion", plan.trajectory.digest[:16]),
        ("problem", problem.digest[:16]),
        ("judged by", f"selfmotion {plan.certificate.version}"),
    ]
    return Section("Program", ("", ""), tuple(rows))


def _margins(margins: Margins) -> Section:
    rows = [
        (item.name, kind, found.size, found.reason)
        for item in margins.subjects
        for kind, found in item.rows
    ]
    about = "; ".join(f"{item.name}: about {item.about}" for item in margins.subjects)
    return Section(
        "How far it may be off while the program runs unchanged",
        ("", "", "margin", "what stops more"),
        tuple(rows),
        f"Judged: {margins.judged}. Rotations of the {about}.",
    )


def _path(plan: Plan) -> Section:
    check = plan.certificate
    rows = [
        _extreme("position error", check.position_error, "m", ".2e"),
        _extreme("rotation error", check.rotation_error, "rad", ".2e"),
    ]
    for position, rotation in check.others:
        rows.append(_extreme(f"position error of {position.name}", position, "m", ".2e"))
        rows.append(_extreme(f"rotation error of {rotation.name}", rotation, "rad", ".2e"))
    for worst in check.deviations:
        unit = "rad" if "r" in worst.name else "m"
        rows.append(_extreme(f"off the path, as allowed: {worst.name}", worst, unit, ".4g"))
    rows.append(_extreme("smallest singular value", check.smallest_singular_value, "", ".4g"))
    allowed = f"Allowed: {check.tolerance.position:.3g} m and {check.tolerance.rotation:.3g} rad."
    return Section("Path, at all times", ("", "worst", "at", "of"), tuple(rows), allowed)


def _kept(plan: Plan) -> Section:
    rows = [
        (
            finding.requirement,
            _found(plan, finding),
            f"{finding.time:.3f} s",
            finding.subject,
            "kept" if finding.satisfied else "NOT KEPT",
        )
        for finding in plan.certificate.findings
        if finding.requirement != "feed"
    ]
    return Section("Requirements, at all times", ("", "worst", "at", "of", ""), tuple(rows))


def _found(plan: Plan, finding: Finding) -> str:
    """Return what was found and what is allowed, with the unit."""
    if finding.requirement == LIMIT_NAMES[0]:
        names = {finding.subject} & set(plan.robot.joint_names)
        return f"{finding.amount:.4g} {plan.robot.unit_of(*names)} left"
    if finding.requirement == "clearance":
        return f"{finding.amount * 1e3:.4g} mm (at least {finding.allowed * 1e3:.4g})"
    if finding.allowed == 1.0 and not finding.unit:
        return f"{finding.amount:.1%} of the limit"
    return f"{finding.amount:.4g} {finding.unit} (allowed {finding.allowed:.4g})"


def _active(plan: Plan) -> Section:
    rows = [
        (
            item.constraint,
            item.easing,
            f"{item.saving:.3g}",
            ", ".join(f"{first:.3g} to {last:.3g} s" for first, last in item.spans),
        )
        for item in plan.report.active
    ]
    return Section(
        "Active constraints",
        ("", "if it were eased by", "the cost would fall by", "active"),
        tuple(rows),
        "To first order, by the Lagrange multipliers: more of it saves less than in proportion.",
    )


def _used(plan: Plan) -> Section:
    used = plan.limits_used
    rows = tuple((name, f"{share:.1%} of the time") for name, share in used.shares)
    return Section(
        "Limits of the pace used by 95 % or more",
        ("", ""),
        rows or (("none", ""),),
        f"Some limit is, for {used.busy:.1%} of the time.",
    )


def _reversals(plan: Plan) -> Section:
    rows = [
        (name, str(len(times)), ", ".join(f"{time:.3g}" for time in times.tolist()))
        for name, times in plan.reversals.times.items()
        if len(times)
    ]
    return Section("Joint reversals", ("", "", "at [s]"), tuple(rows) or (("none", "", ""),))


def _approaches(plan: Plan) -> Section:
    rows = [
        (name, f"{near.value * 1e3:.4g} mm", f"{near.time:.3f} s", near.name)
        for name, near in plan.approaches.items()
    ]
    return Section("Closest approaches", ("to", "", "at", "between"), tuple(rows))


def _feeds(plan: Plan) -> Section:
    rows = [
        (
            item.chain.tip_name,
            f"{feed.asked:.4g} m/s",
            f"{feed.reached:.4g} m/s",
            f"{feed.slowest:.4g} m/s at {feed.time:.4g} s",
            "kept" if feed.kept else "NOT KEPT",
        )
        for item in plan.problem.follows.items
        for feed in item.path.feeds
    ]
    return Section("Feeds", ("", "asked", "reached", "slowest", ""), tuple(rows))


def _assumed(plan: Plan) -> Section:
    return Section("Assumed, and not judged", ("",), tuple((text,) for text in _assumptions(plan)))


def _assumptions(plan: Plan) -> Iterator[str]:
    robot, check = plan.robot, plan.certificate
    yield f"judged: {', '.join(check.covers)}"
    if check.not_checked:
        yield f"not judged: {', '.join(check.not_checked)}"
    yield "the arm follows the joint motion as planned, without error"
    if robot.urdf.is_calibrated:
        yield "the joints are where the calibration puts them"
    else:
        yield "the arm is built as its URDF draws it"
    if robot.locked:
        held = ", ".join(f"{name} {value:.4g}" for name, value in robot.locked.items())
        yield f"joints that are held: {held}"
    yield from check.remarks
    yield from check.notes
    for item in check.damped:
        yield f"damped {item}"


def _extreme(label: str, worst: Extreme, unit: str, form: str) -> tuple[str, ...]:
    time = "" if np.isnan(worst.time) else f"{worst.time:.3f} s"
    return label, f"{worst.value:{form}} {unit}".strip(), time, worst.name


# A process sheet as one HTML page, which prints on A4.

_STYLE = """
@page { size: A4; margin: 14mm }
body { font: 10pt/1.35 system-ui, sans-serif; color: #222; max-width: 182mm; margin: 8mm auto }
h1 { font-size: 15pt; margin: 0 0 2mm } h2 { font-size: 11pt; margin: 4mm 0 1mm }
table { border-collapse: collapse; width: 100% }
td, th { text-align: left; vertical-align: top; padding: .4mm 3mm .4mm 0 }
td { border-top: .2mm solid #ccc }
th { font-weight: 600 } p { margin: 1mm 0 } .note { color: #555; font-size: 9pt }
.verified { color: #00695c; font-weight: 600 } .refused { color: #b71c1c; font-weight: 600 }
section { break-inside: avoid }
@media print { body { margin: 0; max-width: none } }
"""


def write_sheet(
    plan: Plan, file: str | Path, margins: Margins | None = None, *, title: str = ""
) -> Path:
    """Write what a program does, keeps and survives as one HTML page that prints on A4.

    The page needs no network and no other file. Every number is from the plan's certificate or
    report, or from the margins.

    Parameters
    ----------
    plan : Plan
    file : path
        Ends in ``.html``.
    margins : Margins, optional
        Of this plan (`selfmotion.margin`).
    title : str
        By default the arm's name and task.

    Raises
    ------
    PlanError
        The certificate is of another motion, or the margins are of another motion or problem.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"write_sheet: plan is {shown(plan)}, expected a Plan")
    if not isinstance(margins, Margins | None):
        raise ProblemError(f"write_sheet: margins are {shown(margins)}, expected Margins")
    if not plan.certificate.motion:
        raise PlanError(f"{plan.robot.name}: {plan.certificate.verdict}")
    if margins is not None and margins.robot != plan.robot.name:
        raise PlanError(f"the margins are of {margins.robot}, the plan is of {plan.robot.name}")
    own = plan.trajectory.digest, plan.problem.digest
    if margins is not None and (margins.motion, margins.problem) != own:
        raise PlanError(
            f"{plan.robot.name}: the margins are of another motion or problem than the plan; find "
            f"them anew (selfmotion.margin(plan))"
        )
    path = as_path(file)
    if path.suffix != ".html":
        raise ProblemError(f"{path}: expected a name that ends in .html")
    named = title or f"{plan.robot.name}, task {plan.task.value}"
    check = plan.certificate
    kind = "verified" if check.verified else "refused"
    body = [f"<h1>{html.escape(named)}</h1>", f'<p class="{kind}">{html.escape(check.verdict)}</p>']
    if margins is not None:
        body.append(f"<p>{html.escape(margins.sentence)}</p>")
    body += [_drawn(section) for section in sections(plan, margins)]
    write_text(
        path,
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{html.escape(named)}</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>\n",
    )
    return path


def _drawn(section: Section) -> str:
    head = ""
    if any(section.head):
        head = f"<tr>{''.join(f'<th>{html.escape(name)}</th>' for name in section.head)}</tr>"
    rows = "".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>"
        for row in section.rows
    )
    note = f'<p class="note">{html.escape(section.note)}</p>' if section.note else ""
    title = html.escape(section.title)
    return f"<section><h2>{title}</h2><table>{head}{rows}</table>{note}</section>"
