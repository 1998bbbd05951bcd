"""KUKA Robot Language: spline blocks of targets with times, or of poses at speeds."""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.configurations import status_and_turn
from selfmotion.shop.controllers.controller_program import Switch
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.pose_numbers import krl_numbers, krl_pose
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
from selfmotion.shop.controllers.read_segments import Pose, pose_of_values, times_of
from selfmotion.shop.controllers.segments import (
    PoseSegment,
    Segment,
    fastest_between,
    on_one_side,
    straight,
)
from selfmotion.shop.controllers.statements import (
    NUMBER,
    Field,
    Language,
    Statement,
    number,
    seconds,
    truth,
    word,
)
from selfmotion.shop.controllers.thinning import TIME_DIGITS

# After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators
# (KSS 8.3 SI V4): E6AXIS aggregates, ``PTP_SPLINE`` with ``SPTP`` segments and a ``TIME_BLOCK``,
# whose parts share its time in proportion, and the path trigger. ``PTP_SPLINE`` passes all
# targets on a smooth curve in axis space; ``TIME_BLOCK`` is how times are prescribed, whereas
# ``$VEL_AXIS`` counts in percent of what only the controller knows. Where the axes cannot keep a
# time, it takes longer.
#
# Tool poses are ``E6POS`` aggregates in ``$BASE``: ``SPL`` segments of a ``SPLINE`` block, and
# ``SLIN`` where the tool goes straight. Linear motions keep the status of where they begin, so
# that S and T decide nothing in them: the first pose has them for who makes it a ``PTP``. A seam
# at a feed has ``$VEL.CP`` in place of times, and ``SCIRC`` where it goes round, whose
# orientation turns evenly in ``$BASE`` (``$ORI_TYPE = #VAR``, ``$CIRC_TYPE = #BASE``).

# Names that no module may have.
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
# Largest number of characters in a name.
NAME = 24
# Largest speed of the approach [m/s].
_FASTEST = 0.5
# Largest rate of turning of the approach [°/s].
_TURNING = 100.0
# Speed above all that the times of targets need [m/s].
_UNBOUND = 2.0
# Rate of turning above all that the times of targets need [°/s].
UNBOUND_TURNING = 400.0
# Largest share of the speeds of axes [%].
_WHOLE = 100.0
# Largest $VEL.CP [m/s].
_MOST = 3.0
# Ratio of the speed that is set to the speed that times need.
_ABOVE_TIMES = 1.02
# Length of path below which it has no direction [m].
_SHORT = 1e-3
# Distance of poses from their line by rounding [m].
_ON_LINE = 4e-7
# Difference of a block's time from the sum of its parts below which parts are seconds [s].
_SAME_TIME = 1e-4
# Variables of $VEL with the largest rates of turning.
_TURNINGS = ("ORI1", "ORI2")


# Values in statements: aggregates of axes, poses and frames.


def _values(reader: ProgramReader, text: str) -> dict[str, float]:
    """Return the numbers of an aggregate by their names."""
    values: dict[str, float] = {}
    for item in text.strip("{} ").rpartition(":")[2].split(","):
        name, _, digits = item.strip().partition(" ")
        name = name.upper()
        if name in values:
            raise reader.lines.fault(f"axis {name} is there twice")
        values[name] = reader.lines.coordinate(digits)
    return values


def _numbers(reader: ProgramReader, values: Mapping[str, float]) -> Array:
    missing = [name for name in "XYZABC" if name not in values]
    if missing:
        raise reader.lines.fault(f"has no {', '.join(missing)}")
    return np.array([values[name] for name in "XYZABC"])


def _read_axes(reader: ProgramReader, text: str) -> list[float]:
    values = _values(reader, text)
    names = [name for name in AXES if name in values]
    reader.check_axes(names)
    return [values[name] for name in names]


def _read_pose(reader: ProgramReader, text: str) -> Pose:
    # Linear motions keep the status and turn of where they begin.
    values = _values(reader, text)
    external = {name: value for name, value in values.items() if name.startswith("E")}
    place, turn = krl_pose(_numbers(reader, values))
    return Pose(place, turn, reader.external_axes(external), reader.lines.number)


def _read_frame(reader: ProgramReader, text: str) -> SE3:
    place, turn = krl_pose(_numbers(reader, _values(reader, text)))
    return pose_of_values([*place.tolist(), *turn.tolist()])


