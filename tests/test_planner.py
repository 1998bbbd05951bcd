"""Plans: the paper's numbers, the accuracy promised, the certificate's independence."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.basics.arrays import Array

# Of a few additions of numbers of order 1.
ROUNDING = 1e-12

Circle = Callable[..., sm.Problem]


@pytest.fixture(scope="module")
def sample() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def test_sample_problem_without_self_motion(sample: sm.Plan) -> None:
    """Against an independent high-order integration (rtol 1e-10)."""
    report = sample.report
    assert report.initial_cost == pytest.approx(15.500547, abs=1e-4)
    assert report.initial_terms["joint velocity"] == pytest.approx(15.415431, abs=1e-4)
    assert report.initial_terms["inverse manipulability"] == pytest.approx(0.085116, abs=1e-5)
    end = sample.initial_trajectory.q[-1]
    np.testing.assert_allclose(end, [-1.582881, 4.814126, -0.269540], atol=2e-5)


def test_sample_problem_optimum(sample: sm.Plan) -> None:
    assert sample.report.cost == pytest.approx(10.5137, abs=1e-4)
    first = next(i for i in sample.report.history if i.cost <= 10.5145)
    assert first.evaluations <= 10
    assert sample.report.evaluations <= 15
    assert sample.report.status is sm.Status.CONVERGED
    assert sample.certificate.verified


def test_the_papers_twelve_coefficients() -> None:
    motion = sm.PolynomialNullMotion(3, "joint", "monomial")
    plan = sm.plan(sm.sample_problem(null_motion=motion))
    assert plan.coefficients.shape == (12,)
    assert plan.report.cost <= 10.4855
    identity = sm.plan(
        sm.sample_problem(null_motion=motion), optimizer=sm.QuasiNewton(initial_metric="identity")
    )
    assert identity.report.cost <= 10.4900
    default = sm.plan(sm.sample_problem())
    assert default.report.evaluations < 0.5 * identity.report.evaluations


def test_higher_degree_is_never_worse() -> None:
    costs = [
        sm.plan(sm.sample_problem(null_motion=sm.PolynomialNullMotion(degree))).report.cost
        for degree in (0, 1, 3, 7)
    ]
    assert np.all(np.diff(costs) < 1e-6)
    assert costs[-1] == pytest.approx(10.4931, abs=2e-4)


def test_there_and_back() -> None:
    plan = sm.plan(sm.sample_problem(duration=2.0, null_motion=sm.PolynomialNullMotion(7)))
    assert plan.certificate.verified
    assert plan.report.cost < plan.report.initial_cost


def test_without_the_velocity_term_joints_race(sample: sm.Plan) -> None:
    """Why the paper adds the term: manipulability alone is bought with any joint speed."""
    alone = dataclasses.replace(sm.sample_problem(), costs=[sm.Manipulability()])
    plan = sm.plan(alone, max_evaluations=100)
    assert np.abs(plan.trajectory.qd).max() > 2.0 * np.abs(sample.trajectory.qd).max()
    assert plan.report.cost < plan.report.initial_cost


@pytest.mark.parametrize("task", [None, "pose", "position", "pointing"])
def test_evaluations_to_the_optimum(panda_circle: Circle, task: str | None) -> None:
    """Within 1 % after at most 6 evaluations, within 1e-6 after at most 15, on one grid."""
    problem = sm.sample_problem() if task is None else panda_circle(task)
    tight = sm.QuasiNewton(tolerance=1e-13, line_search=sm.LineSearch(sigma=0.1))
    best = _first_grid(sm.plan(problem, optimizer=tight))[-1].cost
    history = _first_grid(sm.plan(problem))
    near = next(i.evaluations for i in history if i.cost <= best * 1.01)
    converged = next(i.evaluations for i in history if i.cost <= best * (1 + 1e-6))
    assert near <= 6
    assert converged <= 15


def _first_grid(plan: sm.Plan) -> list[sm.Iteration]:
    """Return the iterations up to the second grid's start (a record without a step)."""
    history = plan.report.history
    end = next((k for k in range(1, len(history)) if history[k].step == 0.0), len(history))
    return list(history[:end])


