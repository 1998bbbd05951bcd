"""KUKA Robot Language: spline blocks of axis targets with their times.

After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators
(KSS 8.3 SI V4): E6AXIS aggregates, ``PTP_SPLINE`` with ``SPTP`` segments and a ``TIME_BLOCK``,
whose parts share its time in proportion, and the path trigger. ``PTP_SPLINE`` passes all targets
on a smooth curve in axis space; ``TIME_BLOCK`` is how times are prescribed, whereas ``$VEL_AXIS``
counts in percent of what only the controller knows. Where the axes cannot keep a time, it takes
longer.

Tool poses are ``E6POS`` aggregates in ``$BASE``: ``SPL`` segments of a ``SPLINE`` block, and
``SLIN`` where the tool goes straight. Linear motions keep the status of where they begin, so that
S and T decide nothing in them: the first pose has them for who makes it a ``PTP``.
"""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, ProblemError, write_text
from selfmotion.formats.arm_configurations import status_and_turn
from selfmotion.formats.controller_program import (
    ControllerProgram,
    Draft,
    head,
    module_name,
    plain,
    with_begins,
)
from selfmotion.formats.pose_numbers import krl_numbers, krl_pose
from selfmotion.formats.pose_stretches import PoseStretch, straight
from selfmotion.formats.program_axes import written
from selfmotion.formats.program_lines import ProgramReader, switched
from selfmotion.formats.program_settings import AXES
from selfmotion.formats.read_stretches import Pose, pose_of_values
from selfmotion.formats.stretches import Stretch
from selfmotion.formats.thinning import TIME_DIGITS
from selfmotion.robot import RobotModel
from selfmotion.task import SE3, Quaternion

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
# The fastest approach [m/s, °/s], and speeds above all that times ask for.
_FASTEST, _TURNING, _UNBOUND, _UNBOUND_TURNING = 0.5, 100.0, 2.0, 400.0
# Ways shorter than this have no direction [m]; digits leave poses of a line this far off it.
_SHORT, _ON_LINE = 1e-3, 4e-7


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
        f"  $BASE = {_base(draft)}",
        f"  $TOOL = {_frame(draft.tool)}",
        *_load(draft),
        *_slow_and_fast(draft)[0],
        f"  BAS(#VEL_PTP, {percent})",
        f"  BAS(#ACC_PTP, {percent})",
        f"  PTP {_aggregate(first, 0, program)}",
        "  BAS(#VEL_PTP, 100)",
        "  BAS(#ACC_PTP, 100)",
    ]
    begins = True
    for stretch, begun in with_begins(program.stretches):
        lines += ["", f"  ; step: {plain(stretch.name)}"]
        if begun is not None:
            lines += _slowly(draft, begun, percent, begins=begins)
            begins = False
        lines += _block(draft, stretch)
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
    block, segment = "PTP_SPLINE", "SPTP"
    if isinstance(stretch, PoseStretch):
        block, segment = "SPLINE", "SLIN" if _is_straight(stretch) else "SPL"
    lines += [f"  {block}", "    TIME_BLOCK START"]
    for k in range(1, len(stretch.t)):
        for item in stretch.events:
            if item.target == k:
                said = _event(draft, item.name)
                # Without ONSTART it is at the end of the motion that follows.
                comment = said.startswith(";")
                lines.append(
                    f"    {said}" if comment else f"    TRIGGER WHEN PATH = 0 DELAY = 0 DO {said}"
                )
        lines.append(f"    {segment} {_target(stretch, k, draft.program)}")
        lines.append(f"    TIME_BLOCK PART = {_seconds(stretch.t[k] - stretch.t[k - 1])}")
    lines += [f"    TIME_BLOCK END = {_seconds(stretch.t[-1])}", "  ENDSPLINE"]
    return lines


def _slowly(draft: Draft, stretch: Stretch, percent: str, *, begins: bool) -> list[str]:
    """Return the slow motion to where a stretch begins, of another kind than the one before."""
    if not isinstance(stretch, PoseStretch):
        slow, fast = ([f"  BAS(#VEL_PTP, {x})", f"  BAS(#ACC_PTP, {x})"] for x in (percent, "100"))
        return [*slow, f"  PTP {_aggregate(stretch, 0, draft.program)}", *fast]
    configuration = ""
    if begins:
        status, turn = status_and_turn(stretch.frames, stretch.q[0, np.argsort(stretch.order)])
        configuration = f", T {turn}" if status is None else f", S {status}, T {turn}"
    slow, fast = _slow_and_fast(draft)
    unknown = [
        "  ; S is not stated: the wrist axes of this arm do not meet in a point, or its zero is",
        "  ; not that of KUKA's arms. The configuration is that of the begin.",
    ]
    return [
        *(unknown if begins and "S" not in configuration else []),
        *slow,
        f"  LIN {_target(stretch, 0, draft.program, configuration)}",
        *fast,
    ]


