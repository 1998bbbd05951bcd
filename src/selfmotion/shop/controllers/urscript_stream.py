"""URScript as a stream of ``servoj`` at a fixed rate."""

from collections.abc import Sequence

from selfmotion.basics import Array
from selfmotion.model.robot import RobotModel
from selfmotion.shop.controllers.controller_arms import check_joints
from selfmotion.shop.controllers.controller_axes import tool_from_flange
from selfmotion.shop.controllers.program_facts import held_in_words
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.program_texts import as_word, plain
from selfmotion.shop.controllers.program_writer import event_text
from selfmotion.shop.controllers.urscript import URSCRIPT, joint_approach, payload

# After Universal Robots' script manual (e-Series, 5.11): ``set_tcp`` is the tool's pose in the
# flange as position [m] and rotation vector [rad], ``movej`` goes to the start at a joint speed
# and acceleration [rad/s, rad/s²], ``set_standard_digital_out`` switches an output.

# Time by which servoj looks ahead [s]: the default of the manual.
_LOOK_AHEAD = 0.1
# Gain with which it follows: the default of the manual.
_GAIN = 300


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
        Samples, and the event before each. Outputs are switched as late as the arm follows.

    Raises
    ------
    ProblemError
        The arm has other joints, or an event no output.
    """
    program_settings = ProgramSettings() if settings is None else settings
    check_joints(robot, joints)
    period = repr(1.0 / rate)
    tool = tool_from_flange(robot, program_settings) if len(joints) == robot.dof else None
    lines = [
        f"# {plain(robot.name)}: {len(q)} setpoints, "
        f"joints {', '.join(map(as_word, joints))} [rad].",
        f"# servoj at {rate:g} Hz (t = {period} s), lookahead_time = {_LOOK_AHEAD} s, "
        f"gain = {_GAIN}:",
        f"# the arm follows about {_LOOK_AHEAD} s late, and rounds what is faster than that;",
        "# outputs are switched as much later, when the arm is there.",
        *([f"# {plain(held_in_words(robot))}"] if robot.locked else []),
        "def selfmotion():",
        # One arm of a cell says none: the tool may be another's.
        *([] if tool is None else [f"  {URSCRIPT.text('set', tool=tool)}"]),
        *payload(program_settings),
        joint_approach(q[0], program_settings),
    ]
    late = round(_LOOK_AHEAD * rate)
    switched = {k + late: [name for at, name in events if at == k] for k, _ in events}
    # The last setpoint is held until the arm is where the last events are.
    held = max([len(q), *(k + 1 for k in switched)])
    for k in range(held):
        row = q[min(k, len(q) - 1)]
        lines += [
            f"  {event_text(URSCRIPT, name, program_settings.signal(name))}"
            for name in switched.get(k, ())
        ]
        lines.append(
            f"  servoj([{', '.join(map(repr, row.tolist()))}], t={period}, "
            f"lookahead_time={_LOOK_AHEAD}, gain={_GAIN})"
        )
    return "\n".join([*lines, "  stopj(2.0)", "end", ""])
