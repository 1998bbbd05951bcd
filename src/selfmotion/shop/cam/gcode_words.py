"""Words of G-code: letters and numbers of a line (ISO 6983), without what they mean."""

import re
from collections.abc import Sequence

from selfmotion.basics import lines_of
from selfmotion.shop.cam.cuts import Machine

_WORD = re.compile(r"([A-Z])\s*=?\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))\s*")
# Words of the languages of controls alone.
_MACRO = re.compile(r"#|\[|^\s*N?[0-9]*\s*O\s*<|\b(SUB|CALL|REPEAT|WHILE|IF|ENDSUB|GOTO)\b")
_HEIDENHAIN = re.compile(r"[0-9]*\s*BEGIN PGM")
# Words of a printer that extrude, and that extrude while it moves.
_EXTRUDES = re.compile(r"G0*[0-3](?![0-9.]).*E[+-]?[0-9.]")
_ON_ITS_WAY = re.compile(r"[XYZ].*E[+-]?[0-9.]|E[+-]?[0-9.].*[XYZ]")
# A word Z.
_LIFTS = re.compile(r"Z\s*=?\s*[-+.0-9#\[]")
# Words of Siemens' controls → what they are called here: the tool's axis, and its tip in the part.
_SIEMENS = {"A3": "I", "B3": "J", "C3": "K"}
_AXIS = re.compile(r"\b([ABC]3)\s*=")
_TIP = (("TRAORI", "G43.4"), ("TRAFOOF", "G49"))
_LINE = 1000
# The letters that are read, and those that change nothing here.
_LETTERS = "XYZABCIJKRFE" + "NSTHDOPQL"


def extrudes(text: str) -> tuple[bool, bool]:
    """Return whether a program is a printer's, and whether that extrudes while it moves."""
    lines = (re.sub(r"[;(].*", "", line.upper()) for line in lines_of(text) if len(line) < _LINE)
    found = [line for line in lines if "E" in line and _EXTRUDES.search(line)]
    return bool(found), any(map(_ON_ITS_WAY.search, found))


def lifts(text: str) -> bool:
    """Return whether a program says Z."""
    lines = (line.upper() for line in lines_of(text) if len(line) < _LINE)
    return any(_LIFTS.search(_without_comments(line)) for line in lines)


def bare_line(line: str, machine: Machine) -> str:
    """Return a line in capitals, without comments and the sign of one that may be skipped (/)."""
    if len(line) > _LINE:
        raise machine.fault(f"has {len(line)} characters, expected {_LINE} at most")
    text = _without_comments(line.upper())
    if text.startswith("/"):
        machine.note("lines that may be skipped (/) are read")
    return _translated(text.lstrip("/")).strip()


def says_axis(line: str) -> bool:
    """Return whether a line says the tool's axis by words of Siemens' controls."""
    return _AXIS.search(line.upper()) is not None


def _translated(text: str) -> str:
    """Return a line with words of Siemens' controls as they are called here."""
    for word, code in _TIP:
        text = re.sub(rf"\b{word}\b", code, text)
    return _AXIS.sub(lambda found: f" {_SIEMENS[found[1]]}=", text)


def words_of(text: str, machine: Machine) -> list[tuple[str, str]]:
    """Return the letters of a bare line, each with its number as it is written."""
    words, at = list[tuple[str, str]](), 0
    while at < len(text):
        found = _WORD.match(text, at)
        if not found and _MACRO.search(text):
            raise machine.fault(
                f"'{text[:40]}': variables, expressions and subroutines are not read; let CAM "
                f"write the program out, or run it in a simulator that does"
            )
        if not found and _HEIDENHAIN.match(text):
            raise machine.fault(
                "is in Heidenhain's own language, which is not read: let CAM write ISO G-code, "
                "or APT"
            )
        if not found:
            raise machine.unread(f"'{text[at : at + 40]}'")
        words.append((found[1], found[2]))
        at = found.end()
    return words


def values_of(words: Sequence[tuple[str, str]], machine: Machine) -> dict[str, float]:
    """Return the numbers of all words but G and M, of which a line may have several."""
    values: dict[str, float] = {}
    for letter, value in words:
        if letter in "GM":
            continue
        if letter not in _LETTERS:
            raise machine.unread(f"word '{letter}{value}'")
        if letter in values:
            raise machine.fault(f"word {letter} is there twice")
        if len(value) > 30:
            raise machine.fault(f"{letter} has {len(value)} digits; no machine reads them")
        values[letter] = float(value)
    return values


def _without_comments(line: str) -> str:
    """Return a line without comments: (…), also in each other, ; to its end, and checksums."""
    text, count = line, 1
    while count:
        text, count = re.subn(r"\([^()]*(?:\)|$)", " ", text)
    return re.sub(r"\*[0-9]+\s*$", "", text.partition(";")[0]).strip()
