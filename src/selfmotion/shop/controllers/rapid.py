"""ABB RAPID: targets with the time to each, or poses at speeds."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.pose_numbers import TIME_DIGITS, rapid_numbers, rapid_pose
from selfmotion.shop.controllers.program_reader import ProgramReader
from selfmotion.shop.controllers.program_settings import AXES
from selfmotion.shop.controllers.program_writer import WrittenPose
from selfmotion.shop.controllers.segment_building import Pose, pose_of_values
from selfmotion.shop.controllers.statements import (
    Field,
    Language,
    Statement,
    number,
    seconds,
    truth,
    word,
)

# After ABB's Technical reference manual, RAPID Instructions, Functions and Data types (RobotWare
# 6, 3HAC050917-001): ``MoveAbsJ`` of a ``jointtarget``, whose external axes are 9E9 where there
# are none and whose unit is degrees or mm, with ``\T``, the time in seconds that the motion to it
# takes, in place of its speed. ``fine`` is a stop, ``z1`` a zone in which corners are rounded, at
# most from the middle of one motion to that of the next. Tool poses are ``MoveL`` of a
# ``robtarget`` in the work object ``wobjdata``, whose ``confdata`` says in which configuration
# the arm is; ``ConfL \Off`` has the controller go on in the one that it is in, as a shifted work
# object may need other numbers. A seam at a feed has a ``speeddata`` in place of times, and
# ``MoveC`` where it goes round, whose orientation turns evenly in the work object (``CirPathMode
# \ObjectFrame``). Outputs are set by ``SetDO``: where the arm rests when it rests, and where it
# moves when it enters the zone of its target.

# Largest number of characters in a name, those of the procedure included.
NAME = 32
# End of the name of the speed of slow motions.
SLOW = "_v"
# Value of an axis that is not there.
_ABSENT = "9E9"
# Value from which on there is no such axis.
_ABSENT_FROM = 8.9e9
# Largest speed of the approach [mm/s].
FASTEST = 500.0
# Largest rate of turning of the approach [°/s].
APPROACH_TURNING = 100.0
# Rates of turning and speeds of external axes that slow no seam down [°/s, mm/s, °/s].
TURNING = (500.0, 5000.0, 1000.0)


def _texts(reader: ProgramReader, text: str, count: int, what: str) -> list[str]:
    values = text.strip("[] ").split(",")
    if len(values) != count:
        raise reader.lines.fault(f"{what} has {len(values)} numbers, expected {count}")
    return values


def _numbers(reader: ProgramReader, text: str, count: int, what: str) -> list[float]:
    return [reader.lines.coordinate(item) for item in _texts(reader, text, count, what)]


def _read_speeds(reader: ProgramReader, text: str) -> list[float]:
    texts = _texts(reader, text, 4, "speeddata")
    values = [reader.lines.number_of(item) for item in texts]
    if not values[0] > 0.0:
        raise reader.lines.fault(f"v_tcp is {values[0]:g} mm/s, expected a number above 0")
    return values


def _read_axes(reader: ProgramReader, text: str) -> list[float]:
    robot, external = re.findall(_LIST, text)
    robot_axes = _texts(reader, robot, 6, "robax")
    external_axes = _texts(reader, external, 6, "extax")
    every = dict(zip(AXES, [*robot_axes, *external_axes], strict=True))
    present = [name for name, item in every.items() if not _is_absent(reader, name, item)]
    reader.check_axes(present)
    return [reader.lines.coordinate(every[name]) for name in present]


def _is_absent(reader: ProgramReader, name: str, text: str) -> bool:
    return name in AXES[6:] and abs(reader.lines.number_of(text)) > _ABSENT_FROM


def _read_pose(reader: ProgramReader, text: str) -> Pose:
    trans, rot, configuration, external = re.findall(_LIST, text)
    _numbers(reader, configuration, 4, "robconf")
    position, rotation = rapid_pose(_pose_numbers(reader, trans, rot))
    outer = dict(zip(AXES[6:], _texts(reader, external, 6, "extax"), strict=True))
    present = {
        name: reader.lines.coordinate(item)
        for name, item in outer.items()
        if not _is_absent(reader, name, item)
    }
    return Pose(position, rotation, reader.external_axes(present), reader.lines.number)


def _pose_numbers(reader: ProgramReader, trans: str, rot: str) -> Array:
    numbers = [*_numbers(reader, trans, 3, "trans"), *_numbers(reader, rot, 4, "rot")]
    if not any(numbers[3:]):
        raise reader.lines.fault("the quaternion is zero")
    return np.array(numbers)


def _read_frame(reader: ProgramReader, text: str) -> SE3:
    x, y, z, *quaternion = _pose_numbers(reader, *re.findall(_LIST, text)).tolist()
    return pose_of_values([1e-3 * x, 1e-3 * y, 1e-3 * z, *quaternion[1:], quaternion[0]])


def _write_lists(*lists: Sequence[str]) -> str:
    return "[" + ", ".join(f"[{', '.join(each)}]" for each in lists) + "]"


def _write_axes(axes: Mapping[str, str]) -> str:
    # A robot of fewer than six axes has 0 in their place.
    robot_axes = [axes.get(name, "0") for name in AXES[:6]]
    return _write_lists(robot_axes, [axes.get(name, _ABSENT) for name in AXES[6:]])


def _write_pose(pose: WrittenPose) -> str:
    numbers = rapid_numbers(pose.position, pose.quaternion)
    return _write_lists(
        [f"{value:.4f}" for value in numbers[:3]],
        [f"{value:.8f}" for value in numbers[3:]],
        [pose.configuration],
        [pose.axes.get(name, _ABSENT) for name in AXES[6:]],
    )


def _write_frame(pose: SE3 | None) -> str:
    if pose is None:
        return _write_lists("000", "1000")
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    return _write_lists(
        [f"{value + 0.0:.4f}" for value in (1e3 * pose.translation).tolist()],
        [f"{value + 0.0:.8f}" for value in (w, x, y, z)],
    )


def _write_speeds(speeds: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:.7g}' for value in speeds)}]"


_LIST = r"\[[^\[\]]*\]"
_LISTS = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_WORD = word(r"[A-Z]\w{0,31}")
# States of a reader: before the module, in its data, where a procedure begins, in it, after it.
_BEFORE = ("before",)
_DATA = ("data",)
_START = ("start",)
_BODY = ("body",)
_PROGRAM = ("start", "body")
_TOOLDATA = (
    "PERS tooldata <tool> := [TRUE, <tool_frame:frame>, [<mass>, "
    "[<x:length>, <y:length>, <z:length>], [1, 0, 0, 0], 0, 0, 0]];"
)
_WOBJDATA = 'PERS wobjdata <work> := [FALSE, <fixed>, "<unit>", <user:frame>, <object:frame>];'
RAPID = Language(
    comment="!",
    last="ENDMODULE",
    outputs=f"ABB's outputs have names of {NAME} characters at most",
    has_output=lambda output: isinstance(output, str) and len(output) <= NAME,
    fields={
        "name": _WORD,
        "tool": _WORD,
        "work": _WORD,
        "speed": _WORD,
        "output": _WORD,
        "unit": word(r"\w*"),
        "zone": word(r"fine|z[0-9]{1,3}"),
        "event": word(".*"),
        "mass": number(".4f"),
        "length": number(".4f"),
        "seconds": seconds(TIME_DIGITS),
        "value": truth("0", "1"),
        "fixed": truth("FALSE", "TRUE"),
        "configurations": word("Off"),
        "circles": word("ObjectFrame"),
        "speeds": Field(_LIST, _read_speeds, _write_speeds),
        "axes": Field(_LISTS, _read_axes, _write_axes),
        "pose": Field(
            rf"\[ ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?\]", _read_pose, _write_pose
        ),
        "frame": Field(_LISTS, _read_frame, _write_frame),
    },
    statements=(
        Statement("begin", "MODULE <name>", _BEFORE, then="data"),
        Statement("tool", f"TASK {_TOOLDATA}", _DATA),
        Statement("tool", _TOOLDATA, _DATA),
        Statement("work", f"TASK {_WOBJDATA}", _DATA),
        Statement("work", _WOBJDATA, _DATA),
        Statement("speed", "CONST speeddata <speed> := <speeds>;", _DATA),
        Statement("procedure", "PROC <name>()", _DATA, then="start"),
        Statement("set", "ConfL \\<configurations>;", _START),
        Statement("set", "CirPathMode \\<circles>;", _PROGRAM),
        Statement(
            "joint approach", "MoveAbsJ <axes>\\NoEOffs, <speed>, fine, <tool>;", _PROGRAM, "body"
        ),
        Statement(
            "joint", "MoveAbsJ <axes>\\NoEOffs, <speed>\\T:=<seconds>, <zone>, <tool>;", _BODY
        ),
        Statement("linear", "MoveL <pose>, <speed>, <zone>, <tool>\\WObj:=<work>;", _BODY),
        Statement(
            "linear", "MoveL <pose>, <speed>\\T:=<seconds>, <zone>, <tool>\\WObj:=<work>;", _BODY
        ),
        Statement(
            "circular", "MoveC <via:pose>, <pose>, <speed>, <zone>, <tool>\\WObj:=<work>;", _BODY
        ),
        Statement("wait", "WaitTime <seconds>;", _BODY),
        Statement("output", "SetDO <output>, <value>;", _BODY),
        Statement("event", "! event: <event>", _BODY),
        Statement("leave", "ENDPROC", _BODY, then="left"),
        Statement("end", "ENDMODULE", ("left",), then="after"),
    ),
)
