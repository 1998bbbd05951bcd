"""Texts of programs: comments that are read again, names, numbers."""

import re
from collections.abc import Sequence
from math import ceil
from pathlib import Path as FilePath
from urllib.parse import quote, unquote

from selfmotion.basics import FileFormatError
from selfmotion.model.task import SE3, Quaternion

# Marks in names that stand in comments as they are, besides letters, digits and _ . - ~.
_MARKS = "/:+#@()[]{}<>|$&=*;!?^"
# Characters in a line of comments.
_WIDTH = 100
# Start of the comment with the reason for joint targets.
JOINT_TARGETS_REASON = "targets are joints, as poses do not keep the motion: "
# Start of the comment with the reason why a seam with a feed is programmed with times.
TIMES_HEADING = "with times: "
# Start of the comment with the tolerance of seams with a programmed feed.
TOLERANCE_HEADING = "kept of what is prescribed: "
# Start of the comment with the planned duration of a segment with a programmed feed.
DURATION_HEADING = "planned time: "


def pose_values(pose: SE3) -> list[float]:
    """Return a pose as position [m] and quaternion x, y, z, w."""
    quaternion = Quaternion(pose.rotation).coeffs()
    return [float(value) + 0.0 for value in (*pose.translation, *quaternion)]


def rounded_up(value: float, digits: int) -> str:
    """Return a number rounded up, so that what is stated holds."""
    return f"{ceil(value * 10**digits) / 10**digits:.{digits}f}"


# Signs of verdicts and names, as comments of programs have them.
_IN_ASCII = str.maketrans({"→": "->", "°": " deg", "µ": "u"})


def plain(text: str) -> str:
    """Return a text as one line of ASCII, as comments need it."""
    return " ".join(text.translate(_IN_ASCII).encode("ascii", "replace").decode().split())


def as_word(name: str) -> str:
    """Return a name as one word of ASCII; see `of_word`."""
    return quote(name, safe=_MARKS)


def of_word(word: str) -> str:
    """Return the name that `as_word` wrote."""
    return unquote(word)


def folded(text: str) -> list[str]:
    """Return a text wrapped into lines; all but the first begin with two dots."""
    lines, words = [""], text.split(" ")
    for word in words:
        if lines[-1] and len(lines[-1]) + len(word) > _WIDTH:
            lines.append("..")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def module_name(file: FilePath, most: int, reserved: Sequence[str]) -> str:
    """Return the name of a file's module; reserved words of the language are refused.

    Raises
    ------
    FileFormatError
        Controllers know no module of that name.
    """
    name = file.stem
    if not (re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) and len(name) <= most):
        raise FileFormatError(
            f"{file}: the module is called as the file is, and '{name}' is no name: expected a "
            f"letter, then letters, digits and _, {most} at most"
        )
    if name.upper() in reserved:
        raise FileFormatError(
            f"{file}: the module is called as the file is, and '{name}' is a word of the "
            f"controller's language; call the file otherwise"
        )
    return name
