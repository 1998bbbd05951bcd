"""What is wrong with a problem file is said in one line, with file, key and what was expected."""

import re
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import read_document
from selfmotion.shell.documents import plan_request_of
from selfmotion.shell.documents.body_tables import BODIES
from selfmotion.shell.documents.constraint_tables import CONSTRAINTS
from selfmotion.shell.documents.cost_tables import COSTS
from selfmotion.shell.documents.path_tables import PATHS
from selfmotion.shell.documents.schema import json_schema
from selfmotion.shell.documents.tables import checks
from support.cells import CELL, written
from support.shell import complaint

# What is changed in the cell above, and what is said of it.
MALFORMED = [
    ("[robot]", "[robot", "is not TOML: Expected ']'"),
    ('task = "pose"', "task = pose", "is not TOML: Invalid value"),
    ('task = "pose"', 'task = "pse"', "task: is 'pse', expected 'pose', 'position'"),
    ('task = "pose"', "task = 6", "task: is 6, expected"),
    ('task = "pose"', 'tsk = "pose"', "tsk: unknown key, did you mean 'task'?"),
    ('start = "home"', 'start = "hme"', "start: is 'hme', expected 'free', 'home'"),
    ('start = "home"', "start = [1, 2]", "start: configuration has shape (2,), expected (7,)"),
    ('start = "home"', "start = [1, 2, 3, 4, 5, 6, nan]", "start: is [1, 2, 3, 4, 5, 6, nan]"),
    ('start = "home"', 'start = "free"', "path: start: is missing, and there is no start conf"),
    ("= 50\n", "= 0.5\n", "max_evaluations: is 0.5, expected a whole number"),
    ('name = "panda"', 'name = "pnda"', "robot: name: unknown robot 'pnda', known: planar_3r"),
    ('name = "panda"', 'file = "no.urdf"', "no.urdf: no such URDF file"),
    ('name = "panda"', 'file = "no.stl"', "expected a .urdf or .xacro file"),
    ('name = "panda"', "", "robot: expected either name (one of planar_3r"),
    ('name = "panda"', 'nme = "panda"', "robot.nme: unknown key, did you mean 'name'?"),
    ('tool = "panda_hand_tcp"', 'tool = "hand"', "no link 'hand' to use as tool frame"),
    ('tool = "panda_hand_tcp"', "tool_offset = 1", "robot.tool_offset: is 1, expected a table"),
    ('tool = "panda_hand_tcp"', "base = { positon = [0,0,0] }", "robot.base: unknown key 'posit"),
    ('tool = "panda_hand_tcp"', "base = { rpy=[0,0,0], quaternion=[1,0,0,0] }", "has both quat"),
    ('tool = "panda_hand_tcp"', "base = { quaternion=[0,0,0,0] }", "the quaternion is zero"),
    ("= 0.02", "= 2.0", "robot: ", "lock holds joint 'panda_finger_joint1' at 2"),
    ("= 0.02", '= "a"', "robot.lock: is {'panda_finger_joint1': 'a'}, expected a table of joints"),
    ('"circle"', '"circel"', "path: kind is 'circel', expected one of: "),
    ('kind = "circle"', "", "path: has no key 'kind', which says what it is"),
    ("radius_mm = 100", "radius_mm = 0", "path: circle: radius is 0.0, expected a number > 0"),
    ("radius_mm = 100", "radius_deg = 100", "path.radius_deg: 'radius' is no angle"),
    ("radius_mm = 100", "radus_mm = 100", "path.radus_mm: unknown key, did you mean 'radius_mm'"),
    ("duration = 4", "feed = 0.1\nwithin_deg = 2", "path.within_deg: 'within' is no angle"),
    ("band_deg = 5", "band_mm = 5", "relaxations[0].band_mm: row 'rx' is an angle; say band_deg"),
    ('["rx", "ry"]', '["x", "y"]', "relaxations[0].band_deg: row 'x' is a length; say band_mm"),
    ("duration = 4", "feeed_mm = 4", "path.feeed_mm: unknown key, did you mean 'feed_mm'?"),
    ("= 50\n", "= 50\ntolerance_mm = { position = 1 }\n", "'tolerance' is no length: a table"),
    ("= 50\n", "= 50\noptimiser = { tolerance_mm = 1 }\n", "'tolerance' is no length"),
    ('tool = "panda_hand_tcp"', "base = { rpy=[0,0,180] }", "180 rad is more than a turn; in degr"),
    ("band_deg = 5", "band = 5e1", "relaxations[0]: relaxation (rx, ry): a band of 50 rad is more"),
    ("radius_mm = 100", "radius_mm = 100\nradius = 0.1", "'radius' is given twice, in two units"),
    ("radius_mm = 100", "", "path: has neither, expected either center or radius"),
    ("[1, 0, 0]", "[1, 0]", "path: circle: normal is [1, 0] of shape (2,), expected"),
    ("duration = 4", "duration = -4", "path: duration is -4, expected a number > 0"),
    ("duration = 4", 'duration = "4 s"', "path.duration: is '4 s', expected a number"),
    ("duration = 4", "", "path: has neither, expected either duration or feed"),
    ("duration = 4", "duration = 4\nfeed = 0.1", "path: has duration and feed, expected either"),
    (
        'kind = "FreeNullMotion"',
        'kind = "PolynomialNullMotion"\ndegree = 3.5',
        "null_motion.degree: is 3.5, expected a whole number",
    ),
    ('"JointVelocity"', '"JointSpeed"', "costs[0]: kind is 'JointSpeed', expected one of: "),
    ('"JointVelocity"', '"own:Cost"', "costs[0].kind: 'own:Cost' is code, which is run only"),
    ("mu = 0.001", "mu = -1", "cost 'inverse manipulability': mu is -1, expected"),
    ("mu = 0.001", "mu = true", "costs[1].mu: is True, expected a number"),
    ("distance_mm = 10", "distance = -1", "clearance: distance is -1"),
    ("distance_mm = 10", 'srdf = "no.srdf"', "no.srdf: SRDF cannot be read"),
    ('shape = "box"', 'shape = "bx"', "clearance.obstacles[0]: shape is 'bx', expected one"),
    ("size_mm = [100, 100, 1200]", "size = [1, -1, 1]", "box 'post': size is [1.0, -1.0, 1.0]"),
    ("size_mm = [100, 100, 1200]", "", "clearance.obstacles[0].size: is missing"),
    ("[[clearance.obstacles]]", "[clearance.obstacles]", "expected a list of tables ([[…]])"),
    ('["rx", "ry"]', '["rx", "q"]', "relaxations[0]: relaxation: rows are 'rx, q', expected some"),
    ("band_deg = 5", "band_deg = 5\nduring = [3, 1]", "relaxations[0]: relaxation (rx, ry): dur"),
    ("position = 1e-5", "position = -1", "tolerance: "),
]  # fmt: skip


