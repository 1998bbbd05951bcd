"""Cutter location data as APT writes it, ISO 4343: the statements that say where a tool goes."""

import re
from collections.abc import Mapping
from pathlib import Path as FilePath

import numpy as np

from selfmotion.formats.cuts import Machine, unit_axis
from selfmotion.formats.path_rows import PoseRows

_INCH, _MM = 25.4e-3, 1e-3
_STATEMENT = re.compile(r"([A-Z][A-Z0-9]{0,7})\s*(?:/(.*))?")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:E[+-]?[0-9]{1,2})?")
_LONGEST = 10_000
_UNITS = {"MM": _MM, "INCH": _INCH, "INCHES": _INCH}
# Feeds by the minute: all others are by turn or time.
_FEEDS = {"MMPM": _MM, "IPM": _INCH, "PERMIN": None}
# What changes nothing here: names, the cutter's shape, tolerances of what is done already.
_NOTHING = (
    *("PARTNO", "PPRINT", "TPRINT", "REMARK", "MACHIN", "MODE", "CUTTER", "INTOL", "OUTTOL"),
    *("LOADTL", "TLDATA", "SELECTL", "TOOLNO", "MULTAX", "PAINT", "OPSKIP", "SEQNO", "RESET"),
)
# What NX writes around its paths.
_OF_NX = ("TOOL PATH", "END-OF-PATH", "MSYS/", "SET/", "LOAD/", "CUTCOM/OFF")
# What happens to other things than the arm: the events of a cut.
_EVENTS = ("SPINDL", "COOLNT", "AUXFUN", "ARCON", "ARCOFF")
_ENDS = ("FINI", "END")


def read_cldata(file: FilePath) -> Mapping[str, PoseRows]:
    """Read the cuts of a file of cutter locations; see `read_path`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or has a statement that is not read; its line is named.
    """
    reader = _Reader(file)
    whole = ""
    for number, line in enumerate(reader.machine.text().splitlines(), 1):
        reader.machine.number = number
        text = line.partition("$$")[0].strip()
        if text.endswith("$"):
            whole += text[:-1] + " "
            if len(whole) > _LONGEST:
                raise reader.machine.fault(f"goes on for more than {_LONGEST} characters")
            continue
        whole, statement = "", whole + text
        if statement.strip() and reader.take(" ".join(statement.upper().split())):
            break
    return reader.machine.seams()


class _Reader:
    """The modes of a file, and the statements that change them."""

    def __init__(self, file: FilePath) -> None:
        self.machine = Machine(file)
        self._unit, self._rapid = _MM, False

    def take(self, text: str) -> bool:
        """Take a statement; return whether it is the last one."""
        machine = self.machine
        if len(text) > _LONGEST:
            raise machine.fault(f"has {len(text)} characters, expected {_LONGEST} at most")
        if text.startswith((*_NOTHING[:4], *_OF_NX)):
            return False
        found = _STATEMENT.fullmatch(text)
        if not found:
            raise machine.unread(f"'{text[:60]}'")
        word, rest = found[1], found[2] or ""
        given = [item.strip() for item in rest.split(",")] if rest else []
        match word:
            case "GOTO" | "FROM" | "GODLTA":
                self._go(word, given)
            case "RAPID":
                self._rapid = True
            case "FEDRAT":
                self._feed(given)
            case "UNITS":
                if len(given) != 1 or given[0] not in _UNITS:
                    raise machine.fault(f"UNITS/{rest[:40]}: expected MM or INCHES")
                self._unit = _UNITS[given[0]]
            case "MODE" if "INCR" in given:
                raise machine.fault(
                    "MODE/INCR: places by differences are not read; write MODE/ABSOL"
                )
            case _ if word in _EVENTS:
                machine.happens(f"{word}/{','.join(given)}" if given else word)
            case _ if word in _ENDS:
                return True
            case _ if word not in _NOTHING:
                raise machine.unread(f"statement '{word}'")
        return False

    def _go(self, word: str, given: list[str]) -> None:
        machine = self.machine
        values = [self._number(text) for text in given]
        if len(values) not in (3, 6) or (word == "GODLTA" and len(values) != 3):
            raise machine.fault(f"{word} has {len(values)} numbers, expected x,y,z or x,y,z,i,j,k")
        position = self._unit * np.array(values[:3])
        if word == "GODLTA":
            if np.isnan(machine.position).any():
                raise machine.fault("GODLTA goes on from a place that is not known yet")
            position = position + machine.position
        axis = unit_axis(values[3:], machine) if len(values) == 6 else machine.axis
        if self._rapid or word == "FROM":
            machine.rapid(position, axis)
        else:
            machine.cut(position, axis)
        self._rapid = False

    def _feed(self, given: list[str]) -> None:
        units = [item for item in given if item in _FEEDS]
        numbers = [item for item in given if item not in _FEEDS]
        if len(numbers) != 1 or len(units) > 1:
            raise self.machine.fault(
                f"FEDRAT/{','.join(given)[:40]}: expected a feed, and MMPM or IPM"
            )
        scale = _FEEDS[units[0]] if units else None
        feed = self._number(numbers[0]) * (scale or self._unit) / 60.0
        if not 0.0 < feed < 1e3:
            raise self.machine.fault(f"FEDRAT/{numbers[0]}: expected a feed above 0")
        self.machine.feed = feed

    def _number(self, text: str) -> float:
        if not _NUMBER.fullmatch(text) or len(text) > 40:
            raise self.machine.fault(f"'{text[:40]}' is no number")
        return float(text)
