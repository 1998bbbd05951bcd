"""What is given makes a difference, or is refused by name: every parameter, and every key."""

import copy
import inspect
import json
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import read_document
from selfmotion.model.task import SE3
from selfmotion.problem.problem import problem_to_dict
from selfmotion.shell.documents import json_schema
from selfmotion.shell.documents.job_tables import JobFile
from support.arms import PANDA_HOME, robot_named
from support.places import ROOT

PANDA = robot_named("panda")
HERE = PANDA.pose(PANDA_HOME)
FAR, FURTHER = np.array([0.0, 0.6, 0.6]), np.array([0.0, 0.5, 0.0])


def line(seconds: float = 2.0) -> sm.paths.Path:
    there = SE3(HERE.rotation, HERE.translation + np.array([0.0, 0.05, 0.0]))
    return sm.paths.Line(HERE, there, seconds)


def box(name: str, at: np.ndarray) -> sm.obstacles.Obstacle:
    return sm.obstacles.Box(name, at, [0.05, 0.05, 0.05])


# For each parameter of a problem a value that matters to the motion below.
PROBLEM: dict[str, Any] = {
    "robot": sm.load_robot("panda", tool="panda_link8"),
    "path": line(2.5),
    "task": "position",
    "start": PANDA_HOME,
    "null_motion": sm.PolynomialNullMotion(2),
    "costs": [sm.costs.JointVelocity(weight=2.0)],
    "constraints": [sm.constraints.JointPositionLimits(PANDA_HOME - 1e-3, PANDA_HOME + 1e-3)],
    "relaxations": [sm.Relaxation("y", 0.02)],
    "damping": sm.Damping(),
    "clearance": [
        sm.constraints.Clearance([box("post", HERE.translation)], 0.01),
        sm.constraints.Clearance([box("wall", HERE.translation + FAR)], 0.01),
    ],
    "rest": False,
    "also": [sm.Follow(PANDA.pose(PANDA_HOME), "position", tool="panda_link1")],
}
# What no certificate judges is seen in the problem itself.
UNJUDGED = ("start", "null_motion", "costs")


def wobble() -> sm.Trajectory:
    """A motion near the home configuration that rests nowhere."""
    t = np.linspace(0.0, 2.0, 9)
    rates = 0.1 * np.cos(3.0 * t)[:, None] * np.linspace(0.5, 1.0, 7)
    q = PANDA_HOME + np.cumsum(rates, axis=0) * 0.01
    return sm.Trajectory(t, q, rates, PANDA.joint_names)


MOTION = wobble()


def seen(given: Mapping[str, Any]) -> str:
    """Return what is seen of a problem: what its certificate says of a motion, or the refusal."""
    base = {"robot": PANDA, "path": line(), "task": "pose"}
    try:
        problem = sm.Problem(**{**base, **given})
        if problem.damping is not None:
            # Of damping a certificate tells where it acted.
            return f"damped {problem.damping_law} {seen({**given, 'damping': None})}"
        found = problem.certify(MOTION)
    except sm.SelfmotionError as error:
        return f"refused: {error}"
    return json.dumps(
        [
            *(item.to_dict() for item in problem.costs),
            None if problem.start is None else np.asarray(problem.start).tolist(),
            problem.null_motion.to_dict(),
            found.covers,
            found.failures,
            [(item.requirement, item.amount) for item in found.findings],
            [item.value for item in found.deviations],
            [one.value for pair in found.others for one in pair],
            [item.name for item in problem.requirements for item in item.obstacles],
        ]
    )


def test_each_parameter_of_a_problem_has_a_value_that_matters() -> None:
    assert set(PROBLEM) == set(inspect.signature(sm.Problem).parameters)


@pytest.mark.parametrize("name", PROBLEM)
def test_a_problem_uses_or_refuses_all_it_is_given(name: str) -> None:
    """Alone, and beside each other parameter, whichever of both could take its place."""
    alone = seen({name: PROBLEM[name]})
    assert alone != seen({})
    for other, value in PROBLEM.items():
        if other != name:
            both = seen({name: PROBLEM[name], other: value})
            assert both != seen({other: value}) or both.startswith("refused: "), other


