r"""ABB RAPID: axis targets with the time to each.

After ABB's Technical reference manual, RAPID Instructions, Functions and Data types (RobotWare 6,
3HAC050917-001): ``MoveAbsJ`` of a ``jointtarget``, whose external axes are 9E9 where there are none
and whose unit is degrees or mm, with ``\T``, the time in seconds that the motion to it takes, in
place of its speed. ``fine`` is a stop, ``z1`` a zone in which corners are rounded, at most from the
middle of one motion to that of the next. Tool poses are ``MoveL`` of a ``robtarget`` in the work
object ``wobjdata``, whose ``confdata`` says in which configuration the arm is; ``ConfL \Off`` has
the controller go on in the one that it is in, as a shifted work object may need other numbers. A
seam at a feed has a ``speeddata`` in place of times, and ``MoveC`` where it goes round,
whose orientation turns evenly in the work object (``CirPathMode \ObjectFrame``). Outputs are set by
``SetDO``: where the arm rests when it rests, and where it moves when it enters the zone of its
target.
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
from selfmotion.controllers.program_settings import AXES, written
from selfmotion.controllers.program_texts import module_name, plain
from selfmotion.controllers.stretches import PoseStretch, Stretch
from selfmotion.controllers.thinning import TIME_DIGITS
from selfmotion.controllers.tool_frames import confdata, rapid_numbers
from selfmotion.task import SE3, Quaternion

# Characters in a name, those of the procedure included.
NAME = 32
# What no module may be called.
# fmt: off
_WORDS = (
    "ALIAS", "AND", "BACKWARD", "BOOL", "CASE", "CONNECT", "CONST", "DEFAULT", "DIV", "DO",
    "DNUM", "ELSE", "ELSEIF", "ENDFOR", "ENDFUNC", "ENDIF", "ENDMODULE", "ENDPROC", "ENDRECORD",
    "ENDTEST", "ENDTRAP", "ENDWHILE", "ERROR", "EXIT", "FALSE", "FOR", "FROM", "FUNC", "GOTO",
    "IF", "INOUT", "LOCAL", "MOD", "MODULE", "NOSTEPIN", "NOT", "NOVIEW", "NUM", "OR", "PERS",
    "PROC", "RAISE", "READONLY", "RECORD", "RETRY", "RETURN", "STEP", "STRING", "SYSMODULE",
    "TEST", "THEN", "TO", "TRAP", "TRUE", "TRYNEXT", "UNDO", "UNTIL", "VAR", "VIEWONLY", "WHILE",
    "WITH", "XOR",
)
# fmt: on
_PROCEDURE = "_run"
# What stands for an axis that is not there.
_ABSENT = "9E9"
# How a time takes the place of a speed.
_TIME = "\\T:="
# The fastest approach [mm/s, °/s].
_FASTEST, _TURNING = 500.0, 100.0


def write_rapid(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that an IRC5 or OmniCore loads."""
    program = draft.program
    name = module_name(file, NAME - len(_PROCEDURE), _WORDS)
    _check_robot_axes(draft)
    share = draft.settings.approach
    speed = ", ".join(f"{share * value:g}" for value in (_FASTEST, _TURNING, _FASTEST, _TURNING))
    lines = [
        f"MODULE {name}",
        *(f"  ! {line}" for line in head(draft)),
        *(f"  ! {line}" for line in _unknown(draft)),
        f"  TASK PERS tooldata {name}_t := {_tool(draft)};",
        *_work(draft, name),
        f"  CONST speeddata {name}_v := [{speed}];",
        *_speeds(draft, name),
        "",
        f"  PROC {name}{_PROCEDURE}()",
        *([] if draft.frames is None else ["    ConfL \\Off;"]),
        *(["    CirPathMode \\ObjectFrame;"] if goes_round(program) else []),
        _slowly(draft, program.stretches[0], name, by_axes=True),
    ]
    for stretch, begun in with_begins(program.stretches):
        lines += ["", f"    ! step: {plain(stretch.name)}"]
        lines += [f"    ! {line}" for line in before(stretch)]
        if begun is not None:
            by_axes = not isinstance(begun, PoseStretch)
            lines.append(_slowly(draft, begun, name, by_axes=by_axes))
        lines += _moves(draft, stretch, name)
    write_text(file, "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""]))


def _check_robot_axes(draft: Draft) -> None:
    if not any(axis.name.startswith("A") for axis in draft.program.axes):
        raise ProblemError(f"{draft.robot.name}: axes: none is A1 to A6, which a robot has")


def _moves(draft: Draft, stretch: Stretch, name: str) -> list[str]:
    last = len(stretch.t) - 1
    lines = []
    for k in range(last + 1):
        if k and stretch.is_rest:
            lines.append(f"    WaitTime {_seconds(stretch.t[k] - stretch.t[k - 1])};")
        elif k:
            zone = "fine" if k == last else "z1"
            seconds = _seconds(stretch.t[k] - stretch.t[k - 1])
            speed = f"v100{_TIME}{seconds}"
            if isinstance(stretch, FeedStretch):
                speed = f"{name}_f{speeds_of(draft.program).index(stretch.speeds[k - 1]) + 1}"
                zone = "fine" if k == last else "z0"
            lines.append(f"    {_motion(draft, stretch, k, name, f'{speed}, {zone}')}")
        lines += [f"    {_event(draft, item.name)}" for item in stretch.events if item.target == k]
    return lines


def _motion(draft: Draft, stretch: Stretch, k: int, name: str, speed_and_zone: str) -> str:
    """Return the motion to a target of a stretch: linear to a pose, by the axes to joints."""
    if isinstance(stretch, PoseStretch):
        target, rest = _robtarget(draft, stretch, k), f"{speed_and_zone}, {name}_t\\WObj:={name}_w;"
        if isinstance(stretch, FeedStretch) and k and stretch.goes_round(k):
            return f"MoveC {_robtarget(draft, stretch.middles, k - 1)}, {target}, {rest}"
        return f"MoveL {target}, {rest}"
    target = _target(stretch, k, draft.program)
    return f"MoveAbsJ {target}\\NoEOffs, {speed_and_zone}, {name}_t;"


def _speeds(draft: Draft, name: str) -> list[str]:
    """Return the speeds of seams: how fast the tool turns, and external axes, is as in v100."""
    return [
        f"  CONST speeddata {name}_f{k} := [{1e3 * speed:.7g}, 500, 5000, 1000];"
        for k, speed in enumerate(speeds_of(draft.program), 1)
    ]


def _slowly(draft: Draft, stretch: Stretch, name: str, *, by_axes: bool) -> str:
    """Return the slow motion to where a stretch begins."""
    way = Stretch(stretch.name, stretch.t, stretch.q) if by_axes else stretch
    return f"    {_motion(draft, way, 0, name, f'{name}_v, fine')}"


def _robtarget(draft: Draft, stretch: PoseStretch, k: int) -> str:
    x, y, z, *turn = rapid_numbers(stretch.places[k], stretch.turns[k])
    own = stretch.q[k, np.argsort(stretch.order)]
    *quarters, cfx = confdata(stretch.frames, own)
    values = written(stretch.q[k], draft.program.axes)
    known = {axis.name: value for axis, value in zip(draft.program.axes, values, strict=True)}
    parts = (
        ", ".join(f"{value:.4f}" for value in (x, y, z)),
        ", ".join(f"{value:.8f}" for value in turn),
        ", ".join(str(value) for value in (*quarters, cfx or 0)),
        ", ".join(known.get(name, _ABSENT) for name in AXES[6:]),
    )
    return f"[{', '.join(f'[{part}]' for part in parts)}]"


def _unknown(draft: Draft) -> list[str]:
    """Return what is not known of configurations, in words."""
    first = next((item for item in draft.program.stretches if isinstance(item, PoseStretch)), None)
    if first is None or confdata(first.frames, first.q[0, np.argsort(first.order)])[3] is not None:
        return []
    return [
        "cfx is 0 in all targets and means nothing: the wrist axes of this arm do not meet in a",
        "point, or its zero is not that of ABB's arms. The configuration is that of the begin.",
    ]


def _work(draft: Draft, name: str) -> list[str]:
    """Return the work object: in the world, or on a mechanical unit that carries it."""
    frames = draft.frames
    if frames is None:
        return []
    nowhere, place = "[[0, 0, 0], [1, 0, 0, 0]]", _pose(frames.work)
    if not frames.is_carried:
        told = f'TRUE, "", {place}, {nowhere}'
    else:
        unit = draft.settings.positioner
        if not isinstance(unit, str):
            raise ProblemError(
                f"{draft.robot.name}: an axis carries work object '{frames.name}', and a wobjdata "
                f'names its mechanical unit; say positioner = "STN1", or what it is called, in the '
                f"file of --settings (ProgramSettings(positioner=…))"
            )
        told = f'FALSE, "{unit}", {nowhere}, {place}'
    return [f"  TASK PERS wobjdata {name}_w := [FALSE, {told}];"]


def _event(draft: Draft, event: str) -> str:
    signal = draft.signal(event)
    if signal is None:
        return f"! event: {plain(event)}"
    output, value = signal
    if not isinstance(output, str) or len(output) > NAME:
        raise ProblemError(
            f"signals: '{event}' switches {output!r}; ABB's outputs have names of {NAME} "
            f"characters at most"
        )
    return f"SetDO {output}, {int(value)};"


def _target(stretch: Stretch, k: int, program: ControllerProgram) -> str:
    values = written(stretch.q[k], program.axes)
    known = {axis.name: value for axis, value in zip(program.axes, values, strict=True)}
    # A robot of fewer than six axes has 0 in their place.
    own = ", ".join(known.get(name, "0") for name in AXES[:6])
    others = ", ".join(known.get(name, _ABSENT) for name in AXES[6:])
    return f"[[{own}], [{others}]]"


def _tool(draft: Draft) -> str:
    frame, (x, y, z) = _pose(draft.tool), (1e3 * value for value in draft.settings.center)
    # What is drafted has one.
    mass = draft.settings.mass or 0.0
    return f"[TRUE, {frame}, [{mass:.4f}, [{x:.4f}, {y:.4f}, {z:.4f}], [1, 0, 0, 0], 0, 0, 0]]"


def _pose(pose: SE3) -> str:
    place = ", ".join(f"{value + 0.0:.4f}" for value in (1e3 * pose.translation).tolist())
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    turn = ", ".join(f"{value + 0.0:.8f}" for value in (w, x, y, z))
    return f"[[{place}], [{turn}]]"


def _seconds(value: float) -> str:
    return f"{value:.{TIME_DIGITS}f}"
