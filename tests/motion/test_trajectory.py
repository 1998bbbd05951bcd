"""Hermite splines: exact at the samples, with exact extremes, ways and jumps."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

import selfmotion as sm


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [0.0, 0.0]}, "does not come after"),
        ({"q": [[0.0], [np.nan]]}, "not finite"),
        ({"q": [[0.0, 1.0]]}, "expected"),
    ],
)
def test_malformed_trajectories_are_refused(change: dict[str, object], message: str) -> None:
    sound = {"t": [0.0, 1.0], "q": [[0.0], [1.0]], "qd": [[0.0], [0.0]], "joint_names": ("a",)}
    assert sm.Trajectory(**sound).duration == 1.0
    with pytest.raises(sm.errors.FileFormatError, match=message):
        sm.Trajectory(**(sound | {k: np.array(v) for k, v in change.items()}))


def test_trajectory_interpolates_cubics_exactly() -> None:
    t = np.array([0.0, 0.4, 1.0])
    motion = sm.Trajectory(t, (t**3)[:, None], (3 * t**2)[:, None], ("a",))
    s = np.linspace(0, 1, 11)
    np.testing.assert_allclose(motion(s)[:, 0], s**3, atol=1e-15)
    np.testing.assert_allclose(motion(s, 1)[:, 0], 3 * s**2, atol=1e-14)
    np.testing.assert_allclose(motion(s, 2)[:, 0], 6 * s, atol=1e-13)
    assert motion(0.5).shape == (1,)
    assert motion(np.zeros(0)).shape == (0, 1)
    assert motion(np.zeros((2, 0)), 1).shape == (2, 0, 1)
    for time in (1.1, np.nan):
        with pytest.raises(ValueError, match="outside the motion"):
            motion(time)
    with pytest.raises(ValueError, match="order is 7"):
        motion(0.5, order=7)


NAMES = ("a", "b", "c")


def random_motion(quintic: bool, seed: int = 0, count: int = 9) -> sm.Trajectory:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 0.9, count))
    q, qd, qdd = (rng.normal(size=(count, 3)) for _ in range(3))
    return sm.Trajectory(t, q, qd, NAMES, qdd if quintic else None)


def by_scipy(motion: sm.Trajectory) -> BPoly:
    """Return the same spline by another library."""
    given = [motion.q, motion.qd] if motion.qdd is None else [motion.q, motion.qd, motion.qdd]
    return BPoly.from_derivatives(motion.t, np.stack(given, axis=1))


@pytest.mark.parametrize("quintic", [False, True])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_motions_equal_those_of_scipy(quintic: bool, order: int) -> None:
    motion = random_motion(quintic)
    t = np.random.default_rng(1).uniform(motion.t[0], motion.t[-1], 500)
    expected = by_scipy(motion).derivative(order)(t) if order else by_scipy(motion)(t)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(motion(t, order), expected, rtol=0, atol=1e-11 * scale)


@pytest.mark.parametrize("quintic", [False, True])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_no_point_is_beyond_the_extremes_and_some_point_is_near(
    quintic: bool, order: int, seed: int
) -> None:
    motion = random_motion(quintic, seed)
    fine = np.linspace(0.0, 1.0, 4001)
    # Inside the pieces: at the samples the highest derivatives jump.
    inside = (
        motion.t[:-1, None] + np.diff(motion.t)[:, None] * np.clip(fine, 1e-9, 1 - 1e-9)
    ).ravel()
    values = motion(inside, order)
    times, (least, largest) = motion.extremes(order)
    # A step beside an extreme of curvature c is c h² / 2 below it.
    near = 1e-5 * np.ptp(values, axis=0)
    assert np.all(values.min(axis=0) - least <= near)
    assert np.all(values.min(axis=0) - least >= -1e-9 * near)
    assert np.all(largest - values.max(axis=0) <= near)
    assert np.all(largest - values.max(axis=0) >= -1e-9 * near)
    assert np.all((times >= motion.t[0]) & (times <= motion.t[-1]))


@pytest.mark.parametrize("quintic", [False, True])
def test_the_way_is_the_integral_of_the_speed(quintic: bool) -> None:
    motion = random_motion(quintic, 3)
    t = np.linspace(motion.t[0], motion.t[-1], 400_001)
    speed = np.abs(motion(t, 1))
    way = np.cumsum(0.5 * (speed[1:] + speed[:-1]) * (t[1] - t[0]), axis=0)
    some = np.arange(1000, 400_000, 7001)
    np.testing.assert_allclose(motion.travelled(t[some + 1]), way[some], rtol=0, atol=1e-8)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_in_lots_a_motion_is_what_it_is_at_once(
    order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def looked_at() -> tuple[np.ndarray, np.ndarray]:
        motion = random_motion(True, 4, 20)
        times = np.linspace(motion.t[0], motion.t[-1], 101)
        return motion(times, order), motion.travelled(times)

    at_once = looked_at()
    monkeypatch.setattr("selfmotion.model.motion.spline._CHUNK", 7)
    for found, expected in zip(looked_at(), at_once, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_accelerations_are_continuous_where_they_are_given() -> None:
    motion, h = random_motion(quintic=True), 1e-12
    inner = motion.t[1:-1]
    np.testing.assert_allclose(motion(inner - h, 2), motion(inner, 2), atol=1e-7)
    np.testing.assert_allclose(motion(inner, 2), motion.qdd[1:-1], atol=1e-10)


def test_jumps_of_acceleration_are_known() -> None:
    motion, h = random_motion(quintic=False), 1e-9
    inner = motion.t[1:-1]
    expected = np.abs(motion(inner, 2) - motion(inner - h, 2))
    times, jumps = motion.acceleration_jumps()
    np.testing.assert_allclose(jumps, expected.max(axis=0), rtol=1e-6)
    np.testing.assert_array_equal(times, inner[np.argmax(expected, axis=0)])
    assert not random_motion(quintic=True).acceleration_jumps()[1].any()
    single = random_motion(quintic=False, count=2)
    assert not single.acceleration_jumps()[1].any()


def test_a_motion_at_a_rate() -> None:
    motion = random_motion(quintic=True)
    dense = motion.sample(1000.0)
    assert dense.t[0] == motion.t[0]
    assert dense.t[-1] == motion.t[-1]
    assert np.diff(dense.t).max() <= 1e-3 + 1e-12
    t = np.random.default_rng(2).uniform(motion.t[0], motion.t[-1], 300)
    for order, close in ((0, 1e-9), (1, 1e-7), (2, 1e-3)):
        np.testing.assert_allclose(dense(t, order), motion(t, order), atol=close)
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="rate is"):
            motion.sample(bad)


def test_accelerations_of_another_shape_are_refused() -> None:
    with pytest.raises(sm.errors.FileFormatError, match=r"qdd \(2, 2\), expected \(2, 1\)"):
        sm.Trajectory([0.0, 1.0], [[0.0], [1.0]], [[0.0], [0.0]], ("a",), np.zeros((2, 2)))
    with pytest.raises(sm.errors.FileFormatError, match="not finite"):
        sm.Trajectory([0.0, 1.0], [[0.0], [1.0]], [[0.0], [0.0]], ("a",), [[np.nan], [0.0]])


@pytest.mark.parametrize("task", ["pose", "position"])
def test_accelerations_of_a_plan_are_those_of_its_velocities(panda, task: str) -> None:
    """Exactly: what is optimised is what is judged."""
    start = panda.dexterous_configuration(task)
    path = sm.paths.Circle.around(panda.pose(start), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    motion = sm.plan(sm.Problem(panda, path, task, start)).trajectory
    t, h = np.linspace(0.1, 3.9, 77), 1e-6
    difference = (motion(t + h, 1) - motion(t - h, 1)) / (2 * h)
    np.testing.assert_allclose(motion(t, 2), difference, atol=1e-5)
