"""Lines of programs of controllers, and the numbers in them."""

import re
from collections.abc import Iterator
from pathlib import Path as FilePath

from selfmotion.basics import FileFormatError, lines_of, text_of

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
