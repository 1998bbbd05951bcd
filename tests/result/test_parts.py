"""Files of several motions: another version is told as such, and damage as damage."""

import json
import zipfile
from pathlib import Path

import pytest

from selfmotion.basics import FileFormatError
from selfmotion.planning.result import read_bundle, write_bundle


@pytest.mark.parametrize(
    ("found", "told"),
    [
        (1, "was written by an older version"),
        (3, "was written by a newer version"),
        ("2", "or a damaged one: its format is '2', expected 2"),
        (True, "or a damaged one: its format is True, expected 2"),
    ],
)
def test_another_version_is_no_damage(tmp_path: Path, found: object, told: str) -> None:
    file = tmp_path / "a.program"
    write_bundle(file, "program", 2, {}, [])
    with zipfile.ZipFile(file) as archive:
        (name,) = archive.namelist()
        description = json.loads(archive.read(name))
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(name, json.dumps({**description, "version": found}))
    with pytest.raises(FileFormatError) as refused:
        read_bundle(file, "program", 2)
    assert told in str(refused.value)
    assert ("damaged" in str(refused.value)) == ("damaged" in told)
