"""The global search: curves against closed forms, chains against brute force, and refusals."""

import itertools
import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import selfmotion as sm
from selfmotion.basics.arrays import Array
from selfmotion.basics.errors import NoSequenceError, ProblemError
from selfmotion.search import SelfMotion, Sequence, best_sequences, targets
from selfmotion.search.chains import best_chains, diverse_chains
from selfmotion.search.guides import search_times
from selfmotion.search.nodes import Admissible

SUITE = Path(__file__).parents[1] / "benchmarks" / "data"
STEP = np.radians(7.0)
MARGIN = 5e-4


def faults(
    robot: sm.RobotModel,
    path: sm.Path,
    task: sm.Task,
    sequence: Sequence,
    lower: Array,
    upper: Array,
    step: float,
    collision: sm.CollisionModel | None = None,
) -> set[str]:
    """Say what is wrong with a sequence, from poses and distances alone."""
    found = set()
    for t, q in zip(sequence.t, sequence.q, strict=True):
        if max(task.miss(path.pose(t), robot.pose(q))) > 1e-8:
            found.add("path")
        if collision is not None and collision.distance(q).value < MARGIN:
            found.add("collision")
    if np.any(sequence.q < lower) or np.any(sequence.q > upper):
        found.add("limits")
    steps = np.abs(np.diff(sequence.q, axis=0))
    if np.any(steps > step * (1.0 + 1e-12)):
        found.add("step")
    if abs(steps.sum() - sequence.length) > 1e-9:
        found.add("length")
    return found


def suite_problem(name: str) -> tuple[sm.RobotModel, sm.Waypoints, sm.CollisionModel | None]:
    facts = json.loads((SUITE / name / "problem.json").read_text())
    path = sm.Waypoints.from_csv(SUITE / name / "path.csv")
    if "fetch" in name:
        lock = {"torso_lift_joint": 0.0}
        return sm.load_robot(SUITE / "fetch.urdf", tool=facts["tip_frame"], lock=lock), path, None
    robot = sm.load_robot("panda", tool=facts["tip_frame"])
    boxes = [
        sm.Box(f"box{i}", box["center_m"], box["size_m"]) for i, box in enumerate(facts["boxes"])
    ]
    return robot, path, sm.CollisionModel(robot, boxes)


@pytest.fixture(scope="module")
def flappy_bird() -> tuple[sm.RobotModel, sm.Waypoints, sm.CollisionModel | None]:
    return suite_problem("panda__flappy_bird")


@pytest.fixture(scope="module")
def flappy_sequences(flappy_bird) -> list[Sequence]:
    robot, path, collision = flappy_bird
    return best_sequences(
        robot,
        path,
        "pose",
        path.waypoint_times,
        lower=robot.lower,
        upper=robot.upper,
        largest_step=STEP,
        bodies=[] if collision is None else [(collision, MARGIN)],
        count=1,
    )


def test_a_narrow_passage_is_found_and_kept(flappy_bird, flappy_sequences) -> None:
    robot, path, collision = flappy_bird
    for sequence in flappy_sequences:
        assert not faults(
            robot, path, sm.Task.POSE, sequence, robot.lower, robot.upper, STEP, collision
        )
        # The shortest known motion, refined to a smooth one, has 15.80 rad.
        assert 15.7 < sequence.length < 17.5


def test_sequences_are_unlike_each_other(arm: sm.RobotModel) -> None:
    found = planar_search(arm, LINE, count=3)
    assert len(found) >= 2
    lengths = [sequence.length for sequence in found]
    assert lengths == sorted(lengths)
    for a, b in itertools.combinations(found, 2):
        assert np.mean(np.abs(a.q - b.q).max(axis=1) > 0.3) >= 0.1


def test_the_checker_refuses_what_is_broken(flappy_bird, flappy_sequences) -> None:
    robot, path, collision = flappy_bird
    good = flappy_sequences[0]

    def of(q: Array, length: float = good.length) -> set[str]:
        limits = robot.lower, robot.upper
        return faults(
            robot, path, sm.Task.POSE, Sequence(good.t, q, length), *limits, STEP, collision
        )

    assert "path" in of(good.q + 1e-7)
    jump = good.q.copy()
    jump[100:, 6] += 2.0 * STEP
    assert "step" in of(jump)
    beyond = good.q.copy()
    beyond[:, 1] = robot.upper[1] + 0.01
    assert {"limits", "collision"} <= of(beyond)
    assert of(good.q, good.length + 0.01) == {"length"}


