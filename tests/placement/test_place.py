"""Places: what is found is no worse than a grid of places, each planned on its own."""

import importlib
import json
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shell.documents import read_problem
from selfmotion.work.placement import Tried, search
from selfmotion.work.placement.picture import in_unit, legend_of, picture_of
from selfmotion.work.placement.places import Places, places_of
from selfmotion.work.placement.search import Box, Descent, finalists
from support.arms import robot_named
from support.shell import complaint, invoke

LIMITS = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
WITHIN = {"x": (-0.3, 0.3), "y": (-0.4, 0.4)}
# Out of reach of the planar arm [m].
AWAY = pin.SE3(np.eye(3), np.array([9.0, 0.0, 0.0]))
# A place may cost so much more than the best of a grid.
NO_WORSE = 1.01


JOB = """
task = "position"
[robot]
name = "panda"
[clearance]
distance = 0.005
[[clearance.obstacles]]
shape = "box"
name = "wall"
position = [0.95, 0.0, 0.5]
size = [0.02, 1.0, 0.4]
[workpiece]
frame = { position = [0.45, 0.0, 0.3], rpy_deg = [180, 0, 0] }
[[workpiece.obstacles]]
shape = "box"
name = "clamp"
position = [0.0, 0.15, 0.1]
size = [0.05, 0.05, 0.05]
[[seams]]
name = "there"
path = { kind = "line", duration = 1.0, by = [0.1, 0, 0], start = { position = [0, 0.05, 0] } }
[[seams]]
name = "back"
path = { kind = "line", duration = 1.0, by = [0.1, 0, 0], start = { position = [0, -0.05, 0] } }
"""


def planar() -> sm.Problem:
    """A straight seam of a planar arm, in which nothing is in the way."""
    robot = robot_named("planar_3r")
    start = np.array([0.4, 0.9, 0.6])
    pose = robot.pose(start)
    end = pin.SE3(pose.rotation, pose.translation + np.array([-0.3, 0.2, 0.0]))
    seam = sm.paths.Line(pose, end, 2.0)
    return sm.Problem(robot, seam, "planar", constraints=LIMITS)


def panda() -> sm.Problem:
    """A seam above a block that belongs to it, beside a wall that does not."""
    robot = robot_named("panda")
    pose = robot.pose(sm.NAMED_ARMS["panda"].home)
    end = pose.copy()
    end.translation = pose.translation + np.array([0.0, 0.2, 0.0])
    middle = 0.5 * (pose.translation + end.translation)
    block = sm.obstacles.Box("block", middle - [0.0, 0.0, 0.15], [0.1, 0.1, 0.05])
    wall = sm.obstacles.Box("wall", [0.9, 0.0, 0.5], [0.02, 1.0, 0.4])
    clear = sm.constraints.Clearance([block, wall], 5e-3)
    return sm.Problem(robot, sm.paths.Line(pose, end, 3.0), constraints=LIMITS, clearance=clear)


@pytest.fixture(scope="module")
def found() -> sm.placement.Placement:
    return sm.place(planar(), WITHIN)


def test_a_place_is_no_worse_than_any_of_a_grid(found: sm.placement.Placement) -> None:
    costs = []
    for x in np.linspace(*WITHIN["x"], 4):
        for y in np.linspace(*WITHIN["y"], 4):
            path = sm.paths.Placed(planar().path, pin.SE3(np.eye(3), np.array([x, y, 0.0])))
            try:
                plan = sm.plan(planar().changed(path=path))
            except sm.SelfmotionError:
                continue
            costs += [plan.report.cost] if plan.certificate.verified else []
    assert found.verified
    assert found.cost <= NO_WORSE * min(costs)
    assert found.cost < 0.9 * found.cost_before


def test_a_place_says_what_keeps_it_there(found: sm.placement.Placement) -> None:
    """The cost falls towards an end of the box, or it is flat."""
    for name, (low, high) in WITHIN.items():
        value = found.place[name]
        if name in found.on_bounds:
            assert min(value - low, high - value) == pytest.approx(0.0, abs=1e-6)
            assert f"the box in {name}" in found.binds
            continue
        for aside in (-0.02, 0.02):
            moved = {**found.place, name: value + aside}
            frame = pin.SE3(np.eye(3), np.array([moved["x"], moved["y"], 0.0]))
            there = planar().changed(path=sm.paths.Placed(planar().path, frame))
            assert sm.plan(there).report.cost >= found.cost * (1.0 - 1e-3)
    assert "move the part by" in str(found)


