"""Arms for which controllers have programs."""

from collections.abc import Sequence

from selfmotion.basics import ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.shop.controllers.controller_axes import axes_of
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.tool_frames import axis_inside_arm

# Number of joints of an arm of Universal Robots.
_UR_JOINTS = 6


def check_controller(robot: RobotModel, form: str, settings: ProgramSettings) -> None:
    """Refuse what a controller has no program for, or what its program has to say and does not.

    Raises
    ------
    ProblemError
        An arm of seven joints as KRL, or no mass for a controller of ABB.
    """
    if form == "rapid" and settings.mass is None:
        raise ProblemError(
            f"{robot.name}: a tooldata has the mass of what the flange carries, and a controller "
            f"of ABB moves by it; give export --set mass=KG, or mass in the file of --settings "
            f"(ProgramSettings(mass=…))"
        )
    check_arm(robot, form, settings)


def check_arm(robot: RobotModel, form: str, settings: ProgramSettings) -> None:
    """Refuse an arm for which a controller has no programs.

    Raises
    ------
    ProblemError
        It has other axes than arms of that maker.
    """
    if form == "urscript":
        check_joints(robot, robot.joint_names)
        return
    axes = axes_of(robot, settings)
    joint = axis_inside_arm(robot, axes) if form == "krl" else ""
    if joint:
        raise ProblemError(
            f"{robot.name}: joint '{joint}' is in the arm itself: KRL is for arms of six axes with "
            f"external ones, and KUKA's arms of seven (LBR iiwa) are programmed in Java (Sunrise); "
            f"write .yaml (ROS 2) or .csv for the driver of such an arm"
        )


def check_joints(robot: RobotModel, joints: Sequence[str], what: str = "") -> None:
    """Refuse joints, of the robot or of `what`, that are not those of an arm of UR."""
    slides = [name for name in joints if robot.is_prismatic(name)]
    if len(joints) != _UR_JOINTS or slides:
        raise ProblemError(
            f"{what or robot.name}: URScript is for arms of {_UR_JOINTS} revolute joints, this one "
            f"has {len(joints)} joints"
            + (f", of which '{slides[0]}' slides" if slides else "")
            + "; tables (.csv) and ROS 2 messages (.yaml) are for any joints"
        )
