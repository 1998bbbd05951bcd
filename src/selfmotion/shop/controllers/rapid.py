"""ABB RAPID: targets with the time to each, or poses at speeds."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.configurations import confdata
from selfmotion.shop.controllers.feed_segments import ZONE, FeedSegment
from selfmotion.shop.controllers.pose_numbers import rapid_numbers, rapid_pose
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_reader import ProgramReader, Target
from selfmotion.shop.controllers.program_settings import AXES
from selfmotion.shop.controllers.program_texts import module_name
from selfmotion.shop.controllers.program_writer import (
    ProgramWriter,
    WrittenPose,
    goes_round,
    speeds_of,
)
from selfmotion.shop.controllers.read_segments import Pose, pose_of_values
from selfmotion.shop.controllers.segments import PoseSegment, Segment
from selfmotion.shop.controllers.statements import (
    Field,
    Language,
    Statement,
    number,
    seconds,
    truth,
    word,
)
from selfmotion.shop.controllers.thinning import TIME_DIGITS

# After ABB's Technical reference manual, RAPID Instructions, Functions and Data types (RobotWare
# 6, 3HAC050917-001): ``MoveAbsJ`` of a ``jointtarget``, whose external axes are 9E9 where there
# are none and whose unit is degrees or mm, with ``\T``, the time in seconds that the motion to it
# takes, in place of its speed. ``fine`` is a stop, ``z1`` a zone in which corners are rounded, at
# most from the middle of one motion to that of the next. Tool poses are ``MoveL`` of a
# ``robtarget`` in the work object ``wobjdata``, whose ``confdata`` says in which configuration
# the arm is; ``ConfL \Off`` has the controller go on in the one that it is in, as a shifted work
# object may need other numbers. A seam at a feed has a ``speeddata`` in place of times, and
# ``MoveC`` where it goes round, whose orientation turns evenly in the work object (``CirPathMode
# \ObjectFrame``). Outputs are set by ``SetDO``: where the arm rests when it rests, and where it
# moves when it enters the zone of its target.

# Largest number of characters in a name, those of the procedure included.
NAME = 32
# Names that no module may have.
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
# End of the name of the procedure.
_PROCEDURE = "_run"
# End of the name of the speed of slow motions.
SLOW = "_v"
# Value of an axis that is not there.
_ABSENT = "9E9"
# Value from which on there is no such axis.
_ABSENT_FROM = 8.9e9
# Largest speed of the approach [mm/s].
_FASTEST = 500.0
# Largest rate of turning of the approach [°/s].
_TURNING = 100.0
# Zones of seams at speeds, in which corners are rounded by as much as is judged.
_ZONES = ("fine", "z0")
# Rates of turning and speeds of external axes that slow no seam down [°/s, mm/s, °/s].
TURNING = (500.0, 5000.0, 1000.0)


# Values in statements: lists of numbers in brackets.


def _texts(reader: ProgramReader, text: str, count: int, what: str) -> list[str]:
    values = text.strip("[] ").split(",")
    if len(values) != count:
        raise reader.lines.fault(f"{what} has {len(values)} numbers, expected {count}")
    return values


def _numbers(reader: ProgramReader, text: str, count: int, what: str) -> list[float]:
    return [reader.lines.coordinate(item) for item in _texts(reader, text, count, what)]


def _read_speeds(reader: ProgramReader, text: str) -> list[float]:
    texts = _texts(reader, text, 4, "speeddata")
    values = [reader.lines.number_of(item) for item in texts]
    if not values[0] > 0.0:
        raise reader.lines.fault(f"v_tcp is {values[0]:g} mm/s, expected a number above 0")
    return values


def _read_axes(reader: ProgramReader, text: str) -> list[float]:
    robot, external = re.findall(_LIST, text)
    own, outer = _texts(reader, robot, 6, "robax"), _texts(reader, external, 6, "extax")
    every = dict(zip(AXES, [*own, *outer], strict=True))
    present = [name for name, item in every.items() if not _is_absent(reader, name, item)]
    reader.check_axes(present)
    return [reader.lines.coordinate(every[name]) for name in present]


def _is_absent(reader: ProgramReader, name: str, text: str) -> bool:
    return name in AXES[6:] and abs(reader.lines.number_of(text)) > _ABSENT_FROM


def _read_pose(reader: ProgramReader, text: str) -> Pose:
    place, turn, configuration, external = re.findall(_LIST, text)
    _numbers(reader, configuration, 4, "robconf")
    position, rotation = rapid_pose(_place_and_turn(reader, place, turn))
    outer = dict(zip(AXES[6:], _texts(reader, external, 6, "extax"), strict=True))
    present = {
        name: reader.lines.coordinate(item)
        for name, item in outer.items()
        if not _is_absent(reader, name, item)
    }
    return Pose(position, rotation, reader.external_axes(present), reader.lines.number)


def _place_and_turn(reader: ProgramReader, place: str, turn: str) -> Array:
    numbers = [*_numbers(reader, place, 3, "trans"), *_numbers(reader, turn, 4, "rot")]
    if not any(numbers[3:]):
        raise reader.lines.fault("the quaternion is zero")
    return np.array(numbers)


def _read_frame(reader: ProgramReader, text: str) -> SE3:
    x, y, z, *turn = _place_and_turn(reader, *re.findall(_LIST, text)).tolist()
    return pose_of_values([1e-3 * x, 1e-3 * y, 1e-3 * z, *turn[1:], turn[0]])


def _write_lists(*lists: Sequence[str]) -> str:
    return "[" + ", ".join(f"[{', '.join(each)}]" for each in lists) + "]"


def _write_axes(axes: Mapping[str, str]) -> str:
    # A robot of fewer than six axes has 0 in their place.
    own = [axes.get(name, "0") for name in AXES[:6]]
    return _write_lists(own, [axes.get(name, _ABSENT) for name in AXES[6:]])


def _write_pose(pose: WrittenPose) -> str:
    numbers = rapid_numbers(pose.place, pose.turn)
    return _write_lists(
        [f"{value:.4f}" for value in numbers[:3]],
        [f"{value:.8f}" for value in numbers[3:]],
        [pose.configuration],
        [pose.axes.get(name, _ABSENT) for name in AXES[6:]],
    )


def _write_frame(pose: SE3 | None) -> str:
    if pose is None:
        return _write_lists("000", "1000")
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    return _write_lists(
        [f"{value + 0.0:.4f}" for value in (1e3 * pose.translation).tolist()],
        [f"{value + 0.0:.8f}" for value in (w, x, y, z)],
    )


def _write_speeds(speeds: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:.7g}' for value in speeds)}]"


_LIST = r"\[[^\[\]]*\]"
_LISTS = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_WORD = word(r"[A-Z]\w{0,31}")
# States of a reader: before the module, in its data, where a procedure begins, in it, after it.
_BEFORE = ("before",)
_DATA = ("data",)
_START = ("start",)
_BODY = ("body",)
_PROGRAM = ("start", "body")
_TOOLDATA = (
    "PERS tooldata <tool> := [TRUE, <tool_frame:frame>, [<mass>, "
    "[<x:length>, <y:length>, <z:length>], [1, 0, 0, 0], 0, 0, 0]];"
)
_WOBJDATA = 'PERS wobjdata <work> := [FALSE, <fixed>, "<unit>", <user:frame>, <object:frame>];'
RAPID = Language(
    comment="!",
    last="ENDMODULE",
    outputs=f"ABB's outputs have names of {NAME} characters at most",
    has_output=lambda output: isinstance(output, str) and len(output) <= NAME,
    fields={
        "name": _WORD,
        "tool": _WORD,
        "work": _WORD,
        "speed": _WORD,
        "output": _WORD,
        "unit": word(r"\w*"),
        "zone": word(r"fine|z[0-9]{1,3}"),
        "event": word(".*"),
        "mass": number(".4f"),
        "length": number(".4f"),
        "seconds": seconds(TIME_DIGITS),
        "value": truth("0", "1"),
        "fixed": truth("FALSE", "TRUE"),
        "configurations": word("Off"),
        "circles": word("ObjectFrame"),
        "speeds": Field(_LIST, _read_speeds, _write_speeds),
        "axes": Field(_LISTS, _read_axes, _write_axes),
        "pose": Field(
            rf"\[ ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?\]", _read_pose, _write_pose
        ),
        "frame": Field(_LISTS, _read_frame, _write_frame),
    },
    statements=(
        Statement("begin", "MODULE <name>", _BEFORE, then="data"),
        Statement("tool", f"TASK {_TOOLDATA}", _DATA),
        Statement("tool", _TOOLDATA, _DATA),
        Statement("work", f"TASK {_WOBJDATA}", _DATA),
        Statement("work", _WOBJDATA, _DATA),
        Statement("speed", "CONST speeddata <speed> := <speeds>;", _DATA),
        Statement("procedure", "PROC <name>()", _DATA, then="start"),
        Statement("set", "ConfL \\<configurations>;", _START),
        Statement("set", "CirPathMode \\<circles>;", _PROGRAM),
        Statement(
            "joint approach", "MoveAbsJ <axes>\\NoEOffs, <speed>, fine, <tool>;", _PROGRAM, "body"
        ),
        Statement(
            "joint", "MoveAbsJ <axes>\\NoEOffs, <speed>\\T:=<seconds>, <zone>, <tool>;", _BODY
        ),
        Statement("linear", "MoveL <pose>, <speed>, <zone>, <tool>\\WObj:=<work>;", _BODY),
        Statement(
            "linear", "MoveL <pose>, <speed>\\T:=<seconds>, <zone>, <tool>\\WObj:=<work>;", _BODY
        ),
        Statement(
            "circular", "MoveC <via:pose>, <pose>, <speed>, <zone>, <tool>\\WObj:=<work>;", _BODY
        ),
        Statement("wait", "WaitTime <seconds>;", _BODY),
        Statement("output", "SetDO <output>, <value>;", _BODY),
        Statement("event", "! event: <event>", _BODY),
        Statement("leave", "ENDPROC", _BODY, then="left"),
        Statement("end", "ENDMODULE", ("left",), then="after"),
    ),
)


class RapidWriter(ProgramWriter):
    """Writer of a module that an IRC5 or OmniCore loads."""

    language = RAPID

    @override
    def opening(self) -> list[str]:
        draft, name = self.draft, self.name
        if not any(axis.name.startswith("A") for axis in self.program.axes):
            raise ProblemError(f"{draft.robot.name}: axes: none is A1 to A6, which a robot has")
        slow = [float(f"{draft.settings.approach * x:g}") for x in (_FASTEST, _TURNING) * 2]
        data = [
            RAPID.text("begin", name=name),
            *self.head(),
            *map(self.comment, self._unknown()),
            self._tool(),
            *self._work(),
            self.line("speed", speed=f"{name}{SLOW}", speeds=slow),
            *(
                self.line("speed", speed=f"{name}_f{k}", speeds=[1e3 * speed, *TURNING])
                for k, speed in enumerate(speeds_of(self.program), 1)
            ),
            "",
            self.line("procedure", name=f"{name}{_PROCEDURE}"),
        ]
        self.indent = "    "
        return [
            *data,
            *([] if draft.frames is None else [self.line("set", configurations="Off")]),
            *([self.line("set", circles="ObjectFrame")] if goes_round(self.program) else []),
            *self._joint_approach(self.program.segments[0]),
        ]

    @override
    def closing(self) -> list[str]:
        return [f"  {RAPID.text('leave')}", RAPID.text("end")]

    @override
    def before_step(self) -> list[str]:
        return [""]

    @override
    def approach(self, segment: Segment) -> list[str]:
        if not isinstance(segment, PoseSegment):
            return self._joint_approach(segment)
        values = {**self._frames, "speed": f"{self.name}{SLOW}", "zone": "fine"}
        return [self.line("linear", pose=self.pose(segment, 0), **values)]

    def _joint_approach(self, segment: Segment) -> list[str]:
        values = {"speed": f"{self.name}{SLOW}", "tool": f"{self.name}_t"}
        return [self.line("joint approach", axes=self.axes(segment, 0), **values)]

    @override
    def pace(self, segment: Segment, k: int) -> dict[str, Any]:
        stops = k == len(segment.t) - 1
        if isinstance(segment, FeedSegment):
            number = speeds_of(self.program).index(segment.speeds[k - 1]) + 1
            speed = f"{self.name}_f{number}"
            return {**self._frames, "speed": speed, "zone": "fine" if stops else "z0"}
        frames = self._frames if isinstance(segment, PoseSegment) else {"tool": f"{self.name}_t"}
        interval = segment.t[k] - segment.t[k - 1]
        zone = "fine" if stops else "z1"
        return {**frames, "speed": "v100", "seconds": interval, "zone": zone}

    @property
    def _frames(self) -> dict[str, str]:
        """Names of tool and work object."""
        return {"tool": f"{self.name}_t", "work": f"{self.name}_w"}

    @override
    def pose(self, segment: PoseSegment, k: int, configuration: str = "") -> WrittenPose:
        *quarters, cfx = confdata(segment.frames, segment.q[k, np.argsort(segment.order)])
        numbers = ", ".join(str(value) for value in (*quarters, cfx or 0))
        return super().pose(segment, k, configuration or numbers)

    def _unknown(self) -> list[str]:
        """Return the comment on configurations that are not known."""
        first = next((x for x in self.program.segments if isinstance(x, PoseSegment)), None)
        if first is None:
            return []
        known = confdata(first.frames, first.q[0, np.argsort(first.order)])[3] is not None
        return [] if known else _UNKNOWN_CONFIGURATION

    def _tool(self) -> str:
        x, y, z = (1e3 * value for value in self.draft.settings.center)
        # A draft has a mass.
        load = {"mass": self.draft.settings.mass or 0.0, "x": x, "y": y, "z": z}
        return self.line("tool", tool=f"{self.name}_t", tool_frame=self.draft.tool, **load)

    def _work(self) -> list[str]:
        """Return the work object: in the world, or on a mechanical unit that carries it."""
        frames, name = self.draft.frames, f"{self.name}_w"
        if frames is None:
            return []
        values = {"fixed": True, "unit": "", "user": frames.work, "object": None}
        if frames.is_carried:
            unit = self.positioner(
                str,
                'a wobjdata names its mechanical unit; say positioner = "STN1", or what it is '
                "called",
            )
            values = {"fixed": False, "unit": unit, "user": None, "object": frames.work}
        return [self.line("work", work=name, **values)]


_UNKNOWN_CONFIGURATION = [
    "cfx is 0 in all targets and means nothing: the wrist axes of this arm do not meet in a",
    "point, or its zero is not that of ABB's arms. The configuration is that of the begin.",
]


def write_rapid(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that an IRC5 or OmniCore loads."""
    RapidWriter(draft, module_name(file, NAME - len(_PROCEDURE), _WORDS)).write(file)


