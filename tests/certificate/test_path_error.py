"""The path error at all times: no peak is missed, and hardly more is claimed."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import deviation_from
from selfmotion.certificate.path_error import (
    _FROBENIUS,
    PathCheck,
    _vector_series,
    bound_errors,
    deviation_size,
    excess,
    jacobians,
    poses,
    rotation_vectors,
)
from selfmotion.model.follow import Follows, single_tip
from selfmotion.planning.formulation import Formulation, path_errors
from support.arms import robot_named
from support.two_arms import baxter_with_both_arms

ROUNDING = 1e-12


def errors_of(path: sm.paths.Path, task: sm.Task, robot: sm.RobotModel, *given: Any) -> PathCheck:
    return bound_errors(robot, single_tip(Follows.of(robot, path, task)), *given)


def test_the_error_is_bounded_at_all_times_and_hardly_more() -> None:
    """A tool at rest, and a path that swings beside it between the trajectory's two samples."""
    robot = robot_named("planar_3r")
    q = robot.dexterous_configuration("planar")
    pose = robot.pose(q)

    class Swinging(sm.paths.Path):
        """Sideways by a tenth of a millimetre, most at 0.8 s."""

        duration = 1.0
        knots = np.array([0.0, 1.0])

        def evaluate(self, t: Array) -> sm.paths.PathSamples:
            swing = 1e-4 * np.exp(-((t - 0.8) ** 2) / 0.02)
            twist = np.outer(-swing * 100.0 * (t - 0.8), np.eye(6)[1])
            places = pose.translation + np.outer(swing, [0.0, 1.0, 0.0])
            return sm.paths.PathSamples(t, places, np.tile(pose.rotation, (len(t), 1, 1)), twist)

    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 3)), robot.joint_names)

    def check(tolerance: float, *relaxed: sm.Relaxation) -> Any:
        given = sm.Tolerance(tolerance, 1e-6)
        return bound_errors(
            robot,
            Follows.of(robot, Swinging(), sm.Task.PLANAR).items[0],
            trajectory,
            given,
            relaxed,
        )

    for tolerance in (1.001e-4, 1e-4 / 1.001):
        found = check(tolerance)
        assert 1e-4 - 1e-9 <= found.position.value <= 1.03e-4
        assert found.position.time == pytest.approx(0.8, abs=0.05)
        assert found.position.name == "tool"
        assert (found.rotation.value, found.rotation.time, found.undecided) == (0.0, 0.0, ())
    settled = check(1.001e-4)
    assert settled.position.value <= 1.001e-4
    within = check(5.05e-5, sm.Relaxation("y", 5e-5, during=(0.5, 1.0)))
    assert 5e-5 - 1e-9 <= within.position.value <= 5.1e-5
    assert within.deviations[0].value == pytest.approx(1e-4, rel=0.03)
    assert (within.deviations[0].name, within.undecided) == ("(y) at 0.5 to 1 s", ())
    outside = check(1e-6, sm.Relaxation("y", 1e-3, during=(0.0, 0.5)))
    # So far beyond the tolerance nothing has to be known more closely.
    assert 1e-4 - 1e-9 <= outside.position.value <= 1.2e-4
    assert check(1.0).samples == 10
    assert not check(1.0).proved