def test_the_problem_at_the_place_is_the_moved_one(found: sm.placement.Placement) -> None:
    (problem,) = found.problems
    t = np.linspace(0.0, 2.0, 5)
    moved = problem.path.samples(t).translation
    shift = np.array([found.place["x"], found.place["y"], 0.0])
    np.testing.assert_allclose(moved, planar().path.samples(t).translation + shift, atol=1e-12)


def test_a_map_is_of_plans_on_their_own(found: sm.placement.Placement, tmp_path: Path) -> None:
    drawn = found.map(points=3)
    assert drawn.costs.shape == (3, 3)
    assert np.nanmin(drawn.costs) >= found.cost * (1.0 - 1e-3)
    for i, j in ((0, 1), (2, 2)):
        frame = pin.SE3(np.eye(3), np.array([drawn.across[j], drawn.up[i], 0.0]))
        plan = sm.plan(planar().changed(path=sm.paths.Placed(planar().path, frame)))
        if not drawn.reasons[i][j]:
            assert drawn.costs[i, j] >= plan.report.cost * (1.0 - 1e-3)
    page = sm.files.write_placement(found, tmp_path / "map.html", drawn).read_text()
    # A cell for each place, with the part's outline within the frame of all.
    assert page.count("<g><title>") == 9
    assert "x [mm]" in page
    assert page.count("<polygon") == page.count("<clipPath") == 1
    assert page.count("<circle") == len(found.best())
    # Places to choose from: the cheapest first, none near another, each planned as it says.
    best = found.best()
    assert best[0].cost == pytest.approx(found.cost, rel=1e-9)
    assert best[0].cost <= best[1].cost <= best[2].cost
    assert page.count("<tr>") == 1 + len(best) == 4
    assert f"<td>{in_unit('x', found.place['x'])}</td>" in page
    for item in best[1:]:
        frame = pin.SE3(np.eye(3), np.array([*item.place, 0.0]))
        plan = sm.plan(planar().changed(path=sm.paths.Placed(planar().path, frame)))
        assert plan.report.cost <= item.cost * (1.0 + 1e-3)
    drawn.figure().savefig(tmp_path / "map.png")
    with pytest.raises(sm.errors.PlanError, match="over two of x, y"):
        found.map(("x", "yaw"))


def test_the_base_is_moved_for_what_stays(tmp_path: Path) -> None:
    """The arm itself stands elsewhere: its plans are of the problem as it was given."""
    box = {"x": (-0.1, 0.1), "yaw": (-0.3, 0.3)}
    found = sm.place(planar(), box, of="base")
    (plan,) = found.plans
    assert plan.certificate.verified
    np.testing.assert_array_equal(plan.path.pose(1.0), planar().path.pose(1.0))
    q = plan.trajectory.q[0]
    there, before = plan.robot.pose(q), robot_named("planar_3r").pose(q)
    np.testing.assert_allclose(
        there.homogeneous, (found.displacement * before).homogeneous, atol=1e-12
    )
    file = tmp_path / "base.toml"
    sm.files.write_problem(plan.problem, file)
    np.testing.assert_allclose(
        read_problem(file).robot.pose(q).homogeneous, there.homogeneous, atol=1e-12
    )


def test_only_what_belongs_to_the_part_moves_along() -> None:
    places = places_of([panda()], "part", ["block"], None, ("x", "yaw"))
    (moved,) = places.at(np.array([0.1, 0.2]))
    bodies = {body.name: body for body in moved.clearances[0].obstacles}
    before = {body.name: body for body in panda().clearances[0].obstacles}
    np.testing.assert_array_equal(bodies["wall"].pose, before["wall"].pose)
    # What is between path and block stays, whatever both are moved by.
    for t in (0.0, 1.5):
        apart = bodies["block"].pose.inverse() * moved.path.pose(t)
        same = before["block"].pose.inverse() * panda().path.pose(t)
        np.testing.assert_allclose(apart.homogeneous, same.homogeneous, atol=1e-12)
    (seen,) = places_of([panda()], "base", None, None, ("x",)).at(np.array([0.1]))
    walls = {body.name: body for body in seen.clearances[0].obstacles}
    np.testing.assert_array_equal(walls["wall"].pose, before["wall"].pose)
    home = sm.NAMED_ARMS["panda"].home
    shift = seen.robot.pose(home).translation - panda().robot.pose(home).translation
    np.testing.assert_allclose(shift, [0.1, 0.0, 0.0], atol=1e-12)


