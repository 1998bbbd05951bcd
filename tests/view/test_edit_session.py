"""Sessions: the plan that is shown last is that of the saved document; what stops it is told."""

import json

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import FileFormatError, PlanError, ProblemError, RobotError
from selfmotion.model.task import SE3
from selfmotion.shell.view import EditSession
from selfmotion.shell.view.motions import standing
from selfmotion.shell.view.planning import Planning
from selfmotion.shell.view.requests import NewerRequest, Outcome, Request
from selfmotion.shop.controllers import check_arm
from support.views import CIRCLE, Heard, moved, opened


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    file = tmp_path_factory.mktemp("view") / "circle.toml"
    file.write_text(CIRCLE)
    with opened(file) as session:
        yield Heard(session)


def last(page):
    """Return the plan that is shown, when nothing is left to be planned."""
    page.answer(page.session._revision)
    return page.session.found.plan


def planned(file):
    """Return what `selfmotion plan` makes of a file."""
    job = sm.files.read_job(file)
    return sm.plan(job.problem, **job.settings)


@pytest.mark.site
@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("path", moved(x=0.02, z=0.01)),
        ("base", moved(y=-0.03)),
        ("post", moved(x=0.05, y=0.1)),
    ],
)
def test_the_plan_shown_last_is_that_of_the_saved_document(page, name, by):
    for _ in range(4):
        page.drag(name, by, final=False)
    page.drag(name, by)
    shown = last(page)
    assert shown.certificate.verified
    page.session.answer({"do": "save"})
    again = planned(page.session.edited.file)
    assert again.certificate.verified
    np.testing.assert_array_equal(shown.trajectory.q, again.trajectory.q)
    np.testing.assert_array_equal(shown.trajectory.t, again.trajectory.t)
    assert shown.report.cost == again.report.cost


def test_sliders_set_what_is_planned(page):
    page.session.answer({"do": "slide", "name": "duration", "value": 6.0, "final": True})
    assert last(page).trajectory.duration == pytest.approx(6.0)
    assert page.messages[-1]["undo"]
    page.session.answer({"do": "undo"})
    assert last(page).trajectory.duration == pytest.approx(4.0)


def test_each_body_has_a_distance_of_its_own(page):
    """Larger than the arm's own links can keep."""
    slider = next(
        one for one in page.messages[-1]["sliders"] if one["name"] == "clearance from post"
    )
    assert (slider["value"], slider["unit"]) == (5.0, "mm")
    page.session.answer(
        {"do": "slide", "name": "clearance from post", "value": 40.0, "final": True}
    )
    shown = last(page)
    assert shown.certificate.verified
    assert shown.approaches["post"].value >= 0.04
    assert shown.approaches["the arm itself"].value < 0.04
    document = page.session.edited.document["clearance"]
    assert (document["distance_mm"], document["obstacles"][0]["distance_mm"]) == (5, 40.0)
    page.session.answer({"do": "undo"})
    last(page)


def test_what_stops_a_plan_is_told_and_drawn_and_the_next_one_follows(page):
    page.drag("path", moved(x=3.0))
    found = page.answer(page.session._revision)
    assert found["kind"] == "none"
    assert found["words"].startswith("not verified: ")
    assert "no configuration" in found["words"]
    assert found["stopped"][0]["path"].endswith("/stopped/path0")
    # The arm stands there, and what it has to follow is drawn where it is.
    assert not found["plans"][0]["verified"]
    page.session.answer({"do": "undo"})
    assert last(page).certificate.verified
    assert "stopped" not in page.messages[-1]


@pytest.mark.site
def test_places_in_reach_are_told_while_something_is_chosen(page):
    """They are those of the document that is shown: a path that is lifted has others."""

    def are_all_there(found):
        placements = page.session.found.placements
        return (
            found["number"] == page.session._revision
            and "floor" in found
            and placements is not None
            and placements.is_done
        )

    def places():
        page.until(are_all_there)
        return page.session.found.placements

    def dragged(by, *, final=False):
        page.drag("path", by, final=final)
        return places()

    before = dragged(moved(x=0.02, y=0.01))
    same = dragged(moved(y=-0.03))
    np.testing.assert_allclose(same.positions, before.positions, atol=1e-6)
    np.testing.assert_array_equal(same.is_reachable, before.is_reachable)
    lifted = dragged(moved(z=0.3))
    assert lifted.is_reachable.sum() < before.is_reachable.sum()
    # They stay when it is let go, also where it is out of reach.
    dragged(moved(z=-0.3), final=True)
    away = dragged(moved(x=3.0), final=True)
    assert page.messages[-1]["kind"] == "none"
    assert away.is_reachable.any()
    page.session.answer({"do": "undo"})
    places()
    # Tools and posts stand wherever they are put.
    page.drag("post", moved(x=0.01), final=False)
    last(page)
    assert "floor" not in page.messages[-1]
    page.drag("post", moved(x=-0.01))
    # What is chosen has them before it is dragged; of what is let go there are none.
    shown = last(page)
    page.session.answer({"do": "choose", "name": "path"})
    places()
    page.session.answer({"do": "choose", "name": ""})
    assert last(page) is shown
    assert "floor" not in page.messages[-1]