@pytest.fixture(scope="module")
def arm() -> sm.RobotModel:
    return sm.load_robot("planar_3r")


LINKS = np.array([2.0, 2.0, 1.0])


def positions(q: Array) -> Array:
    """Closed form of the arm's tool, (…, 2)."""
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles) @ LINKS, np.sin(angles) @ LINKS], axis=-1)


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def closed_form(x: Array, yaw: Array, elbow: float) -> Array:
    """Configurations with the tool at x (2,) and the last link at angle yaw, (…, 3)."""
    wrist = x - LINKS[2] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    square = np.sum(wrist**2, axis=-1)
    q2 = elbow * np.arccos((square - LINKS[0] ** 2 - LINKS[1] ** 2) / (2 * LINKS[0] * LINKS[1]))
    q1 = np.arctan2(wrist[..., 1], wrist[..., 0]) - np.arctan2(
        LINKS[1] * np.sin(q2), LINKS[0] + LINKS[1] * np.cos(q2)
    )
    return np.stack([q1, q2, yaw - q1 - q2], axis=-1)


def test_curves_of_a_planar_arm_are_those_of_the_closed_form(arm: sm.RobotModel) -> None:
    # At 2 m the wrist is reached for each angle of the last link: two closed curves, elbow up and
    # down, on which that angle makes a turn.
    x = np.array([1.2, 1.6])
    motion = SelfMotion(arm, sm.Task.PLANAR, 0.05)
    target = targets(sm.Line(level(*x), level(1.3, 1.6), 1.0), np.array([0.0]))[0]
    seeds = np.random.default_rng(1).uniform(-3.0, 3.0, (30, 3))
    curves = motion.curves(target, seeds).curves

    def speed(yaw: float) -> float:
        step = 1e-6
        ahead, behind = closed_form(x, np.array([yaw + step, yaw - step]), 1.0)
        difference = ahead - behind
        difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
        return float(np.linalg.norm(difference)) / (2 * step)

    length = quad(speed, 0.0, 2 * np.pi, limit=200)[0]
    assert [curve.closed for curve in curves] == [True, True]
    for curve in curves:
        assert np.abs(positions(curve.q) - x).max() < 1e-10
        assert np.diff(curve.arc).max() < 1.2 * 0.05
        assert curve.length == pytest.approx(length, rel=1e-3)
        turns = (curve.q[-1] - curve.q[0]) / (2 * np.pi)
        assert np.abs(turns - np.round(turns)).max() < 1e-12
        elbow = np.sign(curve.q[0, 1])
        expected = closed_form(x, curve.q.sum(axis=1), elbow)
        difference = curve.q - expected
        difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
        assert np.abs(difference).max() < 1e-8


def test_one_curve_where_elbow_up_and_down_meet(arm: sm.RobotModel) -> None:
    # Beyond 3 m the stretched elbow joins the two families to one curve.
    motion = SelfMotion(arm, sm.Task.PLANAR, 0.05)
    target = targets(sm.Line(level(3.5, 0.0), level(3.4, 0.0), 1.0), np.array([0.0]))[0]
    curves = motion.curves(target, np.random.default_rng(1).uniform(-3.0, 3.0, (30, 3))).curves
    assert [curve.closed for curve in curves] == [True]
    assert curves[0].q[:, 1].min() < -0.1 < 0.1 < curves[0].q[:, 1].max()
    # No joint makes a full turn.
    assert np.abs(curves[0].q[-1] - curves[0].q[0]).max() < 1e-12


def brute_force(layers: list[Array], step: Array) -> float:
    best = np.inf
    for chain in itertools.product(*layers):
        steps = np.abs(np.diff(np.array(chain), axis=0))
        if np.all(steps <= step):
            best = min(best, float(steps.sum()))
    return best


def random_layers(seed: int) -> list[Array]:
    rng = np.random.default_rng(seed)
    layers = [rng.uniform(0.0, 1.0, (rng.integers(3, 8), 3)) for _ in range(5)]
    return [layer[np.argsort(layer[:, 0])] for layer in layers]


@pytest.mark.parametrize("seed", range(12))
def test_shortest_chain_is_that_of_brute_force(seed: int) -> None:
    layers, step = random_layers(seed), np.array([0.6, 0.5, 0.7])
    chains = best_chains(layers, step, np.zeros(3, dtype=bool))
    best = brute_force(layers, step)
    assert chains.cost[-1].min() == pytest.approx(best)
    if np.isfinite(best):
        chain = diverse_chains(layers, chains, step, np.zeros(3, dtype=bool), 1)[0]
        q = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
        assert np.abs(np.diff(q, axis=0)).sum() == pytest.approx(best)
        # Without one of its nodes the answer is another one.
        layers[2] = np.delete(layers[2], chain[2], axis=0)
        assert brute_force(layers, step) > best


