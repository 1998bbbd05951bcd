"""The models of files say what the classes are made of: every kind, every key, every default."""

import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

import selfmotion as sm
from selfmotion.model.collision import obstacle_shapes
from selfmotion.model.task import SE3
from selfmotion.shell.documents.body_tables import BODIES
from selfmotion.shell.documents.constraint_tables import (
    CONSTRAINTS,
    ClearanceTable,
    DampingTable,
    RelaxationTable,
)
from selfmotion.shell.documents.cost_tables import COSTS, NULL_MOTIONS, AnyCost
from selfmotion.shell.documents.job_tables import JobTable, SeamTable
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.path_base import LeadsTable, WeaveTable
from selfmotion.shell.documents.path_tables import PATHS
from selfmotion.shell.documents.pose_tables import FilePoses
from selfmotion.shell.documents.problem_table import (
    FollowTable,
    InPartsTable,
    LineSearchTable,
    ProblemTable,
    QuasiNewtonTable,
    SearchTable,
    ToleranceTable,
)
from selfmotion.shell.documents.tables import Table

SHELL = Path(sm.__file__).parent / "shell"
POSE = {"position", "rotation", "quaternion", "rpy", "rotation_vector", "normal"}
PACED = {"feed", "turn_rate", "acceleration", "turn_acceleration", "smoothing", "within", "weave"}
FRAMED = {"frame", "leads"}
# Kinds that no file names: what others have in common, what is missing of a plan, what a search
# adds, functions (which are named by module:attribute).
IN_NO_FILE = {"Round", "LostCost", "OffPath", "BeyondLimits", "FunctionCost"}
# Where classes are defined that a file may name; not those of motions that change while they run.
OURS = tuple(f"selfmotion.{wing}." for wing in ("model", "problem", "planning", "paper"))
# Kinds of files that are no class.
OF_FILES = {"file", "function"}
# Of kinds: keys that are no parameters, and parameters that are no keys.
BESIDES: Mapping[str, tuple[set[str], set[str]]] = {
    "circle": ({"radius"} | PACED | FRAMED, set()),
    "line": ({"by"} | PACED | FRAMED, set()),
    "spiral": (PACED | FRAMED, set()),
    "twist": ({"breaks", "coefficients"}, {"velocity", "duration"}),
    **dict.fromkeys(("feed", "joined", "weave"), (FRAMED, set())),
    **dict.fromkeys(("polyline", "waypoints"), ({"quaternions"} | FRAMED, set())),
    # The distance from a body is its clearance's.
    **dict.fromkeys(
        ("box", "sphere", "cylinder", "capsule", "mesh"), ({*POSE, "distance"}, {"pose"})
    ),
}
# Defaults that files have otherwise, and why.
DEFAULTS = {
    ("Tilt", "towards"): "down suits a torch, and is upside down for a table: files say it",
    ("JointVelocity", "weight"): "without one, that of the arm: a metre counts as so many radians",
    ("NodeNullMotion", "times"): "a list in files",
    ("Search", "rng"): "a number in files",
    ("Follow", "path"): "or a pose that is held",
}
FAMILIES: list[tuple[OneOf, Mapping[str, type]]] = [
    (PATHS, sm.paths.Path.kinds()),
    (NULL_MOTIONS, sm.motion.NullMotion.kinds()),
    (COSTS, sm.costs.Cost.kinds()),
    (CONSTRAINTS, sm.constraints.Constraint.kinds()),
    (BODIES, dict(obstacle_shapes())),
]
KINDS: dict[str, tuple[type[Table], Any]] = {
    kind: (table, classes[kind])
    for one_of, classes in FAMILIES
    for kind, table in one_of.by_name().items()
    if kind not in OF_FILES
}
# Tables that are no kinds, and what they are handed to.
OTHERS: dict[str, tuple[type[Table], Any]] = {
    "Clearance": (ClearanceTable, sm.constraints.Clearance),
    "Damping": (DampingTable, sm.Damping),
    "Relaxation": (RelaxationTable, sm.Relaxation),
    "Follow": (FollowTable, sm.Follow),
    "Search": (SearchTable, sm.Search),
    "Tolerance": (ToleranceTable, sm.Tolerance),
    "QuasiNewton": (QuasiNewtonTable, sm.QuasiNewton),
    "LineSearch": (LineSearchTable, sm.optimise.LineSearch),
    "InParts": (InPartsTable, sm.plan_in_parts),
    "Problem": (ProblemTable, sm.Problem),
    "Job": (JobTable, sm.plan_job),
    "Seam": (SeamTable, sm.Seam),
    "leads": (LeadsTable, sm.paths.with_leads),
    "weaves": (WeaveTable, sm.paths.Weave),
    "a file": (PATHS.by_name()["file"], sm.files.read_path),
}


