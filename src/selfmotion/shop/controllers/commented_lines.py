"""Lines of programs of controllers: numbers in them, and what their comments say."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import FileFormatError, lines_of, text_of
from selfmotion.certificate import Tolerance
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.program_facts import Load, ProgramFacts
from selfmotion.shop.controllers.program_settings import Axis
from selfmotion.shop.controllers.program_texts import BECAUSE, KEPT, PLANNED, TIMED, of_word
from selfmotion.shop.controllers.read_segments import Follower, Places, Row, pose_of_values
from selfmotion.shop.controllers.segments import Miss, Misses

# Largest size of a controller's file [bytes].
_BYTES = 50_000_000
# Longest line of such a file [characters].
_LINE = 2000
# Largest number in it, in any unit.
_LARGEST = 1e7
# Characters that end lines in other programs; a controller's file has none.
_STRANGE = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")
# Beginning of comments that name events.
_EVENT = "event: "
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(E[+-]?[0-9]{1,3})?", re.IGNORECASE)


class Lines:
    """The lines of a program, read one after the other, and what its comments say.

    Parameters
    ----------
    file : path
    comment : str
        What a comment begins with.
    """

    def __init__(self, file: FilePath, comment: str) -> None:
        self._file, self._mark = file, comment
        try:
            content = file.read_bytes()
        except OSError as error:
            raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
        if len(content) > _BYTES:
            raise FileFormatError(f"{file}: has {len(content)} bytes, expected {_BYTES} at most")
        self._lines = lines_of(text_of(file, content))
        self.number = 0
        self.notes: list[str] = []

    def __iter__(self) -> Iterator[str]:
        """Yield what is no comment but that of an event, without spaces around it."""
        for number, line in enumerate(self._lines, 1):
            self.number = number
            strange = _STRANGE.search(line)
            if strange:
                raise self.fault(
                    f"has a character {ord(strange[0])}, at which some programs end a line and "
                    f"controllers do not"
                )
            text = line.strip()
            if len(text) > _LINE:
                raise self.fault(f"has {len(text)} characters, expected {_LINE} at most")
            if text.startswith(self._mark):
                note = text[len(self._mark) :].strip()
                if note.startswith(_EVENT):
                    yield f"{self._mark} {note}"
                elif note.startswith(".. ") and self.notes:
                    self.notes[-1] += note[2:]
                else:
                    self.notes.append(note)
            elif text:
                yield text

    def fault(self, what: str) -> FileFormatError:
        """Return an error about the line that was read last."""
        return FileFormatError(f"{self._file}: line {self.number}: {what}")

    def number_of(self, text: str) -> float:
        """Return a number that controllers can hold."""
        found = text.strip()
        if not _NUMBER.fullmatch(found) or len(found) > 40 or not abs(float(found)) < 1e10:
            raise self.fault(f"'{found[:40]}' is no number that is meant")
        return float(found)

    def coordinate(self, text: str) -> float:
        """Return a coordinate in degrees or mm, as it is."""
        value = self.number_of(text)
        if abs(value) > _LARGEST:
            raise self.fault(f"coordinate {value:g} is beyond all that is meant")
        return value

    def duration(self, text: str) -> float:
        """Return a time [s] that is above 0."""
        found = self.number_of(text)
        if not 0.0 < found < _LARGEST:
            raise self.fault(f"time is {found:g} s, expected a number above 0")
        return found

    def step(self) -> str:
        """Return the seam or move that the last comment about one names."""
        steps = self._after("step: ")
        return steps[-1] if steps else ""

    def _after(self, begin: str) -> list[str]:
        """Return the texts behind a beginning of comments."""
        return [note.removeprefix(begin) for note in self.notes if note.startswith(begin)]

    def planned(self) -> float | None:
        """Return the time that comments plan for what follows [s], once; None where they do not."""
        for k in range(len(self.notes) - 1, -1, -1):
            if self.notes[k].startswith("step: "):
                return None
            found = re.fullmatch(rf"{PLANNED}([\d.]+) s", self.notes[k][:80])
            if found:
                del self.notes[k]
                return self.duration(found[1])
        return None

    def joints(self) -> dict[str, tuple[str, bool]]:
        """Return the axes stated in comments: axis → its joint, and whether that slides."""
        said = next((note for note in self.notes if note.startswith("axes: ")), "axes: ")
        joints: dict[str, tuple[str, bool]] = {}
        for item in said.removeprefix("axes: ").split(", "):
            found = re.fullmatch(r"([AE][1-6]) = (\S+) \[(mm|deg)\]", item)
            if found:
                joints[found[1]] = of_word(found[2]), found[3] == "mm"
        names = [joint for joint, _ in joints.values()]
        if len(set(names)) < len(names):
            raise FileFormatError(f"{self._file}: two axes are the same joint: {said[:200]}")
        return joints

    def facts(self) -> ProgramFacts | None:
        """Return the facts stated in the comments so far; None if there are none."""
        return ProgramFacts.stated(self.notes)

    def miss(self) -> Misses:
        """Return the deviations that the comments state, or ones without bounds."""
        path = self._stated("deviation: ")
        if path is None:
            return Misses(*[Miss(np.inf, np.inf, np.inf)] * 2)
        return Misses(path, self._stated("deviation of moves: ") or path)

    def _stated(self, what: str) -> Miss | None:
        for note in self.notes:
            found = re.fullmatch(rf"{what}([\d.]+) mm, ([\d.]+) rad, joints ([\d.]+)", note[:200])
            if found:
                position, rotation, joint = (self.number_of(text) for text in found.groups())
                return Miss(1e-3 * position, rotation, joint)
        return None

    def within(self) -> Tolerance | None:
        """Return the tolerance of seams at speeds stated in the comments."""
        for note in self.notes:
            found = re.fullmatch(rf"{KEPT}([\d.]+) mm, ([\d.]+) rad", note[:200])
            if found:
                position, rotation = (self.number_of(text) for text in found.groups())
                return Tolerance(1e-3 * position, rotation)
        return None

    def places(self, tool: SE3 | None, work: SE3 | None) -> Places:
        """Return the frames of poses by the comments and by the program's own declarations."""
        found = Places(tool=tool, work=work)
        for note in self.notes:
            said = re.fullmatch(r"poses: work object (\S+) of (\S+), flange (\S+)", note[:400])
            if said:
                found.work_name, found.carrier, found.flange = map(of_word, said.groups())
            planned = re.fullmatch(r"planned work object: ([-+.\d, e]+)", note[:400])
            if planned:
                values = [self.number_of(text) for text in planned[1].split(",")]
                if len(values) == 7 and any(values[3:]):
                    found.planned = pose_of_values(values)
        return found

    def program(
        self,
        name: str,
        present: Sequence[str],
        rows: Sequence[Row],
        switches: Sequence[Switch] = (),
        places: Places | None = None,
        robot: RobotModel | None = None,
        load: Load | None = None,
    ) -> ControllerProgram:
        """Return the program of rows of targets, and of what is switched.

        Raises
        ------
        FileFormatError
            Something is missing, or the arm cannot follow.
        """
        if not name:
            raise FileFormatError(f"{self._file}: has no beginning of a program")
        said = self.joints()
        # Robots of fewer axes have numbers in the places of those they lack.
        columns = [k for k, axis in enumerate(present) if axis in said or not said]
        axes = tuple(Axis(present[k], *said.get(present[k], (present[k], False))) for k in columns)
        if not axes:
            raise FileFormatError(f"{self._file}: has no axes of those that its comments name")
        self._check_unnamed(present, columns, rows)
        frames = None
        if any(row.poses for row in rows):
            if robot is None or places is None:
                raise FileFormatError(
                    f"{self._file}: has tool poses, whose joint positions need the robot: give it "
                    f"(read_motion(file, robot=…), check --robot)"
                )
            frames = places.frames(robot, axes, self._file)
        follower = Follower(self._file, axes, frames)
        for row in rows:
            follower.take(row.with_axes(columns))
        if not follower.segments:
            raise FileFormatError(f"{self._file}: has no targets with times")
        remark = next((note for note in self.notes if note.startswith(BECAUSE)), BECAUSE)
        return ControllerProgram(
            name,
            axes,
            tuple(follower.segments),
            self.miss(),
            tuple(switches),
            None if places is None else places.shift,
            "world" if places is None or frames is None else places.carrier,
            remark.removeprefix(BECAUSE),
            self.within(),
            tuple(dict.fromkeys(self._after(TIMED))),
            follower.approach,
            self.facts(),
            load,
        )

    def _check_unnamed(
        self, present: Sequence[str], columns: Sequence[int], rows: Sequence[Row]
    ) -> None:
        """Refuse axes that move, and that no comment gives a joint: nothing judges them.

        Robots of fewer than six axes have 0 in the places of those they lack.
        """
        for k, axis in enumerate(present):
            if k in columns:
                continue
            if axis.startswith("E") or any(q[k] != 0.0 for row in rows for q in row.axes):
                raise FileFormatError(
                    f"{self._file}: axis {axis} has targets, and the comment 'axes: …' names no "
                    f"joint that it is: nothing has judged its motion"
                )
