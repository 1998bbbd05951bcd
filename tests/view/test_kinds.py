"""Jobs, plans and programs on the page: what is planned, what is saved, what is only shown."""

import contextlib
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import FileFormatError, PlanError, ProblemError
from selfmotion.model.task import SE3
from selfmotion.shell.view import PageSession, opened as open_page
from selfmotion.shell.view.document import is_job
from selfmotion.shell.view.handles import dragged, handles_of
from support.views import CIRCLE, Heard, moved, opened

# Two seams of an arm that moves in a plane, without a home: planned soon.
JOB = """\
# two seams
task = "planar"
clearance = false

[robot]
name = "planar_3r"

[workpiece]
frame = { position = [0.6, 0.0, 0.0] }

[job]
order = "given"
branches = 1

[[seams]]
name = "left"
either_way = false
path = { kind = "line", start = { position = [0, 0.4, 0] }, by = [0.1, 0, 0], feed = 0.1 }

[[seams]]
name = "right"
either_way = false
path = { kind = "line", start = { position = [0, -0.4, 0] }, by = [0.1, 0, 0], feed_mm = 100 }
"""
PLANNED = ("whole", "none")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    file = tmp_path_factory.mktemp("job") / "job.toml"
    file.write_text(JOB)
    with opened(file) as session:
        yield Heard(session)


def planned(page):
    """Return the message of what is planned in the end."""
    number = page.session._revision
    return page.until(lambda found: found["number"] == number and found["kind"] in PLANNED)


def test_a_job_is_planned_while_its_part_is_dragged(page):
    """The one shown last is the program of the saved document, whichever way led to it."""
    count = len(page.messages)
    page.drag("part", moved(x=0.02), final=False)
    page.drag("part", moved(x=0.03, y=0.01))
    found = planned(page)
    kinds = [one["kind"] for one in page.messages[count:] if one["number"] == found["number"]]
    assert kinds[0] == "coarse"
    assert page.session.found.verified
    page.session.answer({"do": "save"})
    again = sm.files.read_seam_job(page.session.file).plan()
    shown = page.session.found.made
    assert shown.order == again.order == ("left", "right")
    np.testing.assert_array_equal(shown.trajectory.q, again.trajectory.q)
    np.testing.assert_array_equal(shown.trajectory.t, again.trajectory.t)
    assert page.session.file.read_text().startswith("# two seams\n")


def test_the_page_of_a_job_has_its_seams_and_moves(page):
    found = page.until(lambda found: found["kind"] == "whole" and not found["brief"])
    steps = found["plans"][0]["steps"]
    assert [step["name"] for step in steps] == ["left", "left → right", "right"]
    assert {slider["name"] for slider in found["sliders"]} == {"feed of left", "feed of right"}
    assert {handle["name"] for handle in found["handles"]} == {"part", "base", "tool"}


def test_each_seam_has_its_feed(page):
    page.session.answer({"do": "slide", "name": "feed of right", "value": 160.0, "final": True})
    seams = page.session.edited.document["seams"]
    assert [seam["path"].get("feed_mm") for seam in seams] == [None, 160.0]
    page.session.answer({"do": "undo"})
    planned(page)


def test_what_stops_a_job_is_told_and_its_seams_are_red(page, monkeypatch):
    def refuse(*_, **__):
        raise PlanError("'left': no configuration")

    with monkeypatch.context() as patched:
        patched.setattr("selfmotion.shell.documents.SeamJob.plan", refuse)
        page.drag("part", moved(x=3.0))
        found = planned(page)
    assert found["kind"] == "none"
    assert found["words"] == "not verified: 'left': no configuration"
    ends = {command["path"].rsplit("/", 1)[1] for command in found["stopped"]}
    assert ends == {"path0", "path1", "end"}
    with pytest.raises(PlanError, match="nothing is exported until it is verified"):
        page.session.export(".program")
    page.session.answer({"do": "undo"})
    planned(page)


def test_a_program_is_shown_as_it_is(page, tmp_path):
    file = tmp_path / "job.program"
    file.write_bytes(page.session.export(".program"))
    session = open_page(file)
    assert type(session) is PageSession
    shown = Heard(session).messages[-1]
    assert shown["words"] == page.session.found.words
    assert shown["handles"] == shown["sliders"] == []
    with pytest.raises(ProblemError, match="`selfmotion view` changes its job file"):
        session.answer({"do": "undo"})
    assert session.export(".csv") == page.session.export(".csv")


def test_a_seam_without_a_part_is_dragged_itself():
    document = tomllib.loads(JOB)
    del document["workpiece"]
    robot = sm.load_robot("panda")
    path = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), 1.0)
    problem = sm.Problem(robot, path, "position")
    assert set(handles_of(document, problem)) == {"left", "right", "base", "tool"}
    handle = handles_of(document, problem)["left"]
    values = dragged(document, handle, SE3(np.eye(3), np.array([0.5, 0.0, 0.45])))
    assert values == {("seams", 0, "path", "start"): {"position": [0.5, 0.0, 0.45]}}


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    (folder / "circle.toml").write_text(CIRCLE)
    job = sm.files.read_job(folder / "circle.toml")
    return sm.plan(job.problem, **job.settings)


def test_a_plan_is_shown_as_it_is_changed_and_saved_with_its_problem(plan, tmp_path):
    file = tmp_path / "circle.npz"
    plan.save(file)
    with opened(file) as session:
        page = Heard(session)
        assert not is_job(session.edited.document)
        np.testing.assert_array_equal(session.found.plan.trajectory.q, plan.trajectory.q)
        page.drag("post", moved(x=0.02))
        planned(page)
        shown = session.found.plan
        assert session.answer({"do": "save"})["saved"].startswith("Saved circle.npz: the plan")
        again = sm.load_plan(file)
        np.testing.assert_array_equal(again.trajectory.q, shown.trajectory.q)
        assert again.obstacles[0].pose.translation[0] == pytest.approx(0.32)
        # Back at what was opened, that is shown, not planned again.
        session.answer({"do": "undo"})
        planned(page)
        np.testing.assert_array_equal(session.found.plan.trajectory.q, plan.trajectory.q)


@pytest.mark.site
def test_a_second_plan_is_shown_beside(page, plan, tmp_path):
    """Its numbers stand beside the own ones, its arm is the ghost; what is no plan is refused."""
    file = tmp_path / "circle.npz"
    plan.save(file)
    data = file.read_bytes()
    session = open_page(file)
    with contextlib.closing(session):
        shown = Heard(session)
        other = sm.plan(replace(plan.problem, costs=(sm.costs.InverseManipulability(1.0),)))
        other.save(tmp_path / "other.npz")
        session.show_beside("other.npz", (tmp_path / "other.npz").read_bytes())
        found = shown.messages[-1]
        assert found["beside"] == "other.npz"
        costs = next(row["cells"] for row in found["table"] if row["label"] == "cost")
        own, beside = (float(value) for value, _ in costs)
        assert own == pytest.approx(plan.report.cost, rel=1e-5)
        assert beside == pytest.approx(other.evaluate(*plan.problem.costs), rel=1e-5)
        assert beside > own
        with pytest.raises(FileFormatError, match=r"^broken\.npz"):
            session.show_beside("broken.npz", b"no plan")
        session.show_beside("", b"")
        assert shown.messages[-1]["beside"] == ""
    with pytest.raises(ProblemError, match="here are several seams"):
        page.session.show_beside("circle.npz", data)