def _write_axes(axes: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{name} {text}" for name, text in axes.items()) + "}"


def _write_pose(pose: WrittenPose) -> str:
    numbers = zip("XYZABC", krl_numbers(pose.place, pose.turn), strict=True)
    parts = [f"{name} {value:.5f}" for name, value in numbers]
    parts += [pose.configuration] if pose.configuration else []
    parts += [f"{name} {text}" for name, text in pose.axes.items() if name.startswith("E")]
    return "{" + ", ".join(parts) + "}"


def _write_frame(pose: SE3) -> str:
    turn = np.array(Quaternion(pose.rotation).coeffs())
    return _write_pose(WrittenPose(np.array(pose.translation), turn, {}))


def _read_speed(reader: ProgramReader, text: str) -> float:
    value = reader.lines.number_of(text)
    if not value > 0.0:
        raise reader.lines.fault(f"$VEL.CP is {value:g} m/s, expected a number above 0")
    return value


def _read_percent(reader: ProgramReader, text: str) -> float:
    value = reader.lines.number_of(text)
    if not 0.0 < value <= _WHOLE:
        raise reader.lines.fault(f"axes have {value:g} %, expected above 0 and up to {_WHOLE:g}")
    return value


_AXIS = r"[AE][1-6]\s+[^,{}]+"
_AXES = rf"\{{\s*(?:E6AXIS\s*:|AXIS\s*:)?\s*{_AXIS}(?:,\s*{_AXIS})*\}}"
_COORDINATE = r"[A-Z][1-6]?\s+[^,{}]+"
_POSE = rf"\{{\s*(?:E6POS\s*:|POS\s*:|FRAME\s*:)?\s*{_COORDINATE}(?:,\s*{_COORDINATE})*\}}"
# States of a reader: before the module, in its head, between motions, in a block, in its times.
_BEFORE = ("before",)
_HEAD = ("head",)
_BODY = ("body",)
_IN_MODULE = ("head", "body")
_IN_BLOCK = ("block",)
_IN_TIMES = ("time",)
_SEGMENT = ("body", "block", "time")
_PACED = ("body", "block")
_TRIGGER = "TRIGGER WHEN PATH = 0 DELAY = 0 DO $OUT[<output>] = <value>"
KRL = Language(
    comment=";",
    last="END",
    outputs="KUKA's outputs are numbers from 1 on",
    has_output=lambda output: isinstance(output, int) and output >= 1,
    fields={
        "header": word(r"(?:ACCESS|REL|PARAM|COMMENT)\b.*"),
        "name": word(rf"[A-Z]\w{{0,{NAME - 1}}}"),
        "percent": Field(NUMBER, _read_percent, lambda value: f"{value:g}"),
        "speed": Field(NUMBER, _read_speed, lambda value: f"{value:.7g}"),
        "turning": number("g"),
        "orientation": word("#VAR"),
        "circles": word("#BASE"),
        "mass": number(".4f"),
        "length": number(".4f"),
        "seconds": seconds(TIME_DIGITS),
        "output": Field(r"\d+", lambda _, text: text),
        "value": truth("FALSE", "TRUE"),
        "event": word(".*"),
        "unit": Field(r"\d+", lambda _, text: text),
        "axes": Field(_AXES, _read_axes, _write_axes),
        "pose": Field(_POSE, _read_pose, _write_pose),
        "frame": Field(_POSE, _read_frame, _write_frame),
    },
    statements=(
        Statement("comment", "&<header>", _BEFORE),
        Statement("begin", "DEF <name>()", _BEFORE, then="head"),
        Statement("initialise", "BAS(#INITMOV, 0)", _HEAD),
        Statement("set", "$BASE = <work:frame>", _HEAD),
        Statement(
            "set",
            "$BASE = EK(MACHINE_DEF[<unit>].ROOT, MACHINE_DEF[<unit>].MECH_TYPE, <work:frame>)",
            _HEAD,
        ),
        Statement("set", "$TOOL = <tool:frame>", _HEAD),
        Statement(
            "set",
            "$LOAD = {M <mass>, CM {X <x:length>, Y <y:length>, Z <z:length>, A 0, B 0, C 0}, "
            "J {X 0, Y 0, Z 0}}",
            _HEAD,
        ),
        Statement("set", "$ORI_TYPE = <orientation>", _HEAD),
        Statement("set", "$CIRC_TYPE = <circles>", _HEAD),
        Statement("set", "BAS(#VEL_PTP, <VEL:percent>)", _IN_MODULE),
        Statement("set", "BAS(#ACC_PTP, <ACC:percent>)", _IN_MODULE),
        Statement("set", "$VEL.CP = <speed>", _IN_MODULE),
        Statement("set", "$VEL.ORI1 = <ORI1:turning>", _IN_MODULE),
        Statement("set", "$VEL.ORI2 = <ORI2:turning>", _IN_MODULE),
        Statement("joint approach", "PTP <axes>", _IN_MODULE, then="body"),
        Statement("linear approach", "LIN <pose>", _BODY),
        Statement("wait", "WAIT SEC <seconds>", _BODY),
        Statement("output", "$OUT[<output>] = <value>", _IN_MODULE),
        Statement("event", "; event: <event>", _IN_MODULE),
        Statement("axis block", "PTP_SPLINE", _BODY, then="block"),
        Statement("pose block", "SPLINE", _BODY, then="block"),
        Statement("times", "TIME_BLOCK START", _IN_BLOCK, then="time"),
        Statement("joint", "SPTP <axes>", _IN_TIMES),
        Statement("spline", "SPL <pose>", _SEGMENT),
        Statement("spline", "SPL <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("linear", "SLIN <pose>", _SEGMENT),
        Statement("linear", "SLIN <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("circular", "SCIRC <via:pose>, <pose>", _PACED),
        Statement("circular", "SCIRC <via:pose>, <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("part", "TIME_BLOCK PART = <seconds>", _IN_TIMES),
        Statement("trigger", _TRIGGER, ("time", "block")),
        Statement("trigger", "; event: <event>", ("time", "block")),
        Statement("whole", "TIME_BLOCK END = <seconds>", _IN_TIMES, then="ended"),
        Statement("close", "ENDSPLINE", ("ended", "block"), then="body"),
        Statement("end", "END", _IN_MODULE, then="after"),
    ),
)


class KrlWriter(ProgramWriter):
    """Writer of a module that a KR C4 or C5 selects."""

    language = KRL

    @override
    def opening(self) -> list[str]:
        draft, text = self.draft, KRL.text
        return [
            text("comment", header="ACCESS RVP"),
            text("comment", header="REL 1"),
            text("begin", name=self.name),
            *self.head(),
            self.line("initialise"),
            self._base(),
            self.line("set", tool=draft.tool),
            *self._load(),
            *self._slow(),
            *(self._arcs() if goes_round(self.program) else []),
            *self._joint_approach(self.program.segments[0]),
        ]

    @override
    def closing(self) -> list[str]:
        return [KRL.text("end")]

    @override
    def before_step(self) -> list[str]:
        return [""]

    @override
    def approach(self, segment: Segment) -> list[str]:
        if not isinstance(segment, PoseSegment):
            return self._joint_approach(segment)
        configuration = ""
        notes: list[str] = []
        if segment is next(x for x in self.program.segments if isinstance(x, PoseSegment)):
            status, turn = status_and_turn(segment.frames, segment.q[0, np.argsort(segment.order)])
            configuration = f"T {turn}" if status is None else f"S {status}, T {turn}"
            notes = _UNKNOWN_STATUS if status is None else []
        fast = self._fast()
        return [
            *map(self.comment, notes),
            *self._slow(),
            self.line("linear approach", pose=self.pose(segment, 0, configuration)),
            # A seam at its feed says it itself.
            *(fast[1:] if isinstance(segment, FeedSegment) else fast),
        ]

    @override
    def motion(self, segment: Segment) -> list[str]:
        if segment.is_rest:
            return super().motion(segment)
        lines, kind = self.events(segment, 0), "joint"
        if isinstance(segment, FeedSegment):
            return [*lines, *self._at_speed(segment)]
        if isinstance(segment, PoseSegment):
            kind = "linear" if _is_straight(segment) else "spline"
            speed = _unbound(segment)
            # After a seam at its feed, or where times ask for more.
            if speeds_of(self.program) or speed > _UNBOUND:
                lines.append(self.line("set", speed=speed))
        block = "axis block" if kind == "joint" else "pose block"
        lines += [self.line(block), self._inner("times")]
        for k, interval in enumerate(np.diff(segment.t), 1):
            lines += [*self._triggers(segment, k), f"  {self.step(segment, k, kind)}"]
            lines.append(self._inner("part", seconds=interval))
        return [*lines, self._inner("whole", seconds=segment.t[-1]), self.line("close")]

    def _at_speed(self, segment: FeedSegment) -> list[str]:
        """Return the lines of a seam at its feed: one segment, or a block of them."""
        speeds, count = segment.speeds, len(segment.speeds)
        # Steps that bend, none of them round, are passed smoothly.
        bends = not (np.isfinite(segment.vias).any() or _is_straight(segment))
        kind = "spline" if bends and count > 1 else "linear"
        lines, commands = [self.line("set", speed=speeds[0])], list[str]()
        for k, speed in enumerate(speeds, 1):
            commands += self._triggers(segment, k)
            own = {"speed": speed} if speed != speeds[0] else {}
            commands.append(f"  {self.step(segment, k, kind, **own)}")
        if count == 1 and len(commands) == 1:
            return [*lines, commands[0][2:]]
        return [*lines, self.line("pose block"), *commands, self.line("close")]

    def _triggers(self, segment: Segment, k: int) -> list[str]:
        """Return the lines that switch outputs at a target."""
        # Without ONSTART a trigger is at the end of the motion that follows.
        return [
            f"  {line}" if line.strip().startswith(";") else f"    {_AT_TARGET}{line.strip()}"
            for line in self.events(segment, k)
        ]

    def _inner(self, kind: str, **values: object) -> str:
        """Return the line of a statement in a block."""
        return f"  {self.line(kind, **values)}"

    def _joint_approach(self, segment: Segment) -> list[str]:
        slow, fast = (
            [self.line("set", VEL=percent), self.line("set", ACC=percent)]
            for percent in (_WHOLE * self.draft.settings.approach, _WHOLE)
        )
        return [*slow, self.line("joint approach", axes=self.axes(segment, 0)), *fast]

    def _slow(self) -> list[str]:
        """Return the speeds of slow linear motions."""
        share = self.draft.settings.approach
        return self._speeds(share * _FASTEST, share * _TURNING)

    def _fast(self) -> list[str]:
        """Return the speeds below which times decide."""
        return self._speeds(_UNBOUND, UNBOUND_TURNING)

    def _speeds(self, speed: float, turning: float) -> list[str]:
        if self.draft.frames is None:
            return []
        return [
            self.line("set", speed=float(f"{speed:g}")),
            self.line("set", ORI1=turning),
            self.line("set", ORI2=turning),
        ]

    def _arcs(self) -> list[str]:
        return [self.line("set", orientation="#VAR"), self.line("set", circles="#BASE")]

    def _base(self) -> str:
        """Return the frame of poses: in the world, or of an external kinematic system."""
        frames = self.draft.frames
        if frames is None:
            return f"{self.indent}$BASE = {{X 0, Y 0, Z 0, A 0, B 0, C 0}}"
        if not frames.is_carried:
            return self.line("set", work=frames.work)
        unit = self.positioner(
            int,
            "$BASE names its kinematic system by its number in MACHINE_DEF; say positioner = 2, "
            "or which it is",
        )
        return self.line("set", unit=unit, work=frames.work)

    def _load(self) -> list[str]:
        settings = self.draft.settings
        if settings.mass is None:
            return []
        x, y, z = (1e3 * value for value in settings.center)
        return [self.line("set", mass=settings.mass, x=x, y=y, z=z)]


_UNKNOWN_STATUS = [
    "S is not stated: the wrist axes of this arm do not meet in a point, or its zero is",
    "not that of KUKA's arms. The configuration is that of the begin.",
]
# Beginning of a trigger at the next target.
_AT_TARGET = _TRIGGER.partition("$OUT")[0]


def _unbound(segment: PoseSegment) -> float:
    """Return a speed above what the times of a segment need, if $VEL.CP can be it [m/s]."""
    fast, _ = fastest_between(segment.t, segment.places, segment.turns)
    return float(min(max(_UNBOUND, np.ceil(1e3 * _ABOVE_TIMES * fast) / 1e3), _MOST))


def _is_straight(segment: PoseSegment) -> bool:
    """Whether all poses are on one line that turns about one axis, one after the other."""
    rows = np.hstack([segment.places, segment.turns])
    length = np.linalg.norm(rows[:, :3] - rows[0, :3], axis=1)
    if length[-1] < _SHORT or (np.diff(length) <= 0.0).any():
        return False
    line = straight(length, length[[0, -1]], rows[[0, -1]])
    return bool(np.abs(line - rows).max() < _ON_LINE)


def write_krl(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that a KR C4 or C5 selects."""
    KrlWriter(draft, module_name(file, NAME, _WORDS)).write(file)


class KrlReader(ProgramReader):
    """Reader of modules: of what `write_krl` writes, spaces, names and numbers aside."""

    language = KRL

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self._is_initialised = False
        # Of the block that is read: whether it has poses, and which of them are smooth.
        self._by_poses = False
        self._smooth: list[bool] = []

    @override
    def actions(self) -> Mapping[str, Callable[..., None]]:
        return {
            **super().actions(),
            "initialise": self._initialise,
            "joint approach": self._joint_approach,
            "linear approach": self._linear_approach,
            "axis block": self._begin_block,
            "pose block": lambda: self._begin_block(by_poses=True),
            "times": self._begin_times,
            "joint": self._take_axes,
            "linear": self._take_pose,
            "spline": lambda **values: self._take_pose(is_smooth=True, **values),
            "circular": self._take_arc,
            "part": self._take_part,
            "trigger": self._take_trigger,
            "whole": self._end_times,
            "close": self._end_block,
        }

    @property
    @override
    def is_carried(self) -> bool | None:
        return "unit" in self.settings if "work" in self.settings else None

    @override
    def check(self, kind: str) -> None:
        if self.state == "time" and kind in ("joint", "spline", "linear"):
            if self._by_poses != (kind != "joint"):
                raise self.lines.fault("SPLINE has SPL and SLIN, PTP_SPLINE has SPTP")
            if self.run and not self.run[-1].seconds:
                raise self.lines.fault("the target before has no TIME_BLOCK PART")

    def _initialise(self) -> None:
        """Take that all settings begin anew, which has to come before anything is set."""
        if self.settings or self._is_initialised:
            raise self.lines.fault(
                "BAS(#INITMOV, 0) after frames, speeds or the load were set, expected it once and "
                "first: it may set them back"
            )
        self._is_initialised = True

    def _joint_approach(self, axes: list[float]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        facts = self.comments.facts()
        most = _WHOLE if facts is None else _WHOLE * facts.approach
        share = {name: self.settings.get(name, 0.0) for name in ("VEL", "ACC")}
        fast = [name for name, value in share.items() if not 0.0 < value <= most + _SAME_TIME]
        if fast:
            raise self.lines.fault(
                f"PTP goes to where the motion goes on at BAS(#{fast[0]}_PTP) of "
                f"{share[fast[0]]:g} %, expected up to {most:g}: nothing has judged it"
            )
        self.approach(axes)

    def _linear_approach(self, pose: Pose) -> None:
        """Take the pose from which the motion goes on by poses."""
        speed = self.settings.get("speed", 0.0)
        turning = max(self.settings.get(name, 0.0) for name in _TURNINGS)
        if not (0.0 < speed <= _FASTEST and turning <= _TURNING):
            raise self.lines.fault(
                f"LIN goes to where the motion goes on at {speed:g} m/s and {turning:g}°/s, "
                f"expected at most {_FASTEST:g} m/s and {_TURNING:g}°/s: nothing has judged it"
            )
        self.approach(pose)

    def _begin_block(self, *, by_poses: bool = False) -> None:
        self._by_poses, self._smooth = by_poses, []

    def _begin_times(self) -> None:
        if self.run:
            raise self.lines.fault("a time block after segments without times")

    def _take_axes(self, axes: list[float]) -> None:
        self.run.append(Target(axes))

    def _take_pose(
        self, pose: Pose, speed: float | None = None, *, is_smooth: bool = False
    ) -> None:
        """Take a straight or smooth segment: with a time in a time block, else at a speed."""
        if self.state == "time":
            self.run.append(Target(pose))
        else:
            self._take_at_speed(pose, None, speed, is_smooth=is_smooth)

    def _take_arc(self, via: Pose, pose: Pose, speed: float | None = None) -> None:
        """Take a circular segment at a speed."""
        if not {"orientation", "circles"} <= set(self.settings):
            raise self.lines.fault(
                "SCIRC needs $ORI_TYPE = #VAR and $CIRC_TYPE = #BASE at the head: else the tool "
                "turns otherwise"
            )
        self._take_at_speed(pose, via, speed)

    def _take_at_speed(
        self, pose: Pose, via: Pose | None, speed: float | None, *, is_smooth: bool = False
    ) -> None:
        """Take a segment at a speed, in a block or alone."""
        alone = self.state == "body"
        if alone:
            self._begin_block(by_poses=True)
        if not self._by_poses:
            raise self.lines.fault("PTP_SPLINE has SPTP with times")
        own = self.settings.get("speed", 0.0) if speed is None else speed
        if not own > 0.0:
            raise self.lines.fault("a segment without a time, expected $VEL.CP before it")
        turning = {name: self.settings.get(name, UNBOUND_TURNING) for name in _TURNINGS}
        slow = [name for name, value in turning.items() if value < UNBOUND_TURNING]
        if slow:
            raise self.lines.fault(
                f"$VEL.{slow[0]} is {turning[slow[0]]:g}°/s, expected at least "
                f"{UNBOUND_TURNING:g}: a slower one holds the tool back from its speed"
            )
        self.run.append(Target(pose, speed=own, via=via))
        self._smooth.append(is_smooth)
        if alone:
            self.stop(is_spline=is_smooth)

    def _take_part(self, seconds: float) -> None:
        """Take the share of time of the target before."""
        if not self.run or self.run[-1].seconds:
            raise self.lines.fault("there is no target before this part")
        self.run[-1].seconds = seconds

    def _take_trigger(self, output: str = "", value: bool | None = None, event: str = "") -> None:
        """Take an output or event at the target that follows."""
        self.happen(Switch(0.0, output or event.strip(), value), ahead=1)

    def _end_times(self, seconds: float) -> None:
        """Take the time of all targets, and end their motion."""
        if not self.run or not self.run[-1].seconds:
            raise self.lines.fault("each target needs its TIME_BLOCK PART")
        parts = sum(target.seconds for target in self.run)
        share = seconds / parts
        # Parts are shares: those that are seconds stay what they are.
        scale = 1.0 if abs(share - 1.0) * parts < _SAME_TIME else share
        for target in self.run:
            target.seconds *= scale
        self._check_triggers()
        if self._by_poses:
            self._check_in_time()
        else:
            self._check_axis_speeds()
        self.stop()

    def _check_triggers(self) -> None:
        if any(number > len(self.run) for number, _ in self.happens):
            raise self.lines.fault("a trigger has no target after it")

    def _check_axis_speeds(self) -> None:
        """Refuse shares of speeds in force that hold the axes back from the times of a block."""
        for name in ("VEL", "ACC"):
            share = self.settings.get(name, 0.0)
            if share < _WHOLE:
                raise self.lines.fault(
                    f"BAS(#{name}_PTP) before this block is {share:g} %, expected {_WHOLE:g}: less "
                    f"holds the axes back from their times"
                )

    def _check_in_time(self) -> None:
        """Refuse speeds in force that hold the tool back from the times of a block."""
        poses = [at for at in (self.here, *(x.at for x in self.run)) if isinstance(at, Pose)]
        if len(poses) == len(self.run):
            # It begins at axis targets, which `stop` refuses.
            return
        places = np.array([pose.place for pose in poses])
        turns = on_one_side(np.array([pose.turn for pose in poses]))
        times = times_of([target.seconds for target in self.run])
        fast, turning = fastest_between(times, places, turns)
        speed = self.settings.get("speed", 0.0)
        least = min(self.settings.get(name, 0.0) for name in _TURNINGS)
        if fast > speed:
            raise self.lines.fault(
                f"times ask for {fast:.4g} m/s, $VEL.CP is {speed:g} m/s: it holds the tool "
                f"back from its times"
            )
        if np.degrees(turning) > least:
            raise self.lines.fault(
                f"times ask for {np.degrees(turning):.4g}°/s, $VEL.ORI1 or $VEL.ORI2 is "
                f"{least:g}°/s: it holds the tool back from its times"
            )

    def _end_block(self) -> None:
        """End a spline block: one of segments at speeds stops there."""
        if self.state == "ended":
            return
        if not self.run:
            raise self.lines.fault("the spline block has no segments")
        if len(set(self._smooth)) > 1:
            raise self.lines.fault("SPL beside SLIN or SCIRC is not judged, expected SLIN")
        self._check_triggers()
        self.stop(is_spline=self._smooth[0])
