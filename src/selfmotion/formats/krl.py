"""KUKA Robot Language: spline blocks of axis targets with their times.

After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators
(KSS 8.3 SI V4): E6AXIS aggregates, ``PTP_SPLINE`` with ``SPTP`` segments and a ``TIME_BLOCK``,
whose parts share its time in proportion, and the path trigger. ``PTP_SPLINE`` passes all targets
on a smooth curve in axis space; ``TIME_BLOCK`` is how times are prescribed, whereas ``$VEL_AXIS``
counts in percent of what only the controller knows. Where the axes cannot keep a time, it takes
longer.
"""

from collections.abc import Sequence
from pathlib import Path as FilePath

from selfmotion.basics import ProblemError, write_text
from selfmotion.formats.controller_program import (
    ControllerProgram,
    Draft,
    head,
    module_name,
    plain,
)
from selfmotion.formats.program_axes import written
from selfmotion.formats.program_lines import ProgramReader, Row, switched
from selfmotion.formats.program_settings import AXES
from selfmotion.formats.stretches import Stretch
from selfmotion.formats.thinning import TIME_DIGITS
from selfmotion.task import SE3, rpy

# What no module may be called.
# fmt: off
_WORDS = (
    "AND", "ANIN", "ANOUT", "AXIS", "B_AND", "B_EXOR", "B_NOT", "B_OR", "BOOL", "BRAKE", "CASE",
    "CCD_OFF", "CCD_ON", "CHAR", "CIRC", "CIRC_REL", "CONFIRM", "CONST", "CONTINUE", "DECL",
    "DEF", "DEFAULT", "DEFDAT", "DEFFCT", "DELAY", "DIGIN", "DIGOUT", "DO", "E6AXIS", "E6POS",
    "ELSE", "END", "ENDDAT", "ENDFCT", "ENDFOR", "ENDIF", "ENDLOOP", "ENDSPLINE", "ENDSWITCH",
    "ENDWHILE", "ENUM", "EXIT", "EXOR", "EXT", "EXTFCT", "FALSE", "FOR", "FRAME", "GLOBAL",
    "GOTO", "HALT", "IF", "IMPORT", "INT", "INTERRUPT", "IS", "LIN", "LIN_REL", "LOOP", "MAXIMUM",
    "MINIMUM", "NOT", "OFF", "ON", "OR", "POS", "PRIO", "PTP", "PTP_REL", "PTP_SPLINE", "PUBLIC",
    "REAL", "REPEAT", "RESUME", "RETURN", "SCIRC", "SEC", "SIGNAL", "SLIN", "SPL", "SPLINE",
    "SPTP", "STRUC", "SWITCH", "THEN", "TIME_BLOCK", "TO", "TRIGGER", "TRUE", "UNTIL", "WAIT",
    "WHEN", "WHILE",
)
# fmt: on
# Characters in a name.
NAME = 24
_AXIS = r"[AE][1-6]\s+[^,{}]+"
_TARGET = rf"\{{\s*(?:E6AXIS\s*:|AXIS\s*:)?\s*({_AXIS}(?:,\s*{_AXIS})*)\}}"
_ABOVE = 1e-4