@pytest.mark.parametrize("task", ["pose", "position", "pointing"])
def test_panda_circle_is_followed_to_a_micrometre(panda_circle: Circle, task: str) -> None:
    """On a grid of its own, with yourdfpy's kinematics instead of Pinocchio's."""
    plan = sm.plan(panda_circle(task))
    assert plan.certificate.verified
    assert plan.report.cost < plan.report.initial_cost
    assert plan.report.evaluations <= 35
    oracle = yourdfpy.URDF.load(plan.robot.urdf.source, load_meshes=False, build_scene_graph=True)
    fingers = [0.0] * (len(oracle.actuated_joint_names) - 7)
    for t in np.linspace(0, 4, 173):
        oracle.update_cfg([*plan.trajectory(t), *fingers])
        actual = oracle.get_transform(plan.robot.tool, oracle.base_link)
        pose = plan.path.pose(float(t))
        assert np.linalg.norm(actual[:3, 3] - pose.translation) < 1e-6
        if task == "pose":
            assert np.abs(actual[:3, :3] - pose.rotation).max() < 1e-6
        elif task == "pointing":
            assert np.abs(actual[:3, 2] - pose.rotation[:, 2]).max() < 1e-6


def test_certificate_equals_an_independent_recomputation(
    case: tuple[sm.RobotModel, sm.Task, Array, sm.Path],
) -> None:
    robot, task, start, path = case
    plan = sm.plan(sm.Problem(robot, path, task, start))
    certificate = plan.certificate
    t = np.concatenate(
        [
            np.linspace(a, b, 5, endpoint=False)
            for a, b in zip(plan.trajectory.t[:-1], plan.trajectory.t[1:], strict=True)
        ]
        + [plan.trajectory.t[-1:]]
    )
    misses, singular, margins, ratios = [], [], [], []
    for time in t:
        q, qd = plan.trajectory(time), plan.trajectory(time, order=1)
        misses.append(task.miss(path.pose(time), robot.pose(q)))
        jacobian = robot.task_jacobian(q, task)
        singular.append(np.sqrt(np.linalg.eigvalsh(jacobian @ jacobian.T)[0]))
        margins.append(min((q - robot.lower).min(), (robot.upper - q).min()))
        ratios.append((np.abs(qd) / robot.velocity_limit).max())
    position, rotation = np.max(misses, axis=0)
    # Errors are bounds at all times: never milder than what is found here, and near it.
    assert position - ROUNDING <= certificate.position_error.value <= 1.5 * position + ROUNDING
    assert rotation - 1e-9 <= certificate.rotation_error.value <= 1.5 * rotation + 1e-9
    assert certificate.smallest_singular_value.value == pytest.approx(min(singular), rel=1e-6)
    # Limits are judged between these times as well: never milder than here, and hardly stricter.
    assert min(margins) - 1e-5 <= certificate.limit_margin.value <= min(margins) + ROUNDING
    assert max(ratios) - ROUNDING <= certificate.velocity_ratio.value <= max(ratios) * (1 + 1e-3)
    assert certificate.samples >= 8 * (len(plan.trajectory.t) - 1)
    assert certificate.position_error.value <= 1e-6
    assert certificate.rotation_error.value <= 1e-6


def broken(plan: sm.Plan, **changes: Array) -> sm.Certificate:
    trajectory = dataclasses.replace(plan.trajectory, **changes)
    return sm.certify(plan.robot, plan.path, plan.task, trajectory)


def test_broken_plans_are_refused(panda_circle: Circle) -> None:
    plan = sm.plan(panda_circle())
    motion = plan.trajectory
    assert broken(plan).verified

    q = motion.q.copy()
    q[60, 2] += 1e-4
    certificate = broken(plan, q=q)
    assert not certificate.verified
    assert "off the path" in certificate.verdict
    assert certificate.position_error.time == pytest.approx(motion.t[60], abs=0.1)

    qd = motion.qd.copy()
    qd[60, 2] += 0.1
    assert not broken(plan, qd=qd).verified

    assert "lasts" in broken(plan, t=motion.t * 0.9).verdict

    shifted = motion.q.copy()
    shifted[:, 6] += 3.0
    assert "joint 'panda_joint7' is" in broken(plan, q=shifted).verdict


