"""Tolerances as virtual joints: where they put the tool is what the relaxations say, no more."""

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.certificate import deviation_from
from selfmotion.model.follow import (
    Follows,
    band_limits,
    completed,
    deviation_of,
    has_windows,
    window_edges,
    windows_shut,
    with_tolerances,
)
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import (
    BoundConditions,
    CurveSamples,
    Formulation,
    on_path,
    sampled,
    sampled_along,
    with_springs,
)
from selfmotion.planning.formulation.tolerances import RowWithinBand, WithinBand
from selfmotion.planning.nodes import NodeGrid
from selfmotion.planning.nodes.motion import slopes_of
from selfmotion.planning.nodes.node_matrix import NodeMatrix
from selfmotion.planning.nodes.spline import AT_GAUSS
from selfmotion.problem.constraints import DependsOn, NodeTangents
from selfmotion.problem.costs import Partials, Samples
from support.arms import PANDA_HOME, robot_named
from support.nodes import around_of, centred, moved, nodes_of, random_step

# Rounding of poses that are composed twice.
ROUNDING = 1e-12
# Central differences over 1e-6: their truncation, and rounding over the step.
GRADIENT = 1e-7
# Of turns, coordinates shorten a deviation by their own share only to first order.
BENT = 0.1
# Central differences of a whole motion's cost, relative to the largest entry.
COST = 1e-7

R = sm.Relaxation
TOLERANCES = [
    ("panda", "pose", [R("rz", 0.5)]),
    ("panda", "pose", [R(("rx", "ry"), 0.4), R("x", 0.01, axes="tool")]),
    ("tiago", "pose", [R(("ry", "rz"), 0.4), R(("x", "y"), 0.01), R("z", 0.05)]),
    ("panda", "pose", [R("rx", 0.3), R("ry", 0.2)]),
    ("xarm7", "pose", [R(("rx", "ry", "rz"), 0.8), R("z")]),
    ("ur5", "pose", [R("rz"), R(("rx", "ry"), 0.3)]),
    ("ur5", "pointing", [R(("rx", "ry"), 0.3), R("z", 0.01, axes="tool")]),
    ("ur5", "pointing", [R("rx", 0.3)]),
    ("panda", "pointing", [R("rx", 0.3), R("ry", 0.1), R("x", 0.02, axes="tool")]),
    ("panda", "position", [R("z", 0.02, axes="tool")]),
    ("planar_3r", "planar_pose", [R("rz", 0.3), R(("x", "y"), 0.05)]),
]


def differences(function, x: Array, step: float = 1e-6) -> Array:
    """Return the derivatives of what is (K, …) at x (K, n), (K, …, n)."""
    sides = [(function(x + step * axis), function(x - step * axis)) for axis in np.eye(x.shape[1])]
    return np.stack([(above - below) / (2.0 * step) for above, below in sides], axis=-1)


@pytest.mark.parametrize(("name", "task", "relaxations"), TOLERANCES)
def test_the_tool_deviates_in_what_is_relaxed_and_by_what_the_joints_say(
    name: str, task: str, relaxations: list[sm.Relaxation]
) -> None:
    robot, rng = robot_named(name), np.random.default_rng(1)
    real = Follows.of(robot, sm.paths.Dwell(pin.SE3.Identity(), 1.0), task)
    follows = with_tolerances(real, relaxations)
    virtual, n = follows.virtual, robot.dof
    lower, upper = robot.finite_limits()
    for _ in range(3):
        s = rng.uniform(-0.6, 0.6, (1, len(virtual.each)))
        q = np.hstack([rng.uniform(lower, upper)[None], s])
        # Where all is followed is where the joints put it; what deviates is the arm's own tool.
        pose, tool = follows.items[0].chain.place(q[0]), robot.pose(q[0, :n])
        there = Follows.of(robot, sm.paths.Dwell(pose, 1.0), task).items[0]
        in_tool = any(item.in_tool_axes for item in relaxations)
        away = deviation_from(there, np.zeros(1), q[:, :n], in_tool)
        rest = away.copy()
        for item in relaxations:
            rest[:, item.indices] = 0.0
            rows, by = virtual.rows_of(item, s)
            sizes = [np.linalg.norm(x) for x in (rows, away[:, item.indices])]
            assert abs(sizes[0] - sizes[1]) < ROUNDING
            exact = differences(lambda x, item=item: virtual.rows_of(item, x)[0], s)
            np.testing.assert_allclose(by, exact, atol=GRADIENT)
        assert np.abs(rest).max() < ROUNDING
        poses = [(x.rotation[None], x.translation[None]) for x in (tool, pose)]
        np.testing.assert_allclose(virtual.coordinates(*poses), s, atol=1e-9)
        # The last joint's Jacobian is that of its chain, with the arm's own in front.
        jacobian = follows.items[0].chain.at(q[0])[0]
        chain = follows.items[0].chain
        places = differences(lambda x, chain=chain: chain.place(x[0]).translation[None], q)
        np.testing.assert_allclose(jacobian[:3], places[0], atol=GRADIENT)


