"""Single steps of Newton's method: what they predict, how far they go, and why they end."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.nodes import NodeMotion, Step, minimise, newton, newton_system
from selfmotion.planning.nodes.motion import moved_along
from selfmotion.planning.nodes.newton import (
    _merit,
    _raise_merit_penalty,
    _relative_change,
    _residuals,
    _shorter,
    _Solver,
)
from selfmotion.planning.nodes.newton_kernels import merit_of_rows
from selfmotion.planning.nodes.newton_system import Change, Model, System
from selfmotion.planning.nodes.settings import SETTINGS
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.outcomes import NodeOutcome
from selfmotion.planning.planner.refinement import DividesAtNodes, refined
from selfmotion.problem.costs import Partials, Samples
from support.arms import PANDA_HOME, start_of
from support.nodes import centred, moved, nodes_of, problem_of, random_step

# A motion that is closed up to this at its last node [rad].
OFF = 1e-3
# A limit of speeds that binds and can be kept [rad/s].
LOOSE = 1.3
# Share of a step by which functions along it are differentiated.
NEAR = 1e-5
# Of such differences; of a quadratic form against the system without what is added to its diagonal.
DIFFERENCE, DIAGONAL = 1e-3, 1e-3
# Of the linear equations that a step solves, in units of their largest term.
SOLVED = 1e-9


def problem(panda: sm.RobotModel, *constraints: sm.constraints.Constraint, **more) -> sm.Problem:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return problem_of((panda, "pose", PANDA_HOME, path), constraints=constraints, **more)


def bound(panda: sm.RobotModel, *, closed: bool = True) -> NodeMotion:
    """Return a motion that violates limits, and, of a closed one, does not end where it starts."""
    ends = [sm.constraints.ClosedPath()] if closed else []
    return nodes_of(problem(panda, sm.constraints.JointVelocityLimits(1.0), *ends), 16)


def stepped(solver: _Solver) -> tuple[Model, Change]:
    model = Model.of(solver.motion, solver._rows, solver._end_multipliers)
    assert model is not None
    system = solver._system(model)
    assert system is not None
    return model, solver._step(system)


def system_of(solver: _Solver, model: Model) -> System:
    found = System.of(solver.motion, model, solver._rows, solver._barrier, 0.0)
    assert found is not None
    return found


def never(step: Step) -> bool:
    return False


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("before", [0, 1, 4])
def test_a_step_is_a_direction_of_descent_as_steep_as_it_predicts(
    panda: sm.RobotModel, before: int, closed: bool
) -> None:
    solver = _Solver(bound(panda, closed=closed), None, SETTINGS.mu_first, roughly=False)
    for _ in range(before):
        assert solver.advance(never) is None
    _, step = stepped(solver)
    assert len(step.slacks)
    assert bool(len(step.end_multipliers)) is closed
    check_descent(solver)


def check_descent(solver: _Solver) -> float:
    """The derivative of the merit function is as predicted, and negative enough.

    Returns that of cost and barrier terms alone.
    """
    model, step = stepped(solver)

    def merit(share: float) -> float:
        motion = moved_along(solver.motion, share * step.nodes, model.around.changes)
        assert motion is not None
        slacks = solver._slacks + share * step.slacks
        elastics = solver._elastics + share * step.elastics
        return _merit(solver, motion, motion.h[solver._active], slacks, elastics)

    def slope() -> float:
        return (merit(NEAR) - merit(0.0)) / NEAR

    solver._merit_penalty = 0.0
    without = slope()
    predicted = _raise_merit_penalty(solver, model, step)
    assert predicted == pytest.approx(slope(), rel=DIFFERENCE)
    # However costs and barriers rise along it.
    assert predicted <= -abs(without) * (1.0 - DIFFERENCE)
    assert solver._merit_penalty > np.abs(step.end_multipliers).max(initial=0.0)
    return without


def test_a_step_that_has_to_raise_the_cost_is_a_direction_of_descent(planar: sm.RobotModel) -> None:
    """Beside an optimum, to the side on which the cost is lower and the ends do not meet."""
    start = start_of(planar, "planar")
    circle = sm.paths.Circle.around(planar.pose(start), 0.2, 4.0, normal=(0.0, 0.0, 1.0))
    closed = [sm.constraints.ClosedPath()]
    begin = nodes_of(problem_of((planar, "planar", start, circle), constraints=closed), 16)
    found = minimise(begin, never)
    assert found.status is Status.CONVERGED
    slopes = []
    for side in (-1.0, 1.0):
        step = np.zeros((len(found.motion.nu), 3))
        step[:, 0] = side * OFF * np.linspace(0.0, 1.0, len(step)) ** 2
        beside = centred(moved(found.motion, step))
        slopes.append(check_descent(_Solver(beside, None, SETTINGS.mu_first, roughly=False)))
    assert max(slopes) > 0.0


def test_what_a_step_promises_is_its_quadratic_form(panda: sm.RobotModel) -> None:
    """With the matrix K of the system, the decrease of the barrier problem is pᵀKp."""
    solver = _Solver(bound(panda), None, SETTINGS.mu_first, roughly=False)
    for _ in range(3):
        assert solver.advance(never) is None
    model, step = stepped(solver)
    own = solver._rows
    matrix = model.stiffened(own.of_all(system_of(solver, model).stiff)).banded()
    matrix.add(0, 0, model.around.curvature)
    flat = step.nodes.ravel()
    quadratic = float(flat @ matrix.dense() @ flat)
    # What is added to the diagonal of a matrix that is not positive definite would count as well.
    assert solver._shift == 0.0
    assert step.promised == pytest.approx(quadratic, rel=DIAGONAL)
    # For another μ the same system has another step.
    softer = system_of(solver, model).step(30.0 * solver._barrier)
    flat = softer.nodes.ravel()
    assert softer.promised == pytest.approx(float(flat @ matrix.dense() @ flat), rel=DIAGONAL)


def spread(solver: _Solver) -> None:
    """Put slacks, elastic variables and multipliers far from the central path, above 0."""
    rng = np.random.default_rng(4)
    slacks, elastics, shares = rng.uniform(0.2, 0.8, size=(3, len(solver._slacks)))
    solver._slacks, solver._elastics, solver._multipliers = slacks, elastics, shares * solver._rho


def test_a_step_solves_the_linearised_conditions_of_an_optimum(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of `newton`, without elimination, wherever slacks and multipliers are."""
    # What is added to the diagonal is no part of them.
    without = replace(SETTINGS, flat_share=0.0)
    monkeypatch.setattr(newton_system, "SETTINGS", without)
    solver = _Solver(bound(panda), None, SETTINGS.mu_first, roughly=False)
    spread(solver)
    # As much as the other products.
    solver._barrier = 0.2 * solver._rho
    model, step = stepped(solver)
    assert solver._shift == 0.0
    s, e, multipliers, mu = solver._slacks, solver._elastics, solver._multipliers, solver._barrier
    left = solver._rho - multipliers
    changed = model.rows.along(model.by.along(step.nodes))
    rows = solver._h + changed + s + step.slacks - e - step.elastics
    np.testing.assert_allclose(rows, 0.0, atol=SOLVED)
    by_slack = s * multipliers + s * step.multipliers + multipliers * step.slacks
    by_elastic = e * left - e * step.multipliers + left * step.elastics
    np.testing.assert_allclose(by_slack, mu, rtol=SOLVED)
    np.testing.assert_allclose(by_elastic, mu, rtol=SOLVED)
    ends = model.border.columns.T @ step.nodes.ravel() + solver.motion.c
    np.testing.assert_allclose(ends, 0.0, atol=SOLVED)
    # ∂²L p + ∇F + λᵀ∂h + νᵀ∂c = 0 of all coordinates that are not held.
    matrix = model.curvature.banded()
    matrix.add(0, 0, model.around.curvature)
    after = solver._rows.of_all(multipliers + step.multipliers)
    pulled = model.by.pulled(model.rows.pulled(after))
    terms = [
        matrix.dense() @ step.nodes.ravel(),
        model.gradient.ravel(),
        pulled.ravel(),
        model.border.columns @ step.end_multipliers,
    ]
    free = np.ones(step.nodes.size, dtype=bool)
    free[solver.motion.grid.held] = False
    assert all(np.abs(term[free]).max() > 0.0 for term in terms)
    largest = max(np.abs(term).max() for term in terms)
    np.testing.assert_allclose(np.sum(terms, axis=0)[free], 0.0, atol=SOLVED * largest)


