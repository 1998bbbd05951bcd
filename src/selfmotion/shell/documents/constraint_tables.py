"""Tables of constraints in problem files, of clearances and of relaxations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import model_validator

from selfmotion.basics import restore
from selfmotion.model.collision import Obstacle, disabled_links, srdf_notes
from selfmotion.model.task import Damping, Relaxation
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.shell.documents.body_tables import StandingBody
from selfmotion.shell.documents.field_types import (
    Angle,
    AnyTable,
    Axis,
    File,
    Flag,
    Joints,
    Length,
    LengthOrAngle,
    Lengths,
    Names,
    Number,
    Numbers,
    Text,
    key,
    needed,
)
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.tables import Context, Table, refused

_UNUSED = "Share of the limit that is aimed to be left unused; at least half of it is."


class ConstraintTable(Table):
    """A condition on the motion, which the certificate judges."""

    kind: str

    def build(self, _context: Context) -> Constraint:
        """Return the constraint."""
        constraint: Constraint = restore(Constraint, self.given)
        return constraint


class OwnConstraint(ConstraintTable, extra="allow"):
    """A constraint of a class of the user's own."""


class BandConstraint(ConstraintTable):
    """A coordinate stays within a band."""

    kind: Literal["Band"]
    coordinate: AnyTable = needed("`JointCoordinate`, `FrameCoordinate` or `SwivelAngle`.")
    center: LengthOrAngle = needed("The middle of the band [rad or m].")
    half: LengthOrAngle = needed("How far it reaches to each side, less than π [rad or m].")
    margin: Number = key(_UNUSED, 5e-4)


class ClosedPathConstraint(ConstraintTable):
    """The motion ends as it began, so that it can be repeated: q(T) = q(0)."""

    kind: Literal["ClosedPath"]
    velocity: Flag = key("Also q̇(T) = q̇(0), for repetition without a jump in speed.", True)


class EndAccelerationConstraint(ConstraintTable):
    """The motion ends with a joint acceleration; see `StartAcceleration`."""

    kind: Literal["EndAcceleration"]
    qdd: Joints = key("q̈(T) [rad/s² or m/s²].", 0.0)


class EndConfigurationConstraint(ConstraintTable):
    """The motion ends in a configuration that puts the tool on the end of the path."""

    kind: Literal["EndConfiguration"]
    q: Joints = needed("q(T) [rad or m].")


class EndVelocityConstraint(ConstraintTable):
    """The motion ends with a joint velocity; 0 for rest."""

    kind: Literal["EndVelocity"]
    qd: Joints = key("q̇(T) [rad/s or m/s].", 0.0)


class JointAccelerationConstraint(ConstraintTable):
    """Joint accelerations stay below limits."""

    kind: Literal["JointAccelerationLimits"]
    limit: Joints = key("[rad/s² or m/s²]; by default those of the arm's maker, if known.")
    margin: Number = key(_UNUSED, 1e-4)
    replace: Flag = key("Whether these replace the maker's. By default both apply.", False)


class JointJerkConstraint(ConstraintTable):
    """Joint jerks, the derivatives of accelerations, stay below limits."""

    kind: Literal["JointJerkLimits"]
    limit: Joints = key("[rad/s³ or m/s³]; by default those of the arm's maker, if known.")
    margin: Number = key(_UNUSED, 1e-4)
    replace: Flag = key("Whether these replace the maker's. By default both apply.", False)


class JointPositionConstraint(ConstraintTable):
    """Joint coordinates stay within limits."""

    kind: Literal["JointPositionLimits"]
    lower: Joints = key("[rad or m]; -inf for none. By default only the URDF's.")
    upper: Joints = key("[rad or m]; inf for none. By default only the URDF's.")
    margin: Angle = key("Target distance from them [rad or m]; at least half is kept.", 1e-5)
    replace: Flag = key("Whether these replace the URDF's. By default both apply.", False)


