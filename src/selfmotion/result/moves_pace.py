"""Quick paces of moves, of which a job makes thousands: near the fastest one.

Time-optimal path parametrisation by reachability analysis (H. Pham and Q.-C. Pham, IEEE Trans.
Robotics 34(3), 2018), by the package toppra, then its mean over what jerks need, and as much slower
as a whole as that passes limits. `retime` is slower and better.
"""

import logging
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, PlanError, read_only
from selfmotion.constraints import Envelope
from selfmotion.motion import Trajectory, slowdown_of
from selfmotion.path import Pace, times_along
from selfmotion.result.pace_rows import length_speed
from selfmotion.result.pacing import along

# Times are this share longer than limits ask, for the last digits of a product.
_ROUNDING = 1e-9
# Grid points of toppra per sample of the motion.
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
    pace = _smoothed(_pace(motion, kept), kept)
    return along(_slowed(pace, motion, kept), motion)


def _pace(motion: Trajectory, kept: Envelope) -> Pace:
    """Return the fastest pace by limits of speed and acceleration at the grid points of toppra."""
    count = _DENSITY * (len(motion.t) - 1)
    sigma = np.interp(np.arange(count + 1) / _DENSITY, np.arange(len(motion.t)), motion.t)
    q, qd = motion(sigma), motion(sigma, order=1)
    # The pace is looked for over the length of the joint path: over σ, a motion that begins at
    # rest would bound nothing there. A share of the largest speed keeps it increasing.
    stretch = length_speed(qd)
    length = np.append(0.0, np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * np.diff(sigma)))
    rates = _toppra(length, q, kept.speed, kept.acceleration)
    t = times_along(length, rates)
    return Pace(t, sigma - sigma[0], rates / stretch)


def _smoothed(pace: Pace, kept: Envelope) -> Pace:
    """Return a pace so smooth that jerks keep their limits.

    From one limit of the acceleration to the other within the window, the jerk keeps its limit.
    """
    return pace.smoothed(float((2.0 * kept.acceleration / kept.jerk).max()))


def _slowed(pace: Pace, motion: Trajectory, kept: Envelope) -> Pace:
    """Return a pace so much slower that limits are kept between its samples as well."""
    needed = slowdown_of(along(pace, motion), (kept.speed, kept.acceleration, kept.jerk))
    return pace.slower(max(needed, 1.0) * (1.0 + _ROUNDING))


def _toppra(length: Array, q: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the largest rates at lengths (K,) of a joint path q (K, n), zero at both ends."""
    import toppra
    from toppra import algorithm, constraint

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
