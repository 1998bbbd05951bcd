"""Short summaries of plans, certificates and programs, for the terminal."""

import re
from collections.abc import Mapping

from rich.console import Console

from selfmotion.certificate import Certificate, Extreme
from selfmotion.model.path import Retimed
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner import LOOK_AT_POSES, NOTHING_IN_THE_WAY
from selfmotion.planning.result import Plan, Report
from selfmotion.shell.cli.option_names import in_shell
from selfmotion.shell.facts import with_unit
from selfmotion.work.job import Program

# Option that shows what a summary leaves out.
_VERBOSE_OPTION = "--verbose"
# Text after which a message lists remedies.
_REMEDIES = "what would help: "
# Smallest saving that is printed, as a share of the cost: it rounds to 1 %.
_MIN_SAVING = 0.009
# Statuses that need no line, unless the report's message says more.
_ENDED_WELL = (Status.CONVERGED, Status.PRECISION)


def show_plan(plan: Plan, console: Console) -> None:
    """Print the verdict, cost and duration, and the constraint whose relaxation saves most."""
    report, certificate = plan.report, plan.certificate
    show_certificate(certificate, {}, console)
    if report.ending or isinstance(plan.path, Retimed):
        # The cost of part of a path, or at another pace, compares with no other.
        _print(console, _duration(plan))
        if "out of reach" in report.ending:
            _print(console, _remedies(report.message))
        return
    lines = [f"cost {report.cost:.6g}{_change(report)}, {_duration(plan)}", blocked_text(plan)]
    lines += [metres_text(plan) if plan.metres else ""]
    says_more = report.status not in _ENDED_WELL or report.message != report.status.message
    if certificate.verified and says_more:
        message = in_shell(report.message).removeprefix(f"{report.status.value}: ")
        lines.append(f"{report.status.value}: {message}")
    lines.append(_largest_saving(report))
    for line in filter(None, lines):
        _print(console, line)


def _duration(plan: Plan) -> str:
    return f"duration {plan.trajectory.duration:.4g} s"


def _change(report: Report) -> str:
    """Return the change of the cost from the minimum-norm motion; "" where that has none."""
    if not report.initial_cost:
        return ""
    share = (report.cost - report.initial_cost) / abs(report.initial_cost)
    ignores = ", which ignores the constraints" if share > 0.0 else ""
    return f" ({100.0 * share:+.2g} % from the minimum-norm motion{ignores})"


def _largest_saving(report: Report) -> str:
    """Return which relaxation saves most, and how much; "" where it saves hardly anything."""
    if not (report.active and report.cost):
        return ""
    first = report.active[0]
    share = first.saving / abs(report.cost)
    if share < _MIN_SAVING:
        return ""
    return (
        f"{first.easing} would lower the cost by about {100.0 * share:.2g} % (a slope: more of it "
        f"saves less than in proportion)"
    )


def blocked_text(plan: Plan) -> str:
    """Return a note on the bodies that meet in every motion that was found, with remedies.

    "" where none do, and where the start was given.
    """
    violated = [
        item for item in plan.certificate.findings if item.unit == "m" and not item.satisfied
    ]
    collision = next((item for item in violated if item.requirement == "clearance"), None)
    if collision is None or plan.problem.given_start is not None or not plan.certificate.on_path:
        return ""
    outcomes = [item.outcome for item in plan.report.attempts if item.name == LOOK_AT_POSES]
    poses_are_free = NOTHING_IN_THE_WAY in outcomes
    note = ", though the poses that were looked at can each be taken by itself" * poses_are_free
    remedies = ["a smaller clearance"] if poses_are_free and collision.allowed > 0.0 else []
    remedies += ["a task that leaves more free", "the path, or what is in the way, elsewhere"]
    return (
        f"no continuous motion was found that keeps bodies apart{note}; of the best that is known "
        f"the tightest place is {collision.subject} at t = {collision.time:.3f} s; what may help: "
        f"{', '.join(remedies)}"
    )


def metres_text(plan: Plan) -> str:
    """Return how much metres of joints count against radians, and how to change that."""
    weights = ", ".join(f"1 m of '{name}' as {rad:.3g} rad" for name, rad in plan.metres.items())
    names = plan.robot.joint_names
    squares = [f"{plan.metres[name] ** 2:.3g}" if name in plan.metres else "1" for name in names]
    return (
        f"the cost counts {weights}; another number: in the file [[costs]] kind = "
        f'"JointVelocity", weight = [{", ".join(squares)}] (squares, joint by joint), in Python '
        f"JointVelocity(weight=…)"
    )


def show_certificate(
    certificate: Certificate, approaches: Mapping[str, Extreme], console: Console
) -> None:
    """Print the verdict, the closest approach of bodies, and the number of remarks."""
    style = "green" if certificate.verified else "bold red"
    _print(console, with_hint(in_shell(certificate.summary)), style)
    if approaches:
        name, nearest = min(approaches.items(), key=lambda item: item[1].value)
        clearance = (
            f"clearance {with_unit(nearest.value, 'm')} at {nearest.time:.4g} s: {nearest.name}"
        )
        _print(console, clearance if name in nearest.name else f"{clearance} ({name})")
    count = len(certificate.remarks)
    if count:
        # Remarks are shown by their headings alone.
        headings = "; ".join(text.partition(": ")[0] for text in certificate.remarks)
        several = f"{count} remark{'s' * (count != 1)}"
        _print(console, f"{several} on what was checked ({headings}): {_VERBOSE_OPTION}")


def show_program(program: Program, console: Console) -> None:
    """Print the verdict, and the durations of all and of the moves."""
    _print(
        console, with_hint(in_shell(program.summary)), "green" if program.verified else "bold red"
    )
    _print(
        console,
        f"{program.extent} in {program.duration:.2f} s, of it {program.transfer_time:.2f} s moves "
        f"and waits",
    )
    for line in program.kept_told:
        _print(console, line)
    count = len(program.notes)
    if count:
        _print(console, f"{count} note{'s' * (count != 1)}: {_VERBOSE_OPTION}")


def _remedies(message: str) -> str:
    """Return the remedies of a message on reach; general ones where it has none."""
    _, heading, text = message.partition(_REMEDIES)
    if heading:
        return heading + text.partition("; ")[0]
    return (
        "what may help: another --start; a --task that prescribes less; relaxations (--set); the "
        "path in another place (selfmotion place)"
    )


def with_hint(text: str) -> str:
    """Return a summary with the option that lists what it only counts."""
    return re.sub(r"(; and \d+ more)\b", rf"\1 ({_VERBOSE_OPTION})", text, count=1)


def _print(console: Console, text: str, style: str | None = None) -> None:
    # One line of a log; words are kept whole on a terminal.
    console.print(text, style=style, markup=False, soft_wrap=not console.is_terminal)