@pytest.mark.parametrize("angular", [False, True])
def test_no_peak_between_the_points_looked_at_is_missed(angular: bool) -> None:
    """A tool at rest, and a path beside it by a parabola whose top is anywhere."""
    robot, most = robot_named("panda"), 1e-4
    q = robot.dexterous_configuration("pose")
    pose = robot.pose(q)
    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), robot.joint_names)

    class Arched(sm.paths.Path):
        duration = 1.0
        knots = np.array([0.0, 1.0])

        def __init__(self, top: float) -> None:
            self.top = top

        def evaluate(self, t: Array) -> sm.paths.PathSamples:
            sizes = most * (1.0 - (t - self.top) ** 2)
            motions = np.outer(sizes, np.eye(6)[5 if angular else 1])
            places = [pose * pin.exp6(pin.Motion(motion)) for motion in motions]
            translation = np.array([place.translation for place in places])
            rotation = np.array([place.rotation for place in places])
            return sm.paths.PathSamples(t, translation, rotation, np.zeros((len(t), 6)))

    for top in np.random.default_rng(0).uniform(0.05, 0.95, 40):
        for allowed in (1.0, most * (1.0 - 1e-5)):
            given = sm.Tolerance(allowed, allowed)
            path = Arched(float(top))
            found = bound_errors(
                robot, Follows.of(robot, path, sm.Task.POSE).items[0], trajectory, given, ()
            )
            value = (found.rotation if angular else found.position).value
            assert most - ROUNDING <= value <= 1.01 * most


@pytest.mark.parametrize("row", range(6))
@pytest.mark.parametrize("relaxed", [None, ("rx", "world"), ("x", "world"), ("y", "tool")])
def test_errors_of_every_row_count(row: int, relaxed: tuple[str, str] | None) -> None:
    """A tool at rest, and a path that is a constant bit beside it, or turned; bands hardly help."""
    robot, size = robot_named("panda"), 1e-4
    q = robot.dexterous_configuration("pose")
    beside = robot.pose(q) * pin.exp6(pin.Motion(size * np.eye(6)[row]))
    path = sm.paths.Waypoints.from_poses([0.0, 1.0], [beside, beside])
    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), robot.joint_names)
    bands = [] if relaxed is None else [sm.Relaxation(relaxed[0], 1e-9, axes=relaxed[1])]
    follow = Follows.of(robot, path, sm.Task.POSE).items[0]
    found = bound_errors(robot, follow, trajectory, sm.Tolerance(1.0, 1.0), bands)
    expected = [size, 0.0] if row < 3 else [0.0, size]
    errors = [found.position.value, found.rotation.value]
    np.testing.assert_allclose(errors, expected, atol=1e-3 * size)


@pytest.mark.parametrize("relaxed", [False, True])
def test_where_any_turn_is_allowed_all_are(relaxed: bool) -> None:
    """Half a turn and beyond, the tool standing and the path turning: bounds end at half a turn."""
    robot = robot_named("panda")
    q = robot.dexterous_configuration("pose")
    path = sm.paths.Circle.around(robot.pose(q), 0.01, 1.0, turn_tool=True)
    motion = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), robot.joint_names)
    bands = [sm.Relaxation("rx", 0.1)] if relaxed else []
    for tolerance, kept in ((np.pi, True), (3.0, False)):
        found = sm.certify(
            robot, path, "pose", motion, sm.Tolerance(1.0, tolerance), relaxations=bands
        )
        assert found.verified is kept, found.verdict
        assert found.rotation_error.value <= np.pi + 1e-3


def test_of_all_matrices_the_identity_is_largest_by_frobenius() -> None:
    """|M|_F ≤ √3 |M| for matrices of three rows: no smaller factor makes a bound of it."""
    assert np.linalg.norm(np.eye(3)) / np.linalg.norm(np.eye(3), 2) == pytest.approx(_FROBENIUS)


@pytest.mark.parametrize("gap", [1e-13, 1e-11, 1e-6])
def test_between_samples_however_near_the_arm_may_go_anywhere(gap: float) -> None:
    """A spike of a hundredth at a sample that rounding can hardly tell from those beside it."""
    robot = robot_named("panda")
    q = robot.dexterous_configuration("pose")
    t, spiked = np.array([0.0, 0.5 - gap, 0.5, 0.5 + gap, 1.0]), np.tile(q, (5, 1))
    spiked[2, 1] += 0.01
    motion = sm.Trajectory(t, spiked, np.zeros((5, 7)), robot.joint_names)
    path = sm.paths.Dwell(robot.pose(q), 1.0)
    found = bound_errors(
        robot, Follows.of(robot, path, sm.Task.POSE).items[0], motion, sm.Tolerance(), ()
    )
    assert found.position.value > 1e-4
    assert found.position.time == pytest.approx(0.5, abs=2e-6)


