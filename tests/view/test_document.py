"""Documents while they are changed: undone step by step, written only when saved, comments kept."""

import tomllib

import pytest

from selfmotion.basics import FileFormatError
from selfmotion.shell.view.document import Edited, at
from support.views import CIRCLE


@pytest.fixture
def edited(tmp_path):
    file = tmp_path / "circle.toml"
    file.write_text(CIRCLE)
    return Edited(file)


def test_the_file_changes_only_when_it_is_saved(edited):
    edited.change({("path", "duration"): 6.0}, final=True)
    assert edited.is_changed
    assert edited.file.read_text() == CIRCLE
    edited.save()
    assert not edited.is_changed
    assert tomllib.loads(edited.file.read_text()) == edited.document
    assert edited.document["path"]["duration"] == 6.0


def test_comments_and_what_was_not_changed_stay(edited):
    edited.change(
        {("path", "duration"): 6.0, ("robot", "base"): {"position": [1, 0, 0]}}, final=True
    )
    edited.save()
    written, before = edited.file.read_text().splitlines(), CIRCLE.splitlines()
    assert [line for line in written if line not in before] == [
        "base = {position = [1, 0, 0]}",
        "duration = 6.0",
    ]
    assert [line for line in before if line not in written] == ["duration = 4.0"]


@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_other_formats_are_written_as_well(edited, tmp_path, suffix):
    from selfmotion.basics import read_document, write_document

    file = tmp_path / f"circle{suffix}"
    write_document(file, edited.document)
    other = Edited(file)
    other.change({("path", "duration"): 6.0}, final=True)
    other.save()
    assert read_document(file) == other.document != edited.document


def test_a_drag_is_one_step_of_undo(edited):
    before = edited.document
    for k in range(5):
        edited.change({("path", "duration"): 5.0 + k}, final=k == 4)
    edited.change({("task",): "pose"}, final=True)
    assert edited.document["path"]["duration"] == 9.0
    edited.undo()
    assert (edited.document["task"], edited.document["path"]["duration"]) == ("pointing", 9.0)
    edited.undo()
    assert edited.document == before
    assert not edited.can_undo
    edited.undo()
    assert edited.document == before


def test_a_drag_that_has_not_ended_is_undone(edited):
    before = edited.document
    edited.change({("path", "duration"): 5.0}, final=False)
    assert edited.can_undo
    edited.undo()
    assert edited.document == before


def test_what_others_changed_is_left_as_it_is(edited):
    edited.change({("path", "duration"): 6.0}, final=True)
    edited.file.write_text(CIRCLE + "# by another\n")
    with pytest.raises(FileFormatError, match="changed or moved by others since it was opened"):
        edited.save()
    assert edited.file.read_text() == CIRCLE + "# by another\n"
    edited.file.unlink()
    with pytest.raises(FileFormatError, match="changed or moved"):
        edited.save()


def test_a_way_through_a_number_is_refused(edited):
    before = edited.document
    for keys in (("path", "duration", "x"), ("costs", 3, "weight"), ("costs", "weight")):
        with pytest.raises(FileFormatError, match="expected a table or a list"):
            edited.change({keys: 1.0}, final=True)
    assert edited.document == before
    assert not edited.can_undo
    assert at(before, ("costs", 0, "weight")) == 1.0
    assert at(before, ("costs", 3, "weight")) is None
