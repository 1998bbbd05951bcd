"""Values that are none of what a public class or function asks for."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

import selfmotion as sm
from support.arms import robot_named
from support.bad_rows import Row

POSE = pin.SE3.Identity()
_MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])
_NAN_POSE = np.eye(4)
_NAN_POSE[1, 3] = np.nan
NAN, INF = float("nan"), float("inf")

# What each kind of argument is not, as it is written.
NUMBERS = {"nan": NAN, "inf": INF, "'1'": "1", "None": None, "[1, 2]": [1, 2], "True": True}
POSITIVE = {**NUMBERS, "0": 0, "-1": -1}
WHOLE = {"nan": NAN, "1.5": 1.5, "'2'": "2", "None": None, "True": True, "-1": -1}
TEXTS = {"'some'": "some", "3": 3, "None": None, "['a', 'b']": ["a", "b"]}
FLAGS = {"'no'": "no", "2": 2, "None": None}
VECTORS = {
    "(0, 1)": (0, 1),
    "(0, 0, nan)": (0, 0, NAN),
    "(0, inf, 0)": (0, INF, 0),
    "('0', '0', '1')": ("0", "0", "1"),
    "1.0": 1.0,
    "[[0, 0, 1]]": [[0, 0, 1]],
    "[0, [1], 2]": [0, [1], 2],
    "None": None,
    "1j": 1j,
}
POSES = {
    "'here'": "here",
    "None": None,
    "numpy.eye(3)": np.eye(3),
    "2 * numpy.eye(4)": 2.0 * np.eye(4),
    "a mirrored matrix": _MIRROR,
    "a matrix with NaN": _NAN_POSE,
    "the class SE3": pin.SE3,
}
PATHS = {"'line'": "line", "None": None, "Line (the class)": sm.paths.Line, "[1, 2]": [1, 2]}


def bad_values_of(
    area: str, name: str, make: Callable[..., object], /, **bad: dict[str, Any]
) -> list[Row]:
    """Return a row for each bad value of each argument of `make`, which has sound defaults."""
    return [
        Row(area, f"{name}({key}={written})", lambda _, k=key, v=value: make(**{k: v}))
        for key, values in bad.items()
        for written, value in values.items()
    ]


@cache
def line() -> sm.paths.Line:
    end = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    return sm.paths.Line(POSE, end, 2.0)


def sound(kind: Callable[..., object], **sound: Any) -> Callable[..., object]:
    return lambda **given: kind(**{**sound, **given})


def path_rows() -> list[Row]:
    """Return rows of tool motions."""
    area = "Paths"
    circle = sound(sm.paths.Circle, start=POSE, center=(0.1, 0, 0), normal=(0, 0, 1), duration=2.0)
    around = sound(sm.paths.Circle.around, start=POSE, radius=0.1, duration=2.0)
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0.1, 0]], dtype=float)
    turns = np.tile([1.0, 0, 0, 0], (3, 1))
    ways = sound(sm.paths.Waypoints, t=[0, 1, 2], positions=points, quaternions_wxyz=turns)
    twist = sound(sm.paths.TwistPath, start=POSE, velocity=lambda t: [0.1, 0, 0], duration=1.0)
    retimed = sound(sm.paths.Retimed, path=line(), t=[0, 1], sigma=[0, 2], rate=[0, 0])
    return [
        *bad_values_of(
            area,
            "Line",
            sound(sm.paths.Line, start=POSE, end=POSE, duration=1.0),
            start=POSES,
            end=POSES,
            duration={**POSITIVE, "1e300": 1e300},
            time_law=TEXTS,
        ),
        *bad_values_of(
            area,
            "Circle",
            circle,
            start=POSES,
            center=VECTORS,
            normal={**VECTORS, "(0, 0, 0)": (0, 0, 0)},
            duration=POSITIVE,
            turns={**NUMBERS, "1e300": 1e300},
            time_law=TEXTS,
            turn_tool=FLAGS,
        ),
        Row(area, "Circle(center= on the start)", lambda _: circle(center=(0, 0, 0))),
        *bad_values_of(area, "Circle.around", around, radius=POSITIVE, start=POSES, normal=VECTORS),
        *bad_values_of(
            area,
            "Waypoints",
            ways,
            t={
                "[0, 1]": [0, 1],
                "[0, 1, 1]": [0, 1, 1],
                "[0, 2, 1]": [0, 2, 1],
                "[0, nan, 1]": [0, NAN, 1],
                "'abc'": "abc",
                "None": None,
                "[]": [],
                "[[0, 1, 2]]": [[0, 1, 2]],
                "['0', '1', '2']": ["0", "1", "2"],
            },
            positions={
                "of shape (3, 2)": points[:, :2],
                "of shape (2, 3)": points[:2],
                "with NaN": points * [[1], [NAN], [1]],
                "with inf": points + np.array([0, INF, 0]),
                "of texts": points.astype(str),
                "None": None,
                "1.0": 1.0,
                "ragged": [[0, 0, 0], [1, 1], [2, 2, 2]],
            },
            quaternions_wxyz={
                "of shape (3, 3)": turns[:, :3],
                "with a zero": turns * [[1], [0], [1]],
                "with NaN": turns * [[1], [1], [NAN]],
                "'none'": "none",
            },
            corners=TEXTS,
            corner_angle=POSITIVE,
        ),
        *bad_values_of(
            area,
            "Waypoints.from_poses",
            sound(sm.paths.Waypoints.from_poses, t=[0, 1], poses=[POSE]),
            poses={
                "[SE3] for two times": [POSE],
                "'here'": "here",
                "[1, 2]": [1, 2],
                "[SE3, None]": [POSE, None],
                "SE3": POSE,
            },
        ),
        *bad_values_of(
            area,
            "TwistPath",
            twist,
            start=POSES,
            duration=POSITIVE,
            velocity={
                "[0.1, 0, 0]": [0.1, 0, 0],
                "None": None,
                "lambda t: nan": lambda t: NAN,
                "lambda t: [0, 0]": lambda t: [0, 0],
                "lambda t: 'fast'": lambda t: "fast",
                "lambda t: [nan] * 3": lambda t: [NAN] * 3,
                "lambda t: [0.0] * 7": lambda t: [0.0] * 7,
                "a step": lambda t: [float(t > 0.3), 0, 0],
                "|t - 0.3|": lambda t: [abs(t - 0.3), 0, 0],
            },
        ),
        *bad_values_of(
            area, "Placed", sound(sm.paths.Placed, path=line(), frame=POSE), path=PATHS, frame=POSES
        ),
        *bad_values_of(
            area, "Dwell", sound(sm.paths.Dwell, at=POSE, duration=1.0), at=POSES, duration=POSITIVE
        ),
        *bad_values_of(
            area,
            "section_at_rest",
            sound(sm.paths.section_at_rest, path=line(), ramp=0.5),
            path=PATHS,
            ramp={**POSITIVE, "longer than the path": 3.0},
        ),
        *bad_values_of(
            area,
            "Joined",
            sm.paths.Joined,
            pieces={
                "[]": [],
                "None": None,
                "[1]": [1],
                "Line (the class)": sm.paths.Line,
                "[line, line], which jumps": [line(), line()],
            },
        ),
        *bad_values_of(
            area,
            "Retimed",
            retimed,
            path=PATHS,
            t={"[0, 0]": [0, 0], "[0]": [0], "[0, nan]": [0, NAN], "'ab'": "ab"},
            sigma={"[2, 0]": [2, 0], "[0, 1, 2]": [0, 1, 2], "None": None},
            rate={"[0, nan]": [0, NAN], "[0]": [0], "1.0": 1.0},
        ),
        *bad_values_of(
            area,
            "path.samples",
            sound(line().samples),
            t={"-1": -1.0, "3, past the end": 3.0, "nan": NAN, "'0'": "0", "None": None},
        ),
        *bad_values_of(
            area, "path.pose", sound(line().pose), t={"-1": -1.0, "nan": NAN, "'0'": "0"}
        ),
        *bad_values_of(area, "path.twist", sound(line().twist), t={"9": 9.0, "None": None}),
    ]


@cache
def _sample() -> sm.Problem:
    return sm.sample_problem()


def problem_with(**given: Any) -> sm.Problem:
    """Return the paper's problem with other parts."""
    sample = _sample()
    parts = {"robot": sample.robot, "path": sample.path, "task": "planar", "start": sample.start}
    return sm.Problem(**{**parts, **given})


