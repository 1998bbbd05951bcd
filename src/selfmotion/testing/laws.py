"""The laws, one function for each kind of class."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from selfmotion.basics import Array, Saved, restore
from selfmotion.certificate import (
    Finding,
    FinishedMotion,
    QuantityKept,
    Requirement,
    Shares,
    Stretch,
)
from selfmotion.constraints import Constraint
from selfmotion.costs import Cost
from selfmotion.engine import Objective, StillMotion
from selfmotion.motion import Grid, NullMotion, PolynomialNullMotion, Trajectory
from selfmotion.optimise import Iteration, Minimum, Optimizer
from selfmotion.path import Line, Path
from selfmotion.problem import Problem
from selfmotion.robot import RobotModel, load_robot
from selfmotion.search import start_candidates
from selfmotion.task import Task, exp3, log3
from selfmotion.testing.functions import Bowl, Valley
from selfmotion.testing.majorants import check_majorants

# Exact gradients against central differences of F, relative to the largest entry.
GRADIENT = 1e-6
# Twists against central differences of poses [m/s, rad/s]: their truncation and rounding.
TWIST = 1e-6
# Of an optimiser on functions without noise, relative to their scale.
MINIMUM = 1e-4
# So many starts are looked for where none is given.
_STARTS = 8
_STEPS = 10
# So many intervals of each motion tell whether series are majorants.
_INTERVALS = 8


def check_path(path: Path) -> None:
    """Check a path: poses are rigid, twists their derivatives, knots in order, and it can be saved.

    Raises
    ------
    AssertionError
        A law is broken; says which one, and when.
    """
    knots = np.asarray(path.knots)
    _require(knots[0] == 0.0 and knots[-1] == path.duration, f"knots are {knots[0]} to {knots[-1]}")
    _require(bool(np.all(np.diff(knots) > 0.0)), "knots do not increase")
    step = 1e-5 * float(np.diff(knots).min())
    shares = np.linspace(0.1, 0.9, 7)
    t = np.concatenate([a + (b - a) * shares for a, b in pairwise(knots)])
    before, here, after = (path.samples(time) for time in (t - step, t, t + step))
    for array, shape in (
        (here.translation, (len(t), 3)),
        (here.rotation, (len(t), 3, 3)),
        (here.twist, (len(t), 6)),
    ):
        _require(array.shape == shape, f"arrays have shape {array.shape}, expected {shape}")
    gram = here.rotation @ here.rotation.transpose(0, 2, 1)
    _near(gram, np.broadcast_to(np.eye(3), gram.shape), 1e-9, "rotations are not orthonormal", t)
    linear = (after.translation - before.translation) / (2.0 * step)
    turns = after.rotation @ before.rotation.transpose(0, 2, 1)
    angular = np.array([log3(turn) for turn in turns]) / (2.0 * step)
    scale = max(1.0, float(np.abs(here.twist).max()))
    _near(here.twist[:, :3], linear, TWIST * scale, "velocity is not that of the position", t)
    _near(here.twist[:, 3:], angular, TWIST * scale, "ω is not that of the orientation", t)
    again = _saved(path, Path)
    _near(again.samples(t).translation, here.translation, 1e-12, "loaded, it is elsewhere", t)


def check_cost(cost: Cost, robot: RobotModel | None = None, task: Task | str = Task.POSE) -> None:
    """Check a cost: one number per sample, exact gradients, arrays left alone, and it can be saved.

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
    _require(value.shape == samples.t.shape, f"G has shape {value.shape}, expected one per sample")
    _require(bool(np.all(np.isfinite(value))), "G is not finite")
    _gradient(objective.value, objective.gradient, x, f"cost '{cost.name}'")
    _saved(cost, Cost, robot=problem.robot)


