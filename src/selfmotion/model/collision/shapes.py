"""The shapes of obstacles that come with the package."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import coal
import numpy as np
from typing_extensions import override

from selfmotion.basics import (
    Array,
    CollisionError,
    as_numbers,
    is_file,
    read_only,
    shown,
)
from selfmotion.model.collision.obstacles import Obstacle
from selfmotion.model.robot import UrdfShape, says_unit, unit_of

# A mesh that is longer than this is in millimetres [m].
_LONGEST = 20.0


@dataclass(frozen=True, eq=False)
class Box(Obstacle):
    """A solid box, its centre at the pose.

    Attributes
    ----------
    size : (3,)
        Full lengths along the pose's axes [m].
    """

    shape: ClassVar[str] = "box"

    size: Array

    def __post_init__(self) -> None:
        super().__post_init__()
        expected = "three numbers above 0"
        size = as_numbers(self.size, f"{self.label}: size", expected, (3,), CollisionError)
        if not np.all((size > 0.0) & (size <= 1e6)):
            raise CollisionError(f"{self.label}: size is {size.tolist()}, expected {expected}")
        object.__setattr__(self, "size", read_only(size))

    @override
    def geometry(self) -> Any:
        return coal.Box(*self.size.tolist())

    @override
    def urdf_shapes(self) -> Sequence[UrdfShape]:
        return [UrdfShape("box", {"size": " ".join(map(repr, self.size.tolist()))})]


@dataclass(frozen=True, eq=False)
class Sphere(Obstacle):
    """A solid sphere.

    Attributes
    ----------
    radius : float
        [m]
    """

    shape: ClassVar[str] = "sphere"

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_length("radius")

    @override
    def geometry(self) -> Any:
        return coal.Sphere(self.radius)

    @override
    def urdf_shapes(self) -> Sequence[UrdfShape]:
        return [UrdfShape("sphere", {"radius": repr(self.radius)})]


@dataclass(frozen=True, eq=False)
class Cylinder(Obstacle):
    """A solid cylinder, its centre at the pose and its axis along the pose's z.

    Attributes
    ----------
    radius, length : float
        [m]
    """

    shape: ClassVar[str] = "cylinder"

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_length("radius")
        self._set_length("length")

    @override
    def geometry(self) -> Any:
        return coal.Cylinder(self.radius, self.length)

    @override
    def urdf_shapes(self) -> Sequence[UrdfShape]:
        return [_cylinder(self.radius, self.length)]


@dataclass(frozen=True, eq=False)
class Capsule(Obstacle):
    """All points within `radius` of a segment along the pose's z axis, centred at the pose.

    Attributes
    ----------
    radius, length : float
        Radius, and length of the segment (the caps come on top) [m].
    """

    shape: ClassVar[str] = "capsule"

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_length("radius")
        self._set_length("length")

    @override
    def geometry(self) -> Any:
        return coal.Capsule(self.radius, self.length)

    @override
    def urdf_shapes(self) -> Sequence[UrdfShape]:
        """Return a cylinder and two spheres."""
        ends = (0.5 * self.length, -0.5 * self.length)
        caps = (UrdfShape("sphere", {"radius": repr(self.radius)}, height) for height in ends)
        return [_cylinder(self.radius, self.length), *caps]


@dataclass(frozen=True, eq=False)
class Mesh(Obstacle):
    """The solid bounded by a triangle mesh; the file is read when a model is built from it.

    Attributes
    ----------
    file : Path
        STL, OBJ, DAE or PLY.
    scale : float
        Metres per unit of the file; Collada files say their unit themselves.
    """

    shape: ClassVar[str] = "mesh"

    file: Path
    scale: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.file, str | Path):
            raise CollisionError(f"{self.label}: file is {shown(self.file)}, expected a path")
        object.__setattr__(self, "file", Path(self.file))
        self._set_length("scale")

    @property
    @override
    def files(self) -> tuple[Path, ...]:
        return (self.file,)

    @property
    def note(self) -> str:
        """What its file is taken to be in where it says no unit; "" where that is known."""
        if self.scale != 1.0 or says_unit(self.file):
            return ""
        return f"{self.label}: {self.file.name} says no unit: taken for metres (else: scale)"

    def _metres(self) -> float:
        """Return the metres of a unit of the file."""
        unit = unit_of(self.file)
        if unit != 1.0 and self.scale != 1.0:
            raise CollisionError(
                f"{self.label}: {self.file} says itself that its unit is {unit:g} m, and scale is "
                f"{self.scale:g}: leave scale out"
            )
        return unit * self.scale

    @override
    def geometry(self) -> Any:
        if not is_file(self.file):
            raise CollisionError(f"{self.label}: no such file: {self.file}")
        try:
            found = coal.MeshLoader().load(str(self.file), np.full(3, self._metres()))
        except (RuntimeError, ValueError) as error:
            # The text before is a place in the source of coal.
            reason = " ".join(str(error).rpartition("message:")[2].split())
            raise CollisionError(f"{self.label}: {self.file} cannot be read: {reason}") from error
        corners = np.array(found.vertices()).reshape(-1, 3)
        size = float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
        if _LONGEST < size < np.inf:
            raise CollisionError(
                f"{self.label}: {self.file} is {size:.3g} m long: scale = 0.001 if it is in "
                f"millimetres; of a hall, leave what is within {_LONGEST:g} m"
            )
        return found

    @override
    def urdf_shapes(self) -> Sequence[UrdfShape]:
        self._metres()
        if is_file(self.file):
            # An arm carries nothing of that size either.
            self.geometry()
        scale = " ".join([repr(self.scale)] * 3)
        return [UrdfShape("mesh", {"filename": str(self.file.resolve()), "scale": scale})]


def _cylinder(radius: float, length: float) -> UrdfShape:
    return UrdfShape("cylinder", {"radius": repr(radius), "length": repr(length)})
