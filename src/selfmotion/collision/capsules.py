"""Capsules around the links, as small as the optimisation of each finds."""

import hashlib
import math
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, read_only
from selfmotion.collision.outlines import Outline, join, outline
from selfmotion.robot import RobotModel

# Part of the cached files' names: raise it when the same outline is to be fitted otherwise.
_VERSION = 1


@dataclass(frozen=True, eq=False)
class LinkCapsule:
    """All points within `radius` of a segment that moves with a joint.

    Attributes
    ----------
    link : str
        The link it contains, or a part of which.
    joint : int
        Index of the joint that carries it; 0 for the immovable base.
    middle, half : (3,)
        The segment is middle ± half, in the joint's axes [m].
    radius : float
        [m]
    """

    link: str
    joint: int
    middle: Array
    half: Array
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "middle", read_only(self.middle))
        object.__setattr__(self, "half", read_only(self.half))

    @property
    def volume(self) -> float:
        """Its volume [m³]."""
        return capsule_volume(2.0 * float(np.linalg.norm(self.half)), self.radius)


def _link_outlines(robot: RobotModel) -> dict[tuple[str, int], Outline]:
    """Return the outline of each link's collision geometry in its joint's axes.

    Keys are the link and the index of its joint.
    """
    pieces: dict[tuple[str, int], list[Outline]] = {}
    for piece in robot.geometry(pin.GeometryType.COLLISION).geometryObjects:
        key = robot.model.frames[piece.parentFrame].name, piece.parentJoint
        pieces.setdefault(key, []).append(outline(piece.geometry).moved(piece.placement))
    return {key: join(parts) for key, parts in pieces.items()}


def link_capsules(robot: RobotModel) -> tuple[LinkCapsule, ...]:
    """Return capsules that contain the collision geometry of every link.

    A link gets up to three, in slabs along one of its principal axes, when each further one takes
    away a quarter of the volume. Fits are kept in the user's cache folder, by a digest of the
    outline; where it cannot be written, they are repeated.

    Raises
    ------
    RobotError
        A mesh of the robot is missing.
    """
    capsules = []
    for (link, joint), shape in _link_outlines(robot).items():
        for ends in _fit_or_load(shape):
            capsules.append(LinkCapsule(link, joint, ends[:3], ends[3:6], float(ends[6])))
    return tuple(capsules)


def capsule_volume(length: float, radius: float) -> float:
    """Return the volume [m³] of a capsule around a segment of that length [m]."""
    return math.pi * radius**2 * (length + 4.0 / 3.0 * radius)


def _fit_or_load(shape: Outline) -> Array:
    digest = hashlib.sha256(f"{_VERSION}".encode())
    for array in (shape.points, shape.radii, shape.edges):
        digest.update(np.ascontiguousarray(array).tobytes())
    folder = _cache_folder()
    file = None if folder is None else folder / f"capsules-{digest.hexdigest()[:32]}.npy"
    if file is not None:
        stored = _load(file)
        if stored is not None:
            return stored
    # Here, because what is in the cache needs no compiler.
    from selfmotion.collision.fit import fit

    capsules = fit(shape)
    if file is not None:
        _store(file, capsules)
    return capsules


def _cache_folder() -> Path | None:
    """Return the folder for what can be computed again, or None where there is no home."""
    folder = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(folder) if folder else Path.home() / ".cache") / "selfmotion"
    except RuntimeError:
        return None


def _load(file: Path) -> Array | None:
    """Return stored capsules, or None where there are none or the file is damaged."""
    try:
        capsules = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    sound = capsules.ndim == 2 and capsules.shape[1] == 7 and np.isfinite(capsules).all()
    return capsules if sound else None


def _store(file: Path, capsules: Array) -> None:
    """Write under another name first: two processes may fit the same link at once."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as stream:
            np.save(stream, capsules)
        os.replace(stream.name, file)
    except OSError:
        return  # the next run fits again
