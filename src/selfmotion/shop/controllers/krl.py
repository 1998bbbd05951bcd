"""KUKA Robot Language: spline blocks of targets with times, written, and read line by line."""

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, ProblemError, write_text
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Quaternion
from selfmotion.shop.controllers.controller_program import (
    ControllerProgram,
    Draft,
    before,
    goes_round,
    head,
    speeds_of,
    with_begins,
)
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.program_lines import ProgramReader, switched
from selfmotion.shop.controllers.program_settings import AXES, written
from selfmotion.shop.controllers.program_texts import module_name, plain
from selfmotion.shop.controllers.read_segments import Pose, pose_of_values, times_of
from selfmotion.shop.controllers.segments import (
    PoseSegment,
    Segment,
    fastest_between,
    on_one_side,
    straight,
)
from selfmotion.shop.controllers.thinning import TIME_DIGITS
from selfmotion.shop.controllers.tool_frames import krl_numbers, krl_pose, status_and_turn

# KUKA Robot Language: spline blocks of axis targets with their times.
#
# After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators
# (KSS 8.3 SI V4): E6AXIS aggregates, ``PTP_SPLINE`` with ``SPTP`` segments and a ``TIME_BLOCK``,
# whose parts share its time in proportion, and the path trigger. ``PTP_SPLINE`` passes all
# targets on a smooth curve in axis space; ``TIME_BLOCK`` is how times are prescribed, whereas
# ``$VEL_AXIS`` counts in percent of what only the controller knows. Where the axes cannot keep a
# time, it takes longer.
#
# Tool poses are ``E6POS`` aggregates in ``$BASE``: ``SPL`` segments of a ``SPLINE`` block, and
# ``SLIN`` where the tool goes straight. Linear motions keep the status of where they begin, so
# that S and T decide nothing in them: the first pose has them for who makes it a ``PTP``. A seam
# at a feed has ``$VEL.CP`` in place of times, and ``SCIRC`` where it goes round, whose
# orientation turns evenly in ``$BASE`` (``$ORI_TYPE = #VAR``, ``$CIRC_TYPE = #BASE``).

# Names that no module may have.
# fmt: off
_WORDS = (
    "AND", "ANIN", "ANOUT", "AXIS", "B_AND", "B_EXOR", "B_NOT", "B_OR", "BOOL", "BRAKE", "CASE",
    "CCD_OFF", "CCD_ON", "CHAR", "CIRC", "CIRC_REL", "CONFIRM", "CONST", "CONTINUE", "DECL",
    "DEF", "DEFAULT", "DEFDAT", "DEFFCT", "DELAY", "DIGIN", "DIGOUT", "DO", "E6AXIS", "E6POS",
    "ELSE", "END", "ENDDAT", "ENDFCT", "ENDFOR", "ENDIF", "ENDLOOP", "ENDSPLINE", "ENDSWITCH",
    "ENDWHILE", "ENUM", "EXIT", "EXOR", "EXT", "EXTFCT", "FALSE", "FOR", "FRAME", "GLOBAL",
    "GOTO", "HALT", "IF", "IMPORT", "INT", "INTERRUPT", "IS", "LIN", "LIN_REL", "LOOP", "MAXIMUM",
    "MINIMUM", "NOT", "OFF", "ON", "OR", "POS", "PRIO", "PTP", "PTP_REL", "PTP_SPLINE", "PUBLIC",
    "REAL", "REPEAT", "RESUME", "RETURN", "SCIRC", "SEC", "SIGNAL", "SLIN", "SPL", "SPLINE",
    "SPTP", "STRUC", "SWITCH", "THEN", "TIME_BLOCK", "TO", "TRIGGER", "TRUE", "UNTIL", "WAIT",
    "WHEN", "WHILE",
)
# fmt: on
# Characters in a name.
NAME = 24
# Largest speed of the approach [m/s].
_FASTEST = 0.5
# Largest rate of turning of the approach [°/s].
_TURNING = 100.0
# Speed above all that the times of targets need [m/s].
_UNBOUND = 2.0
# Rate of turning above all that the times of targets need [°/s].
UNBOUND_TURNING = 400.0
# Largest share of the speeds of axes [%].
_WHOLE = 100.0
# Largest $VEL.CP [m/s].
_MOST = 3.0
# Ratio of the speed that is set to the speed that times need.
_ABOVE_ASKED = 1.02
# Length of path below which it has no direction [m].
_SHORT = 1e-3
# Distance of poses from their line by rounding [m].
_ON_LINE = 4e-7


