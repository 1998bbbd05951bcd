"""Comments of programs that a reader needs, written and read by one table."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.certificate import Tolerance
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.deviations import NO_DEVIATION, Deviation, Deviations
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.pose_numbers import TIME_DIGITS
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_facts import ProgramFacts, with_checksum
from selfmotion.shop.controllers.program_lines import Lines
from selfmotion.shop.controllers.program_texts import (
    DURATION_HEADING,
    JOINT_TARGETS_REASON,
    TIMES_HEADING,
    TOLERANCE_HEADING,
    as_word,
    folded,
    of_word,
    plain,
    pose_values,
    rounded_up,
)
from selfmotion.shop.controllers.segment_building import ProgramFrames, pose_of_values
from selfmotion.shop.controllers.segments import Segment
from selfmotion.shop.controllers.statements import Field, Statement, Table, seconds, word


def _read_number(comments: Any, text: str) -> float:
    return float(comments.lines.number_of(text))


def _read_numbers(comments: Any, text: str) -> list[float]:
    return [comments.lines.number_of(item) for item in text.split(",")]


_NUMBER = r"[\d.]+"
_HEAD = ("head",)
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

    def stated(self, kind: str) -> Iterator[dict[str, Any]]:
        """Yield the values of each comment of a kind."""
        for note in self.lines.notes:
            found = COMMENTS.find(note, "head")
            if found and found[0].kind == kind:
                yield self._values(*found)

    def _values(self, statement: Statement, texts: dict[str, str]) -> dict[str, Any]:
        return {
            name: COMMENTS.fields[field].read(self, texts[name])
            for name, field in statement.values.items()
        }

    def texts(self, kind: str) -> list[str]:
        """Return the texts of the comments of a kind."""
        return [str(values["text"]) for values in self.stated(kind)]

    def step(self) -> str:
        """Return the seam or move that the last comment about one names."""
        for note in reversed(self.lines.notes):
            found = COMMENTS.find(note, "head")
            if found and found[0].kind == "step":
                return found[1]["text"]
        return ""

    def planned(self) -> float | None:
        """Return the time that comments plan for what follows [s], once; None where they do not."""
        notes = self.lines.notes
        for k in range(len(notes) - 1, -1, -1):
            found = COMMENTS.find(notes[k], "head")
            if found and found[0].kind == "step":
                return None
            if found and found[0].kind == "planned":
                del notes[k]
                return float(self._values(*found)["seconds"])
        return None

    def joints(self) -> dict[str, tuple[str, bool]]:
        """Return the axes stated in comments: axis → its joint, and whether that slides."""
        said = next((str(values["text"]) for values in self.stated("axes")), "")
        joints: dict[str, tuple[str, bool]] = {}
        for item in said.split(", "):
            found = re.fullmatch(r"([AE][1-6]) = (\S+) \[(mm|deg)\]", item)
            if found:
                joints[found[1]] = of_word(found[2]), found[3] == "mm"
        names = [joint for joint, _ in joints.values()]
        if len(set(names)) < len(names):
            raise FileFormatError(f"{self.lines.file}: two axes are the same joint: {said[:200]}")
        return joints

    def facts(self) -> ProgramFacts | None:
        """Return the facts stated in the comments so far; None if there are none."""
        return ProgramFacts.stated(self.lines.notes)

    def deviation(self) -> Deviations:
        """Return the deviations that the comments state, or ones without bounds."""
        path = self._deviation("deviation")
        if path is None:
            return Deviations(*[Deviation(np.inf, np.inf, np.inf)] * 2)
        return Deviations(path, self._deviation("deviation of moves") or path)

    def _deviation(self, kind: str) -> Deviation | None:
        for values in self.stated(kind):
            return Deviation(1e-3 * values["length"], values["angle"], values["joint"])
        return None

    def tolerance(self) -> Tolerance | None:
        """Return the tolerance of seams at speeds; None where none is stated."""
        for values in self.stated("tolerance"):
            return Tolerance(1e-3 * values["length"], values["angle"])
        return None

    def program_frames(self, tool: SE3 | None, work: SE3 | None) -> ProgramFrames:
        """Return the frames of poses by the comments and by the program's own declarations."""
        found = ProgramFrames(tool=tool, work=work)
        for values in self.stated("poses"):
            found.work_name, found.carrier = values["work"], values["carrier"]
            found.flange = values["flange"]
        for values in self.stated("planned work object"):
            if len(values["pose"]) == 7 and any(values["pose"][3:]):
                found.planned = pose_of_values(values["pose"])
        return found


def head(draft: Draft) -> list[str]:
    """Return the comments at the head of a program, without what marks them as such."""
    program = draft.program
    axes = ", ".join(
        f"{axis.name} = {as_word(axis.joint)} [{'mm' if axis.slides else 'deg'}]"
        for axis in program.axes
    )
    moves = program.deviation.moves
    targets = "target" if program.targets == 1 else "targets"
    notes = [
        plain(f"selfmotion: {draft.robot.name}, {program.targets} {targets}"),
        plain(draft.verdict),
        plain(COMMENTS.text("axes", text=axes)),
        *draft.facts.notes,
        *_of_speeds(program),
        _of_deviation("deviation", program.deviation.path),
        *([] if moves == NO_DEVIATION else [_of_deviation("deviation of moves", moves)]),
        f"(of the tool from the plan, straight {_lines(draft)}, rounded corners or a spline",
        "through the targets, at the times of the plan; of seams at speeds where the tool has gone",
        "as far)",
        *([COMMENTS.text("joint targets", text=program.remark)] if program.remark else []),
        *_of_poses(draft),
        "Angles are those of the URDF: compare zeros and signs with the controller's.",
    ]
    return [line for note in with_checksum(notes) for line in folded(note)]


def before(segment: Segment) -> list[str]:
    """Return the comments before a segment, without what marks them as such."""
    planned = isinstance(segment, FeedSegment)
    return [
        *([plain(segment.remark)] if segment.remark else []),
        *([COMMENTS.text("planned", seconds=segment.duration)] if planned else []),
    ]


def _of_speeds(program: ControllerProgram) -> list[str]:
    """Return the lines of the head about seams at speeds."""
    within = program.within
    if within is None:
        return []
    return [
        COMMENTS.text("tolerance", length=1e3 * within.position, angle=within.rotation),
        "(seams are at their feeds, and keep that of what is prescribed; where the tool may turn,",
        "and the arm's self-motion, are off the plan by what follows. Run-up and run-down, and so",
        "when the tool is where, are the controller's)",
    ]


def _of_deviation(kind: str, deviation: Deviation) -> str:
    """Return the comment that states a deviation."""
    return COMMENTS.text(
        kind, length=1e3 * deviation.position, angle=deviation.rotation, joint=deviation.joint
    )


def _lines(draft: Draft) -> str:
    return "joint lines" if draft.frames is None else "lines of the tool"


def _of_poses(draft: Draft) -> list[str]:
    """Return the lines of the head about the frames of poses, from which the reader takes them."""
    frames = draft.frames
    if frames is None:
        return []
    names = {"work": frames.name, "carrier": frames.carrier}
    return [
        COMMENTS.text("poses", **names, flange=draft.settings.flange or "-"),
        COMMENTS.text("planned work object", pose=pose_values(frames.work)),
        "(m, and quaternion x, y, z, w, in that frame; shift the work object to shift the motion)",
        "Poses are reached in the arm's configuration at the begin, by axes.",
    ]
