"""Comments of programs that a reader needs: their table, and what they state."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.certificate import Tolerance
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.deviations import Deviation, Deviations
from selfmotion.shop.controllers.pose_numbers import TIME_DIGITS
from selfmotion.shop.controllers.program_facts import ProgramFacts
from selfmotion.shop.controllers.program_lines import Lines
from selfmotion.shop.controllers.program_texts import (
    DURATION_HEADING,
    JOINT_TARGETS_REASON,
    TIMES_HEADING,
    TOLERANCE_HEADING,
    as_word,
    of_word,
    rounded_up,
)
from selfmotion.shop.controllers.segment_building import ProgramFrames, pose_of_values
from selfmotion.shop.controllers.statements import Field, Statement, Table, seconds, word

# Text of a number without sign and exponent, as the writer makes them.
_NUMBER = r"[\d.]+"
# State of the reader in which each of these comments may stand.
_HEAD = ("head",)


# Readers of fields below.
def _read_number(comments: "Comments", text: str) -> float:
    return comments.lines.number_of(text)


def _read_numbers(comments: "Comments", text: str) -> list[float]:
    return [comments.lines.number_of(item) for item in text.split(",")]


COMMENTS = Table(
    is_exact=True,
    fields={
        # Deviations are rounded up, so that what is stated holds.
        "length": Field(_NUMBER, _read_number, lambda value: rounded_up(value, 6)),
        "angle": Field(_NUMBER, _read_number, lambda value: rounded_up(value, 9)),
        "seconds": replace(seconds(TIME_DIGITS), pattern=_NUMBER),
        "link": Field(r"\S+", lambda _, text: of_word(text), as_word),
        "pose": Field(
            r"[-+.\d, e]+", _read_numbers, lambda pose: ", ".join(f"{x:.9f}" for x in pose)
        ),
        "text": word(".*"),
    },
    # A value <work:link> is called work and is a field link; <text> is a field of its own name.
    statements=(
        Statement("step", "step: <text>", _HEAD),
        Statement("planned", f"{DURATION_HEADING}<seconds> s", _HEAD),
        Statement("deviation", "deviation: <length> mm, <angle> rad, joints <joint:angle>", _HEAD),
        Statement(
            "deviation of moves",
            "deviation of moves: <length> mm, <angle> rad, joints <joint:angle>",
            _HEAD,
        ),
        Statement("tolerance", f"{TOLERANCE_HEADING}<length> mm, <angle> rad", _HEAD),
        Statement("joint targets", f"{JOINT_TARGETS_REASON}<text>", _HEAD),
        Statement("times", f"{TIMES_HEADING}<text>", _HEAD),
        Statement(
            "poses", "poses: work object <work:link> of <carrier:link>, flange <flange:link>", _HEAD
        ),
        Statement("planned work object", "planned work object: <pose>", _HEAD),
        Statement("axes", "axes: <text>", _HEAD),
    ),
)


class Comments:
    """The comments of a program that were read so far.

    Parameters
    ----------
    lines : Lines
    """

    def __init__(self, lines: Lines) -> None:
        self.lines = lines

    def values_of(self, kind: str) -> Iterator[dict[str, Any]]:
        """Yield the values of each comment of a kind."""
        for note in self.lines.notes:
            match = COMMENTS.find(note, "head")
            if match and match[0].kind == kind:
                yield self._values(*match)

    def _values(self, statement: Statement, texts: dict[str, str]) -> dict[str, Any]:
        return {
            name: COMMENTS.fields[field].read(self, texts[name])
            for name, field in statement.values.items()
        }

    def texts_of(self, kind: str) -> list[str]:
        """Return the texts of the comments of a kind."""
        return [str(values["text"]) for values in self.values_of(kind)]

    def last_step(self) -> str:
        """Return the name of the seam or move that was begun last; "" where none was."""
        for note in reversed(self.lines.notes):
            match = COMMENTS.find(note, "head")
            if match and match[0].kind == "step":
                return match[1]["text"]
        return ""

    def take_planned_time(self) -> float | None:
        """Take out the last planned time since the last step began, and return it [s].

        None where there is none.
        """
        notes = self.lines.notes
        for k in range(len(notes) - 1, -1, -1):
            match = COMMENTS.find(notes[k], "head")
            if match and match[0].kind == "step":
                return None
            if match and match[0].kind == "planned":
                del notes[k]
                return float(self._values(*match)["seconds"])
        return None

    def axes(self) -> dict[str, tuple[str, bool]]:
        """Return the axes that the comments state: axis → its joint, and whether that slides."""
        text = next((str(values["text"]) for values in self.values_of("axes")), "")
        axes: dict[str, tuple[str, bool]] = {}
        for item in text.split(", "):
            match = re.fullmatch(r"([AE][1-6]) = (\S+) \[(mm|deg)\]", item)
            if match:
                axes[match[1]] = of_word(match[2]), match[3] == "mm"
        names = [joint for joint, _ in axes.values()]
        if len(set(names)) < len(names):
            raise FileFormatError(f"{self.lines.file}: two axes are the same joint: {text[:200]}")
        return axes

    def facts(self) -> ProgramFacts | None:
        """Return the facts that the comments state; None if there are none."""
        return ProgramFacts.stated(self.lines.notes)

    def deviations(self) -> Deviations:
        """Return the deviations that the comments state, or ones without bounds."""
        path = self._deviation("deviation")
        if path is None:
            unbounded = Deviation(np.inf, np.inf, np.inf)
            return Deviations(unbounded, unbounded)
        return Deviations(path, self._deviation("deviation of moves") or path)

    def _deviation(self, kind: str) -> Deviation | None:
        for values in self.values_of(kind):
            return Deviation(1e-3 * values["length"], values["angle"], values["joint"])
        return None

    def tolerance(self) -> Tolerance | None:
        """Return the tolerance within which seams at feeds were planned; None if none is stated."""
        for values in self.values_of("tolerance"):
            return Tolerance(1e-3 * values["length"], values["angle"])
        return None

    def program_frames(self, tool: SE3 | None, work: SE3 | None) -> ProgramFrames:
        """Return the frames of poses by the comments and by the program's own declarations."""
        frames = ProgramFrames(tool=tool, work=work)
        for values in self.values_of("poses"):
            frames.work_name, frames.carrier = values["work"], values["carrier"]
            frames.flange = values["flange"]
        for values in self.values_of("planned work object"):
            if len(values["pose"]) == 7 and any(values["pose"][3:]):
                frames.planned = pose_of_values(values["pose"])
        return frames
