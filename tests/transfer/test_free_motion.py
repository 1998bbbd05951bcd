"""Free motions end where they should, keep all that is asked at all times, and hurry."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.transfer import FreeMotions
from support.arms import robot_named
from support.oracle import Judge
from support.own_kinematics import Arm
from support.scenes import Followed, arm

# Above what straight bang-bang motions take: corners, jerk limits and detours.
LONGER = 2.5
# What a motion from rest may move at its ends [rad/s, rad/s²]: rounding.
RESTING = 1e-6
SCENE = tuple(
    sm.obstacles.Box(f"box {k}", place, [0.15, 0.15, 0.5])
    for k, place in enumerate([[0.55, 0.0, 0.25], [0.0, 0.55, 0.4], [-0.4, -0.35, 0.6]])
)
HOME = np.array(sm.NAMED_ARMS["panda"].home)


def turned(first: float, second: float, fourth: float) -> np.ndarray:
    """Return what three joints of a Panda turn by, (7,)."""
    return np.array([first, second, 0.0, fourth, 0.0, 0.0, 0.0])


# Low and stretched out on both sides of a box.
ROUND_A_BOX = (HOME + turned(0.9, 1.2, 0.5), HOME + turned(-0.9, 1.2, 0.5))


@pytest.mark.parametrize("joints", [5, 6, 7])
def test_moves_keep_all_limits_and_clearances_by_an_independent_judge(joints, tmp_path) -> None:
    robot = arm(tmp_path, np.random.default_rng(joints), joints, "box")
    kinematics, limit = Arm(robot), np.full(joints, 20.0)
    limits = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(20.0),
    ]
    first, last = np.random.default_rng(5).uniform(-1.2, 1.2, (2, joints))
    _, middle = kinematics.place(kinematics.tool, 0.5 * (first + last)[None])
    ball = sm.obstacles.Sphere("ball", middle[0], 0.08)
    clearance = sm.constraints.Clearance([ball], 2e-3)
    move = sm.move(robot, first, last, constraints=limits, clearance=clearance).require()
    motion = move.motion
    np.testing.assert_array_equal(motion.q[[0, -1]], [first, last])
    for order in (1, 2):
        np.testing.assert_allclose(motion(motion.t[[0, -1]], order), 0.0, atol=RESTING)
    followed = Followed(kinematics, motion, motion.duration)
    bodies = [([ball], clearance.model(robot).pairs, 2e-3)]
    judge = Judge(robot, followed, limits={2: (-limit, limit)}, bodies=bodies, per_interval=9)
    assert not judge.judge(motion).refutes
    straight = FreeMotions(robot, move.constraints, np.random.default_rng(0))
    assert motion.duration <= LONGER * straight.time_of(first, last)


def test_a_straight_move_takes_little_more_than_the_limits_ask_for() -> None:
    panda = robot_named("panda")
    last = HOME + np.array([0.8, 0.2, 0.0, 0.3, 0.0, 0.1, 0.4])
    move = sm.move(panda, HOME, last).require()
    bound = FreeMotions(panda, move.constraints, np.random.default_rng(0)).time_of(HOME, last)
    # The ramps of the jerk limit come on top.
    assert bound <= move.motion.duration <= 1.1 * bound


def test_the_same_seed_gives_the_same_move() -> None:
    robot, clearance = robot_named("panda"), sm.constraints.Clearance(list(SCENE), 5e-3)
    first, last = ROUND_A_BOX
    one, other = (sm.move(robot, first, last, clearance=clearance, rng=3) for _ in range(2))
    straight = sm.move(robot, first, last)
    assert one.require().motion.duration > straight.require().motion.duration
    np.testing.assert_array_equal(one.motion.q, other.motion.q)
    np.testing.assert_array_equal(one.motion.t, other.motion.t)


def test_a_pose_stands_for_any_configuration_that_puts_the_tool_there() -> None:
    panda = robot_named("panda")
    pose = panda.pose(HOME + 0.3)
    move = sm.move(panda, HOME, pose).require()
    np.testing.assert_allclose(
        panda.pose(move.motion.q[-1]).homogeneous, pose.homogeneous, atol=1e-8
    )
    back = sm.move(panda, pose, HOME, task="position").require()
    start = panda.pose(back.motion.q[0])
    np.testing.assert_allclose(start.translation, pose.translation, atol=1e-8)


def test_a_move_passes_what_it_goes_via_without_a_stop() -> None:
    panda = robot_named("panda")
    via = HOME + np.array([0.5, -0.3, 0.2, 0.0, 0.1, 0.0, 0.0])
    last = HOME + np.array([1.0, 0.0, 0.0, 0.2, 0.0, 0.3, 0.0])
    motion = sm.move(panda, HOME, last, via=[via]).require().motion
    t = np.linspace(motion.t[0], motion.t[-1], 20001)
    near = np.abs(motion(t) - via).max(axis=1)
    at = t[int(np.argmin(near))]
    # Within what a joint goes in a step of the samples.
    assert near.min() < 2.5 * (t[1] - t[0])
    assert np.abs(motion(at, 1)).max() > 0.1


def test_moves_keep_bands_and_what_depends_on_the_pace() -> None:
    panda = robot_named("panda")
    upright = sm.constraints.Tilt("panda_hand_tcp", within=0.5)
    slow = sm.constraints.ToolLimits(speed=0.2)
    constraints = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        upright,
        slow,
    ]
    last = panda.inverse_kinematics(
        panda.pose(HOME) * sm.model.task.SE3(np.eye(3), np.array([0.2, -0.3, 0.0])), seed=HOME
    )
    move = sm.move(panda, HOME, last, constraints=constraints).require()
    assert "speeds" in move.verdict
    assert move.motion.duration > sm.move(panda, HOME, last).require().motion.duration


# A straight move is this much longer than limits of speed and acceleration ask, by the last share
# of limits that is left; besides it takes what accelerations need to build up three times, where
# nobody limits the jerk in this time [s].
HURRIED, SOFT = 1.01, 0.02


def test_straight_moves_are_as_fast_as_limits_allow() -> None:
    panda = robot_named("panda")
    constraints = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    planner = FreeMotions(panda, constraints, np.random.default_rng(0))
    rng = np.random.default_rng(3)
    for size in (1e-3, 0.01, 0.1, 0.1, 0.5, 0.5):
        last = HOME + size * rng.uniform(-1.0, 1.0, 7)
        least = float(planner.time_of(HOME, last))
        took = planner.between(HOME, last).require().motion.duration
        assert least <= took <= HURRIED * least + 3.0 * SOFT, size


def test_what_is_not_found_is_said_and_no_more() -> None:
    panda = robot_named("panda")
    clearance = sm.constraints.Clearance(list(SCENE), 5e-3)
    first, last = ROUND_A_BOX
    # Nothing but the straight one is looked at before the deadline.
    blocked = sm.move(panda, first, last, clearance=clearance, seconds=1e-6)
    assert "no way was found between the configurations in " in blocked.trouble
    met = sm.move(panda, first, HOME + turned(0.0, 1.2, 0.5), clearance=clearance)
    assert "the last configuration is not allowed" in met.trouble
    assert "box 0" in met.trouble
    far = sm.move(panda, HOME, HOME + turned(9.0, 0.0, 0.0)).trouble
    assert "joint 'panda_joint1' is at 9 rad (-2.8973 to 2.8973 allowed); give one" in far
    with pytest.raises(sm.errors.PlanError, match="not allowed"):
        met.require()
    beyond = sm.move(panda, HOME, np.full(7, 9.0))
    assert "joint 'panda_joint1' is" in beyond.trouble


def test_a_saved_move_is_the_same_and_a_changed_one_is_not_verified(tmp_path) -> None:
    panda, clearance = robot_named("panda"), sm.constraints.Clearance(list(SCENE), 5e-3)
    move = sm.move(panda, HOME, HOME + 0.4, clearance=clearance).require()
    move.save(tmp_path / "move.npz")
    again = sm.files.load_move(tmp_path / "move.npz").require()
    np.testing.assert_array_equal(again.motion.q, move.motion.q)
    assert again.verdict == move.verdict
    with pytest.raises(sm.errors.FileFormatError, match="is a move, not a plan"):
        sm.load_plan(tmp_path / "move.npz")
    from selfmotion.basics import read_archive, write_archive

    description, arrays = read_archive(tmp_path / "move.npz")
    arrays["q"] = arrays["q"] + 1e-12
    write_archive(tmp_path / "changed.npz", description, arrays)
    assert "digest" in sm.files.load_move(tmp_path / "changed.npz").trouble