def test_joints_stand_still_outside_of_windows() -> None:
    robot = robot_named("panda")
    path = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0)
    windows = [R("x", 0.1, during=(0.0, 2.0)), R(("rx", "ry"), 0.2, during=(1.0, 4.0)), R("z", 0.1)]
    follows = with_tolerances(Follows.of(robot, path, "pose"), windows)
    names = follows.coordinates.names[7:]
    held = follows.held(np.array([0.0, 1.0, 1.5, 2.0, 4.0]))[:, 7:]
    told = [{name for name, still in zip(names, row, strict=True) if still} for row in held]
    tilt = {"tilt rx", "tilt ry"}
    assert told == [tilt, tilt, set(), {"relaxed x"}, {"relaxed x"}]
    assert has_windows(follows)
    assert window_edges(follows) == (1.0, 2.0)


def test_integrated_motions_hold_what_any_window_shuts_and_no_more() -> None:
    robot = robot_named("panda")
    path = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0)
    relaxations = [R("x", 0.1, during=(1.0, 4.0)), R("y", 0.1, during=(0.0, 3.0)), R("z", 0.1)]
    follows = with_tolerances(Follows.of(robot, path, "pose"), relaxations)
    assert follows.virtual.windowed.tolist() == [True, True, False]
    shut = windows_shut(follows)
    at_home = shut.items[0].chain.kinematics()
    at_home.refresh(np.append(PANDA_HOME, np.zeros(3)))
    np.testing.assert_array_equal(at_home.jacobian[:3, 7:], np.diag([0.0, 0.0, -0.1]))
    always = with_tolerances(Follows.of(robot, path, "pose"), [R("z", 0.1)])
    assert not has_windows(always)


def test_two_hinges_tilt_a_pointing_tool_and_three_one_that_must_not_twist() -> None:
    robot = robot_named("panda")
    path, cone = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0), [R(("rx", "ry"), 0.3)]
    rows = {
        task: len(with_tolerances(Follows.of(robot, path, task), cone).items[0].chain.table)
        for task in ("pointing", "pose")
    }
    assert rows == {"pointing": len(robot.chain.table) + 2, "pose": len(robot.chain.table) + 3}


@pytest.mark.parametrize("task", ["pose", "pointing"])
def test_small_tilts_deviate_as_smoothly_as_large_ones(task: str) -> None:
    """Near 0 by a series, whose fourth power is left out: 1e-8 of the curvature at 0.01 rad."""
    robot = robot_named("panda")
    path, cone = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0), R(("rx", "ry"), 1.0)
    virtual = with_tolerances(Follows.of(robot, path, task), [cone]).virtual
    s = np.random.default_rng(0).uniform(-0.004, 0.004, (20, 2))
    exact = differences(lambda x: virtual.rows_of(cone, x)[0], s, 1e-5)
    # Differences over 1e-5 round by 1e-13; a wrong series is off by 1e-6.
    np.testing.assert_allclose(virtual.rows_of(cone, s)[1], exact, atol=1e-11)
    # Where the series ends, a tilt about one axis has the same slopes on both of its sides.
    end = 0.01 / (0.5 if task == "pose" else 1.0)
    sides = [virtual.rows_of(cone, np.array([[end + aside, 0.0]]))[1] for aside in (-1e-9, 1e-9)]
    np.testing.assert_allclose(*sides, atol=5e-11)


