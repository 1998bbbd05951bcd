"""The laws, one function for each kind of class."""

import json
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from selfmotion.basics import Array, Saved, read_only, restore
from selfmotion.model.motion import Grid, NullMotion, PolynomialNullMotion, Sampling
from selfmotion.model.path import Line, Path
from selfmotion.model.robot import RobotModel, load_robot
from selfmotion.model.task import Task, exp3, log3
from selfmotion.planning.formulation import on_path
from selfmotion.planning.optimise import Iteration, Minimum, Optimizer
from selfmotion.planning.paper import Objective
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.problem.costs import Cost, Samples
from selfmotion.problem.problem import Problem

# Exact gradients against central differences of F, relative to the largest entry.
GRADIENT = 1e-6


def require_gradient(
    value: Callable[[Array], float], gradient: Callable[[Array], Array], x: Array, what: str
) -> None:
    """Require that a gradient is that of a value at x, by central differences."""
    exact, differences = np.array(gradient(x)), np.empty_like(x)
    for i in range(len(x)):
        shift = np.zeros_like(x)
        shift[i] = 1e-5
        differences[i] = (value(x + shift) - value(x - shift)) / 2e-5
    # Where the self-motion leaves a value unchanged, its rounding remains.
    scale = max(float(np.abs(differences).max()), 1e-2 * abs(value(x)))
    near(exact, differences, GRADIENT * scale, f"{what}: gradient is not that of the value")


def saved(value: Any, family: type[Saved], **context: Any) -> Any:
    """Return a value after a way through a file's text; the family's restore reads it."""
    description = json.loads(json.dumps(value.to_dict()))
    again = restore(family, description, **context)
    require(type(again) is type(value), f"loaded, it is a {type(again).__name__}")
    require(again.to_dict() == value.to_dict(), "loaded, it describes itself differently")
    return again


def require(condition: bool, message: str) -> None:
    """Raise AssertionError unless a condition holds."""
    if not condition:
        raise AssertionError(message)


def near(
    actual: Array, expected: Array, tolerance: float, message: str, t: Array | None = None
) -> None:
    """Require that numbers are near others; says which is worst, and at which of times t."""
    miss = np.abs(actual - expected)
    # Written so that NaN fails.
    if not np.all(miss <= tolerance):
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(miss, nan=np.inf))), miss.shape)
        when = "" if t is None else f" at t = {t[worst[0]]:.6g} s"
        raise AssertionError(
            f"{message}{when}: {actual[worst]:.9g} against {expected[worst]:.9g} (off by "
            f"{miss[worst]:.2e}, allowed {tolerance:.1e})"
        )


# Twists against central differences of poses [m/s, rad/s]: their truncation and rounding.
TWIST = 1e-6
# Of an optimiser on functions without noise, relative to their scale.
MINIMUM = 1e-4
# Of a quadratic form, relative to its largest derivative; of G among other samples.
CURVATURE = 1e-9
_STEPS = 10


class Bowl:
    """½ (x - 1)ᵀ A (x - 1) + offset, with condition number 100."""

    def __init__(self, offset: float) -> None:
        self._hessian, self._offset = np.diag(np.geomspace(1.0, 100.0, 4)), offset
        self.evaluations = 0

    def value(self, x: Array) -> float:
        """See `Function`."""
        self.evaluations += 1
        return float(0.5 * (x - 1.0) @ self._hessian @ (x - 1.0)) + self._offset

    def gradient(self, x: Array) -> Array:
        """See `Function`."""
        return np.asarray(self._hessian @ (x - 1.0))

    def slope(self, x: Array, direction: Array) -> float:
        """See `Function`."""
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        """See `Function`."""
        return read_only(np.eye(len(x)))


class Valley:
    """Rosenbrock's function, with its least value 1."""

    def __init__(self) -> None:
        self.evaluations = 0

    def value(self, x: Array) -> float:
        """See `Function`."""
        self.evaluations += 1
        return float((1.0 - x[0]) ** 2 + 100.0 * (x[1] - x[0] ** 2) ** 2) + 1.0

    def gradient(self, x: Array) -> Array:
        """See `Function`."""
        across = x[1] - x[0] ** 2
        return np.array([-2.0 * (1.0 - x[0]) - 400.0 * x[0] * across, 200.0 * across])

    def slope(self, x: Array, direction: Array) -> float:
        """See `Function`."""
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        """See `Function`."""
        return read_only(np.eye(2))


