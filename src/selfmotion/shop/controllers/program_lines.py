"""Lines of programs of controllers, and the numbers in them."""

import re
from collections.abc import Iterator
from pathlib import Path as FilePath

from selfmotion.basics import FileFormatError, lines_of, text_of

# Largest size of a controller's file [bytes].
_BYTES = 50_000_000
# Longest line of such a file [characters].
_LINE = 2000
# Bound of all numbers in it, in any unit: 9E9, by which ABB says that an axis is absent, is below.
_NUMBER_BOUND = 1e10
# Largest coordinate or time in it [mm, degrees or s].
_MAX_QUANTITY = 1e7
# Characters that end lines in other programs; a controller's file has none.
_STRANGE = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")
# Beginning of comments that name events.
_EVENT = "event: "
# Longest text of a number [characters].
_MAX_DIGITS = 40
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
        self.file, self._mark = file, comment
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
        return FileFormatError(f"{self.file}: line {self.number}: {what}")

    def number_of(self, text: str) -> float:
        """Return the number that a text is, below 1e10 in size."""
        digits = text.strip()
        if not _NUMBER.fullmatch(digits) or len(digits) > _MAX_DIGITS:
            raise self.fault(f"'{digits[:_MAX_DIGITS]}' is no number, such as -12.5 or 1E3")
        value = float(digits)
        if abs(value) >= _NUMBER_BOUND:
            raise self.fault(f"number {digits} is too large, expected less than {_NUMBER_BOUND:g}")
        return value

    def coordinate(self, text: str) -> float:
        """Return a coordinate in degrees or mm, as it is."""
        value = self.number_of(text)
        if abs(value) > _MAX_QUANTITY:
            raise self.fault(
                f"coordinate {value:g} is too large, expected {_MAX_QUANTITY:g} at most"
            )
        return value

    def duration(self, text: str) -> float:
        """Return a time [s] that is above 0."""
        value = self.number_of(text)
        if not 0.0 < value <= _MAX_QUANTITY:
            raise self.fault(
                f"time is {value:g} s, expected a number above 0, {_MAX_QUANTITY:g} at most"
            )
        return value
