"""Descriptions of the keys of problem and job files, by table."""

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from selfmotion.basics import Saved
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import obstacle_shapes
from selfmotion.model.follow import Follow
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Circle, Feed, Path, Weave, with_leads
from selfmotion.model.robot import load_robot
from selfmotion.model.task import Damping, Relaxation
from selfmotion.planning.optimise import LineSearch, QuasiNewton
from selfmotion.planning.planner import PlanRequest, Search, plan, plan_in_parts
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost
from selfmotion.problem.problem import Problem
from selfmotion.shop.cam import read_path
from selfmotion.work.job import Seam, plan_job

# Callables whose docstrings describe the keys of a table, by the table's title.
_DOCUMENTED_BY: Mapping[str, tuple[Callable[..., Any], ...]] = {
    "Problem": (Problem, plan, PlanRequest),
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
    "Damping": (Damping,),
    "Follow": (Follow,),
    "LineSearch": (LineSearch,),
    "QuasiNewton": (QuasiNewton,),
    "Relaxation": (Relaxation,),
    "Search": (Search,),
    "Tolerance": (Tolerance,),
}
# End of the descriptions of keys that each give an orientation.
_ORIENTATION = "of the axes; one of rotation, quaternion, rpy, rotation_vector and normal"
# Description of the orientations of points.
_QUATERNIONS = "w, x, y, z of each pose, as `quaternions_wxyz`; or 3 × 3 matrices."
# Descriptions that replace or complete those of docstrings, by table and key; "" holds the
# defaults of all tables.
_FILE_NOTES: Mapping[str, Mapping[str, str]] = {
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
        "task": "Which rows of the tool's pose are prescribed; by default pose, of an "
        "arm in a plane planar.",
        "start": "The start configuration [rad or m], or which; by default free: many are tried.",
        "workpiece": "What paths and bodies are placed with.",
        "joint_limits": "A MoveIt file of joint limits that count besides the arm's own.",
        "optimiser": "The published method's quasi-Newton method, and its numbers.",
        "grid": "Values to try for keys, for `selfmotion batch`: a list for each.",
        "loop": "How `selfmotion follow` runs the loop with a controller.",
        "seams": "Seams of a job, for `selfmotion job`: a list, or one table with a file of them.",
        "job": "How a job is planned.",
        "also": "What else of the arm follows a path at the same time: their rows are prescribed.",
        "clearance": "How far bodies keep apart, and which; by default links must not overlap. "
        "False to leave that out.",
    },
    "Loop": {
        "horizon": "How far ahead is planned [s]; 2 by default.",
        "period": "Time between states [s]; 0.01 by default.",
        "cycle": "Time between set-points [s]; 0.001 by default.",
        "latency": "From measuring a state until the arm follows its segment [s]; 0 by default.",
        "silence": "Without a state for so long it ends [s]; 5 by default.",
        "seconds": "How long it runs [s]; by default until it is stopped.",
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


def _saved_classes() -> dict[str, type]:
    """Return paths, null motions, costs, constraints and shapes, by the name in files."""
    # Not cached: users may register classes later.
    families: tuple[type[Saved], ...] = (Path, NullMotion, Cost, Constraint)
    classes = {kind: cls for family in families for kind, cls in family.kinds().items()}
    return {**classes, **dict(obstacle_shapes())}


def key_notes(table: str) -> dict[str, str]:
    """Return the description of each key of a table, in Markdown."""
    saved_class = _saved_classes().get(table)
    documented = (*((saved_class,) if saved_class else ()), *_DOCUMENTED_BY.get(table, ()))
    notes: dict[str, str] = {}
    for item in documented:
        notes |= _parameter_descriptions(item)
    return {**_FILE_NOTES[""], **notes, **_FILE_NOTES.get(table, {})}


@cache
def _parameter_descriptions(item: Callable[..., Any]) -> dict[str, str]:
    """Return the descriptions of parameters in the docstrings of a callable.

    Those of a class include its bases'.
    """
    from docstring_parser import DocstringStyle, parse

    objects = item.__mro__[::-1] if isinstance(item, type) else (item,)
    parameters: dict[str, str] = {}
    for each in objects:
        docstring = parse(inspect.getdoc(each) or "", style=DocstringStyle.NUMPYDOC)
        for parameter in docstring.params:
            for name in parameter.arg_name.split(","):
                if parameter.description:
                    parameters[name.strip()] = " ".join(parameter.description.split())
    return parameters
