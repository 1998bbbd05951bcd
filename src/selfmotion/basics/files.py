"""Archives and tables on disk: written atomically, read with errors that name the place."""

import json
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from selfmotion.basics.arrays import Array, shown
from selfmotion.basics.errors import FileFormatError

_DESCRIPTION = "description"


def write_atomically(file: Path, write: Callable[[IO[bytes]], None]) -> None:
    """Let `write` fill a temporary file beside `file`, then put it in place.

    Raises
    ------
    FileFormatError
        The folder cannot be written to.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be written: {error}") from error
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
        # mkstemp makes the file private; give it what a newly created file would have.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(file)
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be written: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_archive(file: Path, description: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Write a JSON description and named arrays to one ``.npz`` file."""
    text = np.frombuffer(json.dumps(description).encode(), dtype=np.uint8)
    contents: dict[str, Any] = {_DESCRIPTION: text, **arrays}

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(stream, **contents)

    write_atomically(file, write)


def read_archive(file: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read what `write_archive` wrote.

    Raises
    ------
    FileFormatError
        The file is missing or is no such archive.
    """
    if file.exists() and not zipfile.is_zipfile(file):
        raise FileFormatError(f"{file}: is no plan written by selfmotion (.npz)")
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        description = json.loads(arrays.pop(_DESCRIPTION).tobytes())
    except FileNotFoundError:
        raise FileFormatError(f"{file}: no such file") from None
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{file}: is no plan written by selfmotion: {error}") from error
    return description, arrays


def write_csv(file: Path, header: Sequence[str], table: Array) -> None:
    """Write a table with a header line, numbers with all their digits."""

    def write(stream: IO[bytes]) -> None:
        stream.write((",".join(header) + "\n").encode())
        for row in table.tolist():
            stream.write((",".join(map(repr, row)) + "\n").encode())

    write_atomically(file, write)


def read_table(file: Path) -> tuple[list[str], Array]:
    """Read a table of numbers with a header line: names and values of `read_rows`."""
    names, values, _ = read_rows(file)
    return names, values


def as_path(file: Any) -> Path:
    """Return the path of a file; FileFormatError unless it is a text or a path."""
    if not isinstance(file, str | Path):
        raise FileFormatError(f"file is {shown(file)}, expected the path of a file")
    return Path(file)


def read_rows(file: Path) -> tuple[list[str], Array, list[int]]:
    """Read a table of numbers with a header line, and tell on which line each row stands.

    Columns are separated by comma, semicolon or tab, whichever the header has; lines that begin
    with # and empty ones are left out, a byte order mark is not seen.

    Returns
    -------
    names : list of str
    values : (N, C)
    lines : list of int

    Raises
    ------
    FileFormatError
        The file cannot be read, has no rows, a name twice, or a row that is short, long or not
        numeric; the line is named.
    """
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{file}: cannot be read: {error}") from error
    kept = [(k, line) for k, line in enumerate(lines, 1) if line.strip() and line[0] != "#"]
    if not kept:
        raise FileFormatError(f"{file}: is empty, expected a header line and rows of numbers")
    mark = max(",;\t", key=kept[0][1].count)
    names = [name.strip().strip('"') for name in kept[0][1].split(mark)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise FileFormatError(f"{file}: line {kept[0][0]}: column '{twice[0]}' appears twice")
    rows, numbers = [], []
    for number, line in kept[1:]:
        cells = line.split(mark)
        if len(cells) != len(names):
            raise FileFormatError(
                f"{file}: line {number} has {len(cells)} values, expected {len(names)}"
            )
        try:
            rows.append([_number(cell) for cell in cells])
            numbers.append(number)
        except ValueError as error:
            raise FileFormatError(f"{file}: line {number}: {error}") from error
    return names, np.array(rows, dtype=np.float64).reshape(-1, len(names)), numbers


def _number(cell: str) -> float:
    """Return the number in a cell; Python's 1_0 is none."""
    if "_" in cell:
        raise ValueError(f"could not convert string to float: {cell.strip()!r}")
    return float(cell)
