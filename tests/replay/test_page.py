"""The page as text: one file, the same each time, nothing from outside, written whole or not."""

import base64
import hashlib
import html
import re

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import FileFormatError, ProblemError
from selfmotion.shell.replay import notebook_html, replay_html, write_replay
from support.replay_plans import arm_plan, planar_plan


@pytest.fixture(scope="module")
def page():
    return replay_html(planar_plan())


def test_the_same_plan_makes_the_same_bytes(page):
    assert replay_html(planar_plan()) == page
    assert replay_html(planar_plan(mu=30.0)) != page


def test_a_page_refers_to_nothing_outside(page):
    script = page[: page.index('id="viewer"')]
    assert not re.search(r'(?:src|href|action)\s*=\s*"(?!data:)', script)
    assert "http" not in script.replace("http-equiv", "")


def test_the_policy_names_the_very_scripts(page):
    policy = html.unescape(re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1])
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-eval" not in policy
    assert "'unsafe-inline'" not in policy.split("style-src")[0]
    script = re.search(r'<script type="module">(.*?)</script>', page, re.S)[1]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in policy


def test_a_shared_file_explains_itself(page):
    assert "<title>planar_3r, planar task</title>" in page
    description = re.search(r'name="description" content="([^"]*)"', page)[1]
    assert "3 joints follow a tool motion of 2 s" in description
    assert " % below that of the minimum-norm motion" in description
    assert "verified" in description


def test_a_title_is_text_not_markup():
    page = replay_html(planar_plan(), title="<img src=x> & $payload")
    assert "<title>&lt;img src=x&gt; &amp; $payload</title>" in page


def test_writing_leaves_one_file(tmp_path, page):
    file = write_replay(planar_plan(), tmp_path / "a.html")
    assert file.read_text(encoding="utf-8") == page
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("kind", "seen"), [(OSError, FileFormatError), (KeyboardInterrupt, KeyboardInterrupt)]
)
def test_an_interrupted_write_leaves_the_old_file(tmp_path, monkeypatch, kind, seen):
    file = tmp_path / "a.html"
    file.write_text("old")

    def interrupted(*_):
        raise kind

    monkeypatch.setattr("os.replace", interrupted)
    with pytest.raises(seen):
        write_replay(planar_plan(), file)
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_panda_fits_in_a_mail(tmp_path):
    assert write_replay(arm_plan("panda"), tmp_path / "a.html").stat().st_size < 2.5e6


def test_a_notebook_gets_the_page_in_a_frame():
    plan = planar_plan()
    frame = notebook_html(plan)
    assert frame.startswith("<iframe srcdoc=")
    inside = re.search(r'srcdoc="([^"]*)"', frame)[1]
    assert html.unescape(inside) == replay_html(plan)


def test_refusals_name_what_is_wrong():
    plan = planar_plan()
    with pytest.raises(ProblemError, match="at least one plan"):
        replay_html([])
    with pytest.raises(ProblemError, match="'planar_3r' and 'panda'"):
        replay_html([plan, arm_plan("panda")])
    with pytest.raises(ProblemError, match="1 labels for 2 plans"):
        replay_html([plan, plan], labels=["a"])
    for wrong, said in (
        ({"labels": [1]}, "labels: 1, expected a text"),
        ({"triads": -1}, "triads"),
    ):
        with pytest.raises(ProblemError, match=said):
            replay_html(plan, **wrong)
    for none in (5, [5]):
        with pytest.raises(ProblemError, match="a replay is of 5, expected plans"):
            replay_html(none)


def test_triads_at_chosen_times():
    plan = planar_plan()
    at_times = replay_html(plan, triads=np.array([0.0, 0.5]))
    assert at_times == replay_html(plan, triads=[0.0, 0.5])
    assert at_times != replay_html(plan, triads=[0.0, 0.7])
    # Of a whole none, unless they are asked for.
    move = sm.Move(plan.robot, (), plan.trajectory)
    assert replay_html(move) == replay_html(move, triads=0) != replay_html(move, triads=3)