def test_a_twist_by_more_than_half_a_turn_deviates_as_the_one_back_does() -> None:
    """The rotation is the same: its vector is the one below half a turn, and so are its slopes."""
    robot = robot_named("xarm7")
    path = sm.paths.Dwell(robot.pose(robot.dexterous_configuration()), 4.0)
    band = R(("rx", "ry", "rz"), 4.0)
    virtual = with_tolerances(Follows.of(robot, path, "pose"), [band]).virtual
    names = [joint.name for joint in virtual.each]
    turn = 2.0 * np.pi / virtual.each[names.index("relaxed rz")].scale
    s = np.random.default_rng(0).uniform(-0.4, 0.4, (10, 3))
    s[:, names.index("relaxed rz")] += 0.6 * turn
    back = s.copy()
    back[:, names.index("relaxed rz")] -= turn
    for ahead, behind in zip(virtual.rows_of(band, s), virtual.rows_of(band, back), strict=True):
        np.testing.assert_allclose(ahead, behind, atol=ROUNDING)


def test_of_several_paths_the_first_one_says_how_far_the_tool_is_off() -> None:
    hands = "left/panda_hand_tcp", "right/panda_hand_tcp"
    aside = pin.SE3(np.eye(3), np.array([0.0, 1.0, 0.0]))
    robot = sm.load_robot({"left": "panda", "right": "panda"}, base={"right": aside}, tool=hands)
    q = np.append(PANDA_HOME, PANDA_HOME)
    panda = robot_named("panda").pose(PANDA_HOME)
    below = pin.SE3(panda.rotation, panda.translation - [0.0, 0.0, 0.02])
    items = [
        sm.Follow(sm.paths.Dwell(below, 4.0), tool=hands[0]),
        sm.Follow(sm.paths.Dwell(aside * panda, 4.0), tool=hands[1]),
    ]
    band = R("z", 0.05)
    problem = sm.Problem(robot, items, relaxations=[band])
    follows = Formulation.of(problem).follows
    z = completed(follows, np.zeros(1), q[None])
    np.testing.assert_allclose(deviation_of(follows, band, z), [[0.02]], atol=ROUNDING)


def test_where_home_is_not_known_the_middle_of_the_limits_is_usual() -> None:
    robot = robot_named("z1")
    pose = robot.pose(robot.dexterous_configuration(sm.Task.POSITION))
    follows = Follows.of(robot, sm.paths.Dwell(pose, 4.0), "position")
    middle = 0.5 * (robot.lower + robot.upper)
    np.testing.assert_allclose(follows.coordinates.usual(), middle)
    more = with_tolerances(follows, [R("z", 0.1)]).coordinates
    np.testing.assert_allclose(more.usual(), np.append(middle, 0.0))


def test_rows_are_limited_one_by_one_only_where_a_band_of_several_implies_it() -> None:
    robot = robot_named("panda")
    path = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0)
    # One row with another band in another window: no limit of the joint says both.
    one = [R("x", 0.1, during=(0.0, 2.0)), R("x", 0.2, during=(2.0, 4.0))]
    follows = with_tolerances(Follows.of(robot, path, "pose"), one)
    assert all(RowWithinBand.of_row(item, follows) is None for item in one)
    assert all(RowWithinBand.of_each(item, follows) is None for item in one)
    # Rows that are free at some time have no limits at all.
    free = [R(("x", "y"), 0.1, during=(0.0, 2.0)), R(("x", "y"), during=(2.0, 4.0))]
    follows = with_tolerances(Follows.of(robot, path, "pose"), free)
    assert RowWithinBand.of_each(free[0], follows) is None


