"""What each key of a problem or job file means: as the docstrings of what it is given to say it."""

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from selfmotion.basics import Saved
from selfmotion.cam import read_path
from selfmotion.certificate import Tolerance
from selfmotion.collision import obstacle_shapes
from selfmotion.constraints import Clearance, Constraint
from selfmotion.costs import Cost
from selfmotion.documents.job import Job
from selfmotion.follow import Follow
from selfmotion.job import Seam, plan_job
from selfmotion.motion import NullMotion
from selfmotion.optimise import LineSearch, QuasiNewton
from selfmotion.path import Circle, Feed, Path, Weave, with_leads
from selfmotion.planning import Search, plan, plan_in_parts
from selfmotion.problem import Problem
from selfmotion.robot import load_robot
from selfmotion.task import Damping, Relaxation

# What a table's keys are given to, where that is no class of its own name.
_GIVEN_TO: Mapping[str, tuple[Callable[..., Any], ...]] = {
    "Problem": (Problem, plan, Job),
    "Robot": (load_robot,),
    "RobotPart": (load_robot,),
    "InParts": (plan_in_parts,),
    "file": (Feed, read_path),
    "circle": (Feed, Circle.around),
    "line": (Feed,),
    "spiral": (Feed,),
    "Seam": (Problem, Feed, read_path, Seam),
    "Job": (plan_job,),
    "Clearance": (Clearance,),
    "Leads": (with_leads,),
    "Weave": (Weave,),
    **{cls.__name__: (cls,) for cls in (Damping, Follow, LineSearch, QuasiNewton)},
    **{cls.__name__: (cls,) for cls in (Relaxation, Search, Tolerance)},
}
# What files say otherwise than the classes, in tables of a name; "" for all others.
_ORIENTATION = "of the axes; one of rotation, quaternion, rpy, rotation_vector and normal"
_QUATERNIONS = "w, x, y, z of each pose, as `quaternions_wxyz`; or 3 × 3 matrices."
_IN_FILES: Mapping[str, Mapping[str, str]] = {
    "": {
        "kind": "Which of these it is.",
        "shape": "Which of these it is.",
        "frame": "Where it is placed: a pose in the frame of the reference.",
        "leads": "An approach and a retract along the tool's axis: length [m], duration [s].",
        "weave": "Swings beside the path: amplitude [m], pitch [m], axis, dwell.",
        "feed": "Speed of the tool along it [m/s]; or give a duration.",
        "duration": "How long it takes [s]; or give a feed.",
        "start": "The tool's first pose; by default that of the start configuration.",
        "position": "Of the origin [m].",
        "rotation": f"3 × 3 matrix {_ORIENTATION}.",
        "quaternions": "Orientations w, x, y, z, one for each point.",
        "quaternion": f"w, x, y, z {_ORIENTATION}.",
        "rpy": f"Roll, pitch and yaw [rad] {_ORIENTATION}.",
        "rotation_vector": f"Axis times angle [rad] {_ORIENTATION}.",
        "normal": "Direction of the z axis, instead of an orientation.",
    },
    "Problem": {
        "robot": "The arm, or the cell.",
        "path": "The tool motion.",
        "task": "Which rows of the tool's pose are prescribed.",
        "start": "The start configuration [rad or m], or which; by default free: many are tried.",
        "workpiece": "What paths and bodies are placed with.",
        "joint_limits": "A MoveIt file of joint limits that count besides the arm's own.",
        "optimiser": "The published method's quasi-Newton method, and its numbers.",
        "grid": "Values to try for keys, for `selfmotion batch`: a list for each.",
        "seams": "Seams of a job, for `selfmotion job`: a list, or one table with a file of them.",
        "job": "How a job is planned.",
        "also": "What else of the arm follows a path at the same time: their rows are prescribed.",
        "clearance": "How far bodies keep apart, and which; by default links must not overlap. "
        "False to leave that out.",
    },
    "Robot": {
        "name": "An arm that is known by name; see `selfmotion robots`.",
        "file": "A URDF or xacro file.",
        "parts": "Robots that make a cell, by name.",
        "bodies": "Bodies that links carry, each with the link as its frame.",
        "base": "Pose of its root link in the world; of parts, each has its own.",
        "arguments": "Of a xacro file; of parts, each has its own.",
    },
    "RobotPart": {
        "name": "An arm that is known by name, or a positioner.",
        "file": "A URDF or xacro file.",
        "on": "The link of another part that carries it.",
        "base": "Pose of its root link in the world, or in the link that carries it.",
        "arguments": "Of a xacro file.",
    },
    "Workpiece": {
        "frame": "Where it stands: a pose in the world, or in the frame of `on`.",
        "on": "The link that carries it; paths are in its frame then.",
        "mesh": "Its shape, a file in the same frame; it is kept clear of.",
        "scale": "What a unit of the mesh is [m].",
        "obstacles": "Bodies that move with it.",
    },
    "Follow": {
        "pose": "A pose that is held; or give a path.",
        "path": "What it follows; or give a pose.",
    },
    "file": {"file": "The file of poses; see [paths from files](howto/seam.md)."},
    "function": {
        "code": "`module:attribute` of a function of samples; read with --allow-code.",
        "name": "What reports call it.",
    },
    "circle": {"radius": "[m], where the centre follows from the start; or give the centre."},
    "line": {"by": "How far it goes from the start [m]; or give the end."},
    "waypoints": {"quaternions": _QUATERNIONS},
    "polyline": {"quaternions": _QUATERNIONS},
    "twist": {
        "breaks": "Times at which the polynomials change [s].",
        "coefficients": "Of the twist's six components between them, lowest order first.",
    },
    "Seam": {
        "file": "The file of all seams.",
        "leaves": "Bodies that are there from then on.",
        "events": "What happens how long after its start [s], whichever way it is made: "
        '`["arc on", 0.1]`.',
        "run_up": "Whether the tool runs up before the seam and stops behind it.",
        "most_feed": 'With feed = "highest": no more than this [m/s].',
    },
    "Job": {"rng": "Seed of everything that is drawn."},
}


def _classes() -> dict[str, type]:
    # Classes of the user's own may come to be known later.
    families: tuple[type[Saved], ...] = (Path, NullMotion, Cost, Constraint)
    known = {kind: cls for family in families for kind, cls in family.kinds().items()}
    return {**known, **dict(obstacle_shapes())}


def notes_of(table: str) -> dict[str, str]:
    """Return what the keys of a table mean, in Markdown, by key: of a class or of one of ours."""
    own = _classes().get(table)
    sources = (*((own,) if own else ()), *_GIVEN_TO.get(table, ()))
    found: dict[str, str] = {}
    for source in sources:
        found |= _parameters(source)
    return {**_IN_FILES[""], **found, **_IN_FILES.get(table, {})}


@cache
def _parameters(source: Callable[..., Any]) -> dict[str, str]:
    """Return what a docstring says of parameters, and those of the classes that it is made of."""
    from docstring_parser import DocstringStyle, parse

    documented = source.__mro__[::-1] if isinstance(source, type) else (source,)
    found: dict[str, str] = {}
    for each in documented:
        for item in parse(inspect.getdoc(each) or "", style=DocstringStyle.NUMPYDOC).params:
            for name in item.arg_name.split(","):
                if item.description:
                    found[name.strip()] = " ".join(item.description.split())
    return found