def test_where_a_path_bends_sharply_a_short_interval_stays_undecided() -> None:
    """Its error peaks at the tolerance in a corner that nothing announces: halved sixteen times."""
    robot = robot_named("planar_3r")
    q = robot.dexterous_configuration("planar")
    pose = robot.pose(q)

    class Bent(sm.paths.Path):
        duration = 1.0

        def evaluate(self, t: Array) -> sm.paths.PathSamples:
            swing = 1e-4 * (1.0 - np.abs(t - 1.0 / 3.0))
            places = pose.translation + np.outer(swing, [0.0, 1.0, 0.0])
            turns = np.tile(pose.rotation, (len(t), 1, 1))
            return sm.paths.PathSamples(t, places, turns, np.zeros((len(t), 6)))

    trajectory = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 3)), robot.joint_names)
    allowed = sm.Tolerance(1e-4 * (1.0 + 1e-9), 1.0)
    found = bound_errors(
        robot, Follows.of(robot, Bent(), sm.Task.PLANAR).items[0], trajectory, allowed, ()
    )
    ((start, end),) = found.undecided
    assert start <= 1.0 / 3.0 <= end
    assert end - start == pytest.approx(2.0**-16)
    assert 1e-4 < found.position.value < 1.001e-4


@pytest.mark.parametrize("row", range(6))
def test_errors_between_samples_are_those_of_the_poses(row: int) -> None:
    robot, offset = robot_named("panda"), 1e-3
    q = robot.dexterous_configuration("pose")
    pose = robot.pose(q)
    beside = pose * pin.exp6(pin.Motion(offset * np.eye(6)[row]))
    path = sm.paths.Waypoints.from_poses([0.0, 1.0, 2.0], [pose, pose, beside])
    problem = sm.Problem(robot, path, start=q)
    still = sm.Trajectory([0.0, 0.5, 2.0], [q] * 3, np.zeros((3, 7)), robot.joint_names)
    errors = path_errors(Formulation.of(problem), still)
    middles = [path.pose(0.25), path.pose(1.25)]
    expected = [problem.task.miss(target, pose) for target in middles]
    np.testing.assert_allclose(errors, expected, atol=1e-9)
    # What a relaxation allows is no error.
    name = ("x", "y", "z", "rx", "ry", "rz")[row]
    band = sm.Relaxation(name, 2.0 * offset, axes="tool")
    relaxed = dataclasses.replace(problem, relaxations=[band])
    np.testing.assert_allclose(path_errors(Formulation.of(relaxed), still), 0.0, atol=1e-5 * offset)


# The deviation of a pose from its target, row by row.


def rotation(rng: np.random.Generator, size: float = 1.5) -> Array:
    return np.asarray(pin.exp3(rng.uniform(-size, size, 3)))


@pytest.mark.parametrize("in_tool_axes", [False, True])
@pytest.mark.parametrize("task", list(sm.Task))
def test_the_deviation_is_that_of_the_poses(task: sm.Task, in_tool_axes: bool) -> None:
    """Against Pinocchio's logarithm; the tool's axis alone by the turn between two vectors."""
    panda, rng = robot_named("panda"), np.random.default_rng(1)
    lower, upper = panda.finite_limits()
    q = rng.uniform(lower, upper, (6, 7))
    targets = [(rotation(rng) @ panda.pose(x).rotation, rng.normal(size=3)) for x in q]
    turns, places = (np.array(part) for part in zip(*targets, strict=True))
    path: Any = SimpleNamespace(
        samples=lambda t: SimpleNamespace(rotation=turns, translation=places)
    )
    follow: Any = SimpleNamespace(chain=panda.chain, path=path, task=task)
    found = deviation_from(follow, np.zeros(6), q, in_tool_axes)
    for k, configuration in enumerate(q):
        pose = panda.pose(configuration)
        miss = (pose.translation - places[k]) * np.isin(range(3), task.rows)
        expected = turns[k].T @ miss if in_tool_axes else miss
        np.testing.assert_allclose(found[k, :3], expected, atol=ROUNDING)
        relative = turns[k].T @ pose.rotation
        turn = np.zeros(3)
        if task.tool_axes:
            axis = relative[:, 2]
            normal = np.cross([0.0, 0.0, 1.0], axis)
            turn = normal / np.linalg.norm(normal) * np.arccos(axis[2])
        elif np.any(task.rows >= 3):
            turn = pin.log3(relative)
        np.testing.assert_allclose(found[k, 3:], turn, atol=1e-9)


