"""The fastest pace of a joint path within limits of speed and acceleration, by the package toppra.

Time-optimal path parametrisation by reachability analysis (H. Pham and Q.-C. Pham, IEEE Trans.
Robotics 34(3), 2018), smoothed so that jerks keep their limits.
"""

from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, PlanError, ProblemError, read_only
from selfmotion.constraints import Envelope
from selfmotion.motion import Trajectory
from selfmotion.path import Pace, times_along

# Where the motion rests, its length goes on at this share of its largest speed.
_STILL = 0.05
# Times are this share longer than limits ask, for the last digits of a product.
_ROUNDING = 1e-9
# Grid points of toppra per sample of a free motion.
_DENSITY = 4
# Where nobody limits the jerk, moves reach their full acceleration in this time [s].
_SOFT = 0.02


def paced(motion: Trajectory, kept: Envelope) -> Trajectory:
    """Return a joint path in the shortest time within limits, from rest to rest, from t = 0 on.

    Parameters
    ----------
    motion : Trajectory
        The path over any time of its own.
    kept : Envelope
        Finite limits of speed and acceleration, and those of the jerk where there are any.

    Raises
    ------
    PlanError
        No pace keeps the limits.
    """
    # Controllers want accelerations without jumps from arms of any make.
    soft = np.where(np.isfinite(kept.jerk), kept.jerk, kept.acceleration / _SOFT)
    kept = replace(kept, jerk=read_only(soft))
    pace = smoothed(toppra_pace(motion, kept, _DENSITY), kept)
    return along(slowed(pace, motion, kept), motion)


def toppra_pace(motion: Trajectory, kept: Envelope, density: int) -> Pace:
    """Return the fastest pace by limits of speed and acceleration at the grid points of toppra."""
    count = density * (len(motion.t) - 1)
    sigma = np.interp(np.arange(count + 1) / density, np.arange(len(motion.t)), motion.t)
    q, qd = motion(sigma), motion(sigma, order=1)
    # The pace is looked for over the length of the joint path: over σ, a motion that begins at
    # rest would bound nothing there. A share of the largest speed keeps it increasing.
    speed = np.linalg.norm(qd, axis=1)
    stretch = np.hypot(speed, _STILL * max(float(speed.max()), np.finfo(float).tiny))
    length = np.append(0.0, np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * np.diff(sigma)))
    rates = _toppra(length, q, kept.speed, kept.acceleration)
    t = times_along(length, rates)
    return Pace(t, sigma - sigma[0], rates / stretch)


def smoothed(pace: Pace, kept: Envelope) -> Pace:
    """Return a pace so smooth that jerks keep their limits, where there are any.

    From one limit of the acceleration to the other within the window, the jerk keeps its limit.
    """
    limited = np.isfinite(kept.jerk) & np.isfinite(kept.acceleration)
    if not limited.any():
        return pace
    return pace.smoothed(float((2.0 * kept.acceleration[limited] / kept.jerk[limited]).max()))


def slowed(pace: Pace, motion: Trajectory, kept: Envelope) -> Pace:
    """Return a pace so much slower that limits are kept between its samples as well."""
    trial = along(pace, motion)
    factors = [1.0]
    for order, limit in ((1, kept.speed), (2, kept.acceleration), (3, kept.jerk)):
        if order < 3 or pace.bend is not None:
            share = float((np.abs(trial.extremes(order)[1]) / limit).max())
            factors.append(share ** (1.0 / order))
    return pace.slower(max(factors) * (1.0 + _ROUNDING))


def along(pace: Pace, motion: Trajectory) -> Trajectory:
    """Return a motion at a pace."""
    at = pace.sigma + motion.t[0]
    q, qd, rate = motion(at), motion(at, 1), pace.rate[:, None]
    faster = None if pace.bend is None else motion(at, 2) * rate**2 + qd * pace.bend[:, None]
    return Trajectory(pace.t, q, qd * rate, motion.joint_names, faster)


def _toppra(length: Array, q: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the largest rates at lengths (K,) of a joint path q (K, n), zero at both ends."""
    import logging

    try:
        import toppra
        from toppra import algorithm, constraint
    except ImportError:
        raise ProblemError(
            "retiming needs the package toppra: pip install 'selfmotion[retime]'"
        ) from None
    logging.getLogger("toppra").setLevel(logging.ERROR)
    # The length as one more joint: where the motion rests, nothing else bounds its pace.
    velocity = np.append(velocity, np.linalg.norm(velocity))
    acceleration = np.append(acceleration, np.linalg.norm(acceleration))
    solver = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
            constraint.JointAccelerationConstraint(np.stack([-acceleration, acceleration], axis=1)),
        ],
        toppra.SplineInterpolator(length, np.column_stack([q, length])),
        gridpoints=length,
    )
    _, rates, _ = solver.compute_parameterization(0.0, 0.0)
    if rates is None:
        raise PlanError("no pace keeps the velocity and acceleration limits along this joint path")
    return np.asarray(rates, dtype=np.float64)
