"""Messages of the library in terms of command-line options.

The library names arguments of Python; whoever types a command knows options.
"""

import re

# Arguments in messages of the library, and the options that stand for them; applied in this order.
_REPLACEMENTS = (
    (r"take robot\.inverse_kinematics\(.*?\), task, seed=start\)", "give another --start"),
    (r"\btask='(\w+)'", r"--task \1"),
    (r"\bcorners='(\w+)'", r"--set path.corners=\1"),
    (r"\(?\brelaxations=\)?", "with relaxations (--set)"),
    (r"\b(tool|start|feed)=(?=[\s;,.)]|$)", r"--\1"),
    (r"\block=(?=[\s;,.)]|$)", "--set robot.lock.NAME=VALUE"),
    (r"\bduration=(?=[\s;,.)]|$)", "--set path.duration=SECONDS"),
    (
        r"\b(acceleration|velocity)=(?=[\s;,.)]|$)",
        lambda match: f"--set constraints.Joint{match[1].capitalize()}Limits.limit=NUMBER",
    ),
    (r"give force=True to write it", "export --force writes it"),
    (r"give a larger jump", "give a larger --set path.jump"),
    (r"either a feed \[m/s\] or a duration \[s\]", "either --feed (m/s) or path.duration (s)"),
    (r"so that feed has no effect; drop one", "so that --feed has no effect; drop it"),
    (r"so that duration has no effect; drop one", "so that path.duration has no effect; drop it"),
    (r"which needs a feed \[m/s\]; give it", "which needs --feed (m/s)"),
    (r"\(Feed\.original\)", "(a duration in its place)"),
    (r"\(within=\)", "(--set path.within=0.5)"),
    (r"\((acceleration|turn_acceleration|turn_rate|within)=([0-9.e+]+)\)", r"(--set path.\1=\2)"),
    (r"\b(rotary|unit) = '(\w+)'", r"--set path.\1=\2"),
    (r"(?<!path\.)\b((?:flip|rotary)_\w+)", r"--set path.\1"),
    (r"(?<=: )(columns|standoff|rotary|ramp|unit) (?=has|is)", r"--set path.\1 "),
    (r"raise max_evaluations", "raise --set max_evaluations"),
    (r"give columns \(", "give --set path.columns ("),
    (r"choose another task \(", "choose another --task ("),
    (r"choose a task with fewer rows \(", "take another --task ("),
)
# Messages about a key of a problem file, or of a seam in it: they name keys, not arguments.
_ABOUT_FILE = re.compile(r"^(\S+\.(toml|json): |seam ')")


def in_shell(message: str) -> str:
    """Return a message with options in place of arguments."""
    if _ABOUT_FILE.match(message):
        return message
    for argument, option in _REPLACEMENTS:
        message = re.sub(argument, option, message)
    return message
