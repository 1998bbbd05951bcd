"""G-code of machines with up to five axes: the subset of ISO 6983 that says where a tool goes.

The names are Fanuc's. The tool's tip is meant, as under tool centre point control.
"""

import re
from collections.abc import Mapping
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array
from selfmotion.formats.cuts import STOPS, Machine, unit_axis
from selfmotion.formats.path_rows import PoseRows

_WORD = re.compile(r"([A-Z])\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))\s*")
_INCH, _MM = 25.4e-3, 1e-3
# Chords of arcs are off by this at most [m].
_CHORD = 1e-5
# Both ends of an arc are as far from its centre, but for this [m].
_ROUND = 2e-4
_LINE = 1000
# Nearer than this [m] is the same place.
_SAME = 1e-9
# What changes nothing here: cutter compensation off, tool length, the first workpiece, no cycle,
# feeds by the minute, centres of arcs from their starts, tool centre point control.
_NOTHING = {"G40", "G43.4", "G43.5", "G49", "G54", "G69", "G80", "G94", "G91.1", "G64", "G61"}
_MOTIONS = {"G0": 0, "G1": 1, "G2": 2, "G3": 3}
_ENDS = {"M2", "M30"}
_UNSEEN = "NSTHDO"
_AXES = "XYZABC"
_EVERY = _AXES + "IJKRF" + _UNSEEN


def read_gcode(file: FilePath) -> Mapping[str, PoseRows]:
    """Read the cuts of a program; see `read_path`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or has a word that is not read; its line is named.
    """
    reader = _Reader(file)
    for number, line in enumerate(reader.machine.text().splitlines(), 1):
        reader.machine.number = number
        if reader.take(line):
            break
    return reader.machine.seams()