def check_path(path: Path) -> None:
    """Check a path: poses are rigid, twists their derivatives, knots in order, and it can be saved.

    Raises
    ------
    AssertionError
        A law is broken; says which one, and when.
    """
    knots = np.asarray(path.knots)
    require(knots[0] == 0.0 and knots[-1] == path.duration, f"knots are {knots[0]} to {knots[-1]}")
    require(bool(np.all(np.diff(knots) > 0.0)), "knots do not increase")
    step = 1e-5 * float(np.diff(knots).min())
    shares = np.linspace(0.1, 0.9, 7)
    t = np.concatenate([a + (b - a) * shares for a, b in pairwise(knots)])
    before, here, after = (path.samples(time) for time in (t - step, t, t + step))
    for array, shape in (
        (here.translation, (len(t), 3)),
        (here.rotation, (len(t), 3, 3)),
        (here.twist, (len(t), 6)),
    ):
        require(array.shape == shape, f"arrays have shape {array.shape}, expected {shape}")
    gram = here.rotation @ here.rotation.transpose(0, 2, 1)
    near(gram, np.broadcast_to(np.eye(3), gram.shape), 1e-9, "rotations are not orthonormal", t)
    linear = (after.translation - before.translation) / (2.0 * step)
    turns = after.rotation @ before.rotation.transpose(0, 2, 1)
    angular = np.array([log3(turn) for turn in turns]) / (2.0 * step)
    scale = max(1.0, float(np.abs(here.twist).max()))
    near(here.twist[:, :3], linear, TWIST * scale, "velocity is not that of the position", t)
    near(here.twist[:, 3:], angular, TWIST * scale, "ω is not that of the orientation", t)
    again = saved(path, Path)
    near(again.samples(t).translation, here.translation, 1e-12, "loaded, it is elsewhere", t)


def check_cost(cost: Cost, robot: RobotModel | None = None, task: Task | str = Task.POSE) -> None:
    """Check a cost: one number per sample, exact derivatives, arrays left alone, it is saved.

    Parameters
    ----------
    cost : Cost
    robot : RobotModel, optional
        By default a Panda.
    task : Task or str

    Raises
    ------
    AssertionError
        A law is broken; says which one.
    """
    problem = _problem(robot or load_robot("panda"), Task.of(task), costs=[cost])
    objective = _objective(problem)
    x = 0.05 * np.random.default_rng(0).normal(size=objective.size)
    samples = objective.samples(x)
    value = np.asarray(cost.value(samples))
    require(value.shape == samples.t.shape, f"G has shape {value.shape}, expected one per sample")
    require(bool(np.all(np.isfinite(value))), "G is not finite")
    require_gradient(objective.value, objective.gradient, x, f"cost '{cost.name}'")
    if cost.is_quadratic:
        _require_curvature(cost, objective, x)
    if cost.is_pointwise:
        _require_pointwise(cost, objective.samples(x))
    saved(cost, Cost, robot=problem.robot)


def _require_pointwise(cost: Cost, samples: Samples) -> None:
    """Require that G at every second sample is what it is among all of them."""
    rows = np.arange(0, len(samples.t), 2)
    every = Sampling(samples.t[rows], samples.weights[rows], np.arange(len(rows)))
    tips = tuple(tip.at(rows) for tip in samples.tips)
    given = samples.q[rows], samples.qd[rows], samples.follows, tips, samples.task_jacobian[rows]
    some = Samples(every, *given)
    # In place of differences between the samples.
    some.__dict__.update(qdd=samples.qdd[rows], qddd=samples.qddd[rows])
    what = f"cost '{cost.name}': is_pointwise, but G depends on other samples"
    pairs = [(np.asarray(cost.value(samples)), np.asarray(cost.value(some)))]
    whole, part = cost.gradient(samples), cost.gradient(some)
    names = ("q", "qd", "qdd", "qddd", "error")
    slopes = ((getattr(whole, name), getattr(part, name)) for name in names)
    pairs += [(by, own) for by, own in slopes if by is not None and own is not None]
    for among, alone in pairs:
        near(alone, among[rows], CURVATURE * max(1e-9, float(np.abs(among).max())), what, some.t)


