"""Coordinates of an arm's posture: a joint, the position of a link, the swivel of the elbow."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    TURN,
    Array,
    ProblemError,
    Saved,
    as_number,
    as_numbers,
    nearest,
    series,
)
from selfmotion.model.robot.chain import WORLD, Chain
from selfmotion.model.robot.chain_series import ChainSeries
from selfmotion.model.robot.model import RobotModel

# Largest range of joints with limits [rad].
_MAX_TURNS = 4.0 * np.pi


def check_radians(robot: RobotModel, values: Array, what: str, called: str) -> None:
    """Raise ProblemError for `called` coordinates (n,) of revolute joints that are in degrees."""
    for name, value in zip(robot.joint_names, values, strict=True):
        if np.isfinite(value) and abs(value) > _MAX_TURNS and not robot.is_prismatic(name):
            raise ProblemError(
                f"{what}: joint '{name}': {value:.6g} rad is {value / (2.0 * np.pi):.1f} turns; "
                f"{called} are in radians (numpy.radians), ±inf for none"
            )


# Relative distance of an elbow from the line from shoulder to wrist below which there is no swivel,
# and of a reference below which it gives no zero.
_STRAIGHT = 1e-9
# Largest number of names in a message.
_FEW = 12


class Coordinate(Saved, ABC, family="coordinate"):
    """A number that follows from a configuration, with its gradient.

    Attributes
    ----------
    period : float
        Difference of two equal values: 2π for an angle; inf for none.
    unit : str
    """

    period: float = np.inf
    unit: str = "rad or m"

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name in messages."""

    @abstractmethod
    def __call__(self, robot: RobotModel, q: Array) -> tuple[Array, Array]:
        """Return values (K,) and gradients (K, n) at configurations (K, n).

        Raises
        ------
        ProblemError
            The arm has no such joint or frame; the nearest names are offered.
        """

    def series(self, chain: ChainSeries, q: Array) -> Array | None:
        """Return majorants (K + 1, I) on intervals whose middles are q (I, n); None for unknown.

        Inf without a bound. Only rows from 1 on count. A coordinate without series is judged by
        samples: no proof.
        """
        return None

    def check_value(self, value: float, what: str) -> None:
        """Raise ProblemError for an invalid value, or an angle in degrees."""
        number = as_number(value, what)
        if np.isfinite(self.period) and abs(number) > TURN:
            raise ProblemError(f"{what} is {number:g} rad, more than a turn; in degrees?")

    def away(self, values: Array, center: float) -> Array:
        """Return the distances of values (K,) from a centre, modulo the period."""
        away = values - center
        if np.isfinite(self.period):
            away = away - self.period * np.round(away / self.period)
        return away


@dataclass(frozen=True)
class JointCoordinate(Coordinate):
    """A joint's own coordinate [rad or m].

    Parameters
    ----------
    joint : str
    """

    joint: str

    @property
    @override
    def name(self) -> str:
        return f"joint '{self.joint}'"

    @override
    def __call__(self, robot: RobotModel, q: Array) -> tuple[Array, Array]:
        if self.joint not in robot.joint_names:
            raise ProblemError(
                f"{robot.name}: no joint '{self.joint}' for a coordinate"
                f"{nearest(self.joint, robot.joint_names) or _choice(robot.joint_names)}"
            )
        k = robot.joint_names.index(self.joint)
        return q[:, k], np.tile(np.eye(robot.dof)[k], (len(q), 1))

    @override
    def series(self, chain: ChainSeries, q: Array) -> Array:
        """Return the joint's own."""
        return np.asarray(chain.joints[chain.robot.joint_names.index(self.joint)])


