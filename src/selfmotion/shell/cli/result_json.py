"""JSON of plans, programs, batches, places and arms: values that `json.dumps` takes."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from selfmotion.certificate import Certificate, Extreme
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.result import Plan
from selfmotion.shell.facts import Fact, facts_of_program, plan_facts
from selfmotion.work.job import Program

if TYPE_CHECKING:
    from selfmotion.work.batch import Batch
    from selfmotion.work.placement import Placement


def batch_json(batch: "Batch") -> dict[str, Any]:
    """Return the rows of a batch."""
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
    """Return joints, tool and redundancy of arms, by name."""
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
    """Return a certificate with its verdict first, the closest approaches and the facts, in SI."""
    return {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        **dataclasses.asdict(certificate),
        "approaches": {name: dataclasses.asdict(near) for name, near in approaches.items()},
        "facts": [item.to_dict() for item in facts],
    }


def plan_json(plan: Plan) -> dict[str, Any]:
    """Return the report and the certificate of a plan."""
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
    """Return the best place and its cost."""
    return {
        "of": placement.of,
        "place": dict(placement.place),
        "cost": placement.cost,
        "cost_before": placement.cost_before,
        "on_bounds": list(placement.on_bounds),
        "verdicts": [plan.certificate.verdict for plan in placement.plans],
    }


def program_json(program: Program) -> dict[str, Any]:
    """Return verdict, steps, events and facts of a program."""
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