def _slow_and_fast(draft: Draft) -> tuple[list[str], list[str]]:
    """Return the speeds [m/s, °/s] of slow linear motions, and those that times decide below."""
    if draft.frames is None:
        return [], []
    share = draft.settings.approach
    both = ((share * _FASTEST, share * _TURNING), (_UNBOUND, _UNBOUND_TURNING))
    slow, fast = (
        [f"  $VEL.CP = {speed:g}", f"  $VEL.ORI1 = {turn:g}", f"  $VEL.ORI2 = {turn:g}"]
        for speed, turn in both
    )
    return slow, fast


def _is_straight(stretch: PoseStretch) -> bool:
    """Whether all poses are on one line that turns about one axis, one after the other."""
    rows = np.hstack([stretch.places, stretch.turns])
    way = np.linalg.norm(rows[:, :3] - rows[0, :3], axis=1)
    if way[-1] < _SHORT or (np.diff(way) <= 0.0).any():
        return False
    return bool(np.abs(straight(way, way[[0, -1]], rows[[0, -1]]) - rows).max() < _ON_LINE)


def _base(draft: Draft) -> str:
    """Return what poses are counted in: in the world, or on an external kinematic system."""
    frames = draft.frames
    if frames is None:
        return "{X 0, Y 0, Z 0, A 0, B 0, C 0}"
    if not frames.is_carried:
        return _frame(frames.work)
    unit = draft.settings.positioner
    if not isinstance(unit, int):
        raise ProblemError(
            f"{draft.robot.name}: an axis carries work object '{frames.name}', and $BASE names its "
            f"kinematic system by its number in MACHINE_DEF; give positioner = 2, or which it is "
            f"(ProgramSettings(positioner=…))"
        )
    machine = f"MACHINE_DEF[{unit}]"
    return f"EK({machine}.ROOT, {machine}.MECH_TYPE, {_frame(frames.work)})"


def _target(stretch: Stretch, k: int, program: ControllerProgram, configuration: str = "") -> str:
    """Return a target: axes, or a pose and the external axes."""
    if not isinstance(stretch, PoseStretch):
        return _aggregate(stretch, k, program)
    numbers = krl_numbers(stretch.places[k], stretch.turns[k])
    pose = [f"{name} {value:.5f}" for name, value in zip("XYZABC", numbers, strict=True)]
    values = zip(program.axes, written(stretch.q[k], program.axes), strict=True)
    outer = [f"{axis.name} {value}" for axis, value in values if axis.name.startswith("E")]
    return "{" + ", ".join(pose) + configuration + "".join(f", {text}" for text in outer) + "}"


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
    numbers = krl_numbers(np.array(pose.translation), np.array(Quaternion(pose.rotation).coeffs()))
    values = zip("XYZABC", numbers, strict=True)
    return "{" + ", ".join(f"{name} {value:.5f}" for name, value in values) + "}"


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

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self._parts: list[float] = []
        # Of the block that is read: axis targets, or poses.
        self._targets: list[list[float]] = []
        self._poses: list[Pose] = []
        self._by_poses = False
        # At which target what is switched.
        self._triggers: list[tuple[int, Sequence[str]]] = []

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "head"

    def tool_is(self, given: Sequence[str]) -> None:
        """Take the tool in the flange."""
        self.tool = self._frame(given[0])

    def work_is(self, given: Sequence[str]) -> None:
        """Take what poses are counted in."""
        self.work = self._frame(given[0])

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        self.begin_at(self._target(given[0]))
        self.state = "body"

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        self.slowly(self._pose(given[0]))

    def block(self, given: Sequence[str]) -> None:
        """Begin a spline block."""
        self.state, self._parts, self._triggers = "block", [], []
        self._targets, self._poses = [], []
        self._by_poses = given[0].upper() == "SPLINE"

    def start(self, _: Sequence[str]) -> None:
        """Begin its time block."""
        self.state = "time"

    def target(self, given: Sequence[str]) -> None:
        """Take an axis target."""
        self._check_kind(poses=False)
        self._targets.append(self._target(given[0]))

    def pose(self, given: Sequence[str]) -> None:
        """Take a pose."""
        self._check_kind(poses=True)
        self._poses.append(self._pose(given[0]))

    def _check_kind(self, *, poses: bool) -> None:
        if poses != self._by_poses:
            raise self.lines.fault("SPLINE has SPL and SLIN, PTP_SPLINE has SPTP")
        if self._count != len(self._parts):
            raise self.lines.fault("the target before has no TIME_BLOCK PART")

    @property
    def _count(self) -> int:
        return len(self._targets) + len(self._poses)

    def part(self, given: Sequence[str]) -> None:
        """Take the share of time of the target before."""
        if len(self._parts) >= self._count:
            raise self.lines.fault("there is no target before this part")
        self._parts.append(self.lines.duration(given[0]))

    def trigger(self, given: Sequence[str]) -> None:
        """Take what is switched at the target that follows."""
        self._triggers.append((self._count + 1, given))

    def whole(self, given: Sequence[str]) -> None:
        """Take the time of all of them."""
        seconds, parts = self.lines.duration(given[0]), self._parts
        if not parts or len(parts) != self._count:
            raise self.lines.fault("each target needs its TIME_BLOCK PART")
        share = seconds / sum(parts)
        # Parts are shares: those that are seconds stay what they are.
        scale = 1.0 if abs(share - 1.0) * sum(parts) < _ABOVE else share
        times = [scale * part for part in parts]
        for number, what in self._triggers:
            if number > len(parts):
                raise self.lines.fault("a trigger has no target after it")
            self.switches.append(switched(self.clock + sum(times[:number]), what))
        if self._by_poses:
            self.follow(self._poses, times)
        else:
            self.join(self._targets, times)
        self.state = "ended"

    def close(self, _: Sequence[str]) -> None:
        """End a spline block."""
        self.state = "body"

    def _target(self, text: str) -> list[float]:
        values = self._values(text)
        present = [name for name in AXES if name in values]
        self.same_axes(present)
        return [values[name] for name in present]

    def _values(self, text: str) -> dict[str, float]:
        values: dict[str, float] = {}
        for item in text.split(","):
            name, _, number = item.strip().partition(" ")
            name = name.upper()
            if name in values:
                raise self.lines.fault(f"axis {name} is there twice")
            values[name] = self.lines.coordinate(number)
        return values

    def _pose(self, text: str) -> Pose:
        values = self._values(text)
        # Linear motions keep the status and turn of where they begin.
        place = self._numbers({name: x for name, x in values.items() if name not in ("S", "T")})
        outer = {name: x for name, x in values.items() if name.startswith("E")}
        return Pose(*krl_pose(place), self.others_of(outer), self.lines.number)

    def _numbers(self, values: dict[str, float]) -> Array:
        missing = [name for name in "XYZABC" if name not in values]
        if missing:
            raise self.lines.fault(f"has no {', '.join(missing)}")
        return np.array([values[name] for name in "XYZABC"])

    def _frame(self, text: str) -> SE3:
        place, turn = krl_pose(self._numbers(self._values(text)))
        return pose_of_values([*place.tolist(), *turn.tolist()])


