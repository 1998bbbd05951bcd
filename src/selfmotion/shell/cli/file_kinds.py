"""Kinds of motion files, by suffix and format: messages, programs, and what can be read back.

`form` is the format that is asked for; None for the one that the suffix names.
"""

from pathlib import Path

import selfmotion as sm
from selfmotion.shop import controllers


def is_message(target: Path, form: str | None) -> bool:
    """Whether a file is a message of ROS, which has as few samples as straight lines allow."""
    return _format(target, form) in controllers.MESSAGES


def is_target_program(
    target: Path, form: str | None, settings: sm.files.ProgramSettings | None
) -> bool:
    """Whether a file is a program of targets, which has no rate."""
    name = _format(target, form)
    has_poses = settings is not None and settings.by_poses
    return name in controllers.PROGRAMS.values() or (name == "urscript" and has_poses)


def is_controller_file(target: Path, form: str | None) -> bool:
    """Whether a controller runs the file itself, which then has settings."""
    name = _format(target, form)
    return name == "urscript" or name in controllers.PROGRAMS.values()


def is_readable(target: Path, form: str | None) -> bool:
    """Whether a file can be read back as a motion."""
    return form in controllers.READABLE or (
        form is None and target.suffix.lower() not in (".xml", ".script")
    )


def _format(target: Path, form: str | None) -> str | None:
    return form or controllers.SUFFIXES.get(target.suffix.lower())
