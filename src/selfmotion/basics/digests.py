"""What tells values apart, and the version of the package that made them."""

import hashlib
import marshal
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics.files import is_file

# Of the format of marshal: the last one that writes equal values as equal bytes.
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
        # Long lists are of numbers: looking at each would take longer than all the rest.
        if all(type(item) is float for item in value):
            return tuple(value)
        return tuple(_plain(item) for item in value)
    return value


@cache
def version() -> str:
    """Return the version of the package."""
    return metadata.version("selfmotion")
