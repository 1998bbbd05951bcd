"""Whatever Python can say, a file can: a public parameter is a key, or has a reason not to be."""

import dataclasses
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.collision import obstacle_shapes
from selfmotion.shell.documents import constraint_tables, job_tables, problem_table
from selfmotion.shell.documents.body_tables import BODIES
from selfmotion.shell.documents.constraint_tables import CONSTRAINTS
from selfmotion.shell.documents.cost_tables import COSTS, NULL_MOTIONS
from selfmotion.shell.documents.path_tables import PATHS
from selfmotion.shell.documents.problem_table import ProblemTable
from selfmotion.shell.documents.robot_tables import RobotPartTable, RobotTable
from selfmotion.shell.documents.tables import Table
from support.arms import robot_named

# Parameters that no file has, and why.
WHILE_IT_RUNS = "is of the run, and an option of the command"
EXCEPTIONS = {
    "warm_start": "is another plan: --from",
    "deadline": WHILE_IT_RUNS + ": --deadline",
    "callback": WHILE_IT_RUNS,
    "progress": WHILE_IT_RUNS,
    "executor": WHILE_IT_RUNS + ": --workers, --dask",
    "folder": WHILE_IT_RUNS + ": --folder",
    "robot": "is the robot of the file",
    "problem": "is the file",
    "plan": "is what goal = 'retimed' makes",
    "seams": "are the tables [[seams]]",
    "required": "is true of every feed that somebody asks for; rapids of programs are no feeds",
}
# Of certain tables: said otherwise in files.
OTHERWISE: dict[str, dict[str, str]] = {
    "Problem": {"follows": "are path, task and [[also]]"},
    "plan": {"optimizer": "is the table optimiser"},
    "fastest": {
        "acceleration": "is a constraint JointAccelerationLimits",
        "velocity": "is a constraint JointVelocityLimits",
    },
    "retime": {
        "acceleration": "is a constraint JointAccelerationLimits",
        "velocity": "is a constraint JointVelocityLimits",
        "rate": "is of a controller, not of a problem: retime --rate, export --rate",
    },
    "plan_in_parts": {"rng": "shifts seeds; the rest of the problem says all"},
    "plan_job": {
        "constraints": "are the tables [[constraints]]",
        "clearance": "is the Clearance among them, or collision",
        "warm_start": "is of a run, not of a job: job --from",
    },
    "Clearance": {},
    "load_robot": {
        "urdf": "is name or file, or parts",
        "package_dirs": "are beside the file",
        "geometry": "is of a pinocchio.Model, which is in no file",
    },
    "TwistPath": {"twist": "is a function: breaks and coefficients", "knots": "are the breaks"},
}


def parameters(thing: Callable[..., Any]) -> set[str]:
    found = inspect.signature(thing).parameters
    context = set(getattr(thing, "context", ()))
    return {name for name in found if name not in context and name != "kind"}


def tables() -> list[tuple[str, Callable[..., Any], set[str]]]:
    """Return name, what has the parameters, and the keys that say them."""
    top, paths = keys_of(ProblemTable), PATHS.by_name()
    circle = keys_of(paths["circle"])
    found: list[tuple[str, Callable[..., Any], set[str]]] = [
        ("Problem", sm.Problem, top),
        ("plan", sm.plan, top),
        ("fastest", sm.fastest, top),
        ("retime", sm.retime, top),
        ("plan_in_parts", sm.plan_in_parts, top | keys_of(problem_table.InPartsTable)),
        ("Search", sm.Search, keys_of(problem_table.SearchTable)),
        ("QuasiNewton", sm.QuasiNewton, keys_of(problem_table.QuasiNewtonTable)),
        ("Tolerance", sm.Tolerance, keys_of(problem_table.ToleranceTable)),
        ("Damping", sm.Damping, keys_of(constraint_tables.DampingTable)),
        ("Relaxation", sm.Relaxation, keys_of(constraint_tables.RelaxationTable)),
        ("Clearance", sm.constraints.Clearance, keys_of(constraint_tables.ClearanceTable)),
        ("Follow", sm.Follow, keys_of(problem_table.FollowTable)),
        ("feed of a circle", sm.paths.Feed, circle | {"path", "stretches"}),
        ("Circle.around", sm.paths.Circle.around, circle | {"options"}),
        ("read_path", sm.files.read_path, keys_of(paths["file"])),
        ("load_robot", sm.load_robot, keys_of(RobotTable) | keys_of(RobotPartTable)),
        ("plan_job", sm.plan_job, keys_of(job_tables.JobTable)),
        ("Seam", sm.Seam, keys_of(job_tables.SeamTable)),
    ]
    several = (
        (sm.costs.Cost, COSTS),
        (sm.constraints.Constraint, CONSTRAINTS),
        (sm.motion.NullMotion, NULL_MOTIONS),
        (sm.paths.Path, PATHS),
    )
    for family, one_of in several:
        known = family.kinds()
        for kind, table in one_of.by_name().items():
            if kind not in ("twist", "file", "function"):
                found.append((kind, known[kind], keys_of(table)))
    shapes = dict(obstacle_shapes())
    for shape, table in BODIES.by_name().items():
        found.append((shape, shapes[shape], keys_of(table) | {"pose"}))
    return found