def write_krl(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that a KR C4 or C5 selects."""
    program = draft.program
    name = module_name(file, NAME, _WORDS)
    percent = f"{100.0 * draft.settings.approach:g}"
    first = program.segments[0]
    lines = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEF {name}()",
        *(f"  ; {line}" for line in head(draft)),
        "  BAS(#INITMOV, 0)",
        f"  $BASE = {_base(draft)}",
        f"  $TOOL = {_frame(draft.tool)}",
        *_load(draft),
        *_slow_and_fast(draft)[0],
        *(["  $ORI_TYPE = #VAR", "  $CIRC_TYPE = #BASE"] if goes_round(program) else []),
        f"  BAS(#VEL_PTP, {percent})",
        f"  BAS(#ACC_PTP, {percent})",
        f"  PTP {_aggregate(first, 0, program)}",
        "  BAS(#VEL_PTP, 100)",
        "  BAS(#ACC_PTP, 100)",
    ]
    begins = True
    for segment, begun in with_begins(program.segments):
        lines += ["", f"  ; step: {plain(segment.name)}"]
        lines += [f"  ; {line}" for line in before(segment)]
        if begun is not None:
            lines += _slowly(draft, begun, percent, begins=begins)
            begins = False
        lines += _block(draft, segment)
    write_text(file, "\n".join([*lines, "END", ""]))


def _block(draft: Draft, segment: Segment) -> list[str]:
    """Return the lines of a motion from rest to rest, or of a rest."""
    at_begin = [_event(draft, item.name) for item in segment.events if item.target == 0]
    lines = [f"  {line}" for line in at_begin]
    if segment.is_rest:
        t = segment.t
        for k in range(1, len(t)):
            lines.append(f"  WAIT SEC {_seconds(t[k] - t[k - 1])}")
            lines += [
                f"  {_event(draft, item.name)}" for item in segment.events if item.target == k
            ]
        return lines
    if isinstance(segment, FeedSegment):
        return [*lines, *_at_speed(draft, segment)]
    block, command = "PTP_SPLINE", "SPTP"
    if isinstance(segment, PoseSegment):
        block, command = "SPLINE", "SLIN" if _is_straight(segment) else "SPL"
        speed = _unbound(segment)
        # After a seam at its feed, or where times ask for more.
        if speeds_of(draft.program) or speed > _UNBOUND:
            lines.append(f"  $VEL.CP = {speed:g}")
    lines += [f"  {block}", "    TIME_BLOCK START"]
    for k in range(1, len(segment.t)):
        lines += _triggers(draft, segment, k)
        lines.append(f"    {command} {_target(segment, k, draft.program)}")
        lines.append(f"    TIME_BLOCK PART = {_seconds(segment.t[k] - segment.t[k - 1])}")
    lines += [f"    TIME_BLOCK END = {_seconds(segment.t[-1])}", "  ENDSPLINE"]
    return lines


def _unbound(segment: PoseSegment) -> float:
    """Return a speed above what the times of a segment ask for, if $VEL.CP can be it [m/s]."""
    fast, _ = fastest_between(segment.t, segment.places, segment.turns)
    return float(min(max(_UNBOUND, np.ceil(1e3 * _ABOVE_ASKED * fast) / 1e3), _MOST))


def _at_speed(draft: Draft, segment: FeedSegment) -> list[str]:
    """Return the lines of a seam at its feed: one segment, or a block of them."""
    speeds, count = segment.speeds, len(segment.speeds)
    # Steps that bend, none of them round, are passed smoothly.
    bends = not (np.isfinite(segment.vias).any() or _is_straight(segment))
    straight_one = "SPL" if bends and count > 1 else "SLIN"
    lines, commands = [f"  $VEL.CP = {speeds[0]:.7g}"], []
    for k in range(1, count + 1):
        commands += _triggers(draft, segment, k)
        command = f"{straight_one} {_target(segment, k, draft.program)}"
        if segment.goes_round(k):
            via = _target(segment.middles, k - 1, draft.program)
            command = f"SCIRC {via}, {_target(segment, k, draft.program)}"
        own = f" WITH $VEL.CP = {speeds[k - 1]:.7g}" if speeds[k - 1] != speeds[0] else ""
        commands.append(f"    {command}{own}")
    if count == 1 and len(commands) == 1:
        return [*lines, commands[0][2:]]
    return [*lines, "  SPLINE", *commands, "  ENDSPLINE"]


def _triggers(draft: Draft, segment: Segment, k: int) -> list[str]:
    """Return the lines that switch outputs at a target."""
    lines = []
    for item in segment.events:
        if item.target == k:
            said = _event(draft, item.name)
            # Without ONSTART it is at the end of the motion that follows.
            comment = said.startswith(";")
            lines.append(
                f"    {said}" if comment else f"    TRIGGER WHEN PATH = 0 DELAY = 0 DO {said}"
            )
    return lines


def _slowly(draft: Draft, segment: Segment, percent: str, *, begins: bool) -> list[str]:
    """Return the slow motion to where a segment begins, of another kind than the one before."""
    if not isinstance(segment, PoseSegment):
        slow, fast = ([f"  BAS(#VEL_PTP, {x})", f"  BAS(#ACC_PTP, {x})"] for x in (percent, "100"))
        return [*slow, f"  PTP {_aggregate(segment, 0, draft.program)}", *fast]
    configuration = ""
    if begins:
        status, turn = status_and_turn(segment.frames, segment.q[0, np.argsort(segment.order)])
        configuration = f", T {turn}" if status is None else f", S {status}, T {turn}"
    slow, fast = _slow_and_fast(draft)
    unknown = [
        "  ; S is not stated: the wrist axes of this arm do not meet in a point, or its zero is",
        "  ; not that of KUKA's arms. The configuration is that of the begin.",
    ]
    return [
        *(unknown if begins and "S" not in configuration else []),
        *slow,
        f"  LIN {_target(segment, 0, draft.program, configuration)}",
        # A seam at its feed says it itself.
        *(fast[1:] if isinstance(segment, FeedSegment) else fast),
    ]


def _slow_and_fast(draft: Draft) -> tuple[list[str], list[str]]:
    """Return the speeds [m/s, °/s] of slow linear motions, and those that times decide below."""
    if draft.frames is None:
        return [], []
    share = draft.settings.approach
    both = ((share * _FASTEST, share * _TURNING), (_UNBOUND, UNBOUND_TURNING))
    slow, fast = (
        [f"  $VEL.CP = {speed:g}", f"  $VEL.ORI1 = {turn:g}", f"  $VEL.ORI2 = {turn:g}"]
        for speed, turn in both
    )
    return slow, fast


def _is_straight(segment: PoseSegment) -> bool:
    """Whether all poses are on one line that turns about one axis, one after the other."""
    rows = np.hstack([segment.places, segment.turns])
    way = np.linalg.norm(rows[:, :3] - rows[0, :3], axis=1)
    if way[-1] < _SHORT or (np.diff(way) <= 0.0).any():
        return False
    return bool(np.abs(straight(way, way[[0, -1]], rows[[0, -1]]) - rows).max() < _ON_LINE)


def _base(draft: Draft) -> str:
    """Return the frame of poses: the world, or an external kinematic system."""
    frames = draft.frames
    if frames is None:
        return "{X 0, Y 0, Z 0, A 0, B 0, C 0}"
    if not frames.is_carried:
        return _frame(frames.work)
    unit = draft.settings.positioner
    if not isinstance(unit, int):
        raise ProblemError(
            f"{draft.robot.name}: an axis carries work object '{frames.name}', and $BASE names its "
            f"kinematic system by its number in MACHINE_DEF; say positioner = 2, or which it is, "
            f"in the file of --settings (ProgramSettings(positioner=…))"
        )
    machine = f"MACHINE_DEF[{unit}]"
    return f"EK({machine}.ROOT, {machine}.MECH_TYPE, {_frame(frames.work)})"


def _target(segment: Segment, k: int, program: ControllerProgram, configuration: str = "") -> str:
    """Return a target: axes, or a pose and the external axes."""
    if not isinstance(segment, PoseSegment):
        return _aggregate(segment, k, program)
    numbers = krl_numbers(segment.places[k], segment.turns[k])
    pose = [f"{name} {value:.5f}" for name, value in zip("XYZABC", numbers, strict=True)]
    values = zip(program.axes, written(segment.q[k], program.axes), strict=True)
    outer = [f"{axis.name} {value}" for axis, value in values if axis.name.startswith("E")]
    return "{" + ", ".join(pose) + configuration + "".join(f", {text}" for text in outer) + "}"


def _event(draft: Draft, event: str) -> str:
    signal = draft.signal(event)
    if signal is None:
        return f"; event: {plain(event)}"
    output, value = signal
    if not isinstance(output, int) or output < 1:
        raise ProblemError(
            f"signals: '{event}' switches {output!r}; KUKA's outputs are numbers from 1 on"
        )
    return f"$OUT[{output}] = {str(value).upper()}"


def _aggregate(segment: Segment, k: int, program: ControllerProgram) -> str:
    values = written(segment.q[k], program.axes)
    named = zip(program.axes, values, strict=True)
    return "{" + ", ".join(f"{axis.name} {value}" for axis, value in named) + "}"


def _frame(pose: SE3) -> str:
    numbers = krl_numbers(np.array(pose.translation), np.array(Quaternion(pose.rotation).coeffs()))
    values = zip("XYZABC", numbers, strict=True)
    return "{" + ", ".join(f"{name} {value:.5f}" for name, value in values) + "}"


def _load(draft: Draft) -> list[str]:
    mass, (x, y, z) = draft.settings.mass, (1e3 * value for value in draft.settings.center)
    if mass is None:
        return []
    return [
        f"  $LOAD = {{M {mass:.4f}, CM {{X {x:.4f}, Y {y:.4f}, Z {z:.4f}, A 0, B 0, C 0}}, "
        f"J {{X 0, Y 0, Z 0}}}}"
    ]


def _seconds(value: float) -> str:
    return f"{value:.{TIME_DIGITS}f}"


# KUKA Robot Language, read line by line: what `selfmotion.shop.controllers.krl` writes.

# Parts whose sum is as near to their block's time as this [s] are seconds.
_ABOVE = 1e-4
# Variables that set how the tool turns in circular segments.
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
        self._is_set = False
        # Share of their speed and acceleration that axes have in motions by axes [%].
        self._percent: dict[str, float] = {}
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
        unit, other, frame = given
        if unit != other:
            raise self.lines.fault(f"MACHINE_DEF[{unit}] beside MACHINE_DEF[{other}], expected one")
        self.work, self.is_carried, self.unit = self._frame(frame), True, unit

    def loaded(self, given: Sequence[str]) -> None:
        """Take what the flange carries; its inertia is the controller's."""
        mass, center = given
        values = self._values(center)
        self.load_is(mass, [str(values.get(name, 0.0)) for name in "XYZ"], 1e-3)

    def initialise(self, _: Sequence[str]) -> None:
        """Take that all that is set begins anew, which has to come before anything is set."""
        if self._is_set or self._percent or self._speed or self.tool or self.work or self.load:
            raise self.lines.fault(
                "BAS(#INITMOV, 0) after frames, speeds or the load were set, expected it once and "
                "first: it may set them back"
            )
        self._is_set = True

    def axes_are(self, given: Sequence[str]) -> None:
        """Take at which share of their speed or acceleration the axes move [%]."""
        percent = self.lines.number_of(given[1])
        if not 0.0 < percent <= _WHOLE:
            raise self.lines.fault(f"#{given[0]}_PTP is {percent:g} %, expected up to {_WHOLE:g}")
        self._percent[given[0].upper()] = percent

    def go(self, given: Sequence[str]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        facts = self.lines.facts()
        most = _WHOLE if facts is None else _WHOLE * facts.approach
        fast = [name for name in ("VEL", "ACC") if not 0.0 < self._share(name) <= most + _ABOVE]
        if fast:
            raise self.lines.fault(
                f"PTP goes to where the motion goes on at BAS(#{fast[0]}_PTP) of "
                f"{self._share(fast[0]):g} %, expected up to {most:g}: nothing has judged it"
            )
        self.begin_at(self._target(given[0]))
        self.state = "body"

    def go_linear(self, given: Sequence[str]) -> None:
        """Take the pose from which the motion goes on by poses."""
        turning = max(self._turning.values(), default=0.0)
        if not (0.0 < self._speed <= _FASTEST and turning <= _TURNING):
            raise self.lines.fault(
                f"LIN goes to where the motion goes on at {self._speed:g} m/s and {turning:g}°/s, "
                f"expected at most {_FASTEST:g} m/s and {_TURNING:g}°/s: nothing has judged it"
            )
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

    def command(self, given: Sequence[str]) -> None:
        """Take a straight or smooth segment at a speed, in a block or alone."""
        kind, pose, speed = given
        self._at_speed(self._pose(pose), None, speed, is_smooth=kind.upper() == "SPL")

    def circular_command(self, given: Sequence[str]) -> None:
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
            self._check_in_time(times)
            self.follow(self._poses, times)
        else:
            slow = [f"#{name}_PTP" for name in ("VEL", "ACC") if self._share(name) < _WHOLE]
            if slow:
                share = self._share(slow[0][1:4])
                raise self.lines.fault(
                    f"BAS({slow[0]}) before this block is {share:g} %, expected {_WHOLE:g}: less "
                    f"holds the axes back from their times"
                )
            self.join(self._targets, times)
        self.state = "ended"

    def _share(self, name: str) -> float:
        return self._percent.get(name, 0.0)

    def _check_in_time(self, times: Sequence[float]) -> None:
        """Refuse speeds in force that hold the tool back from the times of a block."""
        if self.pose_at is None:
            return
        every = [self.pose_at, *self._poses]
        places = np.array([pose.place for pose in every])
        turns = np.array([pose.turn for pose in every])
        fast, turning = fastest_between(times_of(times), places, on_one_side(turns))
        least = min(self._turning.get(name, 0.0) for name in ("ORI1", "ORI2"))
        if fast > self._speed:
            raise self.lines.fault(
                f"times ask for {fast:.4g} m/s, $VEL.CP is {self._speed:g} m/s: it holds the tool "
                f"back from its times"
            )
        if np.degrees(turning) > least:
            raise self.lines.fault(
                f"times ask for {np.degrees(turning):.4g}°/s, $VEL.ORI1 or $VEL.ORI2 is "
                f"{least:g}°/s: it holds the tool back from its times"
            )

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
_IN_BODY = ("head", "body")
_NUMBER = r"[A-Z][1-6]?\s+[^,{}]+"
_POSE = rf"\{{\s*(?:E6POS\s*:|POS\s*:|FRAME\s*:)?\s*({_NUMBER}(?:,\s*{_NUMBER})*)\}}"
_WITH = r"(?: WITH \$VEL\.CP ?= ?([\d.e-]+))?"
_UNIT = r"MACHINE_DEF ?\[ ?(\d+) ?\]"
_XYZABC = r"\{((?: ?,? ?[XYZABC] [^,{}]+)+)\}"
_NO_INERTIA = r"\{ ?X 0(?:\.0*)? ?, ?Y 0(?:\.0*)? ?, ?Z 0(?:\.0*)? ?\}"
KrlReader.grammar = (
    (("before",), r"&(?:ACCESS|REL|PARAM|COMMENT)\b.*", KrlReader.skip),
    (("before",), rf"DEF ([A-Z]\w{{0,{NAME - 1}}}) ?\( ?\)", KrlReader.begin),
    (("head",), r"BAS ?\( ?#INITMOV ?, ?0 ?\)", KrlReader.initialise),
    (_IN_BODY, r"BAS ?\( ?#(VEL|ACC)_PTP ?, ?([\d.]+) ?\)", KrlReader.axes_are),
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
    (
        ("head",),
        rf"\$LOAD ?= ?\{{ ?M ([^,{{}}]+), ?CM {_XYZABC} ?, ?J {_NO_INERTIA} ?\}}",
        KrlReader.loaded,
    ),
    (_IN_BODY, rf"PTP {_TARGET}", KrlReader.go),
    (_IN_BODY[1:], rf"LIN {_POSE}", KrlReader.go_linear),
    (_IN_BODY[1:], r"WAIT SEC (\S+)", KrlReader.wait),
    (_IN_BODY, r"\$OUT ?\[ ?(\d+) ?\] ?= ?(TRUE|FALSE)", KrlReader.switch),
    (_IN_BODY, r"; event: (.*)", KrlReader.switch),
    (_IN_BODY[1:], r"(PTP_SPLINE|SPLINE)", KrlReader.block),
    (("block",), r"TIME_BLOCK START", KrlReader.start),
    (("time",), rf"SPTP {_TARGET}", KrlReader.target),
    (("time",), rf"(?:SPL|SLIN) {_POSE}", KrlReader.pose),
    (("block", "body"), rf"(SPL|SLIN) {_POSE}{_WITH}", KrlReader.command),
    (("block", "body"), rf"SCIRC {_POSE} ?, ?{_POSE}{_WITH}", KrlReader.circular_command),
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