def test_multipliers_of_ends_count_with_the_bending_of_their_conditions(
    panda: sm.RobotModel,
) -> None:
    """The matrix has ∂²(νᵀc)/∂w², here by second differences of νᵀc along a step."""
    motion = centred(nodes_of(problem(panda, sm.constraints.ClosedPath(), rest=False), 8))
    rows = _Solver(motion, None, SETTINGS.mu_first, roughly=False)._rows
    multipliers = np.random.default_rng(5).normal(size=motion.grid.ends.count)
    without, bent = (Model.of(motion, rows, share * multipliers) for share in (0.0, 1.0))
    assert without is not None
    assert bent is not None
    step = random_step(motion, 6)
    added = np.einsum("ki,kij,kj->", step, bent.around.curvature - without.around.curvature, step)
    above, below = (moved(motion, sign * NEAR * step * motion.grid.scale).c for sign in (1.0, -1.0))
    expected = float(multipliers @ (above - 2.0 * motion.c + below)) / NEAR**2
    assert added == pytest.approx(expected, rel=DIFFERENCE)


def test_products_are_as_far_from_the_barrier_as_the_farthest(panda: sm.RobotModel) -> None:
    """|s λ - μ| of slacks, |e (ρ - λ) - μ| of elastic variables: either may be the largest."""
    solver = _Solver(bound(panda), None, SETTINGS.mu_first, roughly=False)
    spread(solver)
    mu, rho, ones = solver._barrier, solver._rho, np.ones(len(solver._slacks))
    for share in (0.25, 0.75):
        solver._multipliers = share * rho * ones
        solver._slacks = mu / solver._multipliers
        solver._elastics = mu / (rho - solver._multipliers)
        assert _residuals(solver)[1] <= SOLVED * mu
        for name in ("_slacks", "_elastics"):
            near = getattr(solver, name)
            for off in (-0.5, 3.0):
                row = np.arange(len(near)) == 2
                setattr(solver, name, near * (1.0 + off * row))
                assert _residuals(solver)[1] == pytest.approx(abs(off) * mu)
            setattr(solver, name, near)


