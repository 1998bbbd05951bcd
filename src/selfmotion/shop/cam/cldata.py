"""Cutter location data in APT's format (ISO 4343): motion statements, feeds, arcs and cycles."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, lines_of
from selfmotion.shop.cam.arcs import arc_points
from selfmotion.shop.cam.cuts import Machine, unit_axis
from selfmotion.shop.cam.drilling import Pecks, drill
from selfmotion.shop.cam.pose_rows import LENGTH_UNITS, PoseRows

# Inch [m].
_INCH = 25.4e-3
# Millimetre [m].
_MM = 1e-3
_STATEMENT = re.compile(r"([A-Z][A-Z0-9]{0,7})\s*(?:/(.*))?")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:E[+-]?[0-9]{1,2})?")
# Longest statement [characters].
_LONGEST = 10_000
_UNITS = {"MM": _MM, "INCH": _INCH, "INCHES": _INCH}
# Units of feeds per minute; other units, such as per turn, are not read.
_FEEDS = {"MMPM": _MM, "IPM": _INCH, "PERMIN": None}
# Statements without effect on the motion: names, the cutter's shape, tolerances.
_IGNORED = (
    *("MACHIN", "CUTTER", "INTOL", "OUTTOL", "TOLER", "TLDATA", "SELECTL", "TOOLNO", "MULTAX"),
    *("PAINT", "SEQNO", "SELECT", "AUTOPS", "CLPRNT", "NOPOST", "REWIND"),
)
# Statements that are ignored with these arguments only.
_HARMLESS = {"MODE": ("ABSOL", "MILL"), "SET": ("MODE,ABSOL", "MODE,MILL"), "OPSKIP": ("OFF",)}
# Statements that may move a position or a frame, and what they are.
_REASONS = {
    "PREFUN": "a G word of one control, which may move anything: let CAM write what it does, or "
    "delete the line if it moves nothing",
    "SWITCH": "the frame of another turret",
    "RESET": "a state of one control",
    "ORIGIN": "a zero that moves: let CAM write all places in one frame",
    "TRANS": "a zero that moves: let CAM write all places in one frame",
    "ROTATE": "a table that turns: let CAM write the tool's axis (GOTO/x,y,z,i,j,k)",
    "MODE": "a way to read what follows",
    "SET": "a way to read what follows",
}
# Words of a control in a line of INSERT that may move something.
_MOVING = re.compile(
    r"(?<![A-Z])[GXYZABCUVW]\s*=?\s*[-+.0-9#(\[R]|\bA?(?:TRANS|ROT|SCALE|MIRROR)\b"
    r"|\b(?:CYCLE[0-9]+|CALL|TRAORI|TRAFOOF|M9[6-9]|M198)\b"
)
# A line for a control is taken literally, as texts are: a trailing $ does not continue it.
_AS_IT_IS = "INSERT"
# Lines of text, and planes that the tool tip is on anyway.
_TEXTS = ("PARTNO", "PPRINT", "TPRINT", "REMARK", "DISPLY", "LETTER", "PSIS")
# Lines that CAM systems add.
_SYSTEM_LINES = ("TOOL PATH", "END-OF-PATH", "CSI_")
# Statements that are events of a cut, not motions of the arm.
_EVENTS = ("SPINDL", "COOLNT", "AUXFUN", "ARCON", "ARCOFF", "STOP", "OPSTOP", "DELAY")
_ENDS = ("FINI", "END")
# Number of fields of an arc of NX, which adds tolerances and the cutter. It turns left-handed about
# its axis; all others turn right-handed.
_NX_ARC_FIELDS = 11
# An arc of CATIA is a circle or cylinder, with numbers in brackets …
_CATIA_ARC = re.compile(r"\(\s*(CIRCLE|CYLNDR)\s*/([^()]*)\)")
# … and the line or point that it ends on.
_CATIA_END = re.compile(r"\(\s*(LINE|POINT)\s*/([^()]*)\)")
# Cycles that drill in steps.
_PECKS = ("DEEP", "DEEP2", "BRKCHP")
# Words for the length of a step.
_STEPS = ("SUBPECK", "STEP", "INCR")
# Words of a cycle with a number after them.
_CYCLE_WORDS = (
    *("FEDTO", "DEPTH", "RAPTO", "CLEAR", "RTRCTO", "DWELL", "MMPM", "IPM", "1STPECK"),
    *_STEPS,
)
# Largest difference of equal axes.
_TURNED = 1e-6
# Largest cosine between the axes of a frame, by the rounding of files.
_SQUARE = 1e-4
_UP = np.array([0.0, 0.0, 1.0])
# Largest number of turns of a helix.
_TURNS = 1000


class _Arc(NamedTuple):
    """The circle to the next position: right-handed about its axis, with additional turns."""

    center: Array
    axis: Array
    more_turns: int


def read_cldata(file: FilePath, unit: str | None = None) -> Mapping[str, PoseRows]:
    """Read the cuts of a file of cutter locations; see `read_path`.

    Lengths are in `unit` where one is given, whatever the file says itself.

    Raises
    ------
    FileFormatError
        The file cannot be read, or has a statement that is not read; its line is named.
    """
    reader = _Reader(file, unit)
    whole = ""
    for number, line in enumerate(lines_of(reader.machine.text()), 1):
        reader.machine.number = number
        is_text = not whole and line.strip().upper().startswith((*_TEXTS, _AS_IT_IS))
        text = (line if is_text else line.partition("$$")[0]).strip()
        if text.endswith("$") and not is_text:
            whole += text[:-1] + " "
            if len(whole) > _LONGEST:
                raise reader.machine.fault(f"goes on for more than {_LONGEST} characters")
            continue
        whole, statement = "", whole + text
        if statement.strip() and reader.take(" ".join(statement.upper().split())):
            break
    return reader.seams()


class _Reader:
    """The modes of a file, and the statements that change them."""

    def __init__(self, file: FilePath, unit: str | None) -> None:
        self.machine = Machine(file)
        self._given_unit = None if unit is None else LENGTH_UNITS[unit]
        self._unit, self._rapid = self._given_unit or _MM, False
        # Units that the file states for lengths and feeds [m]; None if it does not.
        self._stated_unit: float | None = None
        self._stated_feed_unit: float | None = None
        self._feed_is_bare = False
        # The frame of its coordinates: axes in columns, and origin [m].
        self._axes: Array = np.eye(3)
        self._origin: Array = np.zeros(3)
        self._msys: tuple[Array, Array] | None = None
        # The first statement of kinds of which a file may have only one.
        self._first: dict[str, str] = {}
        # Stated before the next position: an arc, the direction at its start, the tool's axis.
        self._arc: _Arc | None = None
        self._start_direction: Array | None = None
        self._axis: Array | None = None
        self._in_world = False
        # Parameters of the active drilling cycle.
        self._cycle: dict[str, float] = {}
        # Position of the tool before the cycle [m].
        self._position_before_cycle: Array = np.full(3, np.nan)

    def seams(self) -> Mapping[str, PoseRows]:
        """Return the cuts by names."""
        if self._given_unit is None and self._stated_unit is None:
            self.machine.notes.append("no statement says UNITS: lengths are taken for mm")
        if self._feed_is_bare:
            self.machine.notes.append(
                "FEDRAT says neither MMPM nor IPM: feeds are per minute, in the unit of lengths"
            )
        return self.machine.seams()

    def take(self, text: str) -> bool:
        """Take a statement; return whether it is the last one."""
        machine = self.machine
        if len(text) > _LONGEST:
            raise machine.fault(f"has {len(text)} characters, expected {_LONGEST} at most")
        if text.startswith((*_TEXTS, *_SYSTEM_LINES)):
            return False
        if text.startswith(_AS_IT_IS):
            self._insert(text.removeprefix(_AS_IT_IS).lstrip(" /"))
            return False
        if text.startswith("TLON"):
            self._catia_arc(text)
            return False
        if "=" in text:
            raise machine.fault(
                f"'{text[:40]}': names and geometry of part programs are not read; give the cutter "
                f"locations that APT makes of them (GOTO/x,y,z)"
            )
        match = _STATEMENT.fullmatch(text)
        if not match:
            raise machine.unread(f"'{text[:60]}'")
        word, rest = match[1], (match[2] or "").strip()
        arguments = [item.strip() for item in rest.split(",")] if rest else []
        if word in _ENDS:
            return True
        if not self._motion_statement(word, rest, arguments):
            self._other_statement(text, word, rest, arguments)
        return False

    def _motion_statement(self, word: str, rest: str, arguments: list[str]) -> bool:
        """Take a statement about the motion of the tool; return whether it is one."""
        match word:
            case "GOHOME" if len(arguments) < 3:
                self._go_home()
            case "GOTO" | "FROM" | "GODLTA" | "GOHOME":
                self._go(word, arguments)
            case "CIRCLE" | "MOVARC":
                self._arc = self._arc_of(word, arguments)
            case "INDIRV":
                self._start_direction = self._axes @ self._numbers(word, arguments, 3)
            case "TLAXIS":
                self._axis = self._direction(self._numbers(word, arguments, 3).tolist())
                self.machine.says_axis = True
            case "RAPID" if not rest:
                self._rapid = True
            case "FEDRAT":
                self._feed(arguments)
            case _:
                return False
        return True

    def _other_statement(self, text: str, word: str, rest: str, arguments: list[str]) -> None:
        """Take any other statement, or refuse it."""
        machine = self.machine
        match word:
            case "UNITS" | "UNIT":
                if len(arguments) != 1 or arguments[0] not in _UNITS:
                    raise machine.fault(f"{word}/{rest[:40]}: expected MM or INCHES")
                self._set_unit(_UNITS[arguments[0]])
            case "MODE" | "SET" if "INCR" in arguments:
                raise machine.fault(
                    f"{word}/{rest[:40]}: places by differences are not read; write MODE/ABSOL"
                )
            case "CUTCOM":
                self._compensate(arguments)
            case "CYCLE":
                self._set_cycle(arguments)
            case "NURBS":
                raise machine.fault(
                    "NURBS: splines are not read; let CAM write lines or arcs (NX: motion output)"
                )
            case "TRNTYP" | "CSYS":
                self._frame(word, arguments)
            case "MSYS":
                self._set_machine_frame(self._numbers(word, arguments, 9))
            case "OFSTNO":
                self._require_unchanged(
                    word, rest, "another zero of the control: write one file for each"
                )
            case "SETUP" if arguments[:1] in (["START"], ["END"]):
                self._require_unchanged(
                    word, ",".join(arguments[1:]), "another way to hold the part: one file each"
                )
            case "LOADTL" | "LOAD":
                if self._first.setdefault("LOADTL", rest) != rest:
                    machine.note_tool(
                        f"{word}/{rest[:40]}: another tool than {self._first['LOADTL'][:40]}"
                    )
            case _ if word in _EVENTS:
                machine.happens(f"{word}/{','.join(arguments)}" if arguments else word)
            case _ if word in _HARMLESS and rest.replace(" ", "") in _HARMLESS[word]:
                pass
            case "OPSKIP":
                machine.note("OPSKIP: what may be skipped is read")
            case _ if word in _REASONS:
                raise machine.fault(f"{text[:40]}: {_REASONS[word]}; it is not read")
            case _ if word not in _IGNORED:
                raise machine.unread(f"statement '{text[:40]}'")

    def _require_unchanged(self, word: str, values: str, what: str) -> None:
        """Refuse a statement whose values differ from the first of its kind."""
        if self._first.setdefault(word, values) != values:
            raise self.machine.fault(
                f"{word}/{values[:40]} after {word}/{self._first[word][:40]}: {what}"
            )

    def _insert(self, text: str) -> None:
        """Take a line that is passed to the control unchanged."""
        if _MOVING.search(text):
            raise self.machine.fault(
                f"INSERT {text[:40]}: words of a control that may move something are not read: let "
                f"CAM write what they do, or delete the line"
            )
        self.machine.note(f"INSERT {text[:40]}: lines for a control are passed over")

    def _position(self, values: Sequence[float]) -> Array:
        """Return a position of the file (3,) in its first frame [m]."""
        position: Array = self._origin + self._axes @ (self._unit * np.array(values))
        return position

    def _direction(self, values: Sequence[float]) -> Array:
        """Return a direction (3,) of the file in its first frame."""
        return self._axes @ unit_axis(values, self.machine)

    def _set_machine_frame(self, values: Array) -> None:
        """Change to a machine coordinate system, ``MSYS/x,y,z``, its x axis and its y axis.

        Coordinates of the first one are those of the file.
        """
        machine = self.machine
        x, y = (unit_axis(values[k : k + 3].tolist(), machine) for k in (3, 6))
        if abs(x @ y) > _SQUARE:
            raise machine.fault(f"MSYS: its x and y axes are {x @ y:.2g} off a right angle")
        y = unit_axis((y - (x @ y) * x).tolist(), machine)
        own = np.stack([x, y, np.cross(x, y)], axis=1), self._unit * values[:3]
        if self._msys is None:
            if machine.moved:
                raise machine.fault(
                    "MSYS after places that are in none: where its frame is to theirs is not known"
                )
            self._msys = own
            return
        axes, origin = self._msys
        before = self._axes
        self._axes, self._origin = axes.T @ own[0], axes.T @ (own[1] - origin)
        # An axis that is not stated again keeps its numbers, in the new frame.
        turn = self._axes @ before.T
        machine.axis = turn @ machine.axis
        if np.abs(self._axes - before).max() > _TURNED or self._origin.any():
            machine.note(
                "MSYS: another machine coordinate system than the first one: places are those of "
                "the first"
            )

    def _set_unit(self, unit: float) -> None:
        """Take the unit of lengths that the file states [m]."""
        self._stated_unit = unit
        self._unit = self._given_unit or unit
        self._check_units()

    def _check_units(self) -> None:
        """Refuse a file whose feeds are in another unit than its lengths, unless that is given."""
        if self._given_unit or self._stated_feed_unit is None:
            return
        if self._stated_feed_unit != (self._stated_unit or _MM):
            feeds = "IPM" if self._stated_feed_unit == _INCH else "MMPM"
            lengths = {None: "no UNITS", _INCH: "UNITS/INCHES", _MM: "UNITS/MM"}[self._stated_unit]
            raise self.machine.fault(
                f"feeds are in {feeds}, and the file has {lengths}: say in which unit its lengths "
                f"are: unit = 'in' or 'mm'"
            )

    def _go(self, word: str, arguments: list[str]) -> None:
        machine = self.machine
        values = [self._number(text) for text in arguments]
        if len(values) not in (3, 6) or (word == "GODLTA" and len(values) != 3):
            raise machine.fault(f"{word} has {len(values)} numbers, expected x,y,z or x,y,z,i,j,k")
        position = self._position(values[:3])
        if word == "GODLTA":
            if np.isnan(machine.position).any():
                raise machine.fault("GODLTA goes on from a place that is not known yet")
            position = position - self._origin + machine.position
        axis = machine.axis if self._axis is None else self._axis
        if len(values) == 6:
            axis, machine.says_axis = self._direction(values[3:]), True
        travels = word in ("FROM", "GOHOME")
        if self._cycle and not travels:
            self._drill_hole(position, axis)
        else:
            self._move_to(position, axis, travels=self._rapid or travels)

    def _set_cycle(self, arguments: list[str]) -> None:
        """Take a drilling cycle: its kind, and its words, each with a number after it."""
        machine, statement = self.machine, f"CYCLE/{','.join(arguments)[:40]}"
        if arguments[:1] in (["OFF"], ["INIT"], ["CLEAR"]):
            self._cycle = {}
            return
        if arguments[:1] != ["ON"]:
            self._cycle = {}
        items = arguments[1:] if arguments[:1] in (["ON"], ["DRILL"]) else list(arguments)
        cycle = dict(self._cycle)
        # The meaning of numbers without a word before them, in order.
        bare = ["FEDTO", "CLEAR"]
        while items:
            word = items.pop(0)
            if word in _PECKS:
                cycle[word[:4]] = 1.0
            elif word == "RTRCTO" and items[:1] == ["AUTO"]:
                # Back to the height before the cycle.
                items.pop(0)
                cycle["AUTO"] = 1.0
                self._position_before_cycle = machine.position.copy()
            elif word in _CYCLE_WORDS and items:
                cycle[word] = self._number(items.pop(0))
            elif _NUMBER.fullmatch(word) and bare:
                cycle[bare.pop(0)] = self._number(word)
            else:
                raise machine.fault(
                    f"{statement}: '{word}' of a cycle is not read, but DRILL, DEEP and BRKCHP "
                    f"are; let CAM write the moves (GOTO, RAPID)"
                )
        if not {"FEDTO", "DEPTH"} & set(cycle) or not {"RAPTO", "CLEAR"} & set(cycle):
            raise machine.fault(
                f"{statement}: expected a depth (FEDTO) and a height (RAPTO or CLEAR)"
            )
        for word in ("MMPM", "IPM"):
            if word in cycle:
                self._feed([str(cycle.pop(word)), word])
        self._cycle = cycle

    def _drill_hole(self, top: Array, axis: Array) -> None:
        """Drill a hole of the cycle, whose top is given."""
        cycle, unit = self._cycle, self._unit
        height = unit * cycle.get("RAPTO", cycle.get("CLEAR", 0.0))
        # NX states depths as negative heights, others as positive depths.
        depth = unit * abs(cycle.get("FEDTO", cycle.get("DEPTH", 0.0)))
        pecks = None
        if "DEEP" in cycle or "BRKC" in cycle:
            others = next((cycle[word] for word in _STEPS if word in cycle), 0.0)
            first = cycle.get("1STPECK", others)
            pecks = Pecks(unit * first, unit * others, retracts_fully="DEEP" in cycle)
        waits = cycle.get("DWELL", 0.0) > 0.0
        # Height between holes: as stated, or that before the cycle.
        level = max(height, unit * cycle.get("RTRCTO", 0.0))
        before = float((self._position_before_cycle - top) @ axis)
        if "AUTO" in cycle and np.isfinite(before):
            level = max(level, before)
        over = top + level * axis
        if level > height:
            self.machine.rapid(over, axis)
        drill(
            self.machine,
            top + height * axis,
            top - depth * axis,
            axis,
            pecks=pecks,
            dwell=f"DELAY/{cycle['DWELL']:g}" if waits else "",
        )
        if level > height:
            self.machine.rapid(over, axis)
        self._arc, self._start_direction, self._axis, self._rapid = None, None, None, False

    def _move_to(self, position: Array, axis: Array, *, travels: bool) -> None:
        """Move to a position, along the arc that was stated before, if there is one."""
        machine, arc = self.machine, self._arc
        self._arc, self._start_direction, self._axis, self._rapid = None, None, None, False
        if travels:
            machine.rapid(position, axis)
        elif arc is None:
            machine.cut(position, axis)
        else:
            if np.abs(axis - machine.axis).max() > _TURNED:
                raise machine.fault("the tool turns along an arc, which is not read; write lines")
            start, more = machine.position, arc.more_turns
            for point in arc_points(machine, start, position, arc.center, arc.axis, more):
                machine.cut(point, machine.axis)

    def _go_home(self) -> None:
        machine = self.machine
        machine.climbs()
        self._move_to(np.full(3, np.nan), machine.axis, travels=True)
        machine.note_home("GOHOME", "the next GOTO")

    def _arc_of(self, word: str, arguments: list[str]) -> _Arc:
        """Return the circle of ``CIRCLE/x,y,z,i,j,k,r`` or ``MOVARC/x,y,z,i,j,k,r,ANGLE,a``."""
        numbers = [item for item in arguments if item not in ("TIMES", "ANGLE")]
        values = [self._number(text) for text in numbers]
        if len(values) < 6:
            raise self.machine.fault(
                f"{word} has {len(values)} numbers, expected x,y,z of its centre, i,j,k of its "
                f"axis and its radius"
            )
        is_left = word == "CIRCLE" and len(values) - ("TIMES" in arguments) >= _NX_ARC_FIELDS
        turns = 1.0
        if "TIMES" in arguments:
            turns = values[-1]
        elif "ANGLE" in arguments:
            turns = values[-1] / 360.0
        if not 0.0 < turns <= _TURNS:
            raise self.machine.fault(f"{word} goes round {turns:g} times, expected up to {_TURNS}")
        axis = self._direction(values[3:6])
        more_turns = int(np.ceil(turns - 1e-6)) - 1
        return _Arc(self._position(values[:3]), -axis if is_left else axis, more_turns)

    def _catia_arc(self, text: str) -> None:
        """Go along an arc as CATIA writes it: ``INDIRV/…`` and ``TLON,GOFWD/ (CIRCLE/ …``."""
        machine, start_direction = self.machine, self._start_direction
        body, ends = _CATIA_ARC.search(text), _CATIA_END.findall(text)
        if body is None or not ends or start_direction is None:
            raise machine.unread(
                f"'{text[:60]}', but for TLON,GOFWD/ (CIRCLE/…),ON,(LINE/…) after INDIRV/…,"
            )
        values = [self._number(item.strip()) for item in body[2].split(",")]
        last = [self._number(item.strip()) for item in ends[-1][1].split(",")]
        if len(values) != (4 if body[1] == "CIRCLE" else 7) or len(last) not in (3, 6):
            raise machine.fault(f"'{text[:60]}': expected a centre, a radius and where it ends")
        center, goal = self._position(values[:3]), self._position(last[-3:])
        axis = self._direction(_UP.tolist() if body[1] == "CIRCLE" else values[3:6])
        # Positive where the arc is right-handed about the axis.
        forward = float(np.cross(machine.position - center, start_direction) @ axis)
        self._arc = _Arc(center, -axis if forward < 0.0 else axis, 0)
        tool = machine.axis if self._axis is None else self._axis
        self._move_to(goal, tool, travels=self._rapid)

    def _compensate(self, arguments: list[str]) -> None:
        if arguments[:1] != ["OFF"]:
            self.machine.note(
                f"CUTCOM/{','.join(arguments)}: places are taken as they are written, those of the "
                f"tool's centre: no radius is added"
            )

    def _frame(self, word: str, arguments: list[str]) -> None:
        """Take the frame of coordinates: only one frame is read."""
        if word == "TRNTYP":
            self._in_world = arguments[:1] == ["WORLD"]
        is_same = self._in_world
        if word == "CSYS" and not is_same:
            is_same = np.abs(self._numbers(word, arguments, 12) - np.eye(3, 4).ravel()).max() < 1e-9
        if not is_same:
            raise self.machine.fault(
                f"{word}/{','.join(arguments)[:40]}: frames that are turned or moved are not read; "
                f"let CAM write all places in one frame (TRNTYP/WORLD)"
            )

    def _numbers(self, word: str, arguments: list[str], count: int) -> Array:
        if len(arguments) != count:
            raise self.machine.fault(f"{word} has {len(arguments)} numbers, expected {count}")
        return np.array([self._number(text) for text in arguments])

    def _feed(self, arguments: list[str]) -> None:
        units = [item for item in arguments if item in _FEEDS]
        numbers = [item for item in arguments if item not in _FEEDS]
        if len(numbers) != 1 or len(units) > 1:
            raise self.machine.fault(
                f"FEDRAT/{','.join(arguments)[:40]}: expected a feed, and MMPM or IPM"
            )
        scale = _FEEDS[units[0]] if units else None
        if scale is not None:
            self._stated_feed_unit = scale
            self._check_units()
        elif self._stated_feed_unit is None:
            self._feed_is_bare = True
        feed = self._number(numbers[0]) * (scale or self._unit) / 60.0
        if not 0.0 < feed < 1e3:
            raise self.machine.fault(f"FEDRAT/{numbers[0]}: expected a feed above 0")
        self.machine.feed = feed

    def _number(self, text: str) -> float:
        if not _NUMBER.fullmatch(text) or len(text) > 40:
            raise self.machine.fault(f"'{text[:40]}' is no number")
        return float(text)
