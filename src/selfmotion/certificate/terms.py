"""What a certificate is made of: tolerances, requirements, and what was found."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.collision import CollisionModel
from selfmotion.robot import RobotModel
from selfmotion.task import DampingLaw, Relaxation


@dataclass(frozen=True)
class Tolerance:
    """What a verified motion may miss the path by, at any time.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        [rad].
    """

    position: float = 1e-6
    rotation: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("position", "rotation"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ProblemError(f"tolerance: {name} is {value}, expected a number > 0")


@dataclass(frozen=True, eq=False)
class Requirements:
    """What a verified motion must keep besides the path; None: the URDF's limits, or nothing.

    Attributes
    ----------
    lower, upper : (n,) or None
        Position limits [rad or m].
    velocity : (n,) or None
        Speed limits [rad/s or m/s].
    acceleration : (n,) or None
        Acceleration limits [rad/s² or m/s²]; without them none are checked.
    end : (n,) or None
        q(T) [rad or m].
    end_velocity : (n,) or None
        q̇(T) [rad/s or m/s].
    closed, closed_velocity : bool
        Whether q(T) = q(0) is wanted, and q̇(T) = q̇(0).
    collision : CollisionModel or None
        Bodies to keep apart; without it clearance is not checked.
    clearance : float
        Smallest distance between bodies [m].
    relaxations : tuple of Relaxation
        Rows in which the tool may leave the path: only what is beyond them counts as an error.
    damping : DampingLaw or None
        No requirement: how the motion was damped near singular poses, to tell where and what for.
    ending : str
        Why the motion ends before its path does, where it is known to; such a motion is never
        verified.
    """

    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    end: Array | None = None
    end_velocity: Array | None = None
    closed: bool = False
    closed_velocity: bool = False
    collision: CollisionModel | None = None
    clearance: float = 0.0
    relaxations: tuple[Relaxation, ...] = ()
    damping: DampingLaw | None = None
    ending: str = ""

    def limits(self, robot: RobotModel) -> tuple[Array, Array, Array]:
        """Return lower and upper position limits and speed limits for an arm, (n,) each."""
        return (
            robot.lower if self.lower is None else self.lower,
            robot.upper if self.upper is None else self.upper,
            robot.velocity_limit if self.velocity is None else self.velocity,
        )


@dataclass(frozen=True)
class Extreme:
    """The worst value of a quantity along a motion.

    Attributes
    ----------
    value : float
    time : float
        When [s].
    name : str
        Of what: a joint, a frame, a pair of bodies.
    """

    value: float
    time: float
    name: str


@dataclass(frozen=True)
class DampedStretch:
    """A stretch of time over which the inverse was damped.

    Attributes
    ----------
    start, end : float
        [s].
    singular_value : float
        Smallest singular value σ of the task Jacobian on it [m, rad].
    factor : float
        Largest damping λ on it [m, rad].
    """

    start: float
    end: float
    singular_value: float
    factor: float

    def __str__(self) -> str:
        """Return the stretch in words."""
        return (
            f"{self.start:.3f} to {self.end:.3f} s (smallest singular value "
            f"{self.singular_value:.3g}, λ up to {self.factor:.3g})"
        )


@dataclass(frozen=True)
class Certificate:
    """What forward kinematics says about a finished motion, on a grid finer than its samples.

    Attributes
    ----------
    position_error : Extreme
        Largest distance of the tool from the path, in the prescribed rows and beyond what is
        relaxed [m].
    rotation_error : Extreme
        Largest angle from the path's orientation, likewise [rad].
    limit_margin : Extreme
        Smallest distance of a joint from its position limits [rad or m]; negative beyond them.
    velocity_ratio : Extreme
        Largest |q̇| relative to the joint's limit; above 1 it is exceeded.
    smallest_singular_value : Extreme
        Of the task Jacobian: distance from singular poses.
    acceleration_ratio : Extreme or None
        Largest |q̈| relative to the limits asked for; None without any.
    clearance : Extreme or None
        Smallest distance between bodies [m], with their names; None where it was not asked for.
    closure : float
        max |q(T) - q(0)| [rad or m].
    samples : int
        Number of times looked at.
    failures : tuple of str
        What speaks against the motion; empty for a verified one.
    deviations : tuple of Extreme
        For each relaxation the largest deviation of its rows from the path, in its window [m or
        rad].
    damped : tuple of DampedStretch
        Where the inverse was damped, in order of time.
    """

    position_error: Extreme
    rotation_error: Extreme
    limit_margin: Extreme
    velocity_ratio: Extreme
    smallest_singular_value: Extreme
    acceleration_ratio: Extreme | None
    clearance: Extreme | None
    closure: float
    samples: int
    failures: tuple[str, ...]
    deviations: tuple[Extreme, ...] = ()
    damped: tuple[DampedStretch, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the motion follows the path within tolerance and keeps the joint limits."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or what is wrong."""
        if self.verified:
            return (
                f"verified: at most {self.position_error.value:.1e} m and "
                f"{self.rotation_error.value:.1e} rad off the path"
                f"{', beyond what is relaxed' if self.deviations else ''}{self._damping_text}"
            )
        return "not verified: " + "; ".join(self.failures)

    @property
    def _damping_text(self) -> str:
        return f"; damped {' and '.join(map(str, self.damped))}" if self.damped else ""
