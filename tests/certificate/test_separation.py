"""Clearance at all times: what happens between two looks is bounded, decided, or said."""

import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import (
    Separation,
)
from selfmotion.certificate.separation import Approach, _nearer, closest_at_all_times
from selfmotion.model.collision import Closest, Overlap
from support.arms import PANDA_HOME, robot_named, short_line, start_of
from support.motions import motion_of


def test_a_distance_that_is_only_a_bound_is_no_approach() -> None:
    model: Any = SimpleNamespace(pairs=(("a", "b"), ("c", "d")))
    before = Approach(Closest(1.0, "a", "b"), 0.2)
    t, values = np.array([0.3, 0.4]), np.array([[0.9, 0.5], [0.5, 0.7]])
    for bound in (0.5, 0.4):
        assert _nearer(before, model, np.arange(2), t, values, np.full((2, 2), bound)) is before
    # Of two that are as near, the first is told.
    assert _nearer(before, model, np.arange(2), t, values + 0.5, np.full((2, 2), 2.0)) is before
    found = _nearer(before, model, np.arange(2), t, values, np.array([[1.0, 0.5], [0.5, 1.0]]))
    assert (found.closest.value, found.time) == (0.7, 0.4)
    assert (found.closest.first, found.closest.second) == ("c", "d")


class Bodies:
    """Pairs of bodies whose distances are given functions of q, with one lever on all joints."""

    open_meshes = overlapping = disabled = obstacles = held = ()
    checks_links, checks_obstacles, stuck = True, False, None

    def __init__(self, *distances: Callable[[Array], Array], lever: float = 1.0) -> None:
        self._given, self._lever, self.asked = distances, lever, 0
        self.pairs = tuple((f"first{k}", f"second{k}") for k in range(len(distances)))

    def pair_levers_up_to(self, farthest: Array) -> Array:
        return np.full((len(self.pairs), len(farthest)), self._lever)

    def distances(self, q: Array, below: Array, exact_below: Array) -> Array:
        self.asked += len(q)
        exact = np.stack([given(q) for given in self._given], axis=1)
        # Hulls are nearer to each other by up to a centimetre.
        hulls = exact - 0.005 * (1.0 + np.sin(1e3 * exact))
        near = np.where(hulls < exact_below, exact, hulls)
        # As GJK does: beyond what matters, any number that is not smaller.
        return np.where(exact < below, near, np.maximum(below, exact - 0.01))

    def worst(self, q: Array) -> Closest:
        if not self.pairs:
            return Closest(np.inf, "", "")
        exact = np.stack([given(q) for given in self._given], axis=1)
        row, pair = np.unravel_index(int(np.argmin(exact)), exact.shape)
        return Closest(float(exact[row, pair]), *self.pairs[pair], int(row))

    def distance(self, q: Array) -> Closest:
        return self.worst(q[None])


