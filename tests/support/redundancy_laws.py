"""The laws of a redundancy map, each pixel held against Pinocchio, MuJoCo and linear programmes."""

from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.result import Reason, RedundancyMap
from support.redundancy_oracle import Bodies, Coordinate, Kinematics

# Newton's method leaves an error of the square of its last correction of 1e-6 at most [m, rad].
IN_PLACE = 1e-9
# Distances of convex bodies by coal and by MuJoCo agree to this [m].
AGREE = 1e-4
# Pixels at which a linear programme is solved for speeds.
PROGRAMMES = 60
# Speeds agree with linear programmes to this share of their limits.
SHARE = 1e-6
# Longest way of a branch from one pixel to the next, as a multiple of the straight one.
BENT = 1.5
# The share of the largest smallest singular value below which a pose is near a singular one.
NEAR_SINGULAR = 0.05


def faults(plan: sm.Plan, shown: RedundancyMap, bodies: Bodies | None = None) -> list[str]:
    """Return which laws a map breaks, in words; its arm follows one path in the world."""
    known = ~np.isnan(shown.q).any(axis=2)
    checks = [*_misplaced(plan, shown, known), *_limits(plan, shown, known)]
    checks += [*_line(plan, shown), *_singular(plan, shown, known), *_speeds(plan, shown, known)]
    if bodies is not None:
        checks += _bodies(
            shown,
            bodies,
            envelope_of_problem(plan.problem).bodies[0][1],
        )
    if (known == (shown.state == Reason.NO_CONFIGURATION)).any():
        checks.append("'no configuration' where there is one, or the reverse")
    return checks


def _misplaced(plan: sm.Plan, shown: RedundancyMap, known: Any) -> list[str]:
    """Return where the tool is off its place, or the coordinate another one."""
    robot, task, found = plan.robot, plan.task, []
    data, frame = robot.model.createData(), robot.model.getFrameId(robot.tool)
    kinematics = Kinematics(plan.problem, Coordinate.of(shown))
    for i, t in enumerate(shown.times):
        pose, q = plan.path.pose(float(t)), shown.q[i, known[i]]
        for configuration in q:
            pin.framesForwardKinematics(robot.model, data, configuration)
            miss = max(task.miss(pose, data.oMf[frame]))
            if not miss < IN_PLACE:
                found.append(f"the tool is {miss:.3g} off at t = {t:.4g}")
        turn, _, _, places = kinematics.place(q)
        values = kinematics.value(pose.homogeneous, turn, places, q)
        off = values - shown.coordinate[known[i]]
        if kinematics.coordinate.kind != "joint":
            off = (off + np.pi) % (2.0 * np.pi) - np.pi
        if not np.abs(off).max(initial=0.0) < IN_PLACE:
            found.append(f"the coordinate is {np.abs(off).max():.3g} off at t = {t:.4g}")
    return found


def _limits(plan: sm.Plan, shown: RedundancyMap, known: Any) -> list[str]:
    """Return where a reason does not agree with the limits of position."""
    envelope, found = envelope_of_problem(plan.problem), []
    q = np.where(known[:, :, None], shown.q, 0.0)
    beyond = known & ((q > envelope.upper) | (q < envelope.lower)).any(axis=2)
    if ((shown.state == Reason.LIMIT) != beyond).any():
        found.append("'beyond a limit' does not agree with the limits")
    for i, j in np.argwhere(shown.state == Reason.LIMIT):
        name, side = shown.reason(i, j).split("'")[1], shown.reason(i, j).split()[-2]
        k = plan.robot.joint_names.index(name)
        limit = getattr(envelope, side)[k]
        if not (q[i, j, k] - limit) * (1.0 if side == "upper" else -1.0) > 0.0:
            found.append(f"joint '{name}' is not beyond its {side} limit")
    return found


