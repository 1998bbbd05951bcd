"""A joint motion as programs of robot controllers say it, whichever language they speak."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import FileFormatError, ProblemError, Progress, nearest, silent
from selfmotion.formats.pieces import pieces_of
from selfmotion.formats.program_axes import Axis, axes_of, in_order, tool_from_flange
from selfmotion.formats.program_settings import ProgramSettings, Signal
from selfmotion.formats.stretches import NO_MISS, Miss, Misses, Stretch, miss_of
from selfmotion.formats.targets import stretches_of
from selfmotion.job import Program, are_opposite
from selfmotion.motion import Trajectory
from selfmotion.result import Move, Parts, Plan
from selfmotion.robot import RobotModel
from selfmotion.task import SE3


class Switch(NamedTuple):
    """What a program does besides moving.

    Attributes
    ----------
    at : float
        From the begin of its motion [s].
    output : str
        What is switched; of an event that is a comment only its name.
    value : bool or None
        To what; None for a comment.
    """

    at: float
    output: str
    value: bool | None = None


@dataclass(frozen=True, eq=False)
class ControllerProgram:
    """What a program file says of a motion.

    Attributes
    ----------
    name : str
        Of the module.
    axes : tuple of Axis
        In the order of the file: A1 … A6, E1 … E6.
    stretches : tuple of Stretch
        From rest to rest, coordinates in the order of the axes.
    miss : Misses
        How far targets are off the motion, as the file states it.
    switches : tuple of Switch
        What is switched when, in order.
    """

    name: str
    axes: tuple[Axis, ...]
    stretches: tuple[Stretch, ...]
    miss: Misses
    switches: tuple[Switch, ...] = ()

    @property
    def targets(self) -> int:
        """How many targets it has."""
        return sum(len(stretch.t) - 1 for stretch in self.stretches if not stretch.is_rest)

    @property
    def trajectory(self) -> Trajectory:
        """The motion as the cubic spline through the targets of each stretch, at rest in between.

        Raises
        ------
        FileFormatError
            There is none.
        """
        from scipy.interpolate import CubicSpline

        t, q, qd = [np.zeros(1)], [self.stretches[0].q[:1]], [0.0 * self.stretches[0].q[:1]]
        for stretch in self.stretches:
            rates = 0.0 * stretch.q
            if not stretch.is_rest:
                rates = CubicSpline(stretch.t, stretch.q, bc_type="clamped")(stretch.t, 1)
                rates[[0, -1]] = 0.0
            t.append(t[-1][-1] + stretch.t[1:])
            q.append(stretch.q[1:])
            qd.append(rates[1:])
        names = tuple(axis.joint for axis in self.axes)
        return Trajectory(np.concatenate(t), np.concatenate(q), np.concatenate(qd), names)

    def miss_of(self, plan: Plan | Parts | Move | Program) -> Misses:
        """Return how far it is off the motion of a plan, parts, a move or a program.

        Raises
        ------
        FileFormatError
            It has other joints, or other stretches.
        """
        pieces = pieces_of(plan)
        names = [axis.joint for axis in self.axes]
        known = plan.robot.joint_names
        if sorted(names) != sorted(known):
            raise FileFormatError(f"has joints {', '.join(names)}, expected {', '.join(known)}")
        order = [names.index(name) for name in known]
        worst, at, k = Misses(NO_MISS, NO_MISS), 0.0, 0
        for stretch in self.stretches:
            same = replace(stretch, q=stretch.q[:, order])
            piece = pieces[min(k, len(pieces) - 1)]
            found = miss_of(same, piece.motion, piece.chains, piece.motion.t[0] + at)
            both = Misses(NO_MISS, found) if piece.is_move else Misses(found, NO_MISS)
            worst = worst.worse(both)
            at += float(stretch.t[-1])
            if at >= piece.motion.duration - _MOMENT:
                at, k = 0.0, k + 1
        if k != len(pieces):
            raise FileFormatError(f"ends {len(pieces) - k} seams or moves before the motion does")
        return worst


# A piece is over where less of it is left than this [s].
_MOMENT = 1e-4


@dataclass(frozen=True, eq=False)
class Draft:
    """All that a writer needs: the program, the arm, and what else is said."""

    program: ControllerProgram
    robot: RobotModel
    tool: SE3
    settings: ProgramSettings
    verdict: str

    def signal(self, event: str) -> Signal | None:
        """Return what an event switches."""
        return self.settings.signal(event)


def drafted(
    plan: Plan | Parts | Move | Program,
    name: str,
    settings: ProgramSettings,
    verdict: str,
    progress: Progress = silent,
) -> Draft:
    """Return the program of a motion, named as its file is.

    Raises
    ------
    ProblemError
        The arm has axes that controllers have not, an event has no signal, or the motion does not
        rest where it should.
    PlanError
        A move was not found.
    """
    robot, pieces = plan.robot, pieces_of(plan)
    axes = axes_of(robot, settings)
    check_signals({event: item.name for item in pieces for _, event in item.events}, settings)
    slides = np.array([axis.slides for axis in axes])
    stretches, miss = stretches_of(
        pieces, slides, settings.deviation, settings.move_deviation, progress
    )
    order = in_order(axes)
    sorted_ones = tuple(replace(item, q=item.q[:, order]) for item in stretches)
    program = ControllerProgram(name, tuple(axes[k] for k in order), sorted_ones, miss)
    return Draft(program, robot, tool_from_flange(robot, settings), settings, verdict)


def check_signals(seams: Mapping[str, str], settings: ProgramSettings) -> None:
    """Refuse events (event → seam) of which nothing says what they switch."""
    spare = [event for event in settings.signals or {} if event not in seams]
    for event, seam in seams.items():
        if not settings.knows(event):
            raise ProblemError(
                f"seam '{seam}': event '{event}' has no signal{nearest(event, spare)}; say in the "
                f"file of --settings what it switches, [signals] '{event}' = [output, true], or "
                f"false for a comment only (ProgramSettings(signals=…))"
            )
    for one, other in combinations(seams, 2):
        first = settings.signal(one)
        if first is not None and first == settings.signal(other) and are_opposite(one, other):
            raise ProblemError(
                f"signals: '{one}' and '{other}' both switch {first[0]!r} to {first[1]}; one of "
                f"them has to be {not first[1]}, or of another output"
            )


def head(draft: Draft) -> list[str]:
    """Return the comments at the head of a program, without what marks them as such."""
    program = draft.program
    axes = ", ".join(
        f"{axis.name} = {axis.joint} [{'mm' if axis.slides else 'deg'}]" for axis in program.axes
    )
    moves = program.miss.moves
    return [
        plain(f"selfmotion: {draft.robot.name}, {program.targets} targets"),
        *folded(plain(draft.verdict)),
        *folded(plain(f"axes: {axes}")),
        f"deviation: {_stated(program.miss.path)}",
        *([] if moves == NO_MISS else [f"deviation of moves: {_stated(moves)}"]),
        "(of the tool from the plan, straight joint lines, rounded corners or a spline",
        "through the targets, at the times of the plan)",
        "Angles are those of the URDF: compare zeros and signs with the controller's.",
    ]


def _stated(miss: Miss) -> str:
    tool = f"{_up(1e3 * miss.position, 6)} mm, {_up(miss.rotation, 9)} rad"
    return f"{tool}, joints {_up(miss.joint, 9)}"


def _up(value: float, digits: int) -> str:
    """Return a number rounded up, so that what is stated holds."""
    return f"{ceil(value * 10**digits) / 10**digits:.{digits}f}"


def plain(text: str) -> str:
    """Return a text as a comment may hold it: one line of ASCII."""
    return " ".join(text.replace("→", "->").encode("ascii", "replace").decode().split())


def folded(text: str, width: int = 100) -> list[str]:
    """Return a text in lines, those after the first with two dots ahead."""
    lines, words = [""], text.split(" ")
    for word in words:
        if lines[-1] and len(lines[-1]) + len(word) > width:
            lines.append("..")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def module_name(file: FilePath, most: int, reserved: Sequence[str]) -> str:
    """Return the name that a file's module has to have; words of its language are none.

    Raises
    ------
    FileFormatError
        Controllers know no module of that name.
    """
    name = file.stem
    if not (re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) and len(name) <= most):
        raise FileFormatError(
            f"{file}: the module is called as the file is, and '{name}' is no name: expected a "
            f"letter, then letters, digits and _, {most} at most"
        )
    if name.upper() in reserved:
        raise FileFormatError(
            f"{file}: the module is called as the file is, and '{name}' is a word of the "
            f"controller's language; call the file otherwise"
        )
    return name
