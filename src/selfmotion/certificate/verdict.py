"""Certificate of a finished motion, and the verdict."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import in_angle, in_length
from selfmotion.certificate.limits import LIMIT_NAMES
from selfmotion.certificate.requirement import (
    USUAL,
    DampedStretch,
    Extreme,
    Finding,
    Tolerance,
    of_some,
)

# Usual requirements, which a verdict names where they were not judged.
NOT_JUDGED = (
    "its certificate is of another motion or problem: judge it again, "
    "replace(plan, certificate=plan.check())"
)
_EXPECTED = ("path", "joint limits", "speeds", "accelerations", "self-collision")


def allowed_text(tolerance: Tolerance) -> str:
    """Return the clause of a verdict for a larger tolerance than usual, "" for the usual one."""
    if tolerance.position <= USUAL.position and tolerance.rotation <= USUAL.rotation:
        return ""
    position, rotation = in_length(tolerance.position), in_angle(tolerance.rotation)
    return f" ({position} and {rotation} are allowed)"


def relaxed_text(relaxed: bool) -> str:
    """Return the clause of a verdict for relaxed rows, "" without any."""
    return ", apart from its tolerances, which are kept" if relaxed else ""


def first_of(failures: Sequence[str]) -> str:
    """Return the first failure, and the number of others."""
    more = len(failures) - 1
    return f"not verified: {failures[0]}{f'; and {more} more' if more else ''}"


@dataclass(frozen=True)
class Certificate:
    """Judgement of a finished motion by forward kinematics, at all times.

    Attributes
    ----------
    position_error : Extreme
        Largest distance of the tool from the path, in the prescribed rows, in excess of relaxations
        [m].
    rotation_error : Extreme
        Largest angle from the path's orientation, likewise [rad].
    smallest_singular_value : Extreme
        Of the task Jacobian: distance from singular poses.
    closure : float
        max |q(T) - q(0)| [rad or m].
    samples : int
        Number of times at which the motion was evaluated.
    tolerance : Tolerance
        Allowed error from the path.
    findings : tuple of Finding
        Result of each requirement, the arm's own limits first.
    failures : tuple of str
        Violations, in words; empty for a verified motion.
    covers : tuple of str
        Checks at all times: "path", "joint limits", "speeds", "self-collision", …
    remarks : tuple of str
        Gaps of the requirements: pairs of links, open meshes.
    deviations : tuple of Extreme
        For each relaxation the largest deviation of its rows from the path, in its window [m or
        rad].
    damped : tuple of DampedStretch
        Where the inverse was damped, in order of time.
    notes : tuple of str
        Notes for readers that speak neither for nor against the motion.
    others : tuple of (Extreme, Extreme)
        Errors of position and rotation of further task frames.
    motion, problem : str
        Digests of the motion and of its problem; "" where the motion was judged without a
        `Problem`.
    version : str
        Of the package that judged.
    """

    position_error: Extreme
    rotation_error: Extreme
    smallest_singular_value: Extreme
    closure: float
    samples: int
    tolerance: Tolerance
    findings: tuple[Finding, ...]
    failures: tuple[str, ...]
    covers: tuple[str, ...] = ("path",)
    remarks: tuple[str, ...] = ()
    deviations: tuple[Extreme, ...] = ()
    damped: tuple[DampedStretch, ...] = ()
    notes: tuple[str, ...] = ()
    others: tuple[tuple[Extreme, Extreme], ...] = ()
    motion: str = ""
    problem: str = ""
    version: str = ""

    def of_another(self) -> "Certificate":
        """Return the certificate of a motion that was not judged: this tolerance, and no number."""
        nothing = Extreme(np.nan, np.nan, self.position_error.name)
        return Certificate(
            nothing, nothing, nothing, np.nan, 0, self.tolerance, (), (NOT_JUDGED,), covers=()
        )

    @property
    def limit_margin(self) -> Extreme:
        """Smallest distance of a joint from its position limits [rad or m]; negative beyond."""
        return self._required(LIMIT_NAMES[0], min)

    @property
    def velocity_ratio(self) -> Extreme:
        """Largest |q̇| relative to the joint's limit; above 1 it is exceeded."""
        return self._required(LIMIT_NAMES[1], max)

    @property
    def acceleration_ratio(self) -> Extreme | None:
        """Largest |q̈| relative to its limits; None without any."""
        return self._worst(LIMIT_NAMES[2], max)

    @property
    def clearance(self) -> Extreme | None:
        """Smallest distance between bodies [m], with their names; None if not required."""
        return self._worst("clearance", min)

    @property
    def not_checked(self) -> tuple[str, ...]:
        """Usual requirements that were not judged."""
        return tuple(
            f"{name} of the other joints" if of_some(name) in self.covers else name
            for name in _EXPECTED
            if name not in self.covers
        )

    @property
    def on_path(self) -> bool:
        """Whether the tool follows the path within the tolerance, in excess of relaxations."""
        allowed = self.tolerance
        # Written so that NaN fails.
        return all(
            position.value <= allowed.position and rotation.value <= allowed.rotation
            for position, rotation in self._errors
        )

    def __repr__(self) -> str:
        return f"Certificate({self.verdict})"

    @property
    def verified(self) -> bool:
        """Whether the motion follows the path within tolerance and satisfies all requirements."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or the violations."""
        if self.verified:
            return (
                f"verified at all times ({', '.join(self.covers)}): at most "
                f"{in_length(self.position_error.value)} and {in_angle(self.rotation_error.value)} "
                f"off the path{relaxed_text(bool(self.deviations))}{allowed_text(self.tolerance)}"
                f"{self._others_text}"
                f"{self._besides}"
            )
        return "; ".join(("not verified: " + "; ".join(self.failures), *self.notes))

    @property
    def summary(self) -> str:
        """The verdict in short: the largest error, or the first violation; see `verdict`.

        It includes requirements that were not judged, damping, and notes.
        """
        if not self.verified:
            return "; ".join((first_of(self.failures), *self.notes))
        position = max(one.value for one, _ in self._errors)
        rotation = max(one.value for _, one in self._errors)
        return (
            f"verified at all times: at most {in_length(position)} and {in_angle(rotation)} "
            f"off the path{relaxed_text(bool(self.deviations))}{allowed_text(self.tolerance)}"
            f"{self._besides}"
        )

    @property
    def _errors(self) -> tuple[tuple[Extreme, Extreme], ...]:
        return ((self.position_error, self.rotation_error), *self.others)

    @property
    def _besides(self) -> str:
        """Damping, requirements that were not judged, and notes."""
        left_out = f"; not checked: {', '.join(self.not_checked)}" if self.not_checked else ""
        return f"{self._damping_text}{left_out}{''.join(f'; {note}' for note in self.notes)}"

    @property
    def _others_text(self) -> str:
        return "".join(
            f", '{position.name}' {in_length(position.value)} and {in_angle(rotation.value)} off "
            f"its path"
            for position, rotation in self.others
        )

    @property
    def _damping_text(self) -> str:
        return f"; damped {' and '.join(map(str, self.damped))}" if self.damped else ""

    def _worst(self, name: str, choose: Callable[..., Finding]) -> Extreme | None:
        found = [item for item in self.findings if item.requirement == name]
        return choose(found, key=lambda item: item.amount).extreme if found else None

    def _required(self, name: str, choose: Callable[..., Finding]) -> Extreme:
        worst = self._worst(name, choose)
        if worst is None and not self.motion:
            # Nothing was judged: see `of_another`.
            return Extreme(np.nan, np.nan, "")
        if worst is None:
            raise RuntimeError(f"a certificate always judges {name}")
        return worst
