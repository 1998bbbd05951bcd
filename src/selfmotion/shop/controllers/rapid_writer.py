"""Writer of programs in ABB RAPID."""

from pathlib import Path as FilePath
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import ProblemError
from selfmotion.shop.controllers.configurations import confdata
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.pose_segments import PoseSegment
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_texts import module_name
from selfmotion.shop.controllers.program_writer import (
    ProgramWriter,
    WrittenPose,
    goes_round,
    speeds_of,
)
from selfmotion.shop.controllers.rapid import APPROACH_TURNING, FASTEST, NAME, RAPID, SLOW, TURNING
from selfmotion.shop.controllers.segments import Segment

# Names that no module may have.
# fmt: off
_WORDS = (
    "ALIAS", "AND", "BACKWARD", "BOOL", "CASE", "CONNECT", "CONST", "DEFAULT", "DIV", "DO",
    "DNUM", "ELSE", "ELSEIF", "ENDFOR", "ENDFUNC", "ENDIF", "ENDMODULE", "ENDPROC", "ENDRECORD",
    "ENDTEST", "ENDTRAP", "ENDWHILE", "ERROR", "EXIT", "FALSE", "FOR", "FROM", "FUNC", "GOTO",
    "IF", "INOUT", "LOCAL", "MOD", "MODULE", "NOSTEPIN", "NOT", "NOVIEW", "NUM", "OR", "PERS",
    "PROC", "RAISE", "READONLY", "RECORD", "RETRY", "RETURN", "STEP", "STRING", "SYSMODULE",
    "TEST", "THEN", "TO", "TRAP", "TRUE", "TRYNEXT", "UNDO", "UNTIL", "VAR", "VIEWONLY", "WHILE",
    "WITH", "XOR",
)
# fmt: on
# Comment where configurations are not known.
_UNKNOWN_CONFIGURATION = [
    "cfx is 0 in all targets and means nothing: the wrist axes of this arm do not meet in a",
    "point, or its zero is not that of ABB's arms. The configuration is that of the begin.",
]
# End of the name of the procedure.
_PROCEDURE = "_run"


class RapidWriter(ProgramWriter):
    """Writer of a module that an IRC5 or OmniCore loads."""

    language = RAPID

    @override
    def opening(self) -> list[str]:
        draft, name = self.draft, self.name
        if not any(axis.name.startswith("A") for axis in self.program.axes):
            raise ProblemError(f"{draft.robot.name}: axes: none is A1 to A6, which a robot has")
        slow = [float(f"{draft.settings.approach * x:g}") for x in (FASTEST, APPROACH_TURNING) * 2]
        data = [
            RAPID.text("begin", name=name),
            *self.head(),
            *map(self.comment, self._configuration_comment()),
            self._tool(),
            *self._work_object(),
            self.line("speed", speed=f"{name}{SLOW}", speeds=slow),
            *(
                self.line("speed", speed=f"{name}_f{k}", speeds=[1e3 * speed, *TURNING])
                for k, speed in enumerate(speeds_of(self.program), 1)
            ),
            "",
            self.line("procedure", name=f"{name}{_PROCEDURE}"),
        ]
        self.indent = "    "
        return [
            *data,
            *([] if draft.frames is None else [self.line("set", configurations="Off")]),
            *([self.line("set", circles="ObjectFrame")] if goes_round(self.program) else []),
            *self.joint_approach(self.program.segments[0]),
        ]

    @override
    def closing(self) -> list[str]:
        return [f"  {RAPID.text('leave')}", RAPID.text("end")]

    @override
    def before_step(self) -> list[str]:
        return [""]

    @override
    def linear_approach(self, segment: PoseSegment) -> list[str]:
        values = {**self._frames, "speed": f"{self.name}{SLOW}", "zone": "fine"}
        return [self.line("linear", pose=self.pose(segment, 0), **values)]

    @override
    def joint_approach(self, segment: Segment) -> list[str]:
        values = {"speed": f"{self.name}{SLOW}", "tool": f"{self.name}_t"}
        return [self.line("joint approach", axes=self.axes(segment, 0), **values)]

    @override
    def pace(self, segment: Segment, k: int) -> dict[str, Any]:
        stops = k == len(segment.t) - 1
        if isinstance(segment, FeedSegment):
            number = speeds_of(self.program).index(segment.speeds[k - 1]) + 1
            speed = f"{self.name}_f{number}"
            return {**self._frames, "speed": speed, "zone": "fine" if stops else "z0"}
        frames = self._frames if isinstance(segment, PoseSegment) else {"tool": f"{self.name}_t"}
        interval = segment.t[k] - segment.t[k - 1]
        zone = "fine" if stops else "z1"
        return {**frames, "speed": "v100", "seconds": interval, "zone": zone}

    @property
    def _frames(self) -> dict[str, str]:
        """Names of tool and work object."""
        return {"tool": f"{self.name}_t", "work": f"{self.name}_w"}

    @override
    def pose(self, segment: PoseSegment, k: int, configuration: str = "") -> WrittenPose:
        *quarters, cfx = confdata(segment.frames, segment.q[k, np.argsort(segment.order)])
        numbers = ", ".join(str(value) for value in (*quarters, cfx or 0))
        return super().pose(segment, k, configuration or numbers)

    def _configuration_comment(self) -> list[str]:
        """Return a comment where the arm's configurations are not known; nothing else."""
        first = next((x for x in self.program.segments if isinstance(x, PoseSegment)), None)
        if first is None:
            return []
        is_known = confdata(first.frames, first.q[0, np.argsort(first.order)])[3] is not None
        return [] if is_known else _UNKNOWN_CONFIGURATION

    def _tool(self) -> str:
        """Return the tool with its load: mass [kg] and centre of mass [mm]."""
        x, y, z = (1e3 * value for value in self.draft.settings.center)
        # A draft has a mass.
        load = {"mass": self.draft.settings.mass or 0.0, "x": x, "y": y, "z": z}
        return self.line("tool", tool=f"{self.name}_t", tool_frame=self.draft.tool, **load)

    def _work_object(self) -> list[str]:
        """Return the work object: in the world, or on a mechanical unit that carries it."""
        frames, name = self.draft.frames, f"{self.name}_w"
        if frames is None:
            return []
        values = {"fixed": True, "unit": "", "user": frames.work, "object": None}
        if frames.is_carried:
            unit = self.positioner(
                str,
                'a wobjdata names its mechanical unit; say positioner = "STN1", or what it is '
                "called",
            )
            values = {"fixed": False, "unit": unit, "user": None, "object": frames.work}
        return [self.line("work", work=name, **values)]


def write_rapid(file: FilePath, draft: Draft) -> None:
    """Write a program as a module that an IRC5 or OmniCore loads."""
    RapidWriter(draft, module_name(file, NAME - len(_PROCEDURE), _WORDS)).write(file)
