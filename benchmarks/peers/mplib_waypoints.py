"""MPLib: a screw motion from each waypoint to the next, and inverse kinematics at each."""

import sys
from pathlib import Path

import mplib
import numpy as np
from common import panda_urdf, report, start, waypoints

PATH = "panda__1cube"
_, positions, quaternions = waypoints(PATH)
urdf = Path(sys.argv[1]).with_name("mplib.urdf")
urdf.write_text(panda_urdf())
srdf = urdf.with_suffix(".srdf")
srdf.write_text('<robot name="panda"/>')
OPEN = np.zeros(2)  # the fingers


def screws() -> np.ndarray:
    """Follow the path until a screw motion fails."""
    # --8<-- [start:follow]
    planner = mplib.Planner(urdf, "panda_hand", srdf=srdf)
    motion = [start()]
    for position, quaternion in zip(positions[1:], quaternions[1:], strict=True):
        goal = mplib.Pose(position, quaternion)
        step = planner.plan_screw(goal, np.append(motion[-1], OPEN))
        if step["status"] != "Success":
            break
        motion.append(step["position"][-1])
    # --8<-- [end:follow]
    return np.array(motion)


def nearest() -> np.ndarray:
    """Return the nearest of its twenty solutions at each waypoint."""
    mplib.set_global_seed(1)
    planner = mplib.Planner(urdf, "panda_hand", srdf=srdf)
    motion = [np.append(start(), OPEN)]
    for position, quaternion in zip(positions[1:], quaternions[1:], strict=True):
        goal = mplib.Pose(position, quaternion)
        _, found = planner.IK(goal, motion[-1], return_closest=True)
        if found is None:
            break
        motion.append(found)
    return np.array(motion)[:, :7]


report("MPLib", "plan_screw from waypoint to waypoint", screws)
report("MPLib", "IK, the nearest of 20", nearest)
