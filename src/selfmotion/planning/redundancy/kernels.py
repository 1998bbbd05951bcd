"""Compiled continuation of configurations along a self-motion, at given values of a coordinate."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels import (
    cholesky,
    clear_held,
    errors_and_rows,
    gram,
    rows_of,
    solve_cholesky,
)
from selfmotion.model.robot import place_tips
from selfmotion.model.robot.tree_arrays import AXIS, JOINT

# Kinds of a coordinate, first entry of a code: a joint's own coordinate, its number the second …
OWN = 0
# … the turn of the tool about its z axis from its path's orientation …
TURN_OF_TOOL = 1
# … the swivel of the elbow, with the places on the chain of shoulder, elbow and wrist.
SWIVEL = 2

# Largest motion of the joints in a step from one value to the next [rad or m], configuration norm:
# steps are halved until they are shorter, so that none leads to another branch.
_LONGEST = 0.25
# A step ends at most this many times as far as its first correction was long: the curve bends
# little over such a step, and whatever is farther is another branch.
_FARTHEST = 1.5
# Smallest step as a share of the way from one value to the next: the branch ends there.
_SMALLEST_SHARE = 1.0 / 64.0
# Newton corrections of a step: they converge quadratically, so that more of them never do.
_CORRECTIONS = 8
# Size of a correction at convergence [rad or m]: the error is its square.
_CONVERGED = 1e-6
# Distance of an elbow from the line of shoulder and wrist that is none [m].
_STRAIGHT = 1e-6


@inlined
def wrapped_angle(angle: float) -> float:
    """Return an angle within [-π, π)."""
    return float(angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5))


@called
def _turn(target: Array, rotation: Array, jacobian: Array, slope: Array) -> float:
    """Return the turn of the tool about z from its target's orientation, and set its slope (n,)."""
    about, along = 0.0, 0.0
    for a in range(3):
        x, y = target[3 + 3 * a], target[4 + 3 * a]
        about += y * rotation[a, 0] - x * rotation[a, 1]
        along += x * rotation[a, 0] + y * rotation[a, 1]
    for k in range(len(slope)):
        slope[k] = 0.0
        for a in range(3):
            slope[k] += rotation[a, 2] * jacobian[3 + a, k]
    return float(np.arctan2(about, along))


@called
def _swivel(code: Ints, reference: Array, chain: Array, r: Array, p: Array, slope: Array) -> float:
    """Return the `SwivelAngle` of the elbow, and set its slope (n,); NaN for a straight arm.

    With e from the shoulder to the elbow, u the unit vector to the wrist, and the reference a:
    θ = atan2(e·(u × a), e·a - (e·u)(u·a)).
    """
    shoulder, elbow, wrist = p[code[1]], p[code[2]], p[code[3]]
    u, e, across = np.empty(3), np.empty(3), np.empty(3)
    axis, du, de = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        u[i], e[i] = wrist[i] - shoulder[i], elbow[i] - shoulder[i]
    length = np.sqrt(_dot(u, u))
    for i in range(3):
        u[i] /= length
    _cross(u, reference, across)
    eu, au, ea = _dot(e, u), _dot(reference, u), _dot(e, reference)
    y, x = _dot(e, across), ea - eu * au
    square = x * x + y * y
    if not square > _STRAIGHT**2:
        return np.nan
    for k in range(len(slope)):
        slope[k] = 0.0
    for j in range(code[3] - 1):
        for i in range(3):
            axis[i] = du[i] = de[i] = 0.0
            for b in range(3):
                axis[i] += r[j + 1, i, b] * chain[j, AXIS, b] * chain[j, JOINT, 2]
        _add_velocity(1.0, axis, p[j + 1], wrist, du)
        if j < code[2] - 1:
            _add_velocity(1.0, axis, p[j + 1], elbow, de)
        if j < code[1] - 1:
            _add_velocity(-1.0, axis, p[j + 1], shoulder, du)
            _add_velocity(-1.0, axis, p[j + 1], shoulder, de)
        # du = (I - uuᵀ) d(wrist - shoulder) / |wrist - shoulder|.
        along = _dot(du, u)
        for i in range(3):
            du[i] = (du[i] - along * u[i]) / length
        dy, dx = _dot(de, across), _dot(de, reference) - (_dot(de, u) + _dot(e, du)) * au
        dx -= eu * _dot(reference, du)
        _cross(du, reference, de)
        dy += _dot(e, de)
        slope[int(chain[j, JOINT, 0])] += (x * dy - y * dx) / square
    return float(np.arctan2(y, x))


