"""Feeds and polylines, coordinates and their bands, limits of files, the fastest motion."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import selfmotion as sm
from selfmotion import realtime
from support.arms import PANDA_HOME, robot_named
from support.bad_rows import Row
from support.bad_values import (
    FLAGS,
    INF,
    NAN,
    NUMBERS,
    PATHS,
    POSE,
    POSITIVE,
    VECTORS,
    bad_values_of,
    kept,
    line,
    problem_with,
    sound,
)

_POINTS = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], dtype=float)
_TURNS = np.tile([1.0, 0, 0, 0], (3, 1))
_COORDINATES = {
    "'panda_joint1'": "panda_joint1",
    "None": None,
    "JointCoordinate (the class)": sm.robot.JointCoordinate,
}


def addition_rows() -> list[Row]:
    """Return the rows."""
    return [
        *_path_rows(),
        *_coordinate_rows(),
        *_constraint_rows(),
        *_planning_rows(),
        *_dropped_rows(),
        *_limit_file_rows(),
        *_replanner_rows(),
    ]


def _path_rows() -> list[Row]:
    area = "Paths"
    corner = sm.paths.Waypoints([0, 1, 2], _POINTS, corners="stop")
    bend = sound(sm.paths.Retimed, path=line(), t=[0, 1], sigma=[0, 2], rate=[0, 0], bend=[0, 0])
    return [
        *bad_values_of(
            area,
            "Feed",
            sound(sm.paths.Feed, path=line(), feed=0.1),
            path=PATHS,
            feed=POSITIVE,
            turn_rate=POSITIVE,
            acceleration=POSITIVE,
            turn_acceleration=POSITIVE,
            smoothing=POSITIVE,
        ),
        Row(area, "Feed() of a path that rests on its way", lambda _: sm.paths.Feed(corner, 0.1)),
        Row(area, "Feed() of a Dwell", lambda _: sm.paths.Feed(sm.paths.Dwell(POSE, 1.0), 0.1)),
        *bad_values_of(
            area,
            "Polyline",
            sound(sm.paths.Polyline, positions=_POINTS, quaternions_wxyz=_TURNS),
            positions={
                "of shape (3, 2)": _POINTS[:, :2],
                "of shape (2, 3)": _POINTS[:2],
                "one pose": _POINTS[:1],
                "with NaN": _POINTS * [[1], [NAN], [1]],
                "all equal": _POINTS[[1, 1, 1]],
                "there and straight back": _POINTS[[0, 1, 0]],
                "None": None,
                "1.0": 1.0,
                "[]": [],
                "ragged": [[0, 0, 0], [1, 1], [2, 2, 2]],
            },
            quaternions_wxyz={
                "of shape (3, 3)": _TURNS[:, :3],
                "with a zero": _TURNS * [[1], [0], [1]],
                "with NaN": _TURNS * [[1], [1], [NAN]],
                "'none'": "none",
            },
            tolerance=POSITIVE,
            turn_tolerance=POSITIVE,
        ),
        *bad_values_of(
            area,
            "Polyline.from_poses",
            sm.paths.Polyline.from_poses,
            poses={
                "[SE3]": [POSE],
                "'here'": "here",
                "None": None,
                "[SE3, None]": [POSE, None],
                "SE3": POSE,
            },
        ),
        *bad_values_of(
            area,
            "with_leads",
            sound(sm.paths.with_leads, path=line(), length=0.05, duration=1.0),
            path=PATHS,
            length=POSITIVE,
            duration=POSITIVE,
            axis={**VECTORS, "(0, 0, 0)": (0, 0, 0)},
        ),
        Row(
            area,
            "with_leads() of a path that begins at speed",
            lambda _: sm.paths.with_leads(
                sm.paths.Line(POSE, _moved(), 2.0, time_law="constant"), 0.05, 1.0
            ),
        ),
        Row(area, "with_run_ups(Line)", lambda _: sm.paths.with_run_ups(line())),
        *bad_values_of(
            area,
            "Retimed",
            bend,
            bend={"[0]": [0], "[0, nan]": [0, NAN], "1.0": 1.0, "'none'": "none"},
        ),
        Row(
            area,
            "Retimed() that leaves out the start",
            lambda _: sm.paths.Retimed(line(), [0, 2], [0.5, 2], [0, 0]),
        ),
        Row(
            area,
            "Retimed() with rates that make it run backwards",
            lambda _: sm.paths.Retimed(line(), [0, 1, 2], [0, 0.2, 2], [0, 3, 0]),
        ),
        Row(
            area,
            "Weave() with a pitch a hundred thousand times too small",
            lambda _: sm.paths.Weave(line(), 1e-3, 1e-7),
        ),
        Row(
            "Problems",
            "a weave that no arm swings",
            lambda _: _panda(sm.paths.Weave(line(), 1e-2, 3e-5), task="position"),
        ),
        *(
            Row("Problems", f"{kind.__name__}, without orientations, for a full pose", call)
            for kind, call in (
                (sm.paths.Waypoints, lambda _: _panda(sm.paths.Waypoints([0, 1, 2], _POINTS))),
                (sm.paths.Polyline, lambda _: _panda(sm.paths.Polyline(_POINTS))),
                (sm.paths.Feed, lambda _: _panda(sm.paths.Feed(sm.paths.Polyline(_POINTS), 0.1))),
            )
        ),
    ]


def _dropped_rows() -> list[Row]:
    """Return what would make no difference where it is given."""
    panda = robot_named("panda")
    fed = sm.paths.Feed(line(), 0.05)
    move = {"robot": panda, "first": PANDA_HOME, "last": PANDA_HOME + 0.1}
    end = sm.constraints.EndConfiguration(PANDA_HOME)
    seam = sm.Seam("one", line(), "pointing")
    return [
        Row("Planning", "move(constraints=[EndConfiguration(…)])", lambda _: _ended(move, end)),
        Row("Planning", "move(task='position') between configurations", lambda _: _tasked(move)),
        Row(
            "Planning",
            "plan_job(constraints=[EndConfiguration(…)])",
            lambda _: sm.plan_job(panda, [seam], constraints=[end]),
        ),
        Row(
            "Planning",
            "plan_job(warm_start='a.program')",
            lambda _: sm.plan_job(panda, [seam], warm_start="a.program"),
        ),
        Row("Planning", "highest_feed(0.3)", lambda _: sm.job.highest_feed(0.3)),
        Row("Planning", "highest_feed(most=30)", lambda _: sm.job.highest_feed(print, 30.0)),
        Row(
            "Planning", "fastest() along a Feed", lambda _: sm.fastest(_panda(fed, task="position"))
        ),
    ]


def _ended(move: dict[str, Any], end: sm.constraints.Constraint) -> object:
    return sm.move(**move, constraints=[end])


def _tasked(move: dict[str, Any]) -> object:
    return sm.move(**move, task="position")


def _moved() -> Any:
    moved = POSE.copy()
    moved.translation = np.array([0.1, 0.0, 0.0])
    return moved


def _panda(path: sm.paths.Path | None = None, **given: Any) -> sm.Problem:
    arm = robot_named("panda")
    around = sm.paths.Circle.around(arm.pose(PANDA_HOME), 0.1, 4.0)
    return sm.Problem(arm, around if path is None else path, **given)


def _coordinate_rows() -> list[Row]:
    area, arm, small = "Coordinates", robot_named("panda"), robot_named("planar_3r")
    names = {"None": None, "3": 3, "''": ""}
    directions = {**VECTORS, "(0, 0, 0)": (0, 0, 0)}

    def banded(coordinate: Any, robot: sm.RobotModel = arm) -> object:
        return sm.constraints.Band(coordinate, 0.0, 0.5).requirement(robot)

    return [
        *bad_values_of(
            area,
            "JointCoordinate",
            lambda joint: banded(sm.robot.JointCoordinate(joint)),
            joint={**names, "'panda_joint9'": "panda_joint9"},
        ),
        *bad_values_of(
            area,
            "FrameCoordinate",
            lambda **g: banded(sm.robot.FrameCoordinate(**{"frame": "panda_link4", **g})),
            frame={**names, "'panda_link44'": "panda_link44", "'panda_link0'": "panda_link0"},
            direction=directions,
        ),
        *bad_values_of(
            area,
            "SwivelAngle",
            lambda **g: banded(sm.robot.SwivelAngle(**g)),
            reference=directions,
            shoulder={"3": 3, "'shoulder'": "shoulder"},
            elbow={"'panda_jont4'": "panda_jont4"},
        ),
        Row(
            area,
            "SwivelAngle() of an arm of three joints",
            lambda _: banded(sm.robot.SwivelAngle(), small),
        ),
        *bad_values_of(
            area,
            "Band",
            sound(
                sm.constraints.Band,
                coordinate=sm.robot.JointCoordinate("joint1"),
                center=0.0,
                half=0.5,
            ),
            coordinate=_COORDINATES,
            center=NUMBERS,
            half=POSITIVE,
            margin={**POSITIVE, "2": 2},
        ),
        Row(
            area,
            "Band(SwivelAngle(), 0, 4)",
            lambda _: sm.constraints.Band(sm.robot.SwivelAngle(), 0.0, 4.0),
        ),
        *bad_values_of(
            area,
            "Band.of_elbow",
            sound(sm.constraints.Band.of_elbow, side="up"),
            side={"'above'": "above", "None": None, "3": 3},
            half={**POSITIVE, "4": 4},
            elbow_up={"True": True},
        ),
        *bad_values_of(
            area,
            "Towards",
            sound(
                sm.costs.Towards,
                robot=arm,
                coordinate=sm.robot.JointCoordinate("panda_joint1"),
                target=0,
            ),
            robot={"'panda'": "panda", "None": None},
            coordinate={**_COORDINATES, "of no joint": sm.robot.JointCoordinate("panda_joint9")},
            target=NUMBERS,
            weight={**NUMBERS, "-1": -1},
            name={"''": "", "3": 3},
        ),
        Row(
            area,
            "Towards() of another arm",
            lambda _: problem_with(
                costs=[sm.costs.Towards(arm, sm.robot.JointCoordinate("panda_joint1"), 0.0)]
            ),
        ),
    ]


def _constraint_rows() -> list[Row]:
    area = "Constraints"
    limited = {key: value for key, value in POSITIVE.items() if value != INF}
    rates = {"None": None, "[0, 0]": [0, 0], "nan": NAN, "'rest'": "rest", "inf": INF}
    shares = {
        "[1, 1]": [1, 1],
        "0": 0,
        "-1": -1,
        "nan": NAN,
        "'fast'": "fast",
        "None": None,
        "[[1, 1, 1]]": [[1, 1, 1]],
    }
    return [
        *bad_values_of(
            area, "StartAcceleration", kept(sm.constraints.StartAcceleration), qdd=rates
        ),
        *bad_values_of(area, "EndAcceleration", kept(sm.constraints.EndAcceleration), qdd=rates),
        *bad_values_of(
            area,
            "ToolLimits",
            kept(lambda **given: sm.constraints.ToolLimits(**{"speed": 1.0, **given})),
            speed=POSITIVE,
            turn_rate=limited,
            acceleration=limited,
            turn_acceleration=limited,
            margin={**POSITIVE, "2": 2},
        ),
        Row(area, "ToolLimits()", lambda _: sm.constraints.ToolLimits()),
        *(
            row
            for kind in (sm.constraints.JointAccelerationLimits, sm.constraints.JointJerkLimits)
            for row in bad_values_of(area, kind.__name__, kept(kind), replace=FLAGS)
        ),
        *bad_values_of(
            "Costs",
            "LimitUse",
            lambda **g: problem_with(costs=[sm.costs.LimitUse(**{"velocity": 1.0, **g})]),
            velocity={**shares, "inf": INF},
            acceleration=shares,
            power={**NUMBERS, "2": 2, "1000": 1000},
            name={"''": "", "3": 3},
        ),
    ]


@cache
def _sample_plan() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def _planning_rows() -> list[Row]:
    area = "Planning"
    limits = {"[1, 1]": [1, 1], "0": 0, "-1": -1, "nan": NAN, "'fast'": "fast"}
    return [
        *bad_values_of(
            area,
            "plan",
            lambda **g: sm.plan(sm.sample_problem(), **g),
            warm_start={"'plan.npz'": "plan.npz", "3": 3, "Plan (the class)": sm.Plan},
        ),
        *bad_values_of(
            area,
            "fastest",
            sound(sm.fastest, problem=sm.sample_problem(), acceleration=10.0),
            problem={"None": None, "'panda'": "panda", "Problem (the class)": sm.Problem},
            acceleration=limits,
            velocity=limits,
        ),
        *bad_values_of(
            area,
            "plan.redundancy_map",
            lambda **g: _sample_plan().redundancy_map(**g),
            coordinate={"'elbow'": "elbow", "'tool'": "tool", "'joint9'": "joint9", "3": 3},
            shape={"7": 7, "(1, 9)": (1, 9), "(2.5, 9)": (2.5, 9), "(9, 10000)": (9, 10000)},
        ),
        Row(
            area,
            "fastest() of an arm without known accelerations",
            lambda _: sm.fastest(sm.sample_problem()),
        ),
    ]


def _replanner_rows() -> list[Row]:
    area, arm = "While the arm moves", robot_named("panda")
    others = {"1": 1, "'fast'": "fast", "None": None}
    asked = {"[ClosedPath]": [sm.constraints.ClosedPath()], "[1]": [1], **others}
    state = {"None": None, "'home'": "home", "of six joints": PANDA_HOME[:6], "NaN": [NAN] * 7}

    def stepped(**given: Any) -> object:
        first = {"t": 0.0, "q": PANDA_HOME, "qd": np.zeros(7), "path": line(), **given}
        return sm.Replanner(arm).step(**first)

    return [
        *bad_values_of(
            area,
            "Replanner",
            sound(sm.Replanner, robot=arm),
            robot={"'panda'": "panda", "None": None},
            task={"3": 3, "'poses'": "poses"},
            costs={"[1]": [1], **others},
            constraints=asked,
            null_motion={"3": 3, "'cubic'": "cubic"},
            approach={"3": 3, "'slow'": "slow"},
            horizon=POSITIVE,
            cycle=POSITIVE,
            settling=POSITIVE,
            period={"0": 0, "5 s of a horizon of 2 s": 5.0},
            reserve={"-1": -1, "NaN": NAN, "9": 9.0},
            steps={"1": 1, "2.5": 2.5, "None": None},
            latency={"-1": -1, "NaN": NAN},
            patience={"-1": -1, "NaN": NAN},
        ),
        *bad_values_of(
            area, "replanner.step", sound(stepped), t={"NaN": NAN, "None": None}, q=state, qd=state
        ),
        *bad_values_of(
            area,
            "realtime.Chunk.of",
            sound(realtime.Chunk.of, times=[0.0, 1.0], poses=[np.eye(4)] * 2),
            times={
                "None": None,
                "[0, 0]": [0, 0],
                "[1, 0]": [1, 0],
                "of three poses": [0, 1, 2],
                "NaN": [0.0, NAN],
            },
            poses={"None": None, "'poses'": "poses", "one": [np.eye(4)], "[1, 2]": [1, 2]},
        ),
        Row(area, "a chunk without times", lambda _: stepped(path=None, chunk=[np.eye(4)] * 2)),
        Row(
            area,
            "a chunk and a path",
            lambda _: stepped(chunk=[np.eye(4)] * 2, times=[0.0, 1.0]),
        ),
        Row(
            area,
            "a replanner of a planar arm for a full pose",
            lambda _: sm.Replanner(robot_named("planar_3r")),
        ),
    ]


def _limit_file_rows() -> list[Row]:
    area, arm = "Files", robot_named("planar_3r")
    speed = {"has_velocity_limits": True, "max_velocity": 1.0}
    known: dict[str, Any] = {
        "an empty file": None,
        "a list": [1, 2],
        "no table joint_limits": {"joints": {}},
        "joints of another arm": {"joint_limits": {"elbow": speed}},
        "joint_limits that are a list": {"joint_limits": ["joint1"]},
        "a joint that is a number": {"joint_limits": {"joint1": 3}},
        "an unknown key": {"joint_limits": {"joint1": {**speed, "max_velocty": 1.0}}},
        "a flag that is a word": {"joint_limits": {"joint1": {"has_velocity_limits": "sure"}}},
        "a flag without its limit": {"joint_limits": {"joint1": {"has_velocity_limits": True}}},
        "a limit without its flag": {"joint_limits": {"joint1": {"max_velocity": 1.0}}},
        "a limit of 0": {"joint_limits": {"joint1": {**speed, "max_velocity": 0.0}}},
        "a limit that is a text": {"joint_limits": {"joint1": {**speed, "max_velocity": "1"}}},
        "a limit of inf": {"joint_limits": {"joint1": {**speed, "max_velocity": INF}}},
        "positions the wrong way round": {
            "joint_limits": {
                "joint1": {"has_position_limits": True, "min_position": 1, "max_position": -1}
            }
        },
        "a scaling factor of 2": {
            "default_velocity_scaling_factor": 2.0,
            "joint_limits": {"joint1": speed},
        },
    }

    def read(folder: Path, document: Any) -> object:
        return sm.files.read_joint_limits(_written(folder, document), arm)

    return [
        *(
            Row(area, f"read_joint_limits() of {what}", lambda folder, d=document: read(folder, d))
            for what, document in known.items()
        ),
        Row(
            area,
            "read_joint_limits() of no file",
            lambda folder: sm.files.read_joint_limits(folder / "none.yaml", arm),
        ),
        Row(area, "read_joint_limits(None)", lambda _: sm.files.read_joint_limits(None, arm)),
        Row(
            area,
            "read_joint_limits() for no arm",
            lambda folder: sm.files.read_joint_limits(_written(folder, None), "panda"),
        ),
    ]


def _written(folder: Path, document: Any) -> Path:
    file = folder / "joint_limits.yaml"
    file.write_text("" if document is None else yaml.safe_dump(document))
    return file
