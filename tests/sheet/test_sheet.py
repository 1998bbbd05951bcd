"""Process sheets: each number is of the certificate, the report or the margins."""

import dataclasses
import datetime
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import in_length
from selfmotion.shell.sheet.tables import plan_sections
from support.arms import robot_named
from support.replay_plans import two_seams
from support.shell import complaint, invoke


class Cells(HTMLParser):
    """The rows of all tables of a page, by the heading above them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self._tag, self._title, self.outside = "", "", []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self._tag = tag
        if tag == "tr":
            self.tables[self._title].append([])
        if tag in ("td", "th"):
            self.tables[self._title][-1].append("")
        self.outside += [value for key, value in attrs if key in ("src", "href")]  # type: ignore[attr-defined]

    def handle_endtag(self, tag: str) -> None:
        self._tag = ""

    def handle_data(self, data: str) -> None:
        if self._tag == "h2":
            self._title = data
            self.tables[data] = []
        if self._tag in ("td", "th"):
            self.tables[self._title][-1][-1] += data


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    """A motion with a body near it, whose joints reach a limit of their speed."""
    robot = robot_named("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(robot.pose(start), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    block = sm.obstacles.Box(
        "<block>", robot.pose(start).translation - np.array([0, 0, 0.15]), [0.2, 0.2, 0.02]
    )
    constraints = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    ]
    apart = sm.constraints.Clearance([block], 5e-3)
    problem = sm.Problem(robot, circle, start=start, constraints=constraints, clearance=apart)
    return sm.plan(problem).require()


def test_numbers_are_those_of_certificate_report_and_margins(plan: sm.Plan, tmp_path: Path) -> None:
    margins = sm.margin(plan, sm.Tolerance(1e-3, 0.1))
    page = sm.files.write_sheet(plan, tmp_path / "sheet.html", margins).read_text()
    cells, check = Cells(page), plan.certificate
    assert not cells.outside
    assert check.verdict.split(":")[0] in page
    path = {row[0]: row for row in cells.tables["Path, at all times"][1:]}
    assert path["position error"][1] == in_length(check.position_error.value, 4)
    near = {row[0]: row for row in cells.tables["Closest approaches"][1:]}
    for name, found in plan.approaches.items():
        assert near[f"closest to {name}"][1] == in_length(found.value, 4)
    turned = cells.tables["Joint reversals"][1:]
    assert sum(int(row[1]) for row in turned if row[1]) == plan.reversals.count
    wide = cells.tables["How far it may be off while the program runs unchanged"][1:]
    assert len(wide) == 9
    assert wide[0][1] == margins.part.translation.size
    kept = cells.tables["Requirements, at all times"][1:]
    assert len(kept) == len([item for item in check.findings if item.requirement != "feed"])
    assert {row[-1] for row in kept} == {"kept"}
    active = cells.tables.get("Active constraints", [[]])[1:]
    assert len(active) == len(plan.report.active)
    assert "the arm is built as its URDF draws it" in page


def test_times_stay_with_their_units(plan: sm.Plan, tmp_path: Path) -> None:
    text = sm.files.write_sheet(plan, tmp_path / "sheet.html").read_text()
    times = re.findall(r"<td([^>]*)>[\d.]+ s</td>", text)
    assert times
    assert set(times) == {' class="whole"'}


def test_what_is_not_kept_is_said(plan: sm.Plan, tmp_path: Path) -> None:
    broken = dataclasses.replace(plan, certificate=plan.check(sm.Tolerance(1e-15, 1e-15)))
    page = sm.files.write_sheet(broken, tmp_path / "sheet.html").read_text()
    assert 'class="refused"' in page
    assert "off the path" in page
    titles = [section.title for section in plan_sections(broken, None)]
    assert not any("runs unchanged" in title for title in titles)


def test_feeds_are_asked_and_reached(tmp_path: Path) -> None:
    robot = robot_named("panda")
    pose = robot.pose(np.array(sm.NAMED_ARMS["panda"].home))
    end = pose.copy()
    end.translation = pose.translation + np.array([0.0, 0.1, 0.0])
    line = sm.paths.Line(pose, end, 3.0)
    plan = sm.plan(sm.Problem(robot, sm.paths.Feed(line, 0.02), "position"))
    (feed,) = plan.path.feeds
    cells = Cells(sm.files.write_sheet(plan, tmp_path / "sheet.html", title="a & b").read_text())
    (row,) = cells.tables["Feeds"][1:]
    assert float(row[1].split()[0]) == 0.02
    assert float(row[2].split()[0]) == pytest.approx(feed.reached, rel=1e-3)


def test_what_is_no_sheet_is_refused(plan: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected a Plan"):
        sm.files.write_sheet(None, tmp_path / "a.html")  # type: ignore[arg-type]
    with pytest.raises(sm.errors.ProblemError, match=r"expected a datetime\.date"):
        sm.files.write_sheet(plan, tmp_path / "a.html", date="today")  # type: ignore[arg-type]
    with pytest.raises(sm.errors.ProblemError, match=re.escape("ends in .html")):
        sm.files.write_sheet(plan, tmp_path / "a.pdf")
    with pytest.raises(sm.errors.ProblemError, match="expected Margins"):
        sm.files.write_sheet(plan, tmp_path / "a.html", 3)  # type: ignore[arg-type]
    moved = dataclasses.replace(plan.trajectory, t=plan.trajectory.t * 2.0)
    other = dataclasses.replace(plan, trajectory=moved)
    with pytest.raises(sm.errors.PlanError, match="of another motion"):
        sm.files.write_sheet(other, tmp_path / "a.html")


def test_sheets_from_the_shell(plan: sm.Plan, tmp_path: Path) -> None:
    file, page = tmp_path / "plan.npz", tmp_path / "sheet.html"
    plan.save(file)
    code, told = invoke("sheet", file, "-o", page, "--title", "cell 3")
    assert code == 0, told
    assert "<h1>cell 3</h1>" in page.read_text()
    assert "&lt;block&gt;" in page.read_text()
    assert "together" in complaint("sheet", file, "--turn", "0.1")


def test_of_a_program_seams_events_and_moves_are_told(tmp_path: Path) -> None:
    made = two_seams()
    steps = [
        dataclasses.replace(step, events=(("arc on", 0.0), ("arc off", step.duration)))
        if step.is_seam
        else step
        for step in made.steps
    ]
    program = dataclasses.replace(made, steps=tuple(steps))
    first = program.order[0]
    margins = {first: sm.margin(program.plans[first])}
    page = sm.files.write_sheet(
        program,
        tmp_path / "sheet.html",
        margins,
        part_number="47<11",
        order_number="8",
        date=datetime.date(2026, 1, 2),
    ).read_text()
    assert "part 47&lt;11 · order 8 · date 2026-01-02" in page
    assert page.count("<svg") == 1
    assert "signature" in page
    tables = Cells(page).tables
    seams = tables["Seams, in their order"][1:]
    assert len(seams) == len(program.order)
    begins = [at for at, step in zip(program.begins, program.steps, strict=True) if step.is_seam]
    for row, name, begin in zip(seams, program.order, begins, strict=True):
        assert row[0].startswith(name)
        assert float(row[1].split()[0]) == pytest.approx(begin, abs=1e-3)
    assert [(row[1], row[2]) for row in tables["Events"][1:]] == [
        (name, event) for _, name, event in program.events
    ]
    moved = tables["Moves and waits"][1:]
    assert [row[0] for row in moved] == [step.name for step in program.steps if not step.is_seam]
    assert {row[-1] for row in moved} == {"kept"}
    kept = tables["Requirements, at all times of each seam"][1:]
    assert {row[0] for row in kept} == set(program.order)
    wide = tables[f"Seam '{first}': How far it may be off while the program runs unchanged"][1:]
    assert wide[0][1] == margins[first].part.translation.size


def test_margins_of_programs_are_of_their_seams(plan: sm.Plan, tmp_path: Path) -> None:
    program, page = two_seams(), tmp_path / "a.html"
    first, second = program.order
    other = sm.margin(program.plans[second])
    with pytest.raises(sm.errors.PlanError, match=f"expected one of: {first}, {second}"):
        sm.files.write_sheet(program, page, {"none": other})
    with pytest.raises(sm.errors.PlanError, match="of another motion"):
        sm.files.write_sheet(program, page, {first: other})
    with pytest.raises(sm.errors.ProblemError, match="of each seam by its name"):
        sm.files.write_sheet(program, page, other)
    with pytest.raises(sm.errors.ProblemError, match="expected Margins"):
        sm.files.write_sheet(program, page, {first: 3})  # type: ignore[dict-item]
    with pytest.raises(sm.errors.ProblemError, match="expected Margins"):
        sm.files.write_sheet(plan, page, {first: other})
    assert not page.exists()


def test_a_program_without_a_move_has_a_sheet_that_says_so(tmp_path: Path) -> None:
    made = two_seams()
    lost = [
        step if step.is_seam else dataclasses.replace(step, made=_not_found(step.made))
        for step in made.steps
    ]
    program = dataclasses.replace(made, steps=tuple(lost))
    page = sm.files.write_sheet(program, tmp_path / "sheet.html").read_text()
    assert 'class="refused"' in page
    assert "<svg" not in page
    moved = Cells(page).tables["Moves and waits"][1:]
    assert all(row[-1].startswith("NOT KEPT") for row in moved)


def _not_found(made: sm.Plan | sm.Move) -> sm.Move:
    assert isinstance(made, sm.Move)
    return dataclasses.replace(made, trajectory=None)


def test_sheets_of_programs_from_the_shell(tmp_path: Path) -> None:
    file, page = tmp_path / "two.program", tmp_path / "sheet.html"
    two_seams().save(file)
    code, told = invoke("sheet", file, "-o", page, "--number", "part=47", "--number", "order=8")
    assert code == 0, told
    text = page.read_text()
    assert "part 47 · order 8" in text
    assert "How far it may be off" in text