@called
def _add_velocity(sign: float, axis: Array, origin: Array, point: Array, out: Array) -> None:
    """Add the velocity of a point by a turn about an axis to `out` (3,), times a sign."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    out[0] += sign * (axis[1] * z - axis[2] * y)
    out[1] += sign * (axis[2] * x - axis[0] * z)
    out[2] += sign * (axis[0] * y - axis[1] * x)


@called
def _cross(a: Array, b: Array, out: Array) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@called
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@called
def _value(
    code: Ints,
    reference: Array,
    q: Array,
    target: Array,
    chains: Array,
    r: Array,
    p: Array,
    rotations: Array,
    jacobians: Array,
    slope: Array,
) -> float:
    """Return the coordinate at q, placed by `place_tips`, and set its slope ∂c/∂q (n,)."""
    if code[0] == TURN_OF_TOOL:
        return _turn(target, rotations[0], jacobians[0], slope)
    if code[0] == SWIVEL:
        return _swivel(code, reference, chains[0], r, p, slope)
    for k in range(len(slope)):
        slope[k] = 1.0 if k == code[1] else 0.0
    return float(q[code[1]])


@called
def _copy(given: Array, out: Array) -> None:
    for k in range(len(out)):
        out[k] = given[k]


@called
def _reaches(
    goal: float,
    here: Array,
    trial: Array,
    target: Array,
    chains: Array,
    layout: Layout,
    code: Ints,
    reference: Array,
    locked: Flags,
    work: tuple[Array, ...],
) -> bool:
    """Whether Newton's method comes from `here` (n,) to the value `goal` nearby; `trial` is there.

    On [F(q) = x; c(q) = s], with corrections [J; ∂c/∂q]⁺ of least norm.
    """
    r, p, rotations, positions, jacobians, error, rows, factor, slope = work
    n, m = len(here), len(error) - 1
    _copy(here, trial)
    first, length = 0.0, np.inf
    for count in range(_CORRECTIONS):
        place_tips(trial, chains, r, p, rotations, positions, jacobians)
        clear_held(locked, jacobians)
        errors_and_rows(layout, target, jacobians, rotations, positions, error, rows)
        value = _value(
            code, reference, trial, target, chains, r, p, rotations, jacobians, slope
        )  # fmt: skip
        error[m] = goal - value if code[0] == OWN else wrapped_angle(goal - value)
        for j in range(n):
            rows[m, j] = 0.0 if locked[j] else slope[j]
        gram(rows, factor)
        # Where the coordinate does not change along the self-motion, the branch turns back.
        if not cholesky(factor):
            return False
        solve_cholesky(factor, error)
        length = 0.0
        for j in range(n):
            step = 0.0
            for i in range(m + 1):
                step += rows[i, j] * error[i]
            trial[j] += step
            length += step**2
        length = np.sqrt(length)
        if count == 0:
            first = length
        # Written so that NaN ends it, too.
        if not length <= _LONGEST or length < _CONVERGED:
            break
    moved = 0.0
    for j in range(n):
        moved += (trial[j] - here[j]) ** 2
    return bool(length < _CONVERGED and np.sqrt(moved) <= _FARTHEST * first + _CONVERGED)


@inlined
def _work(tips: int, joints: int, n: int, m: int) -> tuple[Array, ...]:
    """Return arrays to work in: places on a chain, tips, Jacobians, and m + 1 rows."""
    return (
        np.empty((joints, 3, 3)),
        np.empty((joints, 3)),
        np.empty((tips, 3, 3)),
        np.empty((tips, 3)),
        np.zeros((tips, 6, n)),
        np.empty(m + 1),
        np.empty((m + 1, n)),
        np.empty((m + 1, m + 1)),
        np.empty(n),
    )


@kernel
def continue_all(
    q: Array,
    first: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    code: Ints,
    reference: Array,
    locked: Flags,
    wanted: Array,
    begins: Ints,
    found: Array,
) -> None:
    """Continue each of q (N, n) along its self-motion to the values `wanted` (M,) of a coordinate.

    From its value `first` (N,), which is below the wanted ones from number `begins` (N,) on, both
    ways, from one wanted value to the next, in steps that are halved where they are too long.
    Targets are (N, 12 F); joints that are `locked` (N, n) rest.
    Sets `found` (N, M, n), as far as a branch goes. Angles may be beyond ±π.
    """
    n = q.shape[1]
    work = _work(layout.shape[0], chains.shape[1], n, rows_of(layout))
    here, trial = np.empty(n), np.empty(n)
    for k in range(len(q)):
        for way in range(2):
            at, value = begins[k] - way, first[k]
            _copy(q[k], here)
            while 0 <= at < len(wanted):
                gone, share = 0.0, 1.0
                while gone < 1.0 and share >= _SMALLEST_SHARE:
                    there = min(1.0, gone + share)
                    goal = value + there * (wanted[at] - value)
                    if _reaches(
                        goal, here, trial, targets[k], chains, layout, code, reference,
                        locked[k], work,
                    ):  # fmt: skip
                        gone, share = there, 2.0 * share
                        _copy(trial, here)
                    else:
                        share *= 0.5
                if gone < 1.0:
                    break
                _copy(here, found[k, at])
                value = wanted[at]
                at += 1 - 2 * way
