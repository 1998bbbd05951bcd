r"""ABB RAPID: axis targets with the time to each.

After ABB's Technical reference manual, RAPID Instructions, Functions and Data types (RobotWare 6,
3HAC050917-001): ``MoveAbsJ`` of a ``jointtarget``, whose external axes are 9E9 where there are none
and whose unit is degrees or mm, with ``\T``, the time in seconds that the motion to it takes, in
place of its speed. ``fine`` is a stop, ``z1`` a zone in which corners are rounded, at most from the
middle of one motion to that of the next. Outputs are set by ``SetDO``: where the arm rests when it
rests, and where it moves when it enters the zone of its target.
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
from selfmotion.formats.program_lines import ProgramReader, Row
from selfmotion.formats.program_settings import AXES
from selfmotion.formats.stretches import Stretch
from selfmotion.formats.thinning import TIME_DIGITS
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
# What stands for an axis that is not there, and from where on numbers mean that.
_ABSENT, _ABSENT_FROM = "9E9", 8.9e9
# The fastest approach [mm/s, °/s].
_FASTEST, _TURNING = 500.0, 100.0
# Without a load a flange carries this [kg], at this height [mm]: that of tool0.
_BARE = 0.001, 0.001


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
        f"  TASK PERS tooldata {name}_t := {_tool(draft)};",
        f"  CONST speeddata {name}_v := [{speed}];",
        "",
        f"  PROC {name}{_PROCEDURE}()",
        f"    MoveAbsJ {_target(program.stretches[0], 0, program)}\\NoEOffs, "
        f"{name}_v, fine, {name}_t;",
    ]
    for stretch in program.stretches:
        lines += ["", f"    ! step: {plain(stretch.name)}", *_moves(draft, stretch, name)]
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
            lines.append(
                f"    MoveAbsJ {_target(stretch, k, draft.program)}\\NoEOffs, "
                f"v100\\T:={seconds}, {zone}, {name}_t;"
            )
        lines += [f"    {_event(draft, item.name)}" for item in stretch.events if item.target == k]
    return lines


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
    mass = draft.settings.mass
    if mass is None:
        mass, z = _BARE
    return f"[TRUE, {frame}, [{mass:.4f}, [{x:.4f}, {y:.4f}, {z:.4f}], [1, 0, 0, 0], 0, 0, 0]]"


def _pose(pose: SE3) -> str:
    place = ", ".join(f"{value + 0.0:.4f}" for value in (1e3 * pose.translation).tolist())
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    turn = ", ".join(f"{value + 0.0:.8f}" for value in (w, x, y, z))
    return f"[[{place}], [{turn}]]"


def _seconds(value: float) -> str:
    return f"{value:.{TIME_DIGITS}f}"


class RapidReader(ProgramReader):
    """Reads a module: what `write_rapid` writes, spaces, names and numbers aside."""

    comment, last = "!", "ENDMODULE"

    def __init__(self, file: FilePath) -> None:
        super().__init__(file)
        self._targets: list[list[float]] = []
        self._times: list[float] = []

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "data"

    def procedure(self, _: Sequence[str]) -> None:
        """Begin its procedure."""
        self.state = "start"

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins."""
        self.at, self.state = self._target(given[0], given[1]), "body"

    def wait(self, given: Sequence[str]) -> None:
        """Take a rest."""
        if self._targets:
            raise self.lines.fault("the arm is to rest where it does not stop: zone is not fine")
        super().wait(given)

    def move(self, given: Sequence[str]) -> None:
        """Take a target."""
        robot, others, seconds, zone = given
        self._targets.append(self._target(robot, others))
        self._times.append(self.lines.duration(seconds))
        if zone.lower() == "fine":
            self.rows.append(Row(self.lines.step(), [self.at, *self._targets], self._times))
            self.at, self._targets, self._times = self._targets[-1], [], []

    @property
    def clock(self) -> float:
        """See `ProgramReader.clock`: with the targets since the last stop."""
        return super().clock + sum(self._times)

    def leave(self, _: Sequence[str]) -> None:
        """End the procedure."""
        if self._targets:
            raise self.lines.fault("the last target has a zone, expected fine")
        self.state = "left"

    def _target(self, robot: str, others: str) -> list[float]:
        values = [text.split(",") for text in (robot, others)]
        for found, what in zip(values, ("robax", "extax"), strict=True):
            if len(found) != 6:
                raise self.lines.fault(f"{what} has {len(found)} numbers, expected 6")
        every = dict(zip(AXES, [*values[0], *values[1]], strict=True))
        self.same_axes([name for name, text in every.items() if not self._is_absent(name, text)])
        return [self.lines.coordinate(every[name]) for name in self.present]

    def _is_absent(self, name: str, text: str) -> bool:
        return name in AXES[6:] and abs(self.lines.number_of(text)) > _ABSENT_FROM


_WORD = r"[A-Z]\w{0,31}"
_LIST = r"\[([^\[\]]*)\]"
_TARGET = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
RapidReader.grammar = (
    (("before",), rf"MODULE ({_WORD})", RapidReader.begin),
    (("data",), rf"(?:TASK )?PERS tooldata {_WORD} ?:= ?\[[^;!]*\];", RapidReader.skip),
    (("data",), rf"CONST speeddata {_WORD} ?:= ?\[[^;!\[\]]*\];", RapidReader.skip),
    (("data",), rf"PROC {_WORD} ?\( ?\)", RapidReader.procedure),
    (
        ("start",),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?{_WORD} ?, ?fine ?, ?{_WORD} ?;",
        RapidReader.go,
    ),
    (
        ("body",),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?{_WORD} ?\\T ?:= ?([^,]+), ?"
        rf"(fine|z[0-9]{{1,3}}) ?, ?{_WORD} ?;",
        RapidReader.move,
    ),
    (("body",), r"WaitTime ([^;\s]+) ?;", RapidReader.wait),
    (("body",), rf"SetDO ({_WORD}) ?, ?([01]) ?;", RapidReader.switch),
    (("body",), r"! event: (.*)", RapidReader.switch),
    (("body",), r"ENDPROC", RapidReader.leave),
    (("left",), r"ENDMODULE", RapidReader.end),
)
