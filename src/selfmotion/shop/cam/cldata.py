"""Cutter location data as APT writes it, ISO 4343: the statements that say where a tool goes."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, lines_of
from selfmotion.shop.cam.cuts import Machine, Pecks, arc_points, drill, unit_axis
from selfmotion.shop.cam.path_rows import LENGTH_UNITS, PoseRows

# Inch [m].
_INCH = 25.4e-3
# Millimetre [m].
_MM = 1e-3
_STATEMENT = re.compile(r"([A-Z][A-Z0-9]{0,7})\s*(?:/(.*))?")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:E[+-]?[0-9]{1,2})?")
# Longest statement [characters].
_LONGEST = 10_000
_UNITS = {"MM": _MM, "INCH": _INCH, "INCHES": _INCH}
# Feeds by the minute: all others are by turn or time.
_FEEDS = {"MMPM": _MM, "IPM": _INCH, "PERMIN": None}
# Words that move nothing: names, the cutter's shape, tolerances of what is done already.
_NOTHING = (
    *("MACHIN", "CUTTER", "INTOL", "OUTTOL", "TOLER", "TLDATA", "SELECTL", "TOOLNO", "MULTAX"),
    *("PAINT", "SEQNO", "SELECT", "AUTOPS", "CLPRNT", "NOPOST", "REWIND"),
)
# Statements of which some move nothing, and these.
_HARMLESS = {"MODE": ("ABSOL", "MILL"), "SET": ("MODE,ABSOL", "MODE,MILL"), "OPSKIP": ("OFF",)}
# Statements that may move a place or a frame, and what they are.
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
# A line for a control; like texts it has all that stands in it: no sign goes on in the next line.
_AS_IT_IS = "INSERT"
# Lines of texts, planes that the tip is on anyway, and what systems write of their own.
_TEXTS = ("PARTNO", "PPRINT", "TPRINT", "REMARK", "DISPLY", "LETTER", "PSIS")
_OWN = ("TOOL PATH", "END-OF-PATH", "CSI_")
# Words that are the events of a cut: they concern other things than the arm.
_EVENTS = ("SPINDL", "COOLNT", "AUXFUN", "ARCON", "ARCOFF", "STOP", "OPSTOP", "DELAY")
_ENDS = ("FINI", "END")
# An arc of NX says tolerances and its cutter as well, and turns left-handed about its axis; all
# others turn right-handed.
_OF_NX = 11
# An arc that CATIA writes as a cylinder and what it ends on: numbers in brackets behind these.
_ROUND = re.compile(r"\(\s*(CIRCLE|CYLNDR)\s*/([^()]*)\)")
_LAST = re.compile(r"\(\s*(LINE|POINT)\s*/([^()]*)\)")
# Cycles whose holes are drilled in steps, words for these, and those with a number behind them.
_PECKS = ("DEEP", "DEEP2", "BRKCHP")
_STEPS = ("SUBPECK", "STEP", "INCR")
_OF_HOLES = (
    *("FEDTO", "DEPTH", "RAPTO", "CLEAR", "RTRCTO", "DWELL", "MMPM", "IPM", "1STPECK"),
    *_STEPS,
)
# Difference of axes that are the same.
_TURNED = 1e-6
# Cosine of the angle between axes of a frame that counts as none: rounding of files.
_SQUARE = 1e-4
_UP = np.array([0.0, 0.0, 1.0])
# Largest number of turns of a helix.
_TURNS = 1000


class _Arc(NamedTuple):
    """The circle that the next place is on: right-handed about its axis, with turns besides."""

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
        self._given = None if unit is None else LENGTH_UNITS[unit]
        self._unit, self._rapid = self._given or _MM, False
        # The word of the file that says its unit, and the one of its feeds.
        self._unit_said: float | None = None
        self._feed_said: float | None = None
        self._feed_is_bare = False
        # Where its coordinates are: the axes of the frame in columns, and its origin.
        self._axes: Array = np.eye(3)
        self._origin: Array = np.zeros(3)
        self._msys: tuple[Array, Array] | None = None
        # What the first statement of a kind said that a file has one of.
        self._first: dict[str, str] = {}
        # Stated for the next places beforehand: an arc, a direction, the tool's axis.
        self._arc: _Arc | None = None
        self._ahead: Array | None = None
        self._axis: Array | None = None
        self._in_world = False
        # The words of a cycle while there is one.
        self._cycle: dict[str, float] = {}
        # Where the tool was before it.
        self._level: Array = np.full(3, np.nan)

    def seams(self) -> Mapping[str, PoseRows]:
        """Return the cuts by names."""
        if self._given is None and self._unit_said is None:
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
        if text.startswith((*_TEXTS, *_OWN)):
            return False
        if text.startswith(_AS_IT_IS):
            self._insert(text.removeprefix(_AS_IT_IS).lstrip(" /"))
            return False
        if text.startswith("TLON"):
            self._go_round(text)
            return False
        if "=" in text:
            raise machine.fault(
                f"'{text[:40]}': names and geometry of part programs are not read; give the cutter "
                f"locations that APT makes of them (GOTO/x,y,z)"
            )
        found = _STATEMENT.fullmatch(text)
        if not found:
            raise machine.unread(f"'{text[:60]}'")
        word, rest = found[1], (found[2] or "").strip()
        given = [item.strip() for item in rest.split(",")] if rest else []
        if word in _ENDS:
            return True
        if not self._goes(word, rest, given):
            self._says(text, word, rest, given)
        return False

    def _goes(self, word: str, rest: str, given: list[str]) -> bool:
        """Take a statement of where or how the tool goes; return whether it is one."""
        match word:
            case "GOHOME" if len(given) < 3:
                self._go_home()
            case "GOTO" | "FROM" | "GODLTA" | "GOHOME":
                self._go(word, given)
            case "CIRCLE" | "MOVARC":
                self._arc = self._arc_of(word, given)
            case "INDIRV":
                self._ahead = self._axes @ self._numbers(word, given, 3)
            case "TLAXIS":
                self._axis = self._direction(self._numbers(word, given, 3).tolist())
                self.machine.says_axis = True
            case "RAPID" if not rest:
                self._rapid = True
            case "FEDRAT":
                self._feed(given)
            case _:
                return False
        return True

    def _says(self, text: str, word: str, rest: str, given: list[str]) -> None:
        """Take any other statement, or refuse it."""
        machine = self.machine
        match word:
            case "UNITS" | "UNIT":
                if len(given) != 1 or given[0] not in _UNITS:
                    raise machine.fault(f"{word}/{rest[:40]}: expected MM or INCHES")
                self._says_unit(_UNITS[given[0]])
            case "MODE" | "SET" if "INCR" in given:
                raise machine.fault(
                    f"{word}/{rest[:40]}: places by differences are not read; write MODE/ABSOL"
                )
            case "CUTCOM":
                self._compensate(given)
            case "CYCLE":
                self._drills(given)
            case "NURBS":
                raise machine.fault(
                    "NURBS: splines are not read; let CAM write lines or arcs (NX: motion output)"
                )
            case "TRNTYP" | "CSYS":
                self._frame(word, given)
            case "MSYS":
                self._turn_to(self._numbers(word, given, 9))
            case "OFSTNO":
                self._only(word, rest, "another zero of the control: write one file for each")
            case "SETUP" if given[:1] in (["START"], ["END"]):
                self._only(word, ",".join(given[1:]), "another way to hold the part: one file each")
            case "LOADTL" | "LOAD":
                if self._first.setdefault("LOADTL", rest) != rest:
                    machine.note_tool(
                        f"{word}/{rest[:40]}: another tool than {self._first['LOADTL'][:40]}"
                    )
            case _ if word in _EVENTS:
                machine.happens(f"{word}/{','.join(given)}" if given else word)
            case _ if word in _HARMLESS and rest.replace(" ", "") in _HARMLESS[word]:
                pass
            case "OPSKIP":
                machine.note("OPSKIP: what may be skipped is read")
            case _ if word in _REASONS:
                raise machine.fault(f"{text[:40]}: {_REASONS[word]}; it is not read")
            case _ if word not in _NOTHING:
                raise machine.unread(f"statement '{text[:40]}'")

    def _only(self, word: str, said: str, what: str) -> None:
        """Refuse a statement that says something else than the first of its kind did."""
        if self._first.setdefault(word, said) != said:
            raise self.machine.fault(
                f"{word}/{said[:40]} after {word}/{self._first[word][:40]}: {what}"
            )

    def _insert(self, text: str) -> None:
        """Take a line that goes to the control as it is."""
        if _MOVING.search(text):
            raise self.machine.fault(
                f"INSERT {text[:40]}: words of a control that may move something are not read: let "
                f"CAM write what they do, or delete the line"
            )
        self.machine.note(f"INSERT {text[:40]}: lines for a control are passed over")

    def _position(self, values: Sequence[float]) -> Array:
        """Return a place (3,) [m] of the file in its first frame."""
        found: Array = self._origin + self._axes @ (self._unit * np.array(values))
        return found

    def _direction(self, values: Sequence[float]) -> Array:
        """Return a direction (3,) of the file in its first frame."""
        return self._axes @ unit_axis(values, self.machine)

    def _turn_to(self, values: Array) -> None:
        """Go over to a machine coordinate system, ``MSYS/x,y,z``, its x axis and its y axis.

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
        # The words of an axis that is not said again are those of the new frame.
        turn = self._axes @ before.T
        machine.axis = turn @ machine.axis
        if np.abs(self._axes - before).max() > _TURNED or self._origin.any():
            machine.note(
                "MSYS: another machine coordinate system than the first one: places are those of "
                "the first"
            )

    def _says_unit(self, unit: float) -> None:
        """Take the word for the unit of lengths."""
        self._unit_said = unit
        self._unit = self._given or unit
        self._agrees()

    def _agrees(self) -> None:
        """Refuse a file whose feeds are in another unit than its lengths, unless that is given."""
        if self._given or self._feed_said is None:
            return
        if self._feed_said != (self._unit_said or _MM):
            feeds = "IPM" if self._feed_said == _INCH else "MMPM"
            lengths = {None: "no UNITS", _INCH: "UNITS/INCHES", _MM: "UNITS/MM"}[self._unit_said]
            raise self.machine.fault(
                f"feeds are in {feeds}, and the file has {lengths}: say in which unit its lengths "
                f"are: unit = 'in' or 'mm' (--unit)"
            )

    def _go(self, word: str, given: list[str]) -> None:
        machine = self.machine
        values = [self._number(text) for text in given]
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
            self._drill(position, axis)
        else:
            self._to(position, axis, travels=self._rapid or travels)

    def _drills(self, given: list[str]) -> None:
        """Take a cycle: what it is, and its words, each with a number behind it."""
        machine, said = self.machine, f"CYCLE/{','.join(given)[:40]}"
        if given[:1] in (["OFF"], ["INIT"], ["CLEAR"]):
            self._cycle = {}
            return
        if given[:1] != ["ON"]:
            self._cycle = {}
        items = given[1:] if given[:1] in (["ON"], ["DRILL"]) else list(given)
        found = dict(self._cycle)
        # What numbers with no word before them say.
        bare = ["FEDTO", "CLEAR"]
        while items:
            word = items.pop(0)
            if word in _PECKS:
                found[word[:4]] = 1.0
            elif word == "RTRCTO" and items[:1] == ["AUTO"]:
                # Back to where it was before the cycle.
                items.pop(0)
                found["AUTO"] = 1.0
                self._level = machine.position.copy()
            elif word in _OF_HOLES and items:
                found[word] = self._number(items.pop(0))
            elif _NUMBER.fullmatch(word) and bare:
                found[bare.pop(0)] = self._number(word)
            else:
                raise machine.fault(
                    f"{said}: '{word}' of a cycle is not read, but DRILL, DEEP and BRKCHP are; let "
                    f"CAM write the moves (GOTO, RAPID)"
                )
        if not {"FEDTO", "DEPTH"} & set(found) or not {"RAPTO", "CLEAR"} & set(found):
            raise machine.fault(f"{said}: expected a depth (FEDTO) and a height (RAPTO or CLEAR)")
        for word in ("MMPM", "IPM"):
            if word in found:
                self._feed([str(found.pop(word)), word])
        self._cycle = found

    def _drill(self, top: Array, axis: Array) -> None:
        """Drill a hole of the cycle, whose top is given."""
        cycle, unit = self._cycle, self._unit
        height = unit * cycle.get("RAPTO", cycle.get("CLEAR", 0.0))
        # NX says depths by what is below 0, others by how deep.
        depth = unit * abs(cycle.get("FEDTO", cycle.get("DEPTH", 0.0)))
        pecks = None
        if "DEEP" in cycle or "BRKC" in cycle:
            others = next((cycle[word] for word in _STEPS if word in cycle), 0.0)
            first = cycle.get("1STPECK", others)
            pecks = Pecks(unit * first, unit * others, is_out="DEEP" in cycle)
        waits = cycle.get("DWELL", 0.0) > 0.0
        # Between holes it is as high as it says, or as it was before them.
        level = max(height, unit * cycle.get("RTRCTO", 0.0))
        before = float((self._level - top) @ axis)
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
        self._arc, self._ahead, self._axis, self._rapid = None, None, None, False

    def _to(self, position: Array, axis: Array, *, travels: bool) -> None:
        """Go somewhere, along the arc that was stated before, if there is one."""
        machine, arc = self.machine, self._arc
        self._arc, self._ahead, self._axis, self._rapid = None, None, None, False
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
        self._to(np.full(3, np.nan), machine.axis, travels=True)
        machine.note_home("GOHOME", "the next GOTO")

    def _arc_of(self, word: str, given: list[str]) -> _Arc:
        """Return the circle of ``CIRCLE/x,y,z,i,j,k,r`` or ``MOVARC/x,y,z,i,j,k,r,ANGLE,a``."""
        numbers = [item for item in given if item not in ("TIMES", "ANGLE")]
        values = [self._number(text) for text in numbers]
        if len(values) < 6:
            raise self.machine.fault(
                f"{word} has {len(values)} numbers, expected x,y,z of its centre, i,j,k of its "
                f"axis and its radius"
            )
        is_left = word == "CIRCLE" and len(values) - ("TIMES" in given) >= _OF_NX
        turns = values[-1] if "TIMES" in given else values[-1] / 360.0 if "ANGLE" in given else 1.0
        if not 0.0 < turns <= _TURNS:
            raise self.machine.fault(f"{word} goes round {turns:g} times, expected up to {_TURNS}")
        axis = self._direction(values[3:6])
        more_turns = int(np.ceil(turns - 1e-6)) - 1
        return _Arc(self._position(values[:3]), -axis if is_left else axis, more_turns)

    def _go_round(self, text: str) -> None:
        """Go along an arc as CATIA writes it: ``INDIRV/…`` and ``TLON,GOFWD/ (CIRCLE/ …``."""
        machine, ahead = self.machine, self._ahead
        body, ends = _ROUND.search(text), _LAST.findall(text)
        if body is None or not ends or ahead is None:
            raise machine.unread(
                f"'{text[:60]}', but for TLON,GOFWD/ (CIRCLE/…),ON,(LINE/…) after INDIRV/…,"
            )
        values = [self._number(item.strip()) for item in body[2].split(",")]
        last = [self._number(item.strip()) for item in ends[-1][1].split(",")]
        if len(values) != (4 if body[1] == "CIRCLE" else 7) or len(last) not in (3, 6):
            raise machine.fault(f"'{text[:60]}': expected a centre, a radius and where it ends")
        center, goal = self._position(values[:3]), self._position(last[-3:])
        axis = self._direction(_UP.tolist() if body[1] == "CIRCLE" else values[3:6])
        # The side that it begins to.
        forward = float(np.cross(machine.position - center, ahead) @ axis)
        self._arc = _Arc(center, -axis if forward < 0.0 else axis, 0)
        tool = machine.axis if self._axis is None else self._axis
        self._to(goal, tool, travels=self._rapid)

    def _compensate(self, given: list[str]) -> None:
        if given[:1] not in (["OFF"], ["ON"]):
            self.machine.note(
                f"CUTCOM/{','.join(given)}: places are taken as they are written, those of the "
                f"tool's centre: no radius is added"
            )

    def _frame(self, word: str, given: list[str]) -> None:
        """Take where coordinates are: those of one frame only are read."""
        if word == "TRNTYP":
            self._in_world = given[:1] == ["WORLD"]
        is_same = self._in_world
        if word == "CSYS" and not is_same:
            is_same = np.abs(self._numbers(word, given, 12) - np.eye(3, 4).ravel()).max() < 1e-9
        if not is_same:
            raise self.machine.fault(
                f"{word}/{','.join(given)[:40]}: frames that are turned or moved are not read; let "
                f"CAM write all places in one frame (TRNTYP/WORLD)"
            )

    def _numbers(self, word: str, given: list[str], count: int) -> Array:
        if len(given) != count:
            raise self.machine.fault(f"{word} has {len(given)} numbers, expected {count}")
        return np.array([self._number(text) for text in given])

    def _feed(self, given: list[str]) -> None:
        units = [item for item in given if item in _FEEDS]
        numbers = [item for item in given if item not in _FEEDS]
        if len(numbers) != 1 or len(units) > 1:
            raise self.machine.fault(
                f"FEDRAT/{','.join(given)[:40]}: expected a feed, and MMPM or IPM"
            )
        scale = _FEEDS[units[0]] if units else None
        if scale is not None:
            self._feed_said = scale
            self._agrees()
        elif self._feed_said is None:
            self._feed_is_bare = True
        feed = self._number(numbers[0]) * (scale or self._unit) / 60.0
        if not 0.0 < feed < 1e3:
            raise self.machine.fault(f"FEDRAT/{numbers[0]}: expected a feed above 0")
        self.machine.feed = feed

    def _number(self, text: str) -> float:
        if not _NUMBER.fullmatch(text) or len(text) > 40:
            raise self.machine.fault(f"'{text[:40]}' is no number")
        return float(text)