TABLES = {**CONSTRAINTS.by_name(), **COSTS.by_name(), **PATHS.by_name(), **BODIES.by_name()}


@pytest.mark.parametrize("name", TABLES)
def test_what_is_an_angle_or_a_length_may_be_in_degrees_or_millimetres(name: str) -> None:
    """By what the sentence of each key says, or a rate of it."""
    for key, info in TABLES[name].model_fields.items():
        told = re.findall(r"\[([^\[\]]*)\]", info.description or "")
        units = {unit.partition("/")[0] for text in told for unit in text.split(" or ")}
        endings = set(getattr(checks(info), "units", ()))
        if checks(info) is not None:
            assert ("_deg" in endings) == ("rad" in units), key
            # Most joints turn: what is of joints is in degrees alone.
            assert ("_mm" in endings) == ("m" in units) or endings == {"_deg"}, key


def test_a_tilt_in_degrees_is_the_one_in_radians(tmp_path: Path) -> None:
    tilt = '[[constraints]]\nkind = "Tilt"\nframe = "panda_link4"\ntowards = [0, 0, -1]\n'
    for key, value in (("within_deg", 170.0), ("within", float(np.radians(170.0)))):
        problem = sm.read_problem(written(tmp_path, f"{CELL}\n{tilt}{key} = {value!r}\n"))
        assert problem.constraints[-1].within == pytest.approx(np.radians(170.0), rel=1e-15)


