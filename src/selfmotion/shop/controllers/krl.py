"""KUKA Robot Language: spline blocks of targets with times, or of poses at speeds."""

from selfmotion.shop.controllers.krl_aggregates import (
    AXES_PATTERN,
    POSE_PATTERN,
    read_axes,
    read_frame,
    read_pose,
    write_axes,
    write_frame,
    write_pose,
)
from selfmotion.shop.controllers.pose_numbers import TIME_DIGITS
from selfmotion.shop.controllers.program_reader import ProgramReader
from selfmotion.shop.controllers.statements import (
    NUMBER,
    Field,
    Language,
    Statement,
    number,
    seconds,
    truth,
    word,
)

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

# Largest number of characters in a name.
MAX_NAME_LENGTH = 24
# Largest speed of the approach [m/s].
APPROACH_SPEED = 0.5
# Largest rate of turning of the approach [°/s].
APPROACH_TURNING = 100.0
# Rate of turning that slows no seam down [°/s].
UNBOUND_TURNING = 400.0
# Largest share of the speeds of axes [%].
FULL_SPEED = 100.0


def _read_speed(reader: ProgramReader, text: str) -> float:
    """Return a speed of the tool above 0 [m/s]."""
    value = reader.lines.number_of(text)
    if not value > 0.0:
        raise reader.lines.fault(f"$VEL.CP is {value:g} m/s, expected a number above 0")
    return value


def _read_percent(reader: ProgramReader, text: str) -> float:
    """Return a share of the axes' speed or acceleration above 0 [%]."""
    value = reader.lines.number_of(text)
    if not 0.0 < value <= FULL_SPEED:
        raise reader.lines.fault(
            f"axes have {value:g} %, expected above 0 and up to {FULL_SPEED:g}"
        )
    return value


# States of a reader in which a statement may come: before the module, in its head, between motions
# (body), in a block, in its times.
_BEFORE = ("before",)
_HEAD = ("head",)
_BODY = ("body",)
_IN_MODULE = ("head", "body")
_IN_BLOCK = ("block",)
_IN_TIMES = ("time",)
_SEGMENT = ("body", "block", "time")
_PACED = ("body", "block")
# Statement that switches an output at a target.
TRIGGER = "TRIGGER WHEN PATH = 0 DELAY = 0 DO $OUT[<output>] = <value>"
KRL = Language(
    comment=";",
    last="END",
    outputs="KUKA's outputs are numbers from 1 on",
    has_output=lambda output: isinstance(output, int) and output >= 1,
    fields={
        "header": word(r"(?:ACCESS|REL|PARAM|COMMENT)\b.*"),
        "name": word(rf"[A-Z]\w{{0,{MAX_NAME_LENGTH - 1}}}"),
        "percent": Field(NUMBER, _read_percent, lambda value: f"{value:g}"),
        "speed": Field(NUMBER, _read_speed, lambda value: f"{value:.7g}"),
        "turning": number("g"),
        "orientation": word("#VAR"),
        "circles": word("#BASE"),
        "mass": number(".4f"),
        "length": number(".4f"),
        "seconds": seconds(TIME_DIGITS),
        "output": Field(r"\d+", lambda _, text: text),
        "value": truth("FALSE", "TRUE"),
        "event": word(".*"),
        "unit": Field(r"\d+", lambda _, text: text),
        "axes": Field(AXES_PATTERN, read_axes, write_axes),
        "pose": Field(POSE_PATTERN, read_pose, write_pose),
        "frame": Field(POSE_PATTERN, read_frame, write_frame),
    },
    statements=(
        Statement("comment", "&<header>", _BEFORE),
        Statement("begin", "DEF <name>()", _BEFORE, then="head"),
        Statement("initialise", "BAS(#INITMOV, 0)", _HEAD),
        Statement("base", "$BASE = <work:frame>", _HEAD),
        Statement(
            "base",
            "$BASE = EK(MACHINE_DEF[<unit>].ROOT, MACHINE_DEF[<unit>].MECH_TYPE, <work:frame>)",
            _HEAD,
        ),
        Statement("set", "$TOOL = <tool:frame>", _HEAD),
        Statement(
            "set",
            "$LOAD = {M <mass>, CM {X <x:length>, Y <y:length>, Z <z:length>, A 0, B 0, C 0}, "
            "J {X 0, Y 0, Z 0}}",
            _HEAD,
        ),
        Statement("set", "$ORI_TYPE = <orientation>", _HEAD),
        Statement("set", "$CIRC_TYPE = <circles>", _HEAD),
        Statement("set", "BAS(#VEL_PTP, <VEL:percent>)", _IN_MODULE),
        Statement("set", "BAS(#ACC_PTP, <ACC:percent>)", _IN_MODULE),
        Statement("set", "$VEL.CP = <speed>", _IN_MODULE),
        Statement("set", "$VEL.ORI1 = <ORI1:turning>", _IN_MODULE),
        Statement("set", "$VEL.ORI2 = <ORI2:turning>", _IN_MODULE),
        Statement("joint approach", "PTP <axes>", _IN_MODULE, then="body"),
        Statement("linear approach", "LIN <pose>", _BODY),
        Statement("wait", "WAIT SEC <seconds>", _BODY),
        Statement("output", "$OUT[<output>] = <value>", _IN_MODULE),
        Statement("event", "; event: <event>", _IN_MODULE),
        Statement("axis block", "PTP_SPLINE", _BODY, then="block"),
        Statement("pose block", "SPLINE", _BODY, then="block"),
        Statement("times", "TIME_BLOCK START", _IN_BLOCK, then="time"),
        Statement("joint", "SPTP <axes>", _IN_TIMES),
        Statement("spline", "SPL <pose>", _SEGMENT),
        Statement("spline", "SPL <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("linear", "SLIN <pose>", _SEGMENT),
        Statement("linear", "SLIN <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("circular", "SCIRC <via:pose>, <pose>", _PACED),
        Statement("circular", "SCIRC <via:pose>, <pose> WITH $VEL.CP = <speed>", _PACED),
        Statement("part", "TIME_BLOCK PART = <seconds>", _IN_TIMES),
        Statement("trigger", TRIGGER, ("time", "block")),
        Statement("trigger", "; event: <event>", ("time", "block")),
        Statement("whole", "TIME_BLOCK END = <seconds>", _IN_TIMES, then="ended"),
        Statement("close", "ENDSPLINE", ("ended", "block"), then="body"),
        Statement("end", "END", _IN_MODULE, then="after"),
    ),
)
