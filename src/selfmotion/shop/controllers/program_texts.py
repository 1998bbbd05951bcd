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
# Beginning of the comment that says why targets are joints.
BECAUSE = "targets are joints, as poses do not keep the motion: "
# Beginning of the comment that says why a seam with a feed has times all the same.
TIMES_HEADING = "with times: "
# Beginning of the comment that says which tolerance seams at speeds keep.
TOLERANCE_HEADING = "kept of what is prescribed: "
# Beginning of the comment with the planned duration of a segment at speeds.
DURATION_HEADING = "planned time: "


def pin_values(pose: SE3) -> list[float]:
    """Return a pose as position [m] and quaternion x, y, z, w."""
    quaternion = Quaternion(pose.rotation).coeffs()
    return [float(value) + 0.0 for value in (*pose.translation, *quaternion)]


def rounded_up(value: float, digits: int) -> str:
    """Return a number rounded up, so that what is stated holds."""
    return f"{ceil(value * 10**digits) / 10**digits:.{digits}f}"


# Signs of verdicts and names, as comments of programs have them.
_IN_ASCII = str.maketrans({"→": "->", "°": " deg", "µ": "u"})


def plain(text: str) -> str:
    """Return a text as a comment may hold it: one line of ASCII."""
    return " ".join(text.translate(_IN_ASCII).encode("ascii", "replace").decode().split())


def as_word(name: str) -> str:
    """Return a name as one word of ASCII; see `of_word`."""
    return quote(name, safe=_MARKS)


def of_word(word: str) -> str:
    """Return the name that `as_word` wrote."""
    return unquote(word)


def folded(text: str) -> list[str]:
    """Return a text in lines, those after the first with two dots ahead."""
    lines, words = [""], text.split(" ")
    for word in words:
        if lines[-1] and len(lines[-1]) + len(word) > _WIDTH:
            lines.append("..")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def module_name(file: FilePath, most: int, reserved: Sequence[str]) -> str:
    """Return the name that a file's module has to have; words of its language are none.

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
