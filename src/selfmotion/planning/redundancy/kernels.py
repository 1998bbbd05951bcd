"""Compiled continuation of configurations along a self-motion, at given values of a coordinate."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels import (
    Vector,
    cholesky,
    clear_held,
    cross,
    dot,
    errors_and_rows,
    gram,
    plus,
    rows_of,
    solve_cholesky,
)
from selfmotion.model.robot import AXIS, JOINT, place_tips

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


@inlined
def _vector(a: Array) -> Vector:
    return a[0], a[1], a[2]


@inlined
def _scaled(s: float, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


@called
def _swivel(code: Ints, reference: Array, chain: Array, r: Array, p: Array, slope: Array) -> float:
    """Return the `SwivelAngle` of the elbow, and set its slope (n,); NaN for a straight arm.

    With e from the shoulder to the elbow, u the unit vector to the wrist, and the reference a:
    θ = atan2(e·(u × a), e·a - (e·u)(u·a)).
    """
    shoulder, elbow, wrist = _vector(p[code[1]]), _vector(p[code[2]]), _vector(p[code[3]])
    a, e, line = _vector(reference), plus(elbow, -1.0, shoulder), plus(wrist, -1.0, shoulder)
    length = np.sqrt(dot(line, line))
    u = _scaled(1.0 / length, line)
    across, eu, au = cross(u, a), dot(e, u), dot(a, u)
    y, x = dot(e, across), dot(e, a) - eu * au
    square = x * x + y * y
    if not square > _STRAIGHT**2:
        return np.nan
    for k in range(len(slope)):
        slope[k] = 0.0
    for j in range(code[3] - 1):
        axis, origin = (0.0, 0.0, 0.0), _vector(p[j + 1])
        for b in range(3):
            column = r[j + 1, 0, b], r[j + 1, 1, b], r[j + 1, 2, b]
            axis = plus(axis, chain[j, AXIS, b] * chain[j, JOINT, 2], column)
        # Velocities of the wrist and of the elbow from the shoulder, by this joint.
        du, de = cross(axis, plus(wrist, -1.0, origin)), (0.0, 0.0, 0.0)
        if j < code[2] - 1:
            de = cross(axis, plus(elbow, -1.0, origin))
        if j < code[1] - 1:
            of_shoulder = cross(axis, plus(shoulder, -1.0, origin))
            du, de = plus(du, -1.0, of_shoulder), plus(de, -1.0, of_shoulder)
        # du = (I - uuᵀ) d(wrist - shoulder) / |wrist - shoulder|.
        du = _scaled(1.0 / length, plus(du, -dot(du, u), u))
        dx = dot(de, a) - (dot(de, u) + dot(e, du)) * au - eu * dot(a, du)
        dy = dot(de, across) + dot(e, cross(du, a))
        slope[int(chain[j, JOINT, 0])] += (x * dy - y * dx) / square
    return float(np.arctan2(y, x))


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