def test_angles_of_turning_joints_count_modulo_turns() -> None:
    layers = [np.array([[3.1, 0.0]]), np.array([[-3.1, 0.0]])]
    step = np.array([0.2, 0.2])
    assert best_chains(layers, step, np.array([False, False])).blocked == 1
    turned = best_chains(layers, step, np.array([True, False]))
    assert turned.cost[-1][0] == pytest.approx(2 * np.pi - 6.2)


def test_bounds_count_every_turn() -> None:
    bounds = Admissible(np.array([-7.0]), np.array([7.0]), np.array([True]), ())
    assert sorted(bounds.all_turns(np.array([[0.5]]))[:, 0]) == pytest.approx(
        [0.5 - 2 * np.pi, 0.5, 0.5 + 2 * np.pi]
    )
    narrow = Admissible(np.array([-1.0]), np.array([1.0]), np.array([True]), ())
    assert list(narrow.free(np.array([[0.9], [1.1], [0.9 - 4 * np.pi]]))) == [True, False, True]
    assert narrow.excess(np.array([[1.2], [-1.3], [0.3]]))[:, 0] == pytest.approx([0.2, 0.3, 0.0])


def planar_search(arm: sm.RobotModel, path: sm.Path, **options) -> list[Sequence]:
    settings = {"lower": -2.9, "upper": 2.9, "largest_step": 0.3, "count": 2} | options
    return best_sequences(arm, path, "planar", np.linspace(0.0, path.duration, 21), **settings)


LINE = sm.Line(level(2.0, 1.0), level(3.0, -0.5), 1.0)


def test_planar_sequences_are_valid_and_repeatable(arm: sm.RobotModel) -> None:
    found = planar_search(arm, LINE, rng=3)
    limit = np.full(3, 2.9)
    for sequence in found:
        assert not faults(arm, LINE, sm.Task.PLANAR, sequence, -limit, limit, 0.3)
    again = planar_search(arm, LINE, rng=3)
    assert all(np.array_equal(a.q, b.q) for a, b in zip(found, again, strict=True))
    with pytest.raises(ValueError, match="read-only"):
        found[0].q[0, 0] = 1.0


def test_a_continuous_joint_goes_on_past_pi() -> None:
    robot, path, _ = suite_problem("fetch_arm__circle")
    times = path.waypoint_times[:60]
    found = best_sequences(
        robot, path, "pose", times, lower=robot.lower, upper=robot.upper, largest_step=STEP
    )
    for sequence in found:
        assert not faults(robot, path, sm.Task.POSE, sequence, robot.lower, robot.upper, STEP, None)


def test_a_path_out_of_the_workspace_says_when(arm: sm.RobotModel) -> None:
    path = sm.Line(level(4.0, 0.0), level(6.0, 0.0), 1.0)
    with pytest.raises(NoSequenceError, match="no configuration puts 'tool' on the path") as error:
        planar_search(arm, path)
    assert error.value.time == pytest.approx(0.5, abs=0.051)


def test_too_small_a_step_names_the_joint(arm: sm.RobotModel) -> None:
    with pytest.raises(NoSequenceError, match=r"step limit: joint 'joint\d' would have to move"):
        planar_search(arm, LINE, largest_step=0.002)


def test_limits_that_exclude_everything_name_the_joint(arm: sm.RobotModel) -> None:
    # The tool at 2.2 m needs a bent elbow.
    with pytest.raises(NoSequenceError, match=r"outside the joint limits.*joint '") as error:
        planar_search(arm, LINE, lower=[-2.9, -0.3, -0.3], upper=[2.9, 0.3, 0.3])
    assert error.value.time == 0.0
    assert "outside" in error.value.reason


