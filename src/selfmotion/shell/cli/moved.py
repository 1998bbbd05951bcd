"""Options and commands of the version before, with what takes their place; gone with the next.

Most options became keys of problem files, which ``--set KEY=VALUE`` sets. The tables map an option
to a template of KEY=VALUE, in which a word in capitals stands for the value that was typed:

    V             the value as it is
    EACH          a number, or numbers with commas as a list: one for each joint
    LIST          numbers with commas, as a list
    NAMES         names with commas, as a list of strings
    AXIS          x, y or z, as a vector
    POSE          six numbers with commas, as a position and a rotation vector
    [COST]        KIND=WEIGHT, as the table of a cost
    [RELAXATION]  ROWS=BAND@FIRST:LAST, as the table of a relaxation
"""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence

# Options that say how a path is read.
_PATH_OPTIONS = {
    "--normal": "path.normal=AXIS",
    "--duration": "path.duration=V",
    "--jump": "path.jump=V",
    "--seam": "path.seam=V",
    "--columns": "path.columns=NAMES",
    "--flip-normals": "path.flip_normals=true",
    "--standoff": "path.standoff=V",
    "--along": "path.along=V",
    "--lead": "path.lead=V",
    "--tilt": "path.tilt=V",
    "--lift": "path.lift=V",
    "--rotary": "path.rotary=V",
    "--rotary-axes": "path.rotary_axes=V",
    "--rotary-center": "path.rotary_center=LIST",
    "--unit": "path.unit=V",
    "--ramp": "path.ramp=V",
    "--corners": "path.corners=V",
    "--corner-tolerance": "path.tolerance=V",
}
# Options of the arm.
_ROBOT_OPTIONS = {
    "--reference": "robot.reference=V",
    "--lock": "robot.lock.V",
    "--argument": "robot.arguments.V",
    "--packages": "robot.packages=NAMES",
}
# Options of collisions between its links.
_LINK_OPTIONS = {
    "--srdf": "clearance.srdf=V",
    "--disabled": "clearance.disabled=[NAMES]",
    "--no-self-collision": "clearance=false",
}
_LIMIT_OPTIONS = {
    "--velocity": "constraints.JointVelocityLimits.limit=EACH",
    "--acceleration": "constraints.JointAccelerationLimits.limit=EACH",
}
# Options of all commands that read a problem.
_PROBLEM_OPTIONS = {
    **_PATH_OPTIONS,
    **_ROBOT_OPTIONS,
    **_LINK_OPTIONS,
    **_LIMIT_OPTIONS,
    "--joint-limits": "joint_limits=V",
    "--obstacles": "clearance.obstacles=@V",
    "--clearance": "clearance.distance=V",
}
# Ends of templates whose options may be given several times: the values are one list.
_REPEATABLE = ("NAMES", "[NAMES]", "[RELAXATION]", "[COST]")
_LOOP_NUMBERS = ("horizon", "period", "cycle", "latency", "silence", "seconds")
# Command → option → template of what is typed after --set in its place.
MOVED: Mapping[str, Mapping[str, str]] = {
    "plan": {
        **_PROBLEM_OPTIONS,
        "--circle": 'path={kind="circle", radius=V, normal=[1, 0, 0], duration=4}',
        "--line": 'path={kind="line", by=LIST, duration=4}',
        "--relax": "relaxations=[RELAXATION]",
        "--degree": 'null_motion={kind="PolynomialNullMotion", degree=V}',
        "--mu": "costs.InverseManipulability.mu=V",
        "--cost": "costs=[COST]",
        "--closed": "constraints.ClosedPath=true",
        "--damped": "damping=true",
        "--max-evaluations": "max_evaluations=V",
        "--search": "search.mode=V",
        "--compare": "search.compare=true",
    },
    "check": _PROBLEM_OPTIONS,
    "init": {**_ROBOT_OPTIONS, **_LINK_OPTIONS},
    "compare": {"--cost": "costs=[COST]"},
    "export": {
        "--targets": "targets=V",
        "--wobj": "work_object=POSE",
        "--mass": "mass=V",
    },
    "follow": {f"--{name}": f"loop.{name}=V" for name in _LOOP_NUMBERS},
}
# Command → option → the option that is typed in its place.
_OTHER_OPTIONS: Mapping[str, Mapping[str, str]] = {
    "place": {
        **{f"--{name}": f"--within {name}=V" for name in ("x", "y", "z", "roll", "pitch", "yaw")},
        "--base": "--of base",
        "--path-alone": "--of path",
    },
    "sheet": {"--part-number": "--number part=V", "--order-number": "--number order=V"},
}
# Command → what is typed in its place.
_COMMANDS = {
    "fastest": "selfmotion plan FILE --set goal=fastest --deadline 60 (limits: --set "
    "constraints.JointAccelerationLimits.limit=8; --keep KIND=FACTOR: --set keep.KIND=FACTOR)",
    "track": "python examples/moving_target.py, or selfmotion follow with a controller",
}


