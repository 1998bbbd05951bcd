"""What a folder says is finished is held against what is asked today."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.work.batch import Row
from selfmotion.work.batch.folder import Folder, answers
from selfmotion.work.batch.items import problem_items
from support.arms import robot_named


def toward(seconds: float, far: float = 0.3) -> sm.paths.Path:
    first = robot_named("planar_3r").pose([0.1, 0.9, 0.9])
    return sm.paths.Line(first, SE3(first.rotation, first.translation - [far, 0.0, 0.0]), seconds)


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    limits = [sm.constraints.JointVelocityLimits(2.0), sm.constraints.JointAccelerationLimits(3.0)]
    robot, start = robot_named("planar_3r"), np.array([0.1, 0.9, 0.9])
    windows = [sm.Relaxation("y", 0.01, during=(0.5, 1.0))]
    problem = sm.Problem(
        robot, toward(2.0), "planar", start, constraints=limits, relaxations=windows
    )
    return sm.plan(problem).require()


def test_a_plan_answers_its_own_job_only(plan: sm.Plan) -> None:
    problem = plan.problem
    faster = sm.retime(plan).require()
    assert answers(plan, sm.files.PlanRequest(problem))
    assert answers(faster, sm.files.PlanRequest(problem, goal="retimed"))
    assert not answers(faster, sm.files.PlanRequest(problem))
    slower = [*problem.constraints, sm.constraints.JointVelocityLimits(1.0)]
    others = [
        sm.files.PlanRequest(problem, tolerance=sm.Tolerance(1e-9, 1e-9)),
        sm.files.PlanRequest(replace(problem, path=toward(2.0, 0.31))),
        sm.files.PlanRequest(replace(problem, constraints=slower)),
        sm.files.PlanRequest(replace(problem, relaxations=[])),
    ]
    for job in others:
        assert not answers(plan, job)
        assert not answers(faster, replace(job, goal="retimed"))


def test_a_row_that_names_another_plan_is_run_again(plan: sm.Plan, tmp_path: Path) -> None:
    """Whoever writes rows knows digests as well."""
    folder, item = Folder(tmp_path), problem_items([plan.problem], {})[0]

    def written(other: sm.Plan) -> Row | None:
        file = folder.plan_file(item.name)
        other.save(tmp_path / "other.npz")
        archive = (tmp_path / "other.npz").read_bytes()
        said = Row(item.name, item.key, file, {"path.feed": 3}, goal="fastest", verified=True)
        folder.record(said, archive)
        row = json.loads((tmp_path / "rows" / f"{item.name}.json").read_text())
        assert row["digest"] == hashlib.sha256(archive).hexdigest()
        return folder.finished(item)

    found = written(plan)
    assert found is not None
    assert (found.settings, found.goal, found.aim) == ({}, "best", plan.report.cost)
    assert written(sm.retime(plan)) is None
    loose = replace(plan, certificate=plan.check(sm.Tolerance(0.5, 0.5)))
    assert loose.certificate.verified
    assert written(loose) is None