def test_rotations_about_changing_pairs_of_axes_are_refused() -> None:
    robot = robot_named("panda")
    path = sm.paths.Dwell(robot.pose(PANDA_HOME), 4.0)
    pairs = [R("rx", 0.1, (0.0, 2.0)), R("ry", 0.1), R("rz", 0.1, (2.5, 4.0))]
    with pytest.raises(sm.errors.ProblemError, match="two and another two"):
        sm.Problem(robot, path, start=PANDA_HOME, relaxations=pairs)
    # One pair, and all three at other times, is none of these.
    alone = [R("rx", 0.1), R("ry", 0.1), R("rz", 0.1, (0.0, 2.0))]
    follows = with_tolerances(Follows.of(robot, path, "pose"), alone)
    assert [joint.name for joint in follows.virtual.each] == ["relaxed rz", "tilt rx", "tilt ry"]


def test_a_problem_with_tolerances_keeps_what_its_costs_and_limits_say_of_the_arm() -> None:
    """Their values and derivatives are those of the arm's own joints; bands are besides."""
    robot = robot_named("panda")
    circle = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 3.0)
    tilt = sm.constraints.Tilt("panda_link7", within=2.0, towards=(1.0, 0.0, 0.0))
    costs = [
        sm.costs.JointVelocity(),
        sm.costs.InverseManipulability(0.1),
        sm.costs.JointAcceleration(0.01),
    ]
    asked = sm.Problem(
        robot,
        circle,
        start=PANDA_HOME,
        costs=costs,
        constraints=[
            sm.constraints.JointPositionLimits(),
            sm.constraints.JointVelocityLimits(),
            tilt,
        ],
        relaxations=[R(("rx", "ry"), 0.2), R("z", 0.01, axes="tool")],
    )
    formulation, rng = Formulation.of(asked), np.random.default_rng(0)
    t = np.linspace(0.0, 3.0, 9)
    more = formulation.follows.dof - robot.dof
    q = np.hstack([PANDA_HOME + 0.1 * rng.normal(size=(9, 7)), 0.3 * rng.normal(size=(9, more))])
    qd = rng.normal(size=q.shape)
    sampling = Sampling.trapezoidal(t)
    whole = sampled_along(formulation, sampling, q, qd)
    own = Samples.along(asked.follows, sampling, q[:, :7], qd[:, :7])
    for cost in formulation.costs:
        np.testing.assert_allclose(cost.value(whole.arm), cost.value(own), rtol=1e-12)
        for name in ("q", "qd", "qdd"):
            part, wanted = (getattr(cost.gradient(x), name) for x in (whole.arm, own))
            assert (part is None) == (wanted is None)
            if part is not None:
                np.testing.assert_allclose(part, wanted, rtol=1e-12)
    bound = formulation.conditions(q[0], q[-1], apart=False)
    before = on_path(asked).conditions(q[0, :7], q[-1, :7], apart=False)
    bands = [item for item in bound.inequalities if item.depends_on is DependsOn.TOLERANCES]
    # Of rows that share a band, each is within it by itself, too.
    assert [type(item) for item in bands] == [RowWithinBand, RowWithinBand, WithinBand]
    kept = [item for item in bound.every if item not in bands]
    for one, other in zip(kept, before.every, strict=True):
        np.testing.assert_allclose(
            one.residual(whole.seen_by(one)), other.residual(own), atol=1e-12
        )
    for item in bound.inequalities:
        columns = slice(7, None) if item in bands else slice(0, 7)
        ones = np.eye(q.shape[1])[columns, columns]
        motion = NodeTangents(np.tile(ones, (9, 1, 1)), np.zeros((9, *ones.shape)), sampling)

        def residual(x: Array, item=item, columns=columns) -> Array:
            there = q.copy()
            there[:, columns] = x
            return item.residual(sampled_along(formulation, sampling, there, qd).seen_by(item))

        if "velocity" not in item.name:
            exact = differences(residual, q[:, columns])
            tangents = item.tangents(whole.seen_by(item), motion)
            np.testing.assert_allclose(tangents, exact, atol=1e-6)


