"""What the commands print for programs."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from selfmotion.certificate import Certificate, Extreme
from selfmotion.job import Program
from selfmotion.result import Plan
from selfmotion.robot import RobotModel
from selfmotion.task import Task

if TYPE_CHECKING:
    from selfmotion.batch import Batch


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


def certificate_json(certificate: Certificate, approaches: Mapping[str, Extreme]) -> dict[str, Any]:
    """Return a certificate as JSON-safe values, the verdict first; with how near bodies come."""
    return {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        **dataclasses.asdict(certificate),
        "approaches": {name: dataclasses.asdict(near) for name, near in approaches.items()},
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
        "certificate": certificate_json(plan.certificate, plan.approaches),
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
    }