@pytest.mark.site
def test_several_seams_are_placed_together_and_elsewhere_alike(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(search, "_BEGINNINGS", 4)
    first, second = planar(), planar().changed(path=sm.paths.Reversed(planar().path))
    box = {"x": (-0.1, 0.2)}
    together = sm.place([first, second], box)
    assert len(together.plans) == 2
    assert together.cost == pytest.approx(sum(plan.report.cost for plan in together.plans))
    with ThreadPoolExecutor(1) as executor:
        elsewhere = sm.place([first, second], box, executor=executor)
    assert elsewhere.place["x"] == pytest.approx(together.place["x"], abs=2e-3)
    assert elsewhere.cost == pytest.approx(together.cost, rel=1e-3)
    # Two workers of a cluster try the same places; one of processes has a test in `batch`.
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False,
        dashboard_address=None, silence_logs=50, local_directory=str(tmp_path / "dask"),
    )  # fmt: skip
    with cluster, distributed.Client(cluster) as client:
        there = sm.place([first, second], box, executor=client.get_executor())
    assert there.place == pytest.approx(elsewhere.place, abs=1e-9)
    assert there.cost == pytest.approx(elsewhere.cost, rel=1e-9)


class Bowl(Places):
    """A place's cost by a formula; beyond a line there is no motion."""

    def __init__(self, edge: float) -> None:
        super().__init__((), "part", frozenset(), np.zeros(3), ("x", "y"))
        object.__setattr__(self, "edge", edge)

    def tried(self, place, near=(), thorough=False):  # type: ignore[no-untyped-def]
        x, y = place
        if x + y > self.edge:  # type: ignore[attr-defined]
            return Tried(place, np.inf, "too far")
        return Tried(place, 1.0 + 3.0 * (x - 0.3) ** 2 + (y - 0.1) ** 2 + x * y)