def check_null_motion(motion: NullMotion) -> None:
    """Check a null motion: finite and independent functions, and it can be saved.

    Raises
    ------
    AssertionError
        A law is broken; says which one.
    """
    _require(motion.space in ("null", "joint"), f"space is '{motion.space}'")
    t = np.linspace(0.0, 2.5, max(64, 4 * motion.fewest_steps))
    functions = np.asarray(motion.functions(t, 2.5))
    _require(functions.ndim == 2 and len(functions) == len(t), f"shape is {functions.shape}")
    _require(bool(np.all(np.isfinite(functions))), "functions are not finite")
    count = functions.shape[1]
    rank = int(np.linalg.matrix_rank(functions))
    _require(rank == count, f"{count} functions span only {rank} dimensions")
    again = _saved(motion, NullMotion)
    _near(again.functions(t, 2.5), functions, 1e-12, "loaded, it has other functions", t)


def check_constraint(constraint: Constraint, problem: Problem) -> None:
    """Check a constraint: its derivatives, and that its requirement says what its conditions say.

    Motions of growing self-motion are made; where the conditions are kept at all nodes, the
    requirement has to be kept there, and some of the motions have to be refused. The `series` of a
    `Quantity` has to be above its derivatives along them: a verdict is a proof only as far as that
    is so everywhere, of which this is a sample.

    Parameters
    ----------
    constraint : Constraint
    problem : Problem
        On which it can be kept and broken; its own constraints are left out.

    Raises
    ------
    AssertionError
        A law is broken; says which one.
    """
    robot = problem.robot
    # Conditions on the velocity at the ends have to be broken here.
    problem = replace(problem, rest=False)
    constraint.check(problem.follows)
    start = problem.given_start
    if start is None:
        start = start_candidates(problem.follows, _STARTS, np.random.default_rng(0))[0]
    grid = Grid.aligned(problem.knots, _STEPS * max(1, problem.null_motion.fewest_steps // 4))
    still = StillMotion.on(problem, start, grid)
    bound = constraint.bind(problem.follows, still.start, still.end)
    objective = Objective.of(problem, still, free=True, constraints=[bound])
    requirement = constraint.requirement(robot)
    _require(isinstance(requirement, Requirement), f"requirement() returned {requirement!r}")
    rng = np.random.default_rng(1)
    x = 0.02 * rng.normal(size=objective.size)
    weights = rng.normal(size=bound.residual(objective.samples(x)).shape)

    def weighed(x: Array) -> float:
        return float(np.sum(weights * bound.residual(objective.samples(x))))

    tangents = bound.tangents(objective.samples(x), objective.node_tangents(x))
    shape = (*weights.shape, objective.size)
    told = f"constraint '{bound.name}': tangents() has shape {np.shape(tangents)}, expected {shape}"
    _require(np.shape(tangents) == shape, told)
    exact = np.tensordot(weights, tangents, weights.ndim)
    _gradient(weighed, lambda _: exact, x, f"constraint '{bound.name}'")
    _known_on_demand(objective, bound.name, tangents.reshape(-1, objective.size), x)
    _judges_alike(objective, bound, requirement, robot, rng)
    _saved(constraint, Constraint)


def _known_on_demand(objective: Objective, name: str, table: Array, x: Array) -> None:
    """Require that derivatives computed as far as they are asked for are those of the table."""
    objective.conditions(x)
    rows = objective.condition_rows(x)
    ones, scale = np.ones(objective.size), max(1.0, float(np.abs(table).max(initial=0.0)))
    for found, expected in (
        (rows.picked(np.arange(len(table))), table),
        (rows.along(ones), table @ ones),
    ):
        off = float(np.abs(found - expected).max(initial=0.0))
        _require(
            off <= GRADIENT * scale,
            f"constraint '{name}': linearised_at() is {off:.2e} off what tangents() says",
        )


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
        _require(gap <= MINIMUM * scale, f"{name}: ends {gap:.2e} above the minimum")
        _require(found.cost == function.value(found.x), f"{name}: the cost is not F(x)")
        costs = [iteration.cost for iteration in history]
        _require(bool(costs), f"{name}: the callback was never called")
        _require(found.cost <= min(costs), f"{name}: worse than a point on the way")
    limited = Valley()
    start = np.array([-1.2, 1.0])
    few = optimizer.minimize(limited, start, max_evaluations=3)
    # The limit is looked at between steps; a gradient may stand for one more.
    _require(limited.evaluations <= 4, f"took {limited.evaluations} evaluations, allowed 3")
    _require(few.cost <= Valley().value(start), "ends worse than it began")
    stopped: Minimum = optimizer.minimize(Valley(), start, callback=lambda _: True)
    _require(len(stopped.history) <= 1, "went on though the callback asked to stop")


def _judges_alike(
    objective: Objective,
    bound: Any,
    requirement: Requirement,
    robot: RobotModel,
    rng: np.random.Generator,
) -> None:
    """Check that what the conditions allow is kept, and that not every motion is."""
    refused = 0
    for size in np.geomspace(1e-3, 10.0, 16):
        x = size * rng.normal(size=objective.size)
        if not np.isfinite(sum(objective.terms(x).values())):
            continue
        h = bound.residual(objective.samples(x))
        worst = float(np.max(np.abs(h) if bound.equality else h))
        found = requirement.judge(FinishedMotion(robot, objective.at(x).trajectory))
        _require(isinstance(found, Finding), f"judge() returned {found!r}, expected a Finding")
        if isinstance(requirement, QuantityKept) and requirement.quantity.series is not None:
            _majorised(requirement, robot, objective.at(x).trajectory, rng)
        _require(
            found.kept or not worst <= -bound.tolerance or bound.equality,
            f"'{bound.name}' is kept at all nodes (h ≤ {worst:.3g}), but judged: {found.text}",
        )
        refused += not found.kept
    _require(refused > 0, f"requirement '{requirement.name}' accepts every motion that was tried")


def _majorised(
    requirement: QuantityKept, robot: RobotModel, trajectory: Trajectory, rng: np.random.Generator
) -> None:
    """Require that a quantity's series is above its derivatives on intervals of a motion."""
    shares = Shares(requirement.quantity)
    if not len(shares.blocks):
        return
    t = trajectory.t
    first = t[rng.choice(len(t) - 1, min(_INTERVALS, len(t) - 1), replace=False)]
    step = np.array([t[np.searchsorted(t, time, "right")] - time for time in first])
    ends = np.sort(rng.random((2, len(first))), axis=0) * step + first
    stretch = Stretch(robot, trajectory, np.stack(ends, axis=1))
    known = shares.series(stretch)
    if known is not None:
        check_majorants(shares, stretch, f"constraint '{requirement.name}'")


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
    grid = Grid.aligned(problem.knots, _STEPS)
    return Objective.of(problem, StillMotion.on(problem, start, grid))


def _gradient(
    value: Callable[[Array], float], gradient: Callable[[Array], Array], x: Array, what: str
) -> None:
    exact, differences = np.array(gradient(x)), np.empty_like(x)
    for i in range(len(x)):
        shift = np.zeros_like(x)
        shift[i] = 1e-5
        differences[i] = (value(x + shift) - value(x - shift)) / 2e-5
    # Where the self-motion leaves a value unchanged, its rounding remains.
    scale = max(float(np.abs(differences).max()), 1e-2 * abs(value(x)))
    _near(exact, differences, GRADIENT * scale, f"{what}: gradient is not that of the value")


def _saved(value: Any, family: type[Saved], **context: Any) -> Any:
    """Return a value after a way through a file's text; the family's restore reads it."""
    description = json.loads(json.dumps(value.to_dict()))
    again = restore(family, description, **context)
    _require(type(again) is type(value), f"loaded, it is a {type(again).__name__}")
    _require(again.to_dict() == value.to_dict(), "loaded, it describes itself differently")
    return again


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise AssertionError(message)


def _near(
    actual: Array, expected: Array, tolerance: float, message: str, t: Array | None = None
) -> None:
    miss = np.abs(actual - expected)
    # Written so that NaN fails.
    if not np.all(miss <= tolerance):
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(miss, nan=np.inf))), miss.shape)
        when = "" if t is None else f" at t = {t[worst[0]]:.6g} s"
        raise AssertionError(
            f"{message}{when}: {actual[worst]:.9g} against {expected[worst]:.9g} (off by "
            f"{miss[worst]:.2e}, allowed {tolerance:.1e})"
        )