def test_the_merit_of_rows_is_that_of_its_formula() -> None:
    """Gaps count on either side, and without rows there is nothing to count."""
    h = np.random.default_rng(7).uniform(-1.0, 1.0, size=9)
    s, e = np.random.default_rng(8).uniform(0.2, 0.8, size=(2, len(h)))
    rho, mu, penalty = 3.0, 0.7, 0.4
    gaps = h + s - e
    assert gaps.min() < 0.0 < gaps.max()
    expected = np.sum(rho * e - mu * (np.log(s) + np.log(e)) + penalty * np.abs(gaps))
    assert merit_of_rows(h, s, e, rho, mu, penalty) == pytest.approx(expected, rel=SOLVED)
    none = np.zeros(0)
    assert merit_of_rows(none, none, none, rho, mu, penalty) == 0.0


def test_a_warm_start_meets_its_rows_and_costs_no_more_violation(panda: sm.RobotModel) -> None:
    """Slacks close all residuals; where rows hold, elastic variables are on the central path."""
    begin = bound(panda)
    known = np.where(begin.h > -0.5, 0.3 * abs(begin.objective), 0.0)
    solver = _Solver(begin, known, SETTINGS.mu_first, roughly=False)
    h = solver._h
    assert h.min() < 0.0 < h.max()
    np.testing.assert_allclose(h + solver._slacks - solver._elastics, 0.0, atol=SOLVED)
    first = SETTINGS.mu_warm / SETTINGS.mu_first * cold_barrier(begin)
    room = solver._elastics * (solver._rho - solver._multipliers)
    holds = -h >= first / solver._multipliers
    np.testing.assert_allclose(room[holds], first, rtol=SOLVED)
    # Where nothing is known of a row that holds, so are its slack and its multiplier.
    unknown = known[solver._active] == 0.0
    products = (solver._slacks * solver._multipliers)[unknown]
    assert unknown.any()
    np.testing.assert_allclose(products, first, rtol=DIFFERENCE)
    # Of others the violation comes on top.
    beyond = h + first / solver._multipliers
    expected = beyond + first / (solver._rho - solver._multipliers)
    np.testing.assert_allclose(solver._elastics[~holds], expected[~holds], rtol=SOLVED)


