"""Several archives in one file."""

import hashlib
import json
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import (
    FileFormatError,
    digest_of_file,
    write_atomically,
)
from selfmotion.planning.result.archive import OtherVersionError, check_version, file_digest
from selfmotion.planning.result.move import Move, load_move
from selfmotion.planning.result.plan import Plan, load_plan

# Largest size of a bundle that is read [bytes].
_LARGEST = 2_000_000_000
_NAME = "bundle.json"


def write_bundle(
    file: FilePath,
    kind: str,
    version: int,
    description: Mapping[str, Any],
    items: Sequence[Plan | Move],
) -> None:
    """Write plans and moves, and further values, to one file; atomically.

    Parameters
    ----------
    file : FilePath
    kind : str
        Its kind, for readers: ``"program"``.
    version : int
        Raised with every change that older versions cannot read.
    description : mapping
        JSON-safe.
    made : sequence of Plan or Move
        Plans and moves.
    """

    def write(stream: Any) -> None:
        # Its members are compressed already.
        with zipfile.ZipFile(stream, "w") as archive, tempfile.TemporaryDirectory() as folder:
            members = []
            for number, item in enumerate(items):
                member = FilePath(folder, _member(number))
                item.save(member)
                members.append({"plan": isinstance(item, Plan), "digest": digest_of_file(member)})
                archive.write(member, member.name)
            whole = {"kind": kind, "version": version, "members": members, **description}
            archive.writestr(_NAME, json.dumps({**whole, "digest": file_digest(whole, {})}))

    write_atomically(file, write)


def read_bundle(
    file: FilePath, kind: str, version: int
) -> tuple[dict[str, Any], list[Plan | Move], bool]:
    """Return the content of a bundle, judged anew, and whether the file was changed.

    Raises
    ------
    FileFormatError
        The file is missing, is of another kind, lacks something, or was written by another version.
    """
    try:
        with zipfile.ZipFile(file) as archive, tempfile.TemporaryDirectory() as folder:
            if sum(item.file_size for item in archive.infolist()) > _LARGEST:
                raise ValueError(f"it unpacks to more than {_LARGEST:g} bytes")
            description: dict[str, Any] = json.loads(archive.read(_NAME))
            if description["kind"] != kind:
                raise ValueError(f"it is a {description['kind']}, expected a {kind}")
            check_version(file, kind, description["version"], version)
            changed = description.pop("digest", None) != file_digest(description, {})
            items, known = list[Plan | Move](), dict[str, Any]()
            for number, item in enumerate(description["members"]):
                data = archive.read(_member(number))
                changed |= hashlib.sha256(data).hexdigest() != item["digest"]
                member = FilePath(folder, _member(number))
                member.write_bytes(data)
                load = load_plan if item["plan"] else load_move
                items.append(load(member, known=known))
    except FileNotFoundError:
        raise FileFormatError(f"{file}: no such file") from None
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror or error}") from error
    except OtherVersionError:
        raise
    # Any number or key of a damaged file may be any other, and fail anywhere.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileFormatError(f"{file}: is no {kind}, or a damaged one: {reason}") from error
    if not items:
        raise FileFormatError(f"{file}: is no {kind}, or a damaged one: it holds no motion")
    return description, items, changed


def _member(number: int) -> str:
    return f"{number:04d}.npz"
