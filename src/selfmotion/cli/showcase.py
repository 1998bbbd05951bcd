"""What the demo plans."""

import numpy as np

import selfmotion as sm


def panda_past_a_box() -> sm.Problem:
    """Return a problem that the pseudo-inverse runs into.

    A Panda draws a circle with its hand pointing ahead, beside a box that its forearm would hit;
    it ends as it began, at rest, within all limits that its maker publishes.
    """
    panda = sm.load_robot("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 5.0, normal=(1.0, 0.0, 0.0))
    box = sm.obstacles.Box("box", np.array([0.1, -0.2, 0.75]), np.full(3, 0.1))
    constraints = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(),
        sm.constraints.JointJerkLimits(),
        sm.constraints.ClosedPath(),
        sm.constraints.Clearance((box,), 0.01),
    )
    return sm.Problem(panda, circle, "pointing", start, constraints=constraints)
