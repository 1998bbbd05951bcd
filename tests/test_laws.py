"""Laws of the method, on every arm and task."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from conftest import central_difference, objective_of, robot_named, short_line, start_of
from selfmotion import kernels
from selfmotion.basics.arrays import Array
from selfmotion.engine.rollout import Rollout
from selfmotion.engine.start import FixedStart
from selfmotion.motion.grid import Grid
from selfmotion.motion.null_motion import NullMotionTable, PolynomialNullMotion, transport

Case = tuple[sm.RobotModel, sm.Task, Array, sm.Path]

# Products of well-conditioned matrices with entries of order 1.
ALGEBRA = 1e-10
# Exact gradients against central differences of F, relative to the gradient's largest entry.
GRADIENT = 1e-6


def rollout_of(case: Case, steps: int = 12) -> Rollout:
    robot, task, _, path = case
    return Rollout(robot, path, task, Grid.aligned(path.knots, steps))


def random_epsilon(rollout: Rollout, seed: int, size: float = 0.3) -> Array:
    """Return a smooth null motion: random cubics per joint."""
    t = rollout.grid.stage_times / rollout.path.duration
    coefficients = np.random.default_rng(seed).normal(size=(4, rollout.robot.dof))
    return size * np.vander(t, 4) @ coefficients


def test_null_space_projector(case: Case) -> None:
    robot, task, start, _ = case
    jacobian = robot.task_jacobian(start, task)
    inverse = np.linalg.pinv(jacobian)
    projector = np.eye(robot.dof) - inverse @ jacobian
    np.testing.assert_allclose(jacobian @ projector, 0.0, atol=ALGEBRA)
    np.testing.assert_allclose(projector @ projector, projector, atol=ALGEBRA)
    np.testing.assert_allclose(projector, projector.T, atol=ALGEBRA)


def test_equation_4_at_every_stage(case: Case) -> None:
    """q̇ is J⁺u + (I - J⁺J)ε with numpy's own pseudo-inverse, and J q̇ = u."""
    rollout = rollout_of(case)
    epsilon = random_epsilon(rollout, 1)
    assert rollout.run(case[2], epsilon) is None
    samples, task = rollout.samples(), case[1]
    target = case[3].samples(samples.t)
    gain = 20.0 / case[3].duration
    for s in range(0, len(samples.t), 7):
        jacobian = samples.task_jacobian[s]
        actual = pin.SE3(samples.rotation[s], samples.translation[s])
        goal = pin.SE3(target.rotation[s], target.translation[s])
        twist = target.twist[s] + gain * task.twist_error(goal, actual)
        command = task.select(twist[:, None], samples.rotation[s])[:, 0]
        inverse = np.linalg.pinv(jacobian)
        expected = inverse @ command + epsilon[s] - inverse @ (jacobian @ epsilon[s])
        np.testing.assert_allclose(samples.qd[s], expected, atol=1e-9)
        np.testing.assert_allclose(jacobian @ samples.qd[s], command, atol=1e-9)


def test_path_error_does_not_depend_on_the_null_motion(case: Case) -> None:
    """Whatever ε does, what is left of the path error is the integration's and vanishes with h."""
    for seed in range(3):
        drifts = []
        for steps in (20, 80):
            rollout = rollout_of(case, steps)
            assert rollout.run(case[2], random_epsilon(rollout, seed, 0.2)) is None
            drifts.append(np.abs(rollout.drift[:, case[1].rows]).max())
        assert drifts[1] < 1e-6
        assert drifts[1] < drifts[0] / 50 or drifts[0] < 1e-11


@pytest.mark.parametrize(("name", "task"), [("planar_3r", "planar"), ("panda", "pose")])
def test_integration_is_of_fourth_order(name: str, task: str) -> None:
    robot = robot_named(name)
    start = start_of(robot, task)
    path = short_line(robot, start)
    # From 40 steps on the feedback (20 over the motion) is resolved and the order shows.
    ends, steps = [], np.array([40, 80, 160, 320, 1600])
    for count in steps:
        rollout = Rollout(robot, path, sm.Task.of(task), Grid.aligned(path.knots, int(count)))
        assert rollout.run(start, random_epsilon(rollout, 4, 0.5)) is None
        ends.append(rollout.samples().q[-1].copy())
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    slope = -np.polyfit(np.log(steps[:-1]), np.log(errors), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.2)


