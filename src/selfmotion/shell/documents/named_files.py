"""Files that documents name: from the folder of the document, whoever writes it."""

import os
from pathlib import Path
from typing import Any

# Keys whose values are names of files or folders, looked for beside the document.
FILE_KEYS = ("calibration", "file", "joint_limits", "mesh", "outputs", "packages", "srdf")


def named_from(value: Any, old: Path, new: Path, key: str = "") -> Any:
    """Return a document whose files, named from a folder, are named from another one.

    Parameters
    ----------
    value : document, or a part of one
    old, new : Path
        Absolute folders: where names are looked for, and where the document will be.
    key : str
        Of the value.
    """
    if isinstance(value, dict):
        is_files = key in FILE_KEYS
        return {
            name: named_from(item, old, new, key if is_files else name)
            for name, item in value.items()
        }
    if isinstance(value, list):
        return [named_from(item, old, new, key) for item in value]
    if key in FILE_KEYS and isinstance(value, str) and not Path(value).is_absolute():
        return Path(os.path.relpath(old / value, new)).as_posix()
    return value
