"""What finished work is kept under: a digest of all that decides what comes of it."""

from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from typing import Any

from selfmotion.basics import digest_of, digest_of_file, version
from selfmotion.collision import Obstacle
from selfmotion.constraints import Clearance, Constraint
from selfmotion.robot import RobotModel, mesh_digests


def key_of(asked: Any, files: Any) -> str:
    """Return the digest of what was asked for, as JSON-safe values, and of the files it reads.

    And of the package's version: what another one made is made again.
    """
    return digest_of(version(), asked, files)


def files_of(
    robot: RobotModel, constraints: Sequence[Constraint], known: MutableMapping[str, Any]
) -> dict[str, str]:
    """Return the SHA-256 of each mesh file that bodies are made of; "" for one that is missing.

    Those of an arm are read once, and put into what is `known`.
    """
    own = f"meshes of {robot.urdf.sha256}"
    if own not in known:
        known[own] = mesh_digests(robot.urdf, "collision")
    bodies = (body for item in constraints for body in _bodies(item, robot))
    given = {str(file): digest_of_file(file) for body in bodies for file in body.files}
    return {**known[own], **given}


def _bodies(item: Constraint, robot: RobotModel) -> Iterator[Obstacle]:
    # Its requirement makes bodies, which takes a good part of a second.
    yield from item.obstacles if isinstance(item, Clearance) else item.requirement(robot).obstacles


class Made(dict[str, Any]):
    """Arms and bodies that this process made before, by their description; see `load_plan`.

    Forgotten when there are many, or a file that they were made of is another.
    """

    _MANY = 64

    def __init__(self) -> None:
        super().__init__()
        self._files: dict[str, str] = {}

    def of(self, files: Mapping[str, str]) -> "Made":
        """Return itself, for work whose bodies are made of files with these digests."""
        changed = any(self._files.get(name, digest) != digest for name, digest in files.items())
        if changed or len(self) > self._MANY:
            self.clear()
        self._files.update(files)
        return self
