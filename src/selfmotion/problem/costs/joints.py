"""Costs of the joints alone: quadratic forms of motion, path length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    Array,
    ProblemError,
    as_number,
    as_numbers,
    as_whole,
    plain_numbers,
    read_only,
    shown,
)
from selfmotion.model.follow import Follows
from selfmotion.model.robot import RobotModel, check_radians
from selfmotion.problem.costs.base import (
    Cost,
    Partials,
    as_weight,
    check_mu,
    check_name,
    check_weight,
    half_square,
    weight_matrix,
    weighted,
)
from selfmotion.problem.costs.samples import Samples


@dataclass(frozen=True, eq=False)
class _Quadratic(Cost):
    """Base of the quadratic costs: the weight W."""

    is_pointwise: ClassVar[bool] = True

    weight: float | npt.ArrayLike = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "weight", as_weight(self.weight, self.name))

    @property
    def _w(self) -> Array:
        return np.asarray(self.weight)

    @override
    def check(self, follows: Follows) -> None:
        check_weight(self._w, follows.robot.dof, self.name)


@dataclass(frozen=True, eq=False)
class _Derivative(_Quadratic):
    """½ xᵀWx for a derivative x of q."""

    is_quadratic: ClassVar[bool] = True
    _order: ClassVar[int]

    @override
    def value(self, samples: Samples) -> Array:
        return half_square(self._w, self._of(samples))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """Wx."""
        return Partials(**{_DERIVATIVES[self._order]: weighted(self._w, self._of(samples))})

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        """W."""
        return {self._order: weight_matrix(self._w, dof)}

    def _of(self, samples: Samples) -> Array:
        derivative: Array = getattr(samples, _DERIVATIVES[self._order])
        return derivative


_DERIVATIVES = {1: "qd", 2: "qdd", 3: "qddd"}


@dataclass(frozen=True, eq=False)
class JointVelocity(_Derivative):
    """Joint speed: G = ½ q̇ᵀWq̇ [rad²/s²], the first term of the paper's eq. 11 and 12.

    Parameters
    ----------
    weight : float, (n,) or (n, n)
        W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.
        Problem files without one, and problems without costs, have that of `usual`.
    """

    name: str = "joint velocity"
    _order: ClassVar[int] = 1

    @classmethod
    def usual(cls, robot: RobotModel) -> JointVelocity:
        """Return that of an arm where no weight is given: W = 1, but for metres among radians.

        A joint that moves in metres has the weight of `RobotModel.speed_weights`, whose squares are
        W; the name of the cost says so. `make bench NAME=rails` compares these with levers and
        masses.
        """
        slides = [robot.is_prismatic(name) for name in robot.joint_names]
        if all(slides) or not any(slides):
            return cls()
        weights = robot.speed_weights
        metre = float(weights[slides.index(True)])
        return cls(weights**2, f"joint velocity (1 m as {metre:.3g} rad)")

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        """Without a weight it is the usual one of the robot."""
        robot = context.get("robot")
        if isinstance(robot, RobotModel) and "weight" not in values:
            usual = cls.usual(robot)
            values = {"name": usual.name, **values, "weight": usual.weight}
        return super().from_dict(values, **context)


def metres_of(costs: Sequence[Cost], robot: RobotModel) -> dict[str, float]:
    """Return the weight of a metre of each prismatic joint in the first cost of joint rates [rad].

    Against a radian of the revolute ones, on average; of an arm of one kind of joints nothing.
    """
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    rates = next((cost for cost in costs if isinstance(cost, _Derivative)), None)
    if rates is None or slides.all() or not slides.any():
        return {}
    weights = np.diag(weight_matrix(rates._w, robot.dof))
    usual = float(weights[~slides].mean())
    if usual == 0.0:
        return {}
    names = np.array(robot.joint_names)[slides].tolist()
    return dict(zip(names, np.sqrt(weights[slides] / usual).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class JointAcceleration(_Derivative):
    """Joint acceleration: G = ½ q̈ᵀWq̈ [rad²/s⁴], q̈ by five-point differences of q̇.

    Parameters
    ----------
    weight : float, (n,) or (n, n)
        W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.
    """

    name: str = "joint acceleration"
    _order: ClassVar[int] = 2


@dataclass(frozen=True, eq=False)
class JointJerk(_Derivative):
    """Joint jerk: G = ½ q⃛ᵀWq⃛ [rad²/s⁶], q⃛ by five-point differences of q̇.

    Parameters
    ----------
    weight : float, (n,) or (n, n)
        W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.
    """

    name: str = "joint jerk"
    _order: ClassVar[int] = 3


@dataclass(frozen=True, eq=False)
class Posture(_Quadratic):
    """Distance from a posture: G = ½ (q - q*)ᵀW(q - q*) [rad²].

    Parameters
    ----------
    weight : float, (n,) or (n, n)
        W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.
    posture : (n,)
        q* [rad or m].
    """

    is_quadratic: ClassVar[bool] = True

    name: str = "posture"
    posture: npt.ArrayLike = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(
            self, "posture", as_numbers(self.posture, f"cost '{self.name}': posture")
        )

    @override
    def value(self, samples: Samples) -> Array:
        return half_square(self._w, samples.q - np.asarray(self.posture))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """W(q - q*)."""
        return Partials(q=weighted(self._w, samples.q - np.asarray(self.posture)))

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        return {0: weight_matrix(self._w, dof)}

    @override
    def check(self, follows: Follows) -> None:
        robot = follows.robot
        super().check(follows)
        posture = np.asarray(self.posture)
        if posture.shape != (robot.dof,) or not np.all(np.isfinite(posture)):
            raise ProblemError(
                f"cost '{self.name}': posture is {posture}, expected {robot.dof} finite numbers"
            )
        check_radians(robot, posture, f"{robot.name}: cost '{self.name}'", "postures")


@dataclass(frozen=True, eq=False)
class JointLimitDistance(Cost):
    """Distance from the joint limits: G = μ Σ_i ((q_i - c_i) / h_i)^p.

    c is the middle and h half the width of the range: 0 in the middle, μ at a limit, steep beyond.
    With p = 2 the classical criterion (A. Liégeois, IEEE Trans. SMC 7(12), 1977, up to a factor);
    larger p leaves the middle of the range free. Joints without limits do not count.

    Parameters
    ----------
    lower, upper : (n,), optional
        Limits [rad or m]; by default those of the arm's URDF.
    mu : float
        μ ≥ 0.
    power : int
        p, even.
    """

    is_pointwise: ClassVar[bool] = True

    lower: npt.ArrayLike | None = None
    upper: npt.ArrayLike | None = None
    mu: float = 1.0
    power: int = 6
    name: str = "joint limits"

    def __post_init__(self) -> None:
        for key in _BOTH:
            if getattr(self, key) is not None:
                given = _limits(getattr(self, key), f"cost '{self.name}': {key}")
                object.__setattr__(self, key, given)
        if self.lower is not None and self.upper is not None:
            self._check_order(np.asarray(self.lower), np.asarray(self.upper))
        check_mu(self.mu, self.name)
        if as_whole(self.power, f"cost '{self.name}': power", 2, 1000) % 2:
            raise ProblemError(f"cost '{self.name}': power is {self.power}, expected 2, 4, 6, …")

    @override
    def value(self, samples: Samples) -> Array:
        return np.asarray(self.mu * np.sum(self._relative(samples) ** self.power, axis=1))

    @override
    def gradient(self, samples: Samples) -> Partials:
        relative = self._relative(samples) ** (self.power - 1)
        return Partials(q=self.mu * self.power * relative * self._scale(samples.follows.robot)[1])

    @override
    def check(self, follows: Follows) -> None:
        robot = follows.robot
        check_mu(self.mu, self.name)
        for limits in self._range(robot):
            if limits.shape != (robot.dof,):
                raise ProblemError(
                    f"cost '{self.name}': limits for {limits.shape} joints, expected ({robot.dof},)"
                )
        self._check_order(*self._range(robot))

    def _check_order(self, lower: Array, upper: Array) -> None:
        if lower.shape != upper.shape or not np.all(lower < upper):
            raise ProblemError(
                f"cost '{self.name}': lower {shown(lower)} is not below upper {shown(upper)}"
            )

    def _range(self, robot: RobotModel) -> tuple[Array, Array]:
        """Return the limits, those of the URDF where none are given."""
        lower = robot.lower if self.lower is None else np.asarray(self.lower)
        upper = robot.upper if self.upper is None else np.asarray(self.upper)
        return lower, upper

    def _scale(self, robot: RobotModel) -> tuple[Array, Array]:
        """Middle of the range, and 1/h (0 without limits)."""
        lower, upper = self._range(robot)
        limited = np.isfinite(lower) & np.isfinite(upper)
        lower, upper = np.where(limited, lower, -1.0), np.where(limited, upper, 1.0)
        return 0.5 * (lower + upper), np.where(limited, 2.0 / (upper - lower), 0.0)

    def _relative(self, samples: Samples) -> Array:
        middle, inverse = self._scale(samples.follows.robot)
        return (samples.q - middle) * inverse


_BOTH = ("lower", "upper")


def _limits(values: npt.ArrayLike, what: str) -> Array:
    """Return limits (n,), infinite for none; ProblemError if they are no numbers."""
    array = plain_numbers(values)
    if array is None or array.ndim != 1 or np.any(np.isnan(array)):
        raise ProblemError(
            f"{what} is {shown(values)}, expected a number for each joint, ±inf for none"
        )
    return read_only(array)


@dataclass(frozen=True, eq=False)
class PathLength(Cost):
    """Length of the joint path, joint by joint: G = Σ_i w_i (√(q̇_i² + δ²) - δ) [rad/s].

    Its integral is Σ_i w_i ∫ |q̇_i| dt, the weighted path lengths of the joints, but smooth where a
    joint reverses.

    Parameters
    ----------
    smoothing : float
        δ [rad/s]; the integral is too small by at most nδT.
    joint_weights : (n,), optional
        w ≥ 0, such as `RobotModel.joint_weights`; 1 for every joint by default, which adds up
        radians only: an arm with prismatic joints has to be given some.
    """

    is_pointwise: ClassVar[bool] = True

    smoothing: float = 1e-2
    joint_weights: npt.ArrayLike | None = None
    name: str = "path length"

    def __post_init__(self) -> None:
        if self.joint_weights is not None:
            object.__setattr__(self, "joint_weights", read_only(self.joint_weights))

    @override
    def value(self, samples: Samples) -> Array:
        lengths = np.hypot(samples.qd, self.smoothing) - self.smoothing
        return np.asarray(np.sum(self._w * lengths, axis=1))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """W_i q̇_i / √(q̇_i² + δ²)."""
        return Partials(qd=self._w * samples.qd / np.hypot(samples.qd, self.smoothing))

    @override
    def check(self, follows: Follows) -> None:
        robot = follows.robot
        check_name(self.name)
        as_number(self.smoothing, f"cost '{self.name}': smoothing", above=0.0)
        weights = self._w
        if weights.shape not in ((), (robot.dof,)) or not np.all(weights >= 0.0):
            raise ProblemError(
                f"cost '{self.name}': joint_weights are {weights}, expected {robot.dof} numbers ≥ 0"
            )
        slides = [name for name in robot.joint_names if robot.is_prismatic(name)]
        if slides and self.joint_weights is None:
            raise ProblemError(
                f"cost '{self.name}': joint '{slides[0]}' moves in metres, others turn in radians; "
                f"say what they count with joint_weights=robot.joint_weights, or your own"
            )

    @property
    def _w(self) -> Array:
        return np.asarray(1.0 if self.joint_weights is None else self.joint_weights)