def test_a_coarse_motion_comes_first_and_says_that_it_is_none(page):
    count = len(page.messages)
    page.drag("path", moved(y=0.01))
    last(page)
    kinds = [message["kind"] for message in page.messages[count:]]
    assert kinds[0] == "coarse"
    assert "whole" in kinds
    first = page.messages[count]
    assert first["words"].startswith("planning")
    assert not first["plans"][0]["verified"]


def test_a_drag_ends_with_its_last_request(page):
    for _ in range(10):
        page.drag("path", moved(y=0.002), final=False)
    page.drag("path", moved(y=-0.02))
    number = page.session._revision
    assert page.answer(number)["number"] == number
    assert not any(
        one["number"] > other["number"]
        for one, other in zip(page.messages, page.messages[1:], strict=False)
    )


def test_what_cannot_be_asked_is_refused_and_changes_nothing(page):
    before = page.session.edited.document
    for asked, said in (
        (5, "expected a table"),
        ({"do": "shout"}, "expected drag, choose, slide, undo or save"),
        ({"do": "drag", "name": "roof"}, "there is no 'roof' in this document, which has path"),
        ({"do": "slide", "name": "roof"}, "which has duration, clearance"),
        ({"do": "slide", "name": "duration", "value": "4"}, "expected a number"),
        ({"do": "slide", "name": "duration", "value": float("nan")}, "expected 0.5 to 32"),
        ({"do": "slide", "name": "clearance", "value": 1e9}, "expected 0 to 100"),
        ({"do": "drag", "name": "post", "matrix": [1.0] * 16}, "expected that of a pose"),
        ({"do": "drag", "name": "post", "matrix": [1.0] * 3}, "expected 16 numbers"),
        ({"do": "drag", "name": "post", "matrix": "abc"}, "expected 16 numbers"),
    ):
        with pytest.raises(ProblemError, match=said):
            page.session.answer(asked)
    assert page.session.edited.document == before


def test_numbers_too_large_for_a_float_are_refused(page):
    for asked, said in (
        ({"do": "slide", "name": "duration", "value": 10**400}, "expected 0.5 to 32"),
        ({"do": "drag", "name": "post", "matrix": [10**400] * 16}, "expected 16 numbers"),
    ):
        with pytest.raises(ProblemError, match=said):
            page.session.answer(asked)


def test_what_is_refused_is_answered_by_the_plan_of_what_is(page):
    last(page)
    page.session.answer({"do": "slide", "name": "duration", "value": 5.0, "mark": 1})
    with pytest.raises(ProblemError):
        page.session.answer({"do": "drag", "name": "roof", "mark": 2})
    assert page.until(lambda found: found["kind"] == "whole" and not found["brief"])["answers"] == 2
    with pytest.raises(ProblemError):
        page.session.answer({"do": "drag", "name": "roof", "mark": 3})
    assert page.until(lambda found: found["answers"] == 3)["kind"] == "whole"


def test_a_page_that_comes_while_a_plan_is_made_is_told_that_it_is(tmp_path):
    file = tmp_path / "circle.toml"
    file.write_text(CIRCLE)
    with opened(file) as session:
        asked = {"do": "slide", "name": "duration", "value": 5.0, "final": True, "mark": 7}
        Heard(session).session.answer(asked)
        session.detach()
        page = Heard(session)
        page.answer(1)
        # Whatever was shown of the document before answered nothing that this page asks.
        assert {found["answers"] for found in page.messages if found["number"] == 0} <= {-1}
        assert {found["answers"] for found in page.messages if found["number"] == 1} == {0}
        numbers = [found["number"] for found in page.messages]
        assert numbers == sorted(numbers)


@pytest.mark.parametrize("said", ["costs = 5", "relaxations = [1]", 'constraints = ["x"]'])
def test_a_file_that_is_no_problem_is_told_at_once(tmp_path, said):
    file = tmp_path / "circle.toml"
    file.write_text(f"{said}\n" + CIRCLE.replace("[[costs]]", "[other]"))
    with pytest.raises((FileFormatError, ProblemError), match=said.split()[0]):
        EditSession(file)