def _cost(kind: Callable[..., object], **sound: Any) -> Callable[..., object]:
    return lambda **given: problem_with(costs=[kind(**{**sound, **given})])


def kept(kind: Callable[..., object], **sound: Any) -> Callable[..., object]:
    return lambda **given: problem_with(constraints=[kind(**{**sound, **given})])


def cost_rows() -> list[Row]:
    """Return rows of costs, each in a problem of the planar arm."""
    area, arm = "Costs", robot_named("planar_3r")
    weights = {
        **POSITIVE,
        "[1, 2]": [1, 2],
        "[1, -1, 1]": [1, -1, 1],
        "[1, nan, 1]": [1, NAN, 1],
        "[[1, 2], [3, 4]]": [[1, 2], [3, 4]],
        "an upper triangle": np.triu(np.ones((3, 3))),
        "numpy.eye(4)": np.eye(4),
        "[]": [],
    }
    del weights["0"]
    factors = {key: value for key, value in POSITIVE.items() if key != "0"}
    limits = {
        "[0, 1]": [0, 1],
        "[9, 9, 9]": [9, 9, 9],
        "[nan] * 3": [NAN] * 3,
        "'low'": "low",
    }
    names = {"None": None, "''": "", "3": 3}
    functions = {
        "None": None,
        "3": 3,
        "lambda qd, q, t: 1": lambda qd, q, t: 1.0,
        "lambda qd, q, t: q": lambda qd, q, t: q,
        "lambda qd, q, t: None": lambda qd, q, t: None,
    }
    found = []
    for kind in (sm.costs.JointVelocity, sm.costs.JointAcceleration, sm.costs.JointJerk):
        found += bad_values_of(area, kind.__name__, _cost(kind), weight=weights, name=names)
    other = robot_named("panda")
    arms = {"'panda'": "panda", "None": None, "RobotModel": sm.RobotModel, "another arm": other}
    return [
        *found,
        *bad_values_of(
            area,
            "Posture",
            _cost(sm.costs.Posture, posture=[0, 0, 0]),
            weight={"nan": NAN, "-1": -1},
            posture={**VECTORS, "[0, 0, 0, 0]": [0] * 4},
        ),
        *bad_values_of(
            area,
            "JointLimitDistance",
            _cost(sm.costs.JointLimitDistance, lower=[-1] * 3, upper=[1] * 3),
            lower=limits,
            upper={"[-2] * 3": [-2] * 3, "[1] * 4": [1] * 4},
            mu=factors,
            power={**WHOLE, "3": 3, "0": 0},
        ),
        *bad_values_of(
            area, "PathLength", _cost(sm.costs.PathLength), smoothing=POSITIVE, name=names
        ),
        *bad_values_of(
            *(area, "JointReversals", _cost(sm.costs.JointReversals)),
            weight={key: value for key, value in POSITIVE.items() if key != "0"},
            speed=POSITIVE,
            smoothing=POSITIVE,
        ),
        *bad_values_of(area, "Manipulability", _cost(sm.costs.Manipulability), mu=factors),
        *bad_values_of(
            area,
            "InverseManipulability",
            _cost(sm.costs.InverseManipulability),
            mu=factors,
            name=names,
        ),
        *bad_values_of(
            area,
            "DirectionalManipulability",
            _cost(sm.costs.DirectionalManipulability, direction=[1, 0]),
            direction={
                "[0, 0]": [0, 0],
                "[1, 0, 0]": [1, 0, 0],
                "1.0": 1.0,
                "'x'": "x",
                "[nan, 1]": [NAN, 1],
                "None": None,
            },
            mu=factors,
        ),
        *bad_values_of(
            area,
            "SmallestSingularValue",
            _cost(sm.costs.SmallestSingularValue),
            mu=factors,
            power=WHOLE,
        ),
        *bad_values_of(
            area, "KineticEnergy", _cost(sm.costs.KineticEnergy, robot=arm), robot=arms, mu=factors
        ),
        *bad_values_of(
            area,
            "GravityTorque",
            _cost(sm.costs.GravityTorque, robot=arm),
            robot=arms,
            weight={"nan": NAN, "[1, 2]": [1, 2]},
        ),
        *bad_values_of(
            area,
            "FunctionCost",
            _cost(sm.costs.FunctionCost, g=lambda qd, q, t: t),
            g={"None": None, "3": 3, "JointVelocity()": sm.costs.JointVelocity()},
            g_gradient={"3": 3},
            name=names,
        ),
        *(
            Row(
                area,
                f"plan() with FunctionCost({written})",
                lambda _, g=g: sm.plan(problem_with(costs=[sm.costs.FunctionCost(g)])),
            )
            for written, g in functions.items()
            if callable(g)
        ),
        *bad_values_of(
            area,
            "Problem",
            problem_with,
            costs={
                "[]": [],
                "None": None,
                "3": 3,
                "'fast'": "fast",
                "[3]": [3],
                "JointVelocity (the class)": sm.costs.JointVelocity,
                "[JointVelocity] (the class)": [sm.costs.JointVelocity],
                "[a function of (qd, q, t)]": [sum],
                "two of one name": [sm.costs.JointVelocity(), sm.costs.JointVelocity()],
            },
        ),
    ]
