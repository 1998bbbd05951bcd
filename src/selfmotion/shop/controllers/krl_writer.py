"""Programs in KUKA Robot Language, written."""

from pathlib import Path as FilePath

import numpy as np
from typing_extensions import override

from selfmotion.shop.controllers.configurations import status_and_turn
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.krl import (
    APPROACH_SPEED,
    APPROACH_TURNING,
    FULL_SPEED,
    KRL,
    MAX_NAME_LENGTH,
    TRIGGER,
    UNBOUND_TURNING,
)
from selfmotion.shop.controllers.pose_segments import PoseSegment, largest_tool_speeds, linear_poses
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_texts import module_name
from selfmotion.shop.controllers.program_writer import (
    ProgramWriter,
    goes_round,
    speeds_of,
)
from selfmotion.shop.controllers.segments import Segment

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
# Speed above all that the times of targets need [m/s].
_UNBOUND = 2.0
# Largest $VEL.CP [m/s].
_MAX_SPEED = 3.0
# Ratio of the speed that is set to the speed that times need.
_ABOVE_TIMES = 1.02
# Length of path below which it has no direction [m].
_SHORT = 1e-3
# Distance of poses from their line by rounding [m].
_ON_LINE = 4e-7


class KrlWriter(ProgramWriter):
    """Writer of a module that a KR C4 or C5 selects."""

    language = KRL

    @override
    def opening(self) -> list[str]:
        draft, text = self.draft, KRL.text
        return [
            text("comment", header="ACCESS RVP"),
            text("comment", header="REL 1"),
            text("begin", name=self.name),
            *self.head(),
            self.line("initialise"),
            self._base(),
            self.line("set", tool=draft.tool),
            *self._load(),
            *self._slow(),
            *(self._arcs() if goes_round(self.program) else []),
            *self.joint_approach(self.program.segments[0]),
        ]

    @override
    def closing(self) -> list[str]:
        return [KRL.text("end")]

    @override
    def before_step(self) -> list[str]:
        return [""]

    @override
    def linear_approach(self, segment: PoseSegment) -> list[str]:
        configuration = ""
        notes: list[str] = []
        if segment is next(x for x in self.program.segments if isinstance(x, PoseSegment)):
            status, turn = status_and_turn(segment.frames, segment.q[0, np.argsort(segment.order)])
            configuration = f"T {turn}" if status is None else f"S {status}, T {turn}"
            notes = _UNKNOWN_STATUS if status is None else []
        fast = self._fast()
        return [
            *map(self.comment, notes),
            *self._slow(),
            self.line("linear approach", pose=self.pose(segment, 0, configuration)),
            # A seam at its feed says it itself.
            *(fast[1:] if isinstance(segment, FeedSegment) else fast),
        ]

    @override
    def motion(self, segment: Segment) -> list[str]:
        if segment.is_rest:
            return super().motion(segment)
        lines, kind = self.events(segment, 0), "joint"
        if isinstance(segment, FeedSegment):
            return [*lines, *self._at_speed(segment)]
        if isinstance(segment, PoseSegment):
            kind = "linear" if _is_straight(segment) else "spline"
            speed = _unbound(segment)
            # After a seam at its feed, or where times ask for more.
            if speeds_of(self.program) or speed > _UNBOUND:
                lines.append(self.line("set", speed=speed))
        block = "axis block" if kind == "joint" else "pose block"
        lines += [self.line(block), self._inner("times")]
        for k, interval in enumerate(np.diff(segment.t), 1):
            lines += [*self._triggers(segment, k), f"  {self.step(segment, k, kind)}"]
            lines.append(self._inner("part", seconds=interval))
        return [*lines, self._inner("whole", seconds=segment.t[-1]), self.line("close")]

    def _at_speed(self, segment: FeedSegment) -> list[str]:
        """Return the lines of a seam at its feed: one segment, or a block of them."""
        speeds, count = segment.speeds, len(segment.speeds)
        # Steps that bend, none of them round, are passed smoothly.
        bends = not (np.isfinite(segment.vias).any() or _is_straight(segment))
        kind = "spline" if bends and count > 1 else "linear"
        lines, commands = [self.line("set", speed=speeds[0])], list[str]()
        for k, speed in enumerate(speeds, 1):
            commands += self._triggers(segment, k)
            changed_speed = {"speed": speed} if speed != speeds[0] else {}
            commands.append(f"  {self.step(segment, k, kind, **changed_speed)}")
        if count == 1 and len(commands) == 1:
            return [*lines, commands[0][2:]]
        return [*lines, self.line("pose block"), *commands, self.line("close")]

    def _triggers(self, segment: Segment, k: int) -> list[str]:
        """Return the lines that switch outputs at a target."""
        # Without ONSTART a trigger is at the end of the motion that follows.
        return [
            f"  {line}" if line.strip().startswith(";") else f"    {_AT_TARGET}{line.strip()}"
            for line in self.events(segment, k)
        ]

    def _inner(self, kind: str, **values: object) -> str:
        """Return the line of a statement in a block."""
        return f"  {self.line(kind, **values)}"

    @override
    def joint_approach(self, segment: Segment) -> list[str]:
        slow, fast = (
            [self.line("set", VEL=percent), self.line("set", ACC=percent)]
            for percent in (FULL_SPEED * self.draft.settings.approach, FULL_SPEED)
        )
        return [*slow, self.line("joint approach", axes=self.axes(segment, 0)), *fast]

    def _slow(self) -> list[str]:
        """Return the speeds of slow linear motions."""
        share = self.draft.settings.approach
        return self._speeds(share * APPROACH_SPEED, share * APPROACH_TURNING)

    def _fast(self) -> list[str]:
        """Return the speeds below which times decide."""
        return self._speeds(_UNBOUND, UNBOUND_TURNING)

    def _speeds(self, speed: float, turning: float) -> list[str]:
        if self.draft.frames is None:
            return []
        return [
            self.line("set", speed=float(f"{speed:g}")),
            self.line("set", ORI1=turning),
            self.line("set", ORI2=turning),
        ]

    def _arcs(self) -> list[str]:
        return [self.line("set", orientation="#VAR"), self.line("set", circles="#BASE")]

    def _base(self) -> str:
        """Return the frame of poses: in the world, or of an external kinematic system."""
        frames = self.draft.frames
        if frames is None:
            return f"{self.indent}$BASE = {{X 0, Y 0, Z 0, A 0, B 0, C 0}}"
        if not frames.is_carried:
            return self.line("base", work=frames.work)
        unit = self.positioner(
            int,
            "$BASE names its kinematic system by its number in MACHINE_DEF; say positioner = 2, "
            "or which it is",
        )
        return self.line("base", unit=unit, work=frames.work)

    def _load(self) -> list[str]:
        settings = self.draft.settings
        if settings.mass is None:
            return []
        x, y, z = (1e3 * value for value in settings.center)
        return [self.line("set", mass=settings.mass, x=x, y=y, z=z)]