class _Reader:
    """The modes of a machine, and the lines that change them."""

    def __init__(self, file: FilePath) -> None:
        self.machine = Machine(file)
        self._unit, self._absolute, self._motion = _MM, True, 0
        self._begun = False
        self._turns: dict[str, float] = {}

    def take(self, line: str) -> bool:
        """Take a line; return whether the program ends with it."""
        machine = self.machine
        if len(line) > _LINE:
            raise machine.fault(f"has {len(line)} characters, expected {_LINE} at most")
        text = (
            re.sub(r"\([^()]*\)", " ", line.upper()).partition(";")[0].strip().lstrip("/").strip()
        )
        if text == "%":
            # The second one ends the tape.
            self._begun, ended = True, self._begun
            return ended
        if not text:
            return False
        words, at = list[tuple[str, str]](), 0
        while at < len(text):
            found = _WORD.match(text, at)
            if not found:
                raise machine.unread(f"'{text[at : at + 40]}'")
            words.append((found[1], found[2]))
            at = found.end()
        codes = [f"{letter}{float(value):g}" for letter, value in words if letter in "GM"]
        values: dict[str, float] = {}
        for letter, value in words:
            if letter in "GM":
                continue
            if letter not in _EVERY:
                raise machine.unread(f"word '{letter}{value}'")
            if letter in values:
                raise machine.fault(f"word {letter} is there twice")
            if len(value) > 30:
                raise machine.fault(f"{letter} has {len(value)} digits; no machine reads them")
            values[letter] = float(value)
        moving = [code for code in codes if code in _MOTIONS]
        if len(moving) > 1:
            raise machine.fault(f"{moving[0]} and {moving[1]} are in one line")
        switched = [code for code in codes if code.startswith("M")]
        for code in codes:
            if code not in switched:
                self._mode(code)
        if "R" in values and self._motion < 2:
            raise machine.fault("R is read of arcs only (G2, G3)")
        # What starts does so before the motion of its line, what stops after it. A rapid leaves the
        # cut before: all that its line switches belongs to the next one.
        late = [code for code in switched if self._motion == 0 or code in STOPS]
        for code in switched:
            if code not in late:
                self._mode(code)
        self._move(values)
        for code in late:
            self._mode(code)
        return any(code in _ENDS for code in codes)

    def _mode(self, code: str) -> None:
        match code:
            case "G20" | "G21":
                self._unit = _INCH if code == "G20" else _MM
            case "G90" | "G91":
                self._absolute = code == "G90"
            case "G17":
                pass
            case _ if code in _MOTIONS:
                self._motion = _MOTIONS[code]
            case _ if code in _NOTHING or code in _ENDS:
                pass
            case "G43":
                raise self.machine.fault(
                    "G43 is not read: heights of its tools' table are not known; write G43.4 where "
                    "the program's positions are those of the tip, or leave it out"
                )
            case "G4":
                raise self.machine.fault("G4 is not read: nothing waits along a cut; leave it out")
            case "M98" | "M99":
                raise self.machine.fault(f"{code}: subprograms are not read; write them out")
            case _ if code.startswith("M"):
                self.machine.happens(code)
            case _:
                raise self.machine.unread(f"{code}")

    def _move(self, values: Mapping[str, float]) -> None:
        machine = self.machine
        if "F" in values:
            if not 0.0 < values["F"] < 1e7:
                raise machine.fault(f"F is {values['F']:g}, expected a feed above 0")
            machine.feed = values["F"] * self._unit / 60.0
        arc = self._motion > 1
        moved = set(values) & set(_AXES + "IJK" + ("R" if arc else ""))
        if not moved:
            return
        goal = machine.position.copy()
        for k, name in enumerate("XYZ"):
            if name in values:
                goal[k] = self._unit * values[name] + (0.0 if self._absolute else goal[k])
        axis = self._axis(values, arc)
        if self._motion == 0:
            machine.rapid(goal, axis)
        elif not arc:
            machine.cut(goal, axis)
        else:
            if np.abs(axis - machine.axis).max() > 0.0:
                raise machine.fault("the tool turns along an arc, which is not read; write lines")
            for point in self._arc(goal, values):
                machine.cut(point, axis)

    def _axis(self, values: Mapping[str, float], arc: bool) -> Array:
        """Return the direction from the tip to the holder."""
        for name in "ABC":
            if name in values:
                before = 0.0 if self._absolute else self._turns.get(name, 0.0)
                self._turns[name] = np.radians(values[name]) + before
        given = [name for name in "IJK" if name in values]
        if given and not arc:
            if len(given) < 3 or any(name in values for name in "ABC"):
                raise self.machine.fault("a tool axis is I, J and K, all three, and not A, B, C")
            return unit_axis([values[name] for name in "IJK"], self.machine)
        if not any(name in values for name in "ABC"):
            return self.machine.axis
        a, b, c = (self._turns.get(name, 0.0) for name in "ABC")
        # Rz(C) Ry(B) Rx(A) z
        tilted = np.array([np.sin(b) * np.cos(a), -np.sin(a), np.cos(b) * np.cos(a)])
        x, y, z = tilted.tolist()
        return np.array([x * np.cos(c) - y * np.sin(c), x * np.sin(c) + y * np.cos(c), z])

    def _arc(self, goal: Array, values: Mapping[str, float]) -> Array:
        """Return points (K, 3) of an arc in the plane of X and Y, its end the last."""
        machine, start = self.machine, self.machine.position
        if np.isnan(start).any() or np.isnan(goal).any():
            raise machine.fault("an arc begins where X, Y or Z is not known yet")
        sense = -1.0 if self._motion == 2 else 1.0
        if "K" in values:
            raise machine.fault("arcs are in the plane of X and Y (G17): K is not read")
        if not set(values) & set("IJR"):
            raise machine.fault("an arc has neither I and J nor R; after an arc, lines say G1")
        if "R" in values:
            center = self._center(start[:2], goal[:2], self._unit * values["R"], sense)
        else:
            offset = [self._unit * values.get(name, 0.0) for name in "IJ"]
            center = start[:2] + np.array(offset)
        arms = start[:2] - center, goal[:2] - center
        radius, other = (float(np.linalg.norm(arm)) for arm in arms)
        if radius < _SAME or abs(radius - other) > _ROUND:
            raise machine.fault(
                f"the arc begins {1e3 * radius:.4g} mm from its centre and ends "
                f"{1e3 * other:.4g} mm from it"
            )
        angles = [float(np.arctan2(arm[1], arm[0])) for arm in arms]
        turn = (sense * (angles[1] - angles[0])) % (2.0 * np.pi)
        if turn < 1e-9:
            turn = 2.0 * np.pi
        count = max(2, int(np.ceil(turn / (2.0 * np.arccos(max(0.0, 1.0 - _CHORD / radius))))))
        if count > 100_000:
            raise machine.fault(f"the arc has a radius of {radius:.4g} m")
        share = np.arange(1, count + 1) / count
        angle = angles[0] + sense * turn * share
        radii = radius + (other - radius) * share
        points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radii[:, None] + center
        heights = start[2] + (goal[2] - start[2]) * share
        found = np.column_stack([points, heights])
        found[-1] = goal
        return found

    def _center(self, start: Array, goal: Array, radius: float, sense: float) -> Array:
        chord = goal - start
        length = float(np.linalg.norm(chord))
        if length < _SAME or length > 2.0 * abs(radius) + _ROUND:
            raise self.machine.fault(
                f"no arc of radius {1e3 * radius:.4g} mm joins points {1e3 * length:.4g} mm apart"
            )
        height = np.sqrt(max(0.0, radius**2 - 0.25 * length**2))
        side = sense if radius > 0.0 else -sense
        normal = np.array([-chord[1], chord[0]]) / length
        return np.asarray(start + 0.5 * chord + side * height * normal)