# Each function with a small job that it does, and for each of its parameters another value; what
# it returns is compared. What is of the run alone is seen by what it does.
def planned(**given: Any) -> Any:
    robot = robot_named("planar_3r")
    start = np.array([0.1, 0.9, 0.9])
    path = sm.paths.Line(robot.pose(start), robot.pose(start + 0.2), 2.0)
    problem = given.pop("problem", sm.Problem(robot, path, "planar"))
    plan = sm.plan(problem, **given)
    report = plan.report
    attempts = [(item.name, item.outcome) for item in report.attempts]
    known = plan.trajectory.digest, plan.tolerance, report.evaluations, report.gap, report.status
    return known, attempts


def told() -> tuple[list[Any], Callable[..., None]]:
    heard: list[Any] = []
    return heard, lambda *words: heard.append(words)


def test_each_parameter_of_plan_matters() -> None:
    robot = robot_named("planar_3r")
    start = np.array([0.1, 0.9, 0.9])
    path = sm.paths.Line(robot.pose(start), robot.pose(start + 0.2), 2.0)
    given = sm.Problem(robot, path, "planar", start)
    heard, tell = told()
    iterations: list[Any] = []
    changed = {
        "problem": given,
        "optimizer": sm.QuasiNewton(max_iterations=1),
        "search": sm.Search(starts=2, finalists=1),
        "warm_start": sm.plan(given),
        "tolerance": sm.Tolerance(1e-4, 1e-4),
        "max_evaluations": 1,
        "deadline": 1e-9,
        "callback": lambda step: bool(iterations.append(step)),
        "progress": tell,
    }
    assert set(changed) == set(inspect.signature(sm.plan).parameters)
    base = planned()
    for name, value in changed.items():
        try:
            found = planned(**{name: value})
        except sm.errors.PlanError as refused:
            found = str(refused)
        assert found != base or {"callback": iterations, "progress": heard}.get(name), name
    # A search has no effect on a given start: that is said.
    with pytest.raises(sm.errors.ProblemError, match="search"):
        sm.plan(given, search=sm.Search(starts=3))


@pytest.mark.site
def test_each_parameter_of_move_matters() -> None:
    last = PANDA_HOME + 0.3
    heard, tell = told()
    changed = {
        "robot": sm.load_robot("panda", tool="panda_link8"),
        "first": PANDA_HOME + 0.01,
        "last": last + 0.01,
        "constraints": [sm.constraints.JointVelocityLimits(0.1)],
        "clearance": sm.constraints.Clearance([box("far", FAR + FURTHER)], 0.01),
        "via": [PANDA_HOME + 0.2 * np.arange(7) / 7.0],
        "task": "position",
        "seconds": 1e-9,
        "rng": 1,
        "progress": tell,
    }
    assert set(changed) == set(inspect.signature(sm.move).parameters)

    def found(**given: Any) -> Any:
        made = sm.move(**{"robot": PANDA, "first": PANDA_HOME, "last": last, **given})
        motion = None if made.trajectory is None else made.trajectory.digest
        return made.robot.tool, motion, made.trouble, [item.name for item in made.obstacles]

    base = found()
    for name, value in changed.items():
        try:
            other = found(**{name: value})
        except sm.errors.ProblemError as error:
            other = f"{name}: refused" if name in str(error) else base
        # The straight move is found at once, whatever the seed, and before any time is up.
        if name not in ("rng", "seconds"):
            assert other != base or (name == "progress" and heard), name
    # A constraint on an end is nothing that a move keeps: its ends are given.
    with pytest.raises(sm.errors.ProblemError, match="EndConfiguration"):
        found(constraints=[sm.constraints.EndConfiguration(last)])
    # Where no way is straight, seed and seconds matter.
    turns = np.array([[0.9, 1.2, 0.0, 0.5, 0.0, 0.0, 0.0], [-0.9, 1.2, 0.0, 0.5, 0.0, 0.0, 0.0]])
    past = dict(zip(("first", "last"), PANDA_HOME + turns, strict=True))
    post = sm.constraints.Clearance(
        [sm.obstacles.Box("post", [0.55, 0.0, 0.25], [0.15, 0.15, 0.5])], 0.005
    )
    ways = [found(clearance=post, **past, rng=seed)[1] for seed in (0, 1)]
    assert ways[0] != ways[1]
    assert "no way was found" in found(clearance=post, **past, seconds=1e-9)[2]


