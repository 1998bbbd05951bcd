"""Files of all kinds, spoiled in all ways, are read or refused in one line that names them."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from support.mutations import Good, good_files, mutated

# `make bench NAME=fuzz-files` reads 20,000, under limits of time and memory.
COUNT, SEED = 60, 1
# Kinds of files: a number, as making them while tests are collected would take a second.
KINDS = 63


def test_each_kind_of_file_is_spoiled() -> None:
    assert len(good_files()) == KINDS


@pytest.mark.parametrize("number", range(KINDS))
def test_spoiled_files_are_read_or_refused(number: int, tmp_path: Path) -> None:
    good = good_files()[number]
    file = tmp_path / f"given{good.suffix}"
    file.write_bytes(good.content)
    good.read(file)
    rng = np.random.default_rng([SEED, number])
    for _ in range(COUNT):
        file.write_bytes(mutated(good, rng))
        with np.errstate(all="ignore"):
            said = _refusal(good, file)
        assert not said or (file.name in said and "\n" not in said and len(said) < 2000), said


def _refusal(good: Good, file: Path) -> str:
    """Return why a file is refused, "" where it is read."""
    try:
        good.read(file)
    except sm.SelfmotionError as error:
        return str(error)
    return ""


def test_what_announces_more_than_it_holds_is_refused(tmp_path: Path) -> None:
    """Before room is made for it: a gigabyte in a megabyte, or in a head alone."""
    bomb = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("t.npy", "w", force_zip64=True) as member,
    ):
        for _ in range(20):
            member.write(bytes(1 << 24))
    with pytest.raises(sm.errors.FileFormatError, match=r"bomb.npz: .* unpacks to 3.36e\+08 bytes"):
        sm.files.read_motion(bomb)
    out = io.BytesIO()
    head = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)}
    np.lib.format.write_array_header_1_0(out, head)
    file = tmp_path / "path.npy"
    file.write_bytes(out.getvalue())
    with pytest.raises(sm.errors.FileFormatError, match=r"path.npy: .* announces an array"):
        sm.files.read_path(file, feed=0.1)


def test_arrays_are_read_as_numpy_writes_them(tmp_path: Path) -> None:
    file = tmp_path / "path.npy"
    table = np.asfortranarray(np.linspace(0.0, 0.3, 9).reshape(3, 3))
    np.save(file, table)
    path = sm.files.read_path(file, duration=1.0)
    np.testing.assert_allclose(path.pose(1.0).translation, table[-1], atol=1e-12)


def test_messages_show_no_control_codes_and_no_endless_words(tmp_path: Path) -> None:
    """What a file says must neither steer a terminal nor fill it."""
    file = tmp_path / "path.csv"
    file.write_text("t,x,y,z\n0,0,0,\x1b[2J" + "9" * 10_000 + "x\n", encoding="utf-8")
    with pytest.raises(sm.errors.FileFormatError) as raised:
        sm.files.read_path(file)
    assert "\x1b" not in str(raised.value)
    assert len(str(raised.value)) < 300


def test_a_path_that_turns_without_end_is_refused() -> None:
    values = sm.sample_problem().path.to_dict()
    values["coefficients"] = np.array(values["coefficients"]) + 1e9
    with pytest.raises(sm.errors.PathError, match="turns by up to"):
        sm.paths.TwistPath.from_dict({key: value for key, value in values.items() if key != "kind"})