def cold_barrier(begin: NodeMotion) -> float:
    return _Solver(begin, None, SETTINGS.mu_first, roughly=False)._barrier


@pytest.mark.parametrize("unit", [2.0**-100, 2.0**40])
def test_the_unit_of_costs_changes_no_bit_of_a_step(panda: sm.RobotModel, unit: float) -> None:
    """Where it is a power of two; also of a matrix that is not positive definite."""

    def steps(unit: float) -> tuple[list[np.ndarray], float]:
        hill = sm.costs.FunctionCost(lambda qd, q, t: -20.0 * unit * np.sum(q**2, axis=1))
        costs = [sm.costs.JointVelocity(unit), hill]
        asked = problem(panda, sm.constraints.JointVelocityLimits(1.0), costs=costs)
        solver = _Solver(nodes_of(asked, 8), None, SETTINGS.mu_first, roughly=False)
        found = []
        for _ in range(2):
            found.append(stepped(solver)[1].nodes)
            solver.advance(never)
        return found, solver._shift

    (usual, shift), (other, same) = steps(1.0), steps(unit)
    assert shift == same > 0.0
    for mine, others in zip(usual, other, strict=True):
        np.testing.assert_array_equal(mine, others)


@pytest.mark.parametrize("unit", [2.0**-20, 2.0**20])
def test_penalties_are_in_the_unit_of_costs_and_changes_of_multipliers_in_none(
    panda: sm.RobotModel, unit: float
) -> None:
    """Bit for bit where it is a power of two: of rows, and where ends have to meet."""
    found = []
    for each in (1.0, unit):
        conditions = sm.constraints.JointVelocityLimits(1.0), sm.constraints.ClosedPath()
        asked = problem(panda, *conditions, costs=[sm.costs.JointVelocity(each)])
        solver = _Solver(nodes_of(asked, 8), None, SETTINGS.mu_first, roughly=False)
        model, step = stepped(solver)
        change = _relative_change(solver, step.multipliers)
        _raise_merit_penalty(solver, model, step)
        found.append((solver._merit_penalty / each, change))
    assert found[0] == found[1]


def test_no_coordinate_changes_more_in_one_step_than_allowed(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    far = sm.costs.Posture(100.0, posture=PANDA_HOME + 1.5)
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 4.0)
    begin = nodes_of(problem_of((panda, "position", PANDA_HOME, path), costs=[far]), 2, free=True)
    changes: list[float] = []

    def seen(motion: NodeMotion, step: np.ndarray, by: np.ndarray) -> NodeMotion | None:
        changes.append(float(np.abs(step[:, : motion.nu.shape[1]]).max()))
        return moved_along(motion, step, by)

    monkeypatch.setattr(newton, "moved_along", seen)
    found = minimise(begin, never)
    assert found.status is Status.CONVERGED
    # Whole steps would be longer.
    assert max(changes) == pytest.approx(SETTINGS.max_change)


