"""The redundancy map of a plan: what its self-motion could have chosen, and what stops it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    Flags,
    Ints,
    ProblemError,
    Progress,
    as_path,
    as_whole,
    read_archive,
    silent,
    write_archive,
)
from selfmotion.model.follow import chain_tables, completed
from selfmotion.model.motion import Trajectory
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.redundancy.axis import Axis, axis_of
from selfmotion.planning.redundancy.judging import NEAR_SINGULAR, Judge, LocalMotion, Reason
from selfmotion.planning.redundancy.kernels import continue_all
from selfmotion.planning.redundancy.picture import drawn
from selfmotion.planning.search import Manifold
from selfmotion.problem.constraints import ActiveConstraint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Pixels along the path and up: a second of the shell's patience, and three degrees of a turn.
PIXELS = (121, 121)
# Largest number of pixels to a side: a hundred times as many take minutes.
_MAX_PIXELS = 2000
# Configurations that are judged at once.
_AT_ONCE = 1000
# Samples of a plan's line between two pixels: angles between them turn by much less than π.
_BETWEEN = 8
# Kind of a file of a map.
_KIND = "redundancy map"
# Arrays of a file, by their fields.
_ARRAYS = (
    "times",
    "coordinate",
    "state",
    "cause",
    "cost",
    "q",
    "plan_line",
    "plan_state",
    "minimum_norm_line",
)


@dataclass(frozen=True, eq=False)
class RedundancyMap:
    """Time along the path against the self-motion's coordinate: what stops the arm where.

    A pixel is the configuration with the tool in its place at that time and with that value of the
    coordinate, continued along the self-motion from the plan's own configuration at that time: of
    the plan's branch. Where the branch turns back or ends before, there is none. With more than
    one degree of redundancy it is a slice: from pixel to pixel joints move as little as they have
    to.

    Attributes
    ----------
    label : str
        The coordinate in words.
    unit : str
        Its unit, ``"rad"`` or ``"m"``.
    joint_names : tuple of str
        The n joints of `q`.
    redundancy : int
        Degrees of redundancy; where more than 1, the map is a slice.
    times : (N,)
        [s].
    coordinate : (M,)
        Values of the coordinate, of angles also beyond ±π [rad or m].
    state : (N, M)
        What stops the arm, values of `Reason`.
    cause : (N, M)
        What exactly, a row of `causes`; -1 for nothing.
    causes : tuple of str
        In words, with the joint or the bodies.
    cost : (N, M)
        Cost density G with the joint velocities J⁺ẋ: of no self-motion; costs of accelerations are
        left out. NaN without a configuration.
    q : (N, M, n)
        Configurations [rad or m]; NaN where there is none.
    plan_line : (N,)
        The plan's own coordinate.
    plan_state : (N,)
        What stops the plan's own configurations, by the same checks.
    minimum_norm_line : (N,)
        The minimum-norm motion's coordinate; NaN after its end. It may be on another branch.
    """

    label: str
    unit: str
    joint_names: tuple[str, ...]
    redundancy: int
    times: Array
    coordinate: Array
    state: Ints
    cause: Ints
    causes: tuple[str, ...]
    cost: Array
    q: Array
    plan_line: Array
    plan_state: Ints
    minimum_norm_line: Array

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            getattr(self, name).setflags(write=False)

    def __repr__(self) -> str:
        shares = {reason: float(np.mean(self.state == reason)) for reason in Reason}
        said = ", ".join(
            f"{share:.0%} {reason.name.lower().replace('_', ' ')}"
            for reason, share in shares.items()
            if share > 0.0
        )
        rows, columns = self.state.shape
        return f"RedundancyMap({self.label} over time, {rows} × {columns} pixels: {said})"

    @property
    def allowed(self) -> Flags:
        """Where nothing stops the arm, (N, M)."""
        return np.asarray(self.state == Reason.ALLOWED)

    def reason(self, i: int, j: int) -> str:
        """Return in words what stops the arm at a pixel; "" for nothing."""
        if self.state[i, j] == Reason.NO_CONFIGURATION:
            return "no configuration"
        return self.causes[self.cause[i, j]] if self.cause[i, j] >= 0 else ""

    def figure(self) -> Figure:
        """Return the map as a matplotlib figure (``pip install 'selfmotion[plots]'``).

        Raises
        ------
        RenderError
            matplotlib is not installed.
        """
        return drawn(self)

    def save_png(self, file: str | Path) -> Path:
        """Write the picture of `figure` as a PNG file, and return its path.

        Raises
        ------
        RenderError
            matplotlib is not installed.
        """
        from selfmotion.basics import write_atomically

        path, figure = as_path(file), self.figure()
        write_atomically(path, lambda stream: figure.savefig(stream, format="png", dpi=_DPI))
        return path

    def save(self, file: str | Path) -> Path:
        """Write all arrays, without loss, to a ``.npz`` file that `load` reads; return its path."""
        path = as_path(file)
        description = {
            "kind": _KIND,
            "label": self.label,
            "unit": self.unit,
            "joint_names": list(self.joint_names),
            "redundancy": self.redundancy,
            "causes": list(self.causes),
        }
        write_archive(path, description, {name: getattr(self, name) for name in _ARRAYS})
        return path

    @classmethod
    def load(cls, file: str | Path) -> RedundancyMap:
        """Read a file of `save`.

        Raises
        ------
        FileFormatError
            The file is missing, or holds no redundancy map.
        """
        path = as_path(file)
        said, arrays = read_archive(path)
        texts = ("label", "unit", "joint_names", "redundancy", "causes")
        missing = [name for name in (*texts, *_ARRAYS) if name not in {**said, **arrays}]
        if said.get("kind") != _KIND or missing:
            raise FileFormatError(f"{path}: holds no {_KIND}")
        given: dict[str, Any] = {name: said[name] for name in texts}
        for name in ("joint_names", "causes"):
            given[name] = tuple(map(str, given[name]))
        given.update({name: arrays[name] for name in _ARRAYS})
        return cls(**given)


# Resolution of a picture [dots per inch].
_DPI = 150


def redundancy_map_of(
    formulation: Formulation,
    motion: Trajectory,
    initial: Trajectory,
    coordinate: str | None,
    shape: tuple[int, int],
    active: Sequence[ActiveConstraint] = (),
    progress: Progress = silent,
) -> RedundancyMap:
    """Return the map of a motion; see `Plan.redundancy_map`.

    Parameters
    ----------
    formulation : Formulation
        Of the plan's problem.
    motion, initial : Trajectory
        The plan's, and the minimum-norm motion, of the arm.
    coordinate : str or None
        ``"tool"``, ``"elbow"``, or a joint; None for the rule of `axis_of`.
    shape : (int, int)
        Numbers N and M of pixels.
    active : sequence of ActiveConstraint
        What keeps the motion from a lower cost.
    progress : callable
        Told how many of the times are judged.

    Raises
    ------
    ProblemError
        There is no such coordinate, or the shape is no shape.
    """
    columns, rows = _shape(shape)
    times = np.linspace(float(motion.t[0]), float(motion.t[-1]), columns)
    z = completed(formulation.follows, times, motion(times))
    axis = axis_of(formulation, motion, coordinate, active)
    line = _line(formulation, axis, motion, times)
    start = _line(formulation, axis, initial, times)
    if axis.turns:
        start -= 2.0 * np.pi * np.round((start[0] - line[0]) / (2.0 * np.pi))
    values = axis.grid([line, start[np.isfinite(start)]], rows)
    found = _continued(formulation, axis, times, z, line, values)
    judged = _judged(formulation, times, z, found, progress)
    return RedundancyMap(
        axis.label,
        axis.unit,
        formulation.robot.joint_names,
        formulation.follows.redundancy,
        times,
        values,
        q=np.array(found[:, :, : formulation.robot.dof]),
        plan_line=line,
        minimum_norm_line=start,
        **judged,
    )


def _judged(
    formulation: Formulation, times: Array, z: Array, found: Array, progress: Progress
) -> dict[str, Any]:
    """Return what stops configurations (N, M, n) and the plan's own (N, n), and what they cost."""
    reached = np.asarray(~np.isnan(found).any(axis=2))
    state = np.full(reached.shape, int(Reason.NO_CONFIGURATION), dtype=np.int64)
    cause, cost = np.full(reached.shape, -1, dtype=np.int64), np.full(reached.shape, np.nan)
    judge, own = Judge(formulation), LocalMotion(formulation, times, z)
    # Some at a time, so that others may ask for something else in between.
    some = max(_AT_ONCE // found.shape[1], 1)
    parts = [slice(first, first + some) for first in range(0, len(times), some)]
    local = [
        LocalMotion(
            formulation,
            np.broadcast_to(times[part, None], reached[part].shape)[reached[part]],
            np.ascontiguousarray(found[part][reached[part]]),
        )
        for part in parts
    ]
    known = [one for one in (own, *local) if len(one.t)]
    largest = [float(one.singular_values.max()) for one in known]
    least = NEAR_SINGULAR * max(largest)
    for part, one in zip(parts, local, strict=True):
        progress("redundancy map", min(part.stop, len(times)), len(times))
        if len(one.t):
            here = reached[part]
            state[part][here], cause[part][here] = judge.judge(one, least)
            cost[part][here] = one.cost()
    plan_state, _ = judge.judge(own, least)
    given = {"state": state, "cause": cause, "cost": cost, "plan_state": plan_state}
    return {**given, "causes": tuple(judge.causes)}


def _shape(shape: tuple[int, int]) -> tuple[int, int]:
    if not (isinstance(shape, tuple | list) and len(shape) == 2):
        raise ProblemError(f"shape is {shape!r}, expected two numbers of pixels")
    first, second = (as_whole(number, "shape", 2, _MAX_PIXELS) for number in shape)
    return first, second


def _line(formulation: Formulation, axis: Axis, motion: Trajectory, times: Array) -> Array:
    """Return the coordinate of a motion at times (N,); NaN outside of it."""
    inside = times <= motion.t[-1] + 1e-9
    few = times[inside]
    line = np.full(len(times), np.nan)
    if len(few) < 2:
        return line
    fine = np.interp(np.arange(_BETWEEN * (len(few) - 1) + 1) / _BETWEEN, np.arange(len(few)), few)
    fine = np.minimum(fine, motion.t[-1])
    z = completed(formulation.follows, fine, motion(fine))
    line[inside] = axis.along(formulation.follows, fine, z)[::_BETWEEN]
    return line


def _continued(
    formulation: Formulation, axis: Axis, times: Array, z: Array, line: Array, values: Array
) -> Array:
    """Return the configurations at values (M,) continued from z (N, n), (N, M, n); NaN for none."""
    follows = formulation.follows
    everywhere = np.full(follows.dof, np.inf)
    targets, held = follows.targets(times), follows.held(times)
    # Plans are on their paths within a tolerance only.
    start, arrived = Manifold(follows, -everywhere, everywhere).project(z, targets, held=held)
    first = axis.along(follows, times, start)
    if axis.turns:
        first -= 2.0 * np.pi * np.round((first - line) / (2.0 * np.pi))
    found = np.full((len(times), len(values), follows.dof), np.nan)
    on = np.flatnonzero(arrived)
    part = np.full((len(on), len(values), follows.dof), np.nan)
    continue_all(
        np.ascontiguousarray(start[on]),
        np.ascontiguousarray(first[on] / axis.size),
        np.ascontiguousarray(targets[on]),
        chain_tables(follows),
        follows.layout,
        axis.code,
        axis.reference,
        np.ascontiguousarray(held[on]),
        values / axis.size,
        np.searchsorted(values, first[on]).astype(np.int64),
        part,
    )
    found[on] = part
    return found
