"""Programs of pockets and holes: rapids along the tool's axis are made, and M words stand there."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, restore
from selfmotion.model.task import SE3
from selfmotion.shop.cam import UNJUDGED
from selfmotion.shop.cam.cuts import RAPID
from support.own_kinematics import Arm, along
from support.pocket_programs import Interpreter, misses, random_program

ZERO = np.array([0.45, -0.05, 0.25])
JOB = (
    'task = "pointing"\nclearance = false\n[robot]\nname = "panda"\n[job]\nbranches = 1\n'
    '[seams]\nfile = "pocket.nc"\nframe = { position = [0.45, -0.05, 0.25] }\n'
)
# Two pockets 20 mm deep.
POCKETS = """%
O1 (TWO POCKETS 20 MM DEEP)
G21 G90 G94 G17 G54
G0 X0 Y0 Z30
Z5 M3
G1 Z-20 F600
X20 F1200
G0 Z30
G0 X0 Y60
G0 Z5
G1 Z-20 F600
X20 F1200
G0 Z30
M5
M30
%
"""
# Feeds are kept to this share; a drill's speed is that of its file but for its acceleration.
SHARE = 0.02


def job_of(folder: Path, text: str, more: str = "") -> sm.files.SeamJob:
    (folder / "pocket.nc").write_text(text)
    (folder / "job.toml").write_text(JOB + more)
    return sm.files.read_seam_job(folder / "job.toml")


def places_of(path: sm.paths.Path, t: Array) -> Array:
    return 1e3 * (path.samples(t).translation - ZERO)


@pytest.mark.parametrize("number", range(4))
def test_random_programs_go_where_an_interpreter_says(number: int, tmp_path: Path) -> None:
    text = random_program(np.random.default_rng([1, number]))
    wanted, job = Interpreter().run(text), job_of(tmp_path, text)
    assert len(wanted) == len(job.seams)
    for seam, own in zip(job.seams, wanted, strict=True):

        def places(t: Array, path: sm.paths.Path = seam.path) -> Array:
            return places_of(path, t)

        assert not misses(own, places, seam.path.duration, seam.events), text


def test_a_way_that_leaves_out_a_retract_or_a_late_switch_is_found(tmp_path: Path) -> None:
    """The judge itself: rejects what is not so."""
    wanted, job = Interpreter().run(POCKETS), job_of(tmp_path, POCKETS)
    first, own = job.seams[1], wanted[1]

    def places(t: Array) -> Array:
        return places_of(first.path, t)

    assert not misses(own, places, first.path.duration, first.events)
    assert any("never comes" in text for text in misses(own, places, 4.0, first.events))
    ((name, at),) = first.events
    assert "from where the file has it" in misses(own, places, at, [(name, at - 1.0)])[0]
    without = job_of(tmp_path, POCKETS.replace("G0 Z30\nM5", "M5"))
    path = without.seams[1].path
    found = misses(own, lambda t: places_of(path, t), path.duration, without.seams[1].events)
    assert any("never comes" in text for text in found)
    assert any("from where the file has it" in text for text in found)


def test_a_planned_pocket_is_left_upwards_and_the_spindle_stops_above(tmp_path: Path) -> None:
    """By kinematics of the tests' own: below the surface nothing goes sideways but the cut."""
    program = job_of(tmp_path, POCKETS).plan()
    assert program.verified, program.verdict
    assert program.verdict.endswith(UNJUDGED)
    program.save(tmp_path / "pocket.program")
    assert sm.load_program(tmp_path / "pocket.program").verdict.endswith(UNJUDGED)
    arm = Arm(program.robot)
    t = np.linspace(0.0, program.duration, 8001)
    tips = 1e3 * (arm.place(arm.tool, along(program.trajectory, t, 0))[1] - ZERO)
    below = tips[:, 2] < 5.0
    assert below.any()
    aside = np.where((tips[:, 1] > 30.0)[:, None], tips - [0, 60, 0], tips)[below]
    assert np.abs(aside[:, 1]).max() < 0.1
    assert (aside[:, 0] > -0.1).all()
    assert (aside[:, 0] < 20.1).all()
    moved = np.diff(tips, axis=0)[:, :2]
    deep = tips[:-1, 2] > -18.9
    assert np.linalg.norm(moved[deep & below[:-1]], axis=1).max(initial=0.0) < 0.05
    at = {name: time for time, _, name in program.events}
    here = arm.place(arm.tool, along(program.trajectory, np.array([at["M5"]]), 0))[1]
    np.testing.assert_allclose(1e3 * (here[0] - ZERO), [20, 60, 30], atol=0.1)


