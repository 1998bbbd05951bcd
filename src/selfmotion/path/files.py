"""Paths from their JSON-safe description."""

from collections.abc import Mapping
from typing import Any

from selfmotion.basics import FileFormatError
from selfmotion.path.base import Path
from selfmotion.path.retimed import Retimed
from selfmotion.path.shapes import Circle, Line
from selfmotion.path.truncated import Truncated
from selfmotion.path.twist import TwistPath
from selfmotion.path.waypoints import Waypoints


def path_from_dict(description: Mapping[str, Any]) -> Path:
    """Return the path that `Path.to_dict` described.

    Raises
    ------
    FileFormatError
        The kind is unknown, or a key is missing or unknown.
    """
    arguments = dict(description)
    kind = arguments.pop("kind", None)
    makers = {
        "line": Line,
        "circle": Circle,
        "twist": TwistPath._restore,
        "waypoints": Waypoints,
        "retimed": _retimed,
        "truncated": _truncated,
    }
    if kind not in makers:
        raise FileFormatError(f"path kind is {kind!r}, expected one of: {', '.join(makers)}")
    try:
        return makers[kind](**arguments)  # type: ignore[operator, no-any-return]
    except TypeError as error:
        raise FileFormatError(f"path of kind '{kind}': {error}") from error


def _retimed(path: Mapping[str, Any], **arguments: Any) -> Retimed:
    return Retimed(path_from_dict(path), **arguments)


def _truncated(path: Mapping[str, Any], **arguments: Any) -> Truncated:
    return Truncated(path_from_dict(path), **arguments)
