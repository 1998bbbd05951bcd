"""KUKA Robot Language, read line by line: what `selfmotion.controllers.krl` writes."""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array
from selfmotion.controllers.krl import NAME, UNBOUND_TURNING
from selfmotion.controllers.program_lines import ProgramReader, switched
from selfmotion.controllers.program_settings import AXES
from selfmotion.controllers.read_stretches import Pose, pose_of_values
from selfmotion.controllers.tool_frames import krl_pose
from selfmotion.robot import RobotModel
from selfmotion.task import SE3

# Parts whose sum is as near to their block's time as this [s] are seconds.
_ABOVE = 1e-4
# How the tool turns in circular segments is said by so many variables.
_KINDS = 2


class KrlReader(ProgramReader):
    """Reads a module: what `write_krl` writes, spaces, names and numbers aside."""

    comment, last = ";", "END"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self._parts: list[float] = []
        # Of the block that is read: axis targets, or poses.
        self._targets: list[list[float]] = []
        self._poses: list[Pose] = []
        self._by_poses = False
        # At which target what is switched.
        self._triggers: list[tuple[int, Sequence[str]]] = []
        # Of segments at speeds: $VEL.CP [m/s], that of each, and through where they go.
        self._speed = 0.0
        # How fast the tool turns at most [°/s], and what is said of how it turns.
        self._turning: dict[str, float] = {}
        self._turns: set[str] = set()
        # Which of the segments are smooth.
        self._smooth: list[bool] = []
        self._speeds: list[float] = []
        self._vias: list[Pose | None] = []

    def begin(self, given: Sequence[str]) -> None:
        """Begin the module."""
        self.name, self.state = given[0], "head"

    def tool_is(self, given: Sequence[str]) -> None:
        """Take the tool in the flange."""
        self.tool = self._frame(given[0])

    def work_is(self, given: Sequence[str]) -> None:
        """Take what poses are counted in, where it stands in the world."""
        self.work, self.is_carried = self._frame(given[0]), False

    def carried_work_is(self, given: Sequence[str]) -> None:
        """Take what poses are counted in, where an external kinematic system carries it."""
        self.work, self.is_carried = self._frame(given[0]), True

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        self.begin_at(self._target(given[0]))
        self.state = "body"

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        self.slowly(self._pose(given[0]))

    def block(self, given: Sequence[str]) -> None:
        """Begin a spline block."""
        self.state, self._parts, self._triggers = "block", [], []
        self._targets, self._poses = [], []
        self._speeds, self._vias, self._smooth = [], [], []
        self._by_poses = given[0].upper() == "SPLINE"

    def speed_is(self, given: Sequence[str]) -> None:
        """Take how fast segments are that do not say it themselves."""
        self._speed = self._speed_of(given[0])

    def turning_is(self, given: Sequence[str]) -> None:
        """Take how fast the tool turns at most."""
        self._turning[given[0].upper()] = self.lines.number_of(given[1])

    def turns(self, given: Sequence[str]) -> None:
        """Take what is said of how the tool turns."""
        self._turns.add(given[0].upper())

    def segment(self, given: Sequence[str]) -> None:
        """Take a straight or smooth segment at a speed, in a block or alone."""
        kind, pose, speed = given
        self._at_speed(self._pose(pose), None, speed, is_smooth=kind.upper() == "SPL")

    def round_segment(self, given: Sequence[str]) -> None:
        """Take a circular segment at a speed, in a block or alone."""
        via, pose, speed = given
        if len(self._turns) < _KINDS:
            raise self.lines.fault(
                "SCIRC needs $ORI_TYPE = #VAR and $CIRC_TYPE = #BASE at the head: else the tool "
                "turns otherwise"
            )
        self._at_speed(self._pose(pose), self._pose(via), speed)

    def _at_speed(
        self, pose: Pose, via: Pose | None, speed: str | None, *, is_smooth: bool = False
    ) -> None:
        alone = self.state == "body"
        if alone:
            self.block(["SPLINE"])
        if not self._by_poses:
            raise self.lines.fault("PTP_SPLINE has SPTP with times")
        self._poses.append(pose)
        self._vias.append(via)
        self._speeds.append(self._speed if speed is None else self._speed_of(speed))
        if not self._speeds[-1] > 0.0:
            raise self.lines.fault("a segment without a time, expected $VEL.CP before it")
        slow = [f"$VEL.{name}" for name, x in self._turning.items() if x < UNBOUND_TURNING]
        if slow:
            raise self.lines.fault(
                f"{slow[0]} is {self._turning[slow[0][5:]]:g}°/s, expected at least "
                f"{UNBOUND_TURNING:g}: a slower one holds the tool back from its speed"
            )
        self._smooth.append(is_smooth)
        if alone:
            self.close([])

    def _speed_of(self, text: str) -> float:
        value = self.lines.number_of(text)
        if not value > 0.0:
            raise self.lines.fault(f"$VEL.CP is {value:g} m/s, expected a number above 0")
        return value

    def start(self, _: Sequence[str]) -> None:
        """Begin its time block."""
        if self._speeds:
            raise self.lines.fault("a time block after segments without times")
        self.state = "time"

    def target(self, given: Sequence[str]) -> None:
        """Take an axis target."""
        self._check_kind(poses=False)
        self._targets.append(self._target(given[0]))

    def pose(self, given: Sequence[str]) -> None:
        """Take a pose."""
        self._check_kind(poses=True)
        self._poses.append(self._pose(given[0]))

    def _check_kind(self, *, poses: bool) -> None:
        if poses != self._by_poses:
            raise self.lines.fault("SPLINE has SPL and SLIN, PTP_SPLINE has SPTP")
        if self._count != len(self._parts):
            raise self.lines.fault("the target before has no TIME_BLOCK PART")

    @property
    def _count(self) -> int:
        return len(self._targets) + len(self._poses)

    def part(self, given: Sequence[str]) -> None:
        """Take the share of time of the target before."""
        if len(self._parts) >= self._count:
            raise self.lines.fault("there is no target before this part")
        self._parts.append(self.lines.duration(given[0]))

    def trigger(self, given: Sequence[str]) -> None:
        """Take what is switched at the target that follows."""
        self._triggers.append((self._count + 1, given))

    def whole(self, given: Sequence[str]) -> None:
        """Take the time of all of them."""
        seconds, parts = self.lines.duration(given[0]), self._parts
        if not parts or len(parts) != self._count:
            raise self.lines.fault("each target needs its TIME_BLOCK PART")
        share = seconds / sum(parts)
        # Parts are shares: those that are seconds stay what they are.
        scale = 1.0 if abs(share - 1.0) * sum(parts) < _ABOVE else share
        times = [scale * part for part in parts]
        for number, what in self._triggers:
            if number > len(parts):
                raise self.lines.fault("a trigger has no target after it")
            self.switches.append(switched(self.clock + sum(times[:number]), what))
        if self._by_poses:
            self.follow(self._poses, times)
        else:
            self.join(self._targets, times)
        self.state = "ended"

    def close(self, _: Sequence[str]) -> None:
        """End a spline block."""
        if self.state == "block":
            if not self._speeds:
                raise self.lines.fault("the spline block has no segments")
            if len(set(self._smooth)) > 1:
                raise self.lines.fault("SPL beside SLIN or SCIRC is not judged, expected SLIN")
            if any(number > len(self._speeds) for number, _ in self._triggers):
                raise self.lines.fault("a trigger has no target after it")
            given = self._poses, self._speeds, self._vias, self._triggers
            self.drive(*given, is_spline=all(self._smooth))
        self.state = "body"

    def _target(self, text: str) -> list[float]:
        values = self._values(text)
        present = [name for name in AXES if name in values]
        self.same_axes(present)
        return [values[name] for name in present]

    def _values(self, text: str) -> dict[str, float]:
        values: dict[str, float] = {}
        for item in text.split(","):
            name, _, number = item.strip().partition(" ")
            name = name.upper()
            if name in values:
                raise self.lines.fault(f"axis {name} is there twice")
            values[name] = self.lines.coordinate(number)
        return values

    def _pose(self, text: str) -> Pose:
        values = self._values(text)
        # Linear motions keep the status and turn of where they begin.
        place = self._numbers({name: x for name, x in values.items() if name not in ("S", "T")})
        outer = {name: x for name, x in values.items() if name.startswith("E")}
        return Pose(*krl_pose(place), self.others_of(outer), self.lines.number)

    def _numbers(self, values: dict[str, float]) -> Array:
        missing = [name for name in "XYZABC" if name not in values]
        if missing:
            raise self.lines.fault(f"has no {', '.join(missing)}")
        return np.array([values[name] for name in "XYZABC"])

    def _frame(self, text: str) -> SE3:
        place, turn = krl_pose(self._numbers(self._values(text)))
        return pose_of_values([*place.tolist(), *turn.tolist()])


