"""Obstacles: bodies of the world, or on a link. An own shape is a subclass of `Obstacle`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    CollisionError,
    as_number,
    as_numbers,
    shown,
)
from selfmotion.model.robot import UrdfShape
from selfmotion.model.task import SE3, as_pose

# An obstacle larger or farther away than this [m] may be in millimetres.
_HUGE = 100.0
# Fields of every obstacle besides the lengths of its shape.
_PLACE = ("name", "pose", "frame")
# Shape → class, filled as the classes are made.
_shapes: dict[str, type[Obstacle]] = {}


@dataclass(frozen=True, eq=False)
class Obstacle(ABC):
    """Base of obstacles: use `Box`, `Sphere`, `Cylinder`, `Capsule`, `Mesh` or an own shape.

    An own shape is a frozen dataclass derived from this one. It names its `shape`, adds its
    lengths as fields, and returns its `geometry`; it is then known to `obstacle_from_dict`::

        @dataclass(frozen=True, eq=False)
        class Cone(Obstacle):
            shape: ClassVar[str] = "cone"
            radius: float
            length: float

            def geometry(self) -> Any:
                return coal.Cone(self.radius, self.length)

    Fields must be numbers, texts, lists of these, arrays or paths, which is what files can hold.

    Attributes
    ----------
    name : str
        Its name in reports; unique among the obstacles and links of a model.
    pose : pinocchio.SE3
        The obstacle's frame in world axes; a position (3,) [m] is taken as a pose along them.
    frame : str or None
        The link of the robot that carries it, in whose frame `pose` is then: a torch, a camera, a
        part in hand, a fixture on a table that turns. None for the world.

    Raises
    ------
    CollisionError
        The name is empty, the pose is no rigid motion, a length is not positive, or the frame is
        no name. When a class is made: its shape is the name of another one.
    """

    shape: ClassVar[str] = ""

    name: str
    pose: SE3
    frame: str | None = field(default=None, kw_only=True)

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        known = _shapes.get(cls.shape)
        if not cls.shape or (known and known.__qualname__ != cls.__qualname__):
            raise CollisionError(
                f"class {cls.__name__}: its shape is {cls.shape!r}, expected a name that no other "
                f"obstacle has; taken are {', '.join(_shapes)}"
            )
        _shapes[cls.shape] = cls

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name):
            raise CollisionError(f"{self.shape}: has name {self.name!r}, expected a text")
        object.__setattr__(self, "pose", _pose(self.label, self.pose))
        if self.frame is not None and not (isinstance(self.frame, str) and self.frame):
            raise CollisionError(
                f"{self.label}: frame is {shown(self.frame)}, expected the name of a link"
            )

    @property
    def label(self) -> str:
        """Shape and name, as messages say it."""
        return f"{self.shape} '{self.name}'"

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that its geometry is read from."""
        return ()

    @property
    def hint(self) -> str:
        """Suspected error of units, in words; "" for none."""
        geometry = self.geometry()
        geometry.computeLocalAABB()
        size = 2.0 * float(geometry.aabb_radius)
        far = float(np.linalg.norm(self.pose.act(np.array(geometry.aabb_center))))
        if max(size, far) < _HUGE:
            return ""
        return f"{self.label} is {size:.3g} m large and {far:.3g} m away: millimetres?"

    @abstractmethod
    def geometry(self) -> Any:
        """Return its coal geometry, in the obstacle's frame [m].

        Raises
        ------
        CollisionError
            A file is missing or cannot be read.
        """

    def urdf_shapes(self) -> Sequence[UrdfShape]:
        """Return its shapes in a URDF, where an arm carries it (`load_robot`, bodies).

        Raises
        ------
        CollisionError
            A URDF does not know the shape.
        """
        raise CollisionError(
            f"{self.label}: a URDF knows no such shape, so that no arm can carry it as a body; "
            f"give it to a Clearance, with frame="
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON-safe values; `obstacle_from_dict` reverses this exactly."""
        rest = (f.name for f in fields(self) if f.name not in _PLACE)
        return {
            "shape": self.shape,
            "name": self.name,
            "position": self.pose.translation.tolist(),
            "rotation": self.pose.rotation.tolist(),
            **({} if self.frame is None else {"frame": self.frame}),
            **{key: _plain(getattr(self, key)) for key in rest},
        }

    def _set_length(self, key: str) -> None:
        """Replace the attribute by a float, which must be positive."""
        what = f"{self.label}: {key}"
        length = as_number(getattr(self, key), what, above=0.0, most=1e6, error=CollisionError)
        object.__setattr__(self, key, length)


def obstacle_shapes() -> list[tuple[str, type[Obstacle]]]:
    """Return the shapes that are known, with their classes."""
    return list(_shapes.items())


def obstacle_from_dict(values: Mapping[str, Any]) -> Obstacle:
    """Build an obstacle of the values of `Obstacle.to_dict`.

    Parameters
    ----------
    values : dict
        ``shape`` and ``name``; ``position`` (3,) [m] and optionally ``rotation`` (3, 3) and
        ``frame``; and the lengths of the shape.

    Raises
    ------
    CollisionError
        A key is missing, unknown or has a value that cannot be used.
    """
    rest = dict(values)
    shape, name = rest.pop("shape", None), rest.pop("name", None)
    if shape not in _shapes:
        raise CollisionError(
            f"obstacle {name!r}: shape is {shape!r}, expected one of {', '.join(_shapes)}; an own "
            f"shape is known once its class is imported"
        )
    label = f"{shape} {name!r}"
    if "position" not in rest:
        raise CollisionError(f"{label}: 'position' is missing")
    position = _numbers(rest.pop("position"))
    rotation = _numbers(rest.pop("rotation", np.eye(3)))
    if position.shape != (3,) or rotation.shape != (3, 3):
        raise CollisionError(
            f"{label}: position has shape {position.shape} and rotation {rotation.shape}, "
            f"expected (3,) and (3, 3)"
        )
    cls = _shapes[shape]
    own = [f for f in fields(cls) if f.name not in _PLACE]
    known = {"frame", *(f.name for f in own)}
    unknown = sorted(set(rest) - known)
    if unknown:
        raise CollisionError(f"{label}: has '{unknown[0]}', expected {', '.join(sorted(known))}")
    needed = {f.name for f in own if f.default is MISSING and f.default_factory is MISSING}
    missing = sorted(needed - set(rest))
    if missing:
        raise CollisionError(f"{label}: '{missing[0]}' is missing")
    return cls(name, SE3(rotation, position), **rest)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def _numbers(values: npt.ArrayLike) -> Array:
    """Return `values` as floats, or NaN where they are none, for one check to refuse."""
    try:
        return np.array(values, dtype=np.float64)
    except (OverflowError, TypeError, ValueError):
        return np.array(np.nan)


def _pose(label: str, pose: Any) -> SE3:
    if not isinstance(pose, SE3):
        position = _numbers(pose)
        if position.shape != (4, 4):
            what, expected = f"{label}: pose", "an SE3, a (4, 4) matrix or a position (3,), finite"
            pose = SE3(np.eye(3), as_numbers(pose, what, expected, (3,), CollisionError))
    return as_pose(pose, f"{label}: pose", CollisionError)
