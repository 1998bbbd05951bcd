"""Summaries of results: the short form for the terminal, and JSON for programs."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console

from selfmotion.certificate import Certificate, Extreme
from selfmotion.model.path import Retimed
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan
from selfmotion.shell.facts import Fact, facts_of_program, plan_facts, with_unit
from selfmotion.work.job import Program

if TYPE_CHECKING:
    from selfmotion.work.batch import Batch
    from selfmotion.work.placement import Placement

# As the library says it → as the shell does, in this order.
_WORDS = (
    (r"take robot\.inverse_kinematics\(.*?\), task, seed=start\)", "give another --start"),
    (r"\btask='(\w+)'", r"--task \1"),
    (r"\bcorners='(\w+)'", r"--set path.corners=\1"),
    (r"\(?\brelaxations=\)?", "with relaxations (--set)"),
    (r"\b(tool|start|feed)=(?=[\s;,.)]|$)", r"--\1"),
    (r"\block=(?=[\s;,.)]|$)", "--set robot.lock.NAME=VALUE"),
    (r"\bduration=(?=[\s;,.)]|$)", "--set path.duration=SECONDS"),
    (
        r"\b(acceleration|velocity)=(?=[\s;,.)]|$)",
        lambda found: f"--set constraints.Joint{found[1].capitalize()}Limits.limit=NUMBER",
    ),
    (r"give force=True to write it", "export --force writes it"),
    (r"give a larger jump", "give a larger --set path.jump"),
    (r"either a feed \[m/s\] or a duration \[s\]", "either --feed (m/s) or path.duration (s)"),
    (r"so that feed has no effect; drop one", "so that --feed has no effect; drop it"),
    (r"so that duration has no effect; drop one", "so that path.duration has no effect; drop it"),
    (r"which needs a feed \[m/s\]; give it", "which needs --feed (m/s)"),
    (r"\(Feed\.original\)", "(a duration in its place)"),
    (r"\(within=\)", "(--set path.within=0.5)"),
    (r"\((acceleration|turn_acceleration|turn_rate|within)=([0-9.e+]+)\)", r"(--set path.\1=\2)"),
    (r"(?<!path\.)\bflip_normals\b", "--set path.flip_normals"),
    (r"\b(rotary|unit) = '(\w+)'", r"--set path.\1=\2"),
    (r"(?<!path\.)\brotary_(axes|center)\b", r"--set path.rotary_\1"),
    (r"(?<=: )(columns|standoff|rotary|ramp|unit) (?=has|is)", r"--set path.\1 "),
    (r"raise max_evaluations", "raise --set max_evaluations"),
    (r"give columns \(", "give --set path.columns ("),
    (r"choose another task \(", "choose another --task ("),
    (r"choose a task with fewer rows \(", "take another --task ("),
)
# Such a message is about a key of the file, or of a seam in it, and says what can be written there.
_OF_PROBLEM_FILE = re.compile(r"^(\S+\.(toml|json): |seam ')")


def in_shell(message: str) -> str:
    """Return a message with the names of options for those of arguments."""
    if _OF_PROBLEM_FILE.match(message):
        return message
    for words, option in _WORDS:
        message = re.sub(words, option, message)
    return message


# What else a summary leaves out is said by this.
_MORE = "--verbose"
# How a message begins to say what a look at single poses has found.
_HELP = "what would help: "
# A saving of less than this share of the cost is not worth a line; larger ones are told as those of
# a step that saves some 1 %.
_WORTH = 0.009
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
    if blocked := blocked_text(plan):
        _print(console, blocked)
    if plan.metres:
        _print(console, metres_text(plan))
    said = report.status in _ENDED_WELL and report.message == report.status.message
    if certificate.verified and not said:
        told = in_shell(report.message).removeprefix(f"{report.status.value}: ")
        _print(console, f"{report.status.value}: {told}")
    if report.active and report.cost:
        first = report.active[0]
        share = first.saving / abs(report.cost)
        if share >= _WORTH:
            _print(
                console,
                f"{first.easing} would lower the cost by about {100.0 * share:.2g} % (a slope: "
                f"more of it saves less than in proportion)",
            )


def blocked_text(plan: Plan) -> str:
    """Return that bodies leave no motion that was found, and what may help; "" where they do not.

    Where it begins was free to choose.
    """
    broken = [item for item in plan.certificate.findings if item.unit == "m" and not item.satisfied]
    met = next((item for item in broken if item.requirement == "clearance"), None)
    if met is None or plan.problem.given_start is not None or not plan.certificate.on_path:
        return ""
    looks = [item.outcome for item in plan.report.attempts if item.name == "look at single poses"]
    single = "nothing is in the way" in looks
    poses = ", though the poses that were looked at can each be taken by itself" * single
    smaller = ["a smaller clearance"] if single and met.allowed > 0.0 else []
    more = "a task that leaves more free", "the path, or what is in the way, elsewhere"
    helps = ", ".join([*smaller, *more])
    return (
        f"no continuous motion was found that keeps bodies apart{poses}; of the best that is known "
        f"the tightest place is {met.subject} at t = {met.time:.3f} s; what may help: {helps}"
    )


def metres_text(plan: Plan) -> str:
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
        told = f"clearance {with_unit(nearest.value, 'm')} at {nearest.time:.4g} s: {nearest.name}"
        _print(console, told if name in nearest.name else f"{told} ({name})")
    count = len(certificate.remarks)
    if count:
        # What was left out of a verdict is named beside it, in as many words as a line has.
        heads = "; ".join(text.partition(": ")[0] for text in certificate.remarks)
        several = f"{count} remark{'s' * (count != 1)}"
        _print(console, f"{several} on what was checked ({heads}): {_MORE}")


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
    for line in program.kept_told:
        _print(console, line)
    count = len(program.notes)
    if count:
        _print(console, f"{count} note{'s' * (count != 1)}: {_MORE}")


def _help_of(message: str) -> str:
    """Return what would help where a path leaves the reach, as far as it is known."""
    _, found, told = message.partition(_HELP)
    if found:
        return found + told.partition("; ")[0]
    return (
        "what may help: another --start; a --task that prescribes less; relaxations (--set); the "
        "path in another place (selfmotion place)"
    )


def with_hint(text: str) -> str:
    """Return a summary that says how to see what it only counts."""
    return re.sub(r"(; and \d+ more)\b", rf"\1 ({_MORE})", text, count=1)


def _print(console: Console, text: str, style: str | None = None) -> None:
    # One line of a log; words are kept whole on a terminal.
    console.print(text, style=style, markup=False, soft_wrap=not console.is_terminal)


def batch_json(batch: "Batch") -> dict[str, Any]:
    """Return the rows of a batch as JSON-safe values."""
    rows = [
        {key: str(value) if key == "file" else value for key, value in vars(row).items()}
        for row in batch.rows
    ]
    for row in rows:
        if row["error"] or row["ends"] is not None:
            row["cost"] = row["initial_cost"] = None
    best = [str(file) for file in batch.best_files]
    return {"folder": str(batch.folder), "resumed": batch.resumed, "best_files": best, "rows": rows}


def robots_json(robots: Mapping[str, RobotModel]) -> dict[str, Any]:
    """Return arms by name, as JSON-safe values."""
    return {
        name: {
            "joints": list(robot.joint_names),
            "tool": robot.tool,
            "redundancy": {
                task.value: robot.redundancy(task) for task in Task if robot.can_follow(task)
            },
        }
        for name, robot in robots.items()
    }


def certificate_json(
    certificate: Certificate, approaches: Mapping[str, Extreme], facts: Sequence[Fact]
) -> dict[str, Any]:
    """Return a certificate as JSON-safe values, the verdict first; with how near bodies come.

    The facts are what tables show, in SI.
    """
    return {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        **dataclasses.asdict(certificate),
        "approaches": {name: dataclasses.asdict(near) for name, near in approaches.items()},
        "facts": [item.to_dict() for item in facts],
    }


def plan_json(plan: Plan) -> dict[str, Any]:
    """Return how a plan was found and what the check says, as JSON-safe values."""
    report = plan.report
    return {
        "robot": plan.robot.name,
        "task": plan.task.value,
        "cost": report.cost,
        "initial_cost": report.initial_cost,
        "terms": dict(report.terms),
        "initial_terms": dict(report.initial_terms),
        "evaluations": report.evaluations,
        "iterations": report.iterations,
        "seconds": report.seconds,
        "status": report.status.value,
        "message": report.message,
        "duration": plan.trajectory.duration,
        "limits_used": {
            "busy": plan.limits_used.busy,
            "shares": dict(plan.limits_used.shares),
        },
        "reversals": {name: times.tolist() for name, times in plan.reversals.times.items()},
        "metres": dict(plan.metres),
        "certificate": certificate_json(plan.certificate, plan.approaches, plan_facts(plan)),
    }


def placement_json(placement: "Placement") -> dict[str, Any]:
    """Return the best place, as JSON-safe values."""
    return {
        "of": placement.of,
        "place": dict(placement.place),
        "cost": placement.cost,
        "cost_before": placement.cost_before,
        "on_bounds": list(placement.on_bounds),
        "verdicts": [plan.certificate.verdict for plan in placement.plans],
    }


def program_json(program: Program) -> dict[str, Any]:
    """Return the steps of a program and what is known of it, as JSON-safe values."""
    return {
        "verified": program.verified,
        "verdict": program.verdict,
        "duration": program.duration,
        "transfer_time": program.transfer_time,
        "bound": program.bound,
        "missing": dict(program.missing),
        "kept": dict(program.kept or {}),
        "notes": list(program.notes),
        "steps": [
            {
                "name": step.name,
                "kind": "seam" if step.is_seam else "move",
                "backwards": step.turned,
                "begin": begin,
                "duration": 0.0 if step.is_missing else step.motion.duration,
            }
            for begin, step in zip(program.begins, program.steps, strict=True)
        ],
        "events": [
            {"time": time, "seam": seam, "event": event} for time, seam, event in program.events
        ],
        "facts": [item.to_dict() for item in facts_of_program(program)],
    }
