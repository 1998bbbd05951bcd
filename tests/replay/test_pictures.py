"""Pictures by a headless browser, the matplotlib figure, and what is left behind: nothing."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from PIL import Image

from selfmotion.basics import RenderError
from selfmotion.shell.replay import browser, figure, render_gif, render_png
from support.places import TESTS
from support.replay_plans import arm_plan, planar_plan
from support.shell import complaint

needs_browser = pytest.mark.skipif(
    not any(map(shutil.which, browser._BROWSERS)) and not os.environ.get("CI"),
    reason="needs a browser; CI has one",
)


def pixels(file):
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGB"))


@pytest.mark.site
@needs_browser
def test_a_picture_shows_the_time_asked_for(tmp_path):
    plan = planar_plan()
    files = [
        render_png(plan, tmp_path / f"{k}.png", t=t, size=(320, 240))
        for k, t in enumerate((0.3, 1.0))
    ]
    pictures = [pixels(file) for file in files]
    assert pictures[0].shape == (240, 320, 3)
    assert not np.array_equal(pictures[0], pictures[1])
    assert sorted(tmp_path.iterdir()) == files


@pytest.mark.site
@needs_browser
def test_a_gif_lasts_as_long_as_the_motion(tmp_path):
    file = render_gif(planar_plan(), tmp_path / "a.gif", size=(160, 120), frames_per_second=5)
    with Image.open(file) as picture:
        assert picture.n_frames == 11
        assert picture.info["duration"] == 200


@pytest.mark.site
@needs_browser
def test_the_whole_page_is_taller_than_the_window(tmp_path):
    file = render_png(planar_plan(), tmp_path / "a.png", t=0.0, size=(400, 300), whole_page=True)
    with Image.open(file) as picture:
        assert picture.height > 900


def test_no_browser_is_said_clearly(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    with pytest.raises(RenderError, match="install Chromium"):
        render_png(planar_plan(), tmp_path / "a.png", t=0.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.site
@needs_browser
def test_pictures_fail_before_work(tmp_path, monkeypatch):
    planar_plan().save(tmp_path / "a.npz")
    asked = ("replay", tmp_path / "a.npz", "--html", tmp_path / "a.html")
    assert "no picture at t = 99 s" in complaint(*asked, "--png", "99")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    assert "install Chromium" in complaint(*asked, "--gif", tmp_path / "a.gif")
    assert [file.name for file in tmp_path.iterdir()] == ["a.npz"]


def test_no_playwright_is_said_clearly(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with pytest.raises(RenderError, match="pip install playwright"):
        render_png(planar_plan(), tmp_path / "a.png", t=0.0)


WRITE = """
import sys, psutil
from support.replay_plans import planar_plan
from selfmotion.shell.replay import write_replay
write_replay(planar_plan(), sys.argv[1] + "/a.html")
me = psutil.Process()
assert me.children() == [] and me.net_connections() == [], "a process or port is left"
assert not {"meshcat", "zmq", "matplotlib", "playwright", "IPython"} & set(sys.modules)
"""


RENDER = """
import sys
from support.replay_plans import planar_plan
from selfmotion.shell.replay import render_gif
render_gif(planar_plan(), sys.argv[1] + "/a.gif", frames_per_second=100)
"""


ANSWERING = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
"""


def start(script, folder, temporary):
    environment = {**os.environ, "PYTHONPATH": str(TESTS), "TMPDIR": str(temporary)}
    return subprocess.Popen(
        # Workers of a parallel test run ignore Ctrl-C, and so would what they start.
        [sys.executable, "-c", ANSWERING + script, str(folder)],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.05)


def test_writing_leaves_no_process_port_or_heavy_import(tmp_path):
    process = start(WRITE, tmp_path, tmp_path)
    _, complaints = process.communicate(timeout=60)
    assert process.returncode == 0, complaints
    assert [file.name for file in tmp_path.iterdir()] == ["a.html"]


@pytest.fixture
def short_folder():
    """Chromium's sockets need a path of fewer than 108 characters, which tmp_path's is not."""
    with tempfile.TemporaryDirectory(prefix="replay") as folder:
        yield Path(folder)


@pytest.mark.site
@needs_browser
def test_an_interrupted_picture_leaves_nothing(short_folder):
    folder, temporary = short_folder / "out", short_folder / "tmp"
    folder.mkdir()
    temporary.mkdir()
    process = start(RENDER, folder, temporary)
    try:
        started = psutil.Process(process.pid)
        wait_until(lambda: len(started.children(recursive=True)) > 3)
        offspring = started.children(recursive=True)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        assert process.returncode != 0
        assert psutil.wait_procs(offspring, timeout=10)[1] == []
    finally:
        process.kill()
        process.communicate()
    assert list(folder.iterdir()) == []
    assert list(temporary.iterdir()) == []


def test_the_figure_draws_what_was_planned():
    plan = arm_plan("panda")
    drawing = figure(plan)
    positions, velocities, manipulability, errors = drawing.axes
    curves = [line for line in positions.get_lines() if line.get_linestyle() == "-"]
    limits = [line for line in positions.get_lines() if line.get_linestyle() == "--"]
    assert [line.get_label() for line in curves] == list(plan.robot.joint_names)
    # Those in sight, and no others.
    low, high = positions.get_ylim()
    bounds = [*plan.robot.lower, *plan.robot.upper]
    seen = [limit for limit in bounds if low <= limit <= high]
    assert sorted(line.get_ydata()[0] for line in limits) == sorted(seen)
    assert len(seen) >= 1
    t = np.asarray(curves[2].get_xdata())
    np.testing.assert_allclose(curves[2].get_ydata(), plan.trajectory(t)[:, 2])
    assert len(velocities.get_lines()) >= 7
    assert len(manipulability.get_lines()) == 2
    assert errors.get_yscale() == "log"
    assert plan.certificate.summary in drawing.get_suptitle().replace("\n", " ")


def test_a_figure_cuts_nothing_off_and_covers_no_curve():
    """The title within the figure, legends beside the curves, a name for dashed lines."""
    drawing = figure(arm_plan("panda"))
    drawing.draw_without_rendering()
    (title,) = [text for text in drawing.texts if text.get_text() == drawing.get_suptitle()]
    extent, whole = title.get_window_extent(), drawing.bbox
    assert whole.x0 <= extent.x0 < extent.x1 <= whole.x1
    plots = [axes.get_window_extent() for axes in drawing.axes]
    of_plots = [axes.get_legend() for axes in drawing.axes if axes.get_legend() is not None]
    (joints,) = drawing.legends
    legends = [joints, *of_plots]
    assert len(legends) == 3
    for legend in legends:
        box = legend.get_window_extent()
        assert whole.x0 <= box.x0 < box.x1 <= whole.x1
        assert not any(box.overlaps(other) for other in (*plots, extent))
    names = [text.get_text() for text in joints.get_texts()]
    assert names[-1] == "limit"
    assert len(names) == len(set(names)) == 8
