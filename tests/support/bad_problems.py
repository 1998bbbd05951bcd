"""Problems whose parts do not fit together, and settings of planning that are none."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

import selfmotion as sm
from support.arms import PANDA_HOME, robot_named
from support.bad_rows import Row
from support.bad_values import (
    FLAGS,
    PATHS,
    POSITIVE,
    TEXTS,
    WHOLE,
    bad_values_of,
    problem_with,
)

NAN = float("nan")
POSITIVE_OR_NONE = {key: value for key, value in POSITIVE.items() if value is not None}


# Of the rows rx, ry, rz first two are relaxed, then another two.
_PAIRS = [
    sm.Relaxation("rx", 0.1, during=(0.0, 0.4)),
    sm.Relaxation("ry", 0.1),
    sm.Relaxation("rz", 0.1, during=(0.6, 1.0)),
]


def _panda(**given: Any) -> sm.Problem:
    robot = robot_named("panda")
    path = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.1, 4.0)
    return sm.Problem(**{"robot": robot, "path": path, "start": PANDA_HOME, **given})


def _line(duration: float, length: float = 0.01) -> sm.paths.Line:
    start = robot_named("panda").pose(PANDA_HOME)
    end = pin.SE3(start)
    end.translation = start.translation + np.array([-length, 0.0, 0.0])
    return sm.paths.Line(start, end, duration)


def problem_rows() -> list[Row]:
    """Return rows of problems and of what an arm is asked."""
    area = "Problems"
    robots = {"'panda'": "panda", "None": None, "RobotModel (the class)": sm.RobotModel}
    starts = {
        "'home'": "home",
        "[0] * 6": [0.0] * 6,
        "[nan] * 7": [NAN] * 7,
        "['0'] * 6 + ['a']": ["0"] * 6 + ["a"],
        "3": 3,
        "[[0] * 7]": [[0.0] * 7],
        "[0.1] * 7, off the path": [0.1] * 7,
        "[[1], 2]": [[1], 2],
    }
    null = {
        "None": None,
        "3": 3,
        "'cubic'": "cubic",
        "PolynomialNullMotion (the class)": sm.PolynomialNullMotion,
    }
    far = pin.SE3(np.eye(3), np.array([300.0, 0.0, 500.0]))
    return [
        *bad_values_of(
            area,
            "Problem",
            _panda,
            robot=robots,
            path=PATHS,
            task={**TEXTS, "'poses'": "poses", "Task (the class)": sm.Task},
            start=starts,
            null_motion=null,
            relaxations={"'z'": "z", "None": None, "[1]": [1]},
            damping={"0.1": 0.1, "True": True, "Damping (the class)": sm.Damping},
            clearance={"0.01": 0.01, "True": True, "'none'": "none"},
            rest=FLAGS,
        ),
        Row(area, "other pairs of rotations at other times", lambda _: _panda(relaxations=_PAIRS)),
        Row(area, "1 cm in 1 ns", lambda _: _panda(path=_line(1e-9))),
        Row(area, "1 m in 1 µs", lambda _: _panda(path=_line(1e-6, 1.0))),
        Row(
            area,
            "a path in millimetres",
            lambda _: _panda(path=sm.paths.Dwell(far, 1.0), start=None),
        ),
        Row(
            area,
            "a full pose for an arm of six joints",
            lambda _: problem_with(
                robot=robot_named("ur5"), path=_line(1.0), task="pose", start=None
            ),
        ),
        Row(area, "a pose for a planar arm", lambda _: problem_with(task="pose")),
        *bad_values_of(
            area,
            "robot.pose",
            robot_named("panda").pose,
            q={
                "[0] * 6": [0] * 6,
                "[nan] * 7": [NAN] * 7,
                "'home'": "home",
                "None": None,
                "[[0] * 6, [0] * 6]": [[0] * 6, [0] * 6],
                "[[[0] * 7]]": [[[0] * 7]],
                "[0, [1]]": [0, [1]],
            },
        ),
        *bad_values_of(
            area,
            "robot.jacobian",
            robot_named("panda").jacobian,
            q={"[0] * 8": [0] * 8, "inf": [np.inf] * 7, "'q'": "q"},
        ),
        *bad_values_of(
            area,
            "robot.null_space",
            lambda **given: robot_named("planar_3r").null_space(
                **{"q": [0.3, 0.8, 0.4], "task": "planar", **given}
            ),
            q={
                "[0, 0]": [0, 0],
                "[[0, 0, 0], [0, nan, 0]]": [[0, 0, 0], [0, NAN, 0]],
                "[[0, 1, 1], [0, 0, 0]]": [[0, 1, 1], [0, 0, 0]],
            },
            task=TEXTS,
        ),
        *bad_values_of(
            area,
            "robot.inverse_kinematics",
            lambda **given: robot_named("panda").inverse_kinematics(
                **{"pose": robot_named("panda").pose(PANDA_HOME), **given}
            ),
            pose={
                "None": None,
                "numpy.eye(3)": np.eye(3),
                "'here'": "here",
                "(0, 0, 1)": (0, 0, 1),
            },
            task=TEXTS,
            seed={"[0] * 3": [0] * 3, "'home'": "home"},
            attempts=WHOLE,
            rng={"'seed'": "seed", "-1": -1},
        ),
        *bad_values_of(
            area,
            "robot.redundancy",
            lambda **given: robot_named("panda").redundancy(**given),
            task=TEXTS,
        ),
    ]


def setting_rows() -> list[Row]:
    """Return rows of null motions, relaxations, settings and motions."""
    whole = {**WHOLE, "2000": 2000}
    spaces = {**TEXTS, "'Null'": "Null"}
    times = {"(1,)": (1,), "(2, 1)": (2, 1), "(0, nan)": (0, NAN), "'all'": "all", "1.0": 1.0}
    motion = {"t": [0, 1], "q": [[0.0], [1.0]], "qd": [[0.0], [0.0]], "joint_names": ("j",)}
    tables = {"[0, 1]": [0, 1], "[[0], [nan]]": [[0], [NAN]], "'q'": "q", "None": None}
    trajectory = sm.Trajectory(**motion)
    return [
        *bad_values_of(
            "Null motions",
            "PolynomialNullMotion",
            sm.PolynomialNullMotion,
            degree=whole,
            space=spaces,
            basis=TEXTS,
        ),
        *bad_values_of(
            "Null motions",
            "BSplineNullMotion",
            sm.motion.BSplineNullMotion,
            intervals={**WHOLE, "0": 0, "1e9": 10**9},
            degree=whole,
            space=spaces,
        ),
        *bad_values_of(
            "Relaxations",
            "Relaxation",
            lambda **g: sm.Relaxation(**{"rows": "z", **g}),
            rows={
                "'q'": "q",
                "[]": [],
                "('x', 'rx')": ("x", "rx"),
                "None": None,
                "('x', 'x')": ("x", "x"),
                "3": 3,
                "[1, 2]": [1, 2],
            },
            band={"nan": NAN, "0": 0, "-1": -1, "'wide'": "wide", "None": None},
            during=times,
            axes=TEXTS,
        ),
        *bad_values_of(
            "Damping",
            "Damping",
            sm.Damping,
            threshold=POSITIVE,
            strength=POSITIVE,
            path_weight=POSITIVE,
        ),
        *bad_values_of("Planning", "Tolerance", sm.Tolerance, position=POSITIVE, rotation=POSITIVE),
        *bad_values_of(
            "Planning",
            "Search",
            sm.Search,
            starts=WHOLE,
            finalists=WHOLE,
            mode=TEXTS,
            rng={"'seed'": "seed", "-1": -1, "1.5": 1.5},
        ),
        *bad_values_of(
            "Planning",
            "plan",
            lambda **g: sm.plan(**{"problem": sm.sample_problem(), **g}),
            problem={"None": None, "Problem (the class)": sm.Problem, "'panda'": "panda"},
            tolerance={
                "0": 0,
                "-1": -1,
                "nan": NAN,
                "'1e-6'": "1e-6",
                "Tolerance (the class)": sm.Tolerance,
                "[1e-6]": [1e-6],
            },
            search={
                "'global'": "global",
                "Search (the class)": sm.Search,
                "Search() where the start is given": sm.Search(),
            },
            optimizer={
                "'bfgs'": "bfgs",
                "QuasiNewton (the class)": sm.QuasiNewton,
                "one that returns 3": SimpleNamespace(minimize=lambda *a, **g: 3),
            },
            callback={"5": 5},
            progress={"5": 5},
            max_evaluations={k: v for k, v in {**WHOLE, "0": 0}.items() if v is not None},
        ),
        *bad_values_of(
            "Planning",
            "plan_in_parts",
            lambda **g: sm.plan_in_parts(sm.sample_problem(), **g),
            axis={"(0, 0, 1), without a retreat": (0, 0, 1)},
            progress={"5": 5},
        ),
        *bad_values_of(
            "Planning",
            "plan_by",
            lambda **g: sm.plan_by(
                **{"problem": sm.sample_problem(), "method": sm.baselines.PseudoInverse(), **g}
            ),
            problem={"None": None},
            tolerance={"0": 0, "'1'": "1"},
            method={
                "None": None,
                "'pinv'": "pinv",
                "PseudoInverse (the class)": sm.baselines.PseudoInverse,
            },
        ),
        *bad_values_of(
            "Planning",
            "QuasiNewton",
            sm.QuasiNewton,
            update=TEXTS,
            tolerance=POSITIVE,
            max_iterations=WHOLE,
            unbounded=POSITIVE,
            initial_metric=TEXTS,
            line_search={"None": None, "0.1": 0.1},
        ),
        *bad_values_of(
            "Planning",
            "DampedLeastSquares",
            sm.baselines.DampedLeastSquares,
            damping=POSITIVE,
            threshold={"0": 0, "nan": NAN, "'1'": "1"},
        ),
        *bad_values_of(
            "Planning",
            "GradientProjection",
            sm.baselines.GradientProjection,
            gain={"-1": -1, "nan": NAN, "'1'": "1"},
        ),
        *bad_values_of(
            "Planning",
            "sample_problem",
            sm.sample_problem,
            mu={"nan": NAN, "-1": -1},
            duration=POSITIVE,
            null_motion={"3": 3},
        ),
        *bad_values_of(
            "Motions",
            "Trajectory",
            lambda **g: sm.Trajectory(**{**motion, **g}),
            t={
                "[0]": [0],
                "[1, 0]": [1, 0],
                "[0, nan]": [0, NAN],
                "'ab'": "ab",
                "None": None,
                "1.0": 1.0,
            },
            q=tables,
            qd=tables,
            qdd={key: value for key, value in tables.items() if key != "None"},
            joint_names={"()": (), "('a', 'b')": ("a", "b"), "3": 3, "None": None, "(1,)": (1,)},
        ),
        *bad_values_of(
            "Motions",
            "trajectory",
            lambda **g: trajectory(**{"t": 0.0, **g}),
            t={"-1": -1, "nan": NAN, "'0'": "0", "None": None, "[[0, 'a']]": [[0, "a"]]},
            order={"4": 4, "-1": -1, "'1'": "1", "None": None, "0.5": 0.5},
        ),
        *bad_values_of(
            "Motions", "trajectory.sample", trajectory.sample, rate={**POSITIVE, "1e300": 1e300}
        ),
        *bad_values_of(
            "Motions",
            "certify",
            _certify,
            robot={"'panda'": "panda", "None": None},
            path=PATHS,
            task=TEXTS,
            trajectory={"None": None, "[0, 1]": [0, 1]},
            tolerance={"0": 0, "'small'": "small"},
            requirements={"3": 3, "[3]": [3], "None": None},
        ),
        *bad_values_of("Motions", "slowdown", sm.slowdown, plan={"None": None, "'plan'": "plan"}),
        *bad_values_of(
            "Motions",
            "place",
            lambda **g: sm.place(**{"problems": None, "within": {"x": (0, 1)}, **g}),
            problems={"None": None, "()": ()},
        ),
        *bad_values_of("Motions", "margin", sm.margin, plan={"None": None, "'plan'": "plan"}),
        Row("Motions", "retime(None, 1.0)", lambda _: sm.retime(None, 1.0)),
        *_file_rows(),
        *bad_values_of(
            "Files",
            "read_path",
            lambda **g: sm.files.read_path(**{"file": "a.csv", **g}),
            feed=POSITIVE_OR_NONE,
            duration=POSITIVE_OR_NONE,
            jump=POSITIVE,
        ),
        *bad_values_of(
            "Files",
            "write_motion",
            lambda **g: sm.files.write_motion(**{"plan": None, "file": "a.csv", **g}),
            plan={"None": None, "'plan'": "plan"},
        ),
        *bad_values_of(
            "Files",
            "ProgramSettings",
            sm.files.ProgramSettings,
            deviation={"None": None, "0.1": 0.1},
            axes={"['A1']": ["A1"], "{'joint1': 'A7'}": {"joint1": "A7"}},
            signals={"3": 3, "{'on': 7}": {"on": 7}, "{'on': (7, 1)}": {"on": (7, 1)}},
            flange={"3": 3},
            mass={"0": 0, "3200": 3200, "'heavy'": "heavy"},
            center={"[0, 0]": [0, 0], "[0, 0, 80]": [0, 0, 80], "'tip'": "tip"},
            approach={"0": 0, "2": 2},
            targets={"'lines'": "lines", "None": None},
            work_object={"'table'": "table"},
            positioner={"0": 0, "'unit 1'": "unit 1"},
        ),
        Row(
            "Files",
            "ProgramSettings(targets='poses', work_object=[[1]])",
            lambda _: sm.files.ProgramSettings(targets="poses", work_object=[[1.0]]),
        ),
        Row(
            "Files",
            "ProgramSettings(targets='poses', work_object=…600 m away…)",
            lambda _: sm.files.ProgramSettings(
                targets="poses",
                work_object=[[1, 0, 0, 600], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            ),
        ),
        Row(
            "Files",
            "read_motion('a.mod', robot='ur5')",
            lambda _: sm.files.read_motion("a.mod", robot="ur5"),
        ),
        *bad_values_of(
            "Files",
            "write_problem",
            lambda **g: sm.files.write_problem(
                **{"problem": sm.sample_problem(), "file": "a.toml", **g}
            ),
            problem={"None": None, "'panda'": "panda"},
            file={"None": None, "3": 3, "'a.docx'": "a.docx"},
        ),
    ]


def _certify(**given: Any) -> object:
    sample = sm.sample_problem()
    parts = {"robot": sample.robot, "path": sample.path, "task": "planar"}
    q = np.tile(sample.start, (2, 1))
    motion = sm.Trajectory([0.0, 1.0], q, 0.0 * q, sample.robot.joint_names)
    return sm.certify(**{**parts, "trajectory": motion, **given})


def _file_rows() -> list[Row]:
    readers = {
        "load_plan": sm.load_plan,
        "read_problem": sm.read_problem,
        "read_job": sm.files.read_job,
        "read_path": sm.files.read_path,
        "read_motion": sm.files.read_motion,
    }
    saved = {"load_plan": "npz", "read_problem": "toml", "read_job": "json"}
    found = []
    for name, reader in readers.items():
        for what, content in (
            ("no file", None),
            ("an empty file", b""),
            ("a binary file", b"\x00\xff\xfe\x80" * 9),
            ("a text", b"hello\n"),
        ):
            suffix = saved.get(name, "csv")

            def call(folder: Any, read: Any = reader, c: Any = content, s: str = suffix) -> object:
                file = folder / f"given.{s}"
                file.unlink(missing_ok=True)
                if c is not None:
                    file.write_bytes(c)
                return read(file)

            found.append(Row("Files", f"{name}() of {what} (.{suffix})", call))
        for written, value in (("None", None), ("3", 3)):
            found.append(Row("Files", f"{name}({written})", lambda _, r=reader, v=value: r(v)))
        found.append(Row("Files", f"{name}() of a folder", lambda folder, r=reader: r(folder)))
    return found
