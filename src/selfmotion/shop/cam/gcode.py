"""G-code of machines with up to five axes, and of printers: what says where a tool goes (ISO 6983).

The names are Fanuc's, and Marlin's where material is extruded (E). The tool's tip is meant.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, lines_of
from selfmotion.shop.cam.arcs import arc_points, center_by_radius
from selfmotion.shop.cam.cuts import PRIME, RETRACT, STOPS, Machine, unit_axis
from selfmotion.shop.cam.drilling import Pecks, drill
from selfmotion.shop.cam.gcode_words import (
    bare_line,
    extrudes,
    lifts,
    says_axis,
    values_of,
    words_of,
)
from selfmotion.shop.cam.pose_rows import PoseRows, Reading
from selfmotion.shop.cam.rotary import HEAD, Rotary

# Inch [m].
_INCH = 25.4e-3
# Millimetre [m].
_MM = 1e-3
# Distance of places that are the same [m].
_SAME_AXIS = 1e-9
# Largest number of turns of a helix.
_MAX_TURNS = 1000
# Words that change nothing here: cutter compensation off, tool length (programs say where the tip
# is), no polar words, mirror or turn, how corners are smoothed.
_IGNORED = {"G40", "G43", "G69", "G64", "G61", "G61.1", "G5.1", "G8", "G9"}
_IGNORED |= {"G15", "G50.1", "G67"}
# Words that are not read → the reason, with what to do.
_REFUSED = {
    **dict.fromkeys(("G41", "G42"), "the cutter's radius is not added: let CAM do so"),
    "G95": "feeds by turns of a spindle are not read: let CAM write them by the minute (G94)",
    "G96": "speeds of a lathe are not read",
    "G16": "polar words are not read: let CAM write X, Y and Z",
    "G68": "turned frames are not read: let CAM write places in one frame",
    "G68.2": "turned frames are not read: let CAM write places in one frame, after G43.4",
    **dict.fromkeys(
        ("M206", "M290", "M428", "SET_GCODE_OFFSET", "RESTORE_GCODE_STATE"),
        "zeros that a printer moves, and modes that it goes back to, are not read: let the slicer "
        "write places in one frame, or delete the line if it moves nothing",
    ),
}
# A wait, a retraction of its own, a look at a bed.
_NON_MOTION = {"G4", "G10", "G11", "G29"}
# Words that have P and Q, besides cycles, arcs and M words: how corners are smoothed.
_WITH_P = {"G61", "G61.1", "G64", "G5.1", "G8"}
# Calls of other programs.
_SUBPROGRAM_CALLS = {"M96", "M97", "M98", "M99", "M198"}
# Zeros of workpieces; a program has one.
_WORK_OFFSETS = {"G54", "G55", "G56", "G57", "G58", "G59"}
_TIP_CONTROL = {"G43.4", "G43.5"}
# The axes of arcs' planes and their normal, right-handed; what goes to a place of the machine.
_PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
# Cycles: those that drill along Z, and those that need a spindle that is synchronous or stops.
_DRILLS = {"G73", "G81", "G82", "G83", "G85", "G89"}
_CYCLES = {"G74", "G76", "G84", "G86", "G87", "G88"}
_MACHINE_POSITIONS = {"G28", "G30", "G53"}
# Words of printers that are read; all others are commands of its own.
_MOTION_WORD = re.compile(r"[GTXYZEF]\s*[0-9+.-]")
_LINE_NUMBER = re.compile(r"N\s*[0-9]+\s*")
_MOTIONS = {"G0": 0, "G1": 1, "G2": 2, "G3": 3}
_ENDS = {"M2", "M30"}
# Of each group a line says one: controls refuse two (Grbl's error 21, LinuxCNC), and which one
# holds is not known. Of what drills and what moves the last one holds (Fanuc).
_GROUPS: tuple[Collection[str], ...] = (
    _MOTIONS,
    _DRILLS,
    _PLANES,
    _WORK_OFFSETS,
    ("G20", "G21"),
    ("G90", "G91"),
    ("G90.1", "G91.1"),
    ("G93", "G94"),
    ("G98", "G99"),
    ("M82", "M83"),
)
_AXES = "XYZABC"
# Modes that no line may say: the words that would, what has to be in the program for the mode to
# count, and what is taken.
_DEFAULTS = (
    (("G20", "G21"), "", "lengths are taken for mm"),
    (("G90", "G91"), "", "places are taken for absolute ones"),
    (("G93", "G94"), "feed", "F is taken for a length by the minute"),
    (("G17", "G18", "G19"), "arc", "arcs are taken to lie in the plane of X and Y"),
    (("G98", "G99"), "hole", "holes are left as high as where they were come to"),
    (("M82", "M83"), "material", "E is taken to count from the start"),
)


def read_gcode(file: FilePath, reading: Reading | None = None) -> Mapping[str, PoseRows]:
    """Read the cuts of a program; see `read_path`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or has a word that is not read; its line is named.
    """
    machine = Machine(file)
    text = machine.text()
    rotary = None if reading is None else reading.rotary
    reader = _Reader(machine, rotary, *extrudes(text))
    if not lifts(text):
        reader.stay_flat()
    for number, line in enumerate(lines_of(text), 1):
        reader.machine.number = number
        if reader.read_line(line):
            break
    return reader.seams()


class _Reader:
    """The modes of a machine, and the lines that change them."""

    def __init__(
        self, machine: Machine, rotary: Rotary | None, prints: bool, on_its_way: bool
    ) -> None:
        self.machine, self._rotary, self._prints = machine, rotary, prints
        # Where it does not, E tells no cut from a travel.
        self._extrudes = on_its_way
        self._unit, self._absolute, self._motion = _MM, True, 0
        self._begun = False
        self._turns: dict[str, float] = {}
        # Where the machine is, the part's place if no table has turned it.
        self._at: Array = np.full(3, np.nan)
        self._plane, self._zero, self._tip = _PLANES["G17"], "", False
        self._inverse_time = self._centers_absolute = False
        # The cycle, its words so far, where Z was before it, and whether it returns there.
        self._cycle, self._level, self._returns = "", np.nan, True
        self._hole: dict[str, float] = {}
        # How far material is fed, and whether words say so from the start.
        self._fed, self._fed_from_start = 0.0, True
        # What S said on the line of a cut; the first tool.
        self._power: float | None = None
        self._tool: float | None = None
        # The words G and M of all lines, and what the program has of that a mode counts for.
        self._said: set[str] = set()
        self._has: set[str] = {""}

    def seams(self) -> Mapping[str, PoseRows]:
        """Return the cuts by names."""
        unsaid = [
            f"{', '.join(words[:-1])} or {words[-1]}: {taken}"
            for words, of, taken in _DEFAULTS
            if of in self._has and self._said.isdisjoint(words)
        ]
        if unsaid:
            self.machine.notes.append(f"no line says {'; '.join(unsaid)}")
        return self.machine.seams()

    def stay_flat(self) -> None:
        """Stay at Z 0, as lasers and plotters do, whose programs say no Z."""
        self._at[2] = 0.0
        self.machine.notes.append("no line says Z: it is taken for 0")

    def read_line(self, line: str) -> bool:
        """Take a line; return whether the program ends with it."""
        machine = self.machine
        text = bare_line(line, machine)
        if self._prints and text:
            bare = _LINE_NUMBER.sub("", text, count=1) if text.startswith("N") else text
            if not _MOTION_WORD.match(bare):
                self._command(bare)
                return False
        if text == "%":
            # The second one ends the tape.
            self._begun, ended = True, self._begun
            return ended
        if not text:
            return False
        words = words_of(text, machine)
        codes = [f"{letter}{float(value):g}" for letter, value in words if letter in "GM"]
        self._said.update(codes)
        for group in _GROUPS:
            said = [code for code in codes if code in group]
            if len(said) > 1:
                raise machine.fault(f"{said[0]} and {said[1]} are in one line")
        if not _NON_MOTION.isdisjoint(codes):
            self._read_non_motion(words, codes)
            return not _ENDS.isdisjoint(codes)
        values = values_of(words, machine)
        modes = ("M82", "M83")
        switched = [code for code in codes if code.startswith("M") and code not in modes]
        for code in codes:
            if code not in switched:
                self._mode(code)
        if says_axis(line) and self._motion > 1 and not self._cycle:
            raise machine.fault("the tool turns along an arc (A3, B3, C3), which is not read")
        if "R" in values and self._motion < 2 and not self._cycle:
            raise machine.fault("R is read of arcs only (G2, G3)")
        if "T" in values:
            self._select(values["T"])
        idle = [name for name in "PQ" if name in values and not self._has_p(name, codes)]
        if idle:
            raise machine.unread(f"word '{idle[0]}{values[idle[0]]:g}' of this line")
        # What starts does so before the motion of its line, what stops after it; where a rapid
        # leaves the cut before, what starts belongs to the next one.
        late = [code for code in switched if code in STOPS]
        if self._is_rapid:
            machine.hold()
        for code in switched:
            if code not in late:
                self._mode(code)
        home = next((code for code in codes if code in _MACHINE_POSITIONS), None)
        if home is not None:
            self._move_to_machine_position(home, values)
        elif "G92" in codes:
            self._set_position(values)
        elif self._cycle:
            self._drill(values)
        else:
            self._move(values)
        machine.release()
        for code in late:
            self._mode(code)
        return not _ENDS.isdisjoint(codes)

    def _select(self, tool: float) -> None:
        """Take the number of a tool; a printer changes its nozzle, other machines wait for M6."""
        if self._prints:
            self.machine.happens(f"T{tool:g}")
        elif self._tool not in (None, tool):
            self.machine.note_tool(f"T{tool:g} after T{self._tool:g}: another tool")
        self._tool = tool

    def _has_p(self, name: str, codes: Sequence[str]) -> bool:
        """Return whether a word P or Q means something in a line with these codes."""
        is_arc = name == "P" and self._motion > 1
        listens = any(code in _WITH_P or code.startswith("M") for code in codes)
        return bool(self._cycle) or is_arc or listens

    def _read_non_motion(self, words: Sequence[tuple[str, str]], codes: Sequence[str]) -> None:
        """Take a line in which nothing moves; its modes hold from then on."""
        machine = self.machine
        name, *others = [code for code in codes if code in _NON_MOTION]
        said = [(letter, value) for letter, value in words if letter not in "GMN"]
        letters = {letter for letter, _ in said}
        if others:
            raise machine.fault(f"{name} and {others[0]} are in one line")
        goes = any(
            code in _MOTIONS or code in _MACHINE_POSITIONS or code == "G92" for code in codes
        )
        if name == "G4":
            moved = letters - set("PXUSF") if len(letters) < 2 else letters - set("P")
            if moved or goes:
                raise machine.fault(
                    "G4 waits, and its line says a motion, or two times: write both into lines of "
                    "their own"
                )
        elif goes or not letters.isdisjoint(self._of_zeros(name)):
            raise machine.fault(
                f"{name}: zeros and offsets that a program sets, and ways home, are not read: let "
                f"CAM write places in one frame"
            )
        switched = [code for code in codes if code.startswith("M")]
        for code in codes:
            if code != name and code not in STOPS:
                self._mode(code)
        machine.happens(" ".join([name, *(f"{letter}{value}" for letter, value in said)]))
        for code in switched:
            if code in STOPS:
                self._mode(code)

    def _of_zeros(self, name: str) -> str:
        """Return the letters with which a line that stands moves a zero all the same."""
        if not self._prints:
            return _AXES + "IJKLR"
        # A printer looks at its bed between X and Y; R is a temperature of a nozzle.
        return "L" if name == "G29" else _AXES + "IJKL"

    def _mode(self, code: str) -> None:
        match code:
            case "G20" | "G21":
                self._unit = _INCH if code == "G20" else _MM
            case "G90" | "G91":
                self._absolute = code == "G90"
            case "G93" | "G94":
                if self._inverse_time != (code == "G93"):
                    # What F said is a number of the other kind.
                    self.machine.feed = 0.0
                self._inverse_time = code == "G93"
            case "G49":
                self._tip = False
            case "G90.1" | "G91.1":
                self._centers_absolute = code == "G90.1"
            case _ if code in _REFUSED:
                raise self.machine.fault(f"{code}: {_REFUSED[code]}")
            case _ if code in _PLANES:
                self._plane = _PLANES[code]
            case _ if code in _MOTIONS:
                self._motion, self._cycle = _MOTIONS[code], ""
            case _ if code in _DRILLS:
                if not self._cycle:
                    self._hole, self._level = {}, float(self._at[2])
                self._cycle = code
            case "G98" | "G99":
                self._returns = code == "G98"
            case "G80":
                self._cycle = ""
            case _ if code in _TIP_CONTROL:
                self._tip = True
            case _ if code in _WORK_OFFSETS:
                self._zero = self._zero or code
                if code != self._zero:
                    raise self.machine.fault(
                        f"{code} after {self._zero}: where their zeros are to each other is not "
                        f"known; write one program for each"
                    )
            case _ if (
                code in _IGNORED or code in _ENDS or code in _MACHINE_POSITIONS or code == "G92"
            ):
                pass
            case "M82" | "M83" if self._prints:
                self._fed_from_start = code == "M82"
            case _ if code in _CYCLES:
                raise self.machine.fault(
                    f"{code}: cycles that tap or bore are not read, those that drill are "
                    f"({', '.join(sorted(_DRILLS))}); let CAM write their moves (G0, G1)"
                )
            case _ if code in _SUBPROGRAM_CALLS:
                raise self.machine.fault(f"{code}: subprograms are not read; write them out")
            case _ if code.startswith("M"):
                self.machine.happens(code)
            case _:
                raise self.machine.unread(f"{code}")

    def _command(self, text: str) -> None:
        """Take a line of a printer that moves nothing: it happens where the tool is."""
        code = (text.split() or [""])[0]
        if code in _REFUSED:
            raise self.machine.fault(f"{code}: {_REFUSED[code]}")
        if code in ("M82", "M83"):
            self._said.add(code)
            self._fed_from_start = code == "M82"
        elif code not in ("", "%"):
            self.machine.happens(code)

    def _move_to_machine_position(self, code: str, values: Mapping[str, float]) -> None:
        """Go to a place that is the machine's own: where that is in the part is not known."""
        machine = self.machine
        turned = [name for name in "ABC" if name in values]
        if turned:
            raise machine.fault(
                f"{code} {turned[0]}: an axis of rotation at a place of the machine's own: how the "
                f"tool stands then is not known; write its angle without {code}"
            )
        axes = [k for k, name in enumerate("XYZ") if name in values] or [0, 1, 2]
        if code != "G53":
            # By the place that its line says.
            goal = self._at.copy()
            for k in axes:
                if "XYZ"[k] in values:
                    before = 0.0 if self._absolute else goal[k]
                    goal[k] = self._unit * values["XYZ"[k]] + before
            machine.rapid(self._part(goal), machine.axis)
            self._at = goal
        if 2 in axes:
            machine.climbs()
        for k in axes:
            self._at[k] = np.nan
        machine.rapid(self._part(self._at), machine.axis)
        machine.note_home(code, "X, Y and Z are given")

    def _set_position(self, values: Mapping[str, float]) -> None:
        """Say how far material is fed by now, or, before anything has moved, where the tool is."""
        moved = [name for name in _AXES if name in values]
        is_first = not self.machine.cuts and np.isnan(self._at).all() and "E" not in values
        if is_first and set(moved) == set("XYZ"):
            self._at = self._unit * np.array([values[name] for name in "XYZ"])
            self.machine.rapid(self._at.copy(), self.machine.axis)
            return
        if moved or "E" not in values:
            raise self.machine.fault(
                f"G92 {' '.join(moved)}: zeros that move are not read, but of E, or of X, Y and Z "
                f"before the first motion"
            )
        self._fed = values["E"]

    def _extruded(self, values: Mapping[str, float]) -> float:
        """Return how much material a line feeds: by differences after M83, and after G91, too."""
        if "E" not in values:
            return 0.0
        self._has.add("material")
        # So do Marlin and Klipper; G90 leaves what M82 and M83 said (Klipper).
        if self._fed_from_start and self._absolute:
            fed, self._fed = values["E"] - self._fed, values["E"]
        else:
            fed = values["E"]
            self._fed += fed
        return fed

    @property
    def _is_rapid(self) -> bool:
        return self._motion == 0 and not self._cycle

    def _drill(self, values: Mapping[str, float]) -> None:
        """Drill a hole of the cycle, where X or Y is given."""
        machine = self.machine
        self._has.add("hole")
        self._take_feed(values)
        if self._plane != _PLANES["G17"]:
            raise machine.fault(f"{self._cycle} drills along Z: say G17")
        if any(values.get(name, 1.0) > 1.0 for name in "LK"):
            raise machine.fault(f"{self._cycle} is repeated, which is not read: write its places")
        goal, level = self._at.copy(), self._level
        for k, name in enumerate("XY"):
            if name in values:
                goal[k] = self._unit * values[name] + (0.0 if self._absolute else goal[k])
        # By differences R is from where it was before, and Z from R.
        for name in "RZ":
            if name in values:
                before = level if name == "R" else self._hole.get("R", np.nan)
                self._hole[name] = self._unit * values[name] + (0.0 if self._absolute else before)
        self._hole |= {name: values[name] for name in "PQ" if name in values}
        axis = self._axis({name: values[name] for name in "ABC" if name in values}, arc=False)
        lacking = [name for name in "ZR" if not np.isfinite(self._hole.get(name, np.nan))]
        if lacking:
            raise machine.fault(f"{self._cycle} says no {lacking[0]}, expected Z and R of the hole")
        if not set(values) & set("XYZ") or 0.0 in (values.get("L"), values.get("K")):
            self._at = goal
            return
        above, bottom = goal.copy(), goal.copy()
        above[2], bottom[2] = self._hole["R"], self._hole["Z"]
        is_turned = self._rotary is None or self._tip
        if is_turned and np.abs(axis - [0.0, 0.0, 1.0]).max() > _SAME_AXIS:
            raise machine.fault(f"{self._cycle} drills along Z, and the tool is tilted")
        pecks = None
        if self._cycle in ("G73", "G83"):
            step = self._unit * self._hole.get("Q", 0.0)
            pecks = Pecks(step, step, retracts_fully=self._cycle == "G83")
        waits = self._cycle in ("G82", "G89") and self._hole.get("P", 0.0) > 0.0
        if np.isfinite(self._at[2]):
            # Over the hole at the height where it is, or where the hole begins if that is above.
            for point in (self._at, goal):
                over = point.copy()
                over[2] = max(self._at[2], self._hole["R"])
                machine.rapid(self._part(over), axis)
        drill(
            machine,
            self._part(above),
            self._part(bottom),
            axis,
            pecks=pecks,
            dwell=f"G4 P{self._hole['P']:g}" if waits else "",
            feeds_out=self._cycle in ("G85", "G89"),
        )
        goal[2] = level if self._returns and np.isfinite(level) else self._hole["R"]
        machine.rapid(self._part(goal), axis)
        self._at = goal

    def _take_feed(self, values: Mapping[str, float]) -> None:
        if "F" in values:
            self._has.add("feed")
            if not 0.0 < values["F"] < 1e7:
                raise self.machine.fault(f"F is {values['F']:g}, expected a feed above 0")
            scale = 1.0 if self._inverse_time else self._unit
            self.machine.feed = values["F"] * scale / 60.0

    def _move(self, values: Mapping[str, float]) -> None:
        machine = self.machine
        if "E" in values and not self._prints:
            raise machine.unread(f"word 'E{values['E']:g}'")
        self._take_feed(values)
        arc, fed = self._motion > 1, self._extruded(values)
        if fed < 0.0:
            machine.happens(RETRACT)
        moved = set(values) & set(_AXES + "IJK" + ("R" if arc else ""))
        if not moved:
            if fed > 0.0:
                machine.happens(PRIME)
            return
        if self._said.isdisjoint(_MOTIONS):
            machine.note("neither this line nor one before says G0, G1, G2 or G3: it is a rapid")
        if arc:
            self._has.add("arc")
        before, start = dict(self._turns), self._at.copy()
        goal = self._at.copy()
        for k, name in enumerate("XYZ"):
            if name in values:
                goal[k] = self._unit * values[name] + (0.0 if self._absolute else goal[k])
        axis = self._axis(values, arc)
        travels = fed <= 0.0 if self._extrudes else self._motion == 0
        if values.get("L", 1.0) > 1.0:
            raise machine.fault("L repeats the line, which is not read: write its places")
        if "S" in values and not travels:
            if self._power not in (None, values["S"]):
                machine.note(
                    "S changes from cut to cut, and is passed over: where a laser or a spindle "
                    "switches, write M codes"
                )
            self._power = values["S"]
        if self._inverse_time and "F" not in values and not travels:
            raise machine.fault("says no F, which after G93 each line has for itself")
        if travels:
            machine.rapid(self._part(goal), axis)
        elif not arc:
            self._cut(self._line(start, goal, before, axis))
        else:
            if np.abs(axis - machine.axis).max() > 0.0:
                raise machine.fault("the tool turns along an arc, which is not read; write lines")
            self._cut([(self._part(point), axis) for point in self._arc(goal, values)])
        self._at = goal

    def _cut(self, poses: Sequence[tuple[Array, Array]]) -> None:
        """Go to poses at the feed; where F says how often a minute, over all of them."""
        machine, feed = self.machine, self.machine.feed
        if self._inverse_time:
            points = np.array([machine.position, *(point for point, _ in poses)])
            machine.feed = feed * float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        for point, axis in poses:
            machine.cut(point, axis)
        machine.feed = feed

    def _line(
        self, start: Array, goal: Array, before: Mapping[str, float], axis: Array
    ) -> list[tuple[Array, Array]]:
        """Return where a line of the machine takes the tool in the part."""
        rotary = self._rotary
        if rotary is None or self._tip or np.isnan(start).any():
            return [(self._part(goal), axis)]
        count = rotary.chord_count(start, goal, before, self._turns)
        found = []
        for k in range(1, count):
            share = k / count
            turns = {
                name: before.get(name, 0.0) + share * (angle - before.get(name, 0.0))
                for name, angle in self._turns.items()
            }
            point = rotary.in_part(start + share * (goal - start), turns)
            found.append((point, rotary.rotation(turns)[:, 2]))
        return [*found, (self._part(goal), axis)]

    def _part(self, position: Array) -> Array:
        """Return where a place of the machine is in the part."""
        if self._rotary is None or self._tip:
            return position.copy()
        return self._rotary.in_part(position.copy(), self._turns)

    def _axis(self, values: Mapping[str, float], arc: bool) -> Array:
        """Return the direction from the tip to the holder."""
        for name in "ABC":
            if name in values:
                before = 0.0 if self._absolute else self._turns.get(name, 0.0)
                self._turns[name] = np.radians(values[name]) + before
        given = [name for name in "IJK" if name in values]
        if (given and not arc) or any(name in values for name in "ABC"):
            self.machine.says_axis = True
        if given and not arc:
            if len(given) < 3 or any(name in values for name in "ABC"):
                raise self.machine.fault("a tool axis is I, J and K, all three, and not A, B, C")
            return unit_axis([values[name] for name in "IJK"], self.machine)
        if not any(name in values for name in "ABC"):
            return self.machine.axis
        turned = [name for name in "ABC" if self._turns.get(name)]
        if turned and self._rotary is None and not self._tip:
            raise self.machine.fault(
                f"{turned[0]} turns a table or the head, and positions may be the machine's: say "
                f"rotary = 'table' with rotary_axes (BC, AC) and rotary_center, or 'head' where "
                f"they are those of the tip in the part (as after G43.4)"
            )
        rotary = self._rotary or Rotary(HEAD)
        known = [name for name, _ in rotary.axes] or "ABC"
        other = next((name for name in turned if name not in known), None)
        if other is not None:
            raise self.machine.fault(
                f"{other} turns, which is none of rotary_axes ({', '.join(known)}): name all"
            )
        return rotary.rotation(self._turns)[:, 2]

    def _arc(self, goal: Array, values: Mapping[str, float]) -> Array:
        """Return points (K, 3) of an arc in its plane, its end the last."""
        machine, start = self.machine, self._at
        sense = -1.0 if self._motion == 2 else 1.0
        first, second, normal = self._plane
        plane, offsets = [first, second], ["IJK"[first], "IJK"[second]]
        if values.get("IJK"[normal], 0.0) != 0.0:
            raise machine.fault(
                f"arcs are in the plane of {'XYZ'[first]} and {'XYZ'[second]}: {'IJK'[normal]} is "
                f"not read"
            )
        if not set(values) & {*offsets, "R"}:
            raise machine.fault(
                f"an arc has neither {' and '.join(sorted(offsets))} nor R; after an arc, lines "
                f"say G1"
            )
        if "R" in values:
            radius = self._unit * values["R"]
            center = center_by_radius(machine, start[plane], goal[plane], radius, sense)
        else:
            given = np.array([self._unit * values.get(name, 0.0) for name in offsets])
            center = given if self._centers_absolute else start[plane] + given
        about = np.array(start)
        about[plane] = center
        axis = np.zeros(3)
        axis[normal] = sense
        return arc_points(machine, start, goal, about, axis, self._more_turns(values))

    def _more_turns(self, values: Mapping[str, float]) -> int:
        """Return how many whole turns an arc makes besides: P counts the one that it ends in."""
        turns = values.get("P", 1.0)
        if turns != round(turns) or not 1.0 <= turns <= _MAX_TURNS:
            raise self.machine.fault(
                f"P of an arc is {turns:g}, expected a number of turns: 1 to {_MAX_TURNS}"
            )
        return int(turns) - 1