class RapidReader(ProgramReader):
    """Reader of modules: of what `write_rapid` writes, spaces, names and numbers aside."""

    language = RAPID
    moving = "zone is not fine"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        # Speeddata by its name: of the tool, and of what turns [mm/s, °/s, mm/s, °/s].
        self._speeds: dict[str, list[float]] = {}

    @override
    def actions(self) -> Mapping[str, Callable[..., None]]:
        return {
            **super().actions(),
            "tool": partial(self._declare, "tool"),
            "work": partial(self._declare, "work"),
            "speed": self._take_speed,
            "procedure": self.no_action,
            "joint approach": self._joint_approach,
            "joint": self._take_axes,
            "linear": self._take_pose,
            "circular": self._take_pose,
            "leave": partial(self.check_stopped, "the program ends"),
        }

    @property
    @override
    def tool(self) -> SE3 | None:
        return self.settings.get("tool_frame")

    @property
    @override
    def work(self) -> SE3 | None:
        if "object" not in self.settings:
            return None
        user, own = self.settings["user"], self.settings["object"]
        return user * own if self.settings["fixed"] else own

    @property
    @override
    def is_carried(self) -> bool | None:
        return None if "fixed" not in self.settings else not self.settings["fixed"]

    def _declare(self, kind: str, **values: object) -> None:
        """Take the tool or the work object, of which there is one."""
        if kind in self.settings:
            what = f"{'tool' if kind == 'tool' else 'wobj'}data '{self.settings[kind]}'"
            raise self.lines.fault(f"there is a {what} already, expected one")
        self.settings.update(values)

    def _take_speed(self, speed: str, speeds: list[float]) -> None:
        self._speeds[speed.lower()] = speeds

    def _joint_approach(self, axes: list[float], speed: str, tool: str) -> None:
        self._check_name("tool", tool)
        self._approach(axes, speed)

    def _approach(self, target: list[float] | Pose, speed: str) -> None:
        """Take a slow motion; nothing has judged one that is faster than those."""
        known, most = self._speeds.get(speed.lower()), (_FASTEST, _TURNING) * 2
        if known is None or any(x > least for x, least in zip(known, most, strict=True)):
            found = "none of the module" if known is None else _in_words(known)
            raise self.lines.fault(
                f"a motion to where the program goes on has speed '{speed}' ({found}), expected a "
                f"speeddata of the module of at most {_in_words(most)}: nothing has judged it"
            )
        self.approach(target)

    def _take_axes(
        self, axes: list[float], speed: str, seconds: float, zone: str, tool: str
    ) -> None:
        self._check_name("tool", tool)
        self.take(Target(axes, seconds), stops=zone.lower() == "fine")

    def _take_pose(
        self,
        pose: Pose,
        speed: str,
        zone: str,
        tool: str,
        work: str,
        seconds: float | None = None,
        via: Pose | None = None,
    ) -> None:
        """Take a pose with a time or a speed; one whose speed is called …_v is a slow motion."""
        self._check_name("tool", tool)
        self._check_name("work", work)
        if "configurations" not in self.settings:
            raise self.lines.fault(
                "linear motions need ConfL \\Off before them: else the controller may stop where "
                "the configuration is another one than a target states"
            )
        stops = zone.lower() == "fine"
        if seconds is not None:
            self.take(Target(pose, seconds), stops=stops)
        elif via is None and speed.lower().endswith(SLOW):
            if not stops:
                raise self.lines.fault(f"a slow motion has zone {zone}, expected fine")
            self._approach(pose, speed)
        else:
            self._check_judged(speed, zone, is_round=via is not None)
            self.take(
                Target(pose, speed=1e-3 * self._speeds[speed.lower()][0], via=via), stops=stops
            )

    def _check_name(self, kind: str, name: str) -> None:
        """Refuse another tool or work object than that of the module."""
        known = str(self.settings.get(kind, ""))
        if name.lower() != known.lower():
            what = "tool" if kind == "tool" else "work object"
            raise self.lines.fault(
                f"{what} is '{name}', expected '{known}', the one that the module has"
            )

    def _check_judged(self, speed: str, zone: str, *, is_round: bool) -> None:
        """Refuse what makes another motion of a seam at its speed than the one that is judged."""
        if speed.lower() not in self._speeds:
            raise self.lines.fault(f"speed '{speed}' is no speeddata of the module")
        if zone.lower() not in _ZONES:
            raise self.lines.fault(
                f"zone is {zone}, expected fine or z0: corners of seams at speeds are judged as "
                f"rounded by {1e3 * ZONE:g} mm at most"
            )
        turning = self._speeds[speed.lower()][1:]
        if any(own < least for own, least in zip(turning, TURNING, strict=True)):
            raise self.lines.fault(
                f"speeddata '{speed}' has {_in_words(turning)} for turning and external axes, "
                f"expected at least {_in_words(TURNING)}: slower ones hold the tool back from its "
                f"speed"
            )
        if is_round and "circles" not in self.settings:
            raise self.lines.fault(
                "MoveC needs CirPathMode \\ObjectFrame before it: else the tool turns otherwise"
            )


def _in_words(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