_UNKNOWN_STATUS = [
    "S is not stated: the wrist axes of this arm do not meet in a point, or its zero is",
    "not that of KUKA's arms. The configuration is that of the begin.",
]
# Beginning of a trigger at the next target.
_AT_TARGET = TRIGGER.partition("$OUT")[0]


def _unbound(segment: PoseSegment) -> float:
    """Return a speed above what the times of a segment need, if $VEL.CP can be it [m/s]."""
    fast, _ = largest_tool_speeds(segment.t, segment.positions, segment.quaternions)
    return float(min(max(_UNBOUND, np.ceil(1e3 * _ABOVE_TIMES * fast) / 1e3), _MAX_SPEED))


def _is_straight(segment: PoseSegment) -> bool:
    """Whether all poses are on one line that turns about one axis, one after the other."""
    rows = np.hstack([segment.positions, segment.quaternions])
    length = np.linalg.norm(rows[:, :3] - rows[0, :3], axis=1)
    if length[-1] < _SHORT or (np.diff(length) <= 0.0).any():
        return False
    line = linear_poses(length, length[[0, -1]], rows[[0, -1]])
    return bool(np.abs(line - rows).max() < _ON_LINE)


def write_krl(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that a KR C4 or C5 selects."""
    KrlWriter(draft, module_name(file, MAX_NAME_LENGTH, _WORDS)).write(file)