def test_motion_equals_a_high_order_integration(case: Case) -> None:
    """The rollout against DOP853 on eq. 4 written with numpy's pseudo-inverse."""
    from scipy.integrate import solve_ivp

    robot, task, start, path = case
    rollout = rollout_of(case, 100)
    coefficients = 0.3 * np.random.default_rng(6).normal(size=(4, robot.dof))

    def epsilon(t: float) -> Array:
        return (t / path.duration) ** np.arange(3, -1, -1) @ coefficients

    def rate(t: float, q: Array) -> Array:
        rotation = robot.pose(q).rotation
        jacobian = task.select(robot.jacobian(q), rotation)
        inverse = np.linalg.pinv(jacobian)
        command = task.select(path.twist(t)[:, None], rotation)[:, 0]
        return inverse @ command + epsilon(t) - inverse @ (jacobian @ epsilon(t))

    table = np.array([epsilon(t) for t in rollout.grid.stage_times])
    assert rollout.run(start, table) is None
    oracle = solve_ivp(rate, (0, path.duration), start, method="DOP853", rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(rollout.samples().q[-1], oracle.y[:, -1], atol=2e-7)


COSTS = {
    "velocity": lambda r, t: sm.JointVelocity(),
    "weighted velocity": lambda r, t: sm.JointVelocity(np.arange(1.0, r.dof + 1.0)),
    "full weight": lambda r, t: sm.JointVelocity(np.eye(r.dof) + 0.3),
    "acceleration": lambda r, t: sm.JointAcceleration(),
    "jerk": lambda r, t: sm.JointJerk(),
    "posture": lambda r, t: sm.Posture(np.arange(1.0, r.dof + 1.0), posture=np.ones(r.dof)),
    "joint limits": lambda r, t: sm.JointLimitDistance(r.lower, r.upper),
    "path length": lambda r, t: sm.PathLength(),
    "inverse manipulability": lambda r, t: sm.InverseManipulability(0.01),
    "manipulability": lambda r, t: sm.Manipulability(0.7),
    "directional": lambda r, t: sm.DirectionalManipulability(np.arange(1.0, t.dimension + 1)),
    "smallest singular value": lambda r, t: sm.SmallestSingularValue(),
    "kinetic energy": lambda r, t: sm.KineticEnergy(r),
    "gravity torque": lambda r, t: sm.GravityTorque(r),
    "function": lambda r, t: sm.FunctionCost(
        lambda qd, q, t: np.sin(q).sum(axis=1) * (qd**2).sum(axis=1) + t * q[:, 0]
    ),
}


@pytest.mark.parametrize("cost", COSTS)
def test_gradient_equals_central_differences(case: Case, cost: str) -> None:
    robot, task, start, path = case
    rollout = rollout_of(case, 8)
    functions = PolynomialNullMotion(2, "joint").functions(rollout.grid.stage_times, path.duration)
    table = NullMotionTable(functions, None, robot.dof)
    objective = objective_of(rollout, table, [COSTS[cost](robot, task)], FixedStart(start))
    x = 0.1 * np.random.default_rng(7).normal(size=objective.size)
    exact = objective.gradient(x)
    differences = central_difference(objective.value, x, 1e-5)
    # Where the self-motion leaves a cost unchanged (UR's last joint), rounding of F remains.
    scale = max(np.abs(differences).max(), 1e-2 * abs(objective.value(x)))
    assert np.abs(exact - differences).max() <= GRADIENT * scale


def test_panda_gradient_to_seven_digits() -> None:
    """50 steps, 6 rows; differences extrapolated so that their own error is far below."""
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    path = sm.Circle.around(robot.pose(start), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    rollout = Rollout(robot, path, sm.Task.POSE, Grid.aligned(path.knots, 50))
    functions = PolynomialNullMotion(3, "joint").functions(rollout.grid.stage_times, 4.0)
    table = NullMotionTable(functions, None, robot.dof)
    costs = [sm.JointVelocity(), sm.InverseManipulability(0.01)]
    objective = objective_of(rollout, table, costs, FixedStart(start))
    x = 0.05 * np.random.default_rng(13).normal(size=objective.size)
    exact = objective.gradient(x)
    coarse = central_difference(objective.value, x, 2e-3)
    fine = central_difference(objective.value, x, 1e-3)
    differences = (4.0 * fine - coarse) / 3.0
    assert np.abs(exact - differences).max() <= 1e-7 * np.abs(differences).max()


def test_pullback_to_the_start_equals_central_differences(case: Case) -> None:
    """Also off the path, where the pose error and its derivative matter."""
    robot, _, start, _ = case
    rollout = rollout_of(case, 10)
    rng = np.random.default_rng(8)
    epsilon = random_epsilon(rollout, 2, 0.1)
    off = start + 0.02 * rng.normal(size=robot.dof)
    by_q, by_qd = rng.normal(size=(2, *epsilon.shape))

    def value(q: Array) -> float:
        assert rollout.run(q, epsilon) is None
        samples = rollout.samples()
        return float((by_q * samples.q).sum() + (by_qd * samples.qd).sum())

    differences = central_difference(value, off)
    value(off)
    _, exact, _ = rollout.pullback(by_q, by_qd)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


def test_sensitivities_equal_central_differences(case: Case) -> None:
    robot, _, start, path = case
    rollout = rollout_of(case, 20)
    functions = PolynomialNullMotion(1, "joint").functions(rollout.grid.stage_times, path.duration)
    table = NullMotionTable(functions, None, robot.dof)
    x = 0.1 * np.random.default_rng(9).normal(size=table.size)
    assert rollout.run(start, table.epsilon(x)) is None
    _, exact = rollout.sensitivities(table.matrix(), np.zeros((robot.dof, table.size)))
    for i in range(table.size):
        shift = np.zeros_like(x)
        shift[i] = 1e-6
        ends = []
        for sign in (1.0, -1.0):
            assert rollout.run(start, table.epsilon(x + sign * shift)) is None
            ends.append(rollout.samples().qd.copy())
        differences = (ends[0] - ends[1]) / 2e-6
        scale = max(1.0, np.abs(differences).max())
        np.testing.assert_allclose(exact[:, :, i], differences, atol=GRADIENT * scale)


def test_contraction_equals_the_jacobian_hessian(case: Case) -> None:
    """⟨M, ∂J/∂q⟩ in O(n) against differences of the task Jacobian, for any M."""
    robot, task, start, _ = case
    weights = np.random.default_rng(10).normal(size=(task.dimension, robot.dof))
    found = kernels.contract_task(
        robot.jacobian(start)[None],
        np.array(robot.pose(start).rotation)[None],
        weights[None],
        task.rows,
        task.tool_axes,
    )[0]
    expected = central_difference(
        lambda q: float((weights * robot.task_jacobian(q, task)).sum()), start
    )
    np.testing.assert_allclose(found, expected, atol=1e-7)


def test_transported_basis_is_orthonormal_and_continuous(case: Case) -> None:
    robot, task, start, _ = case
    rollout = rollout_of(case, 60)
    assert rollout.run(start, random_epsilon(rollout, 3)) is None
    jacobians = rollout.samples().task_jacobian[rollout.grid.node_stages]
    bases = transport(jacobians)
    redundancy = robot.dof - task.dimension
    for jacobian, basis in zip(jacobians, bases, strict=True):
        np.testing.assert_allclose(jacobian @ basis, 0.0, atol=ALGEBRA)
        np.testing.assert_allclose(basis.T @ basis, np.eye(redundancy), atol=ALGEBRA)
    assert np.abs(np.diff(bases, axis=0)).max() < 0.1


def test_transport_survives_flipped_singular_vectors() -> None:
    """Rows reordered and negated from node to node leave the basis continuous."""
    rng = np.random.default_rng(11)
    base, slope = rng.normal(size=(2, 2, 5))
    jacobians = []
    for k in range(50):
        jacobian = base + 0.02 * k * slope
        jacobians.append((-1.0) ** k * jacobian[:: (-1) ** k])
    assert np.abs(np.diff(transport(np.array(jacobians)), axis=0)).max() < 0.1


def test_breakdown_is_reported_not_raised(planar: sm.RobotModel) -> None:
    """From the stretched pose outward no q̇ exists."""
    start = np.array([0.3, 0.0, 0.0])
    pose = planar.pose(start)
    end = pose.copy()
    end.translation = pose.translation * 1.1
    path = sm.Line(pose, end, 1.0)
    rollout = Rollout(planar, path, sm.Task.PLANAR, Grid.aligned(path.knots, 10))
    assert rollout.run(start, np.zeros((41, 3))) == 0.0
    table = NullMotionTable(np.ones((41, 1)), None, 3)
    objective = objective_of(rollout, table, [sm.JointVelocity()], FixedStart(start))
    assert objective.value(np.zeros(3)) == np.inf
    assert np.isnan(objective.gradient(np.zeros(3))).all()
    assert rollout.run(np.array([0.3, 1.0, np.nan]), np.zeros((41, 3))) is not None


def test_null_motion_table_and_its_transpose() -> None:
    """⟨ε(x), w⟩ = ⟨x, pullback(w)⟩ and ε(x) = matrix · x, for both spaces."""
    rng = np.random.default_rng(12)
    for frame, rows in ((None, 4), (rng.normal(size=(9, 4, 2)), 2)):
        table = NullMotionTable(rng.normal(size=(9, 3)), frame, rows)
        x, w = rng.normal(size=table.size), rng.normal(size=(9, 4))
        assert (table.epsilon(x) * w).sum() == pytest.approx(x @ table.pullback(w))
        np.testing.assert_allclose(table.matrix() @ x, table.epsilon(x), atol=1e-12)


def test_paper_parameterisation_has_the_papers_order() -> None:
    """Eq. 6 to 8: x = [e_00 … e_0p e_10 …], ε_i(t) = Σ_k e_ik t^k."""
    motion = PolynomialNullMotion(3, "joint", "monomial")
    t = np.array([0.0, 0.5, 2.0])
    table = NullMotionTable(motion.functions(t, 2.0), None, 3)
    e = np.arange(12.0).reshape(3, 4)
    expected = np.array([[sum(e[i, k] * s**k for k in range(4)) for i in range(3)] for s in t])
    np.testing.assert_allclose(table.epsilon(e.ravel()), expected)


def test_b_spline_functions_are_a_partition_of_unity_with_local_support() -> None:
    motion = sm.BSplineNullMotion(intervals=6, degree=3)
    t = np.linspace(0, 2.5, 61)
    functions = motion.functions(t, 2.5)
    assert functions.shape == (61, 9)
    np.testing.assert_allclose(functions.sum(axis=1), 1.0, atol=1e-12)
    assert (functions != 0).sum(axis=1).max() == 4
    assert sm.BSplineNullMotion(1, 0).functions(t, 2.5).shape == (61, 1)
    with pytest.raises(sm.ProblemError, match="intervals is 0"):
        sm.BSplineNullMotion(0)


def test_accelerations_and_jerks_are_derivatives(case: Case) -> None:
    """Five-point differences of q̇ against differences of q̇ on a four times finer grid."""
    rollout = rollout_of(case, 80)
    assert rollout.run(case[2], random_epsilon(rollout, 5)) is None
    samples = rollout.samples()
    nodes = rollout.grid.node_stages[2:-2]
    h = case[3].duration / rollout.grid.steps
    qd = samples.qd[rollout.grid.node_stages]
    central = (qd[:-4] - 8 * qd[1:-3] + 8 * qd[3:-1] - qd[4:]) / (12 * h)
    np.testing.assert_allclose(samples.qdd[nodes], central, atol=1e-8)
    second = (-qd[:-4] + 16 * qd[1:-3] - 30 * qd[2:-2] + 16 * qd[3:-1] - qd[4:]) / (12 * h**2)
    np.testing.assert_allclose(samples.qddd[nodes], second, atol=1e-6)


def test_legendre_functions_are_orthonormal_over_the_motion() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(12)
    duration = 2.5
    functions = PolynomialNullMotion(6).functions(0.5 * duration * (nodes + 1), duration)
    gram = functions.T @ (0.5 * duration * weights[:, None] * functions)
    np.testing.assert_allclose(gram, np.eye(7), atol=1e-12)
