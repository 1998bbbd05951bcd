"""Random programs of pockets and holes, and an interpreter of the tests' own that says what is cut.

The interpreter shares no code with the package: it reads lines by one pattern, moves a point, and
keeps where the tool goes straight, in which line, and where it was when a word switched something.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from selfmotion.basics import Array

Events = Sequence[tuple[str, float]]

# Chords of arcs of the interpreter are this short [rad]; lengths are in mm.
_CHORD = 0.01
_STOPS = ("M5", "M9")
# How far a drill comes back to break chips, and stays off the bottom of a hole.
_OFF = 0.5


@dataclass
class Seam:
    """What is to be cut without a traverse: places on its way, and what happens where.

    Attributes
    ----------
    points : list of (3,)
        [mm].
    feeds : list of float or None
        To each point [mm/s]; None in a rapid.
    events : list of (str, (3,))
    is_hole : bool
    """

    points: list[Array] = field(default_factory=list)
    feeds: list[float | None] = field(default_factory=list)
    events: list[tuple[str, Array]] = field(default_factory=list)
    is_hole: bool = False

    @property
    def cuts(self) -> bool:
        """Whether anything is cut."""
        return any(feed is not None for feed in self.feeds[1:])


class Interpreter:
    """Runs a program line by line."""

    def __init__(self) -> None:
        self.seams: list[Seam] = []
        self._now: Seam | None = None
        self._waiting: list[str] = []
        self._at = np.full(3, np.nan)
        self._top = -np.inf
        self._from_home = False
        self._absolute, self._motion, self._feed = True, 0, 0.0
        self._cycle, self._words, self._level, self._returns = "", {}, np.nan, True

    def run(self, text: str) -> list[Seam]:
        """Return the seams of a program."""
        for line in text.splitlines():
            self._line(re.sub(r"\(.*?\)", "", line))
        self._end()
        for name in self._waiting:
            self.seams[-1].events.append((name, self.seams[-1].points[-1]))
        return self.seams

    def _line(self, line: str) -> None:
        words = re.findall(r"([A-Z])([-+]?[0-9.]+)", line)
        codes = [f"{a}{float(b):g}" for a, b in words if a in "GM"]
        values = {a: float(b) for a, b in words if a not in "GMN"}
        self._absolute = {"G90": True, "G91": False}.get(
            next((code for code in codes if code in ("G90", "G91")), ""), self._absolute
        )
        self._feed = values.get("F", 60.0 * self._feed) / 60.0
        for code in codes:
            if code in ("G0", "G1", "G2", "G3"):
                self._motion, self._cycle = int(code[1]), ""
            elif code == "G80":
                self._cycle = ""
            elif code in ("G98", "G99"):
                self._returns = code == "G98"
            elif code in ("G73", "G81", "G82", "G83"):
                if not self._cycle:
                    self._level, self._words = self._at[2], {}
                self._cycle = code
        switched = [code for code in codes if code[0] == "M" and code != "M30"]
        early = [code for code in switched if code not in _STOPS]
        home = next((code for code in codes if code in ("G28", "G53")), None)
        goal = self._at.copy()
        for k, name in enumerate("XYZ"):
            if name in values and home is None:
                goal[k] = values[name] + (0.0 if self._absolute else goal[k])
        is_traverse = self._motion == 0 and not self._cycle and not self._is_vertical(goal)
        if not is_traverse:
            for code in early:
                self._switch(code)
        if home is not None:
            self._go_home(home, values)
        elif self._cycle and set(values) & set("XYZ"):
            self._drill(values)
        elif not self._cycle and set(values) & set("XYZ"):
            self._go(goal, values)
        for code in [*(early if is_traverse else []), *(c for c in switched if c in _STOPS)]:
            self._switch(code)

    def _switch(self, code: str) -> None:
        came = self._now is None or len(self._now.points) == 1
        quiet = not self._waiting and not (self._now and self._now.events)
        if came and code in _STOPS and self.seams and quiet:
            self.seams[-1].events.append((code, self.seams[-1].points[-1]))
        elif self._now is None:
            self._waiting.append(code)
        else:
            self._now.events.append((code, self._at.copy()))

    def _is_vertical(self, goal: Array) -> bool:
        return bool(self._now and np.abs((goal - self._at)[:2]).max() < 1e-9)

    def _rapid(self, goal: Array) -> None:
        if self._is_vertical(goal):
            assert self._now is not None
            if abs(goal[2] - self._at[2]) > 1e-9:
                self._now.points.append(goal)
                self._now.feeds.append(None)
        else:
            self._end()
            if np.isfinite(goal).all():
                self._now = Seam([goal], [None])
                if self._from_home and self._top > goal[2]:
                    above = np.array([*goal[:2], self._top])
                    self._now = Seam([above, goal], [None, None])
                self._from_home = False
        self._at = goal
        if np.isfinite(goal).all():
            self._top = max(self._top, goal[2])

    def _cut(self, goal: Array) -> None:
        if self._now is None or self._now.is_hole:
            before = self._at
            self._end()
            self._now = Seam([before], [None])
        if not self._now.cuts:
            self.seams.append(self._now)
            self._now.events[:0] = [(name, self._now.points[0]) for name in self._waiting]
            self._waiting = []
        self._now.points.append(goal)
        self._now.feeds.append(self._feed)
        self._at = goal
        self._top = max(self._top, goal[2])

    def _end(self) -> None:
        if self._now is not None and not self._now.cuts:
            self._waiting = [*(name for name, _ in self._now.events), *self._waiting]
        self._now = None

    def _go(self, goal: Array, values: dict[str, float]) -> None:
        if self._motion == 0:
            self._rapid(goal)
        elif self._motion == 1:
            self._cut(goal)
        else:
            center = self._at[:2] + np.array([values["I"], values["J"]])
            first, last = self._at[:2] - center, goal[:2] - center
            begin, end = (float(np.arctan2(arm[1], arm[0])) for arm in (first, last))
            side = -1.0 if self._motion == 2 else 1.0
            turn = side * ((side * (end - begin)) % (2.0 * np.pi) or 2.0 * np.pi)
            start, radius = self._at.copy(), float(np.linalg.norm(first))
            shares = np.linspace(0.0, 1.0, 2 + int(abs(turn) / _CHORD))[1:]
            for share in shares:
                angle = begin + share * turn
                here = start + share * (goal - start)
                here[:2] = center + radius * np.array([np.cos(angle), np.sin(angle)])
                self._cut(here)

    def _go_home(self, code: str, values: dict[str, float]) -> None:
        if code == "G28" and self._absolute and "Z" in values:
            self._rapid(np.array([*self._at[:2], values["Z"]]))
        if np.isfinite(self._at).all() and self._top > self._at[2]:
            self._rapid(np.array([*self._at[:2], self._top]))
        self._end()
        self._from_home = True
        self._at = np.array([*self._at[:2], np.nan])

    def _drill(self, values: dict[str, float]) -> None:
        place = self._at.copy()
        for k, name in enumerate("XY"):
            if name in values:
                place[k] = values[name] + (0.0 if self._absolute else place[k])
        if "R" in values:
            self._words["R"] = values["R"] + (0.0 if self._absolute else self._level)
        if "Z" in values:
            self._words["Z"] = values["Z"] + (0.0 if self._absolute else self._words["R"])
        self._words |= {name: values[name] for name in "QP" if name in values}
        above, bottom = self._words["R"], self._words["Z"]

        def at(height: float) -> Array:
            return np.array([*place[:2], height])

        level = max(self._at[2], above)
        self._rapid(np.array([*self._at[:2], level]))
        self._rapid(at(level))
        self._rapid(at(above))
        step = self._words.get("Q", 0.0) if self._cycle in ("G73", "G83") else above - bottom
        depth = above
        while depth > bottom + 1e-6:
            if depth < above:
                if self._cycle == "G83":
                    self._rapid(at(above))
                self._rapid(at(min(depth + _OFF, above)))
            depth = max(depth - step, bottom)
            self._cut(at(depth))
        if self._cycle == "G82" and self._words.get("P", 0.0) > 0.0:
            self._switch(f"G4 P{self._words['P']:g}")
        self._rapid(at(above))
        assert self._now is not None
        self._now.is_hole = True
        self._rapid(at(self._level if self._returns else above))


def random_program(rng: np.random.Generator) -> str:
    """Return a program of one to four pockets, slots or holes, 2 to 25 mm deep."""
    lines = ["%", "G21 G90 G94 G17 G54"]
    clear = float(rng.choice([15.0, 30.0, 50.0]))
    lines.append(f"G0 X{rng.uniform(-40, 40):.2f} Y{rng.uniform(-40, 40):.2f} Z{clear:g}")
    on = False
    for _ in range(int(rng.integers(1, 5))):
        lines += _switching(rng, on) if rng.random() < 0.5 else []
        on = True
        x, y = (round(float(value), 2) for value in rng.uniform(-60, 60, 2))
        depth = round(float(rng.uniform(2, 25)), 2)
        low = round(float(rng.uniform(1, 8)), 2)
        feed = round(float(rng.uniform(300, 1800)))
        if rng.random() < 0.3:
            lines += _holes(rng, x, y, depth, low, feed, clear)
        else:
            lines += _pocket(rng, x, y, depth, low, feed, clear)
        lines += _away(rng, clear)
        if rng.random() < 0.4:
            lines.append(str(rng.choice(["M9", "M5", "M8"])))
        if rng.random() < 0.15:
            lines.append(str(rng.choice(["G91 G28 Z0\nG90", "G53 G0 Z0", f"G28 Z{clear:g}"])))
            lines.append(f"G0 X{x:g} Y{y:g}")
            lines.append(f"G0 Z{clear:g}")
    return "\n".join([*lines, "M5", "M30", "%", ""])


def _switching(rng: np.random.Generator, on: bool) -> list[str]:
    return [str(rng.choice(["M3", "M8", "M7"]))] if not on else [str(rng.choice(["M8", "M3"]))]


def _pocket(
    rng: np.random.Generator,
    x: float,
    y: float,
    depth: float,
    low: float,
    feed: int,
    clear: float,
) -> list[str]:
    with_code = " M3" if rng.random() < 0.3 else ""
    lines = [f"G0 X{x:g} Y{y:g}{with_code}", f"G0 Z{low:g}" + (" M8" * (rng.random() < 0.3))]
    passes = int(rng.integers(1, 4))
    for number in range(1, passes + 1):
        below = round(-depth * number / passes, 3)
        lines.append(f"G1 Z{below:g} F{feed // 2}")
        across, along = (round(float(value), 2) for value in rng.uniform(8, 30, 2))
        if rng.random() < 0.5:
            lines.append(f"G91 G1 X{across:g} F{feed}")
            lines.append(f"Y{along:g}")
            lines.append(f"X{-across:g}")
            lines.append(f"Y{-along:g}\nG90")
        else:
            turn = "G2" if rng.random() < 0.5 else "G3"
            lines.append(f"G1 X{x + across:.3f} F{feed}")
            lines.append(f"{turn} X{x:.3f} Y{y:g} I{-across / 2:.4f} J0")
        if number < passes and rng.random() < 0.5:
            lines += [f"G0 Z{low:g}", f"G0 Z{below + 0.5:g}"]
        if rng.random() < 0.2:
            lines.append("M7")
    return lines


def _holes(
    rng: np.random.Generator,
    x: float,
    y: float,
    depth: float,
    low: float,
    feed: int,
    clear: float,
) -> list[str]:
    cycle = str(rng.choice(["G81", "G82 P200", "G83", "G73"]))
    back = str(rng.choice(["G98", "G99"]))
    step = f" Q{rng.uniform(1.0, 6.0):.2f}" if cycle in ("G83", "G73") else ""
    lines = [f"G0 X{x - 5:g} Y{y:g}", f"G0 Z{clear:g}"]
    lines.append(f"{back} {cycle} X{x:g} Y{y:g} Z{-depth:g} R{low:g}{step} F{feed // 3}")
    lines += [f"X{x + 12 * k:.2f}" for k in range(1, int(rng.integers(1, 4)))]
    return [*lines, "G80"]


def _away(rng: np.random.Generator, clear: float) -> list[str]:
    if rng.random() < 0.2:
        return [f"G1 Z2 F600\nG0 Z{clear:g}"]
    if rng.random() < 0.2:
        return [f"G0 Z5\nG0 Z{clear:g} M9"]
    return [f"G0 Z{clear:g}"]


# What a corner may be rounded by, chords of both may be off, and a motion may be off its path [mm].
TOLERANCE, CHORDS, ROUNDING = 1.0, 0.03, 1e-3
# Samples of a seam are this near to each other [mm], about.
_SPACED = 0.25


def misses(
    wanted: Seam, places: Callable[[Array], Array], duration: float, events: Events
) -> list[str]:
    """Return what is wrong with a motion along a seam, in words; nothing for a sound one.

    Parameters
    ----------
    wanted : Seam
    places : callable
        Times (K,) [s] → where the tool is (K, 3) [mm].
    duration : float
    events : sequence of (str, float)
        What happens when [s].
    """
    points = np.array(wanted.points)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    way = places(np.linspace(0.0, duration, 200 + int(4.0 * length / _SPACED)))
    gap = float(np.linalg.norm(np.diff(way, axis=0), axis=1).max())
    found = []
    off = max(_beside(place, points) for place in way)
    if off > TOLERANCE + CHORDS:
        found.append(f"{off:.3f} mm beside what the file says")
    at = 0
    for k, point in enumerate(points):
        is_sharp = k in (0, len(points) - 1) or (wanted.feeds[k] is None) != (
            wanted.feeds[k + 1] is None
        )
        near = (ROUNDING if is_sharp else TOLERANCE + CHORDS) + 0.5 * gap
        passed = np.flatnonzero(np.linalg.norm(way[at:] - point, axis=1) <= near)
        if not len(passed):
            found.append(f"never comes to {point.tolist()} after {points[k - 1].tolist()}")
            break
        at += int(passed[0])
    if [name for name, _ in events] != [name for name, _ in wanted.events]:
        told = [name for name, _ in events], [name for name, _ in wanted.events]
        return [*found, f"switches {told[0]}, expected {told[1]}"]
    for (name, time), (_, place) in zip(events, wanted.events, strict=True):
        away = float(np.linalg.norm(places(np.array([time]))[0] - place))
        if away > TOLERANCE + CHORDS:
            found.append(f"{name} is {away:.3f} mm from where the file has it")
    return found


def _beside(place: Array, points: Array) -> float:
    legs = np.diff(points, axis=0)
    squares = np.maximum((legs * legs).sum(axis=1), 1e-18)
    shares = np.clip(((place - points[:-1]) * legs).sum(axis=1) / squares, 0.0, 1.0)
    nearest = points[:-1] + shares[:, None] * legs
    return float(np.linalg.norm(nearest - place, axis=1).min())
