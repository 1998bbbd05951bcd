"""URScript for arms of Universal Robots: a stream of ``servoj`` at a fixed rate.

After Universal Robots' script manual (e-Series, 5.11): ``set_tcp`` is the tool's pose in the
flange as position [m] and rotation vector [rad], ``movej`` goes to the start at a joint speed and
acceleration [rad/s, rad/s²], ``set_standard_digital_out`` switches an output.
"""

from collections.abc import Sequence

from selfmotion.basics import Array, ProblemError
from selfmotion.controllers.program_axes import tool_from_flange
from selfmotion.controllers.program_settings import ProgramSettings
from selfmotion.robot import RobotModel
from selfmotion.task import log3

# servoj smooths by looking ahead [s]: the default of the manual.
_LOOK_AHEAD = 0.1
# Standard digital outputs are 0 to this one.
_LAST_OUTPUT = 7
# It follows with this gain: the default of the manual.
_GAIN = 300
_JOINTS = 6
# What `approach` is a share of: joints of these arms turn by π rad/s at least; movej's own default
# acceleration [rad/s²].
_FASTEST, _ACCELERATION = 3.14, 1.4


def script(
    robot: RobotModel,
    joints: Sequence[str],
    q: Array,
    rate: float,
    settings: ProgramSettings | None = None,
    events: Sequence[tuple[int, str]] = (),
) -> str:
    """Return a program that moves to the start, slowly, and then streams the samples.

    Parameters
    ----------
    robot : RobotModel
    joints : sequence of str
        Six revolute joints of it, in the controller's order: base to wrist.
    q : (K, 6)
        [rad]
    rate : float
        [Hz]
    settings : ProgramSettings, optional
        Flange, load, outputs, and how fast to the start.
    events : sequence of (int, str)
        Before which sample what happens. Outputs are switched as late as the arm follows.

    Raises
    ------
    ProblemError
        The arm has other joints, or an event no output.
    """
    asked = ProgramSettings() if settings is None else settings
    check_joints(robot, joints)
    period = repr(1.0 / rate)
    center = ", ".join(f"{value:.6g}" for value in asked.center)
    lines = [
        f"# {robot.name}: {len(q)} setpoints, joints {', '.join(joints)} [rad].",
        f"# servoj at {rate:g} Hz (t = {period} s), lookahead_time = {_LOOK_AHEAD} s, "
        f"gain = {_GAIN}:",
        f"# the arm follows about {_LOOK_AHEAD} s late, and rounds what is faster than that;",
        "# outputs are switched as much later, when the arm is there.",
        "def selfmotion():",
        *_tool(robot, joints, asked),
        *([] if asked.mass is None else [f"  set_payload({asked.mass:.6g}, [{center}])"]),
        slow_joints(q[0], asked),
    ]
    late = round(_LOOK_AHEAD * rate)
    switched = {k + late: [name for at, name in events if at == k] for k, _ in events}
    # The last setpoint is held until the arm is where the last events are.
    held = max([len(q), *(k + 1 for k in switched)])
    for k in range(held):
        row = q[min(k, len(q) - 1)]
        lines += [f"  {event_line(name, asked)}" for name in switched.get(k, ())]
        lines.append(
            f"  servoj({_vector(row)}, t={period}, lookahead_time={_LOOK_AHEAD}, gain={_GAIN})"
        )
    return "\n".join([*lines, "  stopj(2.0)", "end", ""])


def check_joints(robot: RobotModel, joints: Sequence[str], what: str = "") -> None:
    """Refuse joints, of the robot or of `what`, that are not those of an arm of UR."""
    slides = [name for name in joints if robot.is_prismatic(name)]
    if len(joints) != _JOINTS or slides:
        raise ProblemError(
            f"{what or robot.name}: URScript is for arms of {_JOINTS} revolute joints, this one "
            f"has {len(joints)} joints"
            + (f", of which '{slides[0]}' slides" if slides else "")
            + "; tables (.csv) and ROS 2 messages (.yaml) are for any joints"
        )


def slow_joints(q: Array, settings: ProgramSettings) -> str:
    """Return the line that goes slowly to a configuration (6,)."""
    speed, push = settings.approach * _FASTEST, settings.approach * _ACCELERATION
    return f"  movej({_vector(q)}, a={push:.4g}, v={speed:.4g})"


def _tool(robot: RobotModel, joints: Sequence[str], settings: ProgramSettings) -> list[str]:
    """Return where the tool is; of one of a cell's arms nothing, as its tool may be another's."""
    if len(joints) < robot.dof:
        return []
    tool = tool_from_flange(robot, settings)
    place = [*tool.translation.tolist(), *log3(tool.rotation).tolist()]
    return [f"  set_tcp(p[{', '.join(f'{value + 0.0:.9f}' for value in place)}])"]


def event_line(event: str, settings: ProgramSettings) -> str:
    """Return what an event switches, or the comment that it is."""
    signal = settings.signal(event)
    if signal is None:
        return f"# event: {' '.join(event.split())}"
    output, value = signal
    if not isinstance(output, int) or output > _LAST_OUTPUT:
        raise ProblemError(
            f"signals: '{event}' switches {output!r}; standard outputs of Universal Robots are "
            f"numbers from 0 to {_LAST_OUTPUT}"
        )
    return f"set_standard_digital_out({output}, {value})"


def _vector(values: Array) -> str:
    return f"[{', '.join(repr(value) for value in values.tolist())}]"
