"""The highest feed at which a job is kept."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from support.arms import robot_named
from support.shell import invoke

HOME = np.array(sm.NAMED_ARMS["panda"].home)
DOWN = np.diag([1.0, -1.0, -1.0])


class Tried:
    """Stands for planning: a program is verified up to a feed, from another one on refused."""

    def __init__(self, kept: float, refused: float = np.inf) -> None:
        self.kept, self.refused, self.feeds = kept, refused, list[float]()

    def __call__(self, feed: float) -> sm.Program:
        self.feeds.append(feed)
        if feed > self.refused:
            raise sm.errors.FeedError(
                "too fast for its bends", asked=feed, possible=self.refused, time=0.0
            )
        missing = {} if feed <= self.kept else {"seam": "the arm is too slow"}
        panda = robot_named("panda")
        still = sm.Trajectory([0.0, 1.0], [HOME] * 2, [0.0 * HOME] * 2, panda.joint_names)
        move = sm.Move(panda, (), still)
        return sm.Program(panda, (sm.job.Step("stay", move),), missing)


@pytest.mark.parametrize("kept", [2.9, 0.7, 0.04])
@pytest.mark.parametrize("accuracy", [0.02, 0.2])
def test_it_is_as_near_to_one_that_is_not_kept_as_is_asked(kept: float, accuracy: float) -> None:
    tried = Tried(kept)
    found = sm.job.highest_feed(tried, accuracy=accuracy)
    assert found.feed <= kept < found.refused <= (1.0 + accuracy) * found.feed * 1.01
    assert found.program.verified
    assert "the arm is too slow" in found.why
    assert len(tried.feeds) < 20
    assert len(set(tried.feeds)) == len(tried.feeds)


def test_what_a_refusal_says_is_possible_is_tried_next() -> None:
    tried = Tried(0.434, refused=0.434)
    assert sm.job.highest_feed(tried).feed == 0.434
    assert tried.feeds[:2] == [3.0, 0.434]
    bounded = sm.job.highest_feed(Tried(5.0), 1.5)
    assert (bounded.feed, bounded.refused, bounded.why) == (1.5, np.inf, "")
    with pytest.raises(
        sm.errors.PlanError, match=r"no feed from 0.00\d+ m/s on is kept: .*too slow"
    ):
        sm.job.highest_feed(Tried(1e-5))
    for given, said in (({"most": 4.0}, "most is 4"), ({"accuracy": 0.0}, "accuracy is 0")):
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.job.highest_feed(Tried(1.0), **given)


JOB = """
task = "pointing"
clearance = false
robot = { name = "panda" }

[job]
start = "home"
branches = 1

[[constraints]]
kind = "JointPositionLimits"

[[constraints]]
kind = "JointVelocityLimits"

[seams]
file = "strokes.csv"
feed = FEED
run_up = true
either_way = true
acceleration = 2.0
"""


def strokes(folder: Path, feed: str, more: str = "") -> Path:
    rows = ["seam,x,y,z,qw,qx,qy,qz,event"]
    for k, x in enumerate((0.45, 0.5)):
        rows.append(f"lane {k},{x},-0.1,0.3,0,1,0,0,gun on")
        rows.append(f"lane {k},{x},0.1,0.3,0,1,0,0,gun off")
    (folder / "strokes.csv").write_text("\n".join(rows))
    file = folder / "paint.toml"
    file.write_text(JOB.replace("FEED", feed) + more)
    return file


def test_a_job_file_asks_for_run_ups_and_the_highest_feed(tmp_path: Path) -> None:
    given = sm.files.read_seam_job(strokes(tmp_path, "0.2"))
    for seam in given.seams:
        (on, begin), (off, end) = seam.events
        assert (on, off) == ("gun on", "gun off")
        # What happens at the ends of the table happens there, at the feed.
        for at, y in ((begin, -0.1), (end, 0.1)):
            assert seam.path.pose(at).translation[1] == pytest.approx(y, abs=1e-6)
            assert np.linalg.norm(seam.path.twist(at)[:3]) == pytest.approx(0.2, rel=1e-3)
    file = strokes(tmp_path, '"highest"', "most_feed = 0.3\n")
    code, text = invoke("job", file, "--out", tmp_path / "a.program", "--folder", tmp_path / "kept")
    assert code == 0, text
    assert "feed: 0.3 m/s, the highest that was found at which all seams are kept" in text
    program = sm.load_program(tmp_path / "a.program")
    assert program.verified
    assert {feed.asked for plan in program.plans.values() for feed in plan.path.feeds} == {0.3}
    for more, said in (
        ("most_feed = 9\n", "most_feed is 9, expected a feed up to 3 m/s"),
        ("weave = { amplitude = 0.002, pitch = 0.01 }\n", "run_up: is of seams with a feed, not"),
    ):
        with pytest.raises(sm.errors.FileFormatError, match=said):
            sm.files.read_seam_job(strokes(tmp_path, '"highest"', more))
    with pytest.raises(
        sm.errors.FileFormatError, match="most_feed: has no effect where feed is a number"
    ):
        sm.files.read_seam_job(strokes(tmp_path, "0.2", "most_feed = 0.3\n"))