_AXIS = r"[AE][1-6]\s+[^,{}]+"
_TARGET = rf"\{{\s*(?:E6AXIS\s*:|AXIS\s*:)?\s*({_AXIS}(?:,\s*{_AXIS})*)\}}"
_ANY = r"[^;{}]*"
_IN_BODY = ("head", "body")
_NUMBER = r"[A-Z][1-6]?\s+[^,{}]+"
_POSE = rf"\{{\s*(?:E6POS\s*:|POS\s*:|FRAME\s*:)?\s*({_NUMBER}(?:,\s*{_NUMBER})*)\}}"
_WITH = r"(?: WITH \$VEL\.CP ?= ?([\d.e-]+))?"
_UNIT = r"MACHINE_DEF ?\[ ?\d+ ?\]"
KrlReader.grammar = (
    (("before",), r"&(?:ACCESS|REL|PARAM|COMMENT)\b.*", KrlReader.skip),
    (("before",), rf"DEF ([A-Z]\w{{0,{NAME - 1}}}) ?\( ?\)", KrlReader.begin),
    (("head",), r"BAS ?\( ?#INITMOV ?, ?0 ?\)", KrlReader.skip),
    (_IN_BODY, r"BAS ?\( ?#(?:VEL|ACC)_PTP ?, ?[\d.]+ ?\)", KrlReader.skip),
    (_IN_BODY, r"\$VEL\.CP ?= ?([\d.e-]+)", KrlReader.speed_is),
    (_IN_BODY, r"\$VEL\.(ORI1|ORI2) ?= ?([\d.]+)", KrlReader.turning_is),
    (("head",), r"(\$ORI_TYPE) ?= ?#VAR", KrlReader.turns),
    (("head",), r"(\$CIRC_TYPE) ?= ?#BASE", KrlReader.turns),
    (("head",), rf"\$TOOL ?= ?{_POSE}", KrlReader.tool_is),
    (("head",), rf"\$BASE ?= ?{_POSE}", KrlReader.work_is),
    (
        ("head",),
        rf"\$BASE ?= ?EK ?\( ?{_UNIT}\.ROOT ?, ?{_UNIT}\.MECH_TYPE ?, ?{_POSE} ?\)",
        KrlReader.carried_work_is,
    ),
    (("head",), rf"\$LOAD ?= ?\{{{_ANY}\{{{_ANY}\}}{_ANY}\{{{_ANY}\}}{_ANY}\}}", KrlReader.skip),
    (_IN_BODY, rf"PTP {_TARGET}", KrlReader.go),
    (_IN_BODY[1:], rf"LIN {_POSE}", KrlReader.go_linear),
    (_IN_BODY[1:], r"WAIT SEC (\S+)", KrlReader.wait),
    (_IN_BODY, r"\$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)", KrlReader.switch),
    (_IN_BODY, r"; event: (.*)", KrlReader.switch),
    (_IN_BODY[1:], r"(PTP_SPLINE|SPLINE)", KrlReader.block),
    (("block",), r"TIME_BLOCK START", KrlReader.start),
    (("time",), rf"SPTP {_TARGET}", KrlReader.target),
    (("time",), rf"(?:SPL|SLIN) {_POSE}", KrlReader.pose),
    (("block", "body"), rf"(SPL|SLIN) {_POSE}{_WITH}", KrlReader.segment),
    (("block", "body"), rf"SCIRC {_POSE} ?, ?{_POSE}{_WITH}", KrlReader.round_segment),
    (("time",), r"TIME_BLOCK PART ?= ?(\S+)", KrlReader.part),
    (
        ("time", "block"),
        r"TRIGGER WHEN PATH ?= ?0 DELAY ?= ?0 DO \$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)",
        KrlReader.trigger,
    ),
    (("time", "block"), r"; event: (.*)", KrlReader.trigger),
    (("time",), r"TIME_BLOCK END ?= ?(\S+)", KrlReader.whole),
    (("ended", "block"), r"ENDSPLINE", KrlReader.close),
    (_IN_BODY, r"END", KrlReader.end),
)
