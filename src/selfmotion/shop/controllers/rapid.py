"""ABB RAPID: targets with the time to each, written, and read line by line."""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import ProblemError, write_text
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.controller_program import (
    ControllerProgram,
    Draft,
    before,
    goes_round,
    head,
    speeds_of,
    with_begins,
)
from selfmotion.shop.controllers.feed_segments import ZONE, FeedSegment
from selfmotion.shop.controllers.program_lines import StopReader
from selfmotion.shop.controllers.program_settings import AXES, written
from selfmotion.shop.controllers.program_texts import module_name, plain
from selfmotion.shop.controllers.read_segments import Pose, pose_of_values
from selfmotion.shop.controllers.segments import PoseSegment, Segment
from selfmotion.shop.controllers.thinning import TIME_DIGITS
from selfmotion.shop.controllers.tool_frames import confdata, rapid_numbers, rapid_pose

# ABB RAPID: axis targets with the time to each.
#
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

# Characters in a name, those of the procedure included.
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
_PROCEDURE = "_run"
# Value of an axis that is not there.
_ABSENT = "9E9"
# How a time takes the place of a speed.
_TIME = "\\T:="
# Largest speed of the approach [mm/s].
_FASTEST = 500.0
# Largest rate of turning of the approach [°/s].
_TURNING = 100.0


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
        _slowly(draft, program.segments[0], name, by_axes=True),
    ]
    for segment, begun in with_begins(program.segments):
        lines += ["", f"    ! step: {plain(segment.name)}"]
        lines += [f"    ! {line}" for line in before(segment)]
        if begun is not None:
            by_axes = not isinstance(begun, PoseSegment)
            lines.append(_slowly(draft, begun, name, by_axes=by_axes))
        lines += _moves(draft, segment, name)
    write_text(file, "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""]))


def _check_robot_axes(draft: Draft) -> None:
    if not any(axis.name.startswith("A") for axis in draft.program.axes):
        raise ProblemError(f"{draft.robot.name}: axes: none is A1 to A6, which a robot has")


def _moves(draft: Draft, segment: Segment, name: str) -> list[str]:
    last = len(segment.t) - 1
    lines = []
    for k in range(last + 1):
        if k and segment.is_rest:
            lines.append(f"    WaitTime {_seconds(segment.t[k] - segment.t[k - 1])};")
        elif k:
            zone = "fine" if k == last else "z1"
            seconds = _seconds(segment.t[k] - segment.t[k - 1])
            speed = f"v100{_TIME}{seconds}"
            if isinstance(segment, FeedSegment):
                speed = f"{name}_f{speeds_of(draft.program).index(segment.speeds[k - 1]) + 1}"
                zone = "fine" if k == last else "z0"
            lines.append(f"    {_motion(draft, segment, k, name, f'{speed}, {zone}')}")
        lines += [f"    {_event(draft, item.name)}" for item in segment.events if item.target == k]
    return lines


def _motion(draft: Draft, segment: Segment, k: int, name: str, speed_and_zone: str) -> str:
    """Return the motion to a target of a segment: linear to a pose, by the axes to joints."""
    if isinstance(segment, PoseSegment):
        target, rest = _robtarget(draft, segment, k), f"{speed_and_zone}, {name}_t\\WObj:={name}_w;"
        if isinstance(segment, FeedSegment) and k and segment.goes_round(k):
            return f"MoveC {_robtarget(draft, segment.middles, k - 1)}, {target}, {rest}"
        return f"MoveL {target}, {rest}"
    target = _target(segment, k, draft.program)
    return f"MoveAbsJ {target}\\NoEOffs, {speed_and_zone}, {name}_t;"


def _speeds(draft: Draft, name: str) -> list[str]:
    """Return the speeds of seams: how fast the tool turns, and external axes, is as in v100."""
    return [
        f"  CONST speeddata {name}_f{k} := [{1e3 * speed:.7g}, 500, 5000, 1000];"
        for k, speed in enumerate(speeds_of(draft.program), 1)
    ]


def _slowly(draft: Draft, segment: Segment, name: str, *, by_axes: bool) -> str:
    """Return the slow motion to where a segment begins."""
    way = Segment(segment.name, segment.t, segment.q) if by_axes else segment
    return f"    {_motion(draft, way, 0, name, f'{name}_v, fine')}"


def _robtarget(draft: Draft, segment: PoseSegment, k: int) -> str:
    x, y, z, *turn = rapid_numbers(segment.places[k], segment.turns[k])
    own = segment.q[k, np.argsort(segment.order)]
    *quarters, cfx = confdata(segment.frames, own)
    values = written(segment.q[k], draft.program.axes)
    known = {axis.name: value for axis, value in zip(draft.program.axes, values, strict=True)}
    parts = (
        ", ".join(f"{value:.4f}" for value in (x, y, z)),
        ", ".join(f"{value:.8f}" for value in turn),
        ", ".join(str(value) for value in (*quarters, cfx or 0)),
        ", ".join(known.get(name, _ABSENT) for name in AXES[6:]),
    )
    return f"[{', '.join(f'[{part}]' for part in parts)}]"


def _unknown(draft: Draft) -> list[str]:
    """Return the comment on configurations that are not known."""
    first = next((item for item in draft.program.segments if isinstance(item, PoseSegment)), None)
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
        rows = f'TRUE, "", {place}, {nowhere}'
    else:
        unit = draft.settings.positioner
        if not isinstance(unit, str):
            raise ProblemError(
                f"{draft.robot.name}: an axis carries work object '{frames.name}', and a wobjdata "
                f'names its mechanical unit; say positioner = "STN1", or what it is called, in the '
                f"file of --settings (ProgramSettings(positioner=…))"
            )
        rows = f'FALSE, "{unit}", {nowhere}, {place}'
    return [f"  TASK PERS wobjdata {name}_w := [FALSE, {rows}];"]


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


def _target(segment: Segment, k: int, program: ControllerProgram) -> str:
    values = written(segment.q[k], program.axes)
    known = {axis.name: value for axis, value in zip(program.axes, values, strict=True)}
    # A robot of fewer than six axes has 0 in their place.
    own = ", ".join(known.get(name, "0") for name in AXES[:6])
    others = ", ".join(known.get(name, _ABSENT) for name in AXES[6:])
    return f"[[{own}], [{others}]]"


def _tool(draft: Draft) -> str:
    frame, (x, y, z) = _pose(draft.tool), (1e3 * value for value in draft.settings.center)
    # A draft has one.
    mass = draft.settings.mass or 0.0
    return f"[TRUE, {frame}, [{mass:.4f}, [{x:.4f}, {y:.4f}, {z:.4f}], [1, 0, 0, 0], 0, 0, 0]]"


def _pose(pose: SE3) -> str:
    place = ", ".join(f"{value + 0.0:.4f}" for value in (1e3 * pose.translation).tolist())
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    turn = ", ".join(f"{value + 0.0:.8f}" for value in (w, x, y, z))
    return f"[[{place}], [{turn}]]"


def _seconds(value: float) -> str:
    return f"{value:.{TIME_DIGITS}f}"


# ABB RAPID, read line by line: what `selfmotion.shop.controllers.rapid` writes.

# End of the name of the speed of slow motions.
SLOW = "_v"
# Zones of seams at speeds, in which corners are rounded by as much as is judged.
_ZONES = ("fine", "z0")
# How fast the tool turns at most, and external axes [°/s, mm/s, °/s]: none of it slows a seam down.
TURNING = (500.0, 5000.0, 1000.0)
# From where on a number means that there is no such axis.
_ABSENT_FROM = 8.9e9


class RapidReader(StopReader):
    """Reads a module: what `write_rapid` writes, spaces, names and numbers aside."""

    comment, last = "!", "ENDMODULE"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        # Speeds by the names of their speeddata: of the tool [mm/s], and of what turns.
        self._known: dict[str, list[float]] = {}
        # Names of tool and work object of the module, and whether arcs turn as they are judged.
        self._tool_name, self._work_name, self._turns_evenly = "", "", False
        # Whether configurations of poses are not asked for.
        self._goes_on = False

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "data"

    def tool_is(self, given: Sequence[str]) -> None:
        """Take the tool in the flange."""
        if self._tool_name:
            raise self.lines.fault(f"there is a tooldata '{self._tool_name}' already, expected one")
        self._tool_name = given[0].lower()
        self.tool = self._frame(given[1], given[2])
        self.load_is(given[3], self._texts(given[4], 3, "cog"), 1e-3)

    def work_is(self, given: Sequence[str]) -> None:
        """Take the work object: user frame and object frame, the first one of a unit its own."""
        if self._work_name:
            raise self.lines.fault(f"there is a wobjdata '{self._work_name}' already, expected one")
        self._work_name = given[0].lower()
        fixed, self.unit, *frames = given[1].upper() == "TRUE", *given[2:]
        user, object_ = frames[:2], frames[2:]
        self.is_carried = not fixed
        own = self._frame(*object_)
        self.work = self._frame(*user) * own if fixed else own

    def procedure(self, _: Sequence[str]) -> None:
        """Begin its procedure."""
        self.state = "start"

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        self._check_stopped("a slow motion")
        robot, others, speed, tool = given
        self._check_slow(speed)
        self._check_tool(tool)
        self.begin_at(self._target(robot, others))
        self.state = "body"

    def _check_slow(self, speed: str) -> None:
        """Refuse a motion to where the program goes on that is faster than slow ones are."""
        known = self._known.get(speed.lower())
        most = (_FASTEST, _TURNING, _FASTEST, _TURNING)
        if known is None or any(x > least for x, least in zip(known, most, strict=True)):
            found = "none of the module" if known is None else ", ".join(f"{x:g}" for x in known)
            raise self.lines.fault(
                f"a motion to where the program goes on has speed '{speed}' ({found}), expected a "
                f"speeddata of the module of at most {', '.join(f'{x:g}' for x in most)}: nothing "
                f"has judged it"
            )

    def _check_tool(self, tool: str) -> None:
        if tool.lower() != self._tool_name:
            raise self.lines.fault(
                f"tool is '{tool}', expected '{self._tool_name}', the one that the module has"
            )

    def speed_is(self, given: Sequence[str]) -> None:
        """Take the speed of a speeddata [mm/s]."""
        values = [self.lines.number_of(item) for item in self._texts(given[1], 4, "speeddata")]
        if not values[0] > 0.0:
            raise self.lines.fault(f"v_tcp is {values[0]:g} mm/s, expected a number above 0")
        self._known[given[0].lower()] = values

    def goes_on(self, _: Sequence[str]) -> None:
        """Take that linear motions go on in the configuration that the arm is in."""
        self._goes_on = True

    def arcs_turn_evenly(self, _: Sequence[str]) -> None:
        """Take how the tool turns in circular motions."""
        self._turns_evenly = True

    def move_at_speed(self, given: Sequence[str]) -> None:
        """Take a pose at a speed, straight or round; one that is called …_v is a slow motion."""
        *poses, speed, zone, tool, work = given
        self._check_names(tool, work)
        if not poses[4:] and speed.lower().endswith(SLOW):
            if zone.lower() != "fine":
                raise self.lines.fault(f"a slow motion has zone {zone}, expected fine")
            self._check_slow(speed)
            self.go_linear(poses)
            return
        if self.axes or self.times:
            raise self.lines.fault(
                "a motion at a speed after one with a time, expected fine before"
            )
        if speed.lower() not in self._known:
            raise self.lines.fault(f"speed '{speed}' is no speeddata of the module")
        self._check_judged(speed, zone, is_round=bool(poses[4:]))
        pose, via = self._pose(poses[-4:]), self._pose(poses[:4]) if poses[4:] else None
        fast = 1e-3 * self._known[speed.lower()][0]
        self.take_pose_at_speed(pose, via, fast, stops=zone.lower() == "fine")

    def _check_names(self, tool: str, work: str) -> None:
        """Refuse a pose of another tool or work object than those of the module."""
        self._check_tool(tool)
        if work.lower() != self._work_name:
            raise self.lines.fault(
                f"work object is '{work}', expected '{self._work_name}', the one that the module "
                f"has"
            )
        if not self._goes_on:
            raise self.lines.fault(
                "linear motions need ConfL \\Off before them: else the controller may stop where "
                "the configuration is another one than a target states"
            )

    def _check_judged(self, speed: str, zone: str, *, is_round: bool) -> None:
        """Refuse what makes another motion of a seam at its speed than the one that is judged."""
        if zone.lower() not in _ZONES:
            raise self.lines.fault(
                f"zone is {zone}, expected fine or z0: corners of seams at speeds are judged as "
                f"rounded by {1e3 * ZONE:g} mm at most"
            )
        turning = self._known[speed.lower()][1:]
        if any(own < least for own, least in zip(turning, TURNING, strict=True)):
            raise self.lines.fault(
                f"speeddata '{speed}' has {', '.join(f'{x:g}' for x in turning)} for turning and "
                f"external axes, expected at least {', '.join(f'{x:g}' for x in TURNING)}: slower "
                f"ones hold the tool back from its speed"
            )
        if is_round and not self._turns_evenly:
            raise self.lines.fault(
                "MoveC needs CirPathMode \\ObjectFrame before it: else the tool turns otherwise"
            )

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        self._check_stopped("a slow motion")
        self.slowly(self._pose(given))

    def wait(self, given: Sequence[str]) -> None:
        """Take a rest."""
        self._check_stopped("the arm is to rest")
        super().wait(given)

    def move(self, given: Sequence[str]) -> None:
        """Take an axis target."""
        robot, others, seconds, zone, tool = given
        self._check_tool(tool)
        if self.poses:
            raise self.lines.fault("an axis target after a pose whose zone is not fine")
        axes, taken = self._target(robot, others), self.lines.duration(seconds)
        self.take_axes(axes, taken, stops=zone.lower() == "fine")

    def move_linear(self, given: Sequence[str]) -> None:
        """Take a pose."""
        *target, seconds, zone, tool, work = given
        self._check_names(tool, work)
        if self.axes or self.speeds:
            raise self.lines.fault("a pose after another kind of target whose zone is not fine")
        pose, taken = self._pose(target), self.lines.duration(seconds)
        self.take_pose(pose, taken, stops=zone.lower() == "fine")

    def leave(self, _: Sequence[str]) -> None:
        """End the procedure."""
        if self.is_moving:
            raise self.lines.fault("the last target has a zone, expected fine")
        self.state = "left"

    def _check_stopped(self, what: str) -> None:
        if self.is_moving:
            raise self.lines.fault(f"{what} where it does not stop: zone is not fine")

    def _frame(self, place: str, turn: str) -> SE3:
        position, rotation = self._list(place, 3, "trans"), self._list(turn, 4, "rot")
        if not any(rotation):
            raise self.lines.fault("the quaternion is zero")
        w, x, y, z = rotation
        return pose_of_values([*(1e-3 * value for value in position), x, y, z, w])

    def _pose(self, given: Sequence[str]) -> Pose:
        place, turn, configuration, others = given
        self._list(configuration, 4, "robconf")
        numbers = [*self._list(place, 3, "trans"), *self._list(turn, 4, "rot")]
        if not any(numbers[3:]):
            raise self.lines.fault("the quaternion is zero")
        outer = dict(zip(AXES[6:], self._texts(others, 6, "extax"), strict=True))
        present = {
            name: self.lines.coordinate(text)
            for name, text in outer.items()
            if not self._is_absent(name, text)
        }
        position, rotation = rapid_pose(np.array(numbers))
        return Pose(position, rotation, self.others_of(present), self.lines.number)

    def _list(self, text: str, count: int, what: str) -> list[float]:
        return [self.lines.coordinate(item) for item in self._texts(text, count, what)]

    def _texts(self, text: str, count: int, what: str) -> list[str]:
        values = text.split(",")
        if len(values) != count:
            raise self.lines.fault(f"{what} has {len(values)} numbers, expected {count}")
        return values

    def _target(self, robot: str, others: str) -> list[float]:
        own, outer = self._texts(robot, 6, "robax"), self._texts(others, 6, "extax")
        every = dict(zip(AXES, [*own, *outer], strict=True))
        self.same_axes([name for name, text in every.items() if not self._is_absent(name, text)])
        return [self.lines.coordinate(every[name]) for name in self.present]

    def _is_absent(self, name: str, text: str) -> bool:
        return name in AXES[6:] and abs(self.lines.number_of(text)) > _ABSENT_FROM


_WORD = r"[A-Z]\w{0,31}"
_LIST = r"\[([^\[\]]*)\]"
_TARGET = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_POSE = rf"\[ ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?\]"
_FRAME = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_NO_TURN = r"\[ ?1 ?, ?0 ?, ?0 ?, ?0 ?\]"
_TIMED = rf"{_WORD} ?\\T ?:= ?([^,]+), ?(fine|z[0-9]{{1,3}})"
_FRAMES = rf"({_WORD}) ?\\WObj ?:= ?({_WORD}) ?;"
_AT_SPEED = rf"({_WORD}) ?, ?(fine|z[0-9]{{1,3}}) ?, ?{_FRAMES}"
RapidReader.grammar = (
    (("before",), rf"MODULE ({_WORD})", RapidReader.begin),
    (
        ("data",),
        rf"(?:TASK )?PERS tooldata ({_WORD}) ?:= ?\[ ?TRUE ?, ?{_FRAME} ?, ?\[ ?([^,\[\]]+), ?"
        rf"{_LIST} ?, ?{_NO_TURN} ?, ?0 ?, ?0 ?, ?0 ?\] ?\];",
        RapidReader.tool_is,
    ),
    (
        ("data",),
        rf"(?:TASK )?PERS wobjdata ({_WORD}) ?:= ?\[ ?FALSE ?, ?(TRUE|FALSE) ?, ?\"(\w*)\" ?, ?"
        rf"{_FRAME} ?, ?{_FRAME} ?\];",
        RapidReader.work_is,
    ),
    (("data",), rf"CONST speeddata ({_WORD}) ?:= ?{_LIST};", RapidReader.speed_is),
    (("data",), rf"PROC {_WORD} ?\( ?\)", RapidReader.procedure),
    (("start",), r"ConfL ?\\ ?Off ?;", RapidReader.goes_on),
    (("start", "body"), r"CirPathMode ?\\ ?ObjectFrame ?;", RapidReader.arcs_turn_evenly),
    (
        ("start", "body"),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?({_WORD}) ?, ?fine ?, ?({_WORD}) ?;",
        RapidReader.go,
    ),
    (
        ("body",),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?{_TIMED} ?, ?({_WORD}) ?;",
        RapidReader.move,
    ),
    (("body",), rf"MoveL {_POSE} ?, ?{_AT_SPEED}", RapidReader.move_at_speed),
    (("body",), rf"MoveC {_POSE} ?, ?{_POSE} ?, ?{_AT_SPEED}", RapidReader.move_at_speed),
    (
        ("body",),
        rf"MoveL {_POSE} ?, ?{_TIMED} ?, ?{_FRAMES}",
        RapidReader.move_linear,
    ),
    (("body",), r"WaitTime ([^;\s]+) ?;", RapidReader.wait),
    (("body",), rf"SetDO ({_WORD}) ?, ?([01]) ?;", RapidReader.switch),
    (("body",), r"! event: (.*)", RapidReader.switch),
    (("body",), r"ENDPROC", RapidReader.leave),
    (("left",), r"ENDMODULE", RapidReader.end),
)
