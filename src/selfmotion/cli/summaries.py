"""What commands print unless everything is asked for: the verdict, one number, one remedy."""

import re
from collections.abc import Mapping

from rich.console import Console

from selfmotion.certificate import Certificate, Extreme
from selfmotion.cli.remedies import in_shell
from selfmotion.job import Program
from selfmotion.optimise import Status
from selfmotion.path import Retimed
from selfmotion.result import Plan

# What else a summary leaves out is said by this.
_MORE = "--verbose"
# How a message begins to say what a look at single poses has found.
_HELP = "what would help: "
# A saving of less than this share of the cost is not worth a line.
_WORTH = 0.01
# After these there is nothing to do, unless the message says more than they do.
_ENDED_WELL = (Status.CONVERGED, Status.PRECISION)


def show_plan(plan: Plan, console: Console) -> None:
    """Print the verdict, the cost, how long the motion takes, and what would help most."""
    report, certificate = plan.report, plan.certificate
    show_certificate(certificate, {}, console)
    duration = f"duration {plan.trajectory.duration:.4g} s"
    if report.ending or isinstance(plan.path, Retimed):
        # The cost of a part of the path compares with nothing, and that of another pace is no cost
        # of this motion.
        _print(console, duration)
        if "out of reach" in report.ending:
            _print(console, _help_of(report.message))
        return
    change = ""
    if report.initial_cost:
        share = (report.cost - report.initial_cost) / abs(report.initial_cost)
        ignores = ", which ignores the constraints" if share > 0.0 else ""
        change = f" ({100.0 * share:+.2g} % from the minimum-norm motion{ignores})"
    _print(console, f"cost {report.cost:.6g}{change}, {duration}")
    if plan.metres:
        _print(console, metres_told(plan))
    said = report.status in _ENDED_WELL and report.message == report.status.message
    if certificate.verified and not said:
        _print(console, f"{report.status.value}: {in_shell(report.message)}")
    if report.active and report.cost:
        first = report.active[0]
        share = first.saving / abs(report.cost)
        if share >= _WORTH:
            _print(console, f"{first.easing} would lower the cost by about {100.0 * share:.2g} %")


def metres_told(plan: Plan) -> str:
    """Return what metres counted against radians, and how to have it otherwise."""
    counted = ", ".join(f"1 m of '{name}' as {rad:.3g} rad" for name, rad in plan.metres.items())
    names = plan.robot.joint_names
    squares = [f"{plan.metres[name] ** 2:.3g}" if name in plan.metres else "1" for name in names]
    return (
        f"the cost counts {counted}; another number: in the file [[costs]] kind = "
        f'"JointVelocity", weight = [{", ".join(squares)}] (squares, joint by joint), in Python '
        f"JointVelocity(weight=…)"
    )


def show_certificate(
    certificate: Certificate, approaches: Mapping[str, Extreme], console: Console
) -> None:
    """Print the verdict, how near bodies come, and how much else is to be known."""
    style = "green" if certificate.verified else "bold red"
    _print(console, with_hint(in_shell(certificate.summary)), style)
    if approaches:
        name, nearest = min(approaches.items(), key=lambda item: item[1].value)
        told = f"clearance {1e3 * nearest.value:.4g} mm at {nearest.time:.4g} s: {nearest.name}"
        _print(console, told if name in nearest.name else f"{told} ({name})")
    count = len(certificate.remarks)
    if count:
        _print(console, f"{count} remark{'s' * (count != 1)} on what was checked: {_MORE}")


def show_program(program: Program, console: Console) -> None:
    """Print the verdict, and how long seams and moves take."""
    _print(
        console, with_hint(in_shell(program.summary)), "green" if program.verified else "bold red"
    )
    _print(
        console,
        f"{program.extent} in {program.duration:.2f} s, of it {program.transfer_time:.2f} s moves "
        f"and waits",
    )
    count = len(program.notes)
    if count:
        _print(console, f"{count} note{'s' * (count != 1)}: {_MORE}")


def _help_of(message: str) -> str:
    """Return what would help where a path leaves the reach, as far as it is known."""
    _, found, told = message.partition(_HELP)
    if found:
        return found + told.partition("; ")[0]
    return (
        "what may help: another --start; a --task that prescribes less; --relax; the path "
        "in another place (selfmotion place)"
    )


def with_hint(text: str) -> str:
    """Return a summary that says how to see what it only counts."""
    return re.sub(r"(; and \d+ more)\b", rf"\1 ({_MORE})", text, count=1)


def _print(console: Console, text: str, style: str | None = None) -> None:
    # One line of a log; words are kept whole on a terminal.
    console.print(text, style=style, markup=False, soft_wrap=not console.is_terminal)
