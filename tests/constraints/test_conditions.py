"""What is kept of constraints, in words and as one number; what binds; rows on demand."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, ProblemError
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid
from selfmotion.model.task import Task
from selfmotion.planning.rollout import Rollout
from selfmotion.problem.constraints import (
    BoundConstraint,
    BoundLimits,
    BoundQuantity,
    Conditions,
    Linear,
    Multipliers,
    NodeTangents,
    active_of,
    linearised,
    penalised,
    penalty,
    violated,
    worst_time,
)
from selfmotion.problem.costs import Samples
from selfmotion.shell.testing import check_constraint
from support.arms import robot_named, short_line, start_of

DURATION = 1.5


@dataclass(frozen=True, eq=False)
class Given(BoundConstraint):
    """A bound constraint of given numbers."""

    name: str
    h: Array
    equality: bool = False
    tolerance: float = 1e-3

    def residual(self, samples: Samples) -> Array:
        return self.h

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        return self.h[:, :, None] * np.arange(1.0, 1.0 + motion.q.shape[2])

    def describe(self, samples: Samples, row: int, column: int) -> str:
        return f"row {row}, column {column}"

    def easing(self, column: int) -> tuple[float, str]:
        return 0.5, f"column {column % 2}"


@pytest.fixture(scope="module")
def grid() -> Grid:
    robot = robot_named("panda")
    return Grid.aligned(short_line(robot, start_of(robot, "pose")).knots, 12)


@pytest.fixture(scope="module")
def samples(grid: Grid) -> Samples:
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    rollout = Rollout(Follows.of(robot, short_line(robot, start), Task.POSE), grid)
    assert rollout.run(start, np.zeros((len(grid.stage_times), 7))) is None
    return rollout.samples()


def table(grid: Grid, columns: int = 2) -> Array:
    return np.zeros((len(grid.nodes), columns))


@pytest.mark.parametrize("equality", [False, True])
@pytest.mark.parametrize("size", [0.01, 0.02, -0.01, 1.0])
def test_the_penalty_is_the_square_over_the_motion(
    grid: Grid, samples: Samples, size: float, equality: bool
) -> None:
    """10 ∫ Σ h² dt / 2e-3, but at most 10 for each constraint, whatever their number."""
    beyond = abs(size) if equality else max(size, 0.0)
    h = table(grid)
    h[:, 1] = size
    # Nodes need not be evenly apart.
    uneven = np.array([0.0, 0.3, 0.4, DURATION])
    for nodes in (grid, Grid.aligned(uneven, 4)):
        looked = SimpleNamespace(sampling=nodes.sampling)
        item = Given("it", np.resize(h, (len(nodes.nodes), 2)), equality)
        expected = 10.0 * min(1.0, DURATION * beyond**2 / 2e-3)
        assert penalty([(item, looked)]) == pytest.approx(expected)
        assert penalty([(item, looked), (item, looked)]) == pytest.approx(2.0 * expected)
    end = Given("end", np.array([[size]]), equality)
    expected = 10.0 * min(1.0, beyond**2 / 2e-3)
    assert penalty([]) == 0.0
    assert penalty([(end, samples)]) == pytest.approx(expected)


def test_what_binds_is_priced_where_it_binds(grid: Grid) -> None:
    """Columns with the same words together, the most expensive first; one free node is no gap."""
    count, times = len(grid.nodes), grid.nodes
    multipliers = np.zeros((count, 4))
    multipliers[2:4, 0], multipliers[5, 2], multipliers[8:10, 2] = 1.0, 3.0, 1.0
    multipliers[1, 1] = 0.5
    limits, end = Given("limits", table(grid, 4)), Given("end", np.zeros((1, 2)), True)
    used = np.ones(multipliers.shape, dtype=np.bool_)
    at_end = np.array([[-20.0, 0.0]])
    both = [
        Multipliers(limits, multipliers, times, used),
        Multipliers(end, at_end, times[:1], np.ones((1, 2), dtype=np.bool_)),
    ]
    span = times[[0, -1]]
    found = active_of(both, span, 0.25)
    assert [(item.constraint, item.easing) for item in found] == [
        ("end", "column 0"),
        ("limits", "column 0"),
        ("limits", "column 1"),
    ]
    np.testing.assert_allclose([item.saving for item in found], [10.0, 0.5 * 7.0, 0.25])
    assert found[0].spans == ((times[0], times[-1]),)
    assert found[1].spans == ((times[2], times[5]), (times[8], times[9]))
    assert found[2].spans == ((times[1], times[1]),)
    assert len(active_of(both, span, 0.26)) == 2
    free = [Multipliers(limits, 0.0 * multipliers, times, used)]
    assert active_of(free, span, 1e-9) == ()


@dataclass(frozen=True, eq=False)
class Sized(Given):
    """One that says how much an easing is."""

    def easing(self, column: int) -> tuple[float, str]:
        return 0.02, f"2 % more of {column}"


def test_what_would_save_much_is_eased_by_less(grid: Grid) -> None:
    """A multiplier is a slope: words and saving shrink alike, the order is that of the slopes."""
    multipliers = np.zeros((len(grid.nodes), 3))
    multipliers[2] = 50.0, 250.0, 5.0
    item = Sized("limits", table(grid, 3))
    each = [Multipliers(item, multipliers, grid.nodes, multipliers > 0.0)]
    found = active_of(each, grid.nodes[[0, -1]], 1e-9, 0.5)
    told = [(item.easing, round(item.saving, 12)) for item in found]
    assert told == [("0.2 % more of 1", 0.5), ("1 % more of 0", 0.5), ("2 % more of 2", 0.1)]
    whole = active_of(each, grid.nodes[[0, -1]], 1e-9)
    assert [item.saving for item in whole] == [5.0, 1.0, 0.1]


@pytest.mark.parametrize("equality", [False, True])
def test_the_worst_place_is_told_of_what_is_not_kept(
    grid: Grid, samples: Samples, equality: bool
) -> None:
    h = table(grid)
    h[3, 1], h[5, 0] = 2.0, -3.0
    item = Given("it", h, equality)
    place = "row 5, column 0" if equality else "row 3, column 1"
    assert violated([(item, samples)]) == (f"it: {place}",)
    kept = Given("kept", np.full((2, 2), 1e-3), equality)
    assert violated([(kept, samples)]) == ()
    beyond = Given("beyond", np.full((2, 2), 1.001e-3), equality)
    broken = Given("broken", np.array([[0.0, np.nan]]), equality)
    told = violated((item, samples) for item in (kept, beyond, broken))
    assert told == ("beyond: row 0, column 0", "broken: row 0, column 1")


@pytest.mark.parametrize(
    ("tangents", "message"),
    [
        (lambda h, d: np.zeros((*h.shape, d - 1)), r"tangents\(\) has shape .* \(4,\) appended"),
        (lambda h, d: np.zeros(h.shape), r"tangents\(\) has shape \(13, 2\)"),
    ],
)
def test_derivatives_of_another_shape_are_refused_by_name(
    tangents, message: str, grid: Grid, samples: Samples
) -> None:
    class Misshapen(Given):
        def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
            return tangents(self.h, motion.size)

    motion = NodeTangents(np.zeros((13, 7, 4)), np.zeros((13, 7, 4)), grid.sampling)
    with pytest.raises(ProblemError, match=f"constraint 'mine': .*{message}"):
        linearised(Misshapen("mine", table(grid)), samples, motion)


def test_a_constraint_that_is_wrong_on_demand_does_not_pass() -> None:
    """Its tangents are right, but not what programmes are solved with."""

    class Turned:
        def __init__(self, own: Linear) -> None:
            self.own = own

        def picked(self, motion: NodeTangents, rows: Array, columns: Array) -> Array:
            return -self.own.picked(motion, rows, columns)

    class Bound(BoundLimits):
        def linearised_at(self, samples: Samples):
            shape, known = super().linearised_at(samples)
            return shape, Turned(known)

    class Mine(sm.constraints.JointVelocityLimits):
        def conditions(self, robot: sm.RobotModel) -> Conditions:
            return Conditions(points=(Bound.of(robot, self.requirement(robot), self.margin),))

    robot = robot_named("panda")
    start = start_of(robot, "pose")
    problem = sm.Problem(robot, short_line(robot, start), Task.POSE, start, rest=False)
    with pytest.raises(AssertionError, match=r"linearised_at\(\) is .* off what tangents\(\) says"):
        check_constraint(Mine(0.02), problem)


def quantity_of(limit: float, components: int) -> sm.certificate.Quantity:
    """Return joint 1 with a limit, or the first joints as a vector."""
    vector = components > 1

    def values(q: Array, qd: Array, qdd: Array) -> Array:
        return q[:, None, :components] if vector else q[:, :1]

    def derivatives(q: Array, qd: Array, qdd: Array) -> tuple[Array]:
        one = np.eye(q.shape[1])[:components]
        return (np.tile(one[None] if vector else one, (len(q), *(1,) * (1 + vector))),)

    columns = [sm.certificate.Column("it", "the place of it", "rad")]
    return sm.certificate.Quantity(
        "place", columns, values, derivatives, limit, components=components
    )


@pytest.mark.parametrize("components", [1, 3])
def test_half_the_margin_of_a_quantity_is_left_at_its_tolerance(
    samples: Samples, components: int
) -> None:
    margin = 0.2
    q = samples.q[samples.nodes]
    size = np.abs(q[:, 0]) if components == 1 else np.linalg.norm(q[:, :components], axis=1)
    row = int(np.argmax(size))
    # Its largest value uses all but half of the margin.
    limit = float(size[row]) / (1.0 - 0.5 * margin)
    bound = BoundQuantity(quantity_of(limit, components), margin)
    assert bound.residual(samples).max() == pytest.approx(bound.tolerance)
    # The words are of the value itself: a number with its sign, of a vector the length.
    value = float(q[row, 0]) if components == 1 else float(size[row])
    time = float(samples.sampling.node_times[row])
    assert bound.describe(samples, row, 0) == bound.quantity.said(0, value, time)


@pytest.mark.parametrize("components", [1, 3])
def test_more_room_of_a_quantity_eases_its_rows_by_as_much_as_is_said(
    samples: Samples, components: int
) -> None:
    """Rows of vectors are squares: two percent more of the limit are four of these."""
    q = samples.q[samples.nodes]
    size = np.abs(q[:, 0]) if components == 1 else np.linalg.norm(q[:, :components], axis=1)
    limit = float(size.max())
    tight, eased = (
        BoundQuantity(quantity_of(share * limit, components), 0.0).residual(samples).max()
        for share in (1.0, 1.02)
    )
    share, words = BoundQuantity(quantity_of(limit, components), 0.0).easing(0)
    assert share == pytest.approx(tight - eased, rel=0.05)
    assert "2 % more" in words


@pytest.mark.parametrize("cost", [-3.0, 0.0, 5.0])
def test_what_violates_something_costs_more_in_rankings(
    grid: Grid, samples: Samples, cost: float
) -> None:
    """By its own size, or by a thousandth; also where the cost is negative."""
    beyond = table(grid)
    beyond[2, 0] = 0.3
    broken = [(Given("one", beyond), samples)]
    assert penalised(cost, []) == cost
    added = penalised(cost, broken) - cost
    assert added == pytest.approx(max(abs(cost), 1e-3) * penalty(broken))
    assert added > 0.0


def test_the_worst_time_is_that_of_the_largest_violation(grid: Grid, samples: Samples) -> None:
    less, more = table(grid), table(grid)
    less[2, 0], more[7, 1] = 0.3, 0.4
    several = [(Given("one", less), samples), (Given("two", more), samples)]
    assert worst_time(several) == worst_time(several[::-1]) == grid.nodes[7]
    assert worst_time(several[:1]) == grid.nodes[2]
    # Not of equalities, nor of what is within its tolerance.
    assert worst_time([(Given("end", more, equality=True), samples)]) is None
    assert worst_time([(Given("kept", 1e-3 * less), samples)]) is None


def test_tangents_of_some_rows_are_those_of_all(grid: Grid) -> None:
    count = len(grid.nodes)
    rng = np.random.default_rng(1)
    motion = NodeTangents(*rng.normal(size=(2, count, 7, 3)), grid.sampling)
    nodes, joints = np.array([0, 3, count - 1, 3]), np.array([6, 0, 2, 5])
    for order in range(4):
        every = motion.of_order(order)
        assert every.shape == motion.q.shape
        found = motion.picked(order, nodes, joints)
        np.testing.assert_allclose(found, every[nodes, joints], atol=1e-9 * np.abs(every).max())