# Poses with one row off at a time, of which a virtual joint's coordinate is in proportion.
OFF = [0.5, 1.5, -2.0]


@pytest.mark.parametrize(("name", "task", "relaxations"), TOLERANCES)
def test_what_is_said_of_a_band_is_the_deviation_in_its_unit(
    name: str, task: str, relaxations: list[sm.Relaxation]
) -> None:
    """And not the coordinate of a virtual joint, nor the name of one."""
    robot = robot_named(name)
    start = robot.dexterous_configuration(task)
    path = sm.paths.Dwell(robot.pose(start), 4.0)
    problem = sm.Problem(robot, path, task, relaxations=relaxations, clearance=None)
    formulation = Formulation.of(problem)
    follows = with_tolerances(Follows.of(robot, path, task), relaxations)
    virtual, n = follows.virtual, robot.dof
    sampling = Sampling.trapezoidal(np.linspace(0.0, 4.0, 5))
    said = 0
    for k, joint in enumerate(virtual.each):
        if joint.row is None:
            continue
        for off in OFF:
            s = np.zeros(len(virtual.each))
            s[k] = off
            q = np.tile(np.append(start, s), (5, 1))
            whole = sampled_along(formulation, sampling, q, np.zeros_like(q))
            for item in formulation.conditions(q[0], q[1], apart=False).every:
                if not item.name.startswith("relaxation"):
                    continue
                samples = whole.seen_by(item)
                h = item.residual(samples)
                text = item.describe(samples, 0, int(h[0].argmax()))
                assert "tilt" not in text
                assert "relaxed" not in text
                if h.max() <= 0.0:
                    continue
                rows = next(x for x in relaxations if x.name in item.name)
                size = np.linalg.norm(deviation_of(follows, rows, q[:1]))
                found = re.search(r"is (\S+) (rad|m) at", text)
                assert found is not None
                assert abs(float(found[1])) == pytest.approx(size, rel=1e-3)
                assert found[2] == ("rad" if rows.angular else "m")
                said += 1
    bands = [item for item in relaxations if np.isfinite(item.band)]
    assert said >= len(bands)
    told = [follows.coordinates.label(n + k) for k in range(len(virtual.each))]
    assert not any("tilt" in words or "relaxed" in words for words in told)
    assert follows.coordinates.label(0) == f"joint '{robot.joint_names[0]}'"


@pytest.mark.parametrize("relaxations", [item[2] for item in TOLERANCES[:4]])
@pytest.mark.parametrize("window", [None, (0.5, 1.3)])
def test_gradients_along_nodes_equal_central_differences(
    relaxations: list[sm.Relaxation], window: tuple[float, float] | None
) -> None:
    robot = robot_named("panda")
    circle = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 2.0)
    items = [dataclasses.replace(item, during=window) for item in relaxations]
    asked = sm.Problem(
        robot, circle, start=PANDA_HOME, relaxations=items, rest=False, clearance=None
    )
    motion = nodes_of(asked)
    held = motion.grid.manifolds.held
    assert held.any() == (window is not None)
    step = random_step(motion, 3, 0.02)
    here = moved(motion, step)
    # What stands still does so, and moves nothing.
    assert not here.place.q[held].any()
    assert not here.place.qd[held].any()
    direction = random_step(motion, 4)
    size = 1e-5
    here = centred(here)
    aims = [moved(here, side * direction).objective for side in (size, -size)]
    force = here.grid.spline.scatter(slopes_of(here))
    gradient = np.einsum("konw,kon->kw", around_of(here).changes, force)
    exact = (aims[0] - aims[1]) / (2.0 * size)
    assert abs(float((gradient * direction).sum()) - exact) < COST * np.abs(gradient).sum()


