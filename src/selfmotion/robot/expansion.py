"""Xacro files, expanded by the package xacro."""

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path

from selfmotion.basics import RobotError


def expand(path: Path, arguments: Mapping[str, str]) -> str:
    """Return the URDF text of a xacro file.

    Parameters
    ----------
    path : Path
    arguments : dict
        Values of its ``<xacro:arg>``.

    Raises
    ------
    RobotError
        The file is missing or cannot be expanded; the message says why.
    """
    import xacro

    for key, value in arguments.items():
        if not (isinstance(key, str) and isinstance(value, str | int | float)):
            raise RobotError(f"{path}: arguments has {key!r}: {value!r}, expected a text or number")
    if not path.is_file():
        raise RobotError(f"{path}: no such xacro file")
    mappings = {key: str(value) for key, value in arguments.items()}
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            document = xacro.process_file(str(path), mappings=mappings)
    # A xacro file holds expressions of Python, which may raise anything.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotError(f"{path}: cannot be expanded by xacro: {reason}") from error
    text: str = document.toxml()
    return text
