"""The schema says what is read: every file of ours is valid, and what is refused is not."""

import copy
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import selfmotion as sm
from selfmotion.basics import read_document
from selfmotion.shell.documents import example_text, plan_request_of

ROOT = Path(__file__).parents[2]
# Of a process of its own: other tests make classes, which files of this process know as well.
PRINTED = (
    "import json; from selfmotion.shell.documents import json_schema; "
    "print(json.dumps(json_schema()))"
)
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
# Tables whose keys are names: of joints, parts, arguments, costs, keys of a grid.
FREE = ("lock", "arguments", "parts", "keep", "grid")


@cache
def schema() -> Any:
    """Return the schema; made by the first test that asks, not while tests are collected."""
    done = subprocess.run([sys.executable, "-c", PRINTED], capture_output=True, check=True)
    return json.loads(done.stdout)


@cache
def judge() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(schema())


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())
    assert len(EXAMPLES) > 2


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.name)
def test_examples_are_valid(file: Path) -> None:
    assert [error.message for error in judge().iter_errors(read_document(file))] == []


@pytest.mark.parametrize("positioner", [False, True])
@pytest.mark.parametrize("job", [False, True])
@pytest.mark.parametrize("arm", ["panda", "ur10"])
def test_what_init_writes_is_valid(arm: str, job: bool, positioner: bool, tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(example_text(arm, file, job=job, positioner=positioner))
    assert [error.message for error in judge().iter_errors(read_document(file))] == []


def tables(value: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the ways to all tables in a document whose keys are not names."""
    if isinstance(value, dict) and not (way and way[-1] in FREE):
        yield way
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if isinstance(item, dict | list):
            yield from tables(item, (*way, key))


def spoiled(document: dict[str, Any], way: tuple[Any, ...]) -> dict[str, Any]:
    found = copy.deepcopy(document)
    inner: Any = found
    for key in way:
        inner = inner[key]
    inner["nonsense"] = 1
    return found


FULL: dict[str, Any] = {
    "task": "pointing",
    "start": "free",
    "robot": {"name": "panda", "tool_offset": {"position_mm": [0, 0, 50], "rpy_deg": [0, 0, 9]}},
    "path": {
        "kind": "placed",
        "frame": {"position_mm": [400, 0, 300]},
        "path": {
            "kind": "line",
            "start": {"position": [0, 0, 0], "rpy_deg": [180, 0, 0]},
            "by_mm": [0, 80, 0],
            "feed_mm": 50,
            "leads": {"length_mm": 20, "duration": 0.5},
            "weave": {"amplitude_mm": 2, "pitch_mm": 10},
        },
    },
    "costs": [{"kind": "JointVelocity", "weight": 2.0}],
    "constraints": [
        {"kind": "Clearance", "obstacles": [
            {"shape": "sphere", "name": "a", "position_mm": [0, 0, -900], "radius_mm": 9}
        ]},
    ],
    "relaxations": [{"rows": ["rx"], "band_deg": 5}],
    "search": {"starts": 3},
}  # fmt: skip
SEAMS: dict[str, Any] = {
    "robot": {"name": "panda"},
    "task": "pointing",
    "job": {"start": "home", "branches": 1},
    "seams": [{"name": "one", "wait": 0.1, "path": FULL["path"]["path"]}],
}


def test_a_key_that_is_refused_is_not_valid_and_the_other_way_round(tmp_path: Path) -> None:
    cache: dict[str, Any] = {}
    assert judge().is_valid(FULL)
    plan_request_of(FULL, cache=cache)
    ways = list(tables(FULL))
    assert len(ways) > 12
    for way in ways:
        wrong = spoiled(FULL, way)
        assert not judge().is_valid(wrong), way
        with pytest.raises(sm.SelfmotionError, match="nonsense"):
            plan_request_of(wrong, cache=cache)


def test_and_of_jobs(tmp_path: Path) -> None:
    from selfmotion.basics import write_document

    def read(document: dict[str, Any]) -> sm.files.SeamJob:
        write_document(tmp_path / "job.json", document)
        return sm.files.read_seam_job(tmp_path / "job.json")

    assert judge().is_valid(SEAMS)
    read(SEAMS)
    for way in tables(SEAMS):
        wrong = spoiled(SEAMS, way)
        assert not judge().is_valid(wrong), way
        with pytest.raises(sm.SelfmotionError, match="nonsense"):
            read(wrong)
    for wrong in ({**SEAMS, "path": FULL["path"]}, {"robot": {"name": "panda"}, "job": {}}):
        assert not judge().is_valid(wrong)
        with pytest.raises(sm.SelfmotionError):
            read(wrong)
    table = {"file": "a.csv", "feed_mm": 20, "leads": {"length_mm": 20, "duration": 0.5}}
    whole = {**SEAMS, "seams": table}
    assert judge().is_valid(whole)
    for way in tables(whole):
        assert not judge().is_valid(spoiled(whole, way)), way


def test_defaults_are_in_the_unit_of_their_key() -> None:
    found = dict[str, tuple[float, float]]()
    for name, definition in schema()["$defs"].items():
        for key, value in definition.get("properties", {}).items():
            for suffix in ("_deg", "_mm"):
                base = definition["properties"].get(key.removesuffix(suffix), {})
                if key.endswith(suffix) and isinstance(base.get("default"), float):
                    found[f"{name}.{key}"] = (base["default"], value["default"])
    assert found
    for key, (plain, other) in found.items():
        scale = 57.29577951308232 if key.endswith("_deg") else 1000.0
        assert other == pytest.approx(plain * scale), key
    # What editors parse has no infinity.
    json.dumps(schema(), allow_nan=False)


def keys_of(node: Any) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield table, key and schema of every key in a schema."""
    if isinstance(node, list):
        for item in node:
            yield from keys_of(item)
    if isinstance(node, dict):
        if isinstance(node.get("properties"), dict) and "type" in node:
            for key, value in node["properties"].items():
                yield str(node.get("title")), key, value
        for item in node.values():
            yield from keys_of(item)


def test_every_key_says_what_it_is() -> None:
    """Where editors show it, and on the page of all keys."""
    found = list(keys_of(schema()))
    assert len(found) > 500
    assert [(table, key) for table, key, value in found if not value.get("description")] == []


def test_units_of_descriptions_are_those_of_their_keys() -> None:
    told = {key: value["description"] for _, key, value in keys_of(schema())}
    assert "[mm]" in told["radius_mm"]
    assert "[mm/s]" in told["feed_mm"]
    assert schema()["properties"]["start_deg"]["description"].startswith(
        "The start configuration [° or m]"
    )
    for key, text in told.items():
        units = re.findall(r"\[([^\[\]]*)\]", text)
        wrong = {"_deg": r"\brad\b", "_mm": r"\bm\b"}.get(key[key.rfind("_") :])
        assert wrong is None or not any(re.search(wrong, unit) for unit in units), key


@pytest.mark.parametrize("key", ["after", "after_any", "may_meet"])
def test_names_of_seams_are_lists(key: str, tmp_path: Path) -> None:
    from selfmotion.basics import write_document

    one, file = SEAMS["seams"][0], tmp_path / "job.json"
    first = {**one, "name": "zero", "leaves": [{"shape": "sphere", "name": "a", "radius": 0.01}]}
    for names, is_read in ((["zero"], True), ("zero", False)):
        document = {**SEAMS, "seams": [first, {**one, key: names}]}
        if key == "may_meet":
            document["seams"][1][key] = ["a"] if is_read else "a"
        assert judge().is_valid(document) == is_read
        write_document(file, document)
        if is_read:
            sm.files.read_seam_job(file)
        else:
            with pytest.raises(sm.SelfmotionError, match=f"{key}: is .* expected a list of names"):
                sm.files.read_seam_job(file)


def test_no_pose_is_offered_in_degrees() -> None:
    keys = schema()["$defs"]["LinePath"]["properties"]
    assert "start" in keys
    assert "start_deg" not in keys
    assert "start_deg" in schema()["properties"]
