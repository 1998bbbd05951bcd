"""The tables of a process sheet: each number is from a certificate, a report or margins."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.result import Plan
from selfmotion.shell.facts import Fact, finding_facts, margin_facts, plan_facts, with_unit
from selfmotion.shell.replay import seam_color
from selfmotion.work.job import Program, Step
from selfmotion.work.margins import Margins


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
    colors : tuple of str
        Of the rows, as in the picture; none by default.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    colors: tuple[str, ...] = ()


def plan_sections(plan: Plan, margins: Margins | None) -> tuple[Section, ...]:
    """Return the tables of a plan, with margins where they are known."""
    sections = [_what(plan)]
    if margins is not None:
        sections.append(_margins(margins))
    facts = plan_facts(plan)
    sections += [_path(plan, facts), _kept(plan), _of_group("Motion", facts, "motion")]
    sections += [_active(plan), _used(plan), _reversals(plan)]
    sections += [_of_group("Closest approaches", facts, "near"), _feeds(plan)]
    sections.append(_assumed(_assumptions(plan)))
    return tuple(section for section in sections if section.rows)


def program_sections(program: Program, margins: Mapping[str, Margins]) -> tuple[Section, ...]:
    """Return the tables of a program, with the margins of seams (by name) that are known."""
    sections = [_what_program(program), _seams(program), _events(program)]
    sections += [_margins(each, f"Seam '{name}': ") for name, each in margins.items()]
    sections += [_kept_by_seams(program), _moves(program), _assumed(_assumptions_of(program))]
    return tuple(section for section in sections if section.rows)


def _what(plan: Plan) -> Section:
    problem, report = plan.problem, plan.report
    rows = [
        *_arm(plan.robot),
        ("task", " and ".join(Task.of(item.task).value for item in problem.follows.items)),
        ("duration", f"{plan.trajectory.duration:.4g} s"),
        ("cost", f"{report.cost:.6g} (minimum-norm motion: {report.initial_cost:.6g})"),
        ("motion", plan.trajectory.digest[:16]),
        ("problem", problem.digest[:16]),
        ("judged by", f"selfmotion {plan.certificate.version}"),
    ]
    return Section("Program", ("", ""), tuple(rows))


def _arm(robot: RobotModel) -> list[tuple[str, str]]:
    arm = robot.name
    if robot.urdf.is_calibrated:
        arm += ", joints where they were measured"
    path = f", path in {robot.reference}" if robot.reference else ""
    return [("arm", arm), ("tool", f"{robot.tool}{path}")]


def _what_program(program: Program) -> Section:
    judges = dict.fromkeys(plan.certificate.version for plan in program.plans.values())
    rows = [
        *_arm(program.robot),
        ("seams", str(len(program.order))),
        ("duration", f"{program.duration:.4g} s, {program.transfer_time:.4g} s of it moves"),
        ("judged by", ", ".join(f"selfmotion {version}" for version in judges)),
    ]
    if not any(step.is_missing for step in program.steps) and program.steps:
        rows.insert(-1, ("motion", program.trajectory.digest[:16]))
    return Section("Program", ("", ""), tuple(rows))


def _seams(program: Program) -> Section:
    timed = zip(program.begins, program.steps, strict=True)
    seams = [(begin, step, step.made) for begin, step in timed if isinstance(step.made, Plan)]
    rows = [
        (
            step.name + (", from its end" if step.turned else ""),
            f"{begin:.3f} s",
            f"{step.duration:.4g} s",
            plan.task.value,
            _feed_text(plan),
            _closest(plan),
        )
        for begin, step, plan in seams
    ]
    head = ("", "begins at", "takes", "task", "feed", "closest")
    colors = tuple(seam_color(number) for number in range(len(rows)))
    return Section("Seams, in their order", head, tuple(rows), colors=colors)


def _feed_text(plan: Plan) -> str:
    feeds = (feed for item in plan.problem.follows.items for feed in item.path.feeds)
    return ", ".join(
        f"{feed.reached:.4g} of {feed.asked:.4g} m/s{'' if feed.kept else ' NOT KEPT'}"
        for feed in feeds
    )


def _closest(plan: Plan) -> str:
    near = min(plan.approaches.values(), key=lambda each: each.value, default=None)
    return "" if near is None else f"{with_unit(near.value, 'm')}, {near.name}"


def _events(program: Program) -> Section:
    rows = [(f"{at:.3f} s", name, event) for at, name, event in program.events]
    return Section("Events", ("at", "of", ""), tuple(rows))


def _kept_by_seams(program: Program) -> Section:
    rows = [(name, *row) for name, plan in program.plans.items() for row in _kept(plan).rows]
    return Section(
        "Requirements, at all times of each seam",
        ("seam", "", "worst", "at, from its begin", "of", ""),
        tuple(rows),
    )


def _moves(program: Program) -> Section:
    rows = [
        (step.name, f"{begin:.3f} s", f"{step.duration:.4g} s", _kept_by_move(step))
        for begin, step in zip(program.begins, program.steps, strict=True)
        if not step.is_seam
    ]
    return Section("Moves and waits", ("", "begins at", "takes", ""), tuple(rows))


def _kept_by_move(step: Step) -> str:
    return f"NOT KEPT: {step.trouble}" if step.trouble else "kept"


def _assumptions_of(program: Program) -> Iterator[str]:
    several = (text for plan in program.plans.values() for text in _assumptions(plan))
    yield from dict.fromkeys([*several, *program.unjudged, *program.notes])


def _margins(margins: Margins, of: str = "") -> Section:
    rows = [(fact.label, fact.number, fact.where) for fact in margin_facts(margins)]
    about = "; ".join(f"{item.name}: about {item.about}" for item in margins.subjects)
    return Section(
        f"{of}How far it may be off while the program runs unchanged",
        ("", "margin", "what stops more"),
        tuple(rows),
        f"Judged: {margins.judged}. Rotations of the {about}.",
    )


def _of_group(title: str, facts: Sequence[Fact], group: str, note: str = "") -> Section:
    rows = [
        (fact.label, fact.number, fact.time, ", ".join(filter(None, (fact.where, fact.remark))))
        for fact in facts
        if fact.group == group
    ]
    return Section(title, ("", "worst", "at", "of"), tuple(rows), note)


def _path(plan: Plan, facts: Sequence[Fact]) -> Section:
    allowed = plan.certificate.tolerance
    position, rotation = with_unit(allowed.position, "m"), with_unit(allowed.rotation, "rad")
    note = f"Allowed: {position} and {rotation}."
    return _of_group("Path, at all times", facts, "path", note)


def _kept(plan: Plan) -> Section:
    rows = [
        (
            fact.label,
            f"{fact.number} ({fact.limit})" if fact.limit else fact.number,
            fact.time,
            fact.where,
            "kept" if fact.kept else "NOT KEPT",
        )
        for fact in finding_facts(plan.certificate, plan.robot)
        if fact.label != "feed"
    ]
    return Section("Requirements, at all times", ("", "worst", "at", "of", ""), tuple(rows))


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


def _assumed(assumptions: Iterator[str]) -> Section:
    return Section("Assumed, and not judged", ("",), tuple((text,) for text in assumptions))


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