def test_springs_have_exact_slopes_and_curvatures() -> None:
    """Deviations cost ½ Σ w δ² where their bands do not bound them."""
    robot = robot_named("panda")
    circle = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 2.0)
    asked = sm.Problem(
        *(robot, circle), start=PANDA_HOME, relaxations=[R("z", 0.02)], rest=False, clearance=None
    )
    soft = with_springs(Formulation.of(asked), 3.0)
    assert soft.springs is not None
    t = np.linspace(0.0, 2.0, 7)
    grid = NodeGrid(soft, t, BoundConditions(), free=False, counts=Counts())
    cost, spline = grid.cost, grid.spline
    rng = np.random.default_rng(0)
    ends = np.concatenate([np.tile(PANDA_HOME, (6, 6, 1)), rng.normal(size=(6, 6, 1))], axis=2)

    def value(ends: Array) -> float:
        every = CurveSamples(
            soft.follows, spline.sampling, lambda o: spline.at(AT_GAUSS, o, ends).reshape(-1, 8)
        )
        hard = np.sum([item.value(sampled(soft, every).arm) for item in soft.costs], axis=0)
        return float(cost.quadratic.at(ends).costs.sum() - spline.sampling.weights @ hard)

    # Being at a band all the time doubles a cost of 3.
    edge = np.zeros((6, 6, 8))
    edge[:, [0, 3], 7] = soft.coordinates.upper[7]
    assert value(edge) == pytest.approx(3.0, rel=1e-9)
    samples = sampled(
        soft, CurveSamples(soft.follows, spline.sampling, lambda o: np.zeros((30, 8)))
    )
    slopes = cost.quadratic.at(ends).slopes[:, :, 7:]
    direction = np.zeros_like(ends)
    direction[:, :, 7] = rng.normal(size=(6, 6))
    exact = (value(ends + 1e-4 * direction) - value(ends - 1e-4 * direction)) / 2e-4
    assert float((slopes * direction[:, :, 7:]).sum()) == pytest.approx(exact, rel=1e-6)
    nodes = np.zeros((7, 3, 8, 1))
    nodes[:, :, 7] = rng.normal(size=(7, 3, 1))
    by, matrix, step = spline.changes(nodes), NodeMatrix.zeros(7, 1), np.ones((7, 1))
    cost.add_curvature(matrix, by, samples, Partials())
    bends = float(step.ravel() @ matrix.banded().dense() @ step.ravel())
    direction = by.along(step)
    sides = value(ends + direction) + value(ends - direction) - 2.0 * value(ends)
    assert bends == pytest.approx(sides, rel=1e-6)


@pytest.mark.parametrize("relaxations", [item[2] for item in TOLERANCES[1:5]])
def test_what_is_brought_within_bands_deviates_by_no_more(relaxations: list[sm.Relaxation]) -> None:
    """Of tolerances of several rows; what is within them may stay where it is."""
    robot = robot_named("panda")
    real = Follows.of(robot, sm.paths.Dwell(pin.SE3.Identity(), 1.0), "pose")
    follows = with_tolerances(real, relaxations)
    count = len(follows.virtual.each)
    q = np.zeros((40, robot.dof + count))
    bands = [follows.virtual.widest([joint.row]) / joint.scale for joint in follows.virtual.each]
    far = np.where(np.isfinite(bands), bands, 1.0)
    q[:, -count:] = far * np.random.default_rng(2).normal(scale=0.7, size=(40, count))
    most = band_limits(follows, q)
    there = np.clip(q, -most, most)
    for item in relaxations:
        if len(item.rows) == 1 or not np.isfinite(item.band):
            continue
        sizes = [np.linalg.norm(deviation_of(follows, item, x), axis=1) for x in (q, there)]
        beyond = sizes[0] > item.band
        assert beyond.any()
        # They are brought to the edge, and no farther in.
        assert (sizes[1] < (1.0 + BENT) * item.band).all()
        assert (sizes[1][beyond] > (1.0 - BENT) * item.band).all()
        np.testing.assert_allclose(sizes[1][~beyond], sizes[0][~beyond])
