"""The exceptions of the package, and names that were probably meant."""

import re
from collections.abc import Iterable
from difflib import get_close_matches

__all__ = [
    "BreakdownError",
    "CollisionError",
    "DeadlineError",
    "FeedError",
    "FileFormatError",
    "FormerUseWarning",
    "InverseKinematicsError",
    "NoSequenceError",
    "PathError",
    "PlanError",
    "ProblemError",
    "RedundancyError",
    "RenderError",
    "RobotError",
    "StartError",
]


def nearest(name: str, names: Iterable[str], alike: float = 0.5) -> str:
    """Return "; nearest: 'a', 'b'" with the names that are like `name`, "" where none is."""
    by_lower = {each.lower(): each for each in names}
    near = get_close_matches(str(name).lower(), by_lower, cutoff=alike)
    return f"; nearest: {', '.join(repr(by_lower[each]) for each in near)}" if near else ""


# The exceptions of the package; besides them, ValueError for a time, order or rate out of range.
#
# ::
#
#     SelfmotionError
#     ├── RobotError                a URDF, frame, joint or configuration that cannot be used
#     ├── PathError                 a tool motion that is malformed or not followable as given
#     │   └── FeedError             a feed that no motion along the path has, whatever the arm
#     ├── ProblemError              robot, path, task and start do not fit together
#     │   ├── RedundancyError       no self-motion is left by the task
#     │   └── StartError            the start configuration is off the path
#     ├── InverseKinematicsError    no configuration found for a pose
#     ├── CollisionError            an obstacle, SRDF or geometry that cannot be checked
#     ├── BreakdownError            the motion runs into a singular pose
#     ├── NoSequenceError           no chain of configurations follows the path
#     ├── FileFormatError           a file that is not what it should be
#     ├── RenderError               no browser to draw a picture of a replay with
#     └── PlanError                 a plan without the quality asked for (`Plan.require`)
#
# Each message names the thing, what was found, what was expected and what to do about it.

# Longest word in a message: longer ones come from damaged files, and are cut in the middle.
_WORD = 120
# Longest message, likewise.
_MESSAGE = 1500


class SelfmotionError(Exception):
    """Root of the package's exceptions."""

    def __init__(self, message: str = "") -> None:
        super().__init__(_legible(str(message)))


def _legible(message: str) -> str:
    """Return a message without control codes and endless words, which a file may contain."""
    plain = "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)
    words = re.sub(rf"[^\s/]{{{_WORD},}}", lambda found: _ends(found.group(), _WORD), plain)
    return _ends(words, _MESSAGE)


def _ends(text: str, length: int) -> str:
    """Return a text, or its beginning and end if it is longer."""
    if len(text) <= length:
        return text
    return f"{text[: length // 2]} … {text[-length // 3 :]}"


class RobotError(SelfmotionError):
    """A URDF, frame, joint or configuration that cannot be used."""


class PathError(SelfmotionError):
    """A tool motion that is malformed or cannot be followed as given."""


class FeedError(PathError):
    """A feed that no motion along the path has, whatever the arm.

    Attributes
    ----------
    asked : float
        [m/s].
    possible : float or None
        The feed that can be had instead [m/s]; None where none was found.
    time : float
        Where the tool is slowest, by the time of the path [s].
    """

    def __init__(self, message: str, *, asked: float, possible: float | None, time: float) -> None:
        super().__init__(message)
        self.asked = asked
        self.possible = possible
        self.time = time


class FormerUseWarning(FutureWarning):
    """Something was said in a way that goes with the next version; the text says the new one."""

    def __init__(self, message: str = "") -> None:
        super().__init__(message)


class ProblemError(SelfmotionError):
    """Robot, path, task and start do not fit together."""


class RedundancyError(ProblemError):
    """No self-motion is left by the task.

    Attributes
    ----------
    dof, rows : int
        Joints of the arm and rows of the task.
    """

    def __init__(self, message: str, *, dof: int, rows: int) -> None:
        super().__init__(message)
        self.dof = dof
        self.rows = rows


class StartError(ProblemError):
    """The start configuration does not put the tool on the start of the path.

    Attributes
    ----------
    position_miss : float
        Distance from the path's first position [m].
    rotation_miss : float
        Angle from the path's first orientation, in the rows the task prescribes [rad].
    """

    def __init__(self, message: str, *, position_miss: float, rotation_miss: float) -> None:
        super().__init__(message)
        self.position_miss = position_miss
        self.rotation_miss = rotation_miss


class InverseKinematicsError(SelfmotionError):
    """No configuration within the joint limits reaches the pose.

    Attributes
    ----------
    position_miss, rotation_miss : float
        Errors of the best attempt [m], [rad].
    """

    def __init__(self, message: str, *, position_miss: float, rotation_miss: float) -> None:
        super().__init__(message)
        self.position_miss = position_miss
        self.rotation_miss = rotation_miss


class CollisionError(SelfmotionError):
    """An obstacle, SRDF or collision geometry that cannot be used; the message names it."""


class BreakdownError(SelfmotionError):
    """Eq. 4 cannot be integrated: the task Jacobian loses rank within the path.

    Attributes
    ----------
    time : float
        When it happens [s].
    """

    def __init__(self, message: str, *, time: float) -> None:
        super().__init__(message)
        self.time = time


class NoSequenceError(SelfmotionError):
    """No chain of configurations follows the path within limits, clearances and step limits.

    Attributes
    ----------
    time : float
        The waypoint [s] that no chain reaches.
    reason : str
        Why: no configuration there, joint limits, collisions or the step limit, with names.
    """

    def __init__(self, message: str, *, time: float, reason: str) -> None:
        super().__init__(message)
        self.time = time
        self.reason = reason


class FileFormatError(SelfmotionError):
    """An invalid file; the message names the file and the row or key."""


class RenderError(SelfmotionError):
    """A replay cannot be drawn as a picture: no browser, or it fails."""


class PlanError(SelfmotionError):
    """A plan below the required quality; raised by `Plan.require`."""


class DeadlineError(PlanError):
    """The deadline came before there was anything to return."""