def test_a_verified_plan_is_exported(page, tmp_path):
    last(page)
    for suffix in (".csv", ".npz", ".yaml"):
        file = tmp_path / f"a{suffix}"
        file.write_bytes(page.session.export(suffix))
        if suffix == ".npz":
            assert sm.load_plan(file).trajectory.digest == last(page).trajectory.digest
    with pytest.raises(ProblemError, match="expected one of"):
        page.session.export(".exe")
    page.drag("path", moved(x=3.0))
    with pytest.raises(PlanError, match=r"is being planned|nothing is exported"):
        page.session.export(".csv")
    page.answer(page.session._revision)
    with pytest.raises(PlanError, match="nothing is exported until it is verified"):
        page.session.export(".csv")
    page.session.answer({"do": "undo"})
    last(page)


def test_controllers_that_have_no_such_arm_are_not_offered(page):
    """A Panda has seven joints in the arm itself: neither UR nor KUKA has programs for it."""
    last(page)
    offered = set(page.session.exports)
    assert {".npz", ".csv", ".yaml", ".mod"} <= offered
    assert not {".script", ".src"} & offered


def test_controllers_that_have_such_an_arm_are_offered():
    ur10, settings = sm.load_robot("ur10"), sm.files.ProgramSettings()
    for controller in ("urscript", "krl", "rapid"):
        check_arm(ur10, controller, settings)


def test_one_page_at_a_time(page):
    assert not page.session.attach(lambda _: None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('task = "pose"\n', "robot: is missing"),
        (CIRCLE.replace("panda", "pandora"), "unknown robot 'pandora'"),
        ("task = ", "circle.toml"),
        (f'goal = "fastest"\n{CIRCLE}', "expected best or retimed"),
    ],
)
def test_what_is_no_problem_is_told_at_once(tmp_path, text, said):
    file = tmp_path / "circle.toml"
    file.write_text(text)
    with pytest.raises((FileFormatError, ProblemError), match=said):
        EditSession(file)


def test_a_problem_without_a_motion_has_a_page_to_change_it_on(tmp_path):
    file = tmp_path / "far.toml"
    file.write_text(CIRCLE.replace("[0.5, 0, 0.5]", "[3.5, 0, 0.5]"))
    with opened(file) as session:
        page = Heard(session)
        assert page.messages[-1]["kind"] == "none"
        page.drag("path", moved(x=-3.0))
        assert last(page).certificate.verified


def test_an_arm_without_a_home_stands_in_the_middle_of_its_limits():
    """Where it has no motion to show; nobody knows where else such an arm is."""
    arm = sm.load_robot("planar_3r")
    with pytest.raises(RobotError):
        _ = arm.home
    path = sm.paths.Line(SE3.Identity(), SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), 1.0)
    found = standing(sm.Problem(arm, path, "planar"), None, "nowhere")
    assert not found.certificate.verified
    np.testing.assert_allclose(found.trajectory.q, 0.5 * np.tile(arm.lower + arm.upper, (2, 1)))


def test_a_fault_of_the_program_ends_no_session(monkeypatch, tmp_path, capsys):
    file = tmp_path / "circle.toml"
    file.write_text(CIRCLE)
    with opened(file) as session:
        page = Heard(session)

        def broken(*_, **__):
            raise ZeroDivisionError("by zero")

        with monkeypatch.context() as patched:
            patched.setattr("selfmotion.shell.view.planning.plan", broken)
            page.drag("post", moved(x=0.01))
            found = page.answer(session._revision)
        assert "a fault of the program: by zero" in found["words"]
        assert "ZeroDivisionError" in capsys.readouterr().err
        page.drag("post", moved(x=0.01))
        assert last(page).certificate.verified


def test_a_plan_that_nobody_waits_for_is_left(tmp_path):
    """A newer request ends the one before, between two evaluations."""
    file = tmp_path / "circle.toml"
    file.write_text(CIRCLE)
    document = sm.basics.read_document(file)
    found: list[Outcome] = []
    planning = Planning(file, False, found.append)
    newer = Request(2, document)

    def take(one: Outcome) -> None:
        found.append(one)
        if one.kind == "coarse":
            planning.ask(newer)

    planning.answer(Request(0, document))
    planning._tell = take
    with pytest.raises(NewerRequest):
        planning.answer(Request(1, {**document, "task": "position"}))
    assert [one.request.number for one in found if one.kind == "whole"] == [0]


def test_messages_are_json_that_browsers_read(page):
    text = json.dumps(page.messages[-1], allow_nan=False)
    assert text
