"""No function passes its bound between the points that it is looked at, and none is far below."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, series
from selfmotion.certificate import BoundedFunction, MotionSegments, bounding
from selfmotion.certificate.bounding import bounded
from support.arms import robot_named
from support.motions import motion_of

ROUNDING = 1e-12


class Wave(BoundedFunction):
    """most · cos(10 (q2 - top)) e^(-(q2 - top)²) and its half, with a majorant or without."""

    def __init__(self, most: float, top: float = 2.345, *, known: bool = True) -> None:
        self.most, self.top, self.known = most, top, known
        self.blocks, self.of = np.arange(2), np.arange(2)
        self.allowed, self.wanted = np.ones(2), np.full(2, 1e-6)

    def series(self, segments: MotionSegments) -> Array | None:
        """The product of cos x and e^(-y) for 10 q and q²; |e^(-y)| ≤ 1 for y ≥ 0."""
        if not self.known:
            return None
        joint = segments.chain().joints[1]
        away = joint.copy()
        away[0] = np.abs(segments.motion(np.zeros(1))[:, 1] - self.top) + series.after_first(joint)
        bell = series.exponential(series.product(away, away))
        swing = abs(self.most) * series.product(series.exponential(10.0 * joint), bell)
        return np.stack([swing, 0.5 * swing])

    def values(self, segments: MotionSegments, u: Array) -> Array:
        away = segments.motion(u)[:, 1] - self.top
        swing = self.most * np.cos(10.0 * away) * np.exp(-(away**2))
        return np.stack([swing, 0.5 * swing], axis=1).reshape(-1, len(u), 2)

    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        return np.abs(values)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("most", [-3.0, 0.5, -0.99, 0.9999, 1.0001, -1.01, 3.0])
def test_the_largest_size_is_bounded_and_hardly_more(most: float, known: bool) -> None:
    motion = motion_of([[0.0] * 3, [0.0, 6.2, 0.0]], [[0.0, 6.2, 0.0]] * 2)
    found = bounded(Wave(most, known=known), motion.robot, motion.trajectory, motion.trajectory.t)
    size = abs(most)
    assert bool(found.values[0] <= 1.0) is (size <= 1.0)
    assert (found.proved, found.undecided) == (known, ())
    if size <= 1.0:
        # Once it decides, an interval is not cut for the sake of a better number.
        assert size - ROUNDING <= found.values[0] <= min(1.0, 1.1 * size)
        assert 0.5 * size - ROUNDING <= found.values[1] <= 0.55 * size
        assert motion.trajectory(found.times[:1])[0, 1] == pytest.approx(2.345, abs=0.2)


def test_a_touched_limit_is_undecided_and_its_interval_named() -> None:
    """A majorant that is true but useless: the place is halved to the end, and told."""
    motion = motion_of([[0.0] * 3, [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0]] * 2)

    class Rough(Wave):
        def series(self, segments: MotionSegments) -> Array:
            near = np.abs(segments.middle - 1.0 / 3.0) <= segments.half
            known = super().series(segments)
            assert known is not None
            return np.where(near, np.inf, known)

    found = bounded(Rough(0.5), motion.robot, motion.trajectory, motion.trajectory.t)
    ((first, last),) = found.undecided
    assert first <= 1.0 / 3.0 <= last
    assert last - first == pytest.approx(2.0**-16)


def test_what_is_not_a_number_is_not_kept() -> None:
    motion = motion_of([[0.0] * 3, [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0]] * 2)

    class Gone(Wave):
        def values(self, segments: MotionSegments, u: Array) -> Array:
            found = super().values(segments, u)
            return np.where(segments.times(u)[:, :, None] > 0.99, np.nan, found)

    found = bounded(Gone(0.5), motion.robot, motion.trajectory, motion.trajectory.t)
    assert not np.all(found.values <= 1.0)


def test_a_motion_too_wild_to_be_looked_at_ends_undecided() -> None:
    motion = motion_of([[0.0] * 3, [0.0, 1e7, 0.0]], np.zeros((2, 3)))
    found = bounded(Wave(0.5), motion.robot, motion.trajectory, motion.trajectory.t)
    assert found.undecided


@pytest.mark.parametrize("degree", [3, 5])
def test_a_stretch_is_the_trajectory(degree: int) -> None:
    """Its polynomials are those of the motion, of all orders, wherever the interval lies."""
    robot, rng = robot_named("panda"), np.random.default_rng(degree)
    t = np.cumsum(rng.uniform(0.1, 1.0, 6))
    tables = [rng.normal(size=(6, 7)) for _ in range(3)]
    motion = sm.Trajectory(t, *tables[:2], robot.joint_names, tables[2] if degree == 5 else None)
    edges = np.sort(np.concatenate([t, rng.uniform(t[0], t[-1], 9)]))
    segments = MotionSegments(robot, motion, np.stack([edges[:-1], edges[1:]], axis=1))
    u = np.linspace(-0.999, 0.999, 7)
    for order in range(4):
        expected = motion(segments.times(u).ravel(), order)
        found = segments.motion(u, order)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())
    # No derivative passes the joints' majorants.
    for joint, known in enumerate(segments.chain().joints):
        for order in range(4):
            most = known[order] * [1.0, 1.0, 2.0, 6.0][order] / segments.half**order
            largest = np.abs(segments.motion(u, order)[:, joint]).reshape(-1, len(u)).max(axis=1)
            assert np.all(largest <= most * (1.0 + ROUNDING) + ROUNDING)


def test_few_intervals_take_the_nodes_of_others() -> None:
    """The next larger number that some take; those of no bound, and the largest, stay."""
    few, many = 3, bounding._FEW
    which = np.repeat([0, 1, 3, 4], [few, many, few, few])
    enough = np.ones(len(which), dtype=bool)
    expected = np.repeat([1, 1, 4, 4], [few, many, few, few])
    np.testing.assert_array_equal(bounding._with_others(which, enough), expected)
    enough[:few] = False
    expected[:few] = 0
    np.testing.assert_array_equal(bounding._with_others(which, enough), expected)
    # Each joins the next one, which is then larger.
    chained = np.repeat([0, 1, 2], [few, few, many])
    found = bounding._with_others(chained, np.ones(len(chained), dtype=bool))
    np.testing.assert_array_equal(found, 2)
    joined = np.repeat([0, 1, 2], [few, many - few, many])
    found = bounding._with_others(joined, np.ones(len(joined), dtype=bool))
    np.testing.assert_array_equal(found, np.repeat([1, 2], many))