# Drilling as FreeCAD, Fusion and SolidWorks CAM write it, numbers restated.
PECKS = {
    "deep": ("G83 Z-10 R2 Q2.1 F400", -10.0),
    "by fives": ("G83 Z-10 R2 Q5 F400", -10.0),
    "shallow": ("G81 Z-2 R1 F400", -2.0),
    "at once": ("G81 Z-10 R3 F400", -10.0),
}


@pytest.mark.parametrize("kind", PECKS)
def test_ways_out_of_a_hole_are_no_feeds_that_were_asked_for(kind: str, tmp_path: Path) -> None:
    cycle, bottom = PECKS[kind]
    text = f"G21 G90 G94 G17\nG0 X10 Y0 Z15\nG98 {cycle} X10 Y0\nG80\nG0 X0\nM30\n"
    (seam,) = job_of(tmp_path, text).seams
    np.testing.assert_allclose([feed.asked for feed in seam.path.feeds], 400e-3 / 60)
    assert all(feed.kept for feed in seam.path.feeds)
    t = np.linspace(0.0, seam.path.duration, 6001)
    samples = seam.path.samples(t)
    heights = places_of(seam.path, t)[:, 2]
    assert heights.min() == pytest.approx(bottom, abs=1e-3)
    np.testing.assert_allclose(heights[[0, -1]], 15.0, atol=1e-6)
    speeds = np.linalg.norm(samples.twist[:, :3], axis=1)
    assert speeds.max() <= RAPID * (1.0 + SHARE)
    deepest = np.minimum.accumulate(heights)
    drilling = (heights <= deepest + 1e-6) & (samples.twist[:, 2] < 0.0) & (heights < 0.5)
    assert speeds[drilling].max() <= 400e-3 / 60 * (1.0 + SHARE)


def test_leads_are_for_ends_that_have_no_rapid_of_their_own(tmp_path: Path) -> None:
    leads = "leads = { length_mm = 40, duration = 1 }\n"
    text = POCKETS.replace("G0 X0 Y0 Z30\nZ5 M3", "G0 X0 Y0 Z5\nM3")
    plain, led = job_of(tmp_path, text).seams, job_of(tmp_path, text, leads).seams
    assert led[0].path.duration == pytest.approx(plain[0].path.duration + 1.0)
    assert led[1].path.duration == pytest.approx(plain[1].path.duration)
    assert led[0].events == (("M3", pytest.approx(1.0)),)
    assert any("leads are left out" in note for note in led[1].path.notes)
    np.testing.assert_allclose(places_of(led[0].path, np.zeros(1))[0], [0, 0, 45], atol=1e-6)


def test_rapids_that_leave_a_cut_aside_are_told(tmp_path: Path) -> None:
    aside = POCKETS.replace("G0 Z30\nG0 X0 Y60\nG0 Z5", "G0 X0 Y60 Z5")
    notes = job_of(tmp_path, aside).seams[0].path.notes
    assert any("line 8: a rapid leaves a cut aside" in note for note in notes)
    assert not any("aside" in note for note in job_of(tmp_path, POCKETS).seams[0].path.notes)


def test_a_home_of_the_machine_is_above(tmp_path: Path) -> None:
    home = POCKETS.replace("G0 Z30\nG0 X0 Y60\nG0 Z5", "G91 G28 Z0\nG90 G0 X0 Y60\nG0 Z-10")
    first, second = job_of(tmp_path, home).seams
    ends = [places_of(first.path, np.array([first.path.duration]))[0],
            places_of(second.path, np.zeros(1))[0]]  # fmt: skip
    np.testing.assert_allclose(ends, [[20, 0, 30], [0, 60, 30]], atol=1e-6)


def test_a_feed_that_need_not_be_reached_is_a_bound() -> None:
    line = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.001, 0.0, 0.0])), 1.0)
    with_bound = sm.paths.Feed(line, 0.1, required=False)
    assert not with_bound.feeds
    assert not sm.paths.Feed(line, 0.1).feeds[0].kept
    again = restore(sm.paths.Path, with_bound.to_dict())
    for path in (again, with_bound.slower(2.0), with_bound.changed({}), with_bound.along(line, 0)):
        assert not path.feeds
    with pytest.raises(sm.errors.PathError, match="feed: required is 2"):
        sm.paths.Feed(line, 0.1, required=2)  # type: ignore[arg-type]
