"""Tables of bodies in problem files: obstacles, what links carry, the workpiece."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ValidationError

from selfmotion.basics import FileFormatError, ProblemError
from selfmotion.model.collision import Obstacle, obstacle_from_dict, obstacle_shapes
from selfmotion.model.path import pose_of
from selfmotion.model.task import SE3
from selfmotion.shell.documents.field_types import File, Length, Lengths, Number, Text, key, needed
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.tables import Context, Pose, PoseTable, Table, refused

_POSE = tuple(PoseTable.model_fields)


class BodyTable(PoseTable, Table):
    """A body: what it is called, and where it is."""

    shape: str
    name: Text = needed("Its name in reports; unique among the obstacles and links of a model.")
    frame: Text = key(
        "The link that carries it, in whose frame it is placed then: a torch, a camera, a part in "
        "hand, a fixture on a table that turns. By default the world."
    )
    distance: Length = key("Smallest distance from it [m]; by default that of the clearance.")

    def build(
        self, context: Context, place: SE3 | None = None, carrier: str | None = None
    ) -> Obstacle:
        """Return the body; with a `place`, that of the workpiece, which a link may carry."""
        where = "" if place is None else "workpiece: "
        values = self.given
        values.pop("distance", None)
        try:
            pose = pose_of({name: values.pop(name) for name in _POSE if name in values})
        except ValueError as error:
            raise FileFormatError(f"{where}obstacle '{self.name}': {error}") from error
        if place is not None:
            pose = place * pose
            if self.frame is not None:
                raise ProblemError(
                    f"workpiece: obstacle '{self.name}' rides on '{self.frame}'; what belongs to "
                    f"the workpiece moves with it"
                )
        if carrier is not None:
            values["frame"] = carrier
        if "file" in values:
            # A plan or a problem with this body may be kept in another folder than it is made in.
            values["file"] = str(context.beside(values["file"]).resolve())
        position, rotation = pose.translation.tolist(), pose.rotation.tolist()
        return obstacle_from_dict({**values, "position": position, "rotation": rotation})


class OwnBody(BodyTable, extra="allow"):
    """A body of a shape of the user's own."""


class BoxTable(BodyTable):
    """A solid box, its centre at the pose."""

    shape: Literal["box"]
    size: Lengths = needed("Full lengths along the pose's axes [m].")


class CapsuleTable(BodyTable):
    """All points within `radius` of a segment along the pose's z axis, centred at the pose."""

    shape: Literal["capsule"]
    radius: Length = needed("[m].")
    length: Length = needed("Of the segment; the caps come on top [m].")


class CylinderTable(BodyTable):
    """A solid cylinder, its centre at the pose and its axis along the pose's z."""

    shape: Literal["cylinder"]
    radius: Length = needed("[m].")
    length: Length = needed("[m].")


class MeshTable(BodyTable):
    """The solid bounded by a triangle mesh; the file is read when a model is built from it."""

    shape: Literal["mesh"]
    file: File = needed("STL, OBJ, DAE or PLY.")
    scale: Number = key("Metres per unit of the file; Collada files say their unit.", 1.0)


class SphereTable(BodyTable):
    """A solid sphere."""

    shape: Literal["sphere"]
    radius: Length = needed("[m].")


BODIES = OneOf(
    "shape",
    lambda: (BoxTable, CapsuleTable, CylinderTable, MeshTable, SphereTable),
    OwnBody,
    lambda: dict(obstacle_shapes()),
    _POSE,
)


def _standing(body: Any) -> Any:
    """Return a body that says where it is; meshes have a place of their own."""
    if body.position is None and not isinstance(body, MeshTable):
        missing: Any = {"type": "missing", "loc": ("position",), "input": body.given}
        raise ValidationError.from_exception_data("body", [missing])
    return body


def _without_distance(body: Any) -> Any:
    """Return a body without a distance of its own, which those of clearances alone have."""
    if body.distance is not None:
        raise refused(
            "distance",
            body.distance,
            "is of obstacles of a clearance or of the workpiece, expected none here: bodies of the "
            "robot and what seams leave keep the distance of the clearance",
        )
    return body


# What rides on something is in its frame by default; what stands in the world says where.
AnyBody = Annotated[BodyTable, BODIES]
CarriedBody = Annotated[BodyTable, BODIES, AfterValidator(_without_distance)]
StandingBody = Annotated[BodyTable, BODIES, AfterValidator(_standing)]


class WorkpieceTable(Table):
    """What paths and bodies are placed with: paths are in its frame, and bodies move with it."""

    frame: Pose = key("Where it stands: a pose in the world, or in the frame of `on`.")
    on: Text = key("The link that carries it; paths are in its frame then.")
    mesh: File = key("Its shape, a file in the same frame; it is kept clear of.")
    scale: Number = key("What a unit of the mesh is [m].")
    obstacles: list[AnyBody] = key("Bodies that move with it.", [])

    @property
    def place(self) -> SE3:
        """Where it stands."""
        return SE3.Identity() if self.frame is None else self.frame

    def build(self, context: Context) -> Sequence[Obstacle]:
        """Return its bodies, in the world or on the link that carries it.

        Raises
        ------
        ProblemError
            A body of it rides on something, or its mesh has a scale and is none.
        """
        bodies = list(self.obstacles)
        if self.mesh is not None:
            scale = {} if self.scale is None else {"scale": self.scale}
            mesh = {"shape": "mesh", "name": "workpiece", "file": self.mesh}
            bodies.append(MeshTable.model_validate({**mesh, **scale}))
        elif self.scale is not None:
            raise ProblemError("workpiece: scale has no effect without a mesh")
        return [body.build(context, self.place, self.on) for body in bodies]