def test_each_parameter_of_other_paces_matters() -> None:
    plan = sm.plan(sm.Problem(PANDA, line(), start=PANDA_HOME, clearance=None))
    base = sm.retime(plan).trajectory.digest
    changed: dict[str, Any] = {"plan": None, "acceleration": 1.0, "velocity": 0.05, "rate": 125.0}
    assert set(changed) == set(inspect.signature(sm.retime).parameters)
    for name, value in list(changed.items())[1:]:
        assert sm.retime(plan, **{name: value}).trajectory.digest != base, name
    fed = sm.plan(sm.Problem(PANDA, sm.paths.Feed(line(), 0.02), start=PANDA_HOME, clearance=None))
    for call in (lambda: sm.retime(fed), lambda: sm.fastest(fed.problem)):
        with pytest.raises(sm.errors.ProblemError, match=r"asks for a feed of 0\.02 m/s"):
            call()


@pytest.mark.site
def test_each_parameter_of_fastest_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    # One round shows it as well as many.
    monkeypatch.setattr(sys.modules["selfmotion.planning.planner.fastest"], "ROUNDS", 1)
    robot, (heard, tell) = robot_named("planar_3r"), told()
    start = np.array([0.1, 0.9, 0.9])
    path = sm.paths.Line(robot.pose(start), robot.pose(start + 0.2), 2.0)
    problem = sm.Problem(robot, path, "planar", start)
    free = sm.Problem(robot, path, "planar")
    changed: dict[str, Any] = {
        "problem": free,
        "acceleration": 1.0,
        "velocity": 0.05,
        "keep": {"JointVelocity": 1.0001},
        "tolerance": sm.Tolerance(1e-4, 1e-4),
        "deadline": 1e-9,
        "progress": tell,
    }
    assert {"search", *changed} == set(inspect.signature(sm.fastest).parameters)

    def found(**given: Any) -> Any:
        asked = {"problem": problem, "acceleration": 2.0, **given}
        try:
            best = sm.fastest(**asked).plan
        except (sm.errors.ProblemError, sm.errors.PlanError) as error:
            return str(error)
        return best.trajectory.digest, best.tolerance

    base = found()
    for name, value in changed.items():
        assert found(**{name: value}) != base or (name == "progress" and heard), name
    # A search has no effect on a given start: that is said.
    assert "search" in found(search=sm.Search(starts=3))


@pytest.mark.site
def test_each_parameter_of_a_job_matters(tmp_path: Path) -> None:
    down = np.diag([1.0, -1.0, -1.0])

    def seam(name: str, y: float) -> sm.Seam:
        ends = (SE3(down, np.array([x, y, 0.3])) for x in (0.4, 0.45))
        return sm.Seam(name, sm.paths.Line(*ends, 1.0), "pointing")

    heard, tell = told()
    home = PANDA_HOME + 0.01
    listed = [seam("b", 0.1), seam("a", -0.1)]
    changed: dict[str, Any] = {
        "robot": sm.load_robot("panda", tool="panda_link8"),
        "seams": listed[:1],
        "start": home,
        "end": home,
        "order": "given",
        "constraints": [sm.constraints.JointVelocityLimits(0.3)],
        "clearance": sm.constraints.Clearance([box("far", FAR + FURTHER)], 0.01),
        "branches": 2,
        "seconds_per_cost": 5.0,
        "move_seconds": 1e-9,
        "deadline": 1e-9,
        # Of a program that begins elsewhere, the seam does as well.
        "warm_start": sm.plan_job(PANDA, [seam("a", -0.05)], branches=1, start=home),
        "folder": tmp_path,
        "executor": ThreadPoolExecutor(1),
        "rng": 1,
        "progress": tell,
    }
    assert set(changed) == set(inspect.signature(sm.plan_job).parameters)
    # The order alone needs two.
    quick: dict[str, Any] = {
        "robot": PANDA,
        "seams": listed[1:],
        "branches": 1,
        "start": PANDA_HOME,
    }

    def found(**given: Any) -> Any:
        program = sm.plan_job(**{**quick, **given})
        bodies = sorted({item.name for plan in program.plans.values() for item in plan.obstacles})
        asked = program.specification
        assert asked is not None
        return [step.made.trajectory.digest for step in program.steps], bodies, asked.in_order

    base = found()
    for name, value in changed.items():
        if name in ("seconds_per_cost", "move_seconds", "branches"):
            # Of two seams with a straight move there is nothing to choose or to look for.
            continue
        if name == "executor":
            with value as executor:
                assert found(executor=executor) == base
            continue
        if name in ("order", "rng"):
            assert found(seams=listed, **{name: value}) != found(seams=listed), name
            continue
        if name == "deadline":
            with pytest.raises(sm.errors.DeadlineError, match="deadline of 1e-09 s"):
                found(deadline=value)
            continue
        other = found(**{name: value})
        if name == "folder":
            assert list(tmp_path.glob("*.npz"))
        else:
            assert other != base or (name == "progress" and heard), name
    for wrong in ([sm.constraints.EndConfiguration(home)], [sm.constraints.Clearance()]):
        with pytest.raises(sm.errors.ProblemError, match=type(wrong[0]).__name__):
            found(constraints=wrong)


