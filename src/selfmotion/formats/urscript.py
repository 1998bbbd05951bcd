"""URScript for arms of Universal Robots: a stream of ``servoj`` at a fixed rate."""

from collections.abc import Sequence

from selfmotion.basics import Array, ProblemError
from selfmotion.robot import RobotModel

# servoj smooths by looking ahead [s]: the default of the manual.
_LOOK_AHEAD = 0.1
# It follows with this gain: the default of the manual.
_GAIN = 300
_JOINTS = 6


def script(robot: RobotModel, joints: Sequence[str], q: Array, rate: float) -> str:
    """Return a program that moves to the start and then streams the samples.

    Parameters
    ----------
    robot : RobotModel
    joints : sequence of str
        Six revolute joints of it, in the controller's order: base to wrist.
    q : (K, 6)
        [rad]
    rate : float
        [Hz]

    Raises
    ------
    ProblemError
        The arm has other joints.
    """
    slides = [name for name in joints if robot.is_prismatic(name)]
    if len(joints) != _JOINTS or slides:
        raise ProblemError(
            f"{robot.name}: URScript is for arms of {_JOINTS} revolute joints, this one has "
            f"{len(joints)} joints" + (f", of which '{slides[0]}' slides" if slides else "")
        )
    period = repr(1.0 / rate)
    lines = [
        f"# {robot.name}: {len(q)} setpoints, joints {', '.join(joints)} [rad].",
        f"# servoj at {rate:g} Hz (t = {period} s), lookahead_time = {_LOOK_AHEAD} s, "
        f"gain = {_GAIN}:",
        f"# the arm follows about {_LOOK_AHEAD} s late, and rounds what is faster than that.",
        "def selfmotion():",
        f"  movej({_vector(q[0])})",
    ]
    for row in q:
        lines.append(
            f"  servoj({_vector(row)}, t={period}, lookahead_time={_LOOK_AHEAD}, gain={_GAIN})"
        )
    return "\n".join([*lines, "  stopj(2.0)", "end", ""])


def _vector(values: Array) -> str:
    return f"[{', '.join(repr(value) for value in values.tolist())}]"
