"""Statements of controllers' languages: tables by which programs are both written and read."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

# Parts of a template: a value, a word, a number, another character, or a space.
_PARTS = re.compile(
    r"<(?P<name>\w+)(:(?P<field>\w+))?>|(?P<word>[A-Za-z_$#&.][\w$#&.]*)|(?P<number>\d+)"
    r"|(?P<mark>:=|[^\s<])|(?P<space>\s+)"
)
# Text of a number, of which `Lines.number_of` says whether it is one.
NUMBER = r"[^\s,;(){}\[\]]+"


@dataclass(frozen=True)
class Field:
    """A type of value in statements.

    Attributes
    ----------
    pattern : str
        Regular expression of its text, without groups.
    read : callable
        The reader of a program, the text → the value.
    write : callable
        The value → its text.
    """

    pattern: str
    read: Callable[[Any, str], Any]
    write: Callable[[Any], str] = str


@dataclass(frozen=True)
class Statement:
    """A statement of a language.

    Attributes
    ----------
    kind : str
        What it says: the name of the action that a reader takes.
    template : str
        Its text, with ``<name>`` or ``<name:field>`` in place of each value; a name that is there
        twice is the same value.
    states : tuple of str
        In which states of a reader it may stand.
    then : str
        State of the reader after it; empty where that stays.
    """

    kind: str
    template: str
    states: tuple[str, ...]
    then: str = ""

    @cached_property
    def values(self) -> dict[str, str]:
        """Field of each value, by its name."""
        parts = (part for part in _PARTS.finditer(self.template) if part["name"])
        return {part["name"]: part["field"] or part["name"] for part in parts}


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Statements that are written and read.

    Attributes
    ----------
    fields : mapping
        Types of values, by name.
    statements : sequence of Statement
    is_exact : bool
        Whether all spaces and capitals matter, as in comments that a checksum guards.
    """

    fields: Mapping[str, Field]
    statements: Sequence[Statement]
    is_exact: bool = False

    def text(self, kind: str, **values: Any) -> str:
        """Return the statement of a kind that has these values."""
        statement = self._by_values[kind, frozenset(values)]

        def written(part: re.Match[str]) -> str:
            name = part["name"]
            return self.fields[statement.values[name]].write(values[name]) if name else part[0]

        return _PARTS.sub(written, statement.template)

    def find(self, text: str, state: str) -> tuple[Statement, dict[str, str]] | None:
        """Return the statement that a line is in a state, and the texts of its values.

        Single spaces may be left out beside marks, and capitals do not matter, unless the table is
        exact.
        """
        for statement, pattern in self._patterns:
            match = pattern.fullmatch(text) if state in statement.states else None
            if match:
                return statement, match.groupdict()
        return None

    @cached_property
    def _by_values(self) -> dict[tuple[str, frozenset[str]], Statement]:
        # Of statements with the same values the first is the one that is written.
        statements = reversed(self.statements)
        return {(item.kind, frozenset(item.values)): item for item in statements}

    @cached_property
    def _patterns(self) -> list[tuple[Statement, re.Pattern[str]]]:
        flags = re.NOFLAG if self.is_exact else re.IGNORECASE
        return [(item, re.compile(self._pattern(item), flags)) for item in self.statements]

    def _pattern(self, statement: Statement) -> str:
        """Return the regular expression of a statement: spaces count between words alone."""
        pattern, after_mark, spaced = "", True, False
        for part in _PARTS.finditer(statement.template):
            if part["space"]:
                spaced = True
                pattern += part[0] if self.is_exact else ""
                continue
            is_mark = bool(part["mark"])
            if not self.is_exact:
                pattern += " ?" if pattern and (is_mark or after_mark) else " " * spaced
            after_mark, spaced = is_mark, False
            is_repeated = bool(part["name"]) and f"(?P<{part['name']}>" in pattern
            pattern += f"(?P={part['name']})" if is_repeated else self._part(statement, part)
        return pattern

    def _part(self, statement: Statement, part: re.Match[str]) -> str:
        if part["name"]:
            return f"(?P<{part['name']}>{self.fields[statement.values[part['name']]].pattern})"
        # A whole number may have decimals that are zero.
        is_number = part["number"] and not self.is_exact
        return rf"{part[0]}(?:\.0*)?" if is_number else re.escape(part[0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Language(Table):
    """The statements of a controller's language.

    Attributes
    ----------
    comment : str
        Beginning of a comment.
    last : str
        The last statement of a program.
    outputs : str
        What outputs may be, in words.
    has_output : callable
        Whether the controller has an output.
    """

    comment: str
    last: str
    outputs: str
    has_output: Callable[[str | int], bool]


@cache
def number(digits: str) -> Field:
    """Return the field of numbers that are written in a format, such as ``".4f"``."""
    return Field(NUMBER, _number, lambda value: format(value, digits))


def word(pattern: str) -> Field:
    """Return the field of names and other texts of a pattern."""
    return Field(pattern, lambda _, text: text)


def _number(reader: Any, text: str) -> float:
    return float(reader.lines.number_of(text))


def _seconds(reader: Any, text: str) -> float:
    return float(reader.lines.duration(text))


def _is_true(_: Any, text: str) -> bool:
    return text.upper() in ("TRUE", "1")


def seconds(digits: int) -> Field:
    """Return the field of times [s] with a number of decimals."""
    return Field(NUMBER, _seconds, lambda value: f"{value:.{digits}f}")


def truth(false: str, true: str) -> Field:
    """Return the field of the states of outputs."""
    return Field(f"{false}|{true}", _is_true, lambda value: true if value else false)