def _require_curvature(cost: Cost, objective: Objective, x: Array) -> None:
    """Require that `curvature` is all that bends: ∂G of one motion less that of another is W Δx."""
    names, known = ("q", "qd", "qdd", "qddd"), cost.curvature(objective.samples(x).q.shape[1])
    both = []
    for motion in (x, -2.0 * x):
        samples = objective.samples(motion)
        by = cost.gradient(samples)
        # Copies: the arrays are the objective's own.
        slopes = [None if (own := getattr(by, k)) is None else np.array(own) for k in names]
        both.append(
            [(np.array(getattr(samples, k)), own) for k, own in zip(names, slopes, strict=True)]
        )
    for order, ((q, by), (other, by_other)) in enumerate(zip(*both, strict=True)):
        weight = known.get(order, np.zeros(2 * q.shape[1:]))
        after, before = (np.zeros_like(q) if one is None else one for one in (by_other, by))
        expected = (other - q) @ weight
        scale = max(float(np.abs(each).max()) for each in (after, before, expected))
        what = f"cost '{cost.name}': curvature() of order {order} is not that of the gradient"
        near(after - before, expected, CURVATURE * scale, what)


def check_null_motion(motion: NullMotion) -> None:
    """Check a null motion: finite and independent functions, and it can be saved.

    Raises
    ------
    AssertionError
        A law is broken; says which one.
    """
    require(motion.space in ("null", "joint"), f"space is '{motion.space}'")
    t = np.linspace(0.0, 2.5, max(64, 4 * motion.fewest_steps))
    functions = np.asarray(motion.functions(t, 2.5))
    require(functions.ndim == 2 and len(functions) == len(t), f"shape is {functions.shape}")
    require(bool(np.all(np.isfinite(functions))), "functions are not finite")
    count = functions.shape[1]
    rank = int(np.linalg.matrix_rank(functions))
    require(rank == count, f"{count} functions span only {rank} dimensions")
    again = saved(motion, NullMotion)
    near(again.functions(t, 2.5), functions, 1e-12, "loaded, it has other functions", t)


def check_optimizer(optimizer: Optimizer) -> None:
    """Check an optimiser: it finds minima, is never worse than its start, and stops when told to.

    Raises
    ------
    AssertionError
        A law is broken; says which one.
    """
    for function, x0, best in (
        (Bowl(offset=1.0), np.full(4, 2.0), 1.0),
        # F < 0: relative tolerances have to take its size.
        (Bowl(offset=-50.0), np.full(4, 2.0), -50.0),
        (Valley(), np.array([-1.2, 1.0]), 1.0),
    ):
        history: list[Iteration] = []
        found = optimizer.minimize(function, x0, callback=history.append)
        name = type(function).__name__
        gap, scale = found.cost - best, max(1.0, abs(best))
        require(gap <= MINIMUM * scale, f"{name}: ends {gap:.2e} above the minimum")
        require(found.cost == function.value(found.x), f"{name}: the cost is not F(x)")
        costs = [iteration.cost for iteration in history]
        require(bool(costs), f"{name}: the callback was never called")
        require(found.cost <= min(costs), f"{name}: worse than a point on the way")
    limited = Valley()
    start = np.array([-1.2, 1.0])
    few = optimizer.minimize(limited, start, max_evaluations=3)
    # The limit is looked at between steps; a gradient may stand for one more.
    require(limited.evaluations <= 4, f"took {limited.evaluations} evaluations, allowed 3")
    require(few.cost <= Valley().value(start), "ends worse than it began")
    stopped: Minimum = optimizer.minimize(Valley(), start, callback=lambda _: True)
    require(len(stopped.history) <= 1, "went on though the callback asked to stop")


def _problem(robot: RobotModel, task: Task, **options: Any) -> Problem:
    """Return a short motion that also turns the tool, from a dexterous configuration."""
    start = robot.dexterous_configuration(task)
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.04, 0.03, -0.03])
    end.rotation = exp3(np.array([0.0, 0.0, 0.1])) @ pose.rotation
    motion = PolynomialNullMotion(2, "joint")
    return Problem(robot, Line(pose, end, 1.5), task, start, motion, **options)


def _objective(problem: Problem) -> Objective:
    start = problem.given_start
    if start is None:
        raise RuntimeError("these problems have a start")
    formulation = on_path(problem)
    grid = Grid.aligned(formulation.knots, _STEPS)
    return Objective.of(formulation, MinimumNormMotion.on(formulation, start, grid))
