"""Files written atomically and read with errors that name the place, and digests of values."""

import codecs
import hashlib
import json
import marshal
import math
import os
import re
import stat
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import IO, Any

import numpy as np

from selfmotion.basics.arrays import Array, shown
from selfmotion.basics.errors import FileFormatError

_DESCRIPTION = "description"
# Suffixes of files with several plans.
_OF_MANY = (".program", ".parts")
# Suffixes of what is saved whole.
ARCHIVE_SUFFIXES = (".npz", *_OF_MANY)
# Suffixes of problem and job files.
DOCUMENT_SUFFIXES = (".toml", ".json", ".yaml", ".yml")
# Largest file of arrays that is read [bytes]: 250,000 samples of a plan are a tenth.
_LARGEST = 250_000_000
# Characters of texts besides letters: blanks, ends of lines, pages, tapes and files.
_BLANKS = "\t\n\v\f\r\x11\x13\x1a\x1c\x1d\x1e\x1f"


def is_file(path: Path) -> bool:
    """Whether there is a file; no for impossible names, such as long ones."""
    return os.path.isfile(path)


def is_folder(path: Path) -> bool:
    """Whether there is a folder, as `is_file`."""
    return os.path.isdir(path)


def write_atomically(file: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let `write` fill a temporary file beside `file`, then put it in place.

    A symbolic link is kept, and its target is written; a file keeps its mode.

    Raises
    ------
    FileFormatError
        The folder cannot be written to.
    """
    try:
        place = Path(os.path.realpath(file)) if file.is_symlink() else file
        place.parent.mkdir(parents=True, exist_ok=True)
        mode = stat.S_IMODE(place.stat().st_mode) if place.exists() else None
        handle, name = tempfile.mkstemp(dir=place.parent, prefix=f".{place.name}.")
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be written: {error}") from error
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
        if mode is None:
            # mkstemp makes the file private; the mode is that of a new file.
            mask = os.umask(0)
            os.umask(mask)
            mode = 0o666 & ~mask
        temporary.chmod(mode)
        temporary.replace(place)
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be written: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(file: Path, data: bytes) -> None:
    """Write a file, atomically."""
    write_atomically(file, lambda stream: stream.write(data))


def write_text(file: Path, text: str) -> None:
    """Write a text file, atomically."""
    write_bytes(file, text.encode())


def text_of(file: Path, content: bytes) -> str:
    """Return the text of a file: in UTF-8, in UTF-16 with its mark, or in letters of one byte each.

    Other encodings (Latin-1, Windows) of other machines occur in comments and units, such as °;
    nothing else of a table or a program is beyond ASCII.

    Raises
    ------
    FileFormatError
        It holds bytes that no text has.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    odd = next((letter for letter in text if letter < " " and letter not in _BLANKS), None)
    if odd is not None:
        raise FileFormatError(f"{file}: is no text: it has a byte {ord(odd)}")
    return text


# Ends of lines of a file: Python also splits at others, which comments may contain.
_LINE_END = re.compile(r"\r\n|\n|\r")


def lines_of(text: str) -> list[str]:
    """Return the lines of a text of a file, as machines that read it end them."""
    return _LINE_END.split(text)


def write_archive(file: Path, description: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Write a JSON description and named arrays to one ``.npz`` file."""
    text = np.frombuffer(json.dumps(description).encode(), dtype=np.uint8)
    contents: dict[str, Any] = {_DESCRIPTION: text, **arrays}

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(stream, **contents)

    write_atomically(file, write)


def read_archive(file: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read an archive of `write_archive`.

    Raises
    ------
    FileFormatError
        The file is missing or is no such archive.
    """
    if file.suffix in _OF_MANY and os.path.exists(file):
        raise FileFormatError(
            f"{file}: holds several plans, expected one (.npz); of a program they are "
            f"[step.made for step in sm.load_program(file).steps if step.is_seam]"
        )
    if os.path.exists(file) and not zipfile.is_zipfile(file):
        is_document = file.suffix in DOCUMENT_SUFFIXES
        hint = "; `selfmotion plan` makes one of a problem file, `selfmotion job` of a job file"
        what = f"{file}: is no plan written by selfmotion (.npz)"
        raise FileFormatError(f"{what}{hint if is_document else ''}")
    arrays = read_arrays(file)
    if _DESCRIPTION not in arrays:
        raise FileFormatError(f"{file}: is no plan written by selfmotion: it has no description")
    try:
        description = json.loads(arrays.pop(_DESCRIPTION).tobytes())
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: is no plan written by selfmotion: {error}") from error
    if not isinstance(description, dict):
        raise FileFormatError(f"{file}: is no plan written by selfmotion: its description is none")
    return description, arrays


def read_arrays(file: Path) -> dict[str, Array]:
    """Return the arrays of an ``.npz`` file by name, or that of an ``.npy`` file as ``""``.

    Raises
    ------
    FileFormatError
        The file is missing, damaged, holds objects, or says that it holds more than it does, or
        more than this reads.
    """
    try:
        if file.suffix != ".npz":
            with file.open("rb") as stream:
                return {"": _read_array(stream, file.stat().st_size, "")}
        with zipfile.ZipFile(file) as archive:
            sizes = {item.filename: item.file_size for item in archive.infolist()}
            if sum(sizes.values()) > _LARGEST:
                raise ValueError(f"it unpacks to {sum(sizes.values()):.3g} bytes")
            arrays = {}
            for member, size in sizes.items():
                with archive.open(member) as packed:
                    arrays[member.removesuffix(".npy")] = _read_array(packed, size, member)
            return arrays
    except FileNotFoundError:
        raise FileFormatError(f"{file}: no such file") from None
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    # Damaged archives, heads and bodies raise several exceptions.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        what = "NumPy arrays" if file.suffix == ".npz" else "a NumPy array"
        raise FileFormatError(f"{file}: cannot be read as {what}: {reason}") from error


def _read_array(stream: Any, size: int, name: str) -> Array:
    """Return an array of a stream of `size` bytes; ValueError if its head has another size."""
    form = np.lib.format
    reads = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
    version = form.read_magic(stream)
    if version not in reads:
        raise ValueError(f"{name}: its format {version} is not known")
    shape, fortran, kind = reads[version](stream)
    if kind.hasobject:
        raise ValueError(f"{name}: holds objects of Python, expected numbers")
    announced = math.prod(shape) * kind.itemsize
    # Before memory is allocated for the announced size.
    if min(shape, default=0) < 0 or announced > min(size, _LARGEST):
        raise ValueError(f"{name}: announces an array of shape {shape}, which it does not hold")
    body = stream.read(announced)
    if len(body) < announced:
        raise ValueError(f"{name}: ends after {len(body)} of {announced} bytes")
    flat: Any = np.frombuffer(body, dtype=kind, count=math.prod(shape)).copy()
    return np.asarray(flat.reshape(shape, order="F" if fortran else "C"))


def write_csv(file: Path, header: Sequence[str], table: Array) -> None:
    """Write a table with a header line, numbers with all their digits.

    Titles with a comma or a quotation mark are in quotation marks, as in RFC 4180.
    """
    lines = [",".join(map(_title, header)), *(",".join(map(repr, row)) for row in table.tolist())]
    write_text(file, "\n".join(lines) + "\n")


def _title(name: str) -> str:
    quoted = '"' + name.replace('"', '""') + '"'
    return quoted if set(name) & set(",;\t\"'([") or name != name.strip() else name


def as_path(file: Any) -> Path:
    """Return the path of a file; FileFormatError unless it is a text or a path."""
    if not isinstance(file, str | Path):
        raise FileFormatError(f"file is {shown(file)}, expected the path of a file")
    return Path(file)


# Version of the format of marshal: the last one that writes equal values as equal bytes.
_PLAIN = 2


def digest_of(*values: Any) -> str:
    """Return a digest of numbers, texts, arrays, and lists and mappings of them: 64 characters.

    Equal values have equal digests, to the last bit of each number.
    """
    found = hashlib.sha256()
    for value in values:
        found.update(marshal.dumps(_plain(value), _PLAIN))
    return found.hexdigest()


def digest_of_file(file: Path) -> str:
    """Return the SHA-256 of a file; "" for one that is missing."""
    return hashlib.sha256(file.read_bytes()).hexdigest() if is_file(file) else ""


def _plain(value: Any) -> Any:
    """Return a value in which everything equal is written alike."""
    if isinstance(value, np.ndarray):
        return str(value.dtype), value.shape, np.ascontiguousarray(value).tobytes()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return tuple((str(key), _plain(value[key])) for key in sorted(value, key=str))
    if isinstance(value, list | tuple):
        # Long lists are of numbers: a type check of each is fastest.
        if all(type(item) is float for item in value):
            return tuple(value)
        return tuple(_plain(item) for item in value)
    return value


@cache
def version() -> str:
    """Return the version of the package."""
    return metadata.version("selfmotion")