@pytest.mark.parametrize("most", [1, 4, 200_000])
def test_what_is_not_looked_at_is_never_kept(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies that meet for an instant, while another pair nearly does all the time."""
    monkeypatch.setattr("selfmotion.certificate.separation._MAX_INTERVALS", most)
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(
        lambda q: np.full(len(q), 1e-7),
        lambda q: np.minimum(np.abs(q[:, 0] - 1.234567), 0.3) - 1e-3,
    )
    found = closest_at_all_times(bodies, motion.trajectory, 0.0)  # type: ignore[arg-type]
    assert found.open_until is not None or found.closest.value < 0.0


@pytest.mark.parametrize("above", [-1e-10, -1e-17, 0.0, 1e-17, 1e-12])
def test_bodies_that_come_exactly_as_near_as_they_may_are_told(above: float) -> None:
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(lambda q: 0.1 + np.abs(q[:, 0] - 1.234567))
    found = closest_at_all_times(bodies, motion.trajectory, 0.1 + above)  # type: ignore[arg-type]
    assert found.names == "first0 - second0"
    assert found.closest.value == pytest.approx(0.1, abs=0.002)


@pytest.mark.parametrize("seed", range(8))
def test_the_closest_approach_is_found_wherever_it_is(seed: int) -> None:
    """Dips as narrow as levers allow, at times that nothing looks at by itself."""
    rng = np.random.default_rng(seed)
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    place, depth = rng.uniform(0.0, 3.0), rng.uniform(0.01, 0.2)
    bodies = Bodies(
        lambda q: np.full(len(q), 0.35), lambda q: depth + np.minimum(np.abs(q[:, 0] - place), 0.3)
    )
    found = closest_at_all_times(bodies, motion.trajectory, 0.0)  # type: ignore[arg-type]
    assert depth <= found.closest.value <= depth + max(0.021 * depth, 1e-4)
    assert found.names == "first1 - second1"
    assert found.time == pytest.approx(place / 3.0, abs=0.01)
    at_that_time = depth + min(abs(3.0 * found.time - place), 0.3)
    assert found.closest.value == pytest.approx(at_that_time, abs=1e-12)
    assert found.open_until is None
    assert bodies.asked < 3000
    for distance, kept in ((0.999 * depth, True), (1.001 * depth, False)):
        judged = Separation(bodies, distance).judge(motion)  # type: ignore[arg-type]
        assert judged.satisfied is kept
        assert (judged.subject, judged.allowed) == ("first1 - second1", distance)


def test_in_lots_the_same_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(
        lambda q: np.full(len(q), 0.35), lambda q: 0.01 + np.minimum(np.abs(q[:, 0] - 0.7), 0.3)
    )
    at_once = closest_at_all_times(bodies, motion.trajectory, 0.0)  # type: ignore[arg-type]
    monkeypatch.setattr("selfmotion.certificate.separation._CHUNK", 3)
    assert closest_at_all_times(bodies, motion.trajectory, 0.0) == at_once  # type: ignore[arg-type]


def test_a_distance_that_is_grazed_is_undecided_and_said_to_be() -> None:
    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    bodies = Bodies(lambda q: 0.1 + np.minimum(np.abs(q[:, 0] - 1.0), 0.3), lever=2.0)
    judged = Separation(bodies, 0.1).judge(motion)  # type: ignore[arg-type]
    assert not judged.satisfied
    assert "whether first0 - second0 keep 100.00 mm from t = 0.333333 to 0.333333 s" in judged.text
    assert "is not decided: they come to 100.0000 mm" in judged.text
    assert judged.time == pytest.approx(1.0 / 3.0, abs=1e-3)
    found = closest_at_all_times(bodies, motion.trajectory, 0.1)  # type: ignore[arg-type]
    assert found.open_until is not None
    # Sixteen intervals, halved 40 times.
    assert (found.open_until - found.time) * 16.0 * 2.0**40 == pytest.approx(1.0, rel=1e-2)
    far = Bodies(lambda q: np.full(len(q), 50.0))
    assert closest_at_all_times(far, motion.trajectory, 0.1).open_until is None  # type: ignore[arg-type]
    assert far.asked == 17


def test_what_is_far_is_decided_by_the_first_look() -> None:
    """However little is told of it: no more than that it is as far as was asked."""

    class Told(Bodies):
        def distances(self, q: Array, below: Array, exact_below: Array) -> Array:
            return np.minimum(super().distances(q, below, exact_below), below)

    motion = motion_of([[0.0] * 3, [3.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]] * 2, [0.0, 1.0])
    far = Told(lambda q: np.full(len(q), 50.0))
    assert closest_at_all_times(far, motion.trajectory, 0.1).open_until is None  # type: ignore[arg-type]
    assert far.asked == 17


def test_how_near_bodies_come_is_told_in_millimetres() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    text = Separation(Bodies(lambda q: np.full(len(q), 0.05)), 0.1).judge(motion).text  # type: ignore[arg-type]
    assert text.startswith("first0 - second0 are 50.00 mm apart at t = 0.000 s (wanted: 100.00 mm)")


def test_links_that_overlap_as_they_are_made_are_told_with_how_often() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    bodies = Bodies(lambda q: np.full(len(q), -0.05))
    bodies.overlapping = (Overlap("first0", "second0", 0.3, True),)
    text = Separation(bodies, 0.1).judge(motion).text  # type: ignore[arg-type]
    assert "overlap in 30 % of all configurations" in text


def test_nothing_to_be_near_to_is_far_enough() -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    found = Separation(Bodies(), 0.1).judge(motion)  # type: ignore[arg-type]
    assert (found.satisfied, found.subject, found.amount) == (True, "nothing", np.inf)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.05, "too near already: first0 - second0 are 50.00 mm apart: choose another one"),
        (-0.01, "in collision: first0 - second0 overlap by 10.00 mm: choose another one"),
    ],
)
def test_a_given_start_that_is_too_near_is_told(value: float, words: str) -> None:
    bodies = Bodies(lambda q: np.full(len(q), value))
    start = np.zeros(3)
    told = Separation(bodies, 0.1).of_given_start(start)  # type: ignore[arg-type]
    assert told == f"the given start is {words}"
    assert not Separation(bodies, -1.0).of_given_start(start)  # type: ignore[arg-type]
    # Another one does not help where links overlap as they are made.
    bodies.overlapping = (Overlap("first0", "second0", 0.9, True),)
    assert not Separation(bodies, 0.1).of_given_start(start)  # type: ignore[arg-type]


# Sums of a few hundred thousand steps against an exact integral, relative to its size.
SUMMED = 1e-7


@pytest.fixture(scope="module")
def circle() -> sm.Plan:
    panda = robot_named("panda")
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(panda, path, start=PANDA_HOME))


def test_the_way_is_what_joints_make(circle: sm.Plan) -> None:
    motion = circle.trajectory
    rng = np.random.default_rng(0)
    # Any cubics do, also such that turn round twice in an interval.
    wild = dataclasses.replace(motion, qd=5.0 * rng.normal(size=motion.qd.shape))
    for trajectory, tolerance in ((motion, SUMMED), (wild, 1e-4)):
        way, dense = trajectory.travelled, np.linspace(0.0, 4.0, 400_001)
        summed = np.cumsum(np.abs(np.diff(trajectory(dense), axis=0)), axis=0)
        for k in (1000, 123_456, 400_000):
            found = way(dense[[k]])[0]
            np.testing.assert_allclose(found, summed[k - 1], rtol=tolerance, atol=1e-7)


def test_the_distance_decides_to_the_last_digits(circle: sm.Plan) -> None:
    model = sm.obstacles.CollisionModel(circle.robot)
    least = model.worst(circle.trajectory(np.linspace(0.0, 4.0, 4001))).value
    kept = closest_at_all_times(model, circle.trajectory, least - 1e-5)
    assert kept.open_until is None
    assert least - 1e-5 <= kept.closest.value <= 1.02 * least
    broken = closest_at_all_times(model, circle.trajectory, least + 1e-6)
    assert broken.closest.value < least + 1e-6


def test_grazing_is_said_to_be_undecided_or_decided(circle: sm.Plan) -> None:
    """Down to the accuracy of distances something has to be said, and never that it is kept."""
    model = sm.obstacles.CollisionModel(circle.robot)
    least = model.worst(circle.trajectory(np.linspace(0.0, 4.0, 40_001))).value
    finding = Separation(model, least).judge(
        sm.certificate.FinishedMotion(circle.robot, circle.trajectory)
    )
    assert abs(finding.amount - least) < 1e-6
    assert finding.satisfied or "not decided" in finding.text or finding.amount < least


def test_a_plate_between_samples_is_found(circle: sm.Plan) -> None:
    """A coarse motion whose samples are clear of a plate that the fingers pass in between."""
    panda, t = circle.robot, np.array([0.0, 4.0])
    first = PANDA_HOME.copy()
    last = first + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    coarse = sm.Trajectory(t, np.array([first, last]), np.zeros((2, 7)), panda.joint_names)
    inside = panda.pose(coarse(2.0))
    plate = sm.obstacles.Box("plate", inside.translation, [0.02, 2e-3, 0.02])
    model = sm.obstacles.CollisionModel(panda, [plate])
    assert model.worst(coarse.q).value > 0.0
    finding = Separation(model, 0.0).judge(sm.certificate.FinishedMotion(panda, coarse))
    assert not finding.satisfied
    assert "plate" in finding.subject


@pytest.mark.parametrize("name", ["panda", "xarm7", "baxter"])
def test_the_default_keeps_an_arm_apart_from_itself(name: str) -> None:
    robot = robot_named(name)
    start = start_of(robot, "pose")
    plan = sm.plan(sm.Problem(robot, short_line(robot, start), start=start))
    assert "self-collision" in plan.certificate.covers
    assert plan.certificate.clearance is not None
    without = sm.plan(dataclasses.replace(plan.problem, clearance=None))
    assert "self-collision" in without.certificate.not_checked
    assert "self-collision" in without.certificate.verdict.split("not checked: ")[1]
    # Where nothing comes near, it changes nothing.
    np.testing.assert_array_equal(without.trajectory.q, plan.trajectory.q)


def test_a_motion_into_itself_is_not_verified_and_planned_anew() -> None:
    """xarm7 on a short line that the motion of least speed follows with its links in each other."""
    robot = robot_named("xarm7")
    rng = np.random.default_rng(2)
    start = rng.uniform(*robot.finite_limits())
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + rng.uniform(-0.1, 0.1, 3)
    careless = sm.plan(
        sm.Problem(robot, sm.paths.Line(pose, end, 3.0), start=start, clearance=None)
    )
    model = sm.obstacles.CollisionModel(robot)
    overlap = Separation(model, 0.0).judge(
        sm.certificate.FinishedMotion(robot, careless.trajectory)
    )
    assert not overlap.satisfied
    plan = sm.plan(
        dataclasses.replace(careless.problem, clearance=sm.constraints.Clearance(distance=0.0))
    )
    assert plan.certificate.verified, plan.certificate.verdict
    assert model.worst(plan.trajectory.q).value >= 0.0


def test_an_arm_without_bodies_says_so(planar: sm.RobotModel) -> None:
    certificate = sm.plan(sm.sample_problem()).certificate
    assert certificate.not_checked == ("accelerations", "self-collision")


def test_pairs_left_out_are_listed() -> None:
    robot = robot_named("baxter")
    remarks = " ".join(Separation(sm.obstacles.CollisionModel(robot), 0.0).remarks)
    for first, second in robot.touching:
        assert first in remarks
        assert second in remarks


def srdf_without(pairs: Iterable[tuple[str, str]]) -> str:
    rows = [f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>' for a, b in pairs]
    return f"<robot name='panda'>{''.join(rows)}</robot>"


def test_pairs_that_the_srdf_leaves_out_are_listed(tmp_path: Path) -> None:
    robot = robot_named("panda")
    every = tuple(dict.fromkeys(sm.obstacles.CollisionModel(robot).pairs))
    (tmp_path / "one.srdf").write_text(srdf_without(every[:1]))
    one = sm.constraints.Clearance(srdf=tmp_path / "one.srdf").requirement(robot)
    assert one.covers == ("self-collision",)
    assert f"pairs not checked, as asked: {' - '.join(every[0])}" in one.remarks


def test_a_plan_keeps_the_pairs_that_its_srdf_left_out(tmp_path: Path) -> None:
    """Whatever becomes of the SRDF: a plan that is read again is judged by the same pairs."""
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    pair = sm.obstacles.CollisionModel(robot).pairs[0]
    (tmp_path / "one.srdf").write_text(srdf_without([pair]))
    kept = sm.constraints.Clearance(srdf=tmp_path / "one.srdf")
    plan = sm.plan(sm.Problem(robot, short_line(robot, start), start=start, clearance=kept))
    plan.save(tmp_path / "plan.npz")
    (tmp_path / "one.srdf").write_text(srdf_without(sm.obstacles.CollisionModel(robot).pairs))
    again = sm.load_plan(tmp_path / "plan.npz")
    assert [item.disabled for item in again.problem.clearances] == [(pair,)]
    assert again.certificate.remarks == plan.certificate.remarks


def test_disabled_links_come_in_pairs() -> None:
    with pytest.raises(
        sm.errors.ProblemError, match=r"disabled has \('a', 'b', 'c'\), expected pairs"
    ):
        sm.constraints.Clearance(disabled=[("a", "b", "c")])


def test_where_the_srdf_leaves_out_all_pairs_self_collision_is_not_covered(tmp_path: Path) -> None:
    robot = robot_named("panda")
    (tmp_path / "all.srdf").write_text(srdf_without(sm.obstacles.CollisionModel(robot).pairs))
    start = start_of(robot, "pose")
    line = short_line(robot, start)
    own = sm.constraints.Clearance(srdf=tmp_path / "all.srdf")
    plan = sm.plan(sm.Problem(robot, line, start=start, clearance=own))
    assert "self-collision" in plan.certificate.not_checked
    assert sm.constraints.Clearance(
        [sm.obstacles.Sphere("ball", [2.0, 0.0, 0.0], 0.1)], srdf=tmp_path / "all.srdf"
    ).requirement(robot).covers == ("obstacles",)


def test_links_that_overlap_from_the_start_are_named_with_the_remedy() -> None:
    robot = dataclasses.replace(robot_named("pr2"), touching=())
    start = start_of(robot, "pose")
    model = sm.obstacles.CollisionModel(robot)
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 1e-3), 1.0)
    motion = sm.Trajectory(
        np.array([0.0, 1.0]),
        np.array([start, start + 1e-3]),
        np.zeros((2, robot.dof)),
        robot.joint_names,
    )
    check = sm.certify(robot, line, "pose", motion, requirements=[Separation(model, 0.0)])
    assert (
        '<disable_collisions link1="r_shoulder_pan_link" link2="r_upper_arm_link"' in check.verdict
    )


def near_bodies(panda: sm.RobotModel) -> sm.Plan:
    """Return a plan past two obstacles, with a torch."""
    start = start_of(panda, "pose")
    at = panda.pose(start).translation
    bodies = [
        sm.obstacles.Box("post", at + np.array([0.0, 0.4, 0.0]), [0.1, 0.1, 0.1]),
        sm.obstacles.Sphere("ball", at + np.array([0.0, -0.25, 0.1]), 0.05),
        sm.obstacles.Cylinder("torch", [0.0, 0.1, 0.05], 0.02, 0.1, frame="panda_hand"),
    ]
    line = short_line(panda, start)
    return sm.plan(
        sm.Problem(
            panda, line, start=start, constraints=[], clearance=sm.constraints.Clearance(bodies)
        )
    )


@pytest.mark.site
def test_the_closest_approach_of_each_obstacle_is_that_of_dense_samples(
    panda: sm.RobotModel,
) -> None:
    plan = near_bodies(panda)
    model = plan.problem.clearances[0].model(panda)
    times = np.linspace(plan.trajectory.t[0], plan.trajectory.t[-1], 400)
    values = model.distances(plan.trajectory(times))
    groups = {
        "the arm itself": [not {"post", "ball", "torch"} & set(pair) for pair in model.pairs],
        **{name: [name in pair for pair in model.pairs] for name in ("post", "ball", "torch")},
    }
    assert plan.approaches.keys() == groups.keys()
    for name, each in plan.approaches.items():
        least = values[:, groups[name]].min()
        # To a fiftieth, or 0.1 mm.
        assert each.value <= least + max(0.02 * least, 1e-4)
        assert each.value >= least - max(0.02 * least, 1e-4)
        pair = tuple(each.name.split(" - "))
        (there,) = model.distances(plan.trajectory(np.array([each.time])))
        own = [value for key, value in zip(model.pairs, there, strict=True) if key == pair]
        assert min(own) == pytest.approx(each.value, abs=1e-9)
    found = list(plan.approaches.values())
    assert found == sorted(found, key=lambda each: each.value)
    assert plan.certificate.clearance is not None
    assert found[0].value == pytest.approx(plan.certificate.clearance.value, rel=0.02)


def test_a_certificate_does_not_ask_for_details(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = near_bodies(panda)
    asked = []
    monkeypatch.setattr(Separation, "approaches", lambda *_: asked.append(1) or {})
    plan.check()
    assert not asked
    assert plan.approaches == {}
    assert asked
