"""Arms of six axes with a wrist whose axes meet, as makers of industrial arms build and count them.

Dimensions of data sheets: ABB's IRB 120 (3HAC035960), KUKA's KR 6 R900 sixx. Zeros and signs are
the makers': ABB's upper arm stands, its forearm points ahead; KUKA's arm is stretched ahead, and
its axes 1, 4 and 6 turn the other way.
"""

from pathlib import Path

import numpy as np

import selfmotion as sm
from support.arms import robot_named

# Of each axis where it is from the one before [m], what it turns about, and its limits [deg].
_ABB = (
    ((0.0, 0.0, 0.29), "0 0 1", 165),
    ((0.0, 0.0, 0.0), "0 1 0", 110),
    ((0.0, 0.0, 0.27), "0 1 0", 110),
    ((0.302, 0.0, 0.07), "1 0 0", 160),
    ((0.0, 0.0, 0.0), "0 1 0", 120),
    ((0.072, 0.0, 0.0), "1 0 0", 400),
)
_KUKA = (
    ((0.0, 0.0, 0.4), "0 0 -1", 170),
    ((0.025, 0.0, 0.0), "0 1 0", 190),
    ((0.455, 0.0, 0.0), "0 1 0", 156),
    ((0.42, 0.0, 0.035), "-1 0 0", 185),
    ((0.0, 0.0, 0.0), "0 1 0", 120),
    ((0.08, 0.0, 0.0), "-1 0 0", 350),
)
MAKERS = {"abb": _ABB, "kuka": _KUKA}
# A rail along y in front of which the arm stands [m].
RAIL = 2.0


def industrial_urdf(maker: str, *, rail: bool = False) -> str:
    """Return the URDF of such an arm, on a rail or not, with ``flange`` and a tool."""
    parts = [f'<robot name="{maker}{"_on_rail" if rail else ""}"><link name="world_frame"/>']
    below = "world_frame"
    if rail:
        parts.append(_joint("rail", "prismatic", below, "carriage", (0, 0, 0), "0 1 0", RAIL))
        below = "carriage"
    for k, (place, axis, degrees) in enumerate(MAKERS[maker], 1):
        limit = degrees * 3.141592653589793 / 180.0
        parts.append(_joint(f"a{k}", "revolute", below, f"link_{k}", place, axis, limit))
        below = f"link_{k}"
    # The z axis of the flange points out of it.
    parts.append(_fixed("to_flange", below, "flange", "0 0 0", "0 1.5707963267948966 0"))
    parts.append(_fixed("to_tool", "flange", "torch", "0.02 0 0.12", "0 0.4 0"))
    return "".join([*parts, "</robot>"])


def industrial_arm(folder: Path, maker: str, *, rail: bool = False) -> sm.RobotModel:
    """Load such an arm."""
    file = folder / f"{maker}{'_on_rail' if rail else ''}.urdf"
    file.write_text(industrial_urdf(maker, rail=rail))
    return sm.load_robot(file, tool="torch")


def _joint(
    name: str,
    kind: str,
    above: str,
    link: str,
    place: tuple[float, ...],
    axis: str,
    limit: float,
) -> str:
    xyz = " ".join(map(str, place))
    return (
        f'<link name="{link}"/><joint name="{name}" type="{kind}"><parent link="{above}"/>'
        f'<child link="{link}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
        f'<limit lower="{-limit}" upper="{limit}" velocity="4" effort="100"/></joint>'
    )


def _fixed(name: str, above: str, link: str, xyz: str, turned: str) -> str:
    return (
        f'<link name="{link}"/><joint name="{name}" type="fixed"><parent link="{above}"/>'
        f'<child link="{link}"/><origin xyz="{xyz}" rpy="{turned}"/></joint>'
    )


def two_seams() -> sm.Program:
    """Two seams of a UR5, with an arc, moves and a wait."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    first = ur5.pose(start)
    seams = []
    for k, side in enumerate((0.0, 0.06)):
        begin, end = first.copy(), first.copy()
        begin.translation = first.translation + np.array([0.0, side, 0.0])
        end.translation = begin.translation + np.array([0.0, 0.0, 0.05])
        events = [("arc on", 0.0), ("arc off", 0.7)]
        path = sm.paths.Line(begin, end, 1.0)
        seams.append(sm.Seam(f"seam {k}", path, "pointing", wait=0.5 * (1 - k), events=events))
    made = sm.plan_job(ur5, seams, start=start, order="given", branches=1, clearance=None)
    return made.require()