def test_a_box_in_the_way_is_named(panda: sm.RobotModel) -> None:
    home = np.array(sm.NAMED_ARMS["panda"].home)
    start = panda.pose(home)
    end = pin.SE3(start.rotation, start.translation + np.array([0.0, 0.3, 0.0]))
    path = sm.Line(start, end, 1.0)
    box = sm.Box("crate", start.translation + np.array([0.0, 0.25, 0.0]), [0.3, 0.1, 0.3])
    with pytest.raises(NoSequenceError, match=r"collision.*'crate'") as error:
        best_sequences(
            panda,
            path,
            "pose",
            np.linspace(0.0, 1.0, 31),
            lower=panda.lower,
            upper=panda.upper,
            largest_step=0.2,
            bodies=[(sm.CollisionModel(panda, [box]), 0.0)],
        )
    assert 0.1 < error.value.time < 0.8


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lower": 1.0, "upper": 0.0}, "joint 'joint1' has its lower limit above"),
        ({"largest_step": 0.0}, "not positive"),
        ({"largest_step": [1.0, 2.0]}, "largest_step has shape"),
        ({"count": 0}, "count is 0"),
    ],
)
def test_nonsense_is_refused(arm: sm.RobotModel, options, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        planar_search(arm, LINE, **options)


def test_other_redundancies_are_refused(panda: sm.RobotModel) -> None:
    path = sm.Line(panda.pose(np.zeros(7)), panda.pose(np.full(7, 0.1)), 1.0)
    with pytest.raises(ProblemError, match="has redundancy 4 for task 'position'"):
        best_sequences(panda, path, "position", [0.0, 1.0], lower=-1.0, upper=1.0, largest_step=0.1)


def test_room_for_several_turns_changes_neither_motion_nor_limits(arm: sm.RobotModel) -> None:
    """Wide limits: as without any, but put inside as a whole, or counted where that is too much."""
    free = planar_search(arm, LINE, lower=-np.inf, upper=np.inf)[0]
    wide = planar_search(arm, LINE, lower=-7.0, upper=7.0)[0]
    assert wide.length == pytest.approx(free.length, rel=1e-12)
    assert not faults(arm, LINE, sm.Task.PLANAR, wide, np.full(3, -7.0), np.full(3, 7.0), 0.3)
    # Just over a turn, placed so that the shortest motion cannot stay inside at any turn.
    middle = 0.5 * (free.q[:, 0].min() + free.q[:, 0].max())
    lower, upper = np.full(3, -np.inf), np.full(3, np.inf)
    lower[0], upper[0] = middle - 0.01, middle + 2 * np.pi
    shifted = planar_search(arm, LINE, lower=lower, upper=upper)[0]
    assert shifted.length > free.length
    assert not faults(arm, LINE, sm.Task.PLANAR, shifted, lower, upper, 0.3)


def test_steps_of_their_own_for_each_interval(arm: sm.RobotModel) -> None:
    times = np.concatenate([np.linspace(0.0, 0.5, 31), np.linspace(0.5, 1.0, 7)[1:]])
    step = 4.0 * np.diff(times)[:, None] * np.ones(3)
    found = best_sequences(
        arm, LINE, "planar", times, lower=-2.9, upper=2.9, largest_step=step, count=1
    )[0]
    moved = np.abs(np.diff(found.q, axis=0))
    assert np.all(moved <= step * (1 + 1e-12))
    assert moved[30:].max() > step[0, 0]
    with pytest.raises(ProblemError, match="largest_step has shape"):
        best_sequences(arm, LINE, "planar", times, lower=-2.9, upper=2.9, largest_step=step[1:])


@pytest.mark.parametrize("waypoints", [2, 3, 60, 199, 1000])
def test_the_search_looks_at_neither_too_few_nor_too_many_times(waypoints: int) -> None:
    rng = np.random.default_rng(waypoints)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, waypoints - 1))])
    poses = [level(2.0 + 0.5 * time / times[-1], 1.0) for time in times]
    t = search_times(sm.Waypoints.from_poses(times, poses), 60)
    assert (t[0], t[-1]) == (0.0, times[-1])
    assert 60 <= len(t) <= 401
    assert np.diff(t).min() > 0.0


def test_the_search_looks_as_the_tool_moves_on() -> None:
    """However the path is timed, and whether it moves or turns; at pauses hardly at all."""
    poses = [level(2.0, 1.0), level(4.0, 1.0), level(4.0, 1.0), level(4.0, -1.0)]
    path = sm.Waypoints.from_poses(np.array([0.0, 1.0, 5.0, 9.0]), poses)
    t = search_times(path, 60)
    tool = path.samples(t).translation
    strides = np.linalg.norm(np.diff(tool, axis=0), axis=1)
    # 0.02 m, by interpolation between 2,000 looks.
    assert strides.max() < 0.022
    assert np.sum((t > 1.0) & (t < 5.0)) < 0.1 * len(t)
