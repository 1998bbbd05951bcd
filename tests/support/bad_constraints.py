"""Constraints and obstacles that are none, or that no arm can keep."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import selfmotion as sm
from support.arms import robot_named
from support.bad_rows import Row
from support.bad_values import (
    FLAGS,
    NAN,
    NUMBERS,
    POSE,
    POSES,
    POSITIVE,
    VECTORS,
    bad_values_of,
    kept,
    problem_with,
    sound,
)


def constraint_rows() -> list[Row]:
    """Return rows of constraints and obstacles."""
    area, arm = "Constraints", robot_named("planar_3r")
    bounds = {
        "[nan] * 3": [NAN] * 3,
        "nan": NAN,
        "[1, 2]": [1, 2],
        "'1'": "1",
        "['a', 'b', 'c']": ["a", "b", "c"],
        "[[1, 1, 1]]": [[1, 1, 1]],
        "True": True,
    }
    rates = {**bounds, "0": 0, "-1": -1, "[1, 0, 1]": [1, 0, 1]}
    margins = {**POSITIVE, "2": 2}
    box = sm.obstacles.Box("post", [3, 0, 0], [0.1, 0.1, 0.1])
    pairs = {
        "'link1'": "link1",
        "['link1']": ["link1"],
        "[('link1',)]": [("link1",)],
        "[(1, 2)]": [(1, 2)],
        "None": None,
        "[('link1', 'link1')]": [("link1", "link1")],
    }
    return [
        *bad_values_of(
            area,
            "JointPositionLimits",
            kept(sm.constraints.JointPositionLimits),
            lower={**bounds, "[9, 9, 9]": [9] * 3, "-360, in degrees": -360},
            upper={**bounds, "[-9, -9, -9]": [-9] * 3, "180, in degrees": 180},
            margin=margins,
            replace=FLAGS,
        ),
        *bad_values_of(
            area,
            "JointVelocityLimits",
            kept(sm.constraints.JointVelocityLimits),
            limit=rates,
            margin=margins,
            replace=FLAGS,
        ),
        *bad_values_of(
            area,
            "JointAccelerationLimits",
            kept(sm.constraints.JointAccelerationLimits),
            limit=rates,
            margin=margins,
        ),
        *bad_values_of(
            area,
            "JointJerkLimits",
            kept(sm.constraints.JointJerkLimits),
            limit=rates,
            margin=margins,
        ),
        *bad_values_of(
            area,
            "PositionDependentVelocityLimits",
            lambda **given: kept(sm.constraints.PositionDependentVelocityLimits)(
                **{"deceleration": 2.0, **given}
            ),
            deceleration={**rates, "inf": np.inf},
            offset={**bounds, "-1": -1, "[0, 0, 99], no room to move": [0, 0, 99]},
            lower={**bounds, "[9, 9, 9]": [9] * 3},
            upper={**bounds, "[-9, -9, -9]": [-9] * 3},
            margin=margins,
        ),
        *bad_values_of(
            area,
            "EndConfiguration",
            kept(sm.constraints.EndConfiguration),
            q={
                "None": None,
                "[0, 0]": [0, 0],
                "[nan] * 3": [NAN] * 3,
                "'home'": "home",
                "[0, 0, 0], off the path": [0, 0, 0],
                "1.0": 1.0,
            },
        ),
        *bad_values_of(
            area,
            "EndVelocity",
            kept(sm.constraints.EndVelocity),
            qd={"None": None, "[0, 0]": [0, 0], "nan": NAN, "'rest'": "rest"},
        ),
        *bad_values_of(
            area,
            "StartVelocity",
            kept(sm.constraints.StartVelocity),
            qd={"None": None, "[0, 0]": [0, 0], "nan": NAN, "[1, 1, 1]": [1, 1, 1]},
        ),
        *bad_values_of(area, "ClosedPath", kept(sm.constraints.ClosedPath), velocity=FLAGS),
        Row(
            area,
            "ClosedPath() on an open path",
            lambda _: problem_with(
                constraints=[sm.constraints.ClosedPath()], path=sample_line(arm)
            ),
        ),
        *bad_values_of(
            area,
            "Clearance",
            kept(sm.constraints.Clearance),
            obstacles={
                "None": None,
                "'box'": "box",
                "[1]": [1],
                "Box (the class)": sm.obstacles.Box,
            },
            distance={**NUMBERS, "-1": -1, "5, in millimetres": 5},
            disabled=pairs,
            srdf={"'nowhere.srdf'": "nowhere.srdf"},
        ),
        Row(
            area,
            "Clearance() of an arm without bodies",
            lambda _: problem_with(constraints=[], clearance=sm.constraints.Clearance([box])),
        ),
        *bad_values_of(
            area,
            "Problem",
            problem_with,
            constraints={
                "None": None,
                "3": 3,
                "[3]": [3],
                "[ClosedPath] (the class)": [sm.constraints.ClosedPath],
            },
        ),
        *_obstacle_rows(),
    ]


def sample_line(arm: sm.RobotModel) -> sm.paths.Line:
    """Return a short line from the sample problem's start."""
    start = sm.sample_problem().path.pose(0.0)
    end = pin.SE3(start)
    end.translation = start.translation + np.array([-0.1, 0.0, 0.0])
    return sm.paths.Line(start, end, 2.0)


def _obstacle_rows() -> list[Row]:
    area, names = "Obstacles", {"''": "", "None": None, "3": 3}
    place = {"name": "post", "pose": POSE}
    poses = {**POSES, "(0, 0)": (0, 0), "(0, 0, nan)": (0, 0, NAN)}
    return [
        *bad_values_of(
            area,
            "Box",
            sound(sm.obstacles.Box, **place, size=(1, 1, 1)),
            name=names,
            pose=poses,
            size={
                **VECTORS,
                "(1, 1, 0)": (1, 1, 0),
                "(1, 1, -1)": (1, 1, -1),
                "(1, 1, 1e300)": (1, 1, 1e300),
            },
            frame={"''": "", "3": 3, "['panda_hand']": ["panda_hand"]},
        ),
        *bad_values_of(
            area,
            "Sphere",
            sound(sm.obstacles.Sphere, **place, radius=1),
            pose=poses,
            radius={**POSITIVE, "1e300": 1e300},
        ),
        *bad_values_of(
            area,
            "Cylinder",
            sound(sm.obstacles.Cylinder, **place, radius=1, length=1),
            radius=POSITIVE,
            length=POSITIVE,
        ),
        *bad_values_of(
            area,
            "Capsule",
            sound(sm.obstacles.Capsule, **place, radius=1, length=1),
            radius=POSITIVE,
            length=POSITIVE,
        ),
        *bad_values_of(
            area,
            "Mesh",
            sound(sm.obstacles.Mesh, **place, file="a.stl"),
            scale=POSITIVE,
            file={"None": None, "3": 3},
        ),
        *(
            Row(area, f"Mesh.geometry() of {what}", lambda folder, c=content: _mesh(folder, c))
            for what, content in (("no file", None), ("an empty file", b""), ("a text", b"hello"))
        ),
    ]


def _mesh(folder: Path, content: bytes | None) -> object:
    file = folder / "body.stl"
    file.unlink(missing_ok=True)
    if content is not None:
        file.write_bytes(content)
    return sm.obstacles.Mesh("post", POSE, file).geometry()