@pytest.mark.parametrize("edge", [5.0, 0.2])
def test_downhill_ends_at_the_bottom_or_where_motions_end(edge: float) -> None:
    places, box = Bowl(edge), Box(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    descent = Descent(places, box, lambda _: None)
    arrived = descent.run(places.tried(np.array([-0.8, 0.7])))
    # 6 (x - 0.3) + y = 0 and 2 (y - 0.1) + x = 0.
    bottom = np.linalg.solve([[6.0, 1.0], [1.0, 2.0]], [1.8, 0.2])
    if edge > 1.0:
        np.testing.assert_allclose(arrived.place, bottom, atol=0.02)
    assert arrived.cost <= places.tried(bottom).cost + 1e-3
    chosen = finalists([arrived, *descent.tried], box)
    assert chosen[0].cost == min(item.cost for item in [arrived, *descent.tried])
    assert len(chosen) <= search._FINALISTS


def test_of_the_present_place_a_quick_no_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the first look there finds nothing, it is planned as any other problem."""
    whole = Places.tried

    def quick(self: Places, place: np.ndarray, near: object = (), thorough: bool = False) -> Tried:
        if not place.any() and not thorough:
            return Tried(place, np.inf, "nothing was found in time")
        return whole(self, place, near, thorough)  # type: ignore[arg-type]

    monkeypatch.setattr(search, "_BEGINNINGS", 2)
    monkeypatch.setattr(Places, "tried", quick)
    found = sm.place(planar(), {"x": (-0.1, 0.1)})
    assert found.cost_before == pytest.approx(sm.plan(planar()).report.cost, rel=1e-3)
    assert "at the present place, " in str(found)


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_deadline_leaves_the_best_place_so_far(
    monkeypatch: pytest.MonkeyPatch, elsewhere: bool
) -> None:
    now, told = [0.0], list[int]()
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])

    def late(stage: str, done: int, total: int) -> None:
        told.append(done)
        now[0] = 2.0 if done > 3 else 0.0

    with ThreadPoolExecutor(1) as executor:
        given = {"executor": executor} if elsewhere else {}
        early = sm.place(planar(), WITHIN, deadline=1.0, progress=late, **given)
        assert told == ([told[0]] if elsewhere else [1, 2, 3, 4])
        assert early.verified
        costs = [item.cost for item in early.tried if np.isfinite(item.cost)]
        assert early.cost == pytest.approx(min(costs), rel=NO_WORSE - 1.0)
        now[0] = 0.0
        far = planar().changed(path=sm.paths.Placed(planar().path, AWAY))
        with pytest.raises(sm.errors.DeadlineError, match=r"any of \d+ places"):
            sm.place(far, {"x": (-0.1, 0.1)}, deadline=1.0, progress=late, **given)


def test_what_cannot_be_placed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "_BEGINNINGS", 2)
    monkeypatch.setattr(search, "_MAX_BEGINNINGS", 3)
    for given, said in (
        ({"within": {}}, "expected lowest and highest"),
        ({"within": {"up": (0, 1)}}, "no coordinate 'up'"),
        ({"within": {"x": (1, 0)}}, "nothing varies"),
        ({"within": {"x": (0, 1, 2)}}, r"within: x"),
        ({"of": "tool"}, "of is 'tool'"),
        ({"part": None}, "which obstacles belong to the part"),
        ({"part": ["blok"]}, "no obstacle 'blok'"),
        ({"part": "block"}, "expected names"),
        ({"of": "base"}, "part says what belongs"),
        ({"executor": 3}, "executor is 3"),
        ({"center": (0.0, 0.0)}, "place: center"),
    ):
        asked = {"within": {"x": (0.0, 0.1)}, "part": ["block"], **given}
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.place(panda(), **asked)  # type: ignore[arg-type]
    with pytest.raises(sm.errors.PlanError, match="no verified motion at any"):
        sm.place(planar(), {"x": (50.0, 60.0)})


def test_the_place_where_it_is_says_why_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all places without motions the first: another one where the box does not hold that."""
    monkeypatch.setattr(search, "_MAX_BEGINNINGS", 3)

    def nowhere(self: Places, place: Array, *near: object, **given: bool) -> Tried:
        return Tried(place, np.inf, f"nothing at {place[0]:.3f}")

    monkeypatch.setattr(Places, "tried", nowhere)
    with pytest.raises(sm.errors.PlanError, match=r"x 0: nothing at 0\.000; widen the box"):
        sm.place(planar(), {"x": (-0.1, 0.1)}, center=(0.0, 0.0, 0.0))
    with pytest.raises(sm.errors.PlanError, match=r"x 1\.5: nothing at 1\.500"):
        sm.place(planar(), {"x": (1.0, 2.0)})


def test_a_path_that_goes_with_the_base_is_refused() -> None:
    """What the arm's base carries is reached from anywhere alike."""
    arm = sm.load_robot("panda", reference="panda_link0")
    problem = panda().changed(robot=arm)
    with pytest.raises(sm.errors.ProblemError, match="'panda_link0', which moves along"):
        sm.place(problem, {"x": (-0.1, 0.1)}, of="base")


def test_places_from_the_shell(tmp_path: Path) -> None:
    cell, out, plan, page = (
        tmp_path / name for name in ("cell.toml", "out.toml", "plan.npz", "map.html")
    )
    sm.files.write_problem(planar(), cell)
    code, told = invoke(
        "place", cell, "--within", "x=-0.1,0.1", "--within", "y=0,0.1", "--out", out, "--out", plan,
        "--map", page, "--points", "2",
    )  # fmt: skip
    assert code == 0, told
    assert "move the part by x [m]" in told
    assert sm.load_plan(plan).certificate.verified
    np.testing.assert_allclose(
        read_problem(out).path.pose(0.0).homogeneous,
        sm.load_plan(plan).path.pose(0.0).homogeneous,
        atol=1e-12,
    )
    assert "<svg" in page.read_text()


def test_a_job_is_placed_as_a_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its file at the place says the same of every seam, moved; what is on the part goes along."""
    (tmp_path / "job.toml").write_text(JOB)
    out = tmp_path / "there.toml"
    ranges = ("--within", "x=-0.05,0.05", "--within", "y=-0.05,0.05")

    def one_place(places: Places, *_: object) -> tuple[Tried, list[Tried]]:
        found = places.tried(np.array([0.02, 0.01]))
        return found, [found]

    monkeypatch.setattr(
        importlib.import_module("selfmotion.work.placement.place"), "best_place", one_place
    )
    code, text = invoke("place", tmp_path / "job.toml", *ranges, "--out", out)
    assert code == 0, text
    here, there = (sm.files.read_seam_job(file) for file in (tmp_path / "job.toml", out))
    by = there.seams[0].path.pose(0.0) * here.seams[0].path.pose(0.0).inverse()
    np.testing.assert_allclose(by.translation, [0.02, 0.01, 0.0], atol=1e-12)
    for before, after in zip(here.problems, there.problems, strict=True):
        np.testing.assert_allclose(
            after.path.pose(0.3).homogeneous, (by * before.path.pose(0.3)).homogeneous, atol=1e-12
        )
        bodies = [
            {item.name: item.pose.translation for item in problem.clearances[0].obstacles}
            for problem in (before, after)
        ]
        np.testing.assert_allclose(bodies[1]["clamp"], by.act(bodies[0]["clamp"]), atol=1e-12)
        np.testing.assert_array_equal(bodies[1]["wall"], bodies[0]["wall"])
    elsewhere = complaint(
        "place", tmp_path / "job.toml", *ranges, "--out", tmp_path.parent / "a.toml"
    )
    assert "beside" in elsewhere


ALONE = """
task = "position"
[robot]
name = "panda"
base = { position = [0.2, 0.1, 0.0], rpy_deg = [0, 0, 90] }
reference = "panda_link0"
[[seams]]
name = "there"
path = { kind = "line", duration = 1.0, by = [0.1, 0, 0], start = { position = [0.4, 0, 0.4] } }
"""


def test_a_job_in_the_frame_of_a_base_is_written_where_it_was_placed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places are in the world, paths in the frame of the base, which is turned."""
    # JSON's null counts as absent: TOML has none.
    document = tomllib.loads(ALONE) | {"costs": None}
    (tmp_path / "job.json").write_text(json.dumps(document))
    out = tmp_path / "there.toml"

    def one_place(places: Places, *_: object) -> tuple[Tried, list[Tried]]:
        found = places.tried(np.array([0.03]))
        return found, [found]

    monkeypatch.setattr(
        importlib.import_module("selfmotion.work.placement.place"), "best_place", one_place
    )
    code, text = invoke("place", tmp_path / "job.json", "--within", "x=-0.05,0.05", "--out", out)
    assert code == 0, text
    starts = []
    for file in (tmp_path / "job.json", out):
        (problem,) = sm.files.read_seam_job(file).problems
        frame = problem.follows.items[0].chain.base_placement
        starts.append(frame.act(problem.path.pose(0.0).translation))
    np.testing.assert_allclose(starts[1] - starts[0], [0.03, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (JOB, ("--part", "wall", "--part", "clamp"), "to which belongs clamp, not wall, clamp"),
        (JOB, ("--part", "wall"), "to which belongs clamp, not wall"),
        (JOB, ("--of", "path"), "to which belongs clamp, not nothing"),
        (
            JOB.replace('name = "panda"', 'name = "panda"\nreference = "panda_link0"', 1).replace(
                "[workpiece]", '[workpiece]\non = "panda_link0"'
            ),
            (),
            "the workpiece is on 'panda_link0'",
        ),
        (
            JOB.replace(
                'name = "panda"',
                'name = "panda"\nreference = "panda_link0"\nbase = { position = [0, 0.1, 0] }',
                1,
            ),
            (),
            "no frame of the workpiece moves both alike",
        ),
    ],
)
def test_a_job_that_cannot_be_written_as_placed_is_refused_before(
    tmp_path: Path, text: str, options: tuple[str, ...], said: str
) -> None:
    (tmp_path / "job.toml").write_text(text)
    out = tmp_path / "there.toml"
    asked = ("place", tmp_path / "job.toml", "--within", "x=-0.05,0.05", *options, "--out", out)
    assert said in " ".join(complaint(*asked).split())
    assert not out.exists()


def test_directions_of_the_world_stay_where_the_base_is_tilted() -> None:
    """The hand is to point downwards, whichever way the arm stands."""
    level = sm.constraints.Tilt("panda_hand", within=0.1)
    problem = panda().changed(task="position", constraints=[*LIMITS, level])
    places = places_of([problem], "base", None, None, ("roll",))
    tried = places.tried(np.array([0.3]))
    assert not tried.reason
    (plan,) = tried.plans
    tilted = pin.rpy.rpyToMatrix(0.3, 0.0, 0.0)
    drawn = robot_named("panda")
    for t in np.linspace(0.0, 3.0, 7):
        # The arm as it is drawn, tilted by hand.
        hand = drawn.chain_to("panda_hand").place(plan.trajectory(t)).rotation
        assert -(tilted @ hand)[2, 2] >= np.cos(0.1) - 1e-6


def test_no_plan_is_said_only_of_what_fails_from_nothing_too(
    found: sm.placement.Placement, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Motions of neighbours are proposals: where they lead nowhere, a place may be as good."""
    surely = Places.surely
    asked: list[Array] = []

    def nowhere(self: Places, place: Array, *near: object, **given: bool) -> Tried:
        return Tried(place, np.inf, "not quickly")

    def noted(self: Places, place: Array) -> Tried:
        asked.append(place)
        return surely(self, place)

    drawn = found.map(points=3)
    monkeypatch.setattr(Places, "tried", nowhere)
    monkeypatch.setattr(Places, "surely", noted)
    again = found.map(points=3)
    assert len(asked) == 9
    assert [reason == "" for row in again.reasons for reason in row] == [
        reason == "" for row in drawn.reasons for reason in row
    ]
    assert (again.costs >= drawn.costs / NO_WORSE).all()


def test_directions_in_which_nothing_changes_are_named() -> None:
    """A planar arm knows nothing of heights."""
    flat = sm.place(planar(), {"x": (-0.1, 0.1), "z": (-0.1, 0.1)})
    assert flat.flat == ("z",)
    assert "nothing changes along z" in str(flat)


def test_a_quick_no_is_asked_again_from_the_nearest_place(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = Places.tried
    lent: list[Array] = []

    def refusing(self: Places, place: Array, near: object = (), thorough: bool = False) -> Tried:
        """Refuse half of the places where nothing is known."""
        if not near and not thorough and place[0] > 0.0:
            return Tried(place, np.inf, "quickly")
        if near:
            lent.append(place)
        return tried(self, place, near, thorough)  # type: ignore[arg-type]

    monkeypatch.setattr(Places, "tried", refusing)
    best = sm.place(planar(), {"x": (-0.2, 0.2)})
    refused = [item.place for item in best.tried if item.reason == "quickly"]
    assert refused
    assert {place.tobytes() for place in refused} <= {place.tobytes() for place in lent}


def test_a_map_of_places_has_contours_and_tells_what_is_out_of_reach() -> None:
    """A contour lies where costs are a share above the least, and ends beside what fails."""
    across, up = np.linspace(-0.1, 0.1, 5), np.linspace(0.0, 0.2, 5)
    costs = np.tile(1.0 + 0.05 * np.arange(5.0), (5, 1))
    costs[4, 4] = costs[0, 0] = np.nan
    reasons = [["" if np.isfinite(cost) else "no motion" for cost in row] for row in costs]
    reasons[4][4] = "out of reach at t = 0 s"
    shown = sm.placement.PlaceMap(
        ("x", "y"),
        across,
        up,
        costs,
        tuple(map(tuple, reasons)),
        best=np.array([[-0.1, 0.1]]),
        outline=np.empty((0, 2)),
    )
    drawn = picture_of(shown)
    told = [word for word in ("+5%", "+10%", "+25%", "+50%") if word in drawn]
    assert told == ["+5%", "+10%"]
    # The one of 5 % is a column's width from the first, in every row of cells but that of the NaN.
    first = next(part for part in drawn.split('<path d="')[1:])
    ends = [
        float(point.split(",")[0]) for point in first.split('"')[0].replace("L", "M").split("M")[1:]
    ]
    assert len(set(ends)) == 1
    assert "in reach, but no plan" in legend_of(shown)
    assert "out of reach" in legend_of(shown)
    assert "x +100 mm, y +200 mm: out of reach at t = 0 s" in drawn


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("x", 0.0068371, "+6.84 mm"),
        ("y", -0.2, "\N{MINUS SIGN}200 mm"),
        ("z", 0.0, "0 mm"),
        ("yaw", np.pi / 7, "+25.7°"),
        ("yaw", 1e-9, "0°"),
    ],
)
def test_places_are_told_with_three_digits_and_a_unit(name: str, value: float, text: str) -> None:
    assert in_unit(name, value) == text
