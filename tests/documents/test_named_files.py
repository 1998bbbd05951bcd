"""Files that documents name: from the document's place, whoever writes it."""

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from selfmotion.shell.documents import write_combination
from selfmotion.shell.documents.field_types import File, Files
from selfmotion.shell.documents.named_files import FILE_KEYS, named_from
from selfmotion.shell.documents.problem_table import ProblemTable, SharedTable
from selfmotion.shell.documents.tables import Table
from support.arms import PANDA_HOME, robot_named

GRID = """task = "position"
start = "home"
clearance = false
outputs = ["out/plan.csv"]
[robot]
name = "panda"
calibration = "measured.yaml"
packages = ["parts"]
[path]
kind = "line"
by = [0.0, 0.05, 0.0]
duration = 3.0
[grid]
"path.duration" = [3.0, 4.0]
"""


def names_in(value: Any, key: str = "") -> list[str]:
    if isinstance(value, Mapping):
        return [name for inner, item in value.items() for name in names_in(item, inner)]
    if isinstance(value, list):
        return [name for item in value for name in names_in(item, key)]
    return [value] if key in FILE_KEYS and isinstance(value, str) else []


def test_every_file_is_named_from_where_the_new_document_is(tmp_path: Path) -> None:
    document = {
        "joint_limits": "a.yaml",
        "outputs": ["b.csv", "/c.csv"],
        "robot": {"parts": {"one": {"file": "d.urdf", "calibration": "e.yaml"}}, "packages": ["f"]},
        "clearance": {"srdf": "g.srdf", "obstacles": [{"shape": "mesh", "file": "h.stl"}]},
        "workpiece": {"mesh": "i.stl", "on": "j"},
        "name": "k",
    }
    old, new = tmp_path / "old", tmp_path / "new" / "er"
    moved = named_from(document, old, new)
    before, after = names_in(document), names_in(moved)
    assert len(before) == len(after) == 9
    assert [(old / name).resolve() for name in before] == [(new / name).resolve() for name in after]
    assert moved["workpiece"]["on"] == "j"


def test_the_keys_that_name_files_are_those_of_the_models() -> None:
    tables, found = [Table], set[str]()
    while tables:
        table = tables.pop()
        tables += table.__subclasses__()
        for name, annotation in inspect.get_annotations(table, eval_str=True).items():
            if annotation in (File, Files):
                found.add(name)
    assert found == set(FILE_KEYS)
    assert ProblemTable in SharedTable.__subclasses__()


def test_the_best_of_a_grid_is_of_the_same_measured_arm(tmp_path: Path) -> None:
    cell, results = tmp_path / "cell", tmp_path / "results"
    (cell / "parts").mkdir(parents=True)
    results.mkdir()
    (cell / "grid.toml").write_text(GRID)
    (cell / "one.toml").write_text(GRID.partition("[grid]")[0])
    (cell / "measured.yaml").write_text("offsets: {panda_joint2: 0.002}\n")
    # That of another arm.
    (results / "measured.yaml").write_text("offsets: {panda_joint2: -0.03}\n")
    write_combination(cell / "grid.toml", {"path.duration": 3.0}, results / "best.toml")
    own, best = (sm.read_problem(file) for file in (cell / "one.toml", results / "best.toml"))
    q = np.array(PANDA_HOME)
    np.testing.assert_array_equal(own.robot.pose(q).translation, best.robot.pose(q).translation)


def test_a_mesh_is_the_same_body_in_a_file_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cells").mkdir()
    for file, size in (("part.stl", 0.2), ("cells/part.stl", 0.01)):
        trimesh.creation.box((size, size, size)).export(file)
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 3.0)
    part = sm.obstacles.Mesh("part", [0.5, 0.5, 0.3], "part.stl")
    clearance = sm.constraints.Clearance([part], 0.01)
    problem = sm.Problem(panda, circle, "position", PANDA_HOME, clearance=clearance)
    sm.files.write_problem(problem, "cells/cell.toml")
    (body,) = sm.read_problem("cells/cell.toml").clearances[0].obstacles
    assert Path(body.file).samefile("part.stl")
