"""Jobs from the shell: seams from a table or a list, files, exit codes, refusals."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shell.cli import jobs
from selfmotion.shell.cli.documents import seams_of_file
from support.places import ROOT
from support.shell import complaint, in_full, invoke, on_circle

TABLE = (ROOT / "examples" / "seams.csv").read_text()
JOB = """
task = "pointing"
[robot]
name = "panda"
[job]
start = "home"
branches = 1
"""
IN_A_TABLE = """
[seams]
file = "seams.csv"
feed = 0.05
frame = { position = [0.45, 0.0, 0.3], rpy_deg = [180, 0, 0] }
"""
LISTED = """
[[seams]]
name = "there"
events = [["on", 0.1]]
[seams.path]
kind = "line"
duration = 1.0
by = [0.1, 0, 0]
start = { position = [0.4, 0.1, 0.3], rpy_deg = [180, 0, 0] }
[[seams]]
name = "then"
after = ["there"]
either_way = false
task = "position"
constraints = [{ kind = "Tilt", frame = "panda_hand_tcp", within_deg = 20, towards = [0, 0, -1] }]
[seams.path]
kind = "line"
duration = 1.0
by = [0.1, 0, 0]
start = { position = [0.4, -0.1, 0.3], rpy_deg = [180, 0, 0] }
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    (tmp_path / "seams.csv").write_text(TABLE)
    file = tmp_path / "job.toml"
    file.write_text(JOB + IN_A_TABLE)
    return file


def test_a_feed_that_no_arm_has_is_refused_before_anything_is_planned(table, tmp_path) -> None:
    line = complaint("job", table, "--set", "seams.feed=2.0", "--folder", tmp_path / "kept")
    assert line.startswith("error: seam 'left': the feed of 2 m/s is reached up to")
    assert "run-up and run-down: ask for" in line
    assert not (tmp_path / "kept").exists()


def test_a_column_of_a_table_tells_the_seams(table) -> None:
    job = sm.files.read_seam_job(table)
    assert [seam.name for seam in job.seams] == ["left", "right", "front", "back"]
    np.testing.assert_allclose(job.seams[0].path.pose(0.0).translation, [0.45, 0.2, 0.3])
    assert job.seams[0].path.feeds[0].asked == 0.05
    np.testing.assert_allclose(job.settings["start"], sm.NAMED_ARMS["panda"].home)


def test_a_former_key_is_read_with_a_note(table) -> None:
    """Seconds of the processor for a move were called a deadline, which is of the whole job."""
    former = seams_of_file(table, ["job.deadline=3.0"], False)
    assert former.settings["move_seconds"] == 3.0
    assert "is called 'move_seconds' by now" in former.remarks[0]
    now = seams_of_file(table, ["job.move_seconds=3.0"], False)
    assert (now.settings["move_seconds"], now.notes) == (3.0, ())


def test_a_deadline_of_the_shell_ends_a_job_and_a_plan(table, tmp_path) -> None:
    at_once = ("--deadline", "1e-9", "--json")
    code, output, errors = in_full("job", table, "--folder", tmp_path / "kept", *at_once)
    assert code == 1
    assert "the deadline of 1e-09 s came before there was a program" in errors
    assert json.loads(output)["error"]["class"] == "DeadlineError"
    # Without one there is the motion of least joint speed to end with.
    code, output, _ = in_full("plan", "panda", *on_circle("0.1"), *at_once)
    assert (code, json.loads(output)["status"]) == (0, "deadline")


def test_anything_of_a_job_file_can_be_set(table) -> None:
    """As if the file said so; what it is set to is refused as that of the file."""
    there = "seams.frame.position=[0.5, 0.0, 0.3]"
    seams = seams_of_file(table, [there, "seams.feed=0.04", "job.branches=2"], False)
    np.testing.assert_allclose(seams.seams[0].path.pose(0.0).translation, [0.5, 0.2, 0.3])
    assert seams.seams[0].path.feeds[0].asked == 0.04
    assert seams.settings["branches"] == 2
    assert "feeds are in m/s, not mm/s" in complaint("job", table, "--set", "seams.feed=40")
    assert "job.brunches: unknown key, did you mean 'branches'?" in complaint(
        "job", table, "--set", "job.brunches=2"
    )
    assert "expected KEY=VALUE" in complaint("job", table, "--set", "job.branches")


