"""A whole job as one motion: seams, moves between them, and what is known of all of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path, Path as FilePath

from selfmotion.basics import PlanError, ProblemError, as_path, shown, write_text
from selfmotion.certificate import Tolerance, first_of
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory, joined_motions
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import (
    CheckedMotion,
    Move,
    Plan,
    arm_differences,
    continuity_faults,
    reached_text,
    rest_faults,
)
from selfmotion.problem.constraints import Clearance
from selfmotion.work.job.program_files import write_program
from selfmotion.work.job.specification import Specification
from selfmotion.work.job.step import Step, same_body

# Events may be outside their step by rounding [s].
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Program:
    """A job as one motion, certified as a whole.

    Attributes
    ----------
    robot : RobotModel
    steps : tuple of Step
        Seams, and the moves and waits between them, in order of time.
    missing : mapping
        Seams without a motion, and why.
    bound : float
        Lower bound of the time of moves of any order of the motions that were planned [s]: of up to
        twelve seams by the times of the moves themselves, of more by limits of speed and
        acceleration.
    notes : tuple of str
        What a reader should know: which orders were given up, and why.
    specification : Specification, optional
        What was asked for, against which the steps are judged; None for steps that were put
        together by hand, and the verdict says so.
    kept : mapping, optional
        Of a warm start: each seam with "" where its motion is that of the earlier program, bit for
        bit, otherwise with why it is not. None without a warm start, and for files.
    unjudged : tuple of str
        What is not judged although a reader may expect it; the verdict says it.
    """

    robot: RobotModel
    steps: tuple[Step, ...]
    missing: Mapping[str, str]
    bound: float = 0.0
    notes: tuple[str, ...] = ()
    specification: Specification | None = None
    kept: Mapping[str, str] | None = None
    unjudged: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return a few lines: how many seams in what order, how long, and the verdict."""
        names = " → ".join(self.order[:_SHOWN]) + (" → …" if len(self.order) > _SHOWN else "")
        return (
            f"Program({self.robot.name}, {self.extent}, {self.duration:.6g} s, "
            f"{self.transfer_time:.6g} s of it moves)\n  {names}\n  {self.verdict}"
        )

    @property
    def extent(self) -> str:
        """The number of seams, in words."""
        count = len(self.order)
        return f"{count} seam{'s' * (count != 1)}"

    @property
    def kept_told(self) -> tuple[str, ...]:
        """How many seams were kept from an earlier program, and why others were not, in words."""
        if not self.kept:
            return ()
        others = {name: why for name, why in self.kept.items() if why}
        count, total = len(self.kept) - len(others), len(self.kept)
        first = f"kept as they were: {count} of {total} seam{'s' * (total != 1)}"
        return (first, *(f"planned: '{name}', as {why}" for name, why in others.items()))

    @property
    def order(self) -> tuple[str, ...]:
        """The names of the seams, in order."""
        return tuple(step.name for step in self.steps if step.is_seam)

    @property
    def tolerance(self) -> Tolerance:
        """The tolerances of the seams."""
        return Tolerance() if self.specification is None else self.specification.tolerance

    @property
    def plans(self) -> dict[str, Plan]:
        """The plans of the seams by name, in order."""
        return {step.name: step.made for step in self.steps if isinstance(step.made, Plan)}

    @property
    def moves(self) -> tuple[Move, ...]:
        """The moves and waits, in order."""
        return tuple(step.made for step in self.steps if isinstance(step.made, Move))

    @cached_property
    def trajectory(self) -> Trajectory:
        """All of it as one motion from t = 0 on.

        Raises
        ------
        PlanError
            A move was not found, or there is no seam.
        """
        if not self.steps:
            raise PlanError(f"{self.robot.name}: {self.verdict}")
        return joined_motions([step.motion for step in self.steps])

    @property
    def begins(self) -> tuple[float, ...]:
        """When each step begins in `trajectory` [s]."""
        durations = [step.duration for step in self.steps]
        return tuple(accumulate(durations[:-1], initial=0.0))[: len(self.steps)]

    @property
    def duration(self) -> float:
        """How long all of it takes [s]."""
        return sum(step.duration for step in self.steps)

    @property
    def transfer_time(self) -> float:
        """How long moves and waits take [s]."""
        return sum(step.duration for step in self.steps if not step.is_seam)

    @property
    def events(self) -> tuple[tuple[float, str, str], ...]:
        """Events: time in `trajectory` [s], seam, name."""
        return tuple(
            (begin + at, step.name, event)
            for begin, step in zip(self.begins, self.steps, strict=True)
            for event, at in step.happenings
        )

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All obstacles at the end: those of the first step, and those that each step leaves."""
        first = self.steps[0].made.obstacles if self.steps else ()
        left = (item for step in self.steps for item in step.leaves)
        return tuple({item.name: item for item in (*first, *left)}.values())

    @property
    def verified(self) -> bool:
        """Whether every seam has a motion, and all constraints are kept at all times."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or what is wrong with which seam or move."""
        if self.verified:
            alone = "" if self.specification else "; the file does not say what was asked for"
            reached = reached_text(list(self.plans.values()), self.tolerance)
            beside = "".join(f"; {text}" for text in self.unjudged)
            return (
                f"verified at all times: {self.extent}, and all moves in between, from rest to "
                f"rest; {reached}{alone}{beside}"
            )
        return f"not verified: {'; '.join(self.failures)}"

    @property
    def summary(self) -> str:
        """The verdict, with only the first of several faults."""
        return self.verdict if self.verified else first_of(self.failures)

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Faults; empty for a verified program."""
        strangers = [
            f"'{step.name}': {text}"
            for step in self.steps
            for text in arm_differences(step.made.robot, self.robot)
        ]
        if strangers:
            return tuple(strangers)
        return tuple(
            [
                *(f"seam '{name}' is not made: {why}" for name, why in self.missing.items()),
                *([] if self.steps else ["there is no step"]),
                *(step.trouble for step in self.steps if step.trouble),
                *self._gaps(),
                *self._unchecked(),
                *self._misplaced_events(),
                *self._against_specification(),
            ]
        )

    def _gaps(self) -> Iterator[str]:
        """Yield where the arm would jump, or does not rest."""
        named = ((step, CheckedMotion.of(f"'{step.name}'", step.made)) for step in self.steps)
        motions = [motion for _, motion in named if motion is not None]
        for motion, end in [
            *((each, 0) for each in motions[:1]),
            *((each, -1) for each in motions[-1:]),
        ]:
            yield from rest_faults(self.robot, motion, end)
        yield from continuity_faults(self.robot, motions)

    def _unchecked(self) -> Iterator[str]:
        """Yield steps that are not checked against an obstacle that is there by then."""
        specification = self.specification
        clearances: tuple[Clearance | None, ...] = (None,)
        if specification is not None:
            clearances = specification.clearances or (Clearance(distance=0.0),)
        each = [
            (clearance, {} if clearance is None else {x.name: x for x in clearance.obstacles})
            for clearance in clearances
        ]
        for step in self.steps:
            named = (name for one, bodies in each for name in step.unchecked(bodies, one))
            unchecked = next(named, None)
            if unchecked is not None:
                yield f"'{step.name}' is not checked against '{unchecked}', which is there by then"
            for item in step.leaves:
                if any(not same_body(bodies.get(item.name, item), item) for _, bodies in each):
                    # It would take the place of that one, which nothing is checked against then.
                    yield f"'{step.name}' leaves '{item.name}', and another body has this name"
            # What is left behind is kept clear of as the first clearance says.
            each[0][1].update((item.name, item) for item in step.leaves)

    def _misplaced_events(self) -> Iterator[str]:
        """Yield events at times outside of their step."""
        for step in self.steps:
            lasts = step.duration
            for event, at in step.events:
                if not -_ROUNDING <= at <= lasts + _ROUNDING:
                    yield f"event '{event}' of '{step.name}' is at {at:.6g} s of {lasts:.6g} s"

    def _against_specification(self) -> Iterator[str]:
        """Yield where the steps differ from the specification."""
        if self.specification is not None:
            yield from self.specification.failures(self.robot, self.steps, self.missing)

    def require(self) -> Program:
        """Return the program itself if all of it is verified.

        Raises
        ------
        PlanError
            It is not; the message is the verdict.
        """
        if not self.verified:
            raise PlanError(f"{self.robot.name}: {self.verdict}")
        return self

    def save(self, file: str | FilePath) -> None:
        """Write the program, without loss, to a file that `load_program` reads; atomically."""
        write_program(self, as_path(file))


# Names in a printed program.
_SHOWN = 12


def write_timetable(program: Program, file: str | Path) -> None:
    """Write when each step begins and ends, and each event is [s], as CSV; atomically.

    Events at one time are in the order in which they were given.

    Raises
    ------
    ProblemError
        It is no program.
    FileFormatError
        The file cannot be written.
    """
    if not isinstance(program, Program):
        raise ProblemError(f"program is {shown(program)}, expected a Program")
    rows = list[tuple[float, float, str, str]]()
    for begin, step in zip(program.begins, program.steps, strict=True):
        kind = "seam" if step.is_seam else "move"
        rows.append((begin, begin + step.duration, kind, step.name))
        for event, at in step.happenings:
            rows.append((begin + at, begin + at, "event", f"{step.name}: {event}"))
    lines = ["begin,end,kind,name"]
    lines += [
        f'{begin:.6f},{end:.6f},{kind},"{name.replace(chr(34), chr(34) * 2)}"'
        for begin, end, kind, name in rows
    ]
    write_text(as_path(file), "\n".join(lines) + "\n")
