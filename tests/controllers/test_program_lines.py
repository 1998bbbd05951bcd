"""Lines and numbers of programs: what is read, and what is refused with its line."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.shop.controllers.program_comments import COMMENTS, Comments
from selfmotion.shop.controllers.program_lines import _LINE, _MAX_QUANTITY, Lines


def lines_of(folder: Path, text: str = "") -> Lines:
    """Return lines of a program whose comments begin with a semicolon."""
    file = folder / "program.src"
    file.write_text(text, encoding="utf-8")
    return Lines(file, ";")


def test_lines_are_read_without_comments_but_those_of_events(tmp_path: Path) -> None:
    """A comment that goes on is one, and only where there is one before."""
    text = "  A = 1  \n\n; one\n; .. and more\n;event: now\nB = 2\n"
    lines = lines_of(tmp_path, text)
    assert list(lines) == ["A = 1", "; event: now", "B = 2"]
    assert lines.notes == ["one and more"]
    first = lines_of(tmp_path, "; .. of nothing\n")
    assert list(first) == []
    assert first.notes == [".. of nothing"]


def test_lines_that_are_too_long_or_end_elsewhere_are_refused_by_number(tmp_path: Path) -> None:
    assert list(lines_of(tmp_path, "x" * _LINE)) == ["x" * _LINE]
    for text, said in (
        ("a\n" + "x" * (_LINE + 1), f"line 2: has {_LINE + 1} characters, expected {_LINE}"),
        ("a\nb\nc\x0cd", "line 3: has a character 12"),
    ):
        with pytest.raises(sm.errors.FileFormatError, match=said):
            list(lines_of(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        (" -2.5 ", -2.5),
        (".5", 0.5),
        ("+3.", 3.0),
        ("1e3", 1000.0),
        ("9" * 9, 999999999.0),
    ],
)
def test_numbers_are_those_that_controllers_write(tmp_path: Path, text: str, value: float) -> None:
    assert lines_of(tmp_path).number_of(text) == value


@pytest.mark.parametrize(
    "text", ["", "x", "nan", "inf", "1_0", "0x1", "1e", "--1", "0" * 41, "1.2.3"]
)
def test_what_is_no_number_is_refused_with_its_beginning(tmp_path: Path, text: str) -> None:
    with pytest.raises(sm.errors.FileFormatError) as error:
        lines_of(tmp_path).number_of(text)
    assert f"'{text[:40]}' is no number, such as" in str(error.value)


@pytest.mark.parametrize("text", ["1e10", "-1e11"])
def test_numbers_that_no_controller_writes_are_too_large(tmp_path: Path, text: str) -> None:
    with pytest.raises(sm.errors.FileFormatError, match=f"number {text} is too large"):
        lines_of(tmp_path).number_of(text)


def test_coordinates_and_times_have_a_range(tmp_path: Path) -> None:
    lines = lines_of(tmp_path)
    assert lines.coordinate(f"-{_MAX_QUANTITY:.0f}") == -_MAX_QUANTITY
    assert lines.duration("0.001") == 0.001
    for read, text in (
        *((lines.coordinate, f"{2.0 * _MAX_QUANTITY:.0f}"), (lines.duration, "0")),
        *((lines.duration, "-1"), (lines.duration, f"{2.0 * _MAX_QUANTITY:.0f}")),
    ):
        with pytest.raises(sm.errors.FileFormatError, match=r"line 0: (coordinate|time)"):
            read(text)


def test_comments_state_deviations_tolerances_and_axes(tmp_path: Path) -> None:
    """In the words that they are written with, and in no others."""
    lines = lines_of(tmp_path)
    comments = Comments(lines)
    assert comments.tolerance() is None
    assert comments.deviations().path.position == float("inf")
    lines.notes = [
        COMMENTS.text("tolerance", length=0.25, angle=0.5),
        COMMENTS.text("axes", text="A1 = arm/one [deg], E1 = rail [mm]"),
        COMMENTS.text("step", text="seam 1"),
    ]
    found = comments.tolerance()
    assert found is not None
    assert (found.position, found.rotation) == (2.5e-4, 0.5)
    assert comments.axes() == {"A1": ("arm/one", False), "E1": ("rail", True)}
    assert comments.last_step() == "seam 1"
    # A checksum guards them: capitals and spaces count.
    lines.notes = [note.upper() for note in lines.notes]
    assert comments.tolerance() is None
    assert comments.last_step() == ""
    lines.notes = [COMMENTS.text("axes", text="A1 = one [deg], A2 = one [deg]")]
    with pytest.raises(sm.errors.FileFormatError, match="two axes are the same joint"):
        comments.axes()


def test_comments_state_where_the_work_object_was_planned(tmp_path: Path) -> None:
    """By position [m] and quaternion x, y, z, w; a pose that is none is not."""
    lines = lines_of(tmp_path)
    comments = Comments(lines)
    assert comments.program_frames(None, None).planned is None
    half = 0.5**0.5
    lines.notes = [
        COMMENTS.text("poses", work="table", carrier="base link", flange="tool0"),
        COMMENTS.text("planned work object", pose=[0.1, -0.2, 0.3, 0.0, 0.0, half, half]),
    ]
    found = comments.program_frames(None, None)
    assert (found.work_name, found.carrier, found.flange) == ("table", "base link", "tool0")
    assert found.planned is not None
    np.testing.assert_allclose(found.planned.translation, [0.1, -0.2, 0.3])
    np.testing.assert_allclose(pin.log3(found.planned.rotation), [0.0, 0.0, 0.5 * np.pi])
    lines.notes[1] = COMMENTS.text("planned work object", pose=[0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 0.0])
    assert comments.program_frames(None, None).planned is None
