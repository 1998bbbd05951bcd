"""KUKA Robot Language: spline blocks of axis targets with their times.

After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators
(KSS 8.3 SI V4): E6AXIS aggregates, ``PTP_SPLINE`` with ``SPTP`` segments and a ``TIME_BLOCK``,
whose parts share its time in proportion, and the path trigger. ``PTP_SPLINE`` passes all targets
on a smooth curve in axis space; ``TIME_BLOCK`` is how times are prescribed, whereas ``$VEL_AXIS``
counts in percent of what only the controller knows. Where the axes cannot keep a time, it takes
longer.

Tool poses are ``E6POS`` aggregates in ``$BASE``: ``SPL`` segments of a ``SPLINE`` block, and
``SLIN`` where the tool goes straight. Linear motions keep the status of where they begin, so that
S and T decide nothing in them: the first pose has them for who makes it a ``PTP``. A seam at a feed
has ``$VEL.CP`` in place of times, and ``SCIRC`` where it goes round, whose orientation turns evenly
in ``$BASE`` (``$ORI_TYPE = #VAR``, ``$CIRC_TYPE = #BASE``).
"""

from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import ProblemError, write_text
from selfmotion.controllers.controller_program import (
    ControllerProgram,
    Draft,
    before,
    goes_round,
    head,
    speeds_of,
    with_begins,
)
from selfmotion.controllers.feed_stretches import FeedStretch
from selfmotion.controllers.program_settings import written
from selfmotion.controllers.program_texts import module_name, plain
from selfmotion.controllers.stretches import PoseStretch, Stretch, straight
from selfmotion.controllers.thinning import TIME_DIGITS
from selfmotion.controllers.tool_frames import krl_numbers, status_and_turn
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
# The fastest approach [m/s, °/s], and speeds above all that times ask for.
_FASTEST, _TURNING, _UNBOUND, UNBOUND_TURNING = 0.5, 100.0, 2.0, 400.0
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
        *(["  $ORI_TYPE = #VAR", "  $CIRC_TYPE = #BASE"] if goes_round(program) else []),
        f"  BAS(#VEL_PTP, {percent})",
        f"  BAS(#ACC_PTP, {percent})",
        f"  PTP {_aggregate(first, 0, program)}",
        "  BAS(#VEL_PTP, 100)",
        "  BAS(#ACC_PTP, 100)",
    ]
    begins = True
    for stretch, begun in with_begins(program.stretches):
        lines += ["", f"  ; step: {plain(stretch.name)}"]
        lines += [f"  ; {line}" for line in before(stretch)]
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
    if isinstance(stretch, FeedStretch):
        return [*lines, *_at_speed(draft, stretch)]
    block, segment = "PTP_SPLINE", "SPTP"
    if isinstance(stretch, PoseStretch):
        block, segment = "SPLINE", "SLIN" if _is_straight(stretch) else "SPL"
        # After a seam at its feed.
        lines += [f"  $VEL.CP = {_UNBOUND:g}"] if speeds_of(draft.program) else []
    lines += [f"  {block}", "    TIME_BLOCK START"]
    for k in range(1, len(stretch.t)):
        lines += _triggers(draft, stretch, k)
        lines.append(f"    {segment} {_target(stretch, k, draft.program)}")
        lines.append(f"    TIME_BLOCK PART = {_seconds(stretch.t[k] - stretch.t[k - 1])}")
    lines += [f"    TIME_BLOCK END = {_seconds(stretch.t[-1])}", "  ENDSPLINE"]
    return lines


def _at_speed(draft: Draft, stretch: FeedStretch) -> list[str]:
    """Return the lines of a seam at its feed: one segment, or a block of them."""
    speeds, count = stretch.speeds, len(stretch.speeds)
    # Steps that bend, none of them round, are passed smoothly.
    bends = not (np.isfinite(stretch.vias).any() or _is_straight(stretch))
    straight_one = "SPL" if bends and count > 1 else "SLIN"
    lines, segments = [f"  $VEL.CP = {speeds[0]:.7g}"], []
    for k in range(1, count + 1):
        segments += _triggers(draft, stretch, k)
        segment = f"{straight_one} {_target(stretch, k, draft.program)}"
        if stretch.goes_round(k):
            via = _target(stretch.middles, k - 1, draft.program)
            segment = f"SCIRC {via}, {_target(stretch, k, draft.program)}"
        own = f" WITH $VEL.CP = {speeds[k - 1]:.7g}" if speeds[k - 1] != speeds[0] else ""
        segments.append(f"    {segment}{own}")
    if count == 1 and len(segments) == 1:
        return [*lines, segments[0][2:]]
    return [*lines, "  SPLINE", *segments, "  ENDSPLINE"]


def _triggers(draft: Draft, stretch: Stretch, k: int) -> list[str]:
    """Return what switches what is to be at a target."""
    lines = []
    for item in stretch.events:
        if item.target == k:
            said = _event(draft, item.name)
            # Without ONSTART it is at the end of the motion that follows.
            comment = said.startswith(";")
            lines.append(
                f"    {said}" if comment else f"    TRIGGER WHEN PATH = 0 DELAY = 0 DO {said}"
            )
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
        # A seam at its feed says it itself.
        *(fast[1:] if isinstance(stretch, FeedStretch) else fast),
    ]


def _slow_and_fast(draft: Draft) -> tuple[list[str], list[str]]:
    """Return the speeds [m/s, °/s] of slow linear motions, and those that times decide below."""
    if draft.frames is None:
        return [], []
    share = draft.settings.approach
    both = ((share * _FASTEST, share * _TURNING), (_UNBOUND, UNBOUND_TURNING))
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
            f"kinematic system by its number in MACHINE_DEF; say positioner = 2, or which it is, "
            f"in the file of --settings (ProgramSettings(positioner=…))"
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