class JointTorqueConstraint(ConstraintTable):
    """Joint torques stay below limits: gravity, inertia and Coriolis forces, with a payload."""

    kind: Literal["JointTorqueLimits"]
    limit: Numbers = key("[Nm, or N of prismatic joints]; by default the URDF's efforts.")
    payload: Number = key("Mass that the tool holds [kg].", 0.0)
    center: Lengths = key("Its centre of mass in the tool frame [m].")
    inertia: Numbers = key(
        "Its inertia about that centre, along the tool's axes [kg m²]; by default a point mass."
    )
    margin: Number = key(_UNUSED, 1e-3)


class JointVelocityConstraint(ConstraintTable):
    """Joint speeds stay below limits."""

    kind: Literal["JointVelocityLimits"]
    limit: Joints = key("[rad/s or m/s]; by default only the URDF's.")
    margin: Number = key(_UNUSED, 1e-4)
    replace: Flag = key("Whether these replace the URDF's. By default both apply.", False)


class PositionDependentVelocityConstraint(ConstraintTable):
    """Joints get slower towards the ends of their ranges (position-based velocity limits)."""

    kind: Literal["PositionDependentVelocityLimits"]
    deceleration: Joints = key("a [rad/s² or m/s²]; by default that of the maker, if known.")
    offset: Joints = key("o [rad/s or m/s]; by default the maker's, or 0 beside a deceleration.")
    lower: Joints = key(
        "Where the lower square root is 0 [rad or m], -inf for a joint without a curve; by default "
        "the maker's, or the URDF's limits beside a given deceleration."
    )
    upper: Joints = key("Where the upper square root is 0 [rad or m]; likewise.")
    margin: Number = key(
        "Share of the distance in which a joint stops from its highest speed that is aimed to be "
        "left unused; at least half of it is. By default more than libfranka's tolerance of "
        "1e-3 rad/s.",
        2e-3,
    )


class StartAccelerationConstraint(ConstraintTable):
    """The motion starts with a joint acceleration: with `StartVelocity`, an arm is taken over."""

    kind: Literal["StartAcceleration"]
    qdd: Joints = key("q̈(0) [rad/s² or m/s²].", 0.0)


class StartVelocityConstraint(ConstraintTable):
    """The motion starts with a joint velocity: that of an arm that moves already."""

    kind: Literal["StartVelocity"]
    qd: Joints = key("q̇(0) [rad/s or m/s].", 0.0)


class TiltConstraint(ConstraintTable):
    """An axis of a link stays within an angle of a direction of the world, at all times."""

    kind: Literal["Tilt"]
    frame: Text = needed("The link.")
    axis: Axis = key("In the link's own frame.", "z")
    within: Angle = key("The largest angle [rad], less than π.", 0.1)
    # Python has a default: down suits a torch, and is upside down for a table.
    towards: Numbers = needed("The direction, in world axes.")
    margin: Number = key(_UNUSED, 5e-4)


class ToolConstraint(ConstraintTable):
    """The tool moves and turns no faster, and accelerates no more, than it may."""

    kind: Literal["ToolLimits"]
    speed: Length = key("Of the tool frame's origin [m/s].", math.inf)
    turn_rate: Angle = key("[rad/s].", math.inf)
    acceleration: Length = key("[m/s²].", math.inf)
    turn_acceleration: Angle = key("[rad/s²].", math.inf)
    margin: Number = key(_UNUSED, 1e-3)