def test_too_fast_plans_are_refused_with_the_factor(panda: sm.RobotModel) -> None:
    start = panda.dexterous_configuration()
    path = sm.Circle.around(panda.pose(start), 0.15, 0.8, normal=(1, 0, 0))
    plan = sm.plan(sm.Problem(panda, path, start=start))
    assert "times its limit" in plan.certificate.verdict
    assert plan.certificate.position_error.value <= 1e-6
    with pytest.raises(sm.PlanError, match="times the duration"):
        plan.require()


def test_verified_plans_pass_require(sample: sm.Plan) -> None:
    assert sample.require() is sample


def test_start_off_the_path_is_refused_with_the_miss(panda_circle: Circle) -> None:
    problem = panda_circle()
    off = np.asarray(problem.start) + np.array([0, 0, 0, 0, 0, 0.01, 0])
    with pytest.raises(sm.StartError, match=r"m and 0\.01 rad off the start") as caught:
        dataclasses.replace(problem, start=off)
    assert caught.value.rotation_miss == pytest.approx(0.01, rel=1e-3)
    assert caught.value.position_miss > 1e-4


def test_missing_start_is_found(panda_circle: Circle) -> None:
    problem = dataclasses.replace(panda_circle(), start=None)
    plan = sm.plan(problem)
    pose = problem.path.pose(0.0)
    assert max(sm.Task.POSE.miss(pose, plan.robot.pose(plan.trajectory.q[0]))) < 1e-9


def test_no_redundancy_is_refused() -> None:
    ur5 = sm.load_robot("ur5")
    pose = ur5.pose(ur5.dexterous_configuration())
    with pytest.raises(sm.RedundancyError, match="6 joints and task 'pose' with 6 rows") as caught:
        sm.Problem(ur5, sm.Circle.around(pose, 0.1, 1.0))
    assert (caught.value.dof, caught.value.rows) == (6, 6)


@pytest.mark.parametrize(
    ("name", "task"), [("planar_3r", "pose"), ("planar_3r", "position"), ("panda", "planar_pose")]
)
def test_rows_the_arm_cannot_move_in_are_refused(name: str, task: str) -> None:
    robot = sm.load_robot(name)
    pose = robot.pose(robot.dexterous_configuration("planar"))
    with pytest.raises(sm.ProblemError, match="choose another task"):
        sm.Problem(robot, sm.Circle.around(pose, 0.1, 1.0), task)


def test_planar_pose_with_three_joints_has_no_freedom(planar: sm.RobotModel) -> None:
    assert planar.can_follow("planar_pose")
    assert planar.redundancy("planar_pose") == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": "posture"}, "unknown task 'posture'"),
        ({"costs": ()}, "no cost is given"),
        ({"costs": ["x"]}, "costs: 'x' is no Cost"),
        ({"robot": "panda"}, "expected a RobotModel"),
        ({"path": None}, "expected a Path"),
        ({"null_motion": "cubic"}, "null_motion is 'cubic'"),
        ({"constraints": [3]}, "constraints: 3 is no Constraint"),
        ({"costs": [sm.PathLength(float("inf"))]}, "smoothing is inf"),
        ({"costs": [sm.JointVelocity(), sm.JointVelocity()]}, "two costs are called"),
        ({"costs": [sm.JointVelocity([1.0, 2.0])]}, r"weight has shape \(2,\)"),
        ({"costs": [sm.InverseManipulability(-1.0)]}, "mu is -1.0"),
        ({"costs": [sm.Manipulability(float("nan"))]}, "mu is nan"),
    ],
)
def test_bad_problems_are_refused(
    panda_circle: Circle, change: dict[str, object], message: str
) -> None:
    with pytest.raises(sm.ProblemError, match=message):
        dataclasses.replace(panda_circle(), **change)


@pytest.mark.parametrize("weight", [-1.0, [[0.0, 1.0], [0.0, 0.0]], float("inf")])
def test_bad_weights_are_refused(weight: object) -> None:
    with pytest.raises(sm.ProblemError, match="weight"):
        sm.JointVelocity(weight)