def replacement(arguments: Sequence[str]) -> str:
    """Return what to type in place of options and commands that moved, "" where none did."""
    command = arguments[0] if arguments else ""
    if command in _COMMANDS:
        return f"the command {command} is now: {_COMMANDS[command]}"
    templates, other_options = MOVED.get(command, {}), _OTHER_OPTIONS.get(command, {})
    replacements = list[tuple[str, str]]()
    repeated = dict[str, list[str]]()
    for option, value in _options(arguments):
        if option in templates:
            template = templates[option]
            setting = _filled(_without_defaults(template, arguments), value)
            if template.rpartition("=")[2] in _REPEATABLE:
                key, _, items = setting.partition("=")
                repeated.setdefault(option, []).append(items[1:-1])
                setting = f"{key}=[{', '.join(repeated[option])}]"
                replacements = [pair for pair in replacements if pair[0] != option]
            replacements.append((option, f"--set {shlex.quote(setting)}"))
        elif option in other_options:
            replacements.append((option, other_options[option].replace("V", value)))
    if not replacements:
        return ""
    texts = "; ".join(f"{option}: {text}" for option, text in replacements)
    return f"these options are typed otherwise: {texts}"


def _options(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield arguments up to ``--`` with their values: after ``=``, or the next argument."""
    for number, argument in enumerate(arguments):
        if argument == "--":
            return
        option, mark, value = argument.partition("=")
        if not mark and number + 1 < len(arguments):
            value = arguments[number + 1]
        yield option, value


def _without_defaults(template: str, arguments: Sequence[str]) -> str:
    """Return the template of a circle or line without the defaults of what other options say."""
    options = {argument.partition("=")[0] for argument in arguments}
    if options & {"--feed", "--duration"}:
        template = template.replace(", duration=4", "")
    if "--normal" in options or any(argument.startswith("planar") for argument in arguments):
        template = template.replace(", normal=[1, 0, 0]", "")
    return template


def _filled(template: str, value: str) -> str:
    """Return a template with the value in place of its word in capitals."""
    for word, written in _WORDS.items():
        if word in template:
            return template.replace(word, written(value))
    return template.replace("V", value)


def _split(value: str) -> list[str]:
    return [part.strip() for part in value.split(",")]


def _list(value: str) -> str:
    return f"[{', '.join(_split(value))}]"


def _names(value: str) -> str:
    return json.dumps(_split(value))


def _each(value: str) -> str:
    return _list(value) if "," in value else value


def _axis(value: str) -> str:
    axes = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}
    return axes.get(value, value)


def _cost(value: str) -> str:
    kind, mark, weight = value.partition("=")
    key = "mu" if kind in ("InverseManipulability", "SmallestSingularValue") else "weight"
    return f'{{kind="{kind}"{f", {key}={weight}" if mark else ""}}}'


def _relaxation(value: str) -> str:
    rows_and_band, _, window = value.partition("@")
    rows, mark, band = rows_and_band.partition("=")
    during = f", during=[{window.replace(':', ', ')}]" if window else ""
    return f"{{rows={json.dumps(rows.split(','))}{f', band={band}' if mark else ''}{during}}}"


def _pose(value: str) -> str:
    numbers = _split(value)
    if len(numbers) != 6:
        return value
    position, rotation = ", ".join(numbers[:3]), ", ".join(numbers[3:])
    return f"{{position=[{position}], rotation_vector=[{rotation}]}}"


# Words of templates, and how each writes the value.
_WORDS = {
    "NAMES": _names,
    "LIST": _list,
    "EACH": _each,
    "AXIS": _axis,
    "COST": _cost,
    "RELAXATION": _relaxation,
    "POSE": _pose,
}