def write_krl(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that a KR C4 or C5 selects."""
    program = draft.program
    name = module_name(file, NAME, _WORDS)
    percent = f"{100.0 * draft.settings.approach:g}"
    first = program.stretches[0]
    lines = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEF {name}()",
        *(f"  ; {line}" for line in head(draft)),
        "  BAS(#INITMOV, 0)",
        "  $BASE = {X 0, Y 0, Z 0, A 0, B 0, C 0}",
        f"  $TOOL = {_frame(draft.tool)}",
        *_load(draft),
        f"  BAS(#VEL_PTP, {percent})",
        f"  BAS(#ACC_PTP, {percent})",
        f"  PTP {_aggregate(first, 0, program)}",
        "  BAS(#VEL_PTP, 100)",
        "  BAS(#ACC_PTP, 100)",
    ]
    for stretch in program.stretches:
        lines += ["", f"  ; step: {plain(stretch.name)}", *_block(draft, stretch)]
    write_text(file, "\n".join([*lines, "END", ""]))


def _block(draft: Draft, stretch: Stretch) -> list[str]:
    """Return the lines of a motion from rest to rest, or of a rest."""
    at_begin = [_event(draft, item.name) for item in stretch.events if item.target == 0]
    lines = [f"  {line}" for line in at_begin]
    if stretch.is_rest:
        t = stretch.t
        for k in range(1, len(t)):
            lines.append(f"  WAIT SEC {_seconds(t[k] - t[k - 1])}")
            lines += [
                f"  {_event(draft, item.name)}" for item in stretch.events if item.target == k
            ]
        return lines
    lines += ["  PTP_SPLINE", "    TIME_BLOCK START"]
    for k in range(1, len(stretch.t)):
        for item in stretch.events:
            if item.target == k:
                said = _event(draft, item.name)
                # Without ONSTART it is at the end of the motion that follows.
                comment = said.startswith(";")
                lines.append(
                    f"    {said}" if comment else f"    TRIGGER WHEN PATH = 0 DELAY = 0 DO {said}"
                )
        lines.append(f"    SPTP {_aggregate(stretch, k, draft.program)}")
        lines.append(f"    TIME_BLOCK PART = {_seconds(stretch.t[k] - stretch.t[k - 1])}")
    lines += [f"    TIME_BLOCK END = {_seconds(stretch.t[-1])}", "  ENDSPLINE"]
    return lines


def _event(draft: Draft, event: str) -> str:
    signal = draft.signal(event)
    if signal is None:
        return f"; event: {plain(event)}"
    output, value = signal
    if not isinstance(output, int) or output < 1:
        raise ProblemError(
            f"signals: '{event}' switches {output!r}; KUKA's outputs are numbers from 1 on"
        )
    return f"$OUT[{output}] = {str(value).upper()}"


def _aggregate(stretch: Stretch, k: int, program: ControllerProgram) -> str:
    values = written(stretch.q[k], program.axes)
    named = zip(program.axes, values, strict=True)
    return "{" + ", ".join(f"{axis.name} {value}" for axis, value in named) + "}"


def _frame(pose: SE3) -> str:
    x, y, z = (1e3 * pose.translation).tolist()
    c, b, a = (57.29577951308232 * rpy.matrixToRpy(pose.rotation)).tolist()
    values = zip("XYZABC", (x, y, z, a, b, c), strict=True)
    return "{" + ", ".join(f"{name} {value + 0.0:.4f}" for name, value in values) + "}"


def _load(draft: Draft) -> list[str]:
    mass, (x, y, z) = draft.settings.mass, (1e3 * value for value in draft.settings.center)
    if mass is None:
        return []
    return [
        f"  $LOAD = {{M {mass:.4f}, CM {{X {x:.4f}, Y {y:.4f}, Z {z:.4f}, A 0, B 0, C 0}}, "
        f"J {{X 0, Y 0, Z 0}}}}"
    ]


def _seconds(value: float) -> str:
    return f"{value:.{TIME_DIGITS}f}"


class KrlReader(ProgramReader):
    """Reads a module: what `write_krl` writes, spaces, names and numbers aside."""

    comment, last = ";", "END"

    def __init__(self, file: FilePath) -> None:
        super().__init__(file)
        self._parts: list[float] = []
        self._targets: list[list[float]] = []
        # At which target what is switched.
        self._triggers: list[tuple[int, Sequence[str]]] = []

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "head"

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins."""
        self.at, self.state = self._target(given[0]), "body"

    def block(self, _: Sequence[str]) -> None:
        """Begin a spline block."""
        self.state, self._parts, self._targets, self._triggers = "block", [], [self.at], []

    def start(self, _: Sequence[str]) -> None:
        """Begin its time block."""
        self.state = "time"

    def target(self, given: Sequence[str]) -> None:
        """Take a target."""
        if len(self._targets) != len(self._parts) + 1:
            raise self.lines.fault("the target before has no TIME_BLOCK PART")
        self._targets.append(self._target(given[0]))

    def part(self, given: Sequence[str]) -> None:
        """Take the share of time of the target before."""
        if len(self._parts) >= len(self._targets) - 1:
            raise self.lines.fault("there is no target before this part")
        self._parts.append(self.lines.duration(given[0]))

    def trigger(self, given: Sequence[str]) -> None:
        """Take what is switched at the target that follows."""
        self._triggers.append((len(self._targets), given))

    def whole(self, given: Sequence[str]) -> None:
        """Take the time of all of them."""
        seconds, parts = self.lines.duration(given[0]), self._parts
        if not parts or len(parts) != len(self._targets) - 1:
            raise self.lines.fault("each target needs its TIME_BLOCK PART")
        share = seconds / sum(parts)
        # Parts are shares: those that are seconds stay what they are.
        scale = 1.0 if abs(share - 1.0) * sum(parts) < _ABOVE else share
        row = Row(self.lines.step(), self._targets, [scale * part for part in parts])
        for number, what in self._triggers:
            if number > len(parts):
                raise self.lines.fault("a trigger has no target after it")
            self.switches.append(switched(self.clock + sum(row.seconds[:number]), what))
        self.rows.append(row)
        self.at, self.state = self._targets[-1], "ended"

    def close(self, _: Sequence[str]) -> None:
        """End a spline block."""
        self.state = "body"

    def _target(self, text: str) -> list[float]:
        values: dict[str, float] = {}
        for item in text.split(","):
            name, _, number = item.strip().partition(" ")
            name = name.upper()
            if name in values:
                raise self.lines.fault(f"axis {name} is there twice")
            values[name] = self.lines.coordinate(number)
        present = [name for name in AXES if name in values]
        self.same_axes(present)
        return [values[name] for name in present]


_ANY = r"[^;{}]*"
_IN_BODY = ("head", "body")
KrlReader.grammar = (
    (("before",), r"&(?:ACCESS|REL|PARAM|COMMENT)\b.*", KrlReader.skip),
    (("before",), rf"DEF ([A-Z]\w{{0,{NAME - 1}}}) ?\( ?\)", KrlReader.begin),
    (("head", "body"), r"BAS ?\( ?#\w+ ?, ?[\d.]+ ?\)", KrlReader.skip),
    (("head",), rf"\$(?:BASE|TOOL) ?= ?\{{{_ANY}\}}", KrlReader.skip),
    (("head",), rf"\$LOAD ?= ?\{{{_ANY}\{{{_ANY}\}}{_ANY}\{{{_ANY}\}}{_ANY}\}}", KrlReader.skip),
    (("head",), rf"PTP {_TARGET}", KrlReader.go),
    (_IN_BODY[1:], r"WAIT SEC (\S+)", KrlReader.wait),
    (_IN_BODY, r"\$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)", KrlReader.switch),
    (_IN_BODY, r"; event: (.*)", KrlReader.switch),
    (_IN_BODY[1:], r"PTP_SPLINE", KrlReader.block),
    (("block",), r"TIME_BLOCK START", KrlReader.start),
    (("time",), rf"SPTP {_TARGET}", KrlReader.target),
    (("time",), r"TIME_BLOCK PART ?= ?(\S+)", KrlReader.part),
    (
        ("time",),
        r"TRIGGER WHEN PATH ?= ?0 DELAY ?= ?0 DO \$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)",
        KrlReader.trigger,
    ),
    (("time",), r"; event: (.*)", KrlReader.trigger),
    (("time",), r"TIME_BLOCK END ?= ?(\S+)", KrlReader.whole),
    (("ended",), r"ENDSPLINE", KrlReader.close),
    (_IN_BODY, r"END", KrlReader.end),
)
