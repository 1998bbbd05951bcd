"""Quantities within limits: torques, tilts, bands, the tool's speed and acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.certificate import MotionSegments, Quantity, Shares
from selfmotion.model.motion import Sampling
from selfmotion.model.robot import ChainSeries, RobotModel
from selfmotion.problem.constraints import BoundQuantity, Constraint, NodeTangents, linearised
from selfmotion.problem.costs import LazySamples, Samples
from selfmotion.realtime.segment import Segment
from selfmotion.realtime.settings import (
    ACCELERATED_RESERVE,
    FARTHEST,
    LEAVING_IN,
    NEAR_LIMIT,
    QUANTITY_BEYOND,
    QUANTITY_RESERVE,
    STRIDE,
    UNMOVED,
)

# Coefficients of the joints' series for the second derivative of a function of q …
_LENGTH = 3
# … and of one of q̈.
_LENGTH_OF_ACCELERATION = 5


def is_quantity(item: Constraint) -> bool:
    """Return whether a constraint says what it limits by `Constraint.quantity`."""
    return type(item).quantity is not Constraint.quantity


class Unproved(NamedTuple):
    """What is not proved of a segment, in words, and at about what time of it [s]."""

    reason: str
    time: float


class Quantities:
    """Limits of quantities: rows of the plan, and a proof for each segment.

    The rows are those of planned motions (`Constraint.conditions`), at the nodes of the horizon.

    Parameters
    ----------
    robot : RobotModel
    constraints : sequence of Constraint
        Each with a quantity.
    fastest : (3, n)
        Limits of |q̇|, |q̈| and of the jerk, which commands keep.
    cycle : float
        Time between commands [s].

    Attributes
    ----------
    by_acceleration : bool
        Whether some depend on accelerations, so that gentler braking may keep them.
    """

    def __init__(
        self, robot: RobotModel, constraints: Sequence[Constraint], fastest: Array, cycle: float
    ) -> None:
        self._robot = robot
        self._near: _NearTimes | None = None
        points = [at for item in constraints for at in item.conditions(robot).points]
        self._conditions = [
            (
                at,
                at.uses_accelerations(robot.dof),
                isinstance(at, BoundQuantity) and at.quantity.of_pace,
            )
            for at in points
        ]
        anywhere = _Groups(robot, cycle, fastest[..., None], np.full((3, 1, robot.dof), np.nan))
        self._proofs = [_Proof(item.quantity(robot), anywhere) for item in constraints]
        self.by_acceleration = any(proof.by_acceleration for proof in self._proofs)

    def forget(self) -> None:
        """Forget by how much limits have been exceeded: the arm is somewhere else."""
        for proof in self._proofs:
            proof.forget()

    def rows(self, samples: Samples, by_q: Array, by_qd: Array, own: int) -> tuple[Array, Array]:
        """Return the constraints of a step of the plan: rows (R, d) and upper limits (R,).

        Those near their limits. The first `own` of the variables are those of the self-motion. What
        is exceeded now is to be left.
        """
        near = self._near or _NearTimes(samples.sampling)
        self._near, nodes, later = near, samples.nodes, near.later
        q, qd = near.motion(samples.q[nodes], samples.qd[nodes])
        between = LazySamples(samples.follows, near.sampling, q=q, qd=qd)
        motion = NodeTangents(*near.motion(by_q[nodes], by_qd[nodes]), near.sampling)
        rows, room = [np.zeros((0, motion.size))], [np.zeros(0)]
        for item, accelerated, of_pace in self._conditions:
            h = item.residual(between)
            reserve = ACCELERATED_RESERVE if accelerated else QUANTITY_RESERVE
            # Accelerations may be others at once.
            beyond = 0.0 if accelerated else np.maximum(h[0] + reserve, 0.0) * later
            left = beyond - reserve - h
            # The present is what it is.
            left[0] = np.inf
            which = np.flatnonzero(left < NEAR_LIMIT)
            if which.size:
                by = linearised(item, between, motion).picked(motion, which)
                still = np.abs(by[:, :own]).max(axis=1, initial=0.0) < UNMOVED
                # What the path alone says, at any pace, may use the reserve.
                some = left.ravel()[which] + reserve * (still & (not of_pace))
                kept = ~still | (some < 0.0) | by.any(axis=1)
                rows.append(by[kept])
                room.append(some[kept])
        return np.concatenate(rows), np.concatenate(room)

    def unproved(self, segment: Segment, deviation: Array) -> Unproved | None:
        """Return where a segment is not proved to keep the limits; None where it is everywhere.

        At the expected position: the command plus the present deviation (n,).
        """
        if np.any(segment.qd[-1]):
            return Unproved("it is not proved that the arm comes to rest in time", np.inf)
        segments = _Groups.of_segment(self._robot, segment, deviation)
        each = (proof.unproved(segments) for proof in self._proofs)
        return next((said for said in each if said is not None), None)


class _NearTimes:
    """Nodes of the horizon, and times between the first ones, by cubic interpolation.

    What is near is commanded soon: there a limit must not be exceeded between two nodes.

    Parameters
    ----------
    sampling : Sampling
        That of the horizon.

    Attributes
    ----------
    sampling : Sampling
        All of its samples are nodes.
    later : (M, 1)
        From 1 now to 0 where nothing may be exceeded any more.
    """

    def __init__(self, sampling: Sampling) -> None:
        from scipy.interpolate import CubicHermiteSpline

        nodes = sampling.node_times
        first = [(1.0 - share) * nodes[0] + share * nodes[1] for share in (0.25, 0.5, 0.75)]
        middles = 0.5 * (nodes[1:3] + nodes[2:4])
        times = np.sort([*nodes, *first, *middles])
        self.sampling = Sampling.trapezoidal(times)
        self.later = np.maximum(1.0 - times / LEAVING_IN, 0.0)[:, None]
        ones = np.eye(len(nodes))
        each = [
            CubicHermiteSpline(nodes, *given) for given in ((ones, 0.0 * ones), (0.0 * ones, ones))
        ]
        self._matrices = [np.hstack([one(times, order) for one in each]) for order in (0, 1)]

    def motion(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return a motion at the times of one at the nodes (N + 1, …), or tangents likewise."""
        ends = np.concatenate([q, qd]).reshape(2 * len(q), q[0].size)
        shape = len(self.later), *q.shape[1:]
        values, rates = ((matrix @ ends).reshape(shape) for matrix in self._matrices)
        return values, rates