_ANY = r"[^;{}]*"
_IN_BODY = ("head", "body")
_NUMBER = r"[A-Z][1-6]?\s+[^,{}]+"
_POSE = rf"\{{\s*(?:E6POS\s*:|POS\s*:|FRAME\s*:)?\s*({_NUMBER}(?:,\s*{_NUMBER})*)\}}"
_UNIT = r"MACHINE_DEF ?\[ ?\d+ ?\]"
KrlReader.grammar = (
    (("before",), r"&(?:ACCESS|REL|PARAM|COMMENT)\b.*", KrlReader.skip),
    (("before",), rf"DEF ([A-Z]\w{{0,{NAME - 1}}}) ?\( ?\)", KrlReader.begin),
    (("head", "body"), r"BAS ?\( ?#\w+ ?, ?[\d.]+ ?\)", KrlReader.skip),
    (_IN_BODY, r"\$VEL\.(?:CP|ORI1|ORI2) ?= ?[\d.]+", KrlReader.skip),
    (("head",), rf"\$TOOL ?= ?{_POSE}", KrlReader.tool_is),
    (("head",), rf"\$BASE ?= ?{_POSE}", KrlReader.work_is),
    (
        ("head",),
        rf"\$BASE ?= ?EK ?\( ?{_UNIT}\.ROOT ?, ?{_UNIT}\.MECH_TYPE ?, ?{_POSE} ?\)",
        KrlReader.work_is,
    ),
    (("head",), rf"\$LOAD ?= ?\{{{_ANY}\{{{_ANY}\}}{_ANY}\{{{_ANY}\}}{_ANY}\}}", KrlReader.skip),
    (_IN_BODY, rf"PTP {_TARGET}", KrlReader.go),
    (_IN_BODY[1:], rf"LIN {_POSE}", KrlReader.go_linear),
    (_IN_BODY[1:], r"WAIT SEC (\S+)", KrlReader.wait),
    (_IN_BODY, r"\$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)", KrlReader.switch),
    (_IN_BODY, r"; event: (.*)", KrlReader.switch),
    (_IN_BODY[1:], r"(PTP_SPLINE|SPLINE)", KrlReader.block),
    (("block",), r"TIME_BLOCK START", KrlReader.start),
    (("time",), rf"SPTP {_TARGET}", KrlReader.target),
    (("time",), rf"(?:SPL|SLIN) {_POSE}", KrlReader.pose),
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