@pytest.mark.parametrize(("one_of", "classes"), FAMILIES)
def test_each_class_that_a_file_may_name_has_a_table(
    one_of: OneOf, classes: Mapping[str, type]
) -> None:
    ours = {kind for kind, cls in classes.items() if cls.__module__.startswith(OURS)}
    assert set(one_of.by_name()) - OF_FILES == ours - IN_NO_FILE


@pytest.mark.parametrize("kind", KINDS)
def test_the_keys_of_a_kind_are_the_parameters_of_its_class(kind: str) -> None:
    table, cls = KINDS[kind]
    parameters = set(inspect.signature(cls).parameters) - set(getattr(cls, "context", ()))
    more, fewer = BESIDES.get(kind, (set(), set()))
    assert set(table.model_fields) - {"kind", "shape"} == (parameters - fewer) | more


@pytest.mark.parametrize("name", [*KINDS, *OTHERS])
def test_defaults_are_those_of_python(name: str) -> None:
    """What has no number or text for a default there has none in files."""
    table, cls = {**KINDS, **OTHERS}[name]
    for key, parameter in inspect.signature(cls).parameters.items():
        default = getattr(parameter.default, "value", parameter.default)
        if key not in table.model_fields or (name, key) in DEFAULTS:
            continue
        field = table.model_fields[key]
        if isinstance(default, bool | int | float | str):
            assert not field.is_required(), key
            # A name of each kind is its own.
            assert field.default == default or key in ("name", "task"), key
        elif default is inspect.Parameter.empty and name not in BESIDES:
            assert field.is_required(), key


def test_an_exception_is_of_a_key_that_there_is() -> None:
    for name, key in DEFAULTS:
        assert key in {**KINDS, **OTHERS}[name][0].model_fields


def test_a_key_is_written_in_one_file_of_the_shell() -> None:
    """Beside the notice of options that became keys: by keys whose names are no other words."""
    keys = [key for key in FilePoses.__annotations__ if "_" in key]
    assert {"flip_normals", "rotary_axes"} <= set(keys)
    texts = {file.name: file.read_text("utf-8") for file in SHELL.rglob("*.py")}
    for key in keys:
        named = {name for name, text in texts.items() if re.search(rf"\b{key}\b", text)}
        assert named - {"moved.py"} == {"pose_tables.py"}, key


def test_kinds_that_are_made_while_it_is_planned_are_in_no_file() -> None:
    for kind in sorted(IN_NO_FILE - {"Round"}):
        with pytest.raises(ValidationError) as refused:
            TypeAdapter(AnyCost).validate_python({"kind": kind})
        assert [error["type"] for error in refused.value.errors()] == ["union_tag_invalid"]


@dataclass(frozen=True)
class CostOfATest(sm.costs.Cost):
    """A cost of a user's own."""

    place: SE3
    speed: float = 1.0
    name: str = "cost of a test"


def test_a_class_of_ones_own_is_read_by_its_signature() -> None:
    """Keys, units as those of ours, and poses; what it does not know is told by its key."""
    read = TypeAdapter(AnyCost).validate_python
    given = {"kind": "CostOfATest", "place": {"position_mm": [1, 2, 3]}, "speed_deg": 90.0}
    found = read(given).given
    np.testing.assert_allclose(found["place"].translation, [1e-3, 2e-3, 3e-3])
    assert found["speed"] == pytest.approx(np.pi / 2)
    for key in ("sped", "sped_deg", "margin_deg"):
        with pytest.raises(ValidationError) as refused:
            read({**given, key: 1.0})
        (error,) = refused.value.errors()
        assert error["loc"] == (key,)
        assert error["msg"].startswith("unknown key, ")
