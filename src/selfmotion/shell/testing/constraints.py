"""The laws of constraints: derivatives, what is judged by what is asked, and series."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import (
    BoundedFunction,
    Finding,
    FinishedMotion,
    MotionSegments,
    QuantityWithinLimits,
    Requirement,
    Shares,
)
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.formulation import bound_conditions, on_path
from selfmotion.planning.paper import Objective, node_tangents
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.planning.search import start_candidates
from selfmotion.problem.constraints import BoundConstraint, Constraint, linearised
from selfmotion.problem.problem import Problem
from selfmotion.shell.testing.laws import GRADIENT, require, require_gradient, saved

# So many starts are looked for where none is given.
_STARTS = 8
_STEPS = 10
# So many intervals of each motion tell whether series are majorants.
_INTERVALS = 8


# Number of nodes of a polynomial fit whose derivatives are compared.
_NODES = 13
# Highest order of derivatives.
_ORDERS = 4
# Sample points of each interval, on [-1, 1].
_PLACES = np.linspace(-1.0, 1.0, 41)
# Rounding error of derivatives, as a share of the series.
_ROUNDING = 1e-6
# Rounding error of values in units of the last place, which derivatives amplify.
_DIGITS = 32.0


def check_majorants(
    function: BoundedFunction, segments: MotionSegments, name: str = "a function"
) -> None:
    """Require of orders k from 1 to 4 that sup |∂ᵏf/∂uᵏ| / k! is at most the k-th of the series.

    Parameters
    ----------
    function : BoundedFunction
        Of which series are known on these segments.
    segments : MotionSegments
    name : str
        What to call it in messages.

    Raises
    ------
    AssertionError
        A derivative is larger: what a verdict says of its function is no proof.
    """
    known = function.series(segments)
    if known is None:
        raise AssertionError(f"{name}: no series on this motion")
    u = np.polynomial.chebyshev.chebpts1(_NODES)
    into = np.linalg.inv(np.polynomial.chebyshev.chebvander(u, _NODES - 1))
    values = function.values(segments, u)
    taken = np.einsum("kp,ipc->kic", into, values)
    wrong = _DIGITS * np.finfo(float).eps * float(np.abs(values).max(initial=0.0))
    for order in range(1, _ORDERS + 1):
        # Derivatives of the polynomial through the nodes: a limit of what rounding leaves.
        slopes = np.polynomial.chebyshev.chebder(taken, order, axis=0)
        found = np.polynomial.chebyshev.chebval(_PLACES, slopes) / math.factorial(order)
        sizes = np.sqrt(np.add.reduceat(found**2, function.blocks, axis=1)).max(axis=2)
        made = np.polynomial.chebyshev.chebder(into, order, axis=0)
        larger = np.abs(np.polynomial.chebyshev.chebval(_PLACES, made)).sum(axis=0).max()
        rounding = wrong * larger / math.factorial(order)
        allowed = known[:, order].T * (1.0 + _ROUNDING) + rounding
        # Written so that NaN fails.
        if not np.all(sizes <= allowed):
            interval, block = np.unravel_index(np.argmax(sizes - allowed), sizes.shape)
            first, last = segments.intervals[interval]
            raise AssertionError(
                f"{name}: series() is no majorant: the derivative of order {order} of number "
                f"{block}, over {order}!, reaches {sizes[interval, block]:.4g} from t = "
                f"{first:.6g} to {last:.6g} s, but the series says "
                f"{known[block, order, interval]:.4g} at most"
            )


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
    formulation = on_path(problem)
    grid = Grid.aligned(formulation.knots, _STEPS * max(1, problem.null_motion.fewest_steps // 4))
    minimum_norm = MinimumNormMotion.on(formulation, start, grid)
    own = constraint.conditions(robot)
    ends = minimum_norm.start, minimum_norm.end
    objective = Objective.of(formulation, minimum_norm, free=True)
    requirement = constraint.requirement(robot)
    require(isinstance(requirement, Requirement), f"requirement() returned {requirement!r}")
    for bound in bound_conditions(formulation, own, *ends).every:
        _check_derivatives(objective, bound)
        _judges_alike(objective, bound, requirement, robot, np.random.default_rng(2))
    saved(constraint, Constraint)


def _check_derivatives(objective: Objective, bound: BoundConstraint) -> None:
    """Require that derivatives of a condition are those of its residual."""
    rng = np.random.default_rng(1)
    x = 0.02 * rng.normal(size=objective.size)
    weights = rng.normal(size=bound.residual(objective.samples(x)).shape)

    def weighed(x: Array) -> float:
        return float(np.sum(weights * bound.residual(objective.samples(x))))

    tangents = bound.tangents(objective.samples(x), node_tangents(objective, x))
    shape = (*weights.shape, objective.size)
    told = f"constraint '{bound.name}': tangents() has shape {np.shape(tangents)}, expected {shape}"
    require(np.shape(tangents) == shape, told)
    exact = np.tensordot(weights, tangents, weights.ndim)
    require_gradient(weighed, lambda _: exact, x, f"constraint '{bound.name}'")
    _known_on_demand(objective, bound, tangents.reshape(-1, objective.size), x)


def _known_on_demand(objective: Objective, bound: BoundConstraint, table: Array, x: Array) -> None:
    """Require that derivatives computed as far as they are asked for are those of the table."""
    motion = node_tangents(objective, x)
    rows, name = linearised(bound, objective.samples(x), motion), f"constraint '{bound.name}'"
    told = f"{name}: linearised_at() knows {rows.count} conditions, expected {len(table)}"
    require(rows.count == len(table), told)
    scale = max(1.0, float(np.abs(table).max(initial=0.0)))
    found = rows.picked(motion, np.arange(len(table)))
    off = float(np.abs(found - table).max(initial=0.0))
    told = f"{name}: linearised_at() is {off:.2e} off what tangents() says"
    require(off <= GRADIENT * scale, told)


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
        require(isinstance(found, Finding), f"judge() returned {found!r}, expected a Finding")
        if (
            isinstance(requirement, QuantityWithinLimits)
            and requirement.quantity.series is not None
        ):
            _majorised(requirement, robot, objective.at(x).trajectory, rng)
        require(
            found.satisfied or not worst <= -bound.tolerance or bound.equality,
            f"'{bound.name}' is kept at all nodes (h ≤ {worst:.3g}), but judged: {found.text}",
        )
        refused += not found.satisfied
    require(refused > 0, f"requirement '{requirement.name}' accepts every motion that was tried")


def _majorised(
    requirement: QuantityWithinLimits,
    robot: RobotModel,
    trajectory: Trajectory,
    rng: np.random.Generator,
) -> None:
    """Require that a quantity's series is above its derivatives on intervals of a motion."""
    shares = Shares(requirement.quantity)
    if not len(shares.blocks):
        return
    t = trajectory.t
    first = t[rng.choice(len(t) - 1, min(_INTERVALS, len(t) - 1), replace=False)]
    step = np.array([t[np.searchsorted(t, time, "right")] - time for time in first])
    ends = np.sort(rng.random((2, len(first))), axis=0) * step + first
    segments = MotionSegments(robot, trajectory, np.stack(ends, axis=1))
    known = shares.series(segments)
    if known is not None:
        check_majorants(shares, segments, f"constraint '{requirement.name}'")
