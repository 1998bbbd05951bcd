"""What a process sheet says: tables, each number from the plan's certificate, report or margins."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from selfmotion.certificate import LIMIT_NAMES, Extreme, Finding
from selfmotion.margins import Margins
from selfmotion.result import Plan
from selfmotion.task import Task


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
        "To first order, by the Lagrange multipliers.",
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