@pytest.mark.parametrize("degree", [-1, 1.5])
def test_bad_null_motions_are_refused(degree: object) -> None:
    with pytest.raises(sm.ProblemError, match="degree"):
        sm.PolynomialNullMotion(degree)
    with pytest.raises(sm.ProblemError, match="space"):
        sm.PolynomialNullMotion(space="task")
    with pytest.raises(sm.ProblemError, match="basis"):
        sm.PolynomialNullMotion(basis="fourier")


def test_one_cost_may_stand_without_a_list(panda_circle: Circle) -> None:
    assert len(panda_circle(costs=sm.JointVelocity()).costs) == 1


@pytest.mark.parametrize("limit", [0, -5])
def test_bad_limits_and_tolerances_are_refused(limit: int) -> None:
    with pytest.raises(sm.ProblemError, match="max_evaluations"):
        sm.plan(sm.sample_problem(), max_evaluations=limit)
    with pytest.raises(sm.ProblemError, match="tolerance: position"):
        sm.Tolerance(limit, 1.0)


def test_user_function_equals_the_built_in_cost(sample: sm.Plan) -> None:
    def half_square(qd: Array, q: Array, t: Array) -> Array:
        return 0.5 * (qd**2).sum(axis=1)

    exact = sm.FunctionCost(half_square, lambda qd, q, t: (qd, np.zeros_like(q)), name="mine")
    problem = sm.sample_problem()
    for cost in (exact, sm.FunctionCost(half_square)):
        costs = [cost, sm.InverseManipulability()]
        plan = sm.plan(dataclasses.replace(problem, costs=costs))
        assert plan.report.cost == pytest.approx(sample.report.cost, rel=1e-8)


def test_user_functions_of_the_wrong_shape_are_named() -> None:
    problem = sm.sample_problem()
    wrong = sm.FunctionCost(lambda qd, q, t: qd, name="mine")
    with pytest.raises(sm.ProblemError, match="cost 'mine' returned shape"):
        sm.plan(dataclasses.replace(problem, costs=[wrong]))
    half = sm.FunctionCost(lambda qd, q, t: t, lambda qd, q, t: (qd, t), name="mine")
    with pytest.raises(sm.ProblemError, match="cost 'mine': its gradient has shape"):
        sm.plan(dataclasses.replace(problem, costs=[half]))


def test_breakdown_names_the_time(planar: sm.RobotModel) -> None:
    """Nearly stretched: what is left of the path is not worth a plan."""
    start = planar.inverse_kinematics(planar.pose([0.0, 0.05, 0.05]), "planar")
    pose = planar.pose(start)
    end = pose.copy()
    end.translation = pose.translation * 1.5
    line = sm.Line(pose, end, 1.0, time_law="constant")
    with pytest.raises(sm.BreakdownError, match="singular pose near t =") as caught:
        sm.plan(sm.Problem(planar, line, "planar", start))
    assert 0.0 < caught.value.time < 0.01


def test_interruption_returns_the_best_so_far() -> None:
    def interrupt(step: sm.Iteration) -> None:
        if step.evaluations >= 3:
            raise KeyboardInterrupt

    plan = sm.plan(sm.sample_problem(), callback=interrupt)
    assert plan.report.status is sm.Status.INTERRUPTED
    assert plan.report.cost < plan.report.initial_cost
    assert plan.certificate.position_error.value < 1e-6


def test_plans_repeat_bit_for_bit(sample: sm.Plan) -> None:
    again = sm.plan(sm.sample_problem())
    np.testing.assert_array_equal(again.trajectory.q, sample.trajectory.q)
    np.testing.assert_array_equal(again.coefficients, sample.coefficients)


def test_a_free_start_is_no_dearer_than_a_good_given_one() -> None:
    """The dexterous start lies on one of the self-motions that a free start looks along."""
    robot = sm.load_robot("panda")
    start = robot.dexterous_configuration()
    for task, normal in (("pose", (1.0, 0.0, 0.0)), ("position", (0.0, 0.0, 1.0))):
        path = sm.Circle.around(robot.pose(start), 0.1, 4.0, normal=normal)
        given = sm.plan(sm.Problem(robot, path, task, start=start))
        free = sm.plan(sm.Problem(robot, path, task))
        assert free.certificate.verified
        # Rough optima that differ by less are not told apart.
        assert free.report.cost <= 1.01 * given.report.cost
