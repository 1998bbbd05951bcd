"""Options and commands of the version before, with what takes their place; gone with the next."""

import json
import shlex
from collections.abc import Callable, Mapping, Sequence

_AXES = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}
# Options that say how a path is read; V stands for what was typed, LIST and NAMES for lists of it.
_OF_PATH = {
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
_OF_ROBOT = {
    "--reference": "robot.reference=V",
    "--lock": "robot.lock.V",
    "--argument": "robot.arguments.V",
    "--packages": "robot.packages=NAMES",
}
_OF_LINKS = {
    "--srdf": "clearance.srdf=V",
    "--disabled": "clearance.disabled=[NAMES]",
    "--no-self-collision": "clearance=false",
}
_LIMITS = {
    "--velocity": "constraints.JointVelocityLimits.limit=EACH",
    "--acceleration": "constraints.JointAccelerationLimits.limit=EACH",
}
_ASKED = {
    **_OF_PATH,
    **_OF_ROBOT,
    **_OF_LINKS,
    **_LIMITS,
    "--joint-limits": "joint_limits=V",
    "--obstacles": "clearance.obstacles=@V",
    "--clearance": "clearance.distance=V",
}
# Lists, which may be given several times.
_LISTED = ("NAMES", "[NAMES]", "[RELAXATION]", "[COST]")
_LOOP = ("horizon", "period", "cycle", "latency", "silence", "seconds")
# Of each command: options, and what is typed in their place after --set.
MOVED: Mapping[str, Mapping[str, str]] = {
    "plan": {
        **_ASKED,
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
    "check": _ASKED,
    "init": {**_OF_ROBOT, **_OF_LINKS},
    "compare": {"--cost": "costs=[COST]"},
    "export": {
        "--targets": "targets=V",
        "--wobj": "work_object=POSE",
        "--mass": "mass=V",
    },
    "follow": {f"--{name}": f"loop.{name}=V" for name in _LOOP},
}
# Options in whose place another one is typed.
_OTHERS: Mapping[str, Mapping[str, str]] = {
    "place": {
        **{f"--{name}": f"--within {name}=V" for name in ("x", "y", "z", "roll", "pitch", "yaw")},
        "--base": "--of base",
        "--path-alone": "--of path",
    },
    "sheet": {"--part-number": "--number part=V", "--order-number": "--number order=V"},
}
_COMMANDS = {
    "fastest": "selfmotion plan FILE --set goal=fastest --deadline 60 (limits: --set "
    "constraints.JointAccelerationLimits.limit=8; --keep KIND=FACTOR: --set keep.KIND=FACTOR)",
    "track": "python examples/moving_target.py, or selfmotion follow with a controller",
}


def moved(arguments: Sequence[str]) -> str:
    """Return what to type in place of options and commands that moved, "" where none did."""
    command = arguments[0] if arguments else ""
    if command in _COMMANDS:
        return f"the command {command} is now: {_COMMANDS[command]}"
    own, others = MOVED.get(command, {}), _OTHERS.get(command, {})
    told, lists = list[str](), dict[str, list[str]]()
    for number, argument in enumerate(arguments):
        if argument == "--":
            break
        option, mark, value = argument.partition("=")
        if not mark and number + 1 < len(arguments):
            value = arguments[number + 1]
        if option in own:
            text = _filled(_shape(own[option], arguments), value)
            key, _, listed = text.partition("=")
            if own[option].split("=")[-1] in _LISTED:
                # All of a list are one key.
                lists.setdefault(key, []).append(listed[1:-1])
                listed = f"[{', '.join(lists[key])}]"
                told = [item for item in told if not item.startswith(f"{option}: --set")]
            text = f"{key}={listed}" if "=" in text else text
            told.append(f"{option}: --set {shlex.quote(text)}")
        elif option in others:
            told.append(f"{option}: {others[option].replace('V', value)}")
    return f"these options are typed otherwise: {'; '.join(told)}" if told else ""


def _shape(template: str, arguments: Sequence[str]) -> str:
    """Return the template of a circle or line without what other options say."""
    names = {argument.partition("=")[0] for argument in arguments}
    if names & {"--feed", "--duration"}:
        template = template.replace(", duration=4", "")
    if "--normal" in names or any(argument.startswith("planar") for argument in arguments):
        template = template.replace(", normal=[1, 0, 0]", "")
    return template


def _filled(template: str, value: str) -> str:
    parts = [part.strip() for part in value.split(",")]
    words: dict[str, Callable[[], str]] = {
        "NAMES": lambda: json.dumps(parts),
        "LIST": lambda: f"[{', '.join(parts)}]",
        "EACH": lambda: value if len(parts) == 1 else f"[{', '.join(parts)}]",
        "AXIS": lambda: _AXES.get(value, value),
        "COST": lambda: _cost(value),
        "RELAXATION": lambda: _relaxation(value),
        "POSE": lambda: _pose(value, parts),
    }
    for word, text in words.items():
        if word in template:
            return template.replace(word, text())
    return template.replace("V", value)


def _cost(text: str) -> str:
    kind, mark, weight = text.partition("=")
    named = "mu" if kind in ("InverseManipulability", "SmallestSingularValue") else "weight"
    return f'{{kind="{kind}"{f", {named}={weight}" if mark else ""}}}'


def _relaxation(text: str) -> str:
    rest, _, window = text.partition("@")
    rows, mark, band = rest.partition("=")
    during = f", during=[{window.replace(':', ', ')}]" if window else ""
    return f"{{rows={json.dumps(rows.split(','))}{f', band={band}' if mark else ''}{during}}}"


def _pose(text: str, parts: Sequence[str]) -> str:
    if len(parts) != 6:
        return text
    place, turn = ", ".join(parts[:3]), ", ".join(parts[3:])
    return f"{{position=[{place}], rotation_vector=[{turn}]}}"
