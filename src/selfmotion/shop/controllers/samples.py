"""A joint motion at the times that a file has it, and whether it begins and ends at rest."""

from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, PlanError, ProblemError, shown
from selfmotion.model.motion import MAX_SAMPLES, Trajectory
from selfmotion.planning.result import Move, Parts, Plan, at_rate, is_retimed
from selfmotion.work.job import Program

# Decimals of times in messages [s]: whole nanoseconds.
_DIGITS = 9
# Difference of times that are written alike: two roundings to whole nanoseconds [s].
_UNEVEN = 2.1e-9
# Smallest number of samples of a motion.
_MIN_SAMPLES = 4
# Shares of an interval at which straight lines are compared with the motion.
_BETWEEN = (0.25, 0.5, 0.75)
# Smallest factor between rates that are tried in turn.
_FASTER = 1.01
# Deviation of cubics that counts as none [rad or m].
_AS_GOOD_AS = 1e-8
# Largest number of halvings of an interval until its cubic is as near.
_MAX_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A joint motion at K times.

    Attributes
    ----------
    joint_names : tuple of str
        As files have them: a part of a cell has names of its own.
    robot_joints : tuple of str
        What the robot calls them.
    t : (K,)
        From 0 [s], in whole nanoseconds.
    q, qd, qdd : (K, n)
        [rad or m], per s, per s².
    """

    joint_names: tuple[str, ...]
    robot_joints: tuple[str, ...]
    t: Array
    q: Array
    qd: Array
    qdd: Array

    @classmethod
    def of(cls, motion: Trajectory, rate: float | None = None) -> "MotionSamples":
        """Sample a motion at a `rate` [Hz] and at its end; by default where it has samples.

        Raises
        ------
        ProblemError
            The rate is not positive, or gives no two samples.
        """
        if rate is None:
            t = np.round(motion.t - motion.t[0], _DIGITS)
        else:
            is_finite = isinstance(rate, Real) and np.isfinite(float(rate))
            if not (is_finite and 1.0 <= rate * motion.duration <= MAX_SAMPLES):
                raise ProblemError(
                    f"rate is {shown(rate)} Hz, expected a number above "
                    f"{1.0 / motion.duration:.4g} and up to {MAX_SAMPLES / motion.duration:.4g}, "
                    f"so that the motion of {motion.duration:.6g} s has samples, not too many"
                )
            t = np.round(motion.sample_times(rate), _DIGITS)
        times = np.clip(motion.t[0] + t, motion.t[0], motion.t[-1])
        names = motion.joint_names
        return cls(names, names, t, *(motion(times, order) for order in (0, 1, 2)))

    def of_part(self, part: str) -> "MotionSamples":
        """Return those of a part of a cell, its joints called as in its own robot."""
        mine = [k for k, name in enumerate(self.robot_joints) if name.startswith(f"{part}/")]
        joints = tuple(self.robot_joints[k] for k in mine)
        names = tuple(name.removeprefix(f"{part}/") for name in joints)
        orders = (values[:, mine] for values in (self.q, self.qd, self.qdd))
        return MotionSamples(names, joints, self.t, *orders)


class LinearDeviation(NamedTuple):
    """Deviation of linear interpolation between samples from a plan's motion.

    Attributes
    ----------
    position, rotation : float
        Of the tool in its reference, or of another frame that follows a path, where it is farthest
        off [m, rad].
    rate : float or None
        Samples per second at which it would stay within the plan's tolerance; None if files
        cannot hold that many.
    """

    position: float
    rotation: float
    rate: float | None


def linear_deviation(plan: Plan, rate: float | None = None) -> LinearDeviation:
    """Return the error of linear interpolation between the samples of a file; see `write_motion`.

    Raises
    ------
    ProblemError
        The rate is not positive, or gives no two samples.
    """
    deviations, _ = _deviations(plan, rate)
    position, rotation = deviations.max(axis=0).tolist()
    return LinearDeviation(position, rotation, _rate_that_keeps(plan))


def _deviations(plan: Plan, rate: float | None) -> tuple[Array, Array]:
    """Return how far straight lines between samples leave a motion.

    Returns
    -------
    deviations : (K, 2)
        Of the tool on each interval: position [m], rotation [rad].
    intervals : (K,)
        Durations between samples [s].
    """
    motion, chains = plan.trajectory, [item.chain for item in plan.problem.follows.items]
    samples = MotionSamples.of(motion, rate)
    intervals = np.diff(samples.t)
    deviations = np.zeros((len(intervals), 2))
    for share in _BETWEEN:
        t = np.minimum(motion.t[0] + samples.t[:-1] + share * intervals, motion.t[-1])
        straight, exact = samples.q[:-1] + share * np.diff(samples.q, axis=0), motion(t)
        for chain in chains:
            _, rotations, positions = chain.along(straight)
            _, exact_rotations, exact_positions = chain.along(exact)
            distance = np.linalg.norm(positions - exact_positions, axis=1)
            # |R - R'| is 2√2 sin(angle / 2).
            half = np.linalg.norm(rotations - exact_rotations, axis=(1, 2)) / np.sqrt(8.0)
            angle = 2.0 * np.arcsin(np.minimum(half, 1.0))
            deviations = np.maximum(deviations, np.stack([distance, angle], axis=1))
    return deviations, intervals


def _rate_that_keeps(plan: Plan) -> float | None:
    """Return a whole rate [Hz] at which the miss is within the tolerance, and hardly a lower one.

    It does not depend on the rate that a file has, and is tried before it is named. None where it
    takes more samples than files have.
    """
    tolerance, duration = plan.tolerance, plan.trajectory.duration
    lowest = float(np.ceil(1.0 / duration))

    def needed(rate: float | None) -> tuple[float, bool]:
        deviations, intervals = _deviations(plan, rate)
        share = (deviations / [tolerance.position, tolerance.rotation]).max(axis=1)
        # The miss of a line over a span h is that of a parabola: it grows with h².
        needed_rate = float(np.ceil((np.sqrt(share) / intervals).max()))
        return max(needed_rate, lowest), bool(share.max() <= 1.0)

    # The samples of the plan itself lie too far apart for more than a first guess.
    rate, _ = needed(None)
    if rate * duration <= MAX_SAMPLES:
        rate = needed(rate)[0]
    while rate * duration <= MAX_SAMPLES:
        better, suffices = needed(rate)
        if suffices:
            return rate
        rate = max(better, float(np.ceil(_FASTER * rate)))
    return None


def coarsest_rate(plan: Plan) -> float | None:
    """Return the lowest whole rate [Hz] at which a plan's samples keep its tolerance.

    Joined by straight lines as well as by quintics, by which the certificate judges them. None
    where the samples of the plan itself are no more, or nothing coarser is verified.
    """
    motion = plan.trajectory
    needed = _rate_that_keeps(plan)
    if needed is None:
        return None
    rate = max(needed, float(np.ceil(_MIN_SAMPLES / motion.duration)))
    if rate * motion.duration >= len(motion.t) - 1:
        return None
    samples = MotionSamples.of(motion, rate)
    coarse = Trajectory(samples.t, samples.q, samples.qd, motion.joint_names, samples.qdd)
    certificate = plan.problem.certify(coarse, plan.tolerance, plan.report.ending)
    return rate if certificate.verified else None


def within_limits_at(plan: Plan, rate: float | None) -> Plan:
    """Return a retimed plan as slow as its samples at a rate need to keep its limits.

    Any other plan, whose time is what was asked for, is returned as it is, and so is one of which
    no slower motion is verified.
    """
    if rate is None or not (is_retimed(plan) and plan.certificate.verified):
        return plan
    samples = MotionSamples.of(plan.trajectory, rate)
    sampled = Trajectory(samples.t, samples.q, samples.qd, plan.trajectory.joint_names, samples.qdd)
    if plan.problem.certify(sampled, plan.tolerance, plan.report.ending).verified:
        return plan
    slower = at_rate(plan, rate)
    return slower if slower.certificate.verified else plan


def slowed_as(plan: Plan, motion: Trajectory) -> Plan:
    """Return a retimed plan as slow as a motion that `within_limits_at` made of it.

    The rate is that of the motion's samples. Any other plan is returned as it is, and so is one of
    which the motion is not made so.
    """
    steps = np.diff(motion.t)
    is_even = np.ptp(steps) <= _UNEVEN
    if not (is_retimed(plan) and is_even and motion.duration > plan.trajectory.duration + _UNEVEN):
        return plan
    slower = within_limits_at(plan, len(steps) / motion.duration)
    is_same = abs(slower.trajectory.duration - motion.duration) <= _UNEVEN
    return slower if is_same else plan


def for_cubics(motion: Trajectory) -> Trajectory:
    """Return a motion with enough samples for cubics through q and q̇.

    For files without accelerations: each interval is halved until its cubic is near enough.
    """
    for _ in range(_MAX_HALVINGS):
        t = motion.t
        middle = 0.5 * (t[1:] + t[:-1])
        cubic = Trajectory(t, motion.q, motion.qd, motion.joint_names)
        far = np.abs(cubic(middle) - motion(middle)).max(axis=1) > _AS_GOOD_AS
        if not far.any():
            break
        # Alike on both sides of where it matters.
        wide = np.convolve(far, np.ones(3), "same") > 0.0
        finer = np.sort(np.concatenate([t, middle[wide]]))
        q, qd, qdd = (motion(finer, order) for order in range(3))
        motion = Trajectory(finer, q, qd, motion.joint_names, qdd)
    return motion


# Speed below which a joint rests, as certificates judge it [rad/s or m/s].
_REST = 1e-6


def moving_ends(plan: Plan | Parts | Move | Program) -> str:
    """Return in words which joint moves at an end that a problem has at rest; "" for none.

    A problem asks for it by `StartVelocity`, `EndVelocity`, `ClosedPath` or ``rest=False``.
    """
    motion = plan.motion if isinstance(plan, Move) else plan.trajectory
    constraints = plan.problem.constraints if isinstance(plan, Plan) else ()
    allowed = [
        any(item.ends.velocity[end] or item.ends.closes for item in constraints) for end in (0, 1)
    ]
    if isinstance(plan, Plan) and not plan.problem.rest:
        allowed = [True, True]
    for row, verb, may in ((0, "begins", allowed[0]), (-1, "ends", allowed[1])):
        speeds = np.abs(motion.qd[row])
        joint = int(speeds.argmax())
        if speeds[joint] > _REST and not may:
            unit = "m/s" if plan.robot.is_prismatic(motion.joint_names[joint]) else "rad/s"
            return (
                f"joint '{motion.joint_names[joint]}' {verb} at {speeds[joint]:.3g} {unit} at "
                f"t = {motion.t[row]:.6g} s, and controllers take motions from rest to rest: plan "
                f"it with a ramp (--set path.ramp=0.5)"
            )
    return ""


def check_ends(plan: Plan | Parts | Move | Program, file: Path, force: bool) -> None:
    """Raise PlanError for a motion that begins or ends moving unasked, unless it is forced."""
    fault = "" if force else moving_ends(plan)
    if fault:
        raise PlanError(f"{file}: is not written: {fault}, or give force=True to write it as it is")
