"""What messages of the library advise, in the words of the shell."""

import re

# As the library says it → as the shell does, in this order.
_WORDS = (
    (r"take robot\.inverse_kinematics\(.*?\), task, seed=start\)", "give another --start"),
    (r"\b(task|corners)='(\w+)'", r"--\1 \2"),
    (r"\(?\brelaxations=\)?", "with --relax"),
    (r"\b(tool|lock|start|acceleration|velocity|duration|feed)=(?=[\s;,.)]|$)", r"--\1"),
    (r"give force=True to write it", "export --force writes it"),
    (r"give a larger jump", "give a larger --jump"),
    (r"either a feed \[m/s\] or a duration \[s\]", "either --feed (m/s) or --duration (s)"),
    (
        r"so that (feed|duration) has no effect; drop one",
        r"so that --\1 has no effect; drop it",
    ),
    (r"which needs a feed \[m/s\]; give it", "which needs --feed (m/s)"),
    (r"\(Feed\.original\)", "(a duration in its place)"),
    (r"\(within=\)", "(--set path.within=0.5)"),
    (r"\((acceleration|turn_acceleration|turn_rate|within)=([0-9.e+]+)\)", r"(--set path.\1=\2)"),
    (r"\bflip_normals\b", "--flip-normals"),
    (r"\b(rotary|unit) = '(\w+)'", r"--\1 \2"),
    (r"\brotary_(axes|center)\b", r"--rotary-\1"),
    (r"(?<=: )(columns|standoff|rotary|ramp|unit) (?=has|is)", r"--\1 "),
    (r"raise max_evaluations", "raise --max-evaluations"),
    (r"give columns \(", "give --columns ("),
    (r"choose another task \(", "choose another --task ("),
    (r"choose a task with fewer rows \(", "take another --task ("),
)
# Such a message is about a key of the file, or of a seam in it, and says what can be written there.
_OF_PROBLEM_FILE = re.compile(r"^(\S+\.(toml|json): |seam ')")


def in_shell(message: str) -> str:
    """Return a message with the names of options for those of arguments."""
    if _OF_PROBLEM_FILE.match(message):
        return message
    for words, option in _WORDS:
        message = re.sub(words, option, message)
    return message
