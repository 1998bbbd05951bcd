"""A ring on a cone, to be welded downhand on a table that tilts and turns."""

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import selfmotion as sm

UPRIGHT = sm.constraints.Tilt("arm/tool0", "z", within=np.radians(3.0))


def downhand(lean: float) -> sm.Problem:
    """Return one turn in 12 s: the torch square to the cone, `lean` [rad] off its axis.

    And within 3° of straight down. Where the table is tilted by as much and turns once round, the
    arm may stand still.
    """
    cell = sm.load_robot(
        {"arm": "ur10", "table": "positioner"},
        base={"table": pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.1]))},
        tool="arm/tool0",
        tool_offset=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3])),
        reference="table/plate",
    )
    angle, same = np.linspace(0.0, 2.0 * np.pi, 97), np.ones(97)
    ring = np.stack([0.08 * np.cos(angle), 0.08 * np.sin(angle), 0.06 * same], axis=1)
    square = Rotation.from_euler("ZY", np.stack([angle, (np.pi + lean) * same], axis=1))
    path = sm.paths.Waypoints(12.0 * angle / angle[-1], ring, square)
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    return sm.Problem(cell, path, "pointing", constraints=[*limits, UPRIGHT], rest=False)
