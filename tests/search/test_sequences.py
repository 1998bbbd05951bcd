"""The global search: sequences that keep all, a checker that refuses, and refusals."""

import itertools
import json

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array, NoSequenceError, silent
from selfmotion.model.follow import Follows
from selfmotion.planning.search import Sequence
from selfmotion.planning.search.sequences import best_sequences, curve_layers
from support.places import DATA

STEP = np.radians(7.0)


MARGIN = 5e-4


def faults(
    robot: sm.RobotModel,
    path: sm.paths.Path,
    task: sm.Task,
    sequence: Sequence,
    lower: Array,
    upper: Array,
    step: float,
    collision: sm.obstacles.CollisionModel | None = None,
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


def searched(
    follows: Follows,
    t: Array,
    *,
    lower: Array | float,
    upper: Array | float,
    largest_step: Array | float,
    bodies: tuple[tuple[sm.obstacles.CollisionModel, float], ...] = (),
    count: int = 3,
    rng: int = 0,
) -> list[Sequence]:
    """Return the best sequences over curves, what is the same for all joints given as a number."""
    dof = follows.robot.dof
    steps = np.array(np.broadcast_to(largest_step, (len(t) - 1, dof)), dtype=np.float64)
    limits = tuple(np.array(np.broadcast_to(x, dof), dtype=np.float64) for x in (lower, upper))
    layers = curve_layers(follows, t, steps, limits, tuple(bodies), rng, silent)
    return best_sequences(layers, count, None, silent)


def suite_problem(
    name: str,
) -> tuple[sm.RobotModel, sm.paths.Waypoints, sm.obstacles.CollisionModel | None]:
    facts = json.loads((DATA / name / "problem.json").read_text())
    path = sm.paths.Waypoints.from_csv(DATA / name / "path.csv")
    if "fetch" in name:
        lock = {"torso_lift_joint": 0.0}
        return sm.load_robot(DATA / "fetch.urdf", tool=facts["tip_frame"], lock=lock), path, None
    robot = sm.load_robot("panda", tool=facts["tip_frame"])
    boxes = [
        sm.obstacles.Box(f"box{i}", box["center_m"], box["size_m"])
        for i, box in enumerate(facts["boxes"])
    ]
    return robot, path, sm.obstacles.CollisionModel(robot, boxes)


@pytest.fixture(scope="module")
def flappy_bird() -> tuple[sm.RobotModel, sm.paths.Waypoints, sm.obstacles.CollisionModel | None]:
    return suite_problem("panda__flappy_bird")


@pytest.fixture(scope="module")
def flappy_sequences(flappy_bird) -> list[Sequence]:
    robot, path, collision = flappy_bird
    return searched(
        Follows.of(robot, path, "pose"),
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


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def planar_search(arm: sm.RobotModel, path: sm.paths.Path, **options) -> list[Sequence]:
    settings = {"lower": -2.9, "upper": 2.9, "largest_step": 0.3, "count": 2} | options
    return searched(
        Follows.of(arm, path, "planar"), np.linspace(0.0, path.duration, 21), **settings
    )


LINE = sm.paths.Line(level(2.0, 1.0), level(3.0, -0.5), 1.0)


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
    found = searched(
        Follows.of(robot, path, "pose"),
        times,
        lower=robot.lower,
        upper=robot.upper,
        largest_step=STEP,
    )
    for sequence in found:
        assert not faults(robot, path, sm.Task.POSE, sequence, robot.lower, robot.upper, STEP, None)


def test_a_path_out_of_the_workspace_says_when(arm: sm.RobotModel) -> None:
    path = sm.paths.Line(level(4.0, 0.0), level(6.0, 0.0), 1.0)
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
    path = sm.paths.Line(start, end, 1.0)
    box = sm.obstacles.Box("crate", start.translation + np.array([0.0, 0.25, 0.0]), [0.3, 0.1, 0.3])
    with pytest.raises(NoSequenceError, match=r"collision.*'crate'") as error:
        searched(
            Follows.of(panda, path, "pose"),
            np.linspace(0.0, 1.0, 31),
            lower=panda.lower,
            upper=panda.upper,
            largest_step=0.2,
            bodies=[(sm.obstacles.CollisionModel(panda, [box]), 0.0)],
        )
    assert 0.1 < error.value.time < 0.8


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
    found = searched(
        Follows.of(arm, LINE, "planar"), times, lower=-2.9, upper=2.9, largest_step=step, count=1
    )[0]
    moved = np.abs(np.diff(found.q, axis=0))
    assert np.all(moved <= step * (1 + 1e-12))
    assert moved[30:].max() > step[0, 0]
