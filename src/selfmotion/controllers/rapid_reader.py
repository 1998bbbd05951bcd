"""ABB RAPID, read line by line: what `selfmotion.controllers.rapid` writes."""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.controllers.feed_stretches import ZONE
from selfmotion.controllers.program_lines import StopReader
from selfmotion.controllers.program_settings import AXES
from selfmotion.controllers.read_stretches import Pose, pose_of_values
from selfmotion.controllers.tool_frames import rapid_pose
from selfmotion.robot import RobotModel
from selfmotion.task import SE3

# What the speed of slow motions is called by at its end.
SLOW = "_v"
# Zones of seams at speeds, in which corners are rounded by as much as is judged.
_ZONES = ("fine", "z0")
# How fast the tool turns at most, and external axes [°/s, mm/s, °/s]: none of it slows a seam down.
TURNING = (500.0, 5000.0, 1000.0)
# From where on a number means that there is no such axis.
_ABSENT_FROM = 8.9e9


class RapidReader(StopReader):
    """Reads a module: what `write_rapid` writes, spaces, names and numbers aside."""

    comment, last = "!", "ENDMODULE"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        # Speeds by the names of their speeddata: of the tool [mm/s], and of what turns.
        self._known: dict[str, list[float]] = {}
        # What tool and work object of the module are called, and whether arcs turn as is judged.
        self._tool_name, self._work_name, self._turns_evenly = "", "", False

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "data"

    def tool_is(self, given: Sequence[str]) -> None:
        """Take the tool in the flange."""
        if self._tool_name:
            raise self.lines.fault(f"there is a tooldata '{self._tool_name}' already, expected one")
        self._tool_name = given[0].lower()
        self.tool = self._frame(given[1], given[2])

    def work_is(self, given: Sequence[str]) -> None:
        """Take the work object: user frame and object frame, the first one of a unit its own."""
        if self._work_name:
            raise self.lines.fault(f"there is a wobjdata '{self._work_name}' already, expected one")
        self._work_name = given[0].lower()
        fixed, user, object_ = given[1].upper() == "TRUE", given[2:4], given[4:6]
        self.is_carried = not fixed
        own = self._frame(*object_)
        self.work = self._frame(*user) * own if fixed else own

    def procedure(self, _: Sequence[str]) -> None:
        """Begin its procedure."""
        self.state = "start"

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        self._check_stopped("a slow motion")
        self.begin_at(self._target(given[0], given[1]))
        self.state = "body"

    def speed_is(self, given: Sequence[str]) -> None:
        """Take the speed of a speeddata [mm/s]."""
        values = [self.lines.number_of(item) for item in self._texts(given[1], 4, "speeddata")]
        if not values[0] > 0.0:
            raise self.lines.fault(f"v_tcp is {values[0]:g} mm/s, expected a number above 0")
        self._known[given[0].lower()] = values

    def arcs_turn_evenly(self, _: Sequence[str]) -> None:
        """Take how the tool turns in circular motions."""
        self._turns_evenly = True

    def move_at_speed(self, given: Sequence[str]) -> None:
        """Take a pose at a speed, straight or round; one that is called …_v is a slow motion."""
        *poses, speed, zone, tool, work = given
        self._check_names(tool, work)
        if not poses[4:] and speed.lower().endswith(SLOW):
            if zone.lower() != "fine":
                raise self.lines.fault(f"a slow motion has zone {zone}, expected fine")
            self.go_linear(poses)
            return
        if self.axes or self.times:
            raise self.lines.fault(
                "a motion at a speed after one with a time, expected fine before"
            )
        if speed.lower() not in self._known:
            raise self.lines.fault(f"speed '{speed}' is no speeddata of the module")
        self._check_judged(speed, zone, is_round=bool(poses[4:]))
        pose, via = self._pose(poses[-4:]), self._pose(poses[:4]) if poses[4:] else None
        fast = 1e-3 * self._known[speed.lower()][0]
        self.take_pose_at_speed(pose, via, fast, stops=zone.lower() == "fine")

    def _check_names(self, tool: str, work: str) -> None:
        """Refuse a pose of another tool or work object than those of the module."""
        for kind, name, known in (
            ("tool", tool, self._tool_name),
            ("work object", work, self._work_name),
        ):
            if name.lower() != known:
                raise self.lines.fault(
                    f"{kind} is '{name}', expected '{known}', the one that the module has"
                )

    def _check_judged(self, speed: str, zone: str, *, is_round: bool) -> None:
        """Refuse what makes another motion of a seam at its speed than the one that is judged."""
        if zone.lower() not in _ZONES:
            raise self.lines.fault(
                f"zone is {zone}, expected fine or z0: corners of seams at speeds are judged as "
                f"rounded by {1e3 * ZONE:g} mm at most"
            )
        turning = self._known[speed.lower()][1:]
        if any(own < least for own, least in zip(turning, TURNING, strict=True)):
            raise self.lines.fault(
                f"speeddata '{speed}' has {', '.join(f'{x:g}' for x in turning)} for turning and "
                f"external axes, expected at least {', '.join(f'{x:g}' for x in TURNING)}: slower "
                f"ones hold the tool back from its speed"
            )
        if is_round and not self._turns_evenly:
            raise self.lines.fault(
                "MoveC needs CirPathMode \\ObjectFrame before it: else the tool turns otherwise"
            )

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        self._check_stopped("a slow motion")
        self.slowly(self._pose(given))

    def wait(self, given: Sequence[str]) -> None:
        """Take a rest."""
        self._check_stopped("the arm is to rest")
        super().wait(given)

    def move(self, given: Sequence[str]) -> None:
        """Take an axis target."""
        robot, others, seconds, zone = given
        if self.poses:
            raise self.lines.fault("an axis target after a pose whose zone is not fine")
        axes, taken = self._target(robot, others), self.lines.duration(seconds)
        self.take_axes(axes, taken, stops=zone.lower() == "fine")

    def move_linear(self, given: Sequence[str]) -> None:
        """Take a pose."""
        *target, seconds, zone, tool, work = given
        self._check_names(tool, work)
        if self.axes or self.speeds:
            raise self.lines.fault("a pose after another kind of target whose zone is not fine")
        pose, taken = self._pose(target), self.lines.duration(seconds)
        self.take_pose(pose, taken, stops=zone.lower() == "fine")

    def leave(self, _: Sequence[str]) -> None:
        """End the procedure."""
        if self.is_moving:
            raise self.lines.fault("the last target has a zone, expected fine")
        self.state = "left"

    def _check_stopped(self, what: str) -> None:
        if self.is_moving:
            raise self.lines.fault(f"{what} where it does not stop: zone is not fine")

    def _frame(self, place: str, turn: str) -> SE3:
        position, rotation = self._list(place, 3, "trans"), self._list(turn, 4, "rot")
        if not any(rotation):
            raise self.lines.fault("the quaternion is zero")
        w, x, y, z = rotation
        return pose_of_values([*(1e-3 * value for value in position), x, y, z, w])

    def _pose(self, given: Sequence[str]) -> Pose:
        place, turn, configuration, others = given
        self._list(configuration, 4, "robconf")
        numbers = [*self._list(place, 3, "trans"), *self._list(turn, 4, "rot")]
        if not any(numbers[3:]):
            raise self.lines.fault("the quaternion is zero")
        outer = dict(zip(AXES[6:], self._texts(others, 6, "extax"), strict=True))
        present = {
            name: self.lines.coordinate(text)
            for name, text in outer.items()
            if not self._is_absent(name, text)
        }
        position, rotation = rapid_pose(np.array(numbers))
        return Pose(position, rotation, self.others_of(present), self.lines.number)

    def _list(self, text: str, count: int, what: str) -> list[float]:
        return [self.lines.coordinate(item) for item in self._texts(text, count, what)]

    def _texts(self, text: str, count: int, what: str) -> list[str]:
        values = text.split(",")
        if len(values) != count:
            raise self.lines.fault(f"{what} has {len(values)} numbers, expected {count}")
        return values

    def _target(self, robot: str, others: str) -> list[float]:
        own, outer = self._texts(robot, 6, "robax"), self._texts(others, 6, "extax")
        every = dict(zip(AXES, [*own, *outer], strict=True))
        self.same_axes([name for name, text in every.items() if not self._is_absent(name, text)])
        return [self.lines.coordinate(every[name]) for name in self.present]

    def _is_absent(self, name: str, text: str) -> bool:
        return name in AXES[6:] and abs(self.lines.number_of(text)) > _ABSENT_FROM


