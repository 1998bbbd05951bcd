"""Archives and tables on disk: written atomically, read with errors that name the place."""

import json
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from selfmotion.basics.arrays import Array
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