def test_no_clearance_is_said_by_false_and_not_by_an_empty_list(tmp_path: Path) -> None:
    plain = CELL[: CELL.index("[clearance]")]
    assert sm.read_problem(written(tmp_path, f"clearance = false\n{plain}")).clearance is None
    with pytest.raises(sm.errors.FileFormatError, match="clearance: is an empty list"):
        sm.read_problem(written(tmp_path, f"clearance = []\n{plain}"))


@pytest.mark.parametrize(
    ("more", "given", "value"),
    [
        ('corners = "round"\nfeed_mm = 9', "tolerance_mm = 0.2", ("tolerance", 2e-4)),
        ("feed_mm = 9", "turn_rate_deg = 90", ("turn_rate", np.pi / 2)),
        ("feed_mm = 9", "acceleration_mm = 500", ("acceleration", 0.5)),
    ],
)
def test_whatever_a_path_is_given_may_have_a_unit(
    more: str, given: str, value: tuple[str, float], tmp_path: Path
) -> None:
    """Each is what the key without a unit says."""
    (tmp_path / "a.csv").write_text("x,y,z\n0.4,0,0.4\n0.5,0,0.4\n0.5,0.1,0.4\n")
    found = []
    for text in (given, f"{value[0]} = {value[1]!r}"):
        file = written(
            tmp_path,
            f'task = "position"\n[robot]\nname = "panda"\n[path]\nkind = "file"\n'
            f'file = "a.csv"\n{more}\n{text}\n',
        )
        found.append(sm.read_problem(file).path)
    assert found[0].duration == pytest.approx(found[1].duration, rel=1e-12)
    assert found[0].to_dict() == found[1].to_dict()


@pytest.mark.parametrize("case", MALFORMED, ids=lambda case: case[2][:40])
def test_malformed_files_are_one_line_and_exit_2(case: tuple[str, ...], tmp_path: Path) -> None:
    old, new, *said = case
    assert CELL.count(old) >= 1
    file = written(tmp_path, CELL.replace(old, new, 1))
    line = complaint("plan", file)
    assert line.startswith(f"error: {tmp_path}/")
    for text in said:
        assert text in line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    assert "nosuch.toml: cannot be read: No such file" in complaint(
        "plan", tmp_path / "nosuch.toml"
    )
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    assert "a.toml: is not UTF-8 text" in complaint("plan", tmp_path / "a.toml")
    assert "is not JSON" in complaint("plan", written(tmp_path, "{", "a.json"))
    assert "holds a list, expected a table" in complaint("plan", written(tmp_path, "[]", "a.json"))
    file = written(tmp_path, CELL + '[grid]\n"path.duration" = [3, 5]\n')
    assert "grid has 2 problems: use `selfmotion batch`" in complaint("plan", file)
    file = written(tmp_path, CELL)
    assert "costs.7.mu: leads to '7'" in complaint("plan", file, "--set", "costs.7.mu=1")
    assert "--set is 'a', expected KEY=VALUE" in complaint("plan", file, "--set", "a")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.json", '{"a": 1, "a": 2}', "key 'a' is given twice; keep one"),
        ("a.yaml", "a: 1\na: 2\n", "key 'a' is given twice; keep one"),
        ("a.toml", "a = 1\na = 2\n", "is not TOML"),
        ("a.json", '{"a": ' + "[" * 100_000, "is not JSON: maximum recursion"),
        ("a.toml", "a = " + "[" * 50_000, "is not TOML: maximum recursion"),
        # The C library would end the process.
        ("a.yaml", "a: " + "[" * 100_000, "line 1: more than 50 tables or lists lie in each other"),
        ("a.yaml", "a: &x [1]\nb: [*x, *x]", "line 2: '*x' stands for something else"),
        ("a.yaml", "[a]: 1", "unhashable key"),
        ("a.yaml", "a: !!python/object:os.system 1", "could not determine a constructor"),
        ("a.yaml", "a: 2026-13-45", "month must be in 1..12"),
        ("a.toml", "a = " + "1" * 5000, "Exceeds the limit"),
    ],
)  # fmt: skip
def test_documents_that_mislead_or_exhaust(tmp_path: Path, name: str, text: str, said: str) -> None:
    with pytest.raises(sm.errors.FileFormatError) as refused:
        read_document(written(tmp_path, text, name))
    assert said in str(refused.value)
    assert name in str(refused.value)