class _Groups(MotionSegments):
    """A motion in groups of `STRIDE` cycles, with majorants of the joints.

    Within a cycle the jerk is constant: derivatives of the joints are bounded by the largest ones
    of a group, and those of functions of the joints follow as they do for polynomials, at each time
    but those of cycles.

    Parameters
    ----------
    robot : RobotModel
    cycle : float
        Time between commands [s].
    fastest : (3, n, I)
        Bounds of |q̇|, |q̈| and the jerk in I groups.
    table : (3, STRIDE · I + 1, n)
        q, q̇ and q̈ at cycles; of any motion within the bounds NaN.
    """

    def __init__(self, robot: RobotModel, cycle: float, fastest: Array, table: Array) -> None:
        count, self.length = fastest.shape[2], _LENGTH_OF_ACCELERATION
        self.robot, self._table, self._fastest = robot, table, fastest
        self._chains: dict[int, ChainSeries] = {}
        self.half = np.full(count, 0.5 * STRIDE * cycle)
        self.middle = self.half * (2.0 * np.arange(count) + 1.0)

    @classmethod
    def of_segment(cls, robot: RobotModel, segment: Segment, deviation: Array) -> _Groups:
        """Return a segment; after its end the arm rests."""
        last, cycle = len(segment.t) - 1, float(segment.t[1] - segment.t[0])
        count = -(-last // STRIDE)
        rows = np.minimum(np.arange(count * STRIDE + 1), last)
        table = np.stack([segment.q + deviation, segment.qd, segment.qdd])[:, rows]
        speed, (before, after) = segment.travelled[rows], (table[2, :-1], table[2, 1:])
        jerk = np.abs(after - before) / cycle
        each = np.diff(speed, axis=0) / cycle, np.maximum(np.abs(before), np.abs(after)), jerk
        fastest = np.reshape(each, (3, count, STRIDE, -1)).max(axis=2).transpose(0, 2, 1)
        return cls(robot, cycle, fastest, table)

    @override
    def chain(self) -> ChainSeries:
        """Return the majorants of the chain's motion, as long as `length` says."""
        if self.length not in self._chains:
            self._chains[self.length] = self._chain_of(self.length)
        return self._chains[self.length]

    def _chain_of(self, length: int) -> ChainSeries:
        n, count = self._fastest.shape[1:]
        joints = np.zeros((n, length, count))
        ends = np.abs([self.robot.lower, self.robot.upper]).max(axis=0)
        joints[:, 0] = np.where(np.isfinite(ends), ends, 0.0)[:, None] + FARTHEST
        scale = 1.0
        for k, each in enumerate(self._fastest[: length - 1], 1):
            scale *= float(self.half[0]) / k
            joints[:, k] = each * scale
        return ChainSeries(self.robot, joints, self.half)

    @override
    def motion(self, u: Array, order: int = 0) -> Array:
        """Return q, q̇ or q̈ at cycles: places u (P,) of all groups that are some."""
        at = np.rint((0.5 * STRIDE) * (u + 1.0)).astype(np.intp)
        rows = STRIDE * np.arange(len(self.half))[:, None] + at
        last = len(self._table[order]) - 1
        return np.ascontiguousarray(self._table[order][np.minimum(rows.ravel(), last)])


class _Proof:
    """One quantity: the shares of its limits that a segment uses at most.

    Between two times at which it is measured, δ apart, a function f leaves its chord by at most
    δ²/8 sup|f''|, if f' is continuous. If it depends on q̈, f' jumps at cycles, so that it is
    measured at each.

    Parameters
    ----------
    quantity : Quantity
    anywhere : _Groups
        Any motion within the limits of joints: what bounds the quantity there, bounds it always.
    """

    def __init__(self, quantity: Quantity, anywhere: _Groups) -> None:
        self._quantity, self._shares = quantity, Shares(quantity)
        somewhere = np.full((1, anywhere.robot.dof), 0.3)
        self.by_acceleration = len(quantity.derivatives(somewhere, somewhere, somewhere)) > 2
        is_each = self.by_acceleration or quantity.series is None
        # Measurements in a group: first few, then all.
        self._steps = [STRIDE] if is_each else [1, STRIDE]
        self._always = self._between(anywhere)
        self.forget()

    def forget(self) -> None:
        """Forget by how much limits have been exceeded."""
        self._most = np.full(len(self._shares.of), np.inf)

    def allowed(self, now: Array) -> Array:
        """Return the shares (C,) that may be used where these are used now.

        What is exceeded, as when the arm was pushed, does not grow; pushed farther, it begins anew.
        """
        pushed = now > self._most + 2.0 * QUANTITY_BEYOND
        before = np.where(pushed, np.inf, self._most)
        self._most = np.minimum(before, np.maximum(now, 1.0))
        return np.where(now > 1.0, np.maximum(self._most + QUANTITY_BEYOND, now), 1.0)

    def unproved(self, segments: _Groups) -> Unproved | None:
        """Return where a segment is not proved to keep the limits; None where it is everywhere."""
        quantity, shares = self._quantity, self._shares
        if not len(quantity.limited):
            return None
        allowed, bends = None, None
        for steps in self._steps:
            u = np.linspace(-1.0, 1.0, steps + 1)
            sizes = shares.sizes(shares.values(segments, u), segments)
            largest = sizes.max(axis=1)
            allowed = self.allowed(sizes[0, 0]) if allowed is None else allowed
            # Written so that NaN proves nothing.
            if np.all(largest + self._always / steps**2 <= allowed):
                return None
            bends = self._between(segments) if bends is None else bends
            most = largest + bends / steps**2
            broken = ~(most <= allowed)
            if not broken.any():
                return None
            if (~(largest <= allowed)).any():
                break
        row, which = np.argwhere(broken)[0]
        label = quantity.columns[int(quantity.limited[which])].label
        time = float(segments.middle[row])
        return Unproved(
            f"{label} is not proved to keep its limit until {time:.3f} s: it uses up to "
            f"{most[row, which]:.4g} times that",
            time,
        )

    def _between(self, segments: _Groups) -> Array:
        """Return by how much shares may be larger between the ends of groups than there, (I, C)."""
        if self._quantity.series is None:
            return np.zeros((1, len(self._shares.of)))
        segments.length = _LENGTH_OF_ACCELERATION if self.by_acceleration else _LENGTH
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            known = self._shares.series(segments)
        if known is None:
            return np.full((1, len(self._shares.of)), np.inf)
        return np.asarray(known[:, 2].T)