def _line(plan: sm.Plan, shown: RedundancyMap) -> list[str]:
    """Return where the plan's line is on a pixel that stops the arm, or is not the plan's."""
    found = []
    if (shown.plan_state != Reason.ALLOWED).any() and plan.certificate.verified:
        found.append("something stops the plan's own configurations")
    steps = np.diff(shown.coordinate)[0]
    for i, value in enumerate(shown.plan_line):
        near = np.abs(shown.coordinate - value) <= steps
        if not shown.allowed[i, near].any():
            found.append(f"the plan's line is on pixels that are not allowed, column {i}")
        own = plan.trajectory(shown.times[i : i + 1])[0]
        upper = int(np.clip(np.searchsorted(shown.coordinate, value), 1, len(shown.coordinate) - 1))
        below, above = shown.q[i, upper - 1], shown.q[i, upper]
        way = np.linalg.norm(above - below)
        # Where the branch turns back beside the plan, it has one of them only.
        if np.isnan(way):
            continue
        # Between the two pixels around it; a curve is longer than its chord.
        if not max(np.linalg.norm(own - q) for q in (below, above)) < BENT * way:
            found.append(f"the plan's configuration is not between its pixels, column {i}")
    return found


def _singular(plan: sm.Plan, shown: RedundancyMap, known: Any) -> list[str]:
    if plan.problem.relaxations:
        return []
    jacobians = plan.robot.task_jacobian(shown.q[known], plan.task)
    smallest = np.linalg.svd(jacobians, compute_uv=False)[:, -1]
    state, least = shown.state[known], NEAR_SINGULAR * smallest.max()
    near = state == Reason.SINGULAR
    # Within a thousandth of the threshold rounding decides.
    wrong = near & (smallest > 1.001 * least)
    clear = np.isin(state, (Reason.ALLOWED, Reason.SPEED)) & (smallest < 0.999 * least)
    return ["'near singular' does not agree with singular values"] if (wrong | clear).any() else []


def _speeds(plan: sm.Plan, shown: RedundancyMap, known: Any) -> list[str]:
    """Return whether linear programmes say otherwise of speeds at some pixels."""
    limit = envelope_of_problem(plan.problem).speed
    follows = Formulation.of(plan.problem).follows
    if shown.redundancy != 1:
        return (
            ["speeds of more degrees are no reason"] if (shown.state == Reason.SPEED).any() else []
        )
    asked = np.argwhere(known & np.isin(shown.state, (Reason.ALLOWED, Reason.SPEED)))
    every = max(1, len(asked) // PROGRAMMES)
    bounded = np.isfinite(limit)
    for i, j in asked[::every]:
        jacobian = follows.jacobian(shown.q[i, j])
        twist = follows.twists(shown.times[i : i + 1])[0]
        # The least share s of the limits with J q̇ = ẋ and |q̇| ≤ s v.
        n = jacobian.shape[1]
        eye, over = np.eye(n)[bounded], -limit[bounded][:, None]
        answer = linprog(
            np.append(np.zeros(n), 1.0),
            A_ub=np.block([[eye, over], [-eye, over]]),
            b_ub=np.zeros(2 * bounded.sum()),
            A_eq=np.hstack([jacobian, np.zeros((len(jacobian), 1))]),
            b_eq=twist,
            bounds=[*[(None, None)] * n, (0.0, None)],
        )
        assert answer.status == 0
        fast = shown.state[i, j] == Reason.SPEED
        if fast != (answer.fun > 1.0) and abs(answer.fun - 1.0) > SHARE:
            return [
                f"a share of {answer.fun:.6g} of the speeds is {'too fast' if fast else 'kept'}"
            ]
    return []


def _bodies(shown: RedundancyMap, bodies: Bodies, required: float) -> list[str]:
    """Return where a reason does not agree with distances by MuJoCo."""
    found = []
    judged = np.argwhere(~np.isin(shown.state, (Reason.NO_CONFIGURATION, Reason.LIMIT)))
    distances = bodies.distances(np.array([shown.q[i, j] for i, j in judged]), required + 0.01)
    names = [bodies.names(pair) for pair in range(len(bodies.pairs))]
    for (i, j), each in zip(judged, distances, strict=True):
        least = float(each.min())
        meets = shown.state[i, j] in (Reason.OBSTACLE, Reason.ITSELF)
        if meets != (least < required) and abs(least - required) > AGREE:
            found.append(
                f"bodies are {least:.4g} m apart where the map says '{shown.reason(i, j)}'"
            )
        if meets:
            words = set(shown.reason(i, j).split())
            said = [each[k] for k, pair in enumerate(names) if pair <= words]
            if not said or min(said) > required + AGREE:
                found.append(f"'{shown.reason(i, j)}', but they are apart")
    return found