def leaves(value: Any, where: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where each number, text and truth of a document is."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from leaves(item, (*where, key))
    elif isinstance(value, list) and not all(isinstance(item, int | float) for item in value):
        for k, item in enumerate(value):
            yield from leaves(item, (*where, k))
    else:
        yield where


def other_than(value: Any) -> Any:
    """Return another value of the same kind, near enough to be meant."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return 1.05 * value if value else 0.013
        case str():
            return f"{value}x"
        case [*numbers]:
            return [1.05 * numbers[0] if numbers[0] else 0.013, *numbers[1:]]
    raise AssertionError(f"a document has {value!r}")


def said(document: Mapping[str, Any], folder: Path, is_job: bool) -> str:
    """Return all that a document says, or its refusal."""
    file = folder / "changed.json"
    file.write_text(json.dumps(document))
    try:
        if is_job:
            job = sm.files.read_seam_job(file)
            seams = [
                (seam.name, seam.path.to_dict(), seam.events, seam.wait, seam.after, str(seam.task))
                for seam in job.seams
            ]
            return repr((job, seams, job.robot.urdf.sha256, job.robot.tools))
        read = sm.files.read_job(file)
        described = problem_to_dict(read.problem)
        return json.dumps(described, sort_keys=True) + repr(
            (read.settings, read.outputs, read.goal, read.parts, read.keep)
        )
    except sm.SelfmotionError as error:
        return f"refused: {error}"


DOCUMENTS = [("cell.toml", False), ("slot.toml", True), ("frame.toml", True)]


@pytest.mark.parametrize(("name", "is_job"), DOCUMENTS)
def test_each_key_of_a_file_matters(name: str, is_job: bool, tmp_path: Path) -> None:
    source = ROOT / "examples" / name
    for beside in (ROOT / "examples").glob("*"):
        if beside.suffix in (".csv", ".nc", ".stl"):
            (tmp_path / beside.name).write_bytes(beside.read_bytes())
    document = tomllib.loads(source.read_text())
    assert read_document(source)
    base = said(document, tmp_path, is_job)
    assert not base.startswith("refused")
    for where in leaves(document):
        changed = copy.deepcopy(document)
        *path, last = where
        table = changed
        for key in path:
            table = table[key]
        table[last] = other_than(table[last])
        assert said(changed, tmp_path, is_job) != base, where


def test_a_job_refuses_the_keys_of_a_problem_that_no_seam_has(tmp_path: Path) -> None:
    """Such as damping, a search, or files to write."""
    source = ROOT / "examples" / "frame.toml"
    document = tomllib.loads(source.read_text())
    (tmp_path / "seams.csv").write_bytes((ROOT / "examples" / "seams.csv").read_bytes())
    lost = set(json_schema()["properties"]) - set(JobFile.model_fields)
    assert {"damping", "search", "outputs", "tolerance", "path"} <= lost
    for key in lost:
        file = tmp_path / "job.json"
        file.write_text(json.dumps(document | {key: True}))
        with pytest.raises(sm.errors.FileFormatError, match=rf"{key}\b"):
            sm.files.read_seam_job(file)