def test_a_job_from_the_shell_is_written_read_and_exported(tmp_path) -> None:
    file, whole = tmp_path / "job.toml", tmp_path / "a.program"
    file.write_text(JOB + LISTED)
    outs = [whole, tmp_path / "a.timetable.csv", tmp_path / "a.yaml"]
    options = [word for out in outs for word in ("--out", str(out))]
    code, text = invoke("job", file, *options, "--folder", tmp_path / "kept")
    assert code == 0, text
    assert "verified at all times: 2 seams" in text
    program = sm.load_program(whole).require()
    assert program.order == ("there", "then")
    with outs[1].open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["kind"] for row in rows} == {"seam", "move", "event"}
    assert "there: on" in {row["name"] for row in rows}
    motion = sm.files.read_motion(outs[2])
    np.testing.assert_allclose(motion.q[-1], program.trajectory.q[-1], atol=1e-9)
    code, text = invoke("check", whole, "--json")
    assert json.loads(text)["verified"]
    code, text = invoke("export", whole, "--out", tmp_path / "b.csv", "--rate", "100")
    assert code == 0, text
    assert len(sm.files.read_motion(tmp_path / "b.csv").t) == int(program.duration * 100) + 2
    # A single move as well, by a suffix in whichever case.
    move = next(step.made for step in program.steps if isinstance(step.made, sm.Move))
    saved, written = tmp_path / "go.npz", tmp_path / "GO.MOD"
    move.save(saved)
    code, text = invoke("export", saved, "--out", written, "--set", "mass=1.5")
    assert code == 0, text
    assert sm.files.read_motion(written).duration == pytest.approx(move.motion.duration, abs=1e-3)
    with pytest.raises(sm.errors.FileFormatError, match="is a move, not a plan"):
        sm.load_plan(saved)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected seams"),
        ("[[seams]]\nname = 'a'", "seams, 'a': path: is missing"),
        (LISTED.replace("after =", "aftr ="), "aftr: unknown key, did you mean 'after'?"),
        (LISTED.replace('"there"]', '"nobody"]'), "no other seam"),
        (LISTED.replace("task =", "tusk ="), "tusk: unknown key, did you mean 'task'?"),
        (LISTED.replace("0.1, 0.3]", "0.1]"), "seams, 'there'"),
        ("[seams]\nfeed = 0.1", "seams.file: is missing"),
        ("[seams]\nfile = 3", "seams.file: is 3, expected the name of a file"),
        (
            "[seams]\nfile = 'seams.csv'\nfeed = 0.1\nweave = 3",
            "weave: is 3, expected a table",
        ),
        (
            "[seams]\nfile = 'seams.csv'\nfeed = 0.1\nevents = 3",
            "events: is 3, expected a list",
        ),
        (
            "[seams]\nfile = 'seams.csv'\nfeed = 0.1\nleaves = ['a']",
            "leaves[0]: is 'a', expected a table",
        ),
        ("[seams]\nfile = 'none.csv'\nfeed = 0.1", "none.csv: cannot be read"),
        ("[seams]\nfile = 'plain.csv'\nfeed = 0.1", "has no column 'seam'"),
        ("[seams]\nfile = 'seams.csv'", "seams.csv: has no times"),
    ],
)
def test_what_is_wrong_with_a_job_file_is_said_by_key(text, said, tmp_path) -> None:
    (tmp_path / "seams.csv").write_text(TABLE)
    (tmp_path / "plain.csv").write_text("x,y,z\n0,0,0\n1,0,0\n")
    file = tmp_path / "job.toml"
    file.write_text(JOB + text)
    with pytest.raises(sm.SelfmotionError) as caught:
        sm.files.read_seam_job(file).plan()
    assert said in str(caught.value)


def test_bad_targets_are_refused_before_anything_is_planned(table) -> None:
    assert ".timetable.csv" in complaint("job", table, "--out", "frame.docx")
    # What an event switches is asked for at once as well.
    table.write_text(JOB + LISTED)
    assert "event 'on' has no signal" in complaint("job", table, "--out", "frame.src")
    settings = table.with_name("cell.toml")
    settings.write_text("[signals]\noff = [1, true]\n")
    said = complaint("job", table, "--out", "frame.src", "--settings", settings)
    assert "event 'on' has no signal" in said
    settings.write_text("[signals]\non = [1, true]\noff = [1, false]\n")
    assert "Java (Sunrise)" in complaint("job", table, "--out", "a.src", "--settings", settings)
    assert "export --set mass=KG" in complaint(
        "job", table, "--out", "a.mod", "--settings", settings
    )
    said = complaint("job", table, "--out", "frame.yaml", "--settings", settings)
    assert "--settings has no effect" in said


def test_settings_are_of_controllers_files_alone(table, tmp_path, monkeypatch) -> None:
    """Beside other files they are no reason to write none after all is planned."""
    told = []
    monkeypatch.setattr(sm.files, "write_motion", lambda *_, settings, **__: told.append(settings))
    settings = sm.files.ProgramSettings()
    for name in ("a.yaml", "a.src", "a.script", "a.csv"):
        jobs.write_program(None, tmp_path / name, settings)
    assert told == [None, settings, settings, None]