@pytest.mark.parametrize("reference", [None, "right_gripper"])
def test_jacobians_are_what_poses_change_by(reference: str | None) -> None:
    """In the frame of the base, which moves with the other hand."""
    robot, rng, step = baxter_with_both_arms(reference), np.random.default_rng(0), 1e-6
    q = robot.dexterous_configuration("pose") + 0.1 * rng.normal(size=robot.dof)
    found, turns = jacobians(robot.chain, q[None])
    for joint, unit in enumerate(np.eye(robot.dof)):
        (ahead, behind), places = poses(robot.chain, q + step * np.outer([1.0, -1.0], unit))
        moved = (places[0] - places[1]) / (2.0 * step)
        turned = pin.log3(ahead @ behind.T) / (2.0 * step)
        np.testing.assert_allclose(found[0, :, joint], [*moved, *turned], atol=1e-8)
    np.testing.assert_allclose(turns[0], robot.pose(q).rotation, atol=ROUNDING)


@pytest.mark.parametrize("task", list(sm.Task))
def test_turns_of_many_intervals_are_those_one_by_one(task: sm.Task) -> None:
    rng = np.random.default_rng(3)
    turns = np.array([rotation(rng) for _ in range(12)])
    found = rotation_vectors(task, turns.reshape(2, 6, 3, 3))
    one_by_one = rotation_vectors(task, turns)
    np.testing.assert_allclose(found.reshape(12, 3), one_by_one, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_half_a_turn_and_none_are_what_they_are(task: str) -> None:
    half = np.diag([1.0, -1.0, -1.0])
    actual = np.array([half, np.eye(3)])
    found = rotation_vectors(sm.Task.of(task), np.asarray(actual))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), [np.pi, 0.0])


def test_what_is_relaxed_is_taken_off_its_rows_in_its_window() -> None:
    item = sm.Relaxation(("x", "y"), 0.5, during=(1.0, 2.0))
    deviation = np.tile([3.0, 4.0, 7.0, 0.1, 0.2, 0.3], (6, 1))
    deviation[4] *= 0.1
    deviation[5, :2] = 0.0
    t = np.array([0.5, 1.0, 2.0, 2.5, 1.5, 1.5])
    size = deviation_size(item, 3.0, t, deviation)
    np.testing.assert_allclose(size, [0.0, 5.0, 5.0, 0.0, 0.5, 0.0])
    beyond = excess([item], 3.0, t, deviation)
    expected = deviation.copy()
    expected[1:3, :2] *= 0.9
    expected[4:, :2] = 0.0
    np.testing.assert_allclose(beyond, expected)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.0, 2.9])
def test_the_rotation_vector_of_a_turn_that_stays_is_as_long_as_its_angle(angle: float) -> None:
    """Of sin θ there is θ = sin θ g(cos θ), to both sides of a quarter turn."""
    turned = np.zeros((4, 1))
    turned[0] = np.sin(angle)
    found = _vector_series(turned, np.array([np.cos(angle)]))
    np.testing.assert_allclose(found[:, 0], [angle, 0.0, 0.0, 0.0], rtol=1e-9)