class ClearanceTable(Table):
    """The arm and attached bodies have a minimum distance from obstacles and from each other."""

    obstacles: list[StandingBody] = key("Obstacles in the world, and bodies attached to links.", [])
    distance: Length = key("Smallest distance [m].", 5e-3)
    disabled: list[Names] = key("Pairs of links or obstacles that are left out.", [])
    only: Names = key(
        "Obstacles: pairs of which neither is one of these are left out. By default none is.", []
    )
    srdf: File = key("File whose `disable_collisions` are left out as well.")

    def build(
        self, context: Context, bodies: Sequence[Obstacle] = (), usual: float | None = None
    ) -> Clearance:
        """Return the clearance, which looks at further bodies; a distance not given is `usual`."""
        distance = self.distance if usual is None or "distance" in self.given else usual
        obstacles = [body.build(context) for body in self.obstacles]
        disabled: list[Any] = [*self.disabled]
        if self.srdf is not None:
            # With what the arm's own xacro is given.
            srdf, given = context.beside(self.srdf), (context.arguments, context.packages)
            disabled += disabled_links(srdf, *given)
            context.notes.extend(srdf_notes(srdf, *given))
        only = tuple(self.only)
        return Clearance((*obstacles, *bodies), distance, disabled=tuple(disabled), only=only)


class ClearanceConstraint(ClearanceTable):
    """A clearance, as files of before say it; see the table `clearance`."""

    kind: Literal["Clearance"]


CONSTRAINTS = OneOf(
    "kind",
    lambda: (
        *(BandConstraint, ClearanceConstraint, ClosedPathConstraint, EndAccelerationConstraint),
        *(EndConfigurationConstraint, EndVelocityConstraint, JointAccelerationConstraint),
        *(JointJerkConstraint, JointPositionConstraint, JointTorqueConstraint),
        *(JointVelocityConstraint, PositionDependentVelocityConstraint),
        *(StartAccelerationConstraint, StartVelocityConstraint, TiltConstraint, ToolConstraint),
    ),
    OwnConstraint,
    Constraint.kinds,
)
AnyConstraint = Annotated[ConstraintTable | ClearanceConstraint, CONSTRAINTS]


class RelaxationTable(Table):
    """Rows in which the tool may leave the path, by how much, and when."""

    rows: Names = needed("All of x, y, z or all of rx, ry, rz.")
    band: LengthOrAngle = key("Largest deviation [m or rad]; by default any.", math.inf)
    during: Numbers = key("First and last time of the window [s]; by default the whole motion.")
    axes: Text = key("Of x, y and z; rotations are in tool axes always.", "world")

    @model_validator(mode="before")
    @classmethod
    def _check_unit(cls, value: Any) -> Any:
        """Refuse a band in mm of rows that turn, and one in degrees of rows that do not."""
        rows = value.get("rows") if isinstance(value, Mapping) else None
        for row in [rows] if isinstance(rows, str) else rows if isinstance(rows, list) else ():
            for rows_of, what, wrong, right in (
                (("rx", "ry", "rz"), "an angle", "band_mm", "band_deg"),
                (("x", "y", "z"), "a length", "band_deg", "band_mm"),
            ):
                if row in rows_of and wrong in value:
                    said = f"row '{row}' is {what}; say {right}"
                    raise refused(wrong, value[wrong], said)
        return value

    def build(self, _context: Context) -> Relaxation:
        """Return the relaxation."""
        return Relaxation(**self.given)


class DampingTable(Table):
    """Damp the pseudo-inverse near singular poses: Jᵀ(JJᵀ + λ²I)⁻¹ there, J⁺ elsewhere."""

    threshold: Number = key("σ0 as a share of σ at the arm's dexterous configuration.", 0.2)
    strength: Number = key(
        "λ0/σ0. At one half, joint speeds stay below 1.3 times those that the same tool speed "
        "takes at the threshold.",
        0.5,
    )
    path_weight: Number = key(
        'w of the cost "path error" ∫ ½ w |e|² dt, without which the optimisation would go '
        "singular to reduce joint motion; as a multiple of (K/σ0)², K the rate [1/s] of the pose "
        "feedback. At 1, an error costs as much as the joint motion that corrects it at the "
        "threshold.",
        1.0,
    )

    def build(self, _context: Context) -> Damping:
        """Return the damping."""
        return Damping(**self.given)
