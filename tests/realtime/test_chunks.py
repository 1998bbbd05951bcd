"""Chunks of poses: joined without a jump, followed to the micrometre, and stopped when over."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.task import SE3
from selfmotion.realtime import Approach, Blended, Chunk, Flag, MovingPose, Replanner, Segment
from selfmotion.realtime.chunks import blend
from selfmotion.shell.testing import check_path
from support.arms import PANDA_HOME, robot_named

# How often a policy tells, how far ahead, its step, and how late it tells [s].
EVERY, AHEAD, STEP, LATE = 0.3, 1.0, 0.1, 0.06
# Its noise [m, rad].
NOISE, TURNED = 1e-3, 5e-3
# What is left of the reference when the tool has caught up [m, rad]: the middle rule's error over
# cycles of 1 ms, and that of the mean of commands.
CAUGHT = 1e-4
# Half a difference of twists, and distance from a place on each side [s].
H, BESIDE = 1e-5, 2e-5
# Jump of the acceleration of a path over that [m/s², rad/s²]: its jerk times that.
JUMP = 0.05
# Rounding of what limits the commands.
ROUNDING = 1e-9


def pose_at(t: float) -> SE3:
    """Return where a policy wants the tool of a Panda, the longer the farther from home."""
    here = robot_named("panda").pose(PANDA_HOME)
    turn = pin.exp3(0.2 * np.sin(0.9 * t) * np.array([0.3, -0.5, 1.0]))
    way = np.array([0.06 * np.sin(0.8 * t), 0.08 * (1 - np.cos(1.1 * t)), -0.03 * np.sin(1.7 * t)])
    return SE3(turn @ here.rotation, here.translation + way)


def told(
    t: float, rng: np.random.Generator, begins: float | None = None
) -> tuple[Array, list[SE3]]:
    """Return times and poses of a noisy chunk that is told at t."""
    times = (t - LATE if begins is None else begins) + np.arange(0.0, AHEAD + 1e-9, STEP)
    poses = []
    for time in times:
        pose, off = pose_at(max(time, 0.0)), rng.standard_normal(6)
        turn = pin.exp3(TURNED * off[3:]) @ pose.rotation
        poses.append(SE3(turn, pose.translation + NOISE * off[:3]))
    return times, poses


def accelerations(path: sm.paths.Path, t: Array) -> Array:
    """Return derivatives of the twist at times, by central differences, (K, 6)."""
    return (path.samples(t + H).twist - path.samples(t - H).twist) / (2.0 * H)


def two_chunks(begins: float | None = None) -> tuple[Chunk, Chunk, Blended]:
    rng = np.random.default_rng(1)
    first, second = (Chunk.of(*told(t, rng, at)) for t, at in ((0.5, None), (0.9, begins)))
    found = blend(first, second, 0.9, Approach())
    assert isinstance(found, Blended)
    return first, second, found


@pytest.mark.parametrize("begins", [None, 1.3])
def test_chunks_and_joins_are_paths(begins: float | None) -> None:
    first, second, found = two_chunks(begins)
    for path in (first, second, found):
        check_path(path)
        assert path.duration > 0.0


def test_a_chunk_goes_through_its_poses_and_rests_outside() -> None:
    times, poses = told(1.0, np.random.default_rng(0))
    chunk = Chunk.of(times, poses)
    for t, pose in zip(times, poses, strict=True):
        assert np.abs(chunk.pose(t).homogeneous - pose.homogeneous).max() <= 1e-12
    assert np.all(chunk.samples([0.0, chunk.duration]).twist == 0.0)
    assert chunk.until == times[-1]


def test_no_acceleration_jumps() -> None:
    """At the ends of a chunk, and where one is joined to another, now or later."""
    for begins in (None, 1.3):
        first, _, found = two_chunks(begins)
        ends = [first.begins, first.until]
        at = [found.at, found.at + found.window] if begins else [found.at + found.window]
        for path, times in ((first, ends), (found, at)):
            t = np.array(times)
            jumps = accelerations(path, t + BESIDE) - accelerations(path, t - BESIDE)
            assert np.abs(jumps).max() <= JUMP
    # The same chunk without the offset jumps.
    t = np.array([found.at])
    apart = accelerations(found.after, t + BESIDE) - accelerations(found.before, t - BESIDE)
    assert np.abs(apart).max() > 5.0 * JUMP


def test_the_old_one_holds_until_the_join_and_the_new_one_from_its_end() -> None:
    first, second, found = two_chunks(1.3)
    early, late = np.linspace(0.9, 1.3, 9), found.at + found.window + np.linspace(0.0, 0.5, 9)
    for t, path in ((early, first), (late, second)):
        assert np.abs(found.samples(t).translation - path.samples(t).translation).max() <= 1e-12
        assert np.abs(found.samples(t).rotation - path.samples(t).rotation).max() <= 1e-12
        assert np.abs(found.samples(t).twist - path.samples(t).twist).max() <= 1e-9
    # One that is told before that join takes the place of the one that waits.
    third = Chunk.of(*told(1.0, np.random.default_rng(5)))
    again = blend(found, third, 1.0, Approach())
    assert isinstance(again, Blended)
    assert again.before is None
    here = np.array([1.0])
    assert np.abs(again.samples(here).translation - first.samples(here).translation).max() <= 1e-12


def test_the_offset_fades_within_the_limits_of_the_approach() -> None:
    approach = Approach(speed=0.2, acceleration=1.0)
    rng = np.random.default_rng(3)
    first, second = Chunk.of(*told(0.5, rng)), Chunk.of(*told(0.9, rng))
    times, poses = told(0.9, rng)
    shift = np.array([0.05, 0.0, 0.0])
    moved = [SE3(pose.rotation, pose.translation + shift) for pose in poses]
    found = blend(first, Chunk.of(times, moved), 0.9, approach)
    t = np.linspace(found.at, found.at + found.window, 400)
    off = found.samples(t).twist - found.after.samples(t).twist
    assert np.linalg.norm(off[:, :3], axis=1).max() <= 0.2
    change = np.diff(off[:, :3], axis=0) / np.diff(t)[:, None]
    assert np.linalg.norm(change, axis=1).max() <= 1.05
    assert blend(first, second, 0.9, Approach()).window < found.window


# In the loop.


def loop(
    replanner: Replanner, seconds: float, until: float = np.inf, seed: int = 0
) -> tuple[list[Segment], Array, list[tuple[float, Array, sm.paths.Path]]]:
    """Return segments, all commands (K, 3, 7), and where the arm was along which path."""
    rng, t, q, qd, last = np.random.default_rng(seed), 0.0, PANDA_HOME, np.zeros(7), -np.inf
    segments, commands, places = [], [], []
    while t < seconds - 1e-9:
        given = {}
        if t - last >= EVERY and t < until:
            last, (times, poses) = t, told(t, rng)
            given = {"chunk": poses, "times": times}
        segment = replanner.step(t, q, qd, **given)
        segments.append(segment)
        t += replanner.period
        now = segment.index(t)
        commands.append(np.stack([segment.q, segment.qd, segment.qdd], axis=1)[:now])
        q, qd = segment.q[now], segment.qd[now]
        places.append((t, q, replanner._path.last.path))
    return segments, np.concatenate(commands), places


@pytest.mark.parametrize("seed", range(3))
def test_noisy_chunks_are_followed_within_all_limits(seed: int) -> None:
    panda = robot_named("panda")
    replanner = Replanner(panda)
    segments, commands, places = loop(replanner, 3.0, seed=seed)
    assert all(item.flag is Flag.PLANNED for item in segments)
    # Limits at 4 kHz: q̈ is linear between commands, so that its ends and the jerk are all.
    h = replanner.cycle
    q, qd, qdd = commands.transpose(1, 0, 2)
    times = h * np.arange(4)[:, None, None] / 4.0
    slope = np.diff(qdd, axis=0) / h
    rates = qd[:-1] + times * (qdd[:-1] + 0.5 * times * slope)
    at = q[:-1] + times * (qd[:-1] + times * (0.5 * qdd[:-1] + times / 6.0 * slope))
    assert np.abs(slope / panda.jerk_limit).max() <= 1.0 + ROUNDING
    assert np.abs(qdd / panda.acceleration_limit).max() <= 1.0
    assert np.abs(rates / panda.velocity_limit).max() <= 1.0
    assert np.all((at >= panda.lower) & (at <= panda.upper))
    # No jump: the samples are one motion.
    assert np.abs(np.diff(qd, axis=0) - 0.5 * h * (qdd[1:] + qdd[:-1])).max() <= ROUNDING
    # The tool is on the joined path all the time, once it has come to it.
    misses = [sm.Task.POSE.miss(path.pose(t), panda.pose(q)) for t, q, path in places if t > 1.0]
    assert np.max(misses) <= CAUGHT


def test_a_chunk_without_another_ends_at_rest_with_its_last_pose() -> None:
    replanner = Replanner(robot_named("panda"))
    segments, commands, _ = loop(replanner, 2.5, until=0.5)
    # Told at 0.3 s, with a pose until 0.3 - LATE + AHEAD.
    over = 0.3 - LATE + AHEAD
    flags = {k: item.flag for k, item in enumerate(segments)}
    for k, flag in flags.items():
        t = k * replanner.period
        if t < over - replanner.period:
            assert flag is Flag.PLANNED
        if t > over + replanner.period:
            assert flag is Flag.STOPPING
            assert "the last chunk ended" in segments[k].reasons[0]
    assert np.all(commands[-1, 1:] == 0.0)
    assert all(np.all(item.qd[-1] == 0.0) for item in segments)


def test_a_chunk_after_a_stop_is_followed_again() -> None:
    panda = robot_named("panda")
    replanner = Replanner(panda)
    loop(replanner, 2.5, until=0.5)
    t, q = 2.5, replanner._commands.segment(0, Flag.STOPPING, (), True, np.zeros(2), 0.0).q[0]
    for k in range(100):
        times, poses = 2.5 + np.array([0.0, 2.0]), [pose_at(1.2), pose_at(1.4)]
        given = {"chunk": poses, "times": times} if k == 0 else {}
        segment = replanner.step(t, q, np.zeros(7), **given)
        t += replanner.period
        q = segment.q[segment.index(t)]
        assert segment.flag is Flag.PLANNED
    assert max(sm.Task.POSE.miss(replanner._path.last.path.pose(t), panda.pose(q))) <= 1e-3


def test_a_chunk_joins_what_a_camera_saw(panda: sm.RobotModel) -> None:
    replanner = Replanner(panda)
    target, twist = panda.pose(PANDA_HOME), np.array([0.0, 0.05, 0.0, 0.0, 0.0, 0.1])
    segment = replanner.step(0.0, PANDA_HOME, np.zeros(7), target=target, twist=twist, seen=-0.02)
    q, qd = segment.q[10], segment.qd[10]
    seen = MovingPose(target, twist, -0.02)
    times = np.array([0.5, 1.0, 1.5])
    segment = replanner.step(0.01, q, qd, chunk=[pose_at(t) for t in times], times=times)
    assert segment.flag is Flag.PLANNED
    held = replanner._path.last.path
    assert np.abs(held.samples([0.3]).twist - seen.samples([0.3]).twist).max() <= 1e-12


BAD = {
    "times[2] = 0.1 s does not come after times[1] = 0.2 s": ([0.0, 0.2, 0.1], 3),
    "3 finite numbers, one for each pose": ([0.0, 0.1], 3),
    "chunk: times": ([0.0, np.nan, 0.2], 3),
    "has 1 poses, expected two or more": ([0.0], 1),
}


@pytest.mark.parametrize("words", BAD)
def test_bad_chunks_are_named_and_the_last_one_holds(panda: sm.RobotModel, words: str) -> None:
    times, count = BAD[words]
    poses = [pose_at(0.1 * k) for k in range(count)]
    with pytest.raises(sm.errors.PathError) as caught:
        Chunk.of(times, poses)
    assert words in str(caught.value)
    replanner = Replanner(panda)
    good = {"chunk": [pose_at(0.0), pose_at(1.0)], "times": [0.0, 1.0]}
    first = replanner.step(0.0, PANDA_HOME, np.zeros(7), **good)
    then = replanner.step(0.01, first.q[10], first.qd[10], chunk=poses, times=times)
    assert then.flag is Flag.PLANNED
    assert words in then.reasons[0]


def test_a_pose_that_is_none_is_named() -> None:
    poses = np.stack([pose_at(t).homogeneous for t in (0.0, 0.1, 0.2)])
    Chunk.of([0.0, 0.1, 0.2], poses)
    poses[1, 0, 0] = np.nan
    with pytest.raises(sm.errors.PathError, match=r"poses\[1\]"):
        Chunk.of([0.0, 0.1, 0.2], poses)
    with pytest.raises(sm.errors.PathError, match="expected a list of poses"):
        Chunk.of([0.0, 0.1], "poses")


def test_one_thing_is_asked_for_at_a_step(panda: sm.RobotModel) -> None:
    poses, times = [pose_at(0.0), pose_at(1.0)], [0.0, 1.0]
    first = 0.0, PANDA_HOME, np.zeros(7)
    for given, words in (
        ({"chunk": poses}, "times is missing"),
        ({"times": times}, "chunk is missing"),
        ({"chunk": poses, "times": times, "target": pose_at(0.0)}, "a path or a target, too"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=words):
            Replanner(panda).step(*first, **given)
    late = Replanner(panda).step(5.0, *first[1:], chunk=poses, times=times)
    assert "it ended 4 s ago" in late.reasons[0]
    assert late.flag is Flag.STOPPING


def test_a_chunk_is_not_joined_to_what_nobody_follows(panda: sm.RobotModel) -> None:
    """Told to stay where it rests, long after a target was lost, the tool stays."""
    replanner, pose = Replanner(panda, "pose"), panda.pose(PANDA_HOME)
    t, q, qd = 0.0, PANDA_HOME, np.zeros(7)

    def go(**given: Any) -> None:
        nonlocal t, q, qd
        segment = replanner.step(t, q, qd, **given)
        t += replanner.period
        n = segment.index(t)
        q, qd = segment.q[n], segment.qd[n]

    for _ in range(10):
        go(target=pose, twist=[0.0, 0.2, 0.0, 0.0, 0.0, 0.0], seen=t)
    for _ in range(150):
        go()
    here = panda.pose(q)
    go(chunk=[here] * 5, times=t + 0.1 * np.arange(5))
    for _ in range(30):
        go()
        assert np.linalg.norm(panda.pose(q).translation - here.translation) < 1e-9


def test_what_fails_leaves_no_arm_without_a_segment(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)

    class Live(sm.paths.Dwell):
        lost = False

        def evaluate(self, t: np.ndarray) -> sm.paths.PathSamples:
            if self.lost:
                raise RuntimeError("camera")
            return super().evaluate(t)

    far = pose.copy()
    far.translation = np.array([1e308, 0.0, 0.0])
    for given in (
        {},
        {"chunk": [pose] * 2, "times": [0.0, 1.0]},
        {"chunk": [pose, far, pose], "times": [0.0, 0.1, 0.2]},
    ):
        live, replanner = Live(pose, 9.0), Replanner(panda, "pose")
        replanner.step(0.0, PANDA_HOME, np.zeros(7), live)
        live.lost = True
        with np.errstate(all="ignore"):
            asked = given or {"path": live}
            segment = replanner.step(0.01, PANDA_HOME, np.zeros(7), **asked)
        assert segment.reasons
        assert np.isfinite(segment.q).all()