_WORD = r"[A-Z]\w{0,31}"
_LIST = r"\[([^\[\]]*)\]"
_TARGET = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_POSE = rf"\[ ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?, ?{_LIST} ?\]"
_FRAME = rf"\[ ?{_LIST} ?, ?{_LIST} ?\]"
_TIMED = rf"{_WORD} ?\\T ?:= ?([^,]+), ?(fine|z[0-9]{{1,3}})"
_FRAMES = rf"({_WORD}) ?\\WObj ?:= ?({_WORD}) ?;"
_AT_SPEED = rf"({_WORD}) ?, ?(fine|z[0-9]{{1,3}}) ?, ?{_FRAMES}"
RapidReader.grammar = (
    (("before",), rf"MODULE ({_WORD})", RapidReader.begin),
    (
        ("data",),
        rf"(?:TASK )?PERS tooldata ({_WORD}) ?:= ?\[ ?TRUE ?, ?{_FRAME}[^;!]*\];",
        RapidReader.tool_is,
    ),
    (
        ("data",),
        rf"(?:TASK )?PERS wobjdata ({_WORD}) ?:= ?\[ ?FALSE ?, ?(TRUE|FALSE) ?, ?\"\w*\" ?, ?"
        rf"{_FRAME} ?, ?{_FRAME} ?\];",
        RapidReader.work_is,
    ),
    (("data",), rf"CONST speeddata ({_WORD}) ?:= ?{_LIST};", RapidReader.speed_is),
    (("data",), rf"PROC {_WORD} ?\( ?\)", RapidReader.procedure),
    (("start", "body"), r"ConfL ?\\ ?(?:On|Off) ?;", RapidReader.skip),
    (("start", "body"), r"CirPathMode ?\\ ?ObjectFrame ?;", RapidReader.arcs_turn_evenly),
    (
        ("start", "body"),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?{_WORD} ?, ?fine ?, ?{_WORD} ?;",
        RapidReader.go,
    ),
    (
        ("body",),
        rf"MoveAbsJ {_TARGET} ?\\NoEOffs ?, ?{_TIMED} ?, ?{_WORD} ?;",
        RapidReader.move,
    ),
    (("body",), rf"MoveL {_POSE} ?, ?{_AT_SPEED}", RapidReader.move_at_speed),
    (("body",), rf"MoveC {_POSE} ?, ?{_POSE} ?, ?{_AT_SPEED}", RapidReader.move_at_speed),
    (
        ("body",),
        rf"MoveL {_POSE} ?, ?{_TIMED} ?, ?{_FRAMES}",
        RapidReader.move_linear,
    ),
    (("body",), r"WaitTime ([^;\s]+) ?;", RapidReader.wait),
    (("body",), rf"SetDO ({_WORD}) ?, ?([01]) ?;", RapidReader.switch),
    (("body",), r"! event: (.*)", RapidReader.switch),
    (("body",), r"ENDPROC", RapidReader.leave),
    (("left",), r"ENDMODULE", RapidReader.end),
)