def keys_of(table: type[Table]) -> set[str]:
    return set(table.model_fields)


@pytest.mark.parametrize(
    ("name", "thing", "keys"), [pytest.param(*item, id=item[0]) for item in tables()]
)
def test_every_parameter_is_a_key(name: str, thing: Callable[..., Any], keys: set[str]) -> None:
    own = OTHERWISE.get(name, {})
    missing = parameters(thing) - keys - set(EXCEPTIONS) - set(own)
    assert not missing, f"{name}: {sorted(missing)} cannot be said in a file"


def test_every_exception_has_a_reason_and_a_user() -> None:
    listed = {name: parameters(thing) - keys for name, thing, keys in tables()}
    used = set().union(*listed.values())
    assert set(EXCEPTIONS) <= used
    assert all(EXCEPTIONS.values())


def test_what_is_written_is_planned_the_same_again(tmp_path: Path) -> None:
    """With its search, its optimiser and its goal."""
    job = sm.files.PlanRequest(
        sm.sample_problem(),
        search=sm.Search(starts=7, finalists=2, mode="local", rng=3),
        optimizer=sm.QuasiNewton(),
        tolerance=sm.Tolerance(1e-5, 2e-5),
        max_evaluations=9,
        outputs=(tmp_path / "out" / "a.csv",),
        goal="retimed",
    )
    for name in ("job.toml", "job.json"):
        sm.files.write_problem(job, tmp_path / name)
        again = sm.files.read_job(tmp_path / name)
        assert again.search == job.search
        assert again.tolerance == job.tolerance
        assert dataclasses.asdict(again.optimizer) == dataclasses.asdict(job.optimizer)  # type: ignore[call-overload]
        assert (again.max_evaluations, again.goal) == (9, "retimed")
        assert [file.resolve() for file in again.outputs] == [tmp_path / "out" / "a.csv"]
    by_chance = dataclasses.replace(job, search=sm.Search(rng=np.random.default_rng(1)))
    with pytest.raises(sm.errors.ProblemError, match="search: rng is a generator"):
        sm.files.write_problem(by_chance, tmp_path / "a.toml")


def test_a_goal_says_what_is_looked_for() -> None:
    arm = robot_named("planar_3r")
    start = np.array([0.4, 0.6, 0.5])
    end = arm.pose(start)
    end.translation = end.translation + np.array([-0.3, 0.2, 0.0])
    limits = [sm.constraints.JointVelocityLimits(2.0), sm.constraints.JointAccelerationLimits(4.0)]
    line = sm.paths.Line(arm.pose(start), end, 8.0)
    problem = sm.Problem(arm, line, "planar", start, constraints=limits)
    own, retimed = (sm.files.PlanRequest(problem, goal=goal).plan() for goal in ("best", "retimed"))
    assert retimed.certificate.verified
    assert retimed.trajectory.duration < 0.5 * own.trajectory.duration
    parts = sm.files.PlanRequest(problem, goal="parts", parts={"ramp": 0.2})
    with pytest.raises(sm.errors.ProblemError, match=r"goal: is 'parts'"):
        parts.plan()
    with pytest.raises(sm.errors.ProblemError, match="search: has no effect on a motion in parts"):
        dataclasses.replace(parts, search=sm.Search()).in_parts()


def test_what_has_no_effect_on_a_goal_is_refused(tmp_path: Path) -> None:
    robot = robot_named("planar_3r")
    start = np.array([0.1, 0.9, 0.9])
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 0.1), 2.0)
    problem = sm.Problem(robot, line, "planar", start)
    keep, parts = {"JointVelocity": 1.1}, {"retreat": 0.1}
    for goal, given, said in (
        ("best", {"keep": keep}, "keep: has no effect on the best motion"),
        ("retimed", {"parts": parts}, "parts: has no effect on the retimed motion"),
        ("fastest", {"parts": parts}, "parts: has no effect on the fastest motion"),
        ("parts", {"keep": keep}, "keep: has no effect on a motion in parts"),
    ):
        job = sm.files.PlanRequest(problem, goal=goal, **given)
        with pytest.raises(sm.errors.ProblemError, match=said):
            job.in_parts() if goal == "parts" else job.plan()
    with pytest.raises(sm.errors.ProblemError, match="goal is 'quick', expected one of"):
        sm.files.PlanRequest(problem, goal="quick")
    file = tmp_path / "cell.toml"
    sm.files.write_problem(problem, file)
    file.write_text(file.read_text() + '\n[grid]\n"path.duration" = [3, 4]\n')
    with pytest.raises(sm.errors.FileFormatError, match="grid: stands for many problems"):
        sm.read_problem(file)
