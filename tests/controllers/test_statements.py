"""Tables of statements: each is read as it is written, and not without one of its words."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from selfmotion.basics import FileFormatError
from selfmotion.model.task import SE3, exp3
from selfmotion.shop.controllers.krl import KRL
from selfmotion.shop.controllers.krl_reader import KrlReader
from selfmotion.shop.controllers.program_comments import COMMENTS, Comments
from selfmotion.shop.controllers.program_lines import Lines
from selfmotion.shop.controllers.program_reader import ProgramReader
from selfmotion.shop.controllers.program_writer import WrittenPose
from selfmotion.shop.controllers.rapid import RAPID
from selfmotion.shop.controllers.rapid_reader import RapidReader
from selfmotion.shop.controllers.segment_building import Pose
from selfmotion.shop.controllers.statements import Statement, Table, number, word
from selfmotion.shop.controllers.urscript import URSCRIPT, UrscriptReader

READERS: dict[str, type[ProgramReader]] = {
    "krl": KrlReader,
    "rapid": RapidReader,
    "urscript": UrscriptReader,
}
LANGUAGES = {"krl": KRL, "rapid": RAPID, "urscript": URSCRIPT}
# Digits of positions [m], and of parts of orientations, in any language.
DIGITS = 1e-7
# Seven digits, as speeds have.
RELATIVE = 1e-6
AXES = {f"A{k}": f"{10.5 * k:g}" for k in range(1, 7)}
FRAME = SE3(exp3(np.array([0.1, -0.2, 0.7])), np.array([0.3, -0.1, 0.2]))
TURN = np.array([0.1, -0.2, 0.3, 0.927361849549570375])
TEXTS = {
    **{"header": "ACCESS RVP", "name": "selfmotion", "event": "arc on: left", "unit": "2"},
    **{"orientation": "#VAR", "circles": "#BASE", "output": "7", "zone": "z1", "work": "w"},
    **{"tool": "t", "configurations": "Off", "stream": "[0], t=0.008"},
}


def value_of(language: str, name: str, field: str) -> Any:
    """Return a value of a field, as a writer gives it."""
    if field == "pose":
        configuration = "0, -1, 0, 0" if language == "rapid" else ""
        return WrittenPose(np.array([0.5, -0.25, 0.125]), TURN, AXES, configuration)
    names = {"speed": "v100", "circles": "ObjectFrame", "output": "doArc"}
    if language == "rapid" and field in names:
        return names[field]
    known: dict[str, Any] = {
        "frame": FRAME,
        "axes": list(np.radians([float(x) for x in AXES.values()])),
        "start": np.radians([float(x) for x in AXES.values()]),
        "speeds": [30.0, 500.0, 5000.0, 1000.0],
        "value": True,
        "fixed": False,
    }
    if language != "urscript":
        known["axes"] = AXES
    return known.get(field, TEXTS.get(field, 0.25))


def every_statement() -> list[tuple[str, Statement]]:
    return [(name, item) for name, language in LANGUAGES.items() for item in language.statements]


def reader_of(language: str, folder: Path) -> ProgramReader:
    file = folder / "a.txt"
    file.write_text("")
    reader = READERS[language](file)
    reader.axes = list(AXES)
    return reader


def same(found: Any, given: Any) -> bool:
    """Whether a value that was read is the one that was written."""
    if isinstance(given, SE3):
        return bool(np.abs(found.homogeneous - given.homogeneous).max() < DIGITS)
    if isinstance(given, WrittenPose):
        assert isinstance(found, Pose)
        turned = min(np.abs(found.quaternion - s * given.quaternion).max() for s in (1.0, -1.0))
        return bool(np.abs(found.position - given.position).max() < DIGITS and turned < DIGITS)
    if isinstance(given, str):
        return bool(found == given)
    if isinstance(given, dict):
        return bool(np.allclose(found, [float(x) for x in given.values()], rtol=RELATIVE))
    if np.ndim(given) and len(given) == len(AXES):
        return bool(np.allclose(np.radians(found), given, rtol=RELATIVE))
    return bool(np.allclose(found, given, rtol=RELATIVE))


@pytest.mark.parametrize(("language", "statement"), every_statement(), ids=lambda x: str(x)[:60])
def test_a_statement_is_read_as_it_is_written(
    language: str, statement: Statement, tmp_path: Path
) -> None:
    table, reader = LANGUAGES[language], reader_of(language, tmp_path)
    values = {name: value_of(language, name, field) for name, field in statement.values.items()}
    text = table.text(statement.kind, **values)
    # Spaces beside marks do not matter, nor do capitals.
    wide = re.sub(r"\s*([,()\[\]{};])\s*", r" \1 ", text).strip()
    for state in statement.states:
        for line in (text, " ".join(wide.split()), text.upper()):
            found = table.find(line, state)
            assert found is not None, (state, line)
            assert found[0].kind == statement.kind
        found = table.find(text, state)
        assert found is not None
        for name, field in found[0].values.items():
            assert same(table.fields[field].read(reader, found[1][name]), values[name]), name
    assert table.find(text, "nowhere") is None


@pytest.mark.parametrize(("language", "statement"), every_statement(), ids=lambda x: str(x)[:60])
def test_a_statement_without_one_of_its_words_is_another_one(
    language: str, statement: Statement
) -> None:
    table = LANGUAGES[language]
    values = {name: value_of(language, name, field) for name, field in statement.values.items()}
    text = table.text(statement.kind, **values)
    fixed = re.findall(r"(?<![<\w:])[A-Za-z_]{2,}(?![\w>])", statement.template)
    for part in (each for each in fixed if each not in ("TASK", "event")):
        less = text.replace(part, "", 1).strip()
        found = table.find(" ".join(less.split()), statement.states[0])
        assert found is None or found[0].kind != statement.kind, (part, less)


def test_a_line_of_the_table_is_all_that_a_statement_takes() -> None:
    """A table of one line, whose value is there twice: both have to be the same."""
    line = Statement("mass", "LOAD <mass> OF <name>, <name>", ("body",))
    fields = {"mass": number(".2f"), "name": word(r"\w+")}
    table = Table(fields=fields, statements=[line])
    assert table.text("mass", mass=1.5, name="tool") == "LOAD 1.50 OF tool, tool"
    found = table.find("load 2 of tool ,tool", "body")
    assert found is not None
    assert found[1] == {"mass": "2", "name": "tool"}
    for other in ("load 2 of tool, gun", "load 2 oftool, tool", "load 2 of tool", "load of a, a"):
        assert table.find(other, "body") is None
    with pytest.raises(KeyError):
        table.text("mass", mass=1.5)


@pytest.mark.parametrize("statement", COMMENTS.statements, ids=lambda x: str(x.kind))
def test_a_comment_is_read_as_it_is_written_alone(statement: Statement, tmp_path: Path) -> None:
    """In other letters or spaces its checksum would not guard it."""
    known = {"text": "arc, left", "link": "table/plate 1", "pose": [0.1, 0.2, -0.3, 0, 0, 0.6, 0.8]}
    values = {name: known.get(field, 0.25) for name, field in statement.values.items()}
    text = COMMENTS.text(statement.kind, **values)
    found = COMMENTS.find(text, "head")
    assert found is not None
    (tmp_path / "a.src").write_text("")
    comments = Comments(Lines(tmp_path / "a.src", ";"))
    for name, field in statement.values.items():
        assert same(COMMENTS.fields[field].read(comments, found[1][name]), values[name])
    begin = text.partition(":")[0]
    for other in (text.replace(begin, begin.upper()), text.replace(":", " :", 1)):
        assert COMMENTS.find(other, "head") is None


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("9E9", "number_of", ""),
        ("1E7", "coordinate", ""),
        ("1E7", "duration", ""),
        ("1E10", "number_of", "too large, expected less than 1e[+]10"),
        ("-1.1E7", "coordinate", "too large, expected 1e[+]07 at most"),
        ("1.1E7", "duration", "expected a number above 0, 1e[+]07 at most"),
        ("0", "duration", "expected a number above 0"),
        ("1_0", "number_of", "is no number"),
        ("1E9999", "coordinate", "is no number"),
    ],
)
def test_numbers_of_programs_have_the_same_bounds_wherever_they_are_read(
    text: str, kind: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "a.src").write_text("")
    read = getattr(Lines(tmp_path / "a.src", ";"), kind)
    if not said:
        assert read(text) == float(text)
        return
    with pytest.raises(FileFormatError, match=f"a.src: line 0: .*{said}"):
        read(text)