def test_a_step_that_is_not_trusted_is_of_a_matrix_that_is_nearly_singular(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More is added to its diagonal until it is trusted; δ is for those not positive definite."""
    solver = _Solver(nodes_of(problem(panda), 8), None, SETTINGS.mu_first, roughly=False)

    def farthest() -> float:
        _, step = stepped(solver)
        return float(np.abs(step.nodes.reshape(len(step.nodes), 3, -1)[:, 0]).max())

    trusted = 0.5 * farthest()
    monkeypatch.setattr(newton_system, "SETTINGS", replace(SETTINGS, max_trusted=trusted))
    assert 0.0 < farthest() <= trusted
    assert solver._shift == 0.0


def test_quadratic_convergence_spares_the_last_system(panda: sm.RobotModel) -> None:
    steps: list[Step] = []
    found = minimise(nodes_of(problem(panda), 16), lambda step: bool(steps.append(step)))
    assert found.status is Status.CONVERGED
    # The gradient is not computed where the last full step has predicted its own error.
    assert steps[-1].slope == 0.0
    assert steps[-1].length == 1.0
    assert steps[-2].slope > 0.0


def test_each_gradient_that_is_computed_is_counted(panda: sm.RobotModel) -> None:
    begin, steps = nodes_of(problem(panda), 16), list[Step]()
    minimise(begin, lambda step: bool(steps.append(step)))
    assert begin.grid.counts.gradients == sum(step.slope > 0.0 for step in steps) > 2


class Uphill(sm.costs.JointVelocity):
    """A cost whose gradient points the wrong way."""

    def gradient(self, samples: Samples) -> Partials:
        return Partials(qd=-samples.qd)


@pytest.mark.parametrize("conditions", ["rows", "ends"])
def test_where_no_step_is_accepted_conditions_may_be_the_reason(
    panda: sm.RobotModel, conditions: str
) -> None:
    """A wrong gradient and rows, or conditions on the ends, that contradict it look alike."""
    constraint = (
        sm.constraints.JointVelocityLimits(0.6)
        if conditions == "rows"
        else sm.constraints.ClosedPath()
    )
    found = minimise(nodes_of(problem(panda, constraint, costs=[Uphill()]), 16), never)
    assert found.status is Status.INFEASIBLE


@pytest.mark.parametrize(
    ("rise", "predicted", "status"),
    [
        (0.0, 0.0, None),
        (5e-14, 0.0, None),
        (0.25e-3, 1e-3, Status.PRECISION),
        (0.75e-3, 1e-3, Status.GRADIENT),
    ],
)
def test_where_little_is_left_a_rise_is_rounding_or_a_wrong_gradient(
    panda: sm.RobotModel,
    monkeypatch: pytest.MonkeyPatch,
    rise: float,
    predicted: float,
    status: Status | None,
) -> None:
    """A step is taken up to rounding; a rise of half of the predicted fall or more tells a fault.

    Of a merit function that rises along the step, and is predicted to fall, by shares of the cost.
    """
    solver = _Solver(nodes_of(problem(panda), 8), None, SETTINGS.mu_first, roughly=False)
    model, step = stepped(solver)
    solver._predicted = 0.5 * SETTINGS.rounding * solver._cost_scale
    cost, lengths = solver.motion.objective, [0.0]

    def along(motion: NodeMotion, nodes: np.ndarray, by: np.ndarray) -> NodeMotion:
        lengths.append(float(np.linalg.norm(nodes) / np.linalg.norm(step.nodes)))
        return motion

    monkeypatch.setattr(newton, "moved_along", along)
    monkeypatch.setattr(newton, "_merit", lambda *_: cost * (1.0 + rise * lengths[-1]))
    monkeypatch.setattr(newton, "_raise_merit_penalty", lambda *_: -predicted * cost)
    assert solver._line_search(model, step) is status
    assert (len(lengths) == 2) is (status is None)


def test_a_rejected_step_is_cut_to_the_least_of_its_parabola() -> None:
    """Of 1 - s α + c α² the least is at s/(2c); of others as far as the bounds allow."""
    for slope, curve in ((-1.0, 1.4), (-2.0, 3.0), (-0.3, 0.9)):
        length = 1.0
        gained = -(slope * length + curve * length**2)
        least = -slope / (2.0 * curve)
        assert SETTINGS.backtracking_least < least < SETTINGS.backtracking
        assert _shorter(length, slope, gained) == pytest.approx(least, rel=1e-12)
    assert _shorter(0.2, -1.0, -1e9) == pytest.approx(0.2 * SETTINGS.backtracking_least)
    # It fell by almost as much as predicted, or rises from the start.
    assert _shorter(0.2, -1.0, 0.19) == pytest.approx(0.2 * SETTINGS.backtracking)
    assert _shorter(0.2, 1.0, -5.0) == pytest.approx(0.2 * SETTINGS.backtracking)


@pytest.mark.parametrize(
    ("share", "status"),
    [(0.5, Status.PRECISION), (2.0, Status.INFEASIBLE), (None, Status.INFEASIBLE)],
)
def test_steps_that_lead_nowhere_are_given_up(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch, share: float | None, status: Status
) -> None:
    """As soon as enough of them are short in a row; a longer one between them begins anew.

    Where next to nothing was left to gain, the last one is an optimum.
    """
    short, long = 0.5 * SETTINGS.short_length, 2.0 * SETTINGS.short_length
    count = SETTINGS.short_steps
    wanted = [short] * (count - 1) + [long] + [short] * (2 * count)
    taken: list[float] = []

    def advance(solver: _Solver, callback: object) -> None:
        taken.append(wanted[len(taken)])
        solver.length = taken[-1]
        if share is not None:
            solver._predicted = share * SETTINGS.rounding * solver._cost_scale

    monkeypatch.setattr(_Solver, "advance", advance)
    found = minimise(nodes_of(problem(panda), 8), never)
    assert found.status is status
    assert len(taken) == 2 * count


def test_from_a_neighbouring_optimum_the_finest_is_found(panda: sm.RobotModel) -> None:
    """Where limits bind: a rough optimum has a larger last μ, one with multipliers has not."""
    begin = nodes_of(problem(panda, sm.constraints.JointVelocityLimits(LOOSE)), 16)
    rough = minimise(begin, never, roughly=True)
    fine = minimise(rough.motion, never, rough.multipliers, roughly=True)
    assert rough.status is fine.status is Status.CONVERGED
    assert rough.multipliers.max() > SETTINGS.multiplier_floor * rough.motion.cost
    assert rough.is_rough
    assert not fine.is_rough
    # Its last μ, of all rows together, is small to what the motion costs.
    assert np.abs(rough.multipliers * rough.motion.h).sum() <= SETTINGS.mu_warm * rough.motion.cost
    assert not minimise(begin, never).is_rough


def test_an_optimum_is_polished_once_on_its_nodes(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where rounding ends that before the tightest tolerances."""
    begin = nodes_of(problem(panda, sm.constraints.JointVelocityLimits(LOOSE)), 16)
    rough = minimise(begin, never, roughly=True)
    known = NodeOutcome.of(replace(rough, status=Status.PRECISION), Status.PRECISION)
    assert rough.is_rough
    asked: list[bool] = []

    def again(known: NodeOutcome, *, roughly: bool = False) -> NodeOutcome:
        asked.append(roughly)
        return known

    monkeypatch.setattr(DividesAtNodes, "_wanted", lambda *_: None)
    recorder, formulation = SimpleNamespace(ended=None), begin.grid.formulation
    search = SimpleNamespace(recorder=recorder, formulation=formulation, again=again)
    refined(known, DividesAtNodes(search))
    assert asked == [False]


def test_settings_are_within_the_ranges_of_their_sources() -> None:
    """Wächter and Biegler 2006, section 4; Nocedal and Wright 2006, chapters 3 and 19."""
    assert all(getattr(SETTINGS, field.name) > 0 for field in fields(SETTINGS))
    for name in (
        *("kappa_mu", "tau", "armijo", "backtracking", "kappa_minus", "saturated", "stall_factor"),
        *("min_merit_penalty", "inactive_share", "min_length", "quadratic_share", "delta_first"),
        *("cost_tolerance", "row_tolerance", "end_tolerance", "barrier_row_tolerance"),
    ):
        assert getattr(SETTINGS, name) < 1.0, name
    for name in ("theta_mu", "kappa_plus", "kappa_epsilon", "rho_factor", "rough_factor"):
        assert getattr(SETTINGS, name) > 1.0, name
    assert SETTINGS.theta_mu < 2.0
    assert SETTINGS.mu_last < SETTINGS.mu_warm < SETTINGS.mu_first
    assert SETTINGS.cost_tolerance < SETTINGS.cost_tolerance_with_rows < SETTINGS.rounding
    assert SETTINGS.max_change < SETTINGS.max_trusted
    with pytest.raises(AttributeError):
        SETTINGS.tau = 0.5  # type: ignore[misc]
    assert replace(SETTINGS, tau=0.9).tau == 0.9