@dataclass(frozen=True, eq=False)
class FrameCoordinate(Coordinate):
    """Position of a link or frame along a direction [m]: d · p(q), world axes.

    Parameters
    ----------
    frame : str
        A link or joint of the URDF.
    direction : (3,)
        d, made a unit vector; upwards by default.
    """

    frame: str
    direction: npt.ArrayLike = (0.0, 0.0, 1.0)
    unit = "m"

    def __post_init__(self) -> None:
        given = as_numbers(self.direction, "coordinate: direction", "three numbers", (3,))
        if not np.any(given):
            raise ProblemError("coordinate: direction is zero, expected a direction")

    @property
    @override
    def name(self) -> str:
        return f"place of '{self.frame}'"

    @override
    def __call__(self, robot: RobotModel, q: Array) -> tuple[Array, Array]:
        direction = np.asarray(self.direction, dtype=np.float64)
        direction = direction / np.linalg.norm(direction)
        ((places, jacobians),) = _points(robot, q, (self.frame,))
        return places @ direction, np.einsum("c,kcn->kn", direction, jacobians)

    @override
    def series(self, chain: ChainSeries, q: Array) -> Array:
        return chain.place(_frame(chain.robot, self.frame))


@dataclass(frozen=True, eq=False)
class SwivelAngle(Coordinate):
    """The angle of the elbow about the line from shoulder to wrist [rad].

    0 where the elbow lies on the side of `reference`, growing right-handed about the direction from
    shoulder S to wrist W: θ = atan2(a·(r × e), r·e - (a·r)(a·e)) with a = (W - S)/|W - S|,
    e = E - S (K. Kreutz-Delgado, M. Long, H. Seraji, Int. J. Robotics Research 11(5), 1992).

    Parameters
    ----------
    reference : (3,)
        r, world axes; upwards by default.
    shoulder, elbow, wrist : str, optional
        Links or joints whose frames lie there. By default the second, fourth and sixth joint of an
        arm with seven revolute ones.
    """

    reference: npt.ArrayLike = (0.0, 0.0, 1.0)
    shoulder: str | None = None
    elbow: str | None = None
    wrist: str | None = None
    period = 2.0 * np.pi
    unit = "rad"

    def __post_init__(self) -> None:
        given = as_numbers(self.reference, "swivel angle: reference", "three numbers", (3,))
        if not np.any(given):
            raise ProblemError("swivel angle: reference is zero, expected a direction")

    @property
    @override
    def name(self) -> str:
        return "swivel angle"

    @override
    def __call__(self, robot: RobotModel, q: Array) -> tuple[Array, Array]:
        (s, by_s), (e, by_e), (w, by_w) = _points(robot, q, self.frames(robot))
        r = np.asarray(self.reference, dtype=np.float64)
        r = r / np.linalg.norm(r)
        line, by_line = w - s, by_w - by_s
        length = np.linalg.norm(line, axis=1)
        a = line / length[:, None]
        # da = (I - aaᵀ) d(W - S) / |W - S|.
        along = np.einsum("kc,kcn->kn", a, by_line)
        by_a = (by_line - a[:, :, None] * along[:, None]) / length[:, None, None]
        arm, by_arm = e - s, by_e - by_s
        normal = np.cross(r, arm)
        sine = np.einsum("kc,kc->k", a, normal)
        ar, ae = a @ r, np.einsum("kc,kc->k", a, arm)
        cosine = arm @ r - ar * ae
        by_sine = np.einsum("kcn,kc->kn", by_a, normal)
        by_sine += np.einsum("kc,kcn->kn", np.cross(a, r), by_arm)
        by_ar = np.einsum("c,kcn->kn", r, by_a)
        by_ae = np.einsum("kcn,kc->kn", by_a, arm) + np.einsum("kc,kcn->kn", a, by_arm)
        by_cosine = np.einsum("c,kcn->kn", r, by_arm)
        by_cosine -= by_ar * ae[:, None] + ar[:, None] * by_ae
        size = np.maximum(sine**2 + cosine**2, (_STRAIGHT * length) ** 2)[:, None]
        gradient = (cosine[:, None] * by_sine - sine[:, None] * by_cosine) / size
        return np.arctan2(sine, cosine), gradient

    @override
    def series(self, chain: ChainSeries, q: Array) -> Array:
        """Return that of arg(C + iS) with |a|² = 1 multiplied out.

        With l = W - S and L = |l|: S = L l·(r × e) and C = L² r·e - (l·r)(l·e). The logarithm of
        C + iS has a majorant where it keeps away from 0, and none near the stretched arm.
        """
        points = _points(chain.robot, q, self.frames(chain.robot))
        s, e, w = (chain.place(_frame(chain.robot, name)) for name in self.frames(chain.robot))
        (at_s, _), (at_e, _), (at_w, _) = points
        r = np.asarray(self.reference, dtype=np.float64)
        r = r / np.linalg.norm(r)
        middle_line, middle_arm = at_w - at_s, at_e - at_s
        line, arm = w + s, e + s
        line[0] = np.linalg.norm(middle_line, axis=1) + series.after_first(line)
        arm[0] = np.linalg.norm(middle_arm, axis=1) + series.after_first(arm)
        squared = series.product(line, line)
        length = np.einsum("kc,kc->k", middle_line, middle_line)
        low = length - series.after_first(squared)
        known = low > 0.0
        root = series.root(np.where(known, low, 1.0), squared[0], len(line))
        area = series.product(line, arm)
        sine = series.product(series.composed(root, squared), area)
        cosine = series.product(squared, arm) + series.product(line, area)
        number = sine + cosine
        at_sine = np.sqrt(length) * np.einsum("kc,kc->k", middle_line, np.cross(r, middle_arm))
        at_cosine = length * (middle_arm @ r)
        at_cosine -= (middle_line @ r) * np.einsum("kc,kc->k", middle_line, middle_arm)
        least = np.hypot(at_sine, at_cosine) - series.after_first(number)
        known &= least > 0.0
        found = series.logarithm(number / np.where(known, least, 1.0))
        return np.where(known, found, np.inf)

    def frames(self, robot: RobotModel) -> tuple[str, str, str]:
        """Return the links of shoulder, elbow and wrist; ProblemError where they are not known."""
        given = self.shoulder, self.elbow, self.wrist
        turning = robot.dof == 7 and not any(map(robot.is_prismatic, robot.joint_names))
        if not turning and None in given:
            raise ProblemError(
                f"{robot.name}: which links are shoulder, elbow and wrist is known of arms with "
                f"seven revolute joints only; name them: SwivelAngle(shoulder=, elbow=, wrist=)"
            )
        joints = [robot.joint_names[k] for k in (1, 3, 5)] if turning else []
        first, second, third = (joints[k] if name is None else name for k, name in enumerate(given))
        return first, second, third


def _points(robot: RobotModel, q: Array, names: tuple[str, ...]) -> list[tuple[Array, Array]]:
    """Return places (K, 3) and linear Jacobians (K, 3, n) of frames."""
    chains = _chains_of.setdefault(robot, {})
    found = []
    for name in names:
        if name not in chains:
            chains[name] = Chain(robot.model, _frame(robot, name), WORLD, robot.coupling)
        jacobians, _, places = chains[name].along(q)
        found.append((places, jacobians[:, :3]))
    return found


# Chains to frames of coordinates, built once by arm.
_chains_of: WeakKeyDictionary[RobotModel, dict[str, Chain]] = WeakKeyDictionary()


def _frame(robot: RobotModel, name: str) -> int:
    known = [frame.name for frame in robot.model.frames]
    if name not in known:
        raise ProblemError(
            f"{robot.name}: no link or joint '{name}' for a coordinate"
            f"{nearest(name, known) or _choice(robot.urdf.links)}"
        )
    return known.index(name)


def _choice(names: Sequence[str]) -> str:
    """Return the clause of known names without a near one, unless there are too many."""
    listed = ", ".join(repr(name) for name in names[:_FEW])
    return f", expected one of: {listed}{', …' if len(names) > _FEW else ''}"
