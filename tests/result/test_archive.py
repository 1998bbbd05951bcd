"""Plans come back from files without loss, or are refused by name."""

import dataclasses
import importlib
import json
import re
from collections.abc import Callable, Iterator
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import files
from selfmotion.planning.result import key_of, own_modules
from support.arms import robot_named

# What a motion is at its nodes comes out of its polynomials [rad, rad/s].
ROUNDING = 1e-13


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def assert_same(one: sm.Certificate, other: sm.Certificate) -> None:
    """Equal but for the last digits of when extremes are: roots depend on where arrays lie."""
    for mine, its in zip(one.findings, other.findings, strict=True):
        assert dataclasses.replace(mine, time=its.time, amount=its.amount) == its
        assert (mine.time, mine.amount) == pytest.approx((its.time, its.amount), rel=1e-12)
    assert dataclasses.replace(one, findings=other.findings) == other


def test_saved_plans_come_back_without_loss(plan: sm.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "folder" / "plan.npz")
    loaded = sm.load_plan(tmp_path / "folder" / "plan.npz")
    for one, other in (
        (plan.trajectory, loaded.trajectory),
        (plan.initial_trajectory, loaded.initial_trajectory),
    ):
        for name in ("t", "q", "qd", "qdd"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert one.joint_names == other.joint_names
    np.testing.assert_array_equal(plan.coefficients, loaded.coefficients)
    assert_same(loaded.certificate, plan.certificate)
    assert loaded.task is plan.task
    for field in dataclasses.fields(plan.report):
        if field.name != "history":
            assert getattr(loaded.report, field.name) == getattr(plan.report, field.name)
    for one, other in zip(plan.report.history, loaded.report.history, strict=True):
        np.testing.assert_array_equal(one.x, other.x)
        assert dataclasses.replace(one, x=other.x) != one or one.cost == other.cost
    again = sm.certify(loaded.robot, loaded.path, loaded.task, loaded.trajectory)
    # Which problem it is of, only a problem knows.
    problem = plan.certificate.problem
    assert_same(dataclasses.replace(again, problem=problem), plan.certificate)


def test_continuous_joints_and_locks_survive(tmp_path: Path) -> None:
    for name, lock in (("kinova", {}), ("tiago", {"torso_lift_joint": 0.2})):
        robot = sm.load_robot(name, lock=lock)
        start = robot.dexterous_configuration("position")
        path = sm.paths.Circle.around(robot.pose(start), 0.03, 3.0)
        plan = sm.plan(sm.Problem(robot, path, "position", start))
        plan.save(tmp_path / "plan.npz")
        loaded = sm.load_plan(tmp_path / "plan.npz").robot
        assert loaded.joint_names == robot.joint_names
        assert loaded.locked == robot.locked
        np.testing.assert_array_equal(loaded.upper, robot.upper)
        np.testing.assert_array_equal(loaded.pose(start).homogeneous, robot.pose(start).homogeneous)


@pytest.mark.parametrize(
    ("name", "share"),
    [("velocity_limit", 1e-3), ("lower", 0.9), ("effort_limit", 0.5), ("jerk_limit", 0.5)],
)
def test_limits_that_an_arm_was_given_survive(
    plan: sm.Plan, name: str, share: float, tmp_path: Path
) -> None:
    """What is not verified within them is not when it is read, and no problem file has them."""
    limit = np.where(np.isfinite(getattr(plan.robot, name)), getattr(plan.robot, name), 10.0)
    robot = dataclasses.replace(plan.robot, **{name: share * limit})
    problem = dataclasses.replace(plan.problem, robot=robot)
    other = dataclasses.replace(plan, problem=problem)
    other = dataclasses.replace(other, certificate=other.check())
    other.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    np.testing.assert_array_equal(getattr(loaded.robot, name), share * limit)
    assert loaded.problem.digest == problem.digest != plan.problem.digest
    assert loaded.certificate.verified == other.certificate.verified
    assert loaded.certificate.verified == (name in ("lower", "effort_limit"))
    with pytest.raises(
        sm.errors.ProblemError, match=f"its {name} is another than it is loaded with"
    ):
        sm.files.write_problem(problem, tmp_path / "problem.toml")


def test_csv_has_every_digit(plan: sm.Plan, tmp_path: Path) -> None:
    sm.files.write_motion(plan, tmp_path / "plan.csv")
    lines = (tmp_path / "plan.csv").read_text().splitlines()
    assert lines[0].split(",")[:3] == ["t", "joint1", "joint2"]
    table = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    motion = plan.trajectory
    columns = np.column_stack([motion.t, motion.q, motion.qd])
    np.testing.assert_allclose(table[:, :7], columns, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(table[:, 7:], motion.qdd, rtol=1e-9, atol=1e-9)
    again = sm.Trajectory.from_csv(tmp_path / "plan.csv")
    t = np.linspace(motion.t[0], motion.t[-1], 300)
    np.testing.assert_allclose(again(t), motion(t), rtol=0, atol=ROUNDING)
    # Of what is written no digit is lost.
    np.testing.assert_array_equal(table[:, :7], np.column_stack([again.t, again.q, again.qd]))


def test_files_that_are_no_plans_are_named(plan: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.FileFormatError, match=r"none\.npz: no such file"):
        sm.load_plan(tmp_path / "none.npz")
    text = tmp_path / "text.npz"
    text.write_text("not a plan")
    with pytest.raises(sm.errors.FileFormatError, match=r"cell\.program: no such file"):
        sm.load_plan(tmp_path / "cell.program")
    (tmp_path / "cell.program").touch()
    with pytest.raises(sm.errors.FileFormatError, match="holds several plans"):
        sm.load_plan(tmp_path / "cell.program")
    with pytest.raises(sm.errors.FileFormatError, match=r"text\.npz: is no plan"):
        sm.load_plan(text)
    np.savez(tmp_path / "other.npz", a=np.zeros(2))
    with pytest.raises(sm.errors.FileFormatError, match=r"other\.npz: is no plan"):
        sm.load_plan(tmp_path / "other.npz")
    files.write_archive(tmp_path / "empty.npz", {}, {})
    with pytest.raises(sm.errors.FileFormatError, match="its format is None"):
        sm.load_plan(tmp_path / "empty.npz")


@pytest.mark.parametrize(
    ("load", "key", "kind"),
    [(sm.load_plan, "format", "plan"), (sm.files.load_move, "move", "move")],
)
def test_files_of_another_version_say_so(
    load: Callable[[Path], object], key: str, kind: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    for found, told in ((0, f"an older version of selfmotion (a {kind}"), (99, "a newer version")):
        files.write_archive(file, {key: found}, {})
        with pytest.raises(sm.errors.FileFormatError, match=re.escape(told)):
            load(file)
    other = {"format": "move", "move": "format"}[key]
    files.write_archive(file, {other: 1}, {})
    with pytest.raises(sm.errors.FileFormatError, match=f"not a {kind}"):
        load(file)


def _leaves(value: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        if isinstance(inner, dict | list):
            yield from _leaves(inner, (*way, key))
        else:
            yield (*way, key), inner


@pytest.mark.parametrize("seed", range(60))
def test_no_part_of_a_file_is_edited_unseen(plan: sm.Plan, seed: int, tmp_path: Path) -> None:
    """Any number, text or array: never verified, or refused by the name of the file."""
    rng, file = np.random.default_rng(seed), tmp_path / "plan.npz"
    plan.save(file)
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored.files}
    document = json.loads(arrays["description"].tobytes())
    if seed % 4:
        leaves = list(_leaves(document))
        way, old = leaves[rng.integers(len(leaves))] if seed > 7 else (("report", "ending"), "")
        inside = reduce(lambda table, key: table[key], way[:-1], document)
        others = [1e300, "x", [], {}, None, not old, -1, 0.5]
        inside[way[-1]] = next(x for x in rng.permutation(np.array(others, object)) if x != old)
        arrays["description"] = np.frombuffer(json.dumps(document).encode(), np.uint8)
    else:
        name = str(rng.choice([name for name in arrays if arrays[name].size > 1]))
        arrays[name] = [arrays[name] + 1, arrays[name][:-1]][seed // 4 % 2]
    np.savez(file, **arrays)
    try:
        # What is too large for numbers overflows, and is seen to.
        with np.errstate(all="ignore"):
            assert not sm.load_plan(file).certificate.verdict.startswith("verified")
        told = str(file)
    except sm.errors.FileFormatError as error:
        told = str(error)
    assert told.startswith(str(file))


def test_a_file_of_before_is_read_whole(tmp_path: Path) -> None:
    """Written on 2026-11-26, when its clearance was `collision`, and constraints `Binding`."""
    loaded = sm.load_plan(Path(__file__).parent / "plan_of_before.npz")
    assert loaded.certificate.verified
    assert not loaded.altered
    assert loaded.problem.clearance is None
    assert loaded.report.cost == pytest.approx(0.0511803, rel=1e-6)
    (limit,) = loaded.report.active
    assert limit.constraint == "joint velocity limits"
    assert limit.spans == ((0.96875, 1.28125),)
    loaded.save(tmp_path / "again.npz")
    again = sm.load_plan(tmp_path / "again.npz")
    assert again.report.active == loaded.report.active
    assert again.problem.digest == loaded.problem.digest


# What finished work is kept under changes with all that decides what comes of it.

OWN = """
from dataclasses import dataclass
from typing import ClassVar
import coal
import selfmotion as sm

class Own(sm.paths.Path, kind="kept for a test"):
    duration = 2.0
    def __init__(self, path): self.path = path
    def evaluate(self, t): return self.path.samples(t)
    def to_dict(self): return {"kind": self.kind}

@dataclass(frozen=True, eq=False)
class Cone(sm.obstacles.Obstacle):
    shape: ClassVar[str] = "cone kept for a test"
    radius: float
    def geometry(self): return coal.Cone(self.radius, self.radius)
"""


def test_ones_own_code_is_in_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a path within another one, and of a body of a clearance."""
    file = tmp_path / "kept_own_code.py"
    file.write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    own = importlib.import_module("kept_own_code")
    pose = robot_named("planar_3r").pose(np.zeros(3))
    path = own.Own(sm.paths.Dwell(pose, 2.0)) + sm.paths.Dwell(pose, 1.0)
    apart = sm.constraints.Clearance([own.Cone("cone", pose, 0.1)])
    plain = sm.paths.Dwell(pose, 2.0)
    described = [item.to_dict() for item in (path, apart, plain)]
    assert [own_modules(item) for item in described] == [["kept_own_code"]] * 2 + [[]]
    before = [key_of(item, {}) for item in described]
    file.write_text(OWN + "# changed")
    after = [key_of(item, {}) for item in described]
    assert [one == other for one, other in zip(before, after, strict=True)] == [False, False, True]