def test_degrees_are_refused_for_joints_that_slide(tmp_path: Path) -> None:
    text = 'robot = { name = "tiago" }\nstart_deg = [1,2,3,4,5,6,7,8]\ntask = "position"\n'
    file = written(tmp_path, text + 'path = { kind = "line", by = [0, 0, 0.1], duration = 1 }')
    with pytest.raises(
        sm.errors.FileFormatError, match="start_deg: joint 'torso_lift_joint' slides"
    ):
        sm.read_problem(file)


JUNK = [
    None, True, 0, -1, 1e300, 10**30, float("nan"), float("inf"), "", "1", [], [1, 2, 3], ["a"],
    [[1, 2], [3]], [True, 1, 2], [0.0] * 7, {}, {"a": 1}, [{}],
]  # fmt: skip


def places(node: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the way to each value of a document."""
    if way:
        yield way
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*way, key))


def test_whatever_is_put_anywhere_is_planned_or_refused_by_name(tmp_path: Path) -> None:
    """A problem, or one line that begins with the file: never another exception."""
    sound = read_document(written(tmp_path, CELL))
    rng, cache, said = np.random.default_rng(0), dict[str, Any](), list[str]()
    ways = list(places(sound))
    for _ in range(150):
        document = deepcopy(sound)
        *way, last = ways[rng.integers(len(ways))]
        node = document
        for key in way:
            node = node[key]
        node[last] = JUNK[rng.integers(len(JUNK))]
        try:
            plan_request_of(document, tmp_path / "cell.toml", cache=cache)
        except sm.SelfmotionError as error:
            said.append(str(error))
    assert len(said) > 75
    for line in said:
        assert line.startswith(f"{tmp_path / 'cell.toml'}: ")
        assert "\n" not in line


@pytest.mark.parametrize("kind", ["JointVelocityLimits", "JointTorqueLimits", "ToolLimits"])
def test_a_margin_that_is_a_share_has_no_unit(kind: str, tmp_path: Path) -> None:
    """Half a degree would be taken for a share of 0.0087."""
    more = '[[constraints]]\nkind = "{}"\nmargin_deg = 0.5\n'
    with pytest.raises(sm.errors.FileFormatError, match="'margin' is no angle: Share of"):
        sm.read_problem(written(tmp_path, CELL + more.format(kind)))
    found = sm.read_problem(written(tmp_path, CELL + more.format("JointPositionLimits")))
    assert found.constraints[-1].margin == pytest.approx(np.radians(0.5))
    tables = CONSTRAINTS.by_name()
    known = json_schema()["$defs"]
    assert "margin_deg" not in known[tables[kind].__name__]["properties"]
    assert "margin_deg" in known[tables["JointPositionLimits"].__name__]["properties"]


@pytest.mark.parametrize(
    ("text", "read"), [("010", "8"), ("-017", "-15"), ("1:30", "90"), ("1_0", "10"), ("0b11", "3")]
)
def test_numbers_that_yaml_reads_in_another_base_are_refused(
    text: str, read: str, tmp_path: Path
) -> None:
    """A clearance of 010 mm is one of 8 mm to YAML 1.1, and of 10 mm to who wrote it."""
    file = tmp_path / "a.yaml"
    file.write_text(f"robot: {{name: panda}}\nclearance: {{distance_mm: {text}}}\n")
    assert f"a.yaml: is not YAML: '{text}' is {read} in YAML 1.1" in complaint("plan", file)
