"""Many plans: the same whoever makes them; what is killed is lost once and done once."""

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import nullcontext
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from selfmotion.shell.cli.batch_command import is_answered
from selfmotion.shell.documents import grid_items, write_combination
from selfmotion.work.batch import BatchProgress, Item, plan_items, run
from support.arms import PANDA_HOME, robot_named
from support.places import ROOT, TESTS
from support.shell import complaint, invoke

GRID = """
task = "planar"
start = [0.1, 0.9, 0.9]
robot = { name = "planar_3r" }
path = { kind = "line", by = [-0.5, 0, 0], duration = 2 }
[[costs]]
kind = "JointVelocity"
[[costs]]
kind = "InverseManipulability"
mu = 0
[grid]
"path.duration" = [3, 4, 5]
"costs.1.mu" = [0, 1]
"""


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    (tmp_path / "cell.toml").write_text(GRID)
    return tmp_path / "cell.toml"


class InPlace(Executor):
    """Runs each call at once: what every executor does, without its costs."""

    def __init__(self, breaks_at: int | None = None) -> None:
        self.calls, self._breaks_at = 0, breaks_at

    def submit(self, fn: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        self.calls += 1
        future: Future[Any] = Future()
        if self.calls == self._breaks_at:
            future.set_exception(BrokenProcessPool("a worker is gone"))
        else:
            future.set_result(fn(*args, **options))
        return future


def motions(batch: sm.Batch) -> list[sm.Trajectory]:
    return [row.plan().trajectory for row in batch.rows]


def same(one: sm.Batch, other: sm.Batch) -> None:
    assert [row.name for row in one.rows] == [row.name for row in other.rows]
    for a, b in zip(motions(one), motions(other), strict=True):
        np.testing.assert_array_equal(a.t, b.t)
        np.testing.assert_array_equal(a.q, b.q)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> sm.Batch:
    folder = tmp_path_factory.mktemp("reference")
    (folder / "cell.toml").write_text(GRID)
    return plan_items(grid_items(folder / "cell.toml"), InPlace(), out=folder / "out")


def test_a_batch_plans_what_python_plans(reference: sm.Batch) -> None:
    assert [row.settings["path.duration"] for row in reference.rows] == [3, 3, 4, 4, 5, 5]
    assert all(row.verified and not row.error for row in reference.rows)
    for row in reference.rows[:2]:
        plan = row.plan()
        np.testing.assert_array_equal(sm.plan(plan.problem).trajectory.q, plan.trajectory.q)
    best = reference.best
    assert best is not None
    assert best.cost == min(row.cost for row in reference.rows)


def test_values_that_are_set_are_of_all_combinations(grid: Path, tmp_path: Path) -> None:
    items = grid_items(grid, {"rest": False})
    assert len(items) == 6
    assert not any(item.make().problem.rest for item in items)
    write = items[0].write
    assert write is not None
    write(tmp_path / "one.toml")
    assert "rest = false" in (tmp_path / "one.toml").read_text()
    with pytest.raises(sm.errors.ProblemError, match=r"path\.duration is a key of its grid"):
        grid_items(grid, {"path.duration": 3.0})
    # What is wrong with a grid is said by its reader.
    (tmp_path / "no_grid.toml").write_text("grid = 5\n")
    with pytest.raises(sm.errors.FileFormatError, match="grid: is 5, expected a table"):
        grid_items(tmp_path / "no_grid.toml", {"rest": False})


@pytest.mark.site
def test_two_processes_and_threads_give_the_same(
    reference: sm.Batch, grid: Path, tmp_path: Path
) -> None:
    seen: list[BatchProgress] = []
    two = plan_items(grid_items(grid), out=tmp_path / "two", workers=2, progress=seen.append)
    same(two, reference)
    assert [item.done for item in seen] == [1, 2, 3, 4, 5, 6]
    assert seen[-1].seconds_left == 0.0
    assert all(item.rate > 0.0 and item.total == 6 for item in seen)
    with ThreadPoolExecutor(2) as threads:
        same(plan_items(grid_items(grid), threads, out=tmp_path / "threads"), reference)


@pytest.mark.site
def test_a_dask_cluster_gives_the_same(reference: sm.Batch, grid: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1",
        dashboard_address=None, silence_logs=50, local_directory=str(tmp_path / "dask"),
    )  # fmt: skip
    with cluster:
        code, text = invoke(
            "batch", grid, "--dask", cluster.scheduler_address, "--out", tmp_path / "out",
            "--replays", "0", "--json",
        )  # fmt: skip
        with distributed.Client(cluster) as client:
            pids, done = list(client.run(os.getpid).values()), list[int]()

            def kill_one(found: BatchProgress) -> None:
                done.append(found.done)
                if found.done == 2:
                    os.kill(pids[0], signal.SIGKILL)

            lost = plan_items(
                grid_items(grid), client.get_executor(), out=tmp_path / "lost", progress=kill_one
            )
    assert code == 0
    assert len(json.loads(text)["rows"]) == 6
    assert done == [1, 2, 3, 4, 5, 6]
    same(lost, reference)
    again = plan_items(grid_items(grid), InPlace(), out=tmp_path / "out")
    assert again.resumed == 6
    same(again, reference)


def test_a_run_that_was_killed_goes_on(reference: sm.Batch, grid: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    script = TESTS / "support" / "batch_killed.py"
    with subprocess.Popen(
        [sys.executable, script, grid, out, "1"], stdout=subprocess.PIPE, text=True
    ) as killed:
        assert killed.stdout is not None
        while killed.stdout.readline().strip() != "2":
            pass
        killed.send_signal(signal.SIGKILL)
    before = {file: file.stat().st_mtime_ns for file in (out / "plans").glob("*.npz")}
    assert 2 <= len(before) < 6
    executor = InPlace()
    result = plan_items(grid_items(grid), executor, out=out)
    assert result.resumed + executor.calls == 6
    assert result.resumed >= 2
    rows = {row.file: row for row in result.rows[: result.resumed]}
    assert all(file.stat().st_mtime_ns == before[file] for file in rows)
    assert not [file for file in out.rglob(".*")], "temporary files of the run that was killed"
    same(result, reference)


@pytest.mark.site
def test_a_worker_that_is_killed_loses_nothing(
    reference: sm.Batch, grid: Path, tmp_path: Path
) -> None:
    killed: list[int] = []

    done: list[int] = []

    def progress(found: BatchProgress) -> None:
        done.append(found.done)
        if found.done == 2:
            killed.append(active_children()[0].pid or 0)
            os.kill(killed[0], signal.SIGKILL)

    result = plan_items(grid_items(grid), out=tmp_path / "out", workers=1, progress=progress)
    assert killed
    assert done == [1, 2, 3, 4, 5, 6]
    same(result, reference)


class Deadly(InPlace):
    """Processes of which one problem kills each that it comes to."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        if args[0]["problem"]["path"]["duration"] != 4.0:
            return super().submit(fn, *args, **options)
        future: Future[Any] = Future()
        future.set_exception(BrokenProcessPool("a worker is gone"))
        return future


def test_a_problem_that_kills_its_worker_is_found_out(
    grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "processes", lambda workers: nullcontext(Deadly()))
    grid.write_text(GRID.replace("[0, 1]", "[0]"))
    batch = plan_items(grid_items(grid), out=tmp_path / "out", workers=1)
    assert [row.verified for row in batch.rows] == [True, False, True]
    assert batch.rows[1].error.startswith("its process died twice")


def test_an_executor_that_breaks_leaves_what_was_done(grid: Path, tmp_path: Path) -> None:
    with pytest.raises(
        sm.errors.PlanError, match=r"broke after 5 of 6 problems; .*: run again to go on"
    ):
        plan_items(grid_items(grid), InPlace(breaks_at=4), out=tmp_path)
    assert plan_items(grid_items(grid), InPlace(), out=tmp_path).resumed == 5


def test_whoever_stops_a_batch_keeps_what_is_done(grid: Path, tmp_path: Path) -> None:
    def stop(found: BatchProgress) -> None:
        if found.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan_items(grid_items(grid), InPlace(), out=tmp_path, progress=stop)
    assert plan_items(grid_items(grid), InPlace(), out=tmp_path).resumed == 2


def test_a_problem_that_changed_is_planned_anew(grid: Path, tmp_path: Path) -> None:
    plan_items(grid_items(grid), InPlace(), out=tmp_path / "out")
    grid.write_text(GRID.replace("[3, 4, 5]", "[3, 4.5, 5]"))
    executor = InPlace()
    assert plan_items(grid_items(grid), executor, out=tmp_path / "out").resumed == 4
    assert executor.calls == 2
    # So is one whose file is gone, or whose row was cut short.
    (tmp_path / "out" / "plans" / "cell-0.npz").unlink()
    (tmp_path / "out" / "rows" / "cell-1.json").write_text("{")
    assert plan_items(grid_items(grid), InPlace(), out=tmp_path / "out").resumed == 4


def test_bad_problems_do_not_stop_the_rest(tmp_path: Path) -> None:
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 3.0)
    good = sm.Problem(panda, circle, start=PANDA_HOME)
    far = panda.pose(PANDA_HOME)
    far.translation = far.translation + 5.0
    problems = [
        good,
        sm.files.PlanRequest(
            sm.Problem(panda, sm.paths.Circle.around(far, 0.05, 3.0)), sm.Search(starts=4)
        ),
        sm.Problem(panda, circle, costs=[sm.costs.FunctionCost(lambda qd, q, t: q[:, 0] ** 2)]),
    ]
    batch = sm.plan_many(problems, InPlace(), out=tmp_path)
    assert [bool(row.error) for row in batch.rows] == [False, True, True]
    assert "is a function, which cannot be sent" in batch.rows[2].error
    with pytest.raises(sm.errors.FileFormatError, match="has no plan"):
        batch.rows[1].plan()
    with pytest.raises(sm.errors.ProblemError, match=r"problems\[0\] is 3"):
        sm.plan_many([3], out=tmp_path)  # type: ignore[list-item]


def test_a_fault_of_ones_own_code_is_said_and_tried_again(
    grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = sm.files.PlanRequest.plan

    def faulty(job: sm.files.PlanRequest, **options: Any) -> sm.Plan:
        if job.problem.path.duration == 4.0:
            raise ZeroDivisionError("own code")
        return real(job, **options)

    monkeypatch.setattr(sm.files.PlanRequest, "plan", faulty)
    batch = plan_items(grid_items(grid), InPlace(), out=tmp_path / "out")
    assert [row.error for row in batch.rows if row.error] == ["ZeroDivisionError: own code"] * 2
    monkeypatch.setattr(sm.files.PlanRequest, "plan", real)
    again = plan_items(grid_items(grid), InPlace(), out=tmp_path / "out")
    assert again.resumed == 4
    assert all(not row.error for row in again.rows)


@pytest.mark.parametrize(("goal", "duration"), [("best", 5.0), ("fastest", 3.0)])
def test_the_best_is_what_was_asked_for(
    grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, goal: str, duration: float
) -> None:
    """Who asked for the fastest motion does not want the cheapest, which takes longest."""
    monkeypatch.setattr(sm.files.PlanRequest, "plan", lambda job, **options: sm.plan(job.problem))
    grid.write_text(f'goal = "{goal}"\n' + GRID.replace("[0, 1]", "[0]"))
    batch = plan_items(grid_items(grid), InPlace(), out=tmp_path / "out")
    assert batch.best is not None
    assert batch.best.duration == pytest.approx(duration)
    rows = list(csv.DictReader((tmp_path / "out" / "table.csv").read_text().splitlines()))
    assert rows[0]["name"] == batch.best.name


def test_tables_are_ranked_and_linked(grid: Path, tmp_path: Path) -> None:
    text = GRID.replace('"costs.1.mu" = [0, 1]', '"costs.1.mu" = [0, -1]')
    grid.write_text(text)
    out = tmp_path / "out"
    result = plan_items(grid_items(grid), InPlace(), out=out, replays=1)
    rows = list(csv.DictReader((out / "table.csv").read_text().splitlines()))
    assert [int(row["rank"]) for row in rows] == [1, 2, 3, 4, 5, 6]
    costs = [float(row["cost"]) for row in rows[:3]]
    assert costs == sorted(costs)
    assert all(row["verified"] == "no plan" and "mu is -1" in row["verdict"] for row in rows[3:])
    assert rows[0]["name"] == (result.best and result.best.name)
    page = (out / "index.html").read_text()
    for row in rows[:3]:
        assert f'href="{row["plan"]}"' in page
        assert (out / row["plan"]).is_file()
    assert [bool(row["replay"]) for row in rows] == [True, False, False, False, False, False]
    assert (out / rows[0]["replay"]).stat().st_size > 100_000
    # Replays that are there stay linked.
    plan_items(grid_items(grid), InPlace(), out=out)
    assert rows[0]["replay"] in (out / "index.html").read_text()


def test_the_best_combination_is_a_problem_file(reference: sm.Batch, tmp_path: Path) -> None:
    (file,) = reference.best_files
    (item,) = grid_items(file)
    assert reference.best is not None
    assert item.key == reference.best.key
    assert item.key not in {row.key for row in reference.rows if row != reference.best}


PLACES = """
task = "pointing"
robot = { name = "panda" }
path = { kind = "file", file = "seam.csv", feed = 0.05 }
joint_limits = "limits.yaml"
outputs = ["motion.csv"]
[workpiece]
frame = { position = [0.5, 0.0, 0.3] }
mesh = "part/frame.stl"
[grid]
"workpiece.frame.position.0" = [0.4, 0.5]
"""


def test_a_combination_is_the_same_problem_in_any_folder(tmp_path: Path) -> None:
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "frame.stl").write_bytes((ROOT / "examples" / "frame.stl").read_bytes())
    (tmp_path / "seam.csv").write_bytes((ROOT / "examples" / "seam.csv").read_bytes())
    limits = (
        "joint_limits:\n  panda_joint1:\n    has_velocity_limits: true\n    max_velocity: 1.0\n"
    )
    (tmp_path / "limits.yaml").write_text(limits)
    (tmp_path / "cell.toml").write_text(PLACES)
    made = grid_items(tmp_path / "cell.toml")
    for folder in (tmp_path, tmp_path / "deep" / "er"):
        for item in made:
            target = folder / f"{item.name}.toml"
            write_combination(tmp_path / "cell.toml", item.settings, target)
            (again,) = grid_items(target)
            assert again.key == item.key
            assert [file.resolve() for file in again.make().outputs] == [tmp_path / "motion.csv"]
    assert made[0].key != made[1].key


def test_refusals_say_why_in_a_few_words(reference: sm.Batch, grid: Path, tmp_path: Path) -> None:
    assert {row.reason for row in reference.rows} == {""}
    lines = '[grid]\n"path.by" = [[-0.4, 0, 0], [-9, 0, 0]]\n'
    grid.write_text(GRID.split("[grid]")[0] + lines)
    near, away = plan_items(grid_items(grid), InPlace(), out=tmp_path / "out").rows
    assert (near.verified, near.reason) == (True, "")
    assert near.margin is not None
    assert near.margin > 0.0
    assert near.margin_unit == "rad"
    assert away.margin_unit in ("", "rad")
    assert not away.verified
    assert away.reason in ("out of reach", "no way through", "ends on the way")


def test_the_shell_says_what_went_wrong(grid: Path, tmp_path: Path) -> None:
    assert "no scheduler answers" in complaint("batch", grid, "--dask", "no address at all")
    grid.write_text(GRID.replace("[0, 1]", "1"))
    assert "grid.costs.1.mu: is 1, expected a list of values" in complaint("batch", grid)
    grid.write_text(GRID.replace('"path.duration"', '"robot.base.position.0"'))
    told = complaint("batch", grid)
    assert told.startswith(f"error: {grid}: robot.base.position.0: ")
    assert "sets one number of 'position', which is not there; give all of them" in told
    # The same in another unit, or written wrongly, is named.
    there = "\n[workpiece]\nframe = { position_mm = [500, 0, 200] }\n"
    for key in ("position", "positoin_mm"):
        wanted = GRID.replace('"path.duration"', f'"workpiece.frame.{key}.0"')
        grid.write_text(wanted.replace("[grid]", f"{there}[grid]"))
        assert f"'{key}', which is not there; nearest: 'position_mm'; give" in complaint(
            "batch", grid
        )
    grid.write_text(GRID)
    (tmp_path / "b").mkdir()
    other = tmp_path / "b" / "cell.toml"
    other.write_text(GRID)
    assert "two problem files are called 'cell-0'" in complaint("batch", grid, other)


def test_names_sort_as_they_are_numbered(grid: Path) -> None:
    grid.write_text(GRID.replace("[0, 1]", "[0, 1, 2, 3]"))
    names = [item.name for item in grid_items(grid)]
    assert names == sorted(names)
    assert len({item.key for item in grid_items(grid)}) == len(names) == 12
    assert all(isinstance(item, Item) for item in grid_items(grid))


def test_of_each_file_some_combination_has_to_be_verified() -> None:
    def made() -> sm.files.PlanRequest:
        raise sm.errors.ProblemError("is not planned here")

    one, other = ([Item(f"{file}-{k}", made, {}) for k in range(3)] for file in "ab")
    assert is_answered([one, other], {"a-2", "b-0"})
    assert not is_answered([one, other], {"a-0", "a-1", "a-2"})
    assert not is_answered([one], set())


@pytest.mark.site
def test_a_mesh_that_changed_is_planned_anew_in_any_process(tmp_path: Path) -> None:
    """In one that has its bodies made before as well; so is what a row lies about."""
    panda = robot_named("panda")
    line = sm.paths.Line(panda.pose(PANDA_HOME), panda.pose(PANDA_HOME + 0.05), 2.0)
    part, out = tmp_path / "part.stl", tmp_path / "out"

    def row() -> tuple[sm.work.batch.Row, int]:
        bodies = [sm.obstacles.Mesh("part", np.zeros(3), str(part))]
        problem = sm.Problem(
            panda,
            line,
            "position",
            PANDA_HOME,
            constraints=[],
            clearance=sm.constraints.Clearance(bodies, 0.01),
        )
        found = sm.work.batch.plan_many([problem], InPlace(), out=out)
        return found.rows[0], found.resumed

    for at, verified in (([2.0, 2.0, 0.0], True), (line.pose(1.0).translation, False)):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        box.apply_translation(at)
        box.export(part)
        assert (row()[0].verified, row()[1]) == (verified, 1)
    said = out / "rows" / "plan-0.json"
    values = json.loads(said.read_text())
    said.write_text(json.dumps(values | {"verified": True, "verdict": "verified"}))
    found, resumed = row()
    assert (found.verified, resumed) == (False, 0)
    # Another file in the place of its plan is not its plan.
    other = sm.plan(sm.Problem(panda, line, "position", PANDA_HOME, clearance=None))
    other.save(out / "plans" / "plan-0.npz")
    assert (row()[0].verified, row()[1]) == (False, 1)


def test_what_a_batch_is_given_is_used_or_refused_by_name(tmp_path: Path) -> None:
    problem = sm.sample_problem()
    bad: list[tuple[dict[str, Any], str]] = [
        ({"workers": 0}, "workers is 0, expected a whole number ≥ 1"),
        ({"workers": 2, "executor": InPlace()}, "workers: has no effect where an executor"),
        ({"executor": 5}, "executor is 5, expected one of concurrent"),
        ({"replays": -1}, "replays is -1"),
        ({"progress": 5}, "progress is 5, expected a function"),
        ({"deadline": 0.0}, "deadline is 0.0, expected a number > 0"),
        ({"callback": print}, "callback: is no option of a batch; expected search, "),
        (
            {"problems": [sm.files.PlanRequest(problem)], "tolerance": 1e-3},
            "tolerance: has no effect: each",
        ),
        ({"problems": problem}, "expected a list of problems"),
    ]
    for given, told in bad:
        with pytest.raises(sm.errors.ProblemError, match=told):
            sm.plan_many(**{"problems": [problem], "out": tmp_path, **given})
    with pytest.raises(sm.errors.FileFormatError, match="file is 5"):
        sm.plan_many([], out=5)  # type: ignore[arg-type]
    (row,) = sm.plan_many(
        [sm.files.PlanRequest(problem, parts={"ramp": 0.1})], InPlace(), out=tmp_path
    ).rows
    assert row.error == "parts: has no effect on the best motion; leave it out"


def test_a_row_that_was_changed_or_renamed_is_not_believed(tmp_path: Path) -> None:
    """Neither its words, its name nor what is no row at all: all is planned again."""
    # Said at once, without a plan.
    twice = 2 * [sm.files.PlanRequest(sm.sample_problem(), parts={"ramp": 0.1})]
    before = [row.error for row in sm.plan_many(twice, InPlace(), out=tmp_path).rows]
    assert all(before)
    file, other = (tmp_path / "rows" / f"plan-{k}.json" for k in range(2))
    sound = file.read_text()
    row = json.loads(sound)
    changes = [{**row, "name": 5}, {**row, "error": [1]}, {**row, "error": "no way"}, [row], 5]
    for text in (*map(json.dumps, changes), other.read_text(), "{}", ""):
        file.write_text(text)
        again = sm.plan_many(twice, InPlace(), out=tmp_path)
        assert ([row.error for row in again.rows], again.resumed) == (before, 1)
        assert file.read_text() != text


def test_settings_are_told_apart_by_what_they_hold() -> None:
    """Not by where they are in memory, which is another place tomorrow."""

    def key(**settings: Any) -> str:
        return run.problem_items([sm.sample_problem()], settings)[0].key

    def search(seed: int) -> sm.Search:
        return sm.Search(rng=np.random.default_rng(seed))

    class Own(sm.QuasiNewton):
        """Of one's own; where it is comes after its digits."""

        def __repr__(self) -> str:
            return object.__repr__(self)

    keys = [
        key(),
        key(search=search(1)),
        key(search=search(2)),
        key(optimizer=Own(max_iterations=3)),
        key(optimizer=Own(max_iterations=4)),
    ]
    assert len(set(keys)) == len(keys)
    assert key(search=search(1)) == keys[1]
    assert key(optimizer=Own(max_iterations=3)) == keys[3]


def test_a_file_that_cannot_be_read_is_a_row_and_rows_are_json(grid: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.toml"
    torn.write_text("task = \n")
    assert "is not TOML" in complaint("batch", torn, "--out", tmp_path / "one")
    one = tmp_path / "one.toml"
    one.write_text(GRID.partition("[grid]")[0])
    code, text = invoke("batch", one, torn, "--out", tmp_path / "out", "--json", "--workers", "1")
    assert code == 1

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    rows = {row["name"]: row for row in json.loads(text, parse_constant=refuse)["rows"]}
    assert rows["one"]["verified"]
    assert "is not TOML" in rows["torn"]["error"]
    assert rows["torn"]["aim"] is None


def test_what_a_deadline_left_is_planned_again(tmp_path: Path, panda: sm.RobotModel) -> None:
    """A row says why there is no plan; with more time it is made, and kept once verified."""
    line = sm.paths.Line(panda.pose(PANDA_HOME), panda.pose(PANDA_HOME + 0.05), 2.0)
    problem = sm.Problem(panda, line, "position", clearance=None)
    out = tmp_path / "out"
    (late,) = sm.plan_many([problem], InPlace(), out=out, deadline=1e-9).rows
    assert (late.verified, late.reason) == (False, "deadline")
    assert "deadline of 1e-09 s" in late.error
    batch = sm.plan_many([problem], InPlace(), out=out, deadline=1e6)
    assert (batch.rows[0].verified, batch.resumed) == (True, 0)
    again = sm.plan_many([problem], InPlace(), out=out, deadline=1e-9)
    assert (again.rows[0].verified, again.resumed) == (True, 1)
